"""Findings of the assessment: what the model says of the image, of each law, and of what to do next."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.findings import Finding, Severity
from radcal.ground.pixels import MANY_IN_NOISE, share_in_noise
from radcal.laws import Law
from radcal.posterior.result import Image, Posterior
from radcal.targets.target import Targets, level_only

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
