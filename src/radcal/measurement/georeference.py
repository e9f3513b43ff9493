"""Georeferenced measured images: which of their pixels lies where the scene's image looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement
from radcal.errors import MeasurementError
from radcal.images import is_raster, open_raster
from radcal.measurement.readers import read_raster
from radcal.scene.crs import crs_of

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = ["GeoreferencedImage", "is_georeferenced", "read_georeferenced", "values_at_ground"]


@dataclass(frozen=True)
class GeoreferencedImage:
    """A measured image on the map.

    Attributes
    ----------
    path : path
        The file, for messages.
    values : ndarray, shape (rows, columns)
        Numbers as read, NaN where there are none.
    transform : affine.Affine
        From (column, row) of pixel corners to coordinates.
    crs : pyproj.CRS
        Of the coordinates.
    """

    path: Path
    values: NDArray[Any]
    transform: Any
    crs: CRS


def is_georeferenced(path: Path) -> bool:
    """Whether a file is a raster with a CRS and a transform to it.

    A file that cannot be read is none: reading it tells why.

    Parameters
    ----------
    path : path
        Any measured image.
    """
    if not is_raster(path):
        return False
    try:
        with open_raster(path) as raster:
            return not raster.transform.is_identity and crs_of(raster) is not None
    except Exception:  # what the libraries raise on damaged files has no common base
        return False


def read_georeferenced(path: Path, config: FileMeasurement) -> GeoreferencedImage:
    """Read a measured image with where it lies.

    Parameters
    ----------
    path : path
        A file of which :func:`is_georeferenced` is true.
    config : FileMeasurement
        Band.

    Raises
    ------
    MeasurementError
        The file cannot be read, or has no CRS or transform.
    """
    values, transform, crs = read_raster(path, config)
    if crs is None or transform.is_identity:
        raise MeasurementError(
            f"measurement.path: {path} has no coordinate reference system or no transform to one, expected a "
            "georeferenced image."
        )
    return GeoreferencedImage(path, values, transform, crs)


def values_at_ground(
    image: GeoreferencedImage, crs: str, transform: Sequence[float], ground: NDArray[np.float32]
) -> NDArray[Any]:
    """Values of a georeferenced image at the places that the pixels of the scene's image show.

    Parameters
    ----------
    image : GeoreferencedImage
        Terrain-corrected: what stands at a place on the map is what lies there.
    crs : str
        The scene's CRS.
    transform : sequence of 6 float
        The scene's affine a, b, c, d, e, f from (column, row) of cell corners to coordinates.
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel of the scene's image shows, in cells with cell
        centres at integers; NaN where it shows none.

    Returns
    -------
    ndarray, shape (rows, columns)
        Values of the nearest pixels, NaN outside the image and where nothing is shown.

    Raises
    ------
    MeasurementError
        The image lies elsewhere.
    """
    from pyproj import CRS, Transformer

    if image.values.dtype.kind not in "fc":
        raise TypeError(f"values are {image.values.dtype}, expected floating-point numbers, which have NaN")
    shown = np.isfinite(ground).all(axis=0)
    row, column = (ground[k][shown].astype(np.float64) + 0.5 for k in range(2))
    a, b, c, d, e, f = transform
    to_image = Transformer.from_crs(CRS.from_user_input(crs), image.crs, always_xy=True)
    x, y = to_image.transform(a * column + b * row + c, d * column + e * row + f)
    inverse = ~image.transform
    # nearest pixels: a mean of n neighbours has 1/n of the variance of speckle, and the spread is what the
    # target density is made of
    at_column = np.floor(inverse.a * x + inverse.b * y + inverse.c)
    at_row = np.floor(inverse.d * x + inverse.e * y + inverse.f)
    rows, columns = image.values.shape
    # places outside the domain of the image's projection are infinite, and beyond every bound
    inside = (at_row >= 0) & (at_row < rows) & (at_column >= 0) & (at_column < columns)
    if not inside.any():
        raise MeasurementError(
            f"measurement.path: {image.path} ({image.crs.name}) covers no place of the scene's image, which lies "
            f"{_span(x, y)} in its coordinates: expected an image of the same area."
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
