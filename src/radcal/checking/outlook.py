"""Outlook on a calibration: contrast of the start image, measured levels against noise, expected time.

It needs no simulator run. Rough values are called rough.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from radcal.checking.file_problems import is_on_map
from radcal.checking.hidden_by_noise import hidden_by_noise
from radcal.checking.unregistered import start_image
from radcal.config import Case, FileMeasurement, Radar, SyntheticMeasurement
from radcal.config.landcover import brighter_than_terrain
from radcal.forecast.time_left import (
    duration,
    largest_runs,
    most_need,
    stored_iteration_seconds,
)
from radcal.image.model import Measurement
from radcal.posterior.curves import NORMAL_90
from radcal.radar.geometry import Geometry
from radcal.registration.registered import LEAST_CONTRAST_DB, contrast_db
from radcal.scene.model import Scene
from radcal.storage.runs import median_seconds

__all__ = [
    "bright_laws",
    "hidden_ground",
    "high_noise",
    "low_track",
    "of_pass",
    "outlook",
    "start_contrast",
    "time_expected",
]

_MOST_HIDDEN, _STEEPEST_DEG = 0.5, 35.0  # more hidden ground and steeper slopes (median) are rare, even in mountains
# units of heights that are taken for metres, with the factors that convert them to metres
_UNITS = {"feet": 0.3048, "decimetres": 0.1, "centimetres": 0.01}


def outlook(case: Case, geometry: Geometry, measured: Measurement | None) -> list[str]:
    """Lines on the contrast of the start image, the level of the image and its noise, for one pass.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    measured : Measurement or None
        Measured image before registration; None if the check has not made it.
    """
    blank = start_contrast(case, geometry)
    lines = [] if blank is None else [f"warning: {blank}."]
    image = case.measurement
    if isinstance(image, FileMeasurement):
        if "heading_deg" not in case.radar.model_fields_set and is_on_map(image):
            lines.append("warning: radar.heading_deg is not given, so that the track heads to the grid's north.")
        # an offset that is removed has an error of its own; the levels of several passes have independent errors; an
        # external law has no band of sigma0
        curves = any(case.laws[name].has_curve for name in case.calibrated)
        if case.target.normalisation == "none" and curves:
            error = case.uncertainty.level_db
            lines.append(
                f"the image's level counts as right to {error:g} dB (uncertainty.level_db, one standard error): no "
                f"90 % band of sigma0 from this pass alone is narrower than +-{NORMAL_90 * error:.2g} dB"
            )
    return [*lines, *hidden_by_noise(case, geometry, measured)] if measured is not None else lines


def of_pass(lines: Sequence[str], number: int, passes: int) -> list[str]:
    """Lines with the number of their pass, from 1, if a case has several passes; indented lines continue the last.

    The word warning stays at the beginning of a line.
    """
    if passes == 1:
        return list(lines)
    return [line if line[:1] == " " else re.sub("^(warning: )?", rf"\g<1>pass {number}: ", line) for line in lines]


def hidden_ground(scene: Scene, geometry: Geometry) -> list[str]:
    """Warning about ground that the radar hardly sees or that is too steep, which wrong units of heights can cause.

    Parameters
    ----------
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of a pass.

    Returns
    -------
    list of str
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
    units = [
        f"{unit} (gdal_calc --calc='A*{factor:g}' makes metres, with half of the ground steeper than {deg:.0f} degrees)"
        for unit, factor in _UNITS.items()
        if (deg := math.degrees(math.atan(factor * slope))) <= _STEEPEST_DEG
    ]
    return [
        f"warning: {100 * hidden:.0f} % of the simulated image's pixels are in shadow or layover or without ground "
        f"({100 * without:.0f} % show none at all), and half of the ground is steeper than {slope_deg:.0f} degrees: "
        f"are the heights in scene.elevation in {' or in '.join(units[:2])}, or is radar.depression_deg wrong?"
    ]


def high_noise(passes: Sequence[Case]) -> list[str]:
    """Warning about noise above 0 dB, which a missing minus sign can cause; one for each key, else empty.

    Parameters
    ----------
    passes : sequence of Case
        Passes of the case.
    """
    found: dict[str, float] = {}
    for number, one in enumerate(passes, start=1):
        which = f"pass {number}: " if len(passes) > 1 else ""
        noise = one.radar.nesz_db
        found[f"{which}radar.nesz_db"] = noise if isinstance(noise, float) else max(level for _, level in noise)
        if isinstance(one.measurement, SyntheticMeasurement) and one.measurement.synthetic.nesz_db is not None:
            found[f"{which}measurement.synthetic.nesz_db"] = one.measurement.synthetic.nesz_db
    return [
        f"warning: {key} is {level:g} dB: is a minus sign missing (-{level:g})? Noise above 0 dB hides nearly all "
        "ground, unless the levels of the image itself lie far above 0 dB."
        for key, level in found.items()
        if level > 0
    ]


