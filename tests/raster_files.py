"""GeoTIFFs for tests."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.errors import NotGeoreferencedWarning


def write_raster(path: str | Path, values: np.ndarray, names: Sequence[str | None] = (), **profile: Any) -> Path:
    """Write one band, or several along the first axis, with their names."""
    bands = values if values.ndim == 3 else values[None]
    size = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", driver="GTiff", **size, **profile) as raster:
            raster.write(bands)
            if names:
                raster.descriptions = tuple(names)
    return Path(path)
