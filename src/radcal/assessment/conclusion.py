"""Conclusion of a calibration: decision on its end, checks of the laws, densities of the final runs, remarks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.budget import NORMAL_90, Budget, level_contradicted
from radcal.assessment.causes import joint_cause, likely_cause
from radcal.assessment.fit_test import FitTest, check_fit
from radcal.assessment.law_check import LawCheck, check_laws, texture_note
from radcal.assessment.posterior import Posterior
from radcal.assessment.program_check import another_law
from radcal.assessment.registration_check import Moved, check_registration
from radcal.assessment.verdict import OFF_DB, Known, verdict
from radcal.calibration.history import History
from radcal.calibration.noise import noise_sentence
from radcal.calibration.objectives import Comparison, make_objectives
from radcal.calibration.scoring import with_texture
from radcal.calibration.steps import not_fresh, repeatability
from radcal.calibration.stopping import Decision, decide
from radcal.config import Stop, Uncertainty, stages
from radcal.errors import StoreError
from radcal.measurement.registration import Registered
from radcal.measurement.target import Targets
from radcal.radar.geometry import Geometry
from radcal.seeds import derived_rng
from radcal.storage.runs import Record, RunStore

__all__ = ["Conclusion", "MaterialPixels", "conclude"]

Pixels = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class MaterialPixels:
    """Simulated pixels of one material's target in the reference run and the two final runs, textured.

    Attributes
    ----------
    start, calibrated, fresh : ndarray, shape (n,)
        Pixels of three runs, after normalisation of the level: the reference run, the final run with common random
        numbers, and the final run with fresh ones [dB; interquartile ranges for ``normalisation: image``].
    calibrated_dp, fresh_dp : ndarray, shape (3,)
        Skew-normal densities (xi, omega, alpha) of all visible pixels in the two final runs; xi and omega have the
        unit of the pixels.
    differ : bool
        Whether the pixels of the two final runs, of different seeds, differ.
    """

    start: NDArray[Any]
    calibrated: NDArray[Any]
    fresh: NDArray[Any]
    calibrated_dp: NDArray[np.float64]
    fresh_dp: NDArray[np.float64]
    differ: bool


@dataclass(frozen=True)
class Conclusion:
    """Results of a calibration: decision on its end, laws, pixels of the final runs, remarks and verdicts.

    Attributes
    ----------
    decision : Decision
        Whether the search has ended, and why.
    checks : mapping
        Check of each calibrated material's law.
    materials : mapping
        Pixels and densities of each calibrated material.
    reference_db, calibrated_db : ndarray of float32, shape (rows, columns), or None
        Image of the reference run, and image of the final run with fresh random numbers [dB].
    simulator : mapping
        Identity of the simulator.
    new_runs : int
        Number of final runs that the search had not simulated already.
    notes : list of str
        Remarks on the simulator's random numbers, on texture, on the image's level and on the registration.
    fits : mapping
        Test of the fit of each calibrated material's law.
    posteriors : mapping
        Posterior of each law; if the law does not fit, or if the level of an image is contradicted, its posterior calls
        sigma0 known at no angle.
    verdicts : mapping
        Verdict on each calibrated material, as a sentence.
    """

    decision: Decision
    checks: Mapping[str, LawCheck]
    materials: Mapping[str, MaterialPixels]
    reference_db: NDArray[np.float32] | None
    calibrated_db: NDArray[np.float32] | None
    simulator: Mapping[str, Any]
    new_runs: int
    notes: list[str]
    fits: Mapping[str, FitTest]
    posteriors: Mapping[str, Posterior]
    verdicts: Mapping[str, str]


def conclude(
    case: stages.Archive,
    stop: Stop,
    history: History,
    targets: Targets,
    geometry: Geometry,
    runs: str | Path,
    final: Sequence[Record],
    posteriors: Mapping[str, Posterior] | None = None,
    registered: Registered | None = None,
) -> Conclusion:
    """Conclude a calibration: decide if the search has ended, check the laws, and score the final runs.

    Parameters
    ----------
    case, stop : stages.Archive, Stop
        Configuration of the case, and stop criteria.
    history : History
        Scored runs: reference run, design and verified proposals.
    targets : Targets
        Target of each calibrated material.
    geometry : Geometry
        Geometry of the pass, which holds the pixels of each material.
    runs : path
        Folder of the run store.
    final : sequence of two Record
        Final runs of the calibrated laws: with the common random numbers, and with fresh ones.
    posteriors : mapping, optional
        Posterior of each material's law.
    registered : Registered, optional
        Registered measured image of the first pass, to be registered again onto the image of the calibrated laws.

    Raises
    ------
    StoreError
        If the record of the reference run is missing or holds no image.
    """
    store, key = RunStore(runs), history.runs[0].key
    reference = store.get(key, list(targets), image=True)
    if reference is None:
        raise StoreError(
            f"{store.path(key)}: the reference run is missing or without its image; delete "
            f"{Path(runs).parent / 'reference.json'} and type the same command again to make it again."
        )
    objectives = make_objectives(case, targets)
    first = {name: score.looks for name, score in history.runs[0].scores.items()}
    looks = {name: history.best(name).scores[name].looks for name in targets}
    fresh_db = with_texture(final[1].pixels_db, objectives, looks, case.seed, fresh=True)
    each_db = [
        with_texture(reference.pixels_db, objectives, first, case.seed),
        with_texture(final[0].pixels_db, objectives, looks, case.seed),
        fresh_db,
    ]
    materials = _materials(targets, each_db, final)
    fits = {name: _fit(case, name, targets, objectives[name], history, materials[name]) for name in targets}
    moved = _moved(case, history, targets, geometry, registered, final[1])
    others = _other_laws(case, targets, objectives, history, geometry)
    withheld = {**others, **{name: why for name, test in fits.items() if (why := not_to_be_used(test))}}
    unknown = {**_contradicted(case, targets), **others}
    believed = _believed(posteriors or {}, {*withheld, *unknown})
    checks = check_laws(case, targets, history, posteriors=believed, withheld=withheld, doubts=unknown)
    return Conclusion(
        decision=decide(history, list(targets), stop, case.objective),
        checks=checks,
        materials=materials,
        reference_db=reference.image_db,
        calibrated_db=_picture(final[1], {name: fresh_db[name] for name in targets}, geometry),
        simulator=store.description(key).get("simulator", {}),
        new_runs=len({record.key for record in final} - {run.key for run in history.runs}),
        notes=[*_notes(case, history, checks, final), *targets.level_warnings(), *_moves(moved)],
        fits=fits,
        posteriors=believed,
        verdicts={
            name: verdict(
                name,
                fits[name],
                _cause(case, name, targets, objectives[name], history, geometry, fits[name]),
                _known(believed.get(name), targets, case.uncertainty, name, unknown.get(name, "")),
                level_only=targets.level_only(name),
                between_db=checks[name].between_db,
                passes=len(targets.passes),
                doubt=_doubt(name, moved, others if fits[name].fits is False else {}),
            )
            for name in targets
        },
    )


def not_to_be_used(test: FitTest) -> str:
    """Reason why a law must not be used, because the budget of its posterior does not cover it; otherwise empty."""
    if test.fits is False:
        return "the law does not fit"
    return "the density is not matched" if test.unmatched else ""


def _believed(posteriors: Mapping[str, Posterior], nowhere: Collection[str]) -> dict[str, Posterior]:
    """Posteriors of all materials; those of the materials in ``nowhere`` call sigma0 known at no angle."""
    return {name: _unknown(one) if name in nowhere else one for name, one in posteriors.items()}


def _unknown(posterior: Posterior) -> Posterior:
    """Posterior that calls sigma0 known at no angle."""
    return replace(posterior, known_between_deg=None, known_half_width_db=None)


def _contradicted(case: stages.Archive, targets: Targets) -> dict[str, str]:
    """Reason by material why sigma0 must not be called known although its law may fit; materials without one absent."""
    level = level_contradicted(case.uncertainty, [one.levels for one in targets.passes])
    return dict.fromkeys(targets, level) if level else {}


def _other_laws(
    case: stages.Archive,
    targets: Targets,
    objectives: Mapping[str, Comparison],
    history: History,
    geometry: Geometry,
) -> dict[str, str]:
    """Clause on each material of which an external program computes another law than the configured one."""
    if case.simulator.kind != "command":
        return {}
    each = {
        name: another_law(name, case.materials[name].law, objectives[name], target, history, geometry)
        for name, target in targets.items()
    }
    return {name: why for name, why in each.items() if why}


def _doubt(name: str, moved: Mapping[str, Moved], others: Mapping[str, str]) -> str:
    """Clauses on a law in doubt, by the registration and by a program that computes another law; empty if none."""
    said = [moved[name].sentence(name)] if name in moved and moved[name].doubtful else []
    return "; ".join([*said, *([others[name]] if name in others else [])])


def _known(
    posterior: Posterior | None, targets: Targets, config: Uncertainty, name: str, withheld: str = ""
) -> Known | None:
    """Interval of incidence in which sigma0 is known; None without a posterior, or for a law without a curve."""
    if posterior is None or posterior.curve is None:
        return None
    levels = targets.levels
    removed = levels.normalisation == "offset" and np.isfinite(levels.offset_error_db)
    return Known(
        posterior.known_between_deg,
        posterior.known_half_width_db,
        linear=not posterior.sampled,
        levels=posterior.levels() if targets.level_only(name) else (),
        # each pass has a level of its own, so that several passes lower the error of their common law
        level_error_db=0.0 if targets.further else NORMAL_90 * Budget.of(config, levels).level_db,
        level_key="the removed offset" if removed else "uncertainty.level_db",
        withheld=withheld,
    )


def _fit(
    case: stages.Archive, name: str, targets: Targets, objective: Comparison, history: History, pixels: MaterialPixels
) -> FitTest:
    """Test whether the law of one material's best run fits the target."""
    score, target = history.best(name).scores[name], targets[name]
    found = check_fit(
        objective,
        score,
        (pixels.calibrated, target.values_db),
        score.rms / target.rms_sampling,
        derived_rng(case.seed, "fit", name),
    )
    return without_angles(found) if targets.level_only(name) else found


