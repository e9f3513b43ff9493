"""Archives for tests, with results that differ from those of a calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from radcal.report.archive import Archive, HeldOutBlocks


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
    values |= {"law_db": block + 0.7, "sd_db": np.full(6, 0.5)}
    return HeldOutBlocks(**{**values, **changes})
