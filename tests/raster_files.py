"""Images in files for tests."""

import warnings
from pathlib import Path
from types import SimpleNamespace

import rasterio
from rasterio.errors import NotGeoreferencedWarning

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.reading.base import reader_of
from radcal.reading.images import ImageFile


def write_raster(path, values, names=(), **profile):
    """Write one band, or several along the first axis, with their names."""
    bands = values if values.ndim == 3 else values[None]
    size = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", **{"driver": "GTiff", **size, **profile}) as raster:
            raster.write(bands)
            if names:
                raster.descriptions = tuple(names)
    return Path(path)


def file_to_read(path, scale="power", band=None, dataset=None):
    """File of an image with the keys that say how it is read."""
    asked = SimpleNamespace(scale=scale, band=band, dataset=dataset)
    return ImageFile(Path(path), asked, "measurement", "path", MeasurementError)


def read_image(path, config, shape=None):
    """Image in slant range as its reader gives it, of any size without a shape."""
    grid = SimpleNamespace(shape=shape, on_map=None)
    reader = reader_of(str(path))
    return reader(path, config, Radar()).read(grid)
