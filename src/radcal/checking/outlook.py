"""Outlook on a calibration without a run: contrast of the start image, ground, levels and noise.

The model of the assessment tells what the image before registration says of fixed materials and of bounds of X.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.conclusion import image_findings
from radcal.assessment.model import image_of
from radcal.assessment.observation import observe
from radcal.config import Case, FileMeasurement, Material, SyntheticMeasurement
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, MeasurementError
from radcal.findings import Finding, of_pass
from radcal.ground.levels import Levels
from radcal.ground.pixels import (
    IN_THE_NOISE,
    MANY_IN_NOISE,
    eligible_pixels,
    noise_limited,
    point_targets,
    share_in_noise,
)
from radcal.image.base import opened
from radcal.image.model import Measurement
from radcal.posterior.cells import CellMeans, Simulated
from radcal.posterior.curves import NORMAL_90
from radcal.posterior.fixed_laws import apart_db
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.registration.registered import LEAST_CONTRAST_DB, Registered, contrast_db
from radcal.scene.model import Scene
from radcal.sections.simulator import BuiltinSimulation
from radcal.simulators.builtin import BuiltinSimulator
from radcal.tables.landcover import brightest_db
from radcal.targets.reach import check_level

_MOST_HIDDEN, _STEEPEST_DEG = 0.5, 35.0  # more hidden ground and steeper slopes (median) are rare, even in mountains
_MIDDLE_DEG = 45.0  # incidence at which the gamma of a law is compared with those of terrain
_BRIGHTER_DB = 6.0  # the source of those adds 5 log10(f / 10 GHz) to gamma, at most 5 dB below 100 GHz
# units of heights that are taken for metres, with the factors that convert them to metres
_UNITS = {"feet": 0.3048, "decimetres": 0.1, "centimetres": 0.01}
_MOVED_PX = 2.0  # displacement for which the margin to other ground is widened before registration
_STEPS = 100  # of the sampler, of which the assessment makes more


def start_image(case: Case, geometry: Geometry) -> NDArray[np.float32]:
    """Expected image of the starting laws by the built-in simulator, with noise and without speckle [dB].

    Materials whose law has no curve are left out.
    """
    laws = {name: law for name, law in case.at_start.laws.items() if law.has_curve}
    return BuiltinSimulator(geometry, case.radar, laws).expected(case.start_parameters)


def _moved_px(case: Case, geometry: Geometry) -> NDArray[np.float32]:
    """Standard error of the image's place, by which the margin to other ground is widened [pixels]."""
    return np.full(geometry.shape, 0.0 if case.registration.method == "none" else _MOVED_PX, dtype=np.float32)


def cells_of(case: Case, geometry: Geometry, measured: Measurement, scene: Scene) -> dict[str, CellMeans]:
    """Cells of all materials in one pass, from the image before registration and the expected image at the start.

    Parameters
    ----------
    case : Case
        One pass of the case; for normalised images, which are not in dB, there are no cells.
    geometry : Geometry
        Geometry of the pass.
    measured : Measurement
        Measured image before registration.
    scene : Scene
        Scene, whose connected areas are the fields.
    """
    if case.target.normalisation == "image":
        return {}
    stage = STAGES["posterior"].of(case.at_start).model_copy(update={"simulator": BuiltinSimulation()})
    still, image = np.zeros((2, *geometry.shape), dtype=np.float32), measured.image_db
    registered = Registered(measured, image, still, _moved_px(case, geometry), 0.0, "none", False, "")
    simulated = Simulated(start_image(case, geometry), case.start_parameters)
    return observe(stage, geometry, registered, [simulated], Levels(), scene)


def fixed_laws(case: Case, cells: Sequence[Mapping[str, CellMeans]]) -> list[Finding]:
    """Findings on the images of all passes: level of each fixed material, then those of the assessment.

    Parameters
    ----------
    case : Case
        The case.
    cells : sequence of mapping
        Result of :func:`cells_of` for each pass, none of them empty.
    """
    steps = min(case.uncertainty.steps, _STEPS)
    short = case.model_copy(update={"uncertainty": case.uncertainty.model_copy(update={"steps": steps})})
    image = image_of(STAGES["posterior"].of(short), cells)
    levels = [
        one
        for number, (of, own) in enumerate(zip(case.passes, cells, strict=True), start=1)
        for one in of_pass([_level(of, x, own[x]) for x in case.reference_materials if x in own], number, len(cells))
    ]
    model = image_findings(STAGES["archive"].of(case), replace(image, sampled=True))
    return [*levels, *(one for one in model if one.code != "fixed_law_and_image")]  # which the level tells already


