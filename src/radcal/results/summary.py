"""Summary of a calibration for scripts, ``summary.json``."""

from __future__ import annotations

import contextlib
import csv
import json
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radcal import skewnormal
from radcal.findings import Finding
from radcal.laws import Law
from radcal.posterior.result import HeldOut, Posterior
from radcal.registration.registered import Registered
from radcal.results.archive import Archive, MaterialResult
from radcal.results.law_notes import found_words
from radcal.words import asked_steps, beside_headline, headline, remarks, sentence, verdict

_FORM = ("noticed", "refuted", "noticed_db")
_DENSITY, _CENTRED = ("xi", "omega", "alpha"), ("mean", "sd", "skewness")
_POSTERIOR = ("known_half_width_db", "sampled", "r_hat", "cells", "fields", "looks")
_LEVELS = ("normalisation", "offset_db", "offset_error_db", "scale", "unit")


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
    iterations = _iterations(archive)
    chunks = len(archive.passes) * archive.configured.design_parts
    return {"design": chunks, **dict.fromkeys(("train", "propose", "verify"), iterations)}


def _iterations(archive: Archive) -> int:
    """Number of iterations; each has made one or several infill runs."""
    return int(np.unique(archive.runs.index[archive.runs.kind == "infill"]).size)


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
    """Sentences on a calibration: verdicts, warnings, and reasons why the search ended.

    The first sentence is the verdict on all materials, with what to do next; in a case of several materials, a verdict
    on each follows. The parameters of a law without a curve are told with their intervals.
    """
    findings = archive.findings
    each = [verdict(name, findings) for name in archive.materials]
    lines = [_verdict(archive), *(each if len(each) > 1 else [])]
    found = [text for name in archive.materials if (text := _without_curve(archive, name))]
    return [
        *lines,
        *beside_headline(_warnings(archive), findings),
        *(sentence(one.finding) for one in archive.decision.materials.values()),
        *found,
    ]


def _without_curve(archive: Archive, name: str) -> str:
    """Sentence on the parameters of a law without a curve and their 90 % intervals; empty for a law with a curve."""
    posterior, material = archive.materials[name].posterior, archive.configured.materials[name]
    if archive.configured.laws[name].has_curve:
        return ""
    found, low, high = (
        dict(zip(material.parameter_names, map(float, x), strict=True))
        for x in (archive.laws[name], posterior.parameters_p05, posterior.parameters_p95)
    )
    return f"{name}: {found_words(found, material.box, low, high)}."


def _warnings(archive: Archive) -> list[str]:
    """Warnings and refusals: notes on the measured images of all passes, and findings that no verdict tells."""
    others = [one for each in archive.passes.values() for one in each.registered.measurement.findings]
    found = [*_notes(archive), *others, *remarks(archive.findings)]
    return list(dict.fromkeys(sentence(one) for one in found if one.severity != "note"))


def _notes(archive: Archive) -> list[Finding]:
    """Findings on the measurement of the first pass, on simulator and passes."""
    return [*archive.registered.measurement.findings, *archive.notes]


def _verdict(archive: Archive) -> str:
    return headline(list(archive.materials), archive.findings, archive.decision.converged)


def _posterior(material: MaterialResult, names: Sequence[str]) -> dict[str, Any]:
    """Posterior of a law: incidence at which sigma0 is determined, curve, parameters, and error of the form."""
    known = material.posterior
    curve, form = known.curve, known.form
    parameters = {key: getattr(known, key) for key in ("parameters_p05", "parameters_p95", "parameters_model")}
    return {
        "identified": None if curve is None else known.known_between_deg is not None,
        "known_between_deg": known.known_between_deg,
        "sigma0_curve": None if curve is None else vars(curve),
        "levels": _levels(known) if material.level_only else None,
        **{key: None if x is None else dict(zip(names, x, strict=True)) for key, x in parameters.items()},
        "misfit": None if form is None else {"form_rms_db": form.rms_db, **{key: getattr(form, key) for key in _FORM}},
        "validation": None if known.held is None else _validation(known.held),
        "fields_left_out": None if known.left_out is None else _validation(known.left_out),
        "posterior": {
            **{key: getattr(known, key) for key in _POSTERIOR},
            "effective_sample_size": known.ess,
            "field_sd_db": known.between_db,
            "cell_sd_db": known.within_db,
        },
    }


def _levels(known: Posterior) -> list[dict[str, Any]]:
    """Sigma0 at the middle incidence of each pass; empty for a law without a curve."""
    if known.curve is None:
        return []
    keys = ("incidence_deg", "p05_db", "median_db", "p95_db")
    return [dict(zip(keys, (deg, *known.curve.at(deg)), strict=True)) for deg in known.middles_deg]