def without_angles(test: FitTest) -> FitTest:
    """Test of a material seen at one incidence: a failed test counts only if the mean is off by more than 0.5 dB."""
    return replace(test, fits=False if test.fits is False and abs(test.mean_db) > OFF_DB else None)


def _cause(
    case: stages.Archive,
    name: str,
    targets: Targets,
    objective: Comparison,
    history: History,
    geometry: Geometry,
    fit: FitTest,
) -> str:
    """Likely cause of a misfit; empty for a law that fits."""
    if fit.fits is not False:
        return ""
    if not case.laws[name].has_curve:
        return joint_cause(fit, "the law has no curve to examine")
    # the misfit may lie in another pass than the first, whose law and pixels are examined below
    if targets.further:
        return joint_cause(fit, "causes are examined in cases of one pass")
    law = objective.law_in(0, history.best(name).scores[name])
    return likely_cause(case.materials[name].law, law, fit, targets[name], geometry, targets.looks)


def _moved(
    case: stages.Archive,
    history: History,
    targets: Targets,
    geometry: Geometry,
    registered: Registered | None,
    final: Record,
) -> dict[str, Moved]:
    """Change of the first pass's registration by the calibrated laws, of materials whose law the pixels can show."""
    if registered is None:
        return {}
    laws = {
        name: (case.laws[name], history.best(name).scores[name].parameters)
        for name in targets
        if not targets.level_only(name)
    }
    return check_registration(laws, targets, geometry, registered, final.image_db)


