"""Properties of the input files of a new case: size, CRS, pixel spacing, codes, bands and scale."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radcal.errors import ConfigError, RadcalError, WrongNumbers
from radcal.reading.arrays import is_raster
from radcal.reading.rasters import check_blocks, open_raster
from radcal.scene.crs import crs_of, horizontal, label, pixel_size_m, vertical_datum

if TYPE_CHECKING:
    from radcal.image.acquisition import Acquisition

__all__ = [
    "RasterFacts",
    "check_overlap",
    "code_counts",
    "landcover_codes",
    "product_acquisition",
    "raster_facts",
    "swapped_hint",
]

_POLARISATIONS = ("HH", "HV", "VH", "VV")
_SAMPLE_PX = 1024  # side of the sample from which the range of an image's numbers is read
_HEIGHTS_PX = 100  # side of the sample of heights for which the acquisition of a product is computed
_STRIP_VALUES = 20_000_000


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
        For each band, from 1: lowest, median and highest number of a sample, or "complex", or None if the sample holds
        no number.
    """

    rows: int
    columns: int
    bands: tuple[str, ...]
    crs: str | None
    datum: str | None
    pixel_m: tuple[float, float] | None
    numbers: Mapping[int, tuple[float, float, float] | str | None] = field(default_factory=dict)

    def sentence(self) -> str:
        """Size, CRS and pixel size in words."""
        where = "no georeference" if self.crs is None else self.crs.splitlines()[0][:60]
        ground = "" if self.pixel_m is None else f", pixels of {self.pixel_m[0]:.4g} x {self.pixel_m[1]:.4g} m"
        several = f", {len(self.bands)} bands" if len(self.bands) > 1 else ""
        return f"{self.rows} x {self.columns} pixels{several}, {where}{ground}"

    @property
    def polarised(self) -> int | None:
        """Number of the first band, from 1, whose name is a polarisation; None if there is none."""
        return next((k for k, name in enumerate(self.bands, start=1) if name in _POLARISATIONS), None)

    def scale(self, band: int | None) -> str | None:
        """Scale that the numbers of a band show, or those of all bands; None if they do not show it.

        Parameters
        ----------
        band : int or None
            Number of the band, from 1; None for all bands.
        """
        numbers = [self.numbers.get(k) for k in ((band,) if band is not None else range(1, len(self.bands) + 1))]
        if all(isinstance(one, tuple) and one[0] < 0 for one in numbers):
            return "db"
        return "complex" if all(one == "complex" for one in numbers) else None


@cache
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
    if path.is_dir():
        raise ConfigError(f"{key}: {path} is a folder, expected a file.")
    if not path.is_file():
        words = ", expected a file, a SAFE folder, or the word synthetic or none" * (key == "measurement.path")
        raise ConfigError(f"{key}: the file {path} does not exist{words}.")
    if not is_raster(path):
        return None
    try:
        with open_raster(path) as raster:
            crs = crs_of(raster)
            return RasterFacts(
                raster.height,
                raster.width,
                tuple(_name(text) for text in raster.descriptions),
                None if crs is None else label(horizontal(crs)),
                None if crs is None else vertical_datum(crs),
                None if crs is None else pixel_size_m(raster, horizontal(crs)),
                {band: _numbers(raster, band) for band in raster.indexes} if numbers else {},
            )
    except ConfigError:
        raise
    except Exception as error:  # the libraries' exceptions for damaged files have no common base class
        raise ConfigError(f"{key}: {path} cannot be read as a raster ({error}).") from None


@cache
def product_acquisition(path: Path, heights: Path, polarisation: str | None) -> Acquisition:
    """Acquisition of a Sentinel-1 product over a raster of heights.

    Parameters
    ----------
    path : path
        SAFE folder or its manifest.
    heights : path
        Georeferenced raster of heights [m].
    polarisation : str, optional
        Polarisation of the image; by default the first one in the product.

    Raises
    ------
    ConfigError, MeasurementError
        The raster has no CRS; the product cannot be read, or does not show the raster.
    """
    from radcal.config import FileMeasurement, Radar
    from radcal.scene.model import Scene
    from radcal.sentinel1.overpass import overpass_unchecked

    with open_raster(heights) as raster:
        check_blocks(raster)
        shape = (min(raster.height, _HEIGHTS_PX), min(raster.width, _HEIGHTS_PX))
        coarse = raster.read(1, out_shape=shape, masked=True).astype(np.float64)
        down, across = raster.height / shape[0], raster.width / shape[1]
        middle = float(np.median(coarse.compressed())) if coarse.count() else 0.0
        crs, t = crs_of(raster), raster.transform
    if crs is None:
        raise ConfigError(f"scene.elevation: {heights} has no CRS, expected heights on the map for a Sentinel-1 image.")
    scene = Scene(
        identity="",
        names=("ground",),
        material=np.ones(shape, np.uint8),
        elevation_m=np.asarray(coarse.filled(middle)),
        cell_m=1.0,  # the acquisition does not depend on it
        crs=horizontal(crs).to_wkt(),
        transform=(t.a * across, t.b * down, t.c, t.d * across, t.e * down, t.f),
        vertical_datum=vertical_datum(crs),
    )
    radar = Radar(polarisation=polarisation) if polarisation else Radar()
    return overpass_unchecked(path, FileMeasurement.model_validate({"path": str(path)}), radar, scene).acquisition