def _level(case: Case, name: str, cells: CellMeans) -> Finding:
    """Mean of image minus law over the cells of a fixed material, with the 90 % interval by speckle and fields.

    It is a warning where errors of the fixed law and of the image's level of the size that section ``uncertainty``
    gives do not explain it.
    """
    budget = case.uncertainty
    law_db = np.asarray(case.laws[name](np.radians(cells.incidence_deg), case.start_parameters[name]))
    low, apart, high = apart_db(cells, cells.above_db(law_db), budget.field_db).tolist()
    explained = np.hypot(0.5 * (high - low), NORMAL_90 * np.hypot(budget.fixed_law_db, budget.level_db))
    warned = case.target.normalisation == "none" and abs(apart) > explained
    numbers = {"apart_db": apart, "p05_db": low, "p95_db": high}
    return Finding("fixed_level", "warning" if warned else "note", name, numbers, f"materials.{name}.parameters")


def unreachable(case: Case, geometry: Geometry, measured: Measurement) -> list[ConfigError]:
    """Errors about bounds of X inside which a law cannot reach the measured level (:func:`.check_level`).

    Parameters
    ----------
    case, geometry, measured
        Arguments of :func:`cells_of`; where a level is removed, it is not known before the reference run.
    """
    found = list[ConfigError]()
    noise = np.broadcast_to(noise_floor_db(case.radar, geometry.flat_incidence_deg)[:, None], geometry.shape).ravel()
    for name, law in case.laws.items() if case.target.normalisation == "none" else ():
        if name not in case.calibrated or name not in geometry.names or not law.has_curve:
            continue
        try:
            pixels = eligible_pixels(name, geometry, measured, case.target, _moved_px(case, geometry)).pixels
            angle, values = (image.ravel()[pixels] for image in (geometry.incidence_deg, measured.image_db))
            check_level(case, name, angle, values, float(noise[pixels].mean()))
        except MeasurementError:  # too few pixels
            continue
        except ConfigError as error:
            found.append(error)
    return found


def outlook(case: Case, geometry: Geometry, measured: Measurement | None) -> list[Finding]:
    """Findings on the contrast of the start image, the level of the image and its noise, for one pass.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    measured : Measurement or None
        Measured image before registration; None if the check has not made it.
    """
    found = start_contrast(case, geometry)
    if isinstance(case.measurement, FileMeasurement):
        if "heading_deg" not in case.radar.model_fields_set and opened(case.measurement, case.radar).facts().on_map:
            found.append(Finding("heading_missing", "warning", "radar.heading_deg"))
        # an offset that is removed has an error of its own; the levels of several passes have independent errors; an
        # external law has no band of sigma0
        curves = any(case.laws[name].has_curve for name in case.calibrated)
        if case.target.normalisation == "none" and curves:
            error = case.uncertainty.level_db
            numbers = {"level_db": error, "half_width_db": NORMAL_90 * error}
            found.append(Finding("level_counted", "note", "uncertainty.level_db", numbers))
    return [*found, *hidden_by_noise(case, geometry, measured)] if measured is not None else found


def hidden_ground(scene: Scene, geometry: Geometry) -> list[Finding]:
    """Warning about ground that the radar hardly sees or that is too steep, which wrong units of heights can cause.

    Parameters
    ----------
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of a pass.

    Returns
    -------
    list of Finding
        Warning if more than half of the image's pixels are without visible ground, in layover or partly in shadow, or
        if the median slope is more than 35 degrees; else empty.
    """
    if scene.elevation_m is None or min(scene.elevation_m.shape) < 2:
        return []
    without = float(np.mean(~geometry.visible))
    hidden = float(np.mean(~geometry.visible | geometry.layover | geometry.shadow))
    slope = float(np.median(np.hypot(*np.gradient(scene.elevation_m, scene.cell_m))))
    slope_deg = math.degrees(math.atan(slope))
    if hidden <= _MOST_HIDDEN and slope_deg <= _STEEPEST_DEG:
        return []
    # units with which half of the ground would not be too steep
    likely = [unit for unit, m in _UNITS.items() if math.degrees(math.atan(m * slope)) <= _STEEPEST_DEG]
    numbers: dict[str, float | str] = {
        "hidden_percent": 100.0 * hidden,
        "without_percent": 100.0 * without,
        "slope_deg": slope_deg,
        "units": " or ".join(likely[:2]) or "smaller",
    }
    return [Finding("ground_hidden", "warning", "scene.elevation", numbers)]