def bright_laws(case: Case) -> list[str]:
    """Warnings about fixed laws that are far brighter than any terrain, which a missing minus sign can cause.

    Parameters
    ----------
    case : Case
        The case; nothing is said if a calibrated material starts as bright, because its levels are then relative.
    """
    asked = {name: brighter_than_terrain(material) for name, material in case.materials.items()}
    if any(asked[name] for name in case.calibrated):
        return []
    return [f"warning: materials.{name}.parameters: {text}" for name, text in asked.items() if text]


def low_track(radar: Radar, geometry: Geometry) -> list[str]:
    """Note on an altitude in metres whose number would be that of a satellite in km; else empty.

    Parameters
    ----------
    radar : Radar
        Pass over a scene with elevations.
    geometry : Geometry
        Geometry of the pass.
    """
    if not radar.maybe_in_km:
        return []
    low, high = geometry.flat_incidence_deg.min(), geometry.flat_incidence_deg.max()
    return [
        f"radar.altitude_m is {radar.altitude_m:g}, a track {radar.altitude_m:g} m above the scene, which sees level "
        f"ground at {low:.1f} to {high:.1f} degrees of incidence: expected {1000.0 * radar.altitude_m:g} for a "
        f"satellite {radar.altitude_m:g} km high."
    ]


def start_contrast(case: Case, geometry: Geometry) -> str | None:
    """Sentence on a start image with too little contrast for registration; None if there is nothing to say.

    There is nothing to say if the image has enough contrast, if ``registration.method`` is ``none``, or if a law has no
    curve, because the image is then not known without a run.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    """
    if case.registration.method == "none" or not all(law.has_curve for law in case.at_start.laws.values()):
        return None
    image = np.where(np.isfinite(geometry.incidence_deg), start_image(case, geometry), np.float32(np.nan))
    contrast = contrast_db(image)
    if not contrast < LEAST_CONTRAST_DB:
        return None
    several = [name for name in case.calibrated if name in geometry.names]
    return (
        f"the image simulated at the start has no contrast between materials (the level of its squares varies by "
        f"{contrast:.2f} dB), so that no image can be registered onto it: give {_listed(several)} starts that differ "
        f"(materials.{several[0]}.start: {_other(case, several[0])}), or, if the measured image lies on the simulated "
        "image's pixels already, set registration.method: none"
    )


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + f" and {names[-1]}" if len(names) > 1 else names[0]


def _other(case: Case, name: str) -> list[float]:
    """Example of a different start of a material: the first parameter moved by a tenth of its interval of bounds."""
    material = case.materials[name]
    start, (low, high) = list(material.start_parameters), material.box[0]
    step = 0.1 * (high - low)
    start[0] = float(f"{start[0] - step if start[0] - step >= low else start[0] + step:.3g}")
    return start


def time_expected(case: Case, results: str | Path) -> str:
    """Line on the expected time of the simulator runs, from the stored runs of the case.

    Without a stored run, the line says that the time is not known.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    results : path
        Folder that contains the results folders of all cases.
    """
    seconds = median_seconds(Path(results) / case.case / "runs")
    if seconds is None:
        return "time: not known before the first run, which radcal run CASE reference makes"
    each = seconds * case.simulator.draws
    whole = stored_iteration_seconds(Path(results) / case.case / "benchmarks")
    largest, search = largest_runs(case), most_need(case.design_size, case.stop.max_runs)

    def total(infill: int) -> str:
        """Number of runs with so many infill runs for each pass, and their time with that of the iterations."""
        others = sum(number for kind, number in largest.items() if kind != "infill")
        runs = others + len(case.passes) * infill
        if whole is None:
            return f"{runs} runs ({duration(runs * each)} of simulation)"
        return f"{runs} runs ({duration(others * each + infill * whole)} with training and proposals)"

    more = f"; an iteration with training and proposal takes about {duration(whole)}" if whole is not None else ""
    return (
        f"time: about {duration(each)} of simulation a run (median of the case's stored runs){more}; with a search as "
        f"for most laws of docs/right_law.md, at most {total(search - case.design_size)}, stop.max_runs allows at "
        f"most {total(case.stop.max_runs - case.design_size)}"
    )
