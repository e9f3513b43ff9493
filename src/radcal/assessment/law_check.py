"""Checks of the calibrated laws: whether they are identified, and whether they predict ground that was left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.constant import Constant, constants
from radcal.assessment.fit_test import SPREAD
from radcal.assessment.incidence_check import incidence_warnings
from radcal.assessment.posterior import Posterior
from radcal.assessment.recommendation import FieldCheck, fold_of_fields, leave_fields_out, recommend
from radcal.assessment.validation import HeldOut, cross_validate, held_out
from radcal.calibration.expected import law_cumulants
from radcal.calibration.grounds import GroundLaw, fit_grounds
from radcal.calibration.history import History, Score
from radcal.calibration.misfit import true_angles
from radcal.calibration.objectives import make_objectives
from radcal.config import stages
from radcal.config.objectives import DEFAULT
from radcal.measurement.classes import FEWEST
from radcal.measurement.ground import Blocks, Ground
from radcal.measurement.patches import spreads
from radcal.measurement.pixels import MANY_IN_NOISE, share_in_noise
from radcal.measurement.target import Target, Targets
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["LawCheck", "check_laws", "texture_note"]

_IDENTIFIED = 2.0  # see GroundLaw.identified
_FOLDS = 5  # number of folds into which fields are divided


@dataclass(frozen=True)
class LawCheck:
    """Check of the law with which the calibration of a material ended.

    Attributes
    ----------
    looks, looks_nominal : float
        Effective looks of the material, and looks of the simulated speckle.
    identified : bool or None
        Whether sigma0 is known at some angles of the incidence seen (:mod:`radcal.assessment.posterior`). Without a
        posterior: whether the law's change over the incidence seen exceeds its own uncertainty. If only the density of
        all pixels was matched, a law that predicts blocks of its own ground no better than a constant is not
        identified, either. None for a law without a curve.
    held : HeldOut or None
        Errors of the predicted means of held-out blocks; None without held-out blocks.
    left_out : FieldCheck or None
        Errors of the predictions of whole fields of the calibrated ground from the other fields; None for a law without
        a curve.
    recommended, recommended_why : str
        Recommended predictor of other fields (``law``, ``constant``, or ``average`` of both), and a text with the
        reason; both are empty for a law without a curve.
    law_weight : float
        Weight of the law in the recommended predictor, from 0 to 1; NaN for a law without a curve.
    constant_db : float
        Constant level with which the law is compared [dB]: generalised least squares mean of the calibrated ground over
        fields and cells.
    between_db, within_db : float
        Standard deviations between and within fields [dB]; NaN if they were not estimated.
    incidence_error_deg : float
        Assumed standard error of the local incidence [deg].
    class_deg, class_db, class_error_db : ndarray, shape (n,)
        Mean incidence of each incidence-angle bin [deg], level of the law that would give the measured mean of the bin
        [dB], and standard error of the measured mean [dB]. Empty for objective ``density``.
    sentences : list of str
        Sentences on reasons to doubt the law.
    """

    looks: float
    looks_nominal: float
    identified: bool | None
    held: HeldOut | None
    left_out: FieldCheck | None
    recommended: str
    law_weight: float
    recommended_why: str
    constant_db: float
    between_db: float
    within_db: float
    incidence_error_deg: float
    class_deg: NDArray[np.float64]
    class_db: NDArray[np.float64]
    class_error_db: NDArray[np.float64]
    sentences: list[str]


def check_laws(
    case: stages.Archive,
    targets: Targets,
    history: History,
    posteriors: Mapping[str, Posterior] | None = None,
    withheld: Mapping[str, str] | None = None,
    doubts: Mapping[str, str] | None = None,
) -> dict[str, LawCheck]:
    """Check the best run's law of every material on the ground of the first pass.

    Parameters
    ----------
    case : stages.Archive
        The configuration.
    targets : Targets
        Target of each calibrated material.
    history : History
        All scored runs; the uncertainty of a law follows from all passes.
    posteriors : mapping, optional
        Posterior of each material's law; with it, a law counts as identified if sigma0 is known at some angles.
    withheld : mapping, optional
        For each material whose law must not be used, the reason, such as a law that does not fit.
    doubts : mapping, optional
        For each material whose law may be used, but whose sigma0 must not be called known, the reason.

    Returns
    -------
    dict
        Check of each material's law.
    """
    objectives = make_objectives(case, targets)
    one_angle = {name for name in targets if targets.level_only(name)}
    if targets.further:
        case = case.passes[0]
    scores = {name: history.best(name).scores[name] for name in targets}
    best = {name: objectives[name].in_pass(0, score) for name, score in scores.items()}
    laws = {
        name: objectives[name].law_in(0, score)
        for name, score in scores.items()
        # values of normalised images are not in dB
        if case.laws[name].has_curve and case.target.normalisation != "image"
    }
    binned = any(target.classes is not None for target in targets.values())
    if case.validation is not None and not binned:
        own = spreads([law.cell_residuals() for law in laws.values()])
        laws = {name: replace(law, spread=spread) for (name, law), spread in zip(laws.items(), own, strict=True)}
    levels = constants({name: law.ground for name, law in laws.items()})
    held = _held(case, targets, laws, levels)
    found = {
        name: _check(case, name, target, best[name], laws.get(name), levels.get(name), held.get(name))
        for name, target in targets.items()
    }
    return {
        name: _with_posterior(
            case,
            name,
            check,
            (posteriors or {}).get(name),
            name in one_angle,
            (withheld or {}).get(name, ""),
            (doubts or {}).get(name, ""),
        )
        for name, check in found.items()
    }


def _with_posterior(
    case: stages.Archive,
    name: str,
    check: LawCheck,
    posterior: Posterior | None,
    level_only: bool,
    withheld: str,
    doubt: str,
) -> LawCheck:
    """Check of a law in which the posterior decides whether the law is identified; a law not to be used is not."""
    if withheld and check.recommended:
        check = replace(check, recommended="constant", law_weight=0.0, recommended_why=withheld)
    if posterior is None or posterior.curve is None or check.identified is None:
        return check
    known = posterior.known_between_deg is not None
    others = [said for said in check.sentences if f"{name}: the law is not identified" not in said]
    # the verdict already gives the level of a material that is seen at one incidence
    why = posterior.sentence(case.uncertainty.known_db, withheld=withheld or doubt)
    nowhere = [] if known or level_only else [f"{name}: {why}"]
    linear = [] if posterior.sampled else [f"{name}: {posterior.sentences[0]}"]
    return replace(check, identified=known, sentences=[*nowhere, *linear, *others])


def texture_note(checks: Mapping[str, LawCheck]) -> str:
    """Note that lists the materials whose simulated pixels are multiplied by texture; empty if there are none."""
    found = {name: check for name, check in checks.items() if check.looks < check.looks_nominal}
    if not found:
        return ""
    each = ", ".join(f"{name} {check.looks:.2f}" for name, check in found.items())
    nominal = next(iter(found.values())).looks_nominal
    return (
        f"The simulated speckle has {nominal:.3g} looks, and the search found fewer effective looks ({each}). Values "
        "above about 0.9 of the sensor's looks, the median of their prior, show no texture. For densities and images, "
        "these simulated pixels are multiplied by gamma texture that lowers their looks to those found."
    )


def _start_db(case: stages.Archive, name: str, ground: Ground) -> NDArray[np.float64] | None:
    """Expected dB value of each pixel by the starting law, at the sensor's looks; None for a law without a curve."""
    law = case.at_start.laws[name]
    if not law.has_curve:
        return None
    level = law(np.radians(ground.incidence_deg), case.materials[name].start_parameters)
    return np.asarray(level + log_speckle_cumulants(float(case.radar.looks))[0])


