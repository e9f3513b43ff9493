"""Images in files for tests."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import rasterio
from rasterio.errors import NotGeoreferencedWarning

from radcal.config import FileMeasurement, Radar
from radcal.image.base import ReadImage
from radcal.reading.base import reader_of


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


def read_image(path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None) -> ReadImage:
    """Image in slant range as its reader gives it, of any size without a shape."""
    grid: Any = SimpleNamespace(shape=shape, on_map=None)
    reader: Any = reader_of(str(path))
    return reader(path, config, Radar()).read(grid)
