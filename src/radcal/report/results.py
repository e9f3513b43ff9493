"""Results of a calibration at its end, gathered for the archive: decision, law checks, texture, densities, notes."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.class_search import ClassSearch, class_searches
from radcal.calibration.history import History
from radcal.calibration.law_check import LawCheck, check_laws, texture_note
from radcal.calibration.noise import noise_sentence
from radcal.calibration.steps import not_fresh, repeatability
from radcal.calibration.stopping import Decision, decide
from radcal.config import Case, Material, Radar, Stop
from radcal.errors import StoreError
from radcal.measurement.levels import Levels
from radcal.measurement.model import Measurement
from radcal.measurement.registration import Registered
from radcal.measurement.target import Targets
from radcal.radar.geometry import Geometry
from radcal.radar.laws import EXTERNAL
from radcal.report.archive import (
    Archive,
    Check,
    HeldOutBlocks,
    Images,
    LawParameters,
    LevelSummary,
    MaterialResult,
    ObjectPlaces,
    RegistrationSummary,
    Runs,
    SceneView,
)
from radcal.report.law_notes import law_notes
from radcal.scene.model import Scene
from radcal.storage.disclosure import disclosed
from radcal.storage.runs import Record, RunStore

__all__ = ["gather"]

_LARGEST_SCENE = 1200  # cells per side
_MOST_OBJECTS = 20_000  # more dots than a picture tells apart
_PACKAGES = ("radcal", "numpy", "scipy", "smt", "platypus-opt", "h5py", "snakemake")

Pixels = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class _End:
    """What the results of every material are taken from.

    Attributes
    ----------
    case, history, targets, measurement
        As of :func:`gather`.
    decision, checks
        End and trust of each material.
    searches : mapping
        By material; empty where one density of all pixels is compared.
    start_db, calibrated_db, fresh_db : mapping
        Pixels [dB] of the reference run and the two final runs, with texture where it is known.
    fresh : mapping
        Whether another seed gave a material other pixels.
    """

    case: Case
    history: History
    targets: Targets
    measurement: Measurement
    decision: Decision
    checks: Mapping[str, LawCheck]
    searches: Mapping[str, ClassSearch]
    start_db: Pixels
    calibrated_db: Pixels
    fresh_db: Pixels
    fresh: Mapping[str, bool]


def gather(
    *,
    case: Case,
    stop: Stop,
    history: History,
    scene: Scene,
    geometry: Geometry,
    registered: Registered,
    targets: Targets,
    runs: str | Path,
    final: Sequence[Record],
) -> Archive:
    """Decide, check the laws, score the final runs, and put the results together.

    Parameters
    ----------
    case, stop : Case, Stop
        Configuration.
    history : History
        Reference, design and verified proposals.
    scene, geometry, registered, targets
        What the runs are compared with.
    runs : path
        Folder of the run store.
    final : sequence of two Record
        The calibrated laws with common and with fresh random numbers.

    Returns
    -------
    Archive
        Materials in the order of the configuration.

    Raises
    ------
    StoreError
        The reference run's record is gone.
    """
    store = RunStore(runs)
    reference = _reference(store, history, targets)
    end = _end(case, stop, history, registered.measurement, targets, reference, final)
    parameters = _final_parameters(case, history, targets)
    final_scores = [targets.score(pixels_db) for pixels_db in (end.calibrated_db, end.fresh_db)]
    return Archive(
        case=case.case,
        config=json.dumps(disclosed({**case.sections(*case.__dict__), "stop": stop.model_dump(mode="json")})),
        objective=case.objective,
        reason=end.decision.reason or "running",
        converged=end.decision.converged,
        tolerance=stop.rms,
        max_runs=stop.max_runs,
        looks=case.radar.looks,
        measured_looks=targets.looks,
        measurement=registered.measurement.source,
        notes=tuple(_notes(end, final)),
        law_notes=tuple(law_notes(case, geometry, parameters)),
        sentences=tuple(end.decision.materials[name].sentence for name in targets),
        simulator=json.dumps(store.description(reference.key).get("simulator", {})),
        versions=json.dumps(_versions()),
        final_runs=len({record.key for record in final} - {run.key for run in history.runs}),
        names=tuple(geometry.names),
        runs=_runs(history),
        registration=_registration(registered),
        levels=_levels(targets.levels),
        scene=_scene(scene),
        laws={name: _law(parameters[name], item, case.radar) for name, item in case.materials.items()},
        materials={name: _material(end, name, *(scores[name][0] for scores in final_scores)) for name in targets},
        images=_images(end, registered.measurement, reference, final[1], geometry),
    )


def _reference(store: RunStore, history: History, targets: Targets) -> Record:
    """The reference run, with its image."""
    key = history.runs[0].key
    reference = store.get(key, list(targets), image=True)
    if reference is None:
        raise StoreError(
            f"{store.path(key)}: the reference run is missing or without its image; delete "
            f"{store.path(key).parents[1] / 'reference.json'} and type the same command again to make it again."
        )
    return reference


def _end(
    case: Case,
    stop: Stop,
    history: History,
    measurement: Measurement,
    targets: Targets,
    reference: Record,
    final: Sequence[Record],
) -> _End:
    """Decision, checks of the laws, and pixels with texture."""
    searches = class_searches(case, targets)
    checks = check_laws(case, targets, history)
    looks = {name: checks[name].looks for name in searches}
    common, fresh = final
    return _End(
        case=case,
        history=history,
        targets=targets,
        measurement=measurement,
        decision=decide(history, list(targets), stop),
        checks=checks,
        searches=searches,
        start_db=_textured(reference.pixels_db, searches, history.runs[0].looks),
        calibrated_db=_textured(common.pixels_db, searches, looks),
        fresh_db=_textured(fresh.pixels_db, searches, looks, fresh=True),
        fresh={name: not np.array_equal(common.pixels_db[name], fresh.pixels_db[name]) for name in targets},
    )


def _textured(
    pixels_db: Pixels, searches: Mapping[str, ClassSearch], looks: Mapping[str, float], fresh: bool = False
) -> Pixels:
    """A run's pixels with the texture of each material whose looks are known."""
    known = {name: searches[name].textured(pixels_db[name], looks[name], fresh) for name in searches if name in looks}
    return {**pixels_db, **known}


