"""Displacement fields between two images: image warping, inversion and composition.

A displacement field ``d`` has shape (2, rows, columns): ``d[0]`` is the displacement in rows, ``d[1]`` in columns
[pixels]. Pixel x of the fixed image and position x + d(x) of the moving image show the same ground.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

_ITERATIONS = 50
_CLOSE_PX = 1e-3


def squares(image: NDArray[Any], side: int) -> NDArray[Any]:
    """Whole squares of an image, shape (rows, side, columns, side); pixels beyond the last square are left out."""
    rows, columns = (n // side for n in image.shape)
    return image[: rows * side, : columns * side].reshape(rows, side, columns, side)


def warp(image: NDArray[np.float32], displacement: NDArray[np.float64]) -> NDArray[np.float32]:
    """Moving image resampled onto the pixels of the fixed image, at the nearest pixels.

    Interpolation would lower the variance of speckle.

    Parameters
    ----------
    image : ndarray, shape (rows, columns)
        Moving image, NaN where it has no value.
    displacement : ndarray, shape (2, rows, columns)
        Field [pixels].

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        Values of ``image`` at the pixels nearest to x + d(x), NaN outside the image.
    """
    at = np.indices(displacement.shape[1:], dtype=np.float64) + displacement
    return np.asarray(
        scipy.ndimage.map_coordinates(image.astype(np.float64), at, order=0, mode="constant", cval=np.nan),
        dtype=np.float32,
    )


def _at(field: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of a field at points, shape (2, rows, columns); a point outside the image takes the border value."""
    return np.stack([scipy.ndimage.map_coordinates(part, points, order=1, mode="nearest") for part in field])


def invert(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a displacement field, by fixed-point iteration.

    Parameters
    ----------
    displacement : ndarray, shape (2, rows, columns)
        Field [pixels] that changes by less than a pixel per pixel (no folds).

    Returns
    -------
    ndarray, shape (2, rows, columns)
        Displacement field e that satisfies e(y) = -d(y + e(y)).

    Raises
    ------
    ValueError
        The iteration does not converge to 0.001 pixels, because the displacement field folds and has no inverse.

    References
    ----------
    Chen et al., "A simple fixed-point approach to invert a deformation field", Medical
    Physics 35 (2008), eq. 6.
    """
    grid = np.indices(displacement.shape[1:], dtype=np.float64)
    inverse = -np.asarray(displacement, dtype=np.float64)
    for _ in range(_ITERATIONS):
        found = -_at(displacement, grid + inverse)
        step = float(np.abs(found - inverse).max())
        inverse = found
        if step < _CLOSE_PX:
            return inverse
    raise ValueError(f"the displacement field folds: its inverse still moves by {step:.2g} pixels.")
