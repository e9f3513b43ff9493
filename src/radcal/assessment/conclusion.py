"""Findings of a calibration, and what a refusal withholds.

The model says what is found of the image and of each law. Runs of an external program show whether it computes the law
of a material. The registration is made again with the image of the calibrated laws, in place of the run onto which it
was made.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.config.part import Part
from radcal.findings import Finding, Severity
from radcal.ground.pixels import MANY_IN_NOISE, share_in_noise
from radcal.inference.misfit import LawForward
from radcal.laws import Law
from radcal.objectives import Comparison
from radcal.objectives.history import History
from radcal.posterior.cells import weights_of_facets
from radcal.posterior.result import Image, Posterior
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import with_noise_db
from radcal.registration.gefolki import find_flow, pyramid
from radcal.registration.registered import Registered
from radcal.targets.target import Target, Targets, level_only

# Differences that are left to effects which are not computed [dB]. With terrain, a pixel mixes ground of several
# incidences: the best runs of the built-in simulator, whose law is right, differ by up to 2.1 dB beyond what is known
# (the steep and dark dyke of config/dyke_published.yaml). Without terrain, they do not differ beyond it.
_LEFT_DB, _LEFT_ON_TERRAIN_DB = 1.0, 3.0
_ERRORS = 3.0  # sampling errors of a bin's mean in a run
_TIMES = 1.5  # least ratio of a change to its stated standard error
_LEAST_DB = 0.5  # least change of sigma0 that a doubt names, as for a misfit
_FAR_PX = 3.0  # mean displacement from which the search starts at this displacement
Doubles = NDArray[np.float64]

_WRONG_LAW_DB = 1.0  # error of a fixed law that is named
_LEVEL_DB = 0.2  # level that is named
_OTHER = {"sigma0_ref": "sigma0_local", "beta0": "sigma0_local", "gamma0": "gamma0_rtc"}
_OTHER |= {"sigma0_local": "sigma0_ref", "gamma0_rtc": "gamma0"}


def image_findings(case: Part, image: Image) -> Iterator[Finding]:
    """Findings on radiometry, fixed laws and level of the measured images, in the order in which to act on them."""
    if case.target.normalisation == "image":
        return
    for number, one in enumerate(case.passes, start=1):
        about, shown, other = f"pass {number}", image.radiometry[str(number)], _OTHER[one.radar.radiometry]
        declared = one.radar.radiometry
        numbers: dict[str, float | str] = {
            "declared": declared, "other": other, "chance_percent": 100.0 * shown.chance,
        }  # fmt: skip
        if shown.materials:
            numbers |= {"exponent": shown.exponent, "error": shown.error}
        if shown.found:
            yield Finding("radiometry", "refusal", about, numbers, f"radar.radiometry: {other}")
        elif not shown.checked:
            yield Finding("radiometry_unchecked", "note", about, numbers)
    bright = {name for one in image.radiometry.values() for name in one.materials}  # well above the noise
    if len(image.laws_db) > 1:
        for name, error in image.laws_db.items():
            if name in bright and _differs(error, _WRONG_LAW_DB):
                yield Finding("fixed_law", "warning", name, _numbers(error, "error_db"), f"materials.{name}.parameters")
    if len(image.laws_db) == 1:
        name, apart = next(iter(image.apart_db.items()))
        severity: Severity = "warning" if _differs(apart, _LEVEL_DB) else "note"
        yield Finding("fixed_law_and_image", severity, name, _numbers(apart, "apart_db"))
    else:
        for number, level in enumerate(image.levels_db, start=1):
            about = f"pass {number}"
            if not image.laws_db:
                yield Finding("level_unchecked", "note", about, {"level_db": case.uncertainty.level_db})
            else:
                severity = "warning" if _differs(level, _LEVEL_DB) else "note"
                yield Finding("level", severity, about, _numbers(level, "level_db"))
    if not image.sampled:
        yield Finding("not_sampled", "warning", "fixed laws", {})


def _differs(quantiles: Doubles, least_db: float) -> bool:
    """Whether a level is named: its median is over a least size, and its 90 % interval leaves 0."""
    return bool(abs(quantiles[1]) > least_db and (quantiles[0] > 0.0 or quantiles[2] < 0.0))


def _numbers(quantiles: Doubles, median: str) -> dict[str, float]:
    """5 % quantile, median and 95 % quantile by name."""
    return dict(zip(("p05_db", median, "p95_db"), map(float, quantiles), strict=True))


def material_findings(
    case: Part, name: str, posterior: Posterior, targets: Sequence[Targets], refused: bool
) -> Iterator[Finding]:
    """Findings on one material: first where its sigma0 is determined, then the form of its law, then remarks."""
    yield _state(case, name, posterior, targets, refused)
    if (form := posterior.form) is not None:
        numbers = _numbers(form.rms_db, "rms_db")
        if np.isfinite(form.noticed_db):
            numbers["noticed_db"] = form.noticed_db
        code = "refuted" if form.refuted else "form_noticed" if form.noticed else "not_refuted"
        yield Finding(code, "note" if code == "not_refuted" else "warning", name, numbers)
    if not posterior.sampled:
        yield Finding("not_sampled", "warning", name, {"r_hat": posterior.r_hat, "ess": posterior.ess})
    share = share_in_noise(targets[0][name].left_out, targets[0][name].eligible)
    if share >= MANY_IN_NOISE:
        yield Finding("in_the_noise", "warning", name, {"share": share})


def _state(case: Part, name: str, posterior: Posterior, targets: Sequence[Targets], refused: bool) -> Finding:
    """Finding that says at which incidence sigma0 of a material is determined, and how well."""
    curve = posterior.curve
    if curve is None:
        few = Finding("without_cells", "warning", name)
        return Finding("parameters_only", "note", name) if posterior.cells else few
    if level_only(targets, name):
        middle = float(posterior.seen_deg[0].mean().round(1))
        return Finding("level_only", "note", name, {"incidence_deg": middle, **_numbers(curve.at(middle), "median_db")})
    low, high = float(posterior.seen_deg[:, 0].min()), float(posterior.seen_deg[:, 1].max())
    half = curve.half_widths_over(low, high)
    if refused:
        return Finding("withheld", "refusal", name, {"half_width_db": float(half.max())})
    if posterior.known_between_deg is None or posterior.known_half_width_db is None:
        numbers = {"narrowest_db": float(half.min()), "known_db": case.uncertainty.known_db}
        return Finding("undetermined", "warning", name, numbers)
    first, last = posterior.known_between_deg
    inside = (curve.incidence_deg >= first) & (curve.incidence_deg <= last)
    field = 0.5 * (curve.field_p95_db - curve.field_p05_db)
    numbers = {"half_width_db": posterior.known_half_width_db, "from_deg": first, "to_deg": last}
    if inside.any():
        numbers["field_half_width_db"] = float(field[inside].max())
        numbers["systematic_db"] = float(curve.systematic_db[inside].max())
    return Finding("determined", "note", name, numbers)


def law_findings(name: str, posterior: Posterior, law: Law, x: Doubles, warned: Collection[str]) -> Iterator[Finding]:
    """Warning if the law of the search leaves the band over the incidence seen.

    Parameters
    ----------
    name : str
        Material.
    posterior : Posterior
        Posterior of the law.
    law : Law
        Law of the material.
    x : ndarray, shape (d,)
        X of the search.
    warned : collection of str
        What the image's findings warn of.
    """
    curve = posterior.curve
    if curve is None or not law.has_curve:
        return
    angle = np.concatenate([np.linspace(low, high, 21) for low, high in posterior.seen_deg])
    (low, _, high), at = curve.at(angle), np.asarray(law(np.radians(angle), x))
    beyond = float(np.maximum(low - at, at - high).max())
    if beyond > 0.0:
        if posterior.form is not None and (posterior.form.noticed or posterior.form.refuted):
            warned = [*warned, "form of the law"]
        numbers: dict[str, float | str] = {"beyond_db": beyond, "cause": ", ".join(warned) or "unknown"}
        yield Finding("law_outside_band", "warning", name, numbers)


def moved_finding(name: str, moved_px: float, stated_px: float, moved_db: float, stated_db: float) -> Finding:
    """Finding on the registration of one material's pixels.

    A warning if displacement and sigma0 change more than their stated errors explain, and sigma0 by over 0.5 dB.

    Parameters
    ----------
    name : str
        Material.
    moved_px, stated_px : float
        Root mean square change of the displacement of the material's pixels, and root mean square of the standard
        error of its length that the registration stated [pixels].
    moved_db, stated_db : float
        Root mean square change of sigma0 of these pixels by the calibrated law, to first order, and its stated standard
        error [dB].
    """
    doubtful = moved_px > _TIMES * stated_px and moved_db > max(_TIMES * stated_db, _LEAST_DB)
    numbers = {"moved_px": moved_px, "stated_px": stated_px, "moved_db": moved_db, "stated_db": stated_db}
    severity: Severity = "warning" if doubtful else "note"
    return Finding("registration_moved", severity, name, numbers, f"materials.{name}.start" * doubtful)


def moved_again(registered: Registered, calibrated_db: NDArray[np.float32]) -> NDArray[np.float64]:
    """Change of the displacement field if the image is registered onto another simulated image.

    Parameters
    ----------
    registered : Registered
        Registered measured image, with its displacement.
    calibrated_db : ndarray, shape (rows, columns)
        Simulated image of the calibrated laws [dB].

    Returns
    -------
    ndarray, shape (2, rows, columns)
        New displacement minus present displacement [pixels].
    """
    present = registered.displacement_px.astype(np.float64)
    mean = present.mean(axis=(1, 2))
    start = mean if np.hypot(*mean) > _FAR_PX else None
    return find_flow(pyramid(calibrated_db, registered.unregistered_db), start=start).displacement_px - present


def check_registration(
    laws: Mapping[str, tuple[Law, ArrayLike]],
    targets: Mapping[str, Target],
    geometry: Geometry,
    registered: Registered,
    calibrated_db: NDArray[np.float32],
) -> Iterator[Finding]:
    """Register the measured image again, onto the image of the calibrated laws, and compare both registrations.

    The registration compares patterns of brightness. If the laws of the run onto which the image was registered differ
    much from the real laws, other slopes are bright in this run than in the measured image, and the displacement has an
    error that its standard error does not contain. The image of the calibrated laws has the right pattern if the laws
    are right. If the displacement then changes by more than its standard error, one of the two registrations is wrong.

    Parameters
    ----------
    laws : mapping
        Calibrated law of each material, and its parameters.
    targets : mapping
        Target of each material in this pass.
    geometry : Geometry
        Geometry of the pass.
    registered : Registered
        Registered measured image.
    calibrated_db : ndarray, shape (rows, columns)
        Simulated image of the calibrated laws [dB].

    Yields
    ------
    Finding
        Change of each material that has a law with a curve; none if the image was not moved.
    """
    if not registered.applied or registered.method != "gefolki":
        return
    change = moved_again(registered, calibrated_db)
    incidence = geometry.incidence_deg.astype(np.float64)
    down, right = np.gradient(incidence)
    gradient = np.stack([down, right])
    for name, (law, parameters) in laws.items():
        if name not in targets or not law.has_curve:
            continue
        pixels = targets[name].pixels
        moved, stated = change.reshape(2, -1)[:, pixels], registered.uncertainty_px.ravel()[pixels].astype(np.float64)
        steep = gradient.reshape(2, -1)[:, pixels]
        angle = np.radians(incidence.ravel()[pixels])
        slope = np.asarray(law(angle + 1e-4, parameters) - law(angle - 1e-4, parameters)) / np.degrees(2e-4)
        # an unknown direction of the error: half of its square lies along the gradient
        changes = np.stack([slope * (steep * moved).sum(axis=0), slope * np.hypot(*steep) * stated / np.sqrt(2.0)])
        moved_db, stated_db = _rms(changes[:, np.isfinite(changes).all(axis=0)])
        yield moved_finding(name, *map(float, (_rms(np.hypot(*moved)), _rms(stated), moved_db, stated_db)))


def _rms(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square along the last axis; 0 for no values."""
    return np.sqrt(np.mean(np.square(values), axis=-1)) if values.shape[-1] else np.zeros(values.shape[:-1])


