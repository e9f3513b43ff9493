"""Summary of a calibration for scripts, ``summary.json``."""

from __future__ import annotations

import contextlib
import csv
import json
import math
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.assessment.curves import GRID_DEG
from radcal.assessment.posterior import KeptDraws, Posterior
from radcal.config import stages
from radcal.report.archive import Archive, Check, MaterialResult, PassSummary, RegistrationSummary
from radcal.report.fitted import misfit, overall
from radcal.report.held_out_blocks import HeldOutBlocks
from radcal.report.law_notes import found_words, outside_interval

__all__ = ["numbered_jobs", "sentences", "summarise", "wall_seconds"]

_WARNING = "warning: "  # start of a note on the measured image that the verdict counts


def numbered_jobs(archive: Archive) -> dict[str, int]:
    """Number of jobs of each workflow stage whose jobs are numbered.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.

    Returns
    -------
    dict
        Number of chunks for the stage design, and number of iterations for train, propose and verify.
    """
    iterations = int(np.count_nonzero(archive.runs.kind == "infill"))
    config = json.loads(archive.config)
    sizes = stages.DesignSize.model_validate({key: config[key] for key in stages.DesignSize.model_fields})
    chunks = -(-sizes.design_size // sizes.design.chunk)
    return {"design": chunks, **dict.fromkeys(("train", "propose", "verify"), iterations)}


def wall_seconds(folder: str | Path, jobs: Mapping[str, int] | None = None) -> dict[str, float]:
    """Wall time by stage, from Snakemake's benchmark files ``<stage>[_number].tsv``.

    Parameters
    ----------
    folder : path
        Folder of the benchmark files.
    jobs : mapping, optional
        Number of jobs of each numbered stage. Jobs are numbered from 0, and files with higher numbers, left over from
        an earlier calibration of the case, are ignored. For a stage that is not in ``jobs``, all files are counted.

    Returns
    -------
    dict
        Wall time by stage [s]; stages without a file are absent.
    """
    seconds: dict[str, float] = defaultdict(float)
    for file in sorted(Path(folder).rglob("*.tsv")):
        stage, _, number = file.stem.rpartition("_")
        if not number.isdigit():
            stage, number = file.stem, "0"
        if int(number) >= (jobs or {}).get(stage, math.inf):
            continue
        # Snakemake does not write these files atomically, so that a file may be incomplete after a kill
        with file.open(encoding="utf-8") as handle, contextlib.suppress(KeyError, TypeError, ValueError):
            seconds[stage] += sum(float(row["s"]) for row in csv.DictReader(handle, delimiter="\t"))
    return {stage: round(value, 3) for stage, value in seconds.items()}


def sentences(archive: Archive) -> list[str]:
    """Sentences on a calibration: verdicts, reasons why the search ended, and warnings about each law.

    The first sentence is the verdict on all materials; in a case of several materials, a verdict on each follows.
    Warnings on the measured image are next. The parameters of a law without a curve are told with their intervals.
    """
    each = [material.fitted.verdict for material in archive.materials.values()]
    verdicts = [_overall(archive)["verdict"], *(each if len(each) > 1 else [])]
    warnings = [said for material in archive.materials.values() for said in material.check.sentences]
    warnings += [f"{name}: {said}" for name, material in archive.materials.items() if (said := _outside(material))]
    found = [said for name, material in archive.materials.items() if (said := _without_curve(name, material))]
    return [*verdicts, *_image_warnings(archive), *archive.sentences, *found, *warnings]


def _without_curve(name: str, material: MaterialResult) -> str:
    """Sentence on the parameters of a law without a curve and their 90 % intervals; empty without a posterior."""
    if material.posterior is None or material.parameters.curve().has_curve:
        return ""
    found = dict(zip(material.parameter_names, map(float, material.parameters.values[material.best]), strict=True))
    interval = [
        dict(zip(material.parameter_names, map(float, ends), strict=True))
        for ends in (material.posterior.parameters_p05, material.posterior.parameters_p95)
    ]
    return f"{name}: {found_words(found, material.bounds.tolist(), *interval)}."


def _image_warnings(archive: Archive) -> list[str]:
    """Notes on the measured images of all passes that are warnings."""
    further = [note for one in (archive.passes or {}).values() for note in one.notes]
    return [note for note in dict.fromkeys([*archive.notes, *further]) if note.startswith(_WARNING)]


def _overall(archive: Archive) -> dict[str, Any]:
    """Whether all laws fit, and the verdict on all materials."""
    fitted = {name: material.fitted for name, material in archive.materials.items()}
    return overall(fitted, archive.converged, len(_image_warnings(archive)))


def _check(check: Check) -> dict[str, Any]:
    """Looks, identifiability and held-out errors of a law."""
    return {
        "looks": check.looks,
        "looks_nominal": check.looks_nominal,
        "identified": check.identified,
        "validation": None if check.held is None else _numbers(check.held),
        "fields_left_out": None if check.left_out is None else dict(vars(check.left_out)),
        "recommended_predictor": check.recommended or None,
        "law_weight": check.law_weight,
        "constant_db": check.constant_db,
        "recommended_why": check.recommended_why or None,
        "patch_spread_db": check.between_db,
        "cell_spread_db": check.within_db,
        "incidence_error_deg": check.incidence_error_deg,
        "law_sentences": list(check.sentences),
    }


def _posterior(material: MaterialResult) -> dict[str, Any]:
    """Posterior of a law: incidence at which sigma0 is known, curve of sigma0, and 90 % intervals of the parameters."""
    known = material.posterior
    if known is None:
        return {}
    curve, names = known.curve, material.parameter_names
    return {
        "known_between_deg": None if known.known_between_deg is None else list(known.known_between_deg),
        "sigma0_curve": None
        if curve is None
        else {key: getattr(curve, key).tolist() for key in ("incidence_deg", "median_db", "p05_db", "p95_db")},
        "levels": [dict(vars(level)) for level in known.levels()] if material.fitted.level_only else None,
        "parameters_p05": dict(zip(names, map(float, known.parameters_p05), strict=True)),
        "parameters_p95": dict(zip(names, map(float, known.parameters_p95), strict=True)),
        "parameters_remark": _outside(material) or None,
        "posterior": {
            "known_half_width_db": known.known_half_width_db,
            "sampled": known.sampled,
            "effective_sample_size": known.ess,
            "r_hat": known.r_hat,
            "looks": known.looks.tolist(),
            "field_sd_db": known.between_db.tolist(),
            "mode_shares": known.mode_share.tolist(),
            "sentences": list(known.sentences),
        },
    }


def _outside(material: MaterialResult) -> str:
    """Sentence on parameters outside their own 90 % intervals; empty if all lie inside, or without a posterior."""
    if material.posterior is None:
        return ""
    interval = list(zip(material.posterior.parameters_p05, material.posterior.parameters_p95, strict=True))
    best = material.parameters.values[material.best]
    beyond_db = _beyond_db(material, material.posterior)
    held = material.fitted.bounds if material.fitted.fits is False else ()
    return outside_interval(material.parameter_names, best, material.bounds.tolist(), interval, beyond_db, held)


def _beyond_db(material: MaterialResult, posterior: Posterior) -> float | None:
    """Largest distance of the best run's sigma0 from its 90 % band over the incidence seen [dB]; None without a band.

    The band is that of the mean power of the ground, to which the standard deviations of fields add.
    """
    curve = posterior.curve
    if curve is None:
        return None
    fields_db = np.array([[posterior.between_db[1], posterior.within_db[1]]])
    best = KeptDraws(material.parameters.values[[material.best]], posterior.looks[[1]], fields_db)
    level_db = best.curves_db(material.parameters.curve())[0]
    angle = np.concatenate([np.linspace(low, high, 21) for low, high in posterior.seen_deg])
    low, high = (np.interp(angle, curve.incidence_deg, edge) for edge in (curve.p05_db, curve.p95_db))
    at = np.interp(angle, GRID_DEG, level_db)
    return float(np.maximum(np.maximum(low - at, at - high), 0.0).max())


def _numbers(held: HeldOutBlocks) -> dict[str, Any]:
    """Errors of the predictions for held-out blocks, without the values of the individual blocks."""
    return {key: value for key, value in vars(held).items() if not isinstance(value, np.ndarray)}


def _theta(dp: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(("xi", "omega", "alpha"), map(float, dp), strict=True))


def _material(material: MaterialResult, counted: NDArray[np.bool_], tolerance: float) -> dict[str, Any]:
    best, rms, x = material.best, material.rms, material.parameters.values
    dp, target = material.dp[best], material.target_dp
    # a reference run with another law is never within the tolerance
    within = np.flatnonzero((rms <= tolerance) & np.isfinite(x).all(axis=1))
    summary = {
        "parameters": dict(zip(material.parameter_names, map(float, x[best]), strict=True)),
        "bounds": material.bounds.tolist(),
        "law": material.law,
        **({"formula": material.parameters.formula} if material.parameters.formula is not None else {}),
        "start_law": material.start.law,
        "stop_reason": material.reason,
        "sentence": material.sentence,
        **_check(material.check),
        **_posterior(material),
        "fits": material.fitted.fits,
        "level_only": material.fitted.level_only,
        "verdict": material.fitted.verdict,
        "misfit": misfit(material.fitted),
        "target": _theta(target),
        "calibrated": _theta(dp),
        "rms": float(rms[best]),
        "mse": float(rms[best] ** 2),
        "rms_start": float(rms[0]),
        "rms_final": skewnormal.density_rms(material.final_dp, target),
        "rms_fresh": skewnormal.density_rms(material.fresh_dp, target) if material.fresh else None,
        "rms_sampling": material.rms_sampling,
        "effective_pixels": material.effective,
        "left_out": json.loads(material.left_out),
        "measured_looks": material.looks,
        "textured": material.textured,
        "target_error": dict(zip(("mean", "sd", "skewness"), map(float, material.target_cp_error), strict=True)),
        "target_interval": dict(zip(("mean", "sd", "skewness"), material.target_cp_interval.tolist(), strict=True)),
        # goodness of fit of the density to the measured pixels
        "fit": {
            "ks": material.fit_ks, "ks_p": material.fit_ks_p, "ad": material.fit_ad, "ad_p": material.fit_ad_p,
        },
        "hellinger": skewnormal.hellinger(dp, target),
        "ks": skewnormal.kolmogorov_smirnov(dp, target),
        # the reference run is not counted, so that the number is zero where it is within the tolerance already
        "runs_to_tolerance": int(np.count_nonzero(counted[: within[0] + 1])) if within.size else None,
    }  # fmt: skip
    if material.hidden is not None:
        summary["hidden"] = dict(zip(material.parameter_names, map(float, material.hidden), strict=True))
        law = material.parameters.curve()
        # external laws have no curve to compare
        if law.has_curve:
            summary["law_difference_db"] = law.largest_difference_db(x[best], material.hidden, material.incidence_deg)
    return summary


def _registration(registration: RegistrationSummary) -> dict[str, Any]:
    """Registration: method, verdict, and rms, standard error and true error of the displacement [pixels]."""
    summary: dict[str, Any] = {
        "method": registration.method,
        "applied": registration.applied,
        "verdict": registration.verdict,
    }
    if registration.displacement_px is not None and registration.uncertainty_px is not None:
        field = registration.displacement_px.astype(np.float64)
        summary["rms_px"] = float(np.sqrt((field**2).sum(axis=0).mean()))
        summary["uncertainty_px"] = float(np.median(registration.uncertainty_px))
        if registration.misregistration_px is not None:
            summary["error_px"] = float(np.hypot(*(field - registration.misregistration_px)).mean())
    return summary


def _pass(one: PassSummary) -> dict[str, Any]:
    """Summary of one pass of several, with the standard deviations of the laws over its incidence."""
    known = {key: value for key, value in vars(one).items() if key not in ("keys", "materials", "final_runs")}
    return {
        **known,
        "notes": list(one.notes),
        "runs": int(np.unique(one.keys).size) + one.final_runs,
        "materials": {name: dict(vars(law)) for name, law in one.materials.items()},
    }


def _finite(value: Any) -> Any:
    """Plain data, with None in place of NaN and infinite numbers."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def summarise(archive: Archive, seconds: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Data of ``summary.json``, computed from the archive.

    Parameters
    ----------
    archive : Archive
        Results of a calibration; the images are not needed.
    seconds : mapping, optional
        Wall time by stage [s].

    Returns
    -------
    dict
        Keys of ``summary.json``; rms in 1/dB, mse in 1/dB^2, all numbers finite or None.
    """
    kinds = archive.runs.kind
    passes = archive.passes or {}
    keys = np.concatenate([one.keys for one in passes.values()] or [archive.runs.key])
    # a proposal whose run was simulated before does not count as a run; each pass of an X is a run
    made = np.isin(np.arange(keys.size), np.unique(keys, return_index=True)[1])
    each = np.tile(kinds, keys.size // kinds.size)
    runs = {kind: int(np.count_nonzero((each == kind) & made)) for kind in ("reference", "design", "infill")}
    again = int(np.count_nonzero((each == "registration") & made))
    runs["reference"] += again
    runs["final"] = sum(one.final_runs for one in passes.values()) if passes else archive.final_runs
    search = runs["design"] + runs["infill"]
    reused = int(np.count_nonzero(kinds == "reused"))
    summary: dict[str, Any] = {
        "case": archive.case,
        "objective": archive.objective,
        **_overall(archive),
        "converged": archive.converged,
        "stop_reason": archive.reason,
        "tolerance": archive.tolerance,
        "runs": {**runs, "total": sum(runs.values()), "registration": again, "search": search, "reused": reused},
        "iterations": int(np.count_nonzero(kinds == "infill")),
        "measurement": archive.measurement,
        "looks": {
            "simulated": int(archive.looks) if archive.looks.is_integer() else archive.looks,
            "measured": archive.measured_looks,
        },
        "simulator": json.loads(archive.simulator),
        "notes": list(archive.notes),
        "warnings": _image_warnings(archive),
        "law_notes": list(archive.law_notes),
        "registration": _registration(archive.registration),
        "levels": dict(vars(archive.levels)),
        "wall_seconds": dict(seconds or {}),
        "versions": json.loads(archive.versions),
        "materials": {
            name: _material(material, np.isin(kinds, ("design", "infill")), archive.tolerance)
            for name, material in archive.materials.items()
        },
    }
    if passes:
        summary["passes"] = [_pass(one) for one in passes.values()]
    result = _finite(summary)
    assert isinstance(result, dict)  # noqa: S101 - the type checker cannot infer that a dict stays a dict
    return result
