"""Georeferenced measured images, resampled to the pixels of the scene's image."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.image.readers import Places, read_raster
from radcal.reading.arrays import is_raster
from radcal.reading.rasters import open_raster
from radcal.scene.crs import crs_of, horizontal, pixel_size_m, transformer

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = [
    "GeoreferencedImage",
    "check_spacing",
    "is_georeferenced",
    "map_pixel_m",
    "off_the_map",
    "places_on_ground",
    "read_georeferenced",
    "values_at_ground",
]

_FAR_OFF = 5.0  # largest ratio of pixel spacing to pixel size, or of pixel size to pixel spacing


@dataclass(frozen=True)
class GeoreferencedImage:
    """Measured image with CRS and transform.

    Attributes
    ----------
    path : path
        Path of the file, for messages.
    values : ndarray, shape (rows, columns)
        Numbers as read from the file, NaN where the file has no data.
    transform : affine.Affine
        Affine transform from (column, row) of pixel corners to coordinates.
    crs : pyproj.CRS
        CRS of the coordinates.
    """

    path: Path
    values: NDArray[Any]
    transform: Any
    crs: CRS


def is_georeferenced(path: Path, folders: Sequence[Path] = ()) -> bool:
    """Whether a file is a raster with a CRS and a transform from its pixels to coordinates in this CRS.

    For a file that cannot be read, the function returns False; the function that reads the file later raises an error.

    Parameters
    ----------
    path : path
        Path of a measured image of any format.
    folders : sequence of path
        Folders that may contain the source files of a VRT, besides the folder of the VRT.
    """
    if not is_raster(path):
        return False
    try:
        with open_raster(path, folders) as raster:
            return not raster.transform.is_identity and crs_of(raster) is not None
    except Exception:  # the libraries' exceptions for damaged files have no common base class
        return False


def off_the_map(path: Path, crs: str, folders: Sequence[Path] = ()) -> str:
    """Text for the error about an image whose size differs, for which :func:`is_georeferenced` is false.

    Parameters
    ----------
    path, folders
        Arguments of :func:`is_georeferenced`.
    crs : str
        The scene's CRS.
    """
    from pyproj import CRS

    lacks = "CRS"
    if is_raster(path):
        with contextlib.suppress(Exception), open_raster(path, folders) as raster:
            lacks = "CRS" if crs_of(raster) is None else "transform from its pixels to the map"
    return (
        f", and the file has no {lacks}, expected a georeferenced image, as the scene in "
        f"{CRS.from_user_input(crs).name} is, or one in slant range on the grid of the scene's image"
    )


def check_spacing(path: Path, radar: Radar, folders: Sequence[Path] = ()) -> None:
    """Refuse pixel spacings that are much larger or smaller than the pixels of a georeferenced image.

    If the pixels of the image were much larger than the spacings, each pixel would be used many times, as if its copies
    were independent. If the pixels of the image were much smaller, most pixels would not be used.

    Parameters
    ----------
    path : path
        File for which :func:`is_georeferenced` is true.
    radar : Radar
        Pixel spacings.
    folders : sequence of path
        Folders that may contain the source files of a VRT, besides the folder of the VRT.

    Raises
    ------
    MeasurementError
        A spacing on the ground is more than five times the mean side of the image's pixels, or less than a fifth of it.
    """
    sides = _sides_m(path, folders)
    side = float(np.sqrt(sides[0] * sides[1]))
    for way, per_ground in (("range", radar.slant_per_ground), ("azimuth", 1.0)):
        spacing = getattr(radar, f"{way}_spacing_m")
        if not 1.0 / _FAR_OFF <= spacing / per_ground / side <= _FAR_OFF:
            ground = f" ({spacing / per_ground:.3g} m on the ground)" if way == "range" else ""
            raise MeasurementError(
                f"radar.{way}_spacing_m is {spacing:g}{ground}, the pixels of {path} are {sides[0]:.3g} x "
                f"{sides[1]:.3g} m: expected about {per_ground * side:.3g}, at most {_FAR_OFF:g} times more or less."
            )


def _sides_m(path: Path, folders: Sequence[Path]) -> tuple[float, float]:
    with open_raster(path, folders) as raster:
        crs = crs_of(raster)
        return pixel_size_m(raster, horizontal(crs)) if crs is not None else (1.0, 1.0)


def map_pixel_m(path: Path, radar: Radar, folders: Sequence[Path] = ()) -> tuple[float, float]:
    """Sides of a georeferenced image's pixels along slant range and azimuth [m], as the root of their mean square.

    Parameters
    ----------
    path, radar, folders
        Arguments of :func:`check_spacing`.
    """
    east, north = _sides_m(path, folders)
    heading = np.radians(radar.heading_deg)
    across = float(np.hypot(east * np.cos(heading), north * np.sin(heading)))
    return across * radar.slant_per_ground, float(np.hypot(east * np.sin(heading), north * np.cos(heading)))


def read_georeferenced(path: Path, config: FileMeasurement, places: Places | None = None) -> GeoreferencedImage:
    """Read a measured image with its CRS and transform.

    Parameters
    ----------
    path : path
        File for which :func:`is_georeferenced` is true.
    config : FileMeasurement
        Band.
    places : callable, optional
        Function that returns the coordinates of interest in a given CRS; only the rectangle around these coordinates is
        read.

    Raises
    ------
    MeasurementError
        The file cannot be read, or has no CRS or transform.
    """
    values, transform, crs = read_raster(path, config, places)
    if crs is None or transform.is_identity:
        raise MeasurementError(
            f"measurement.path: {path} has no coordinate reference system or no transform to one, expected a "
            "georeferenced image."
        )
    return GeoreferencedImage(path, values, transform, crs)


def places_on_ground(
    crs: str, transform: Sequence[float], ground: NDArray[np.float32], other: CRS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates, in another CRS, of the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    crs, transform, ground
        Arguments of :func:`values_at_ground`.
    other : pyproj.CRS
        CRS of the coordinates.

    Returns
    -------
    x, y : ndarray, shape (pixels that show a place,)
        Coordinates; infinite outside the domain of the CRS ``other``.
    """
    from pyproj import CRS

    row, column = (ground[k][np.isfinite(ground).all(axis=0)].astype(np.float64) + 0.5 for k in range(2))
    a, b, c, d, e, f = transform
    to_other = transformer(CRS.from_user_input(crs), other)
    x, y = to_other.transform(a * column + b * row + c, d * column + e * row + f)
    return np.asarray(x), np.asarray(y)


