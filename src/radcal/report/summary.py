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

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.config import stages
from radcal.radar.laws import Law
from radcal.report.law_records import read_law
from radcal.storage.records import read_hdf5

__all__ = ["law_difference_db", "numbered_jobs", "sentences", "summarise", "wall_seconds"]


def law_difference_db(law: Law, found: ArrayLike, hidden: ArrayLike, incidence_deg: ArrayLike) -> float:
    """Largest difference of two laws over the incidence seen.

    Parameters
    ----------
    law : Law
        The law.
    found, hidden : array_like, shape (d,)
        Parameters.
    incidence_deg : array_like
        Local incidence of the material's pixels [deg]; its 5 to 95 % range counts.

    Returns
    -------
    float
        Maximum of the absolute difference [dB].
    """
    low, high = np.percentile(np.asarray(incidence_deg), [5.0, 95.0])
    phi = np.radians(np.linspace(low, high, 201))
    return float(np.max(np.abs(law(phi, found) - law(phi, hidden))))


def numbered_jobs(archive: str | Path) -> dict[str, int]:
    """Number of jobs of each stage that the workflow numbers.

    Parameters
    ----------
    archive : path
        ``calibration.h5``.

    Returns
    -------
    dict
        Chunks of the design; iterations for train, propose and verify.
    """
    with read_hdf5(archive, "calibration") as file:
        iterations = int(np.count_nonzero(file["runs/kind"].asstr()[()] == "infill"))
        config = json.loads(str(file.attrs["config"]))
    sizes = stages.DesignSize.model_validate({key: config[key] for key in stages.DesignSize.model_fields})
    chunks = -(-sizes.design_size // sizes.design.chunk)
    return {"design": chunks, **dict.fromkeys(("train", "propose", "verify"), iterations)}


def wall_seconds(folder: str | Path, jobs: Mapping[str, int] | None = None) -> dict[str, float]:
    """Wall time by stage, from Snakemake's benchmark files ``<stage>[_number].tsv``.

    Parameters
    ----------
    folder : path
        Where the files are.
    jobs : mapping, optional
        Number of jobs of numbered stages, counted from 0: files beyond are left over from an
        earlier calibration of the case. All files count for stages that are not named.

    Returns
    -------
    dict
        Seconds by stage; none for a stage without a file.
    """
    seconds: dict[str, float] = defaultdict(float)
    for file in sorted(Path(folder).glob("*.tsv")):
        stage, _, number = file.stem.rpartition("_")
        if not number.isdigit():
            stage, number = file.stem, "0"
        if int(number) >= (jobs or {}).get(stage, math.inf):
            continue
        # Snakemake writes them in place: one whose job was killed meanwhile may be cut
        with file.open(encoding="utf-8") as handle, contextlib.suppress(KeyError, TypeError, ValueError):
            seconds[stage] += sum(float(row["s"]) for row in csv.DictReader(handle, delimiter="\t"))
    return {stage: round(value, 3) for stage, value in seconds.items()}


def sentences(archive: str | Path) -> list[str]:
    """Sentences on the end of each material, and warnings about its law."""
    with read_hdf5(archive, "calibration") as file:
        of_laws = [
            str(sentence) for group in file["materials"].values() for sentence in group["check"].attrs["sentences"]
        ]
        return [*(str(sentence) for sentence in file.attrs["sentences"]), *of_laws]


_HELD_OUT = (
    *("rmse_law_db", "rmse_law_patch_db", "rmse_constant_db", "rmse_best_db", "rmse_start_db"),
    *("ks_law", "ks_constant", "ks_start", "tail_law_db", "tail_constant_db", "tail_start_db", "coverage_90"),
)


def _check(group: h5py.Group) -> dict[str, Any]:
    """Looks, identifiability and held-out errors of a law."""
    identified = int(group.attrs["identified"])
    validation = None
    if "n_blocks" in group.attrs:
        validation = {**{key: float(group.attrs[key]) for key in _HELD_OUT}, "n_blocks": int(group.attrs["n_blocks"])}
    return {
        "looks": float(group.attrs["looks"]),
        "looks_nominal": float(group.attrs["looks_nominal"]),
        "identified": None if identified < 0 else bool(identified),
        "validation": validation,
        "patch_spread_db": float(group.attrs["between_db"]),
        "cell_spread_db": float(group.attrs["within_db"]),
        "incidence_error_deg": float(group.attrs["incidence_error_deg"]),
        "law_sentences": [str(sentence) for sentence in group.attrs["sentences"]],
    }


def _theta(dp: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(("xi", "omega", "alpha"), map(float, dp), strict=True))


def _material(group: h5py.Group, counted: NDArray[np.bool_], tolerance: float) -> dict[str, Any]:
    best = int(group.attrs["best"])
    rms = group["rms"][()]
    dp, target = group["dp"][best], group["target_dp"][()]
    names = [str(name) for name in group.attrs["parameter_names"]]
    # a reference run of another law reaches nothing
    within = np.flatnonzero((rms <= tolerance) & np.isfinite(group["parameters"][()]).all(axis=1))
    summary = {
        "parameters": dict(zip(names, map(float, group["parameters"][best]), strict=True)),
        "bounds": group["bounds"][()].tolist(),
        "law": str(group.attrs["law"]),
        "start_law": str(group["start"].attrs["law"]),
        "stop_reason": str(group.attrs["reason"]),
        "sentence": str(group.attrs["sentence"]),
        **_check(group["check"]),
        "target": _theta(target),
        "calibrated": _theta(dp),
        "rms": float(rms[best]),
        "mse": float(rms[best] ** 2),
        "rms_start": float(rms[0]),
        "rms_final": skewnormal.density_rms(group["final_dp"][()], target),
        # archives of earlier versions do not say, and were not asked
        "rms_fresh": skewnormal.density_rms(group["fresh_dp"][()], target) if group.attrs.get("fresh", True) else None,
        "rms_sampling": float(group.attrs["rms_sampling"]),
        "effective_pixels": float(group.attrs["effective"]),
        "left_out": json.loads(group.attrs["left_out"]),
        "measured_looks": float(group.attrs["looks"]),
        "textured": bool(group.attrs["textured"]),
        "target_error": dict(zip(("mean", "sd", "skewness"), map(float, group["target_cp_error"][()]), strict=True)),
        "target_interval": dict(zip(("mean", "sd", "skewness"), group["target_cp_interval"][()].tolist(), strict=True)),
        # the measured pixels against the density fitted to them
        "fit": {key: float(group.attrs[f"fit_{key}"]) for key in ("ks", "ks_p", "ad", "ad_p")},
        "hellinger": skewnormal.hellinger(dp, target),
        "ks": skewnormal.kolmogorov_smirnov(dp, target),
        # the reference run is not counted: zero where it is within the tolerance already
        "runs_to_tolerance": int(np.count_nonzero(counted[: within[0] + 1])) if within.size else None,
    }
    if "hidden" in group:
        summary["hidden"] = dict(zip(names, map(float, group["hidden"][()]), strict=True))
    law = read_law(group["parameters"])
    # only the simulator knows what an external law makes of its parameters
    if "hidden" in group and law.has_curve:
        summary["law_difference_db"] = law_difference_db(
            law, group["parameters"][best], group["hidden"][()], group["incidence_deg"][()]
        )
    return summary


def _registration(group: h5py.Group) -> dict[str, Any]:
    """Registration: method, verdict and lengths [pixels]."""
    summary: dict[str, Any] = {
        "method": str(group.attrs["method"]),
        "applied": bool(group.attrs["applied"]),
        "verdict": str(group.attrs["verdict"]),
    }
    if summary["applied"]:
        field = group["displacement_px"][()].astype(np.float64)
        summary["rms_px"] = float(np.sqrt((field**2).sum(axis=0).mean()))
        summary["uncertainty_px"] = float(np.median(group["uncertainty_px"][()]))
        if "misregistration_px" in group:
            summary["error_px"] = float(np.hypot(*(field - group["misregistration_px"][()])).mean())
    return summary


def _levels(group: h5py.Group) -> dict[str, Any]:
    """Assumed level, and the offset that it implies [dB]."""
    return {
        "normalisation": str(group.attrs["normalisation"]),
        **{key: float(group.attrs[key]) for key in ("offset_db", "offset_error_db", "scale")},
        "sentence": str(group.attrs["sentence"]),
        "doubtful": bool(group.attrs["doubtful"]),
        "unit": str(group.attrs["unit"]),
    }


def _finite(value: Any) -> Any:
    """Replace numbers that are not finite by None."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def summarise(archive: str | Path, seconds: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Plain data of ``summary.json`` from the archive.

    Parameters
    ----------
    archive : path
        ``calibration.h5``.
    seconds : mapping, optional
        Wall time by stage [s].

    Returns
    -------
    dict
        Keys as documented; rms in 1/dB, mse in 1/dB^2, numbers finite or None.
    """
    with read_hdf5(archive, "calibration") as file:
        kinds = file["runs/kind"].asstr()[()]
        # a proposal that was simulated before is no further run
        made = np.isin(np.arange(kinds.size), np.unique(file["runs/key"].asstr()[()], return_index=True)[1])
        runs = {kind: int(np.count_nonzero((kinds == kind) & made)) for kind in ("reference", "design", "infill")}
        runs["final"] = int(file.attrs["final_runs"])
        tolerance = float(file.attrs["tolerance"])
        reused = int(np.count_nonzero(kinds == "reused"))
        summary: dict[str, Any] = {
            "case": str(file.attrs["case"]),
            "objective": str(file.attrs["objective"]),
            "converged": bool(file.attrs["converged"]),
            "stop_reason": str(file.attrs["reason"]),
            "tolerance": tolerance,
            "runs": {**runs, "total": sum(runs.values()), "reused": reused},
            "iterations": int(np.count_nonzero(kinds == "infill")),
            "measurement": str(file.attrs["measurement"]),
            "looks": {"simulated": int(file.attrs["looks"]), "measured": float(file.attrs["measured_looks"])},
            "simulator": json.loads(str(file.attrs["simulator"])),
            "notes": [str(note) for note in file.attrs["notes"]],
            "law_notes": [str(note) for note in file.attrs["law_notes"]],
            "registration": _registration(file["registration"]),
            "levels": _levels(file["levels"]),
            "wall_seconds": dict(seconds or {}),
            "versions": json.loads(str(file.attrs["versions"])),
            "materials": {
                name: _material(group, np.isin(kinds, ("design", "infill")), tolerance)
                for name, group in file["materials"].items()
            },
        }
    result = _finite(summary)
    assert isinstance(result, dict)  # noqa: S101 - it came in as one
    return result