def _moves(moved: Mapping[str, Moved]) -> list[str]:
    """Remark on the registration onto the image of the calibrated laws; empty if it was not made."""
    each = ", ".join(
        f"{name} {one.moved_px:.2f} (stated error {one.stated_px:.2f}, sigma0 by {one.moved_db:.2f} dB)"
        for name, one in moved.items()
    )
    return (
        [f"Check of the registration: onto the calibrated image, pixels move by (pixels, rms) {each}."] if each else []
    )


def _picture(record: Record, pixels_db: Pixels, geometry: Geometry) -> NDArray[np.float32] | None:
    """Whole image of a run in which the pixels of some materials are replaced by ``pixels_db``."""
    if record.image_db is None or not pixels_db:
        return record.image_db
    image = record.image_db.copy()
    for name, values in pixels_db.items():
        image.ravel()[geometry.pixels(name)] = values
    return image


def _materials(targets: Targets, each_db: Sequence[Pixels], final: Sequence[Record]) -> dict[str, MaterialPixels]:
    """Pixels of each material in the reference run and both final runs, and densities of the final runs."""
    levels = targets.levels
    mappings = [levels.simulated(pixels_db) for pixels_db in each_db]
    scores = [targets.score(pixels_db) for pixels_db in each_db[1:]]
    found = {}
    for name, target in targets.items():
        start, calibrated, fresh = (
            levels.apply(pixels_db[name][target.order], mapping)
            for pixels_db, mapping in zip(each_db, mappings, strict=True)
        )
        calibrated_dp, fresh_dp = (score[name][0] for score in scores)
        differ = not np.array_equal(final[0].pixels_db[name], final[1].pixels_db[name])
        found[name] = MaterialPixels(start, calibrated, fresh, calibrated_dp, fresh_dp, differ)
    return found


def _notes(
    case: stages.Archive, history: History, checks: Mapping[str, LawCheck], final: Sequence[Record]
) -> list[str]:
    """Remarks on the random numbers of the simulator, and on texture."""
    notes = [repeatability(case.simulator, history.repeat_db)]
    if (case.surrogate.outputs, case.surrogate.training) == ("centred", "posterior"):
        known = {name: history.noise_variance(name) for name in checks}
        notes += [noise_sentence(name, variance) for name, variance in known.items() if variance is not None]
    notes += [texture_note(checks), not_fresh(case.simulator, final)]
    return [note for note in notes if note]
