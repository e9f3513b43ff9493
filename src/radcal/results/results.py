"""Results of a calibration in one archive.

Its parts compare measured and simulated statistics of incidence-angle bins, with the prior of X, and hold the front of
a search with several objectives.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.conclusion import conclude, withheld
from radcal.calibration.scoring import with_texture
from radcal.calibration.steps import random_findings
from radcal.calibration.stopping import decide
from radcal.config.disclosure import disclosed
from radcal.config.part import Part
from radcal.findings import Finding
from radcal.inference.moments import from_cumulants, to_cumulants
from radcal.objectives import Comparison, make_objectives
from radcal.objectives.history import History, Run, Score
from radcal.posterior.curves import curves_of
from radcal.posterior.result import Image, Posterior
from radcal.proposals.surrogate import Surrogate, Training
from radcal.radar.geometry import Geometry
from radcal.registration.height_shift import with_height_finding
from radcal.registration.registered import Registered, without_images
from radcal.results.archive import (
    Archive,
    BinStatistics,
    Fidelity,
    Images,
    MaterialResult,
    PassResult,
    Runs,
    SceneView,
    SearchFront,
)
from radcal.results.law_notes import law_notes
from radcal.scene.model import Scene, picture_step
from radcal.seeds import derived_rng
from radcal.storage.runs import Record, RunStore, record_of
from radcal.targets.target import Targets, level_only

_MOST_OBJECTS = 20_000  # largest number of archived objects; a figure cannot show more as separate dots
_PACKAGES = ("radcal", "numpy", "scipy", "smt", "platypus-opt", "h5py", "snakemake")
Doubles = NDArray[np.float64]

_HALF_STEP = 0.005  # half of 1 % of the width of the bounds
_TRIED, _KEPT = 40_000, 2_000  # points of which the draws from a prior are chosen, and draws


def search_fronts(objectives: Mapping[str, Comparison], history: History) -> dict[str, SearchFront]:
    """Front of the last search of each material; materials whose search has a single objective are left out.

    Parameters
    ----------
    objectives : mapping
        Objective by calibrated material.
    history : History
        All scored runs.
    """
    last = {}
    for run in history.infill:
        last.update({name: proposal.front for name, proposal in run.proposals.items() if proposal.front.objectives})
    found = {}
    for name, front in last.items():
        comparison = objectives[name]
        nothing = np.full(len(comparison.part_names), np.nan)
        scores = [run.scores[name] for run in history.runs]
        found[name] = SearchFront(
            objectives=tuple(comparison.part_names),
            predicted=np.array(front.objectives),
            verified=np.array([comparison.parts_of(score) if score.own_law else nothing for score in scores]),
        )
    return found


def bin_statistics(comparison: Comparison, history: History, training: Training | None = None) -> BinStatistics | None:
    """Statistics of the incidence-angle bins of one material; None for an objective without bins.

    Parameters
    ----------
    comparison : Comparison
        Objective of the material.
    history : History
        All scored runs.
    training : Training, optional
        Surrogate by all runs, from which the sensitivities at the best X follow as central differences.
    """
    name = comparison.material.name
    best, first = history.best(name), history.runs[0].scores[name]
    parts = [(k, part.moments) for k, part in enumerate(comparison.passes) if part is not None]
    shown = [(k, moments) for k, moments in parts if moments is not None]
    if not shown:
        return None
    measured = [from_cumulants(moments.classes.cumulants) for _, moments in shown]

    def expected(score: Score) -> Doubles:
        found = []
        for (k, moments), values in zip(shown, measured, strict=True):
            own = comparison.in_pass(k, score)
            residuals = moments(np.asarray(own.parameters), own.looks, to_cumulants(own.statistics))
            found.append(values + moments.differences(residuals))
        return np.concatenate(found)

    return BinStatistics(
        in_pass=np.repeat([k + 1 for k, _ in shown], [moments.classes.size for _, moments in shown]),
        incidence_deg=np.concatenate([moments.classes.nodes_deg.mean(axis=1) for _, moments in shown]),
        measured=np.concatenate(measured),
        error=np.concatenate([np.sqrt(np.diag(moments.covariance)).reshape(3, -1).T for _, moments in shown]),
        calibrated=expected(best),
        start=expected(first) if first.own_law else None,
        sensitivity=None if training is None else _sensitivity(Surrogate(training, comparison), best.parameters),
    )


def _sensitivity(surrogate: Surrogate, parameters: list[float]) -> Doubles:
    """Change of each statistic over 1 % of the width of each bound, shape (b, 3, d), about an X in the bounds.

    References
    ----------
    Hill and Tiedeman, "Effective Groundwater Model Calibration" (2007), chapter 4: scaled sensitivities.
    """
    middle = np.clip(surrogate.unit(parameters), _HALF_STEP, 1.0 - _HALF_STEP)
    step = _HALF_STEP * np.eye(middle.size)
    change = surrogate.predict(middle + step) - surrogate.predict(middle - step)
    return np.asarray(np.moveaxis(change, 0, -1))


def prior_draws(comparison: Comparison, rng: np.random.Generator) -> Doubles:
    """Draws from the prior of X: uniform inside the bounds, times the prior on the law's curve, shape (2000, d).

    References
    ----------
    Rubin, "Using the SIR algorithm to simulate posterior distributions", Bayesian Statistics 3 (1988): sampling,
    importance, resampling.
    """
    low, high = comparison.material.box.T
    x = low + rng.random((_TRIED, low.size)) * (high - low)
    x = np.where(comparison.material.integer, np.round(x), x)
    prior = next(part for part in comparison.passes if part is not None).prior
    if prior is None:
        return np.asarray(x[:_KEPT])
    log = -0.5 * (prior.of_curves(curves_of(prior.law, x, np.radians(prior.angles_deg)), x) ** 2).sum(axis=1)
    chance = np.exp(log - log.max())
    return np.asarray(x[rng.choice(_TRIED, _KEPT, p=chance / chance.sum())])


def archive_of(
    case: Part,
    history: History,
    scene: Scene,
    geometry: Geometry,
    passes: Sequence[Registered],
    targets: Sequence[Targets],
    runs: str | Path,
    final: Sequence[Record],
    posteriors: Sequence[Posterior],
    image: Image,
    trained: Mapping[str, Training] = MappingProxyType({}),
    noted: Sequence[Finding] = (),
) -> Archive:
    """Collect the results of a calibration, with its findings (:func:`.conclude`).

    Parameters
    ----------
    case : Part
        Configuration of the case.
    history : History
        Reference run, design runs and verified proposals.
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of the first pass.
    passes : sequence of Registered
        Registered measured images of all passes.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    runs : path
        Folder of the run store.
    final : sequence of Record
        Final runs of all passes, two for each.
    posteriors : sequence of Posterior
        Posterior of each law, in the order of the calibrated materials.
    image : Image
        What the fixed materials say.
    trained : mapping
        Surrogate by all runs, by material; empty if the search made none.
    noted : sequence of Finding
        Findings on the geometry of all passes.

    Returns
    -------
    Archive
        Results, with the materials in the order of the configuration.

    Raises
    ------
    StoreError
        The record of the reference run is missing or holds no image.
    """
    images = [with_height_finding(passes[0], geometry, scene, case.radar), *passes[1:]]
    seen, objectives = targets[0], make_objectives(case, targets)
    final_db = final[1].image_db
    assert final_db is not None  # noqa: S101 - the run is made with its image
    of_each = dict(zip(case.calibrated, posteriors, strict=True))
    findings = conclude(case, history, targets, objectives, geometry, final_db, of_each, image, images, noted)
    best = {name: history.best(name) for name in seen}
    store, start = RunStore(runs), history.runs[0].keys[0]
    reference = record_of(store, Path(runs).parent / "passes/1/reference.json", start, list(seen), image=True)
    looks = {name: score.looks for name, score in best.items()}
    calibrated, fresh = (
        with_texture(run.pixels_db, objectives, looks, case.seed, fresh=number == 1)
        for number, run in enumerate(final[:2])
    )
    final_scores, fresh_scores = seen.score(calibrated), seen.score(fresh)
    calibrated_db = final_db.copy()
    for name in seen:
        calibrated_db.ravel()[geometry.pixels(name)] = fresh[name]
    laws = {
        name: np.array(best[name].parameters if name in best else material.start_parameters, dtype=np.float64)
        for name, material in case.materials.items()
    }
    fronts, hidden = search_fronts(objectives, history), images[0].measurement.hidden
    notes = random_findings(case, history, seen, final[:2])
    if (count := len(targets)) > 1:
        notes.append(Finding("passes_together", "note", "", {"passes": count}))

    def material(name: str) -> MaterialResult:
        unknown = [np.nan] * len(case.materials[name].parameter_names)
        repeats = np.array_equal(final[0].pixels_db[name], final[1].pixels_db[name])
        scores = [run.scores[name] for run in history.runs]
        return MaterialResult(
            targets={str(k): one[name] for k, one in enumerate(targets, start=1) if name in one},
            rms_final=final_scores[name][1],
            rms_fresh=np.nan if repeats else fresh_scores[name][1],
            textured=seen.textured(name),
            level_only=level_only(targets, name),
            best=history.runs.index(history.best_run(name)),
            parameters=np.array([score.parameters if score.own_law else unknown for score in scores], dtype=np.float64),
            dp=np.array([score.dp for score in scores]),
            rms=np.array([score.rms for score in scores]),
            cost=_numbers(score.cost if score.own_law else None for score in scores),
            looks=_numbers(score.looks if score.own_law else None for score in scores),
            posterior=withheld(name, of_each[name], findings),
            prior=prior_draws(objectives[name], derived_rng(case.seed, "prior", name)),
            hidden=np.array(hidden[name]) if name in hidden else None,
            fidelity=_fidelity(history.infill, name),
            front=fronts.get(name),
            bins=bin_statistics(objectives[name], history, trained.get(name)),
        )

    return Archive(
        config=json.dumps(disclosed(_as_written(case))),
        decision=decide(history, list(seen), case.stop, case.objective),
        measured_looks=seen.looks,
        notes=tuple(notes),
        law_notes=tuple(law_notes(case, geometry, laws)),
        simulator=json.dumps(store.description(start).get("simulator", {})),
        versions=json.dumps({"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}),
        names=tuple(geometry.names),
        runs=Runs(
            kind=np.array([run.kind for run in history.runs]),
            index=np.array([run.index for run in history.runs]),
            seconds=np.array([run.seconds for run in history.runs]),
        ),
        passes={
            str(k + 1): PassResult(
                registered=one if k == 0 else without_images(one),
                levels=targets[k].levels,
                keys=np.array([run.keys[k] for run in history.runs]),
                final_keys=tuple(record.key for record in final[2 * k : 2 * k + 2]),
                rms={name: density.rms for name in seen if (density := best[name].densities[k]) is not None},
            )
            for k, one in enumerate(images)
        },
        image=image,
        findings=tuple(findings),
        scene=_scene(scene),
        laws=laws,
        materials={name: material(name) for name in seen},
        images=Images(
            reference_db=reference.image_db,
            calibrated_db=calibrated_db,
            material=geometry.material,
            incidence_deg=geometry.incidence_deg,
        ),
    )


def _as_written(case: Part) -> dict[str, Any]:
    """Configuration in the form of a case file, in which sections of several passes are lists."""
    data = case.sections(*case.__dict__)
    for name, colour in data.pop("colours", {}).items():
        data["materials"][name]["colour"] = colour
    return data


def _place(scene: Scene) -> dict[str, Any]:
    """Coordinate reference system and south-west corner of a grid that points to the north of this system."""
    if scene.crs is None or scene.transform is None or scene.heading_deg:
        return {}
    return {"crs": scene.crs, "west_m": float(scene.transform[2]), "south_m": float(scene.transform[5])}


def _scene(scene: Scene) -> SceneView:
    """Scene, reduced to the resolution of the figures."""
    step = picture_step(scene.material.shape)
    objects_m = None
    if scene.objects:
        middles_m = np.stack([scene.objects.x_m, scene.objects.y_m], axis=1)
        objects_m = middles_m[:: -(-len(scene.objects) // _MOST_OBJECTS)].astype(np.float32)
    elevation_m = scene.elevation_m
    return SceneView(
        step=step,
        cell_m=scene.cell_m,
        material=scene.material[::step, ::step].astype(np.uint8),
        elevation_m=None if elevation_m is None else elevation_m[::step, ::step].astype(np.float32),
        objects_m=objects_m,
        imagery=scene.imagery,
        **_place(scene),
    )


def _fidelity(infill: Sequence[Run], name: str) -> Fidelity | None:
    """Proposals of the surrogate for a material, and the statistics of the runs that verified them."""
    if not infill:
        return None
    proposals = [run.proposals[name] for run in infill]
    verified = np.array([run.scores[name].statistics for run in infill])
    nothing = np.full(verified.shape[1:], np.nan)
    return Fidelity(
        mode=tuple(proposal.mode for proposal in proposals),
        cost=_numbers(proposal.cost for proposal in proposals),
        floor=_numbers(proposal.floor for proposal in proposals),
        predicted=np.array([proposal.statistics or nothing for proposal in proposals]),
        error=np.array([proposal.errors or nothing for proposal in proposals]),
        verified=verified,
        q2=np.array([proposal.q2 or [np.nan] * 3 for proposal in proposals], dtype=np.float64),
    )


def _numbers(values: Iterable[float | None]) -> NDArray[np.float64]:
    """Numbers as an array, with NaN in place of None."""
    return np.array(list(values), dtype=np.float64)