def check_overlap(elevation: str, materials: str) -> None:
    """Raise an error if the rasters of elevation and land cover have no common area.

    Parameters
    ----------
    elevation, materials : str
        Paths of two rasters with a CRS.

    Raises
    ------
    SceneError
        The rasters do not overlap, or one of them cannot be a raster of a scene.
    """
    from radcal.config import RasterScene
    from radcal.scene.grid import opened, overlap

    scene = RasterScene.model_construct(elevation=elevation, materials=materials)
    with opened("scene.elevation", scene) as heights, opened("scene.materials", scene) as cover:
        overlap(heights, cover)


def code_counts(path: Path) -> dict[int, int]:
    """Number of pixels of each code in the first band of a land-cover raster, without pixels marked as no data.

    Raises
    ------
    ConfigError
        The file cannot be read, or its numbers are of no integer type.
    """
    from rasterio.windows import Window

    counts: dict[int, int] = {}
    try:
        with open_raster(path) as raster:
            check_blocks(raster)
            if np.dtype(raster.dtypes[0]).kind not in "ui":
                text = f"scene.materials: {path} holds {raster.dtypes[0]}, expected whole material ids."
                raise ConfigError(text, WrongNumbers("scene.materials", path, raster.dtypes[0]))
            rows = max(1, _STRIP_VALUES // raster.width)
            for first in range(0, raster.height, rows):
                strip = Window(0, first, raster.width, min(rows, raster.height - first))
                codes, times = np.unique(raster.read(1, window=strip, masked=True).compressed(), return_counts=True)
                for code, count in zip(codes.tolist(), times.tolist(), strict=True):
                    counts[code] = counts.get(code, 0) + count
    except ConfigError:
        raise
    except Exception as error:  # as above
        raise ConfigError(f"scene.materials: {path} cannot be read as a raster ({error}).") from None
    return dict(sorted(counts.items()))


def landcover_codes(path: Path, elevation: str | None) -> dict[int, int]:
    """Number of pixels of each code in a land cover, without code 0.

    Parameters
    ----------
    path : path
        Raster of land cover.
    elevation : str or None
        Path of the raster of heights, which the user may have exchanged with the land cover.

    Raises
    ------
    ConfigError
        The file cannot be read, or its numbers are of no integer type.
    """
    try:
        counts = code_counts(path)
    except ConfigError as error:
        hint = "" if elevation is None else swapped_hint(Path(elevation).expanduser(), error)
        raise ConfigError(f"{error}{hint}", error.about) from None
    return {code: count for code, count in counts.items() if code != 0}


def swapped_hint(elevation: Path, error: RadcalError) -> str:
    """Question whether heights and land cover are swapped, for a problem of a land cover that holds no codes.

    Parameters
    ----------
    elevation : path
        Raster of heights.
    error : RadcalError
        Problem; the hint is empty for a problem of another file, and if the raster of heights holds no whole numbers.
    """
    about = error.about
    if not (isinstance(about, WrongNumbers) and about.key == "scene.materials" and about.what.startswith("float")):
        return ""
    try:
        code_counts(elevation)  # refuses a raster of fractions
    except ConfigError:
        return ""
    return f" scene.elevation: {elevation} holds whole numbers: are the two files swapped?"


def _name(description: str | None) -> str:
    text = (description or "").strip()
    return next((name for name in _POLARISATIONS if name in text.upper().replace("_", " ").split()), text)


def _numbers(raster: Any, band: int) -> tuple[float, float, float] | str | None:
    """Lowest, median and highest number of a sample of a band."""
    if "complex" in raster.dtypes[band - 1]:
        return "complex"
    check_blocks(raster)
    shape = (min(raster.height, _SAMPLE_PX), min(raster.width, _SAMPLE_PX))
    values = raster.read(band, out_shape=shape, masked=True).compressed().astype(np.float64)
    values = values[np.isfinite(values)]
    return (float(values.min()), float(np.median(values)), float(values.max())) if values.size else None
