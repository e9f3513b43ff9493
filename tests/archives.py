"""Archives for tests, with results that differ from those of a calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from radcal.report.held_out_blocks import HeldOutBlocks, LeftOutFields

from radcal.assessment.posterior import Curve, Posterior
from radcal.report.archive import Archive


def changed_material(archive: Archive, name: str, **changes: Any) -> Archive:
    """Copy of an archive with changed results of one material."""
    return replace(archive, materials={**archive.materials, name: replace(archive.materials[name], **changes)})


def changed_check(archive: Archive, name: str, **changes: Any) -> Archive:
    """Copy of an archive with a changed check of one material's law."""
    return changed_material(archive, name, check=replace(archive.materials[name].check, **changes))


def held_out_blocks(**changes: Any) -> HeldOutBlocks:
    """Errors on six held-out blocks, with changes to their fields."""
    block = np.arange(6)
    values: dict[str, Any] = {"rmse_law_db": 1.25, "rmse_law_patch_db": 1.0, "rmse_constant_db": 3.0}
    values |= {"rmse_best_db": 0.75, "rmse_start_db": 4.0, "ks_law": 0.03, "ks_constant": 0.2, "ks_start": np.nan}
    values |= {"tail_law_db": 0.25, "tail_constant_db": -1.5, "tail_start_db": np.nan, "coverage_90": 0.875}
    values |= {"n_blocks": 6, "block": block, "mean_db": block + 0.0, "predicted_db": block + 0.5}
    values |= {"law_db": block + 0.7, "sd_db": np.full(6, 0.5), "rmse_constant_patch_db": 2.5, "n_fields": 3}
    values |= {"law_gain": 0.875, "law_gain_error": 0.125, "patch_gain": 0.75, "patch_gain_error": 0.25}
    values |= {"field": np.arange(3), "field_law_gain": np.full(3, 0.875), "field_patch_gain": np.full(3, 0.75)}
    return HeldOutBlocks(**{**values, **changes})


def left_out_fields(n_fields: int) -> LeftOutFields:
    """Errors on fields that were left out; unknown for fewer than two."""
    unknown = float("nan")
    if n_fields < 2:
        return LeftOutFields(unknown, unknown, unknown, float("inf"), n_fields, 0.0)
    return LeftOutFields(1.75, 2.25, 0.25, 0.125, n_fields, 3.0)


def posterior(**changes: Any) -> Posterior:
    """Posterior of a law with four parameters, known between two angles, with changes to its fields."""
    angle = np.arange(86.0)
    curve = Curve(angle, -4.0 - 0.2 * angle, -5.0 - 0.21 * angle, -3.2 - 0.18 * angle, np.full(86, 11.0))
    third, four = np.array([2.1, 3.0, 3.9]), np.array([1.0, 2.0, 3.0, 4.0])
    keys: dict[str, Any] = {
        "sampled": True,
        "ess": 812.0,
        "r_hat": 1.01,
        "steps": 1500,
        "parameters_p05": four,
        "parameters_p50": four + 0.7,
        "parameters_p95": four + 1.9,
        "looks": third,
        "between_db": 0.1 * third,
        "within_db": 0.05 * third,
        "seen_deg": np.array([[21.0, 44.0]]),
        "combinations": np.eye(4),
        "combinations_left": 0.2 * four,
        "mode_share": np.array([0.8, 0.2]),
        "mode_parameters": np.stack([four, four + 1.0]),
        "sentences": ("2 distinct laws agree with the pixels.",),
        "curve": curve,
        "known_between_deg": (22.25, 39.5),
        "known_half_width_db": 1.5,
        **changes,
    }
    return Posterior(**keys)
