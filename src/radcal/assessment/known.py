"""Findings of the assessment: what the model says of the image, of each law, and of what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.posterior import Curve, Image, Posterior
from radcal.config import stages
from radcal.findings import Finding
from radcal.measurement.pixels import MANY_IN_NOISE, share_in_noise
from radcal.measurement.target import Targets
from radcal.radar.laws import Law

__all__ = ["image_findings", "law_findings", "material_findings"]

Doubles = NDArray[np.float64]

_WRONG_LAW_DB = 1.0  # error of a fixed law that is named
_LEVEL_DB = 0.2  # level that is named
_MEANT = {1: {"sigma0_local": "sigma0_ref", "gamma0_rtc": "gamma0"}}
_MEANT[-1] = {"sigma0_ref": "sigma0_local", "beta0": "sigma0_local", "gamma0": "gamma0_rtc"}


def image_findings(case: stages.Archive, image: Image) -> Iterator[Finding]:
    """Findings on radiometry, fixed laws and level of the measured images, in the order in which to act on them."""
    if case.target.normalisation == "image":
        return
    for number, one in enumerate(case.passes, start=1):
        about, shown = f"pass {number}", image.radiometry[str(number)]
        numbers = {"exponent": shown.exponent, "error": shown.error} if shown.materials else {}
        if shown.found:
            declared = one.radar.radiometry
            meant = _MEANT[shown.found][declared]
            yield Finding(
                "radiometry",
                "refusal",
                about,
                {**numbers, "declared": declared, "found": meant},
                f"radar.radiometry: {meant}",
            )
        elif not shown.checked:
            yield Finding("radiometry_unchecked", "note", about, numbers)
    bright = {name for one in image.radiometry.values() for name in one.materials}  # well above the noise
    wrong = {
        name: error
        for name, error in image.laws_db.items()
        if name in bright and abs(error[1]) > _WRONG_LAW_DB and (error[0] > 0.0 or error[2] < 0.0)
    }
    if len(image.laws_db) > 1:
        for name, error in wrong.items():
            numbers = {"error_db": float(error[1]), "p05_db": float(error[0]), "p95_db": float(error[2])}
            yield Finding("fixed_law", "warning", name, numbers, f"materials.{name}.parameters")
    yield from _levels(case, image)
    if not image.sampled:
        yield Finding("not_sampled", "warning", "fixed laws", {})


def _levels(case: stages.Archive, image: Image) -> Iterator[Finding]:
    """Level of each pass or, of a single fixed material, difference between image and law in the first pass."""
    if len(image.laws_db) == 1:
        name, apart = next(iter(image.apart_db.items()))
        numbers = dict(zip(("p05_db", "apart_db", "p95_db"), map(float, apart), strict=True))
        yield Finding("fixed_law_and_image", "warning" if _differs(apart) else "note", name, numbers)
        return
    for number, level in enumerate(image.levels_db, start=1):
        if not image.laws_db:
            yield Finding("level_unchecked", "note", f"pass {number}", {"level_db": case.uncertainty.level_db})
            continue
        numbers = dict(zip(("p05_db", "level_db", "p95_db"), map(float, level), strict=True))
        yield Finding("level", "warning" if _differs(level) else "note", f"pass {number}", numbers)


def _differs(quantiles: Doubles) -> bool:
    """Whether a level is named: its median is over 0.2 dB and its 90 % interval leaves 0."""
    return bool(abs(quantiles[1]) > _LEVEL_DB and (quantiles[0] > 0.0 or quantiles[2] < 0.0))


def material_findings(
    case: stages.Archive, name: str, posterior: Posterior, targets: Targets, refused: bool
) -> Iterator[Finding]:
    """Findings on one material: first where its sigma0 is determined, then the form of its law, then remarks."""
    yield _state(case, name, posterior, targets, refused)
    if (form := posterior.form) is not None:
        numbers = dict(zip(("p05_db", "rms_db", "p95_db"), map(float, form.rms_db), strict=True))
        if np.isfinite(form.noticed_db):
            numbers["noticed_db"] = form.noticed_db
        code = "refuted" if form.refuted else "form_noticed" if form.noticed else "not_refuted"
        yield Finding(code, "note" if code == "not_refuted" else "warning", name, numbers)
    if not posterior.sampled:
        yield Finding("not_sampled", "warning", name, {"r_hat": posterior.r_hat, "ess": posterior.ess})
    share = share_in_noise(targets[name].left_out, targets[name].eligible)
    if share >= MANY_IN_NOISE:
        yield Finding("in_the_noise", "warning", name, {"share": share})


def _state(case: stages.Archive, name: str, posterior: Posterior, targets: Targets, refused: bool) -> Finding:
    """Finding that says at which incidence sigma0 of a material is determined, and how well."""
    curve = posterior.curve
    if curve is None:
        few = Finding("without_cells", "warning", name)
        return Finding("parameters_only", "note", name) if posterior.cells else few
    if targets.level_only(name):
        level = posterior.levels()[0]
        numbers = {"incidence_deg": level.incidence_deg, "median_db": level.median_db}
        return Finding("level_only", "note", name, {**numbers, "p05_db": level.p05_db, "p95_db": level.p95_db})
    low, high = float(posterior.seen_deg[:, 0].min()), float(posterior.seen_deg[:, 1].max())
    half = np.interp(np.linspace(low, high, 91), curve.incidence_deg, curve.half_width_db)
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


def law_findings(name: str, posterior: Posterior, law: Law, x: Doubles, causes: Mapping[str, str]) -> Iterator[Finding]:
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
    causes : mapping
        What the image's findings name as cause, by code.
    """
    curve = posterior.curve
    if curve is None or not law.has_curve:
        return
    beyond = _beyond_db(curve, law, x, posterior.seen_deg)
    if beyond > 0.0:
        numbers: dict[str, float | str] = {"beyond_db": beyond, "cause": ", ".join(causes.values()) or "cause unknown"}
        yield Finding("law_outside_band", "warning", name, numbers)


def _beyond_db(curve: Curve, law: Law, x: Doubles, seen_deg: Doubles) -> float:
    """Largest distance of a law from the 90 % band over the incidence seen [dB]."""
    angle = np.concatenate([np.linspace(low, high, 21) for low, high in seen_deg])
    low, high = (np.interp(angle, curve.incidence_deg, edge) for edge in (curve.p05_db, curve.p95_db))
    at = np.asarray(law(np.radians(angle), x))
    return float(np.maximum(np.maximum(low - at, at - high), 0.0).max())