def _validation(held: HeldOut) -> dict[str, Any]:
    """Errors of the predictions of cells that were left out."""
    each = {"": held.predicted, "law_": held.law, "constant_": held.constant}
    return {
        "n_cells": held.patch.size,
        "n_fields": int(np.unique(held.patch).size),
        **{f"rmse_{which}db": held.rmse_db(by) for which, by in each.items()},
        **{f"coverage_{which}90": held.coverage_90(by) for which, by in each.items()},
    }


def _material(archive: Archive, name: str, material: MaterialResult) -> dict[str, Any]:
    best, rms, x = material.best, material.rms, material.parameters
    configured, law = archive.configured.materials[name], archive.configured.laws[name]
    names = configured.parameter_names
    target, ending = material.target, archive.decision.materials[name]
    dp, counted = material.dp[best], np.isin(archive.runs.kind, ("design", "infill"))
    # a reference run with another law is never within the tolerance
    within = np.flatnonzero((rms <= archive.configured.stop.rms) & np.isfinite(x).all(axis=1))
    summary = {
        "parameters": dict(zip(names, x[best], strict=True)),
        "bounds": np.array(configured.box),
        "law": configured.law,
        **({"formula": configured.formula} if configured.formula is not None else {}),
        "start_law": configured.at_start.law,
        "stop_reason": ending.reason or "running",
        "sentence": sentence(ending.finding),
        "looks": material.looks[best],
        "looks_nominal": float(archive.configured.radar.looks),
        "incidence_error_deg": target.incidence_error_deg,
        **_posterior(material, names),
        "fits": material.fits,
        "level_only": material.level_only,
        "target": dict(zip(_DENSITY, target.dp, strict=True)),
        "calibrated": dict(zip(_DENSITY, dp, strict=True)),
        "rms": rms[best],
        "mse": rms[best] ** 2,
        "rms_start": rms[0],
        "rms_final": material.rms_final,
        "rms_fresh": material.rms_fresh,
        "rms_sampling": target.rms_sampling,
        "effective_pixels": target.effective,
        "left_out": target.left_out,
        "measured_looks": target.looks,
        "textured": material.textured,
        "target_error": dict(zip(_CENTRED, target.cp_error, strict=True)),
        # goodness of fit of the density to the measured pixels
        "fit": vars(target.goodness),
        "hellinger": skewnormal.hellinger(dp, target.dp),
        "ks": skewnormal.kolmogorov_smirnov(dp, target.dp),
        # the reference run is not counted, so that the number is zero where it is within the tolerance already
        "runs_to_tolerance": int(np.count_nonzero(counted[: within[0] + 1])) if within.size else None,
    }
    if material.hidden is not None:
        summary["hidden"] = dict(zip(names, material.hidden, strict=True))
        # external laws have no curve to compare
        if law.has_curve:
            summary["law_difference_db"] = law.largest_difference_db(x[best], material.hidden, target.incidence_deg)
            if (model := material.posterior.parameters_model) is not None:
                difference = law.largest_difference_db(model, material.hidden, target.incidence_deg)
                summary["law_difference_model_db"] = difference
    return summary


def _registration(registered: Registered) -> dict[str, Any]:
    """Registration: method, verdict, and rms, standard error and true error of the displacement [pixels]."""
    summary: dict[str, Any] = {key: getattr(registered, key) for key in ("method", "applied", "verdict")}
    if registered.applied:
        field = registered.displacement_px.astype(np.float64)
        summary["rms_px"] = float(np.sqrt((field**2).sum(axis=0).mean()))
        summary["uncertainty_px"] = float(np.median(registered.uncertainty_px))
        if (true_px := registered.measurement.misregistration_px) is not None:
            summary["error_px"] = float(np.hypot(*(field - true_px)).mean())
    return summary


def _pass(archive: Archive, number: str, final_runs: int) -> dict[str, Any]:
    """Summary of one pass of several, with the laws over its incidence."""
    one, configured = archive.passes[number], archive.configured.passes[int(number) - 1]
    radar, measurement = configured.radar, one.registered.measurement
    missing = [name for name, material in archive.materials.items() if number not in material.targets]
    too_few = [Finding("too_few_pixels", "note", name) for name in missing]
    return {
        "depression_deg": radar.centre_depression_deg,
        "look_side": radar.look_side,
        "polarisation": radar.polarisation,
        "looks": float(radar.looks),
        "measurement": measurement.source,
        "registration": one.registered.verdict,
        "levels": sentence(one.levels.finding),
        "notes": list(map(sentence, (*measurement.findings, *too_few))),
        "runs": int(np.unique(one.keys).size) + final_runs,
        "materials": {
            name: _pass_law(archive, number, name, configured.laws[name])
            for name in archive.materials
            if name not in missing
        },
    }