def another_law(
    name: str, law: str, objective: Comparison, target: Target, history: History, geometry: Geometry
) -> Iterator[Finding]:
    """Warning if the program computes another law than the material's, whose band then says nothing about sigma0.

    Parameters
    ----------
    name, law : str
        Names of the material and of its law.
    objective : Comparison
        Objective of the material.
    target : Target
        Target of the material in the first pass.
    history : History
        Scored runs of the program.
    geometry : Geometry
        Geometry of the first pass.
    """
    if not objective.material.law.has_curve or not objective.material.decibels:
        return
    difference, beyond = beyond_law_db(name, objective, target, history, geometry)
    # only a scene in slant range has no places in a grid of the ground
    left_db = _LEFT_DB if np.isnan(geometry.ground).all() else _LEFT_ON_TERRAIN_DB
    if not np.all(beyond <= left_db):
        numbers: dict[str, float | str] = {"difference_db": float(np.abs(difference).max()), "law": law}
        yield Finding("another_law", "warning", name, numbers, f"materials.{name}.law: external")


def beyond_law_db(
    name: str, objective: Comparison, target: Target, history: History, geometry: Geometry
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Difference of the best run from the law at the same X in each bin of the first pass, and its unexplained part.

    A run differs from law and speckle by the area of the ground in a pixel, which the geometry contains, and by the
    power of noise and neighbouring materials. This power is about the same in all runs, so that it is at most the power
    of the darkest run.

    Returns
    -------
    (ndarray, ndarray), each of shape (n,)
        Mean of the best run minus the mean by law and speckle [dB]; distance of this difference from the interval which
        area, added power and three sampling errors explain [dB], negative inside the interval.
    """
    part = objective.passes[0]
    assert part is not None  # noqa: S101
    classes, material = part.classes, part.material
    each = [objective.in_pass(0, run.scores[name]) for run in history.runs if run.scores[name].own_law]
    best = objective.in_pass(0, history.best(name))
    means, sd = np.array([score.statistics for score in each])[:, :, 0], np.exp(np.array(best.statistics)[:, 1])
    expected = LawForward(material.law, classes.nodes_deg, material.looks)(np.array(best.parameters))[:, 0]
    difference = np.array(best.statistics)[:, 0] - expected
    area = 10.0 * np.log10(np.maximum(weights_of_facets(geometry)[target.pixels], 1e-9))
    by_area = np.bincount(classes.member, area, classes.size) / np.maximum(classes.count, 1)
    added = with_noise_db(expected, means.min(axis=0)) - expected
    low, high = np.minimum(by_area, 0.0), np.maximum(by_area, 0.0) + added
    error = _ERRORS * sd / np.sqrt(classes.effective)
    return difference, np.maximum(difference - high, low - difference) - error


def conclude(
    case: Part,
    history: History,
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
    geometry: Geometry,
    final_db: NDArray[np.float32],
    posteriors: Mapping[str, Posterior],
    image: Image,
    images: Sequence[Registered] = (),
    noted: Sequence[Finding] = (),
) -> list[Finding]:
    """Findings on the images in the order in which to act on them, then on each material.

    Parameters
    ----------
    case : Part
        Configuration of the case.
    history : History
        Scored runs: reference run, design and verified proposals.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    objectives : mapping
        Objective of each calibrated material.
    geometry : Geometry
        Geometry of the first pass, which holds the pixels of each material.
    final_db : ndarray, shape (rows, columns)
        Image of the final run with fresh random numbers in the first pass [dB].
    posteriors : mapping
        Posterior of each material's law.
    image : Image
        What the fixed materials say.
    images : sequence of Registered
        Registered measured image of each pass; the first is registered again onto the image of the calibrated laws.
    noted : sequence of Finding
        Findings on the geometry of all passes.
    """
    seen = targets[0]  # it shows all calibrated materials
    findings = [finding for one in images for finding in one.findings]
    findings += [*image_findings(case, image), *noted]
    refused = any(one.severity == "refusal" for one in findings)
    warned = {one.code: f"{one.code.replace('_', ' ')} of {one.about}" for one in findings if one.severity != "note"}
    laws = {name: (case.laws[name], np.asarray(history.best(name).parameters)) for name in seen}
    for name, found in laws.items():
        other = list[Finding]()
        if not (case.simulator.own or refused):
            law = case.materials[name].law
            other += another_law(name, law, objectives[name], seen[name], history, geometry)
        findings += other or material_findings(case, name, posteriors[name], targets, refused)
        looks = history.best(name).looks
        if looks < case.radar.looks:
            numbers = {"looks": looks, "looks_nominal": float(case.radar.looks)}
            findings.append(Finding("texture", "note", name, numbers))
        findings += law_findings(name, posteriors[name], *found, warned.values())
    shown = {name: law for name, law in laws.items() if not level_only(targets, name)}
    for one in images[:1]:
        findings += check_registration(shown, seen, geometry, one, final_db)
    return findings


def withheld(name: str, posterior: Posterior, findings: Sequence[Finding]) -> Posterior:
    """Posterior of a law that determines sigma0 at no angle if an image is refused, or the program's law is another."""
    refused = any(one.severity == "refusal" or (one.code, one.about) == ("another_law", name) for one in findings)
    return replace(posterior, known_between_deg=None, known_half_width_db=None) if refused else posterior
