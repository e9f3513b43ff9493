"""Results of a calibration, collected for the archive."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.conclusion import Conclusion
from radcal.calibration.steps import random_findings
from radcal.config import Stop, stages
from radcal.findings import Finding
from radcal.ground.levels import without_level
from radcal.laws import Law
from radcal.objectives import OBJECTIVES
from radcal.objectives.history import History, Run, Score
from radcal.posterior.result import Image, Posterior
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered
from radcal.results.archive import (
    Archive,
    Fidelity,
    Images,
    MaterialResult,
    PassLaw,
    PassSummary,
    RegistrationSummary,
    Runs,
    SceneView,
)
from radcal.results.law_notes import law_notes
from radcal.results.search_front import SearchFront
from radcal.scene.model import Scene
from radcal.sections.base import FURTHER
from radcal.storage.disclosure import disclosed
from radcal.storage.runs import Record
from radcal.targets.target import Target, Targets

__all__ = ["collect_results"]

_LARGEST_SCENE = 1200  # largest number of archived cells per side
_MOST_OBJECTS = 20_000  # largest number of archived objects; a figure cannot show more as separate dots
_PACKAGES = ("radcal", "numpy", "scipy", "smt", "platypus-opt", "h5py", "snakemake")


def collect_results(
    *,
    case: stages.ArchiveStage,
    stop: Stop,
    history: History,
    scene: Scene,
    geometry: Geometry,
    registered: Registered,
    targets: Targets,
    conclusion: Conclusion,
    image: Image,
    final: Sequence[Record],
    fronts: Mapping[str, SearchFront],
    passes: Sequence[Registered] = (),
) -> Archive:
    """Collect the results of a calibration.

    Parameters
    ----------
    case, stop : stages.ArchiveStage, Stop
        Configuration of the case, and its stop settings.
    history : History
        Reference run, design runs and verified proposals.
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of the first pass.
    registered : Registered
        Registered measured image of the first pass.
    targets : Targets
        Targets of the calibrated materials.
    conclusion : Conclusion
        Decision on the end of the search, posteriors, findings, and final runs.
    image : Image
        What the fixed materials say.
    final : sequence of Record
        Final runs of all passes, two for each.
    fronts : mapping
        Front of the last search by material, for searches with several objectives.
    passes : sequence of Registered
        Registered measured images of all passes.

    Returns
    -------
    Archive
        Results, with the materials in the order of the configuration.
    """
    parameters = _final_parameters(case, history, targets)
    measurement, remarks = registered.measurement, random_findings(case, history, targets, final[:2])
    return Archive(
        case=case.case,
        config=json.dumps(disclosed(_as_written(case, stop))),
        objective=case.objective,
        decision=conclusion.decision,
        tolerance=stop.rms,
        max_runs=stop.max_runs,
        looks=case.radar.looks,
        measured_looks=targets.looks,
        measurement=measurement.source,
        notes=(*measurement.findings, *remarks, *_of_passes(targets, case.objective)),
        law_notes=tuple(law_notes(case, geometry, parameters)),
        simulator=json.dumps(conclusion.simulator),
        versions=json.dumps(_versions()),
        final_runs=len({record.key for record in final[:2]} - {run.key for run in history.runs}),
        names=tuple(geometry.names),
        runs=_runs(history),
        registration=_registration(registered),
        levels=targets.levels,
        image=image,
        findings=tuple(conclusion.findings),
        scene=_scene(scene),
        laws={name: np.array(x, dtype=np.float64) for name, x in parameters.items()},
        materials={
            name: replace(
                _material(name, case, history, targets, conclusion, measurement.hidden.get(name)),
                posterior=conclusion.posteriors.get(name),
                front=fronts.get(name),
            )
            for name in targets
        },
        passes=_passes(case, history, targets, conclusion.posteriors, passes, final)
        if len(targets.passes) > 1
        else None,
        images=Images(
            # figures compare whole images in dB, after subtraction of the assumed level
            measured_db=without_level(measurement.image_db, targets.levels),
            reference_db=conclusion.reference_db,
            calibrated_db=conclusion.calibrated_db,
            material=geometry.material,
            incidence_deg=geometry.incidence_deg,
        ),
    )


def _of_passes(targets: Targets, objective: str) -> list[Finding]:
    """Finding that says which results belong to all passes, and which to pass 1 alone; empty in a case of one pass."""
    count = len(targets.passes)
    if count == 1:
        return []
    misfit = OBJECTIVES[objective].misfit
    shared = [Finding("fields_shared", "note", "")] * (misfit is not None and misfit.of_fields)
    return [Finding("passes_together", "note", "", {"passes": count}), *shared]


def _as_written(case: stages.ArchiveStage, stop: Stop) -> dict[str, Any]:
    """Configuration in the form of a case file, in which sections of several passes are lists."""
    data = {**case.sections(*case.__dict__), "stop": stop.model_dump(mode="json")}
    for section, further in FURTHER.items():
        if further in data:
            data[section] = [data[section], *data.pop(further)]
    for name, colour in data.pop("colours", {}).items():
        data["materials"][name]["colour"] = colour
    return data


def _passes(
    case: stages.ArchiveStage,
    history: History,
    targets: Targets,
    posteriors: Mapping[str, Posterior],
    images: Sequence[Registered],
    final: Sequence[Record],
) -> dict[str, PassSummary]:
    """Summaries of the passes of a case, by the number of the pass from 1."""
    found = {}
    known = {key for run in history.runs for key in run.keys}
    for k, (one, registered, target) in enumerate(zip(case.passes, images, targets.passes, strict=True)):
        keys = [run.keys[k] for run in history.runs]
        missing = [name for name in targets if name not in target]
        too_few = [Finding("too_few_pixels", "note", name) for name in missing]
        new = {record.key for record in final[2 * k : 2 * k + 2]} - known
        known |= new
        found[str(k + 1)] = PassSummary(
            depression_deg=one.radar.centre_depression_deg,
            look_side=one.radar.look_side,
            polarisation=one.radar.polarisation,
            looks=one.radar.looks,
            measurement=registered.measurement.source,
            registration=registered.verdict,
            levels=target.levels.sentence,
            notes=(*registered.measurement.findings, *too_few),
            keys=np.array(keys),
            final_runs=len(new),
            materials={
                name: _pass_law(
                    k,
                    one.laws[name],
                    history.best(name),
                    target[name],
                    posteriors.get(name),
                    registered.measurement.hidden.get(name),
                )
                for name in targets
                if name in target
            },
        )
    return found


def _pass_law(
    k: int, law: Law, score: Score, target: Target, posterior: Posterior | None, hidden: Sequence[float] | None
) -> PassLaw:
    """Law of a material over the incidence of the pass ``k`` (from 0), and density of its best run there."""
    low, high = (float(end) for end in np.quantile(target.incidence_deg.astype(np.float64), [0.05, 0.95]))
    density = score.densities[k]
    curve = None if posterior is None else posterior.curve
    return PassLaw(
        low_deg=low,
        high_deg=high,
        rms=float("nan") if density is None else density.rms,
        half_width_db=None if curve is None else float(curve.half_widths_over(low, high).max()),
        pixels=target.pixels.size,
        difference_db=_difference_db(law, score.parameters, hidden, target.incidence_deg),
    )


def _difference_db(
    law: Law, found: Sequence[float], hidden: Sequence[float] | None, incidence_deg: Any
) -> float | None:
    """Largest difference of the law from the hidden law over a pass's incidence [dB].

    None if there is no hidden law, or if the law has no curve.
    """
    if hidden is None or not law.has_curve:
        return None
    return law.largest_difference_db(found, hidden, incidence_deg)


def _final_parameters(case: stages.ArchiveStage, history: History, targets: Targets) -> dict[str, Sequence[float]]:
    """X of every material in the final runs: for a calibrated material X of the best run, else the fixed X."""
    best = {name: history.best(name).parameters for name in targets}
    return {name: best.get(name, material.start_parameters) for name, material in case.materials.items()}


def _runs(history: History) -> Runs:
    """Kind, number, hash and time of all runs, in the order reference, registration, reused, design, infill."""
    return Runs(
        kind=np.array([run.kind for run in history.runs]),
        index=np.array([run.index for run in history.runs]),
        key=np.array([run.key for run in history.runs]),
        seconds=np.array([run.seconds for run in history.runs]),
    )


def _registration(registered: Registered) -> RegistrationSummary:
    """Outcome of the registration, with the arrays only if the displacement was applied."""
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


def _scene(scene: Scene) -> SceneView:
    """Scene, reduced to the resolution of the figures."""
    step = -(-max(scene.material.shape) // _LARGEST_SCENE)
    objects_m, count = None, len(scene.objects or ())
    if scene.objects is not None and count:
        middles_m = np.stack([scene.objects.x_m, scene.objects.y_m], axis=1)
        objects_m = middles_m[:: -(-count // _MOST_OBJECTS)].astype(np.float32)
    elevation_m = scene.elevation_m
    return SceneView(
        step=step,
        cell_m=scene.cell_m,
        material=scene.material[::step, ::step].astype(np.uint8),
        elevation_m=None if elevation_m is None else elevation_m[::step, ::step].astype(np.float32),
        objects_m=objects_m,
        object_count=count,
    )


def _material(
    name: str,
    case: stages.ArchiveStage,
    history: History,
    targets: Targets,
    conclusion: Conclusion,
    hidden: Sequence[float] | None,
) -> MaterialResult:
    """Target and results of a calibrated material."""
    runs, target = history.runs, targets[name]
    classes = target.classes
    unknown = [np.nan] * len(case.materials[name].parameter_names)
    proposals = [run.proposals[name] for run in history.infill]
    scores = [run.scores[name] for run in runs]
    return MaterialResult(
        target=target,
        simulated=conclusion.materials[name],
        textured=targets.textured(name),
        level_only=targets.level_only(name),
        best=runs.index(history.best_run(name)),
        parameters=np.array([score.parameters if score.own_law else unknown for score in scores], dtype=np.float64),
        dp=np.array([score.dp for score in scores]),
        rms=np.array([score.rms for score in scores]),
        best_looks=history.best(name).looks,
        floor_rms=_numbers(None if classes else proposal.floor for proposal in proposals),
        mode=tuple(proposal.mode for proposal in proposals),
        hidden=None if hidden is None else np.array(hidden),
        cost=_numbers(score.cost if score.own_law else None for score in scores) if classes else None,
        run_looks=_numbers(score.looks if score.own_law else None for score in scores) if classes else None,
        fidelity=_fidelity(history.infill, name),
    )


def _fidelity(infill: Sequence[Run], name: str) -> Fidelity | None:
    """Predictions of the surrogate for a material, and the results of the runs that verified them."""
    if not infill:
        return None
    proposals, scores = [run.proposals[name] for run in infill], [run.scores[name] for run in infill]
    verified = np.array([score.statistics for score in scores])
    nothing = np.full(verified.shape[1:], np.nan)
    return Fidelity(
        predicted_cost=_numbers(proposal.cost for proposal in proposals),
        verified_cost=_numbers(score.cost for score in scores),
        predicted=np.array([proposal.statistics or nothing for proposal in proposals]),
        error=np.array([proposal.errors or nothing for proposal in proposals]),
        verified=verified,
        q2=np.array([proposal.q2 or [np.nan] * 3 for proposal in proposals], dtype=np.float64),
    )


def _numbers(values: Iterable[float | None]) -> NDArray[np.float64]:
    """Numbers as an array, with NaN in place of None."""
    return np.array(list(values), dtype=np.float64)


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