def _held(
    case: stages.Archive, targets: Targets, laws: Mapping[str, GroundLaw], levels: Mapping[str, Constant]
) -> dict[str, HeldOut | None]:
    """Predictions of held-out ground; with ``keep: both`` or ``keep: fields``, each part is held out in turn."""
    if case.validation is None:
        return {}
    if case.validation.holds_out:
        return {
            name: held_out(law, levels[name], out, _start_db(case, name, out))
            for name, law in laws.items()
            if (out := targets[name].kept_out) is not None
        }
    blocks = Blocks.of(case.validation)
    folds = {
        name: fold_of_fields(law.ground.patch, _FOLDS)
        if case.validation.keep == "fields"
        else np.where(blocks.kept(law.ground.block, "even"), 0, 1)
        for name, law in laws.items()
    }
    parts: dict[str, list[HeldOut]] = {name: [] for name in laws}
    for k in range(max((int(fold.max()) for fold in folds.values()), default=0) + 1):
        kept = {name: fold != k for name, fold in folds.items() if min((fold != k).sum(), (fold == k).sum()) >= FEWEST}
        rest = {name: laws[name].ground.part(mask) for name, mask in kept.items()}
        # laws and variances are fitted anew: those of the calibration have seen the ground that is predicted
        again = fit_grounds(rest, {name: laws[name].method for name in rest})
        constant = constants({name: law.ground for name, law in again.items()})
        for name, law in again.items():
            out = laws[name].ground.part(~kept[name])
            part = held_out(law, constant[name], out, _start_db(case, name, out))
            parts[name] += [part] if part is not None else []
    return {name: HeldOut.pooled(found) for name, found in parts.items()}