def high_noise(passes: Sequence[Case]) -> list[Finding]:
    """Warnings about noise above 0 dB, which a missing minus sign can cause, one for each key; else empty.

    Parameters
    ----------
    passes : sequence of Case
        Passes of the case.
    """
    found = []
    for number, one in enumerate(passes, start=1):
        noise = one.radar.nesz_db
        levels = {"radar.nesz_db": noise if isinstance(noise, float) else max(level for _, level in noise)}
        if isinstance(one.measurement, SyntheticMeasurement) and one.measurement.synthetic.nesz_db is not None:
            levels["measurement.synthetic.nesz_db"] = one.measurement.synthetic.nesz_db
        high = [
            Finding("noise_positive", "warning", key, {"level_db": level}) for key, level in levels.items() if level > 0
        ]
        found += of_pass(high, number, len(passes))
    return found


def bright_laws(case: Case) -> list[Finding]:
    """Warnings about fixed laws that are far brighter than any terrain, which a missing minus sign can cause.

    Parameters
    ----------
    case : Case
        The case; nothing is said if a calibrated material starts as bright, because its levels are then relative.
    """
    gamma = {name: g for name, one in case.materials.items() if (g := _gamma_db(one)) > brightest_db() + _BRIGHTER_DB}
    if gamma.keys() & set(case.calibrated):
        return []
    found = []
    for name, level in gamma.items():
        numbers: dict[str, float | str] = {"law": str(case.materials[name].at_start.law), "gamma_db": level}
        numbers |= {"incidence_deg": _MIDDLE_DEG, "brightest_db": brightest_db()}
        found.append(Finding("law_bright", "warning", f"materials.{name}.parameters", numbers))
    return found


def _gamma_db(material: Material) -> float:
    """Gamma of the starting law at 45 degrees [dB]; -inf if only a pass or a simulator gives its curve."""
    law, phi = material.at_start.unbound_law, math.radians(_MIDDLE_DEG)
    if law.needs or not law.has_curve:
        return -math.inf
    return float(law(np.array([phi]), material.start_parameters)[0]) - 10.0 * math.log10(math.cos(phi))


def start_contrast(case: Case, geometry: Geometry) -> list[Finding]:
    """Warning about a start image with too little contrast for registration; else empty.

    It is empty if the image has enough contrast, if ``registration.method`` is ``none``, or if a law has no curve,
    because the image is then not known without a run.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    """
    if case.registration.method == "none" or not all(law.has_curve for law in case.at_start.laws.values()):
        return []
    image = np.where(np.isfinite(geometry.incidence_deg), start_image(case, geometry), np.float32(np.nan))
    contrast = contrast_db(image)
    if not contrast < LEAST_CONTRAST_DB:
        return []
    about = ", ".join(name for name in case.calibrated if name in geometry.names)
    return [Finding("no_contrast", "warning", about, {"contrast_db": contrast})]


def hidden_by_noise(case: Case, geometry: Geometry, measured: Measurement) -> list[Finding]:
    """Warnings on calibrated materials of which a part of the pixels is to be masked as noise.

    The share of pixels is that of the report (:func:`radcal.ground.pixels.share_in_noise`), but for an image that
    is not registered, and for all ground, held out or not. If the level of the image is removed, its noise is not known
    before the reference run, and nothing is said.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    measured : Measurement
        Measured image before registration.
    """
    if case.target.normalisation != "none":
        return []
    noise_db = noise_floor_db(case.radar, geometry.flat_incidence_deg)
    flags = {IN_THE_NOISE: noise_limited(measured.image_db, noise_db, case.target.snr_db)}
    if case.target.leave_out_point_targets:
        flags["point targets"] = point_targets(measured.image_db, geometry.material, case.radar)
    found = []
    for name in case.calibrated:
        with suppress(MeasurementError):  # too few pixels: a further pass, which may lack the material
            eligible = eligible_pixels(name, geometry, measured, case.target, flags=flags)
            share = share_in_noise(eligible.masked, eligible.pixels.size)
            if share >= MANY_IN_NOISE:
                found.append(Finding("in_the_noise", "warning", name, {"share": share}))
    return found