def _notes(end: _End, final: Sequence[Record]) -> list[str]:
    """Remarks on the measured image and on the random numbers of the simulator."""
    notes = [repeatability(end.case, end.history.repeat_db)]
    if end.case.surrogate.outputs == "centred":
        known = {name: end.history.noise_variance(name) for name in end.targets}
        notes += [noise_sentence(name, variance) for name, variance in known.items() if variance is not None]
    notes += [texture_note(end.checks), not_fresh(end.case, final)]
    return [*end.measurement.notes, *filter(None, notes)]


def _final_parameters(case: Case, history: History, targets: Targets) -> dict[str, Sequence[float]]:
    """X of every material in the final runs: the best run's, or those of its fixed law."""
    best = {name: history.best(name).parameters[name] for name in targets}
    return {name: best.get(name, material.start_parameters) for name, material in case.materials.items()}


def _law(values: Any, material: Material, radar: Radar) -> LawParameters:
    """Parameters of a material's law, of one run or of several."""
    external = material.law == EXTERNAL
    return LawParameters(
        values=np.array(values, dtype=np.float64),
        law=material.law,
        polarisation=radar.polarisation,
        frequency_ghz=radar.frequency_ghz,
        angles_deg=None if material.angles_deg is None else tuple(material.angles_deg),
        names=tuple(material.parameter_names) if external else None,
        units=tuple(material.parameter_units) if external else None,
    )


def _runs(history: History) -> Runs:
    """The runs in their order."""
    return Runs(
        kind=np.array([run.kind for run in history.runs]),
        index=np.array([run.index for run in history.runs]),
        key=np.array([run.key for run in history.runs]),
        seconds=np.array([run.seconds for run in history.runs]),
    )


def _registration(registered: Registered) -> RegistrationSummary:
    """Registration, with its fields where the image was moved."""
    said = (registered.method, registered.applied, registered.verdict)
    if not registered.applied:
        return RegistrationSummary(*said)
    return RegistrationSummary(
        *said,
        unregistered_db=registered.unregistered_db,
        displacement_px=registered.displacement_px,
        uncertainty_px=registered.uncertainty_px,
        misregistration_px=registered.measurement.misregistration_px,
    )


def _levels(levels: Levels) -> LevelSummary:
    """Level that was assumed."""
    keys = ("normalisation", "offset_db", "offset_error_db", "scale", "sentence", "doubtful", "unit")
    return LevelSummary(**{key: getattr(levels, key) for key in keys})