def _check(
    case: stages.Archive, name: str, target: Target, score: Score,
    law: GroundLaw | None, constant: Constant | None, held: HeldOut | None,
) -> LawCheck:  # fmt: skip
    nominal, nothing, unknown = float(case.radar.looks), np.empty(0), float("nan")
    level_db = float(target.values_db.mean())
    hidden = _noise_sentences(name, target)
    if law is None or constant is None:
        return LawCheck(
            score.looks, nominal, None, None, None, "", unknown, "", level_db, *(unknown,) * 3, *(nothing,) * 3, hidden
        )
    binned = target.classes is not None
    crossed = cross_validate(law, constant, law.ground.block // Blocks.of(case.validation).parts)
    left_out = leave_fields_out(law, constant)
    choice = recommend(law, left_out, case.uncertainty.known_db)
    identified = law.identified >= _IDENTIFIED
    # three moments of all pixels do not show how the level changes with the incidence; blocks do
    worse = identified and not binned and crossed.no_better
    sentences = _doubts(name, identified, binned) + hidden + _held_sentences(case, name, held)
    if sentence := crossed.sentence(name):
        sentences.append(sentence if binned else f"{sentence} objective: {DEFAULT} can tell more.")
    centre = shown = error = nothing
    if binned:
        if law.method.free_looks and _spread_as_found(law):
            sentences += incidence_warnings(name, law.method.law, law.fit, law.ground.incidence_deg, law.method.looks)
        centre, shown, error = _levels_asked(law, score, nominal)
    estimated = binned or case.validation is not None
    return LawCheck(
        looks=law.fit.looks,
        looks_nominal=nominal,
        identified=bool(identified and not worse),
        held=held,
        left_out=left_out,
        recommended=choice.predictor,
        law_weight=choice.weight,
        recommended_why=choice.why,
        constant_db=constant.level_db,
        between_db=law.spread.between if estimated else unknown,
        within_db=law.spread.within if estimated else unknown,
        incidence_error_deg=law.method.incidence_error_deg,
        class_deg=centre,
        class_db=shown,
        class_error_db=error,
        sentences=sentences,
    )


def _spread_as_found(law: GroundLaw) -> bool:
    """Whether the pixels of the bins spread at least nearly as the speckle of the looks found.

    A level that is off can press the looks far below those of the pixels; then they say nothing about the pixels.
    """
    pixels = np.average(law.classes.cumulants[:, 1], weights=law.classes.count)
    return bool(log_speckle_cumulants(law.fit.looks)[1] < (1.0 + SPREAD) ** 2 * pixels)


def _doubts(name: str, identified: bool, binned: bool) -> list[str]:
    """Sentence on a law that is not identified; empty if it is."""
    if identified:
        return []
    why = "" if binned else f" One density of all pixels cannot tell; objective: {DEFAULT} can tell more."
    return [
        f"{name}: the law is not identified: the mean square of its change over the incidence seen is less than "
        f"{_IDENTIFIED:g} times the variance of its error.{why}"
    ]


def _noise_sentences(name: str, target: Target) -> list[str]:
    """Sentence on a material of which the noise hides a part, which selects the brighter pixels near the noise."""
    share = share_in_noise(target.left_out, target.eligible)
    if share < MANY_IN_NOISE:
        return []
    return [
        f"{name}: {100.0 * share:.0f} % of its pixels are masked, because they are in the noise (target.snr_db). The "
        "pixels that remain near the noise are the brighter ones, so that sigma0 may be found too high where the "
        "ground is darkest."
    ]


def _held_sentences(case: stages.Archive, name: str, held: HeldOut | None) -> list[str]:
    """Sentences on held-out ground: none is there, a constant predicts it better, or few means lie in the band."""
    if held is None and case.validation is not None:
        keep = case.validation.keep
        need = {
            "fields": f"keep: fields needs fields on both sides of a fold, each with {FEWEST} pixels",
            "both": f"keep: both needs {FEWEST} of its pixels in the even and in the odd blocks",
        }
        return [
            f"{name}: validation checks nothing: "
            + need.get(
                keep,
                f"no held-out block holds 20 of its pixels (validation.rows is {case.validation.rows}, keep {keep})",
            )
            + "."
        ]
    if held is None:
        return []
    lines = []
    if held.gain.worse:
        lines.append(
            f"{name}: held-out ground is predicted worse by law and field effects than by a constant with field "
            f"effects: means of {held.n_blocks} blocks are {held.rmse_law_patch_db:.2f} and "
            f"{held.rmse_constant_patch_db:.2f} dB off, the law's error in {held.n_fields} fields is "
            f"{held.gain.ratio:.2f} times the constant's."
        )
    if not held.held_in_band:
        lines.append(
            f"{name}: {100.0 * held.coverage_90:.0f} % of {held.n_blocks} held-out means lie inside the 90 % band of "
            "their predictions, fewer than chance leaves if their errors are independent."
        )
    return lines


def _levels_asked(law: GroundLaw, score: Score, nominal: float) -> tuple[NDArray[np.float64], ...]:
    """Mean incidence of each bin [deg], level of the law that gives the measured mean [dB], and standard error [dB]."""
    classes, method = law.classes, law.method
    speckle = log_speckle_cumulants(law.fit.looks)[0] - log_speckle_cumulants(nominal)[0]
    expected = np.asarray(score.statistics)[:, 0] + speckle
    nodes = true_angles(law.ground, classes, method, classes.nodes_deg)
    level, there = (law_cumulants(method.law, law.fit.parameters, at)[:, 0] for at in (classes.nodes_deg, nodes))
    # an error of the incidence changes the expected mean of a bin, and not the law
    shown = level + classes.cumulants[:, 0] - (expected + there - level)
    return classes.nodes_deg.mean(axis=1), shown, np.sqrt(classes.cumulants[:, 1] / classes.effective)