def values_at_ground(
    image: GeoreferencedImage, crs: str, transform: Sequence[float], ground: NDArray[np.float32]
) -> NDArray[Any]:
    """Values of a georeferenced image on the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    image : GeoreferencedImage
        Terrain-corrected image, in which every pixel shows the ground at the pixel's map coordinates.
    crs : str
        The scene's CRS.
    transform : sequence of 6 float
        Coefficients a, b, c, d, e, f of the scene's affine transform from (column, row) of cell corners to coordinates.
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel of the scene's image shows, with cell centres at whole numbers; NaN where a
        pixel shows no ground.

    Returns
    -------
    ndarray, shape (rows, columns)
        Values of the nearest pixels, NaN outside the image and where a pixel shows no ground.

    Raises
    ------
    MeasurementError
        The image does not cover the scene's image.
    """
    if image.values.dtype.kind not in "fc":
        raise TypeError(f"values are {image.values.dtype}, expected floating-point numbers, which have NaN")
    shown = np.isfinite(ground).all(axis=0)
    x, y = places_on_ground(crs, transform, ground, image.crs)
    inverse = ~image.transform
    # nearest pixels: a mean of n neighbours would have only 1/n of the speckle variance that the target must keep
    at_column = np.floor(inverse.a * x + inverse.b * y + inverse.c)
    at_row = np.floor(inverse.d * x + inverse.e * y + inverse.f)
    rows, columns = image.values.shape
    # places outside the domain of the image's projection are infinite and thus outside all bounds
    inside = (at_row >= 0) & (at_row < rows) & (at_column >= 0) & (at_column < columns)
    if not inside.any():
        raise MeasurementError(
            f"measurement.path: {image.path} ({image.crs.name}) covers no place of the scene's image, which lies "
            f"{_span(x, y)} in its coordinates: expected an image of the same area.",
        )
    found = np.full(inside.shape, np.nan, dtype=image.values.dtype)
    found[inside] = image.values[at_row[inside].astype(np.int64), at_column[inside].astype(np.int64)]
    result = np.full(shown.shape, np.nan, dtype=image.values.dtype)
    result[shown] = found
    return result


def _span(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return "nowhere"
    x, y = x[known], y[known]
    return f"from ({x.min():.6g}, {y.min():.6g}) to ({x.max():.6g}, {y.max():.6g})"