def _scene(scene: Scene) -> SceneView:
    """As much of the scene as pictures need."""
    step = -(-max(scene.material.shape) // _LARGEST_SCENE)
    places = None
    if scene.objects is not None and (count := len(scene.objects)):
        middles_m = np.stack([scene.objects.x_m, scene.objects.y_m], axis=1)
        places = ObjectPlaces(middles_m[:: -(-count // _MOST_OBJECTS)].astype(np.float32), count)
    elevation_m = scene.elevation_m
    return SceneView(
        step=step,
        cell_m=scene.cell_m,
        material=scene.material[::step, ::step].astype(np.uint8),
        elevation_m=None if elevation_m is None else elevation_m[::step, ::step].astype(np.float32),
        objects=places,
    )


def _images(end: _End, measurement: Measurement, reference: Record, fresh: Record, geometry: Geometry) -> Images:
    """Whole images in dB, the measured one at the level that was taken as its own."""
    levels = end.targets.levels
    level = 0.0 if levels.normalisation == "none" else levels.offset_db
    calibrated_db = fresh.image_db
    if calibrated_db is not None and end.searches:
        calibrated_db = calibrated_db.copy()
        for name in end.searches:
            calibrated_db.ravel()[geometry.pixels(name)] = end.fresh_db[name]
    return Images(
        measured_db=measurement.image_db - np.float32(level),
        reference_db=reference.image_db,
        calibrated_db=calibrated_db,
        material=geometry.material,
        incidence_deg=geometry.incidence_deg,
    )


def _material(end: _End, name: str, final_dp: NDArray[np.float64], fresh_dp: NDArray[np.float64]) -> MaterialResult:
    """Target, runs and end of a calibrated material."""
    case, runs, target, material = end.case, end.history.runs, end.targets[name], end.case.materials[name]
    verdict, fit, levels = end.decision.materials[name], target.goodness, end.targets.levels
    start_db, calibrated_db, fresh_db = (
        levels.apply(pixels_db[name][target.order], levels.simulated(pixels_db))
        for pixels_db in (end.start_db, end.calibrated_db, end.fresh_db)
    )
    unknown = [np.nan] * len(material.parameter_names)
    proposals = [run.proposals[name] for run in end.history.infill]
    return MaterialResult(
        law=material.law,
        parameter_names=tuple(material.parameter_names),
        parameter_units=tuple(material.parameter_units),
        reason=verdict.reason or "running",
        sentence=verdict.sentence,
        eligible=target.eligible,
        at_boundary=target.at_boundary,
        rms_sampling=target.rms_sampling,
        effective=target.effective,
        looks=target.looks,
        textured=end.targets.textured(name),
        fresh=end.fresh[name],
        left_out=json.dumps(target.left_out),
        fit_ks=fit.ks,
        fit_ks_p=fit.ks_p,
        fit_ad=fit.ad,
        fit_ad_p=fit.ad_p,
        best=runs.index(end.history.best(name)),
        parameters=_law(
            [unknown if name in run.other_law else run.parameters[name] for run in runs], material, case.radar
        ),
        dp=np.array([run.dp[name] for run in runs]),
        rms=np.array([run.rms[name] for run in runs]),
        bounds=np.array(material.box),
        start=_law(material.start_parameters, material.at_start, case.radar),
        target_dp=target.dp,
        target_cp_error=target.cp_error,
        target_cp_interval=target.cp_interval,
        pixels=target.pixels,
        incidence_deg=target.incidence_deg,
        measured_db=target.values_db,
        start_db=start_db,
        calibrated_db=calibrated_db,
        fresh_db=fresh_db,
        check=_check(end.checks[name]),
        final_dp=final_dp,
        fresh_dp=fresh_dp,
        predicted_rms=_numbers(proposal.predicted_rms for proposal in proposals),
        floor_rms=_numbers(proposal.floor_rms for proposal in proposals),
        mode=tuple(proposal.mode for proposal in proposals),
        hidden=np.array(end.measurement.hidden[name]) if name in end.measurement.hidden else None,
        cost=_numbers(run.cost.get(name) for run in runs) if name in end.searches else None,
        run_looks=_numbers(run.looks.get(name) for run in runs) if name in end.searches else None,
    )


def _numbers(values: Iterable[float | None]) -> NDArray[np.float64]:
    """Numbers, NaN for None."""
    return np.array(list(values), dtype=np.float64)


def _check(check: LawCheck) -> Check:
    """What is known of a law."""
    known = {key: value for key, value in vars(check).items() if key not in ("sentences", "held")}
    held = None if check.held is None else HeldOutBlocks(**asdict(check.held))
    return Check(**known, sentences=tuple(check.sentences), held=held)


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
