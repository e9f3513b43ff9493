"""Georeferenced measured images, resampled to the pixels of the scene's image."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.image.base import image_file
from radcal.reading.arrays import raster_band
from radcal.reading.images import reading
from radcal.reading.rasters import open_raster
from radcal.scene.crs import coordinates, crs_of, horizontal

if TYPE_CHECKING:
    from pyproj import CRS

Place = tuple[str, Sequence[float]]  # CRS and transform of the scene
_FAR_OFF = 5.0  # largest ratio of pixel spacing to pixel size, or of pixel size to pixel spacing


def check_spacing(path: Path, pixel_m: tuple[float, float], radar: Radar) -> None:
    """Refuse pixel spacings that are much larger or smaller than the pixels of a georeferenced image.

    If the pixels of the image were much larger than the spacings, each pixel would be used many times, as if its copies
    were independent. If the pixels of the image were much smaller, most pixels would not be used.

    Parameters
    ----------
    path : path
        File of the image, for messages.
    pixel_m : (float, float)
        Sides of the image's pixels on the ground [m].
    radar : Radar
        Pixel spacings.

    Raises
    ------
    MeasurementError
        A spacing on the ground is more than five times the mean side of the image's pixels, or less than a fifth of it.
    """
    side = float(np.sqrt(pixel_m[0] * pixel_m[1]))
    for way, per_ground in (("range", radar.slant_per_ground), ("azimuth", 1.0)):
        spacing = getattr(radar, f"{way}_spacing_m")
        if not 1.0 / _FAR_OFF <= spacing / per_ground / side <= _FAR_OFF:
            ground = f" ({spacing / per_ground:.3g} m on the ground)" if way == "range" else ""
            raise MeasurementError(
                f"radar.{way}_spacing_m is {spacing:g}{ground}, the pixels of {path} are {pixel_m[0]:.3g} x "
                f"{pixel_m[1]:.3g} m: expected about {per_ground * side:.3g}, at most {_FAR_OFF:g} times more or less."
            )


def map_pixel_m(pixel_m: tuple[float, float], radar: Radar) -> tuple[float, float]:
    """Sides of a georeferenced image's pixels along slant range and azimuth [m], as the root of their mean square.

    Parameters
    ----------
    pixel_m : (float, float)
        Sides of the pixels on the ground, to the east and to the north [m].
    radar : Radar
        Heading and angle of the pass.
    """
    east, north = pixel_m
    heading = np.radians(radar.heading_deg)
    across = float(np.hypot(east * np.cos(heading), north * np.sin(heading)))
    return across * radar.slant_per_ground, float(np.hypot(east * np.sin(heading), north * np.cos(heading)))


def read_at_ground(path: Path, config: FileMeasurement, place: Place, ground: NDArray[np.float32]) -> NDArray[Any]:
    """Numbers of a measured image on the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    path : path
        Terrain-corrected image, in which every pixel shows the ground at the pixel's map coordinates.
    config : FileMeasurement
        Band.
    place : (str, sequence of 6 float)
        The scene's CRS, and coefficients a, b, c, d, e, f of its affine transform from (column, row) of cell corners to
        coordinates.
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel of the scene's image shows, with cell centres at whole numbers; NaN where a
        pixel shows no ground.

    Returns
    -------
    ndarray, shape (rows, columns)
        Numbers of the nearest pixels; NaN outside the image, where it has no data, and where a pixel shows no ground.

    Raises
    ------
    MeasurementError
        The file cannot be read, does not hold the band, has no CRS or transform, or does not cover the scene's image.
    """
    file = image_file(path, config)
    with reading(file, "a raster"), open_raster(path, file.folders) as raster:
        crs = crs_of(raster)
        if crs is None or raster.transform.is_identity:
            raise file.refused(
                f"{path} has no coordinate reference system or no transform to one, expected a georeferenced image."
            )
        plane = horizontal(crs)
        x, y = places_on_ground(*place, ground, plane)
        window = window_around(raster.transform, raster.shape, x, y)
        values, inverse = raster_band(raster, file, window), ~raster.window_transform(window)
    # nearest pixels: a mean of n neighbours would have only 1/n of the speckle variance that the target must keep
    at_column = np.floor(inverse.a * x + inverse.b * y + inverse.c)
    at_row = np.floor(inverse.d * x + inverse.e * y + inverse.f)
    rows, columns = values.shape
    # places outside the domain of the image's projection are infinite and thus outside all bounds
    inside = (at_row >= 0) & (at_row < rows) & (at_column >= 0) & (at_column < columns)
    if not inside.any():
        raise MeasurementError(
            f"measurement.path: {path} ({plane.name}) covers no place of the scene's image, which lies {_span(x, y)} "
            "in its coordinates: expected an image of the same area."
        )
    found = np.full(inside.shape, np.nan, dtype=values.dtype)
    found[inside] = values[at_row[inside].astype(np.int64), at_column[inside].astype(np.int64)]
    shown = np.isfinite(ground).all(axis=0)
    result = np.full(shown.shape, np.nan, dtype=values.dtype)
    result[shown] = found
    return result


def window_around(transform: Any, shape: tuple[int, int], x: NDArray[np.float64], y: NDArray[np.float64]) -> Any:
    """Rectangle of a raster's pixels around coordinates; one pixel if all coordinates lie outside the raster."""
    from rasterio.windows import Window

    inverse, around = ~transform, []
    for at, size in (
        (inverse.a * x + inverse.b * y + inverse.c, shape[1]),
        (inverse.d * x + inverse.e * y + inverse.f, shape[0]),
    ):
        known = at[np.isfinite(at)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
        first = int(np.clip(np.floor(low), 0, size - 1))
        around.append((first, int(np.clip(np.floor(high) + 1, first + 1, size)) - first))
    (left, width), (top, height) = around
    return Window(left, top, width, height)


def places_on_ground(
    crs: str, transform: Sequence[float], ground: NDArray[np.float32], other: CRS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates, in another CRS, of the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    crs, transform, ground
        Parts of ``place`` of :func:`read_at_ground`, and its ``ground``.
    other : pyproj.CRS
        CRS of the coordinates.

    Returns
    -------
    x, y : ndarray, shape (pixels that show a place,)
        Coordinates; infinite outside the domain of the CRS ``other``.
    """
    row, column = (ground[k][np.isfinite(ground).all(axis=0)].astype(np.float64) + 0.5 for k in range(2))
    x, y = coordinates(crs, transform, column, row, other)
    return np.asarray(x), np.asarray(y)


def _span(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return "nowhere"
    x, y = x[known], y[known]
    return f"from ({x.min():.6g}, {y.min():.6g}) to ({x.max():.6g}, {y.max():.6g})"
