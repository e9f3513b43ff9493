"""Measured image before registration, by the model of the assessment: fixed materials, and bounds of X."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.known import image_findings
from radcal.assessment.model import image_of
from radcal.assessment.observation import observe
from radcal.config import Case
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, MeasurementError
from radcal.findings import Finding, of_pass
from radcal.ground.levels import Levels
from radcal.ground.pixels import eligible_pixels
from radcal.image.model import Measurement
from radcal.posterior.cells import CellMeans, Simulated
from radcal.posterior.curves import NORMAL_90
from radcal.posterior.fixed_laws import apart_db
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.sections.simulator import BuiltinSimulation
from radcal.simulators.builtin import BuiltinSimulator
from radcal.targets.reach import check_level

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
