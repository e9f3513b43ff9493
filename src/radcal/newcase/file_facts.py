"""Properties of the input files of a new case: size, CRS, pixel spacing, codes, bands, scale and levels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import ConfigError
from radcal.image.acquisition import Acquisition
from radcal.reading.arrays import is_raster
from radcal.reading.intake import guarded
from radcal.reading.rasters import check_blocks, open_raster
from radcal.reading.vectors import read_vectors
from radcal.scene.crs import crs_of, horizontal, label, pixel_size_m, vertical_datum
from radcal.vectors.mapping import MOST_MATERIALS, text_of

POLARISATIONS = ("HH", "HV", "VH", "VV")
_SAMPLE_PX = 1024  # side of the sample from which the range of an image's numbers is read
_HEIGHTS_PX = 100  # side of the sample of heights for which the acquisition of a product is computed
_CLASSES = ("material", "landcover", "fclass", "class", "landuse", "code", "type")  # usual names of attributes
_STRIP_VALUES = 20_000_000
_SHARES = (0.05, 0.5, 0.95)  # quantiles that count as the levels of an image
_PER_DECADE = {"power": 10.0, "amplitude": 20.0, "complex": 20.0}


@dataclass(frozen=True)
class RasterFacts:
    """Properties of a raster, from its header and from a sample of its numbers.

    Attributes
    ----------
    rows, columns : int
        Size.
    bands : tuple of str
        Polarisation or description of each band; empty text where the file gives none.
    crs : str or None
        Horizontal CRS; None for a file without georeference.
    datum : str or None
        Vertical datum; None if the CRS does not name it.
    pixel_m : (float, float) or None
        Size of a pixel on the ground [m], east and north, in the middle of the raster.
    numbers : dict
        Sample of the finite numbers of each band, from 1; empty if it was not asked for.
    """

    rows: int
    columns: int
    bands: tuple[str, ...]
    crs: str | None
    datum: str | None
    pixel_m: tuple[float, float] | None
    numbers: Mapping[int, NDArray[Any]]

    def __str__(self) -> str:
        where = "no georeference" if self.crs is None else self.crs.splitlines()[0][:60]
        ground = "" if self.pixel_m is None else f", pixels of {self.pixel_m[0]:.4g} x {self.pixel_m[1]:.4g} m"
        several = f", {len(self.bands)} bands" if len(self.bands) > 1 else ""
        return f"{self.rows} x {self.columns} pixels{several}, {where}{ground}"

    def scale(self, band: int | None) -> str | None:
        """Scale that the numbers of a band, from 1, or those of all bands show; None if they do not show it."""
        samples = [x for k, x in self.numbers.items() if band in (None, k)]
        if samples and all(np.iscomplexobj(x) for x in samples):
            return "complex"
        return "db" if samples and all(x.size and x.real.min() < 0 for x in samples) else None

    def levels_db(self, band: int, scale: str | None) -> tuple[float, float, float] | None:
        """Levels that 5, 50 and 95 % of the numbers of a band do not exceed [dB]; None if the scale is not known."""
        numbers = self.numbers[band]
        if scale in _PER_DECADE:
            numbers = np.abs(numbers)
            numbers = _PER_DECADE[scale] * np.log10(numbers[numbers > 0])
        elif scale != "db":
            return None
        low, middle, high = np.quantile(numbers, _SHARES).tolist() if numbers.size else (np.nan,) * 3
        return (low, middle, high) if np.isfinite(middle) else None


def raster_facts(path: Path, key: str, numbers: bool = False) -> RasterFacts | None:
    """Properties of a raster; None for a file that is no raster, such as a file with a numpy array.

    Parameters
    ----------
    path : path
        File.
    key : str
        Configuration key of the file, for messages.
    numbers : bool
        Whether a sample of the numbers of each band is read.

    Raises
    ------
    ConfigError
        The file does not exist or cannot be read.
    """
    if not path.is_file():
        words = ", a SAFE folder, or the word synthetic or none" * (key == "measurement.path")
        found = "is a folder" if path.is_dir() else "does not exist"
        raise ConfigError(f"{key}: {path} {found}, expected a file{words}.")
    if not is_raster(path):
        return None
    with _raster(path, key) as raster:
        crs = crs_of(raster)
        return RasterFacts(
            raster.height,
            raster.width,
            tuple(_name(text) for text in raster.descriptions),
            None if crs is None else label(horizontal(crs)),
            None if crs is None else vertical_datum(crs),
            None if crs is None else pixel_size_m(raster, horizontal(crs)),
            {band: _sample(raster, band) for band in raster.indexes} if numbers else {},
        )


def product_acquisition(path: Path, heights: Path, polarisation: str | None) -> Acquisition | None:
    """Acquisition in the file of a measured image over a raster of heights; None if the file gives none.

    Parameters
    ----------
    path : path
        File or folder of the image.
    heights : path
        Georeferenced raster of heights [m].
    polarisation : str, optional
        Polarisation of the image; by default the first one in the product.

    Raises
    ------
    ConfigError, MeasurementError
        The raster has no CRS; the image cannot be read, or does not show the raster.
    """
    from radcal.config import FileMeasurement, Radar
    from radcal.image.base import opened
    from radcal.scene.model import Scene

    with _raster(heights, "scene.elevation") as raster:
        shape = (min(raster.height, _HEIGHTS_PX), min(raster.width, _HEIGHTS_PX))
        coarse = raster.read(1, out_shape=shape, masked=True).astype(np.float64)
        crs, transform = crs_of(raster), raster.transform
        transform *= transform.scale(raster.width / shape[1], raster.height / shape[0])
    if crs is None:
        raise ConfigError(f"scene.elevation: {heights} has no CRS, expected heights on the map for this image.")
    scene = Scene(
        identity="",
        names=("ground",),
        material=np.ones(shape, np.uint8),
        elevation_m=np.asarray(coarse.filled(np.median(coarse.compressed()) if coarse.count() else 0.0)),
        cell_m=1.0,  # the acquisition does not depend on it
        crs=horizontal(crs).to_wkt(),
        transform=tuple(transform)[:6],
        vertical_datum=vertical_datum(crs),
    )
    radar = Radar(polarisation=polarisation) if polarisation else Radar()
    return opened(FileMeasurement.model_validate({"path": str(path)}), radar).facts(scene).acquisition


def code_counts(path: Path) -> dict[int, int]:
    """Number of pixels of each code in the first band of a land-cover raster, without pixels marked as no data.

    Raises
    ------
    ConfigError
        The file cannot be read, or its numbers are of no integer type.
    """
    from rasterio.windows import Window

    counts = Counter[int]()
    with _raster(path, "scene.materials") as raster:
        if np.dtype(raster.dtypes[0]).kind not in "ui":
            raise ConfigError(f"scene.materials: {path} holds {raster.dtypes[0]}, expected whole material ids.")
        rows = max(1, _STRIP_VALUES // raster.width)
        for first in range(0, raster.height, rows):
            strip = Window(0, first, raster.width, min(rows, raster.height - first))
            codes, times = np.unique(raster.read(1, window=strip, masked=True).compressed(), return_counts=True)
            counts.update(dict(zip(codes.tolist(), times.tolist(), strict=True)))
    return dict(sorted(counts.items()))


def value_counts(path: Path) -> tuple[str, dict[str, int]]:
    """Attribute of a vector layer that tells its classes, and number of features of each of its values.

    The attribute has at most 254 values; it is the first of a few usual names, else the one that fewest features lack.

    Raises
    ------
    ConfigError
        The file cannot be read, has several layers, or has no such attribute.
    """
    import pandas as pd

    def refused(text: str) -> ConfigError:
        return ConfigError(f"scene.materials: {path} {text}")

    layer = read_vectors(path, None, refused, "layers in a mapping, and give it with --names")
    found = {}
    for name, values in layer.columns.items():
        counts = pd.Series(values).map(text_of).value_counts().drop("", errors="ignore").sort_index()
        if values.dtype.kind != "f" and 1 <= len(counts) <= MOST_MATERIALS:
            found[name] = {str(value): int(count) for value, count in counts.items()}
    if not found:
        known = ", ".join(layer.columns) or "none"
        raise refused(f"has no attribute of 1 to {MOST_MATERIALS} values (attributes: {known}), expected --names.")
    usual = [name for word in _CLASSES for name in found if name.lower() == word]
    best = usual[0] if usual else max(found, key=lambda name: sum(found[name].values()))
    return best, found[best]


@contextmanager
def _raster(path: Path, key: str) -> Iterator[Any]:
    """Context with an open raster, in which whatever a damaged file raises becomes a ConfigError."""
    with guarded(path, lambda text: ConfigError(f"{key}: {path} {text}"), "a raster"), open_raster(path) as raster:
        check_blocks(raster)
        yield raster


def _name(description: str | None) -> str:
    text = (description or "").strip()
    return next((name for name in POLARISATIONS if name in text.upper().replace("_", " ").split()), text)


def _sample(raster: Any, band: int) -> NDArray[Any]:
    """Finite numbers of a band, of at most 1024 x 1024 pixels."""
    shape = (min(raster.height, _SAMPLE_PX), min(raster.width, _SAMPLE_PX))
    values = raster.read(band, out_shape=shape, masked=True).compressed()
    values = values if np.iscomplexobj(values) else values.astype(np.float64)
    return np.asarray(values[np.isfinite(values)])