def _pass_law(archive: Archive, number: str, name: str, law: Law) -> dict[str, Any]:
    """Law of a material over the incidence of one pass, from 5 to 95 % of the pixels of its target."""
    one, material = archive.passes[number], archive.materials[name]
    target, hidden = material.targets[number], one.registered.measurement.hidden.get(name)
    low, high = np.quantile(target.incidence_deg.astype(np.float64), [0.05, 0.95])
    curve = material.posterior.curve
    difference_db = None
    if hidden is not None and law.has_curve:
        difference_db = law.largest_difference_db(archive.laws[name], hidden, target.incidence_deg)
    return {
        "low_deg": low,
        "high_deg": high,
        "rms": one.rms.get(name),
        "half_width_db": None if curve is None else curve.half_widths_over(low, high).max(),
        "pixels": target.pixels.size,
        "difference_db": difference_db,
    }


def _final_runs(archive: Archive) -> dict[str, int]:
    """Number of final runs in each pass that were not simulated before."""
    known, found = {key for one in archive.passes.values() for key in one.keys}, {}
    for number, one in archive.passes.items():
        new = set(one.final_keys) - known
        known |= new
        found[number] = len(new)
    return found


def _finite(value: Any) -> Any:
    """Plain data: lists in place of arrays, and None in place of NaN and infinite numbers."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
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
    keys, final_runs = np.concatenate([one.keys for one in archive.passes.values()]), _final_runs(archive)
    # a proposal whose run was simulated before does not count as a run; each pass of an X is a run
    made = np.isin(np.arange(keys.size), np.unique(keys, return_index=True)[1])
    each = np.tile(kinds, keys.size // kinds.size)
    runs = {kind: int(np.count_nonzero((each == kind) & made)) for kind in ("reference", "design", "infill")}
    again = int(np.count_nonzero((each == "registration") & made))
    runs["reference"] += again
    runs["final"] = sum(final_runs.values())
    looks = float(archive.configured.radar.looks)
    search = runs["design"] + runs["infill"]
    reused = int(np.count_nonzero(kinds == "reused"))
    fits = [material.fits for material in archive.materials.values()]
    findings = (*archive.findings, *_notes(archive), *archive.law_notes)
    summary: dict[str, Any] = {
        "case": archive.configured.case,
        "objective": archive.configured.objective,
        "fits": False if False in fits else None if None in fits else True,
        "verdict": _verdict(archive),
        "converged": archive.decision.converged,
        "stop_reason": archive.decision.reason or "running",
        "tolerance": archive.configured.stop.rms,
        "runs": {**runs, "total": sum(runs.values()), "registration": again, "search": search, "reused": reused},
        "iterations": _iterations(archive),
        "measurement": archive.registered.measurement.source,
        "looks": {"simulated": int(looks) if looks.is_integer() else looks, "measured": archive.measured_looks},
        "simulator": json.loads(archive.simulator),
        "notes": list(map(sentence, _notes(archive))),
        "warnings": _warnings(archive),
        "next": [one.text for one in asked_steps(archive.findings)],
        "findings": [{**vars(one), "text": sentence(one, prefix=False)} for one in findings],
        "law_notes": list(map(sentence, archive.law_notes)),
        "registration": _registration(archive.registered),
        "levels": {key: getattr(archive.levels, key) for key in _LEVELS}
        | {"sentence": sentence(archive.levels.finding)},
        "fixed_laws": {
            "levels_db": archive.image.levels_db,
            "errors_db": archive.image.laws_db,
            "radiometry": [{**vars(one), "found": one.found} for one in archive.image.radiometry.values()],
        },
        "wall_seconds": dict(seconds or {}),
        "versions": json.loads(archive.versions),
        "materials": {
            name: {**_material(archive, name, material), "verdict": verdict(name, archive.findings)}
            for name, material in archive.materials.items()
        },
    }
    if len(archive.passes) > 1:
        summary["passes"] = [_pass(archive, number, count) for number, count in final_runs.items()]
    result = _finite(summary)
    assert isinstance(result, dict)  # noqa: S101 - the type checker cannot infer that a dict stays a dict
    return result
