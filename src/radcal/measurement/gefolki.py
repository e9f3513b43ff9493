"""Dense registration of two radar images: GeFolki with a regularised field.

From the papers: the rank transform instead of intensities, local inversion of contrast, a
pyramid of scales, and Gauss-Newton steps on windows that shrink (Plyer, Colin-Koeniguer and
Weissgerber, "A new coregistration algorithm for recent applications on urban SAR images",
IEEE GRSL 12 (2015); Brigot et al., "Adaptation and evaluation of an optical flow method
applied to coregistration of forest remote sensing images", IEEE JSTARS 9 (2016)).

Two things differ. Where the papers solve for each pixel in a window, here a cubic B-spline
field is found for the whole image with a penalty on its bending (Rueckert et al., IEEE TMI 18
(1999), eq. 8), stiff at first and then less so, in place of the decreasing radii. In speckle
most of a window's gradient is noise, which holds a windowed flow back; the penalty is set
against the data's own noise instead. And where the papers choose between contrast and its
inverse, each place counts with the likelihood of its local correlation, of either sign:
homogeneous ground, where both images hold nothing but speckle, then adds no noise. The last
steps weigh spatial frequencies in the same way (``benchmarks/registration.py`` has the figures).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse
from scipy.ndimage import gaussian_filter, map_coordinates, uniform_filter
from scipy.sparse.linalg import spsolve

__all__ = ["gefolki", "local_correlation", "rank_transform"]

# chosen on the even seeds of benchmarks/registration.py
_RANK_RADIUS = 16
_BLUR_PX = 0.7
_SPACING_PX = 48.0
_BENDING = 8.0
_BENDING_MATCHED = 5.0
_SPECTRUM_SMOOTHING = 12 / 512  # of the power spectra [cycles per pixel]
_COHERENCE = 0.95  # counted at most
_STIFFNESS = (4.0, 1.0, 1.0, 1.0)  # of successive Gauss-Newton steps, times _BENDING
_COARSEST_PX = 96
_LEVELS = 4
_CELL_PX = 8
_WINDOW_PX = 33
_HIGHEST = 0.8  # local correlation counted at most
_SHARED = 0.2  # and at least, where the curvature of the cost is concerned


def rank_transform(image_db: NDArray[np.float32], radius: int = _RANK_RADIUS) -> NDArray[np.float32]:
    """Rank of each pixel among its neighbours.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB] (any monotonic scale gives the same), NaN where there is none.
    radius : int
        Half width of the square neighbourhood [pixels].

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        -1 for the smallest of the neighbourhood to 1 for its largest; 0 where there is no value.
    """
    from skimage.filters.rank import equalize  # the local histogram's distribution function at the centre

    valid = np.isfinite(image_db)
    if not valid.any():
        return np.zeros(image_db.shape, dtype=np.float32)
    low, high = np.percentile(image_db[valid], [0.2, 99.8])
    steps = np.clip((image_db - low) / max(float(high - low), 1e-6) * 255.0, 0.0, 255.0)
    steps = np.where(valid, steps, 0.0).astype(np.uint8)
    square = np.ones((2 * radius + 1, 2 * radius + 1), dtype=np.uint8)
    rank = equalize(steps, square, mask=valid.astype(np.uint8)).astype(np.float32) / 127.5 - 1.0
    return np.where(valid, rank, 0.0).astype(np.float32)


def _halved(image_db: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means of 2 x 2 pixels, of those that are there."""
    rows, columns = image_db.shape[0] // 2, image_db.shape[1] // 2
    blocks = image_db[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2)
    there = np.isfinite(blocks)
    total = np.where(there, blocks, 0.0).sum(axis=(1, 3))
    count = there.sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def local_correlation(
    first: NDArray[np.float32], second: NDArray[np.float32], window_px: int = _WINDOW_PX
) -> NDArray[np.float32]:
    """Correlation of two zero-mean images in windows.

    Parameters
    ----------
    first, second : ndarray, shape (rows, columns)
        Rank transforms, 0 where there is no value.
    window_px : int
        Width of the window.

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        Between -1 and 1, 0 where a window holds nothing.
    """
    both = [uniform_filter(product, window_px) for product in (first * second, first**2, second**2)]
    norm = np.sqrt(np.maximum(both[1] * both[2], 0.0))
    return np.where(norm > 1e-6, both[0] / np.maximum(norm, 1e-6), 0.0).astype(np.float32)


def _basis(points: NDArray[np.float64], spacing: float, length: float) -> sparse.csr_array:
    """Cubic B-splines at points, shape (points, control points)."""
    x = points / spacing
    first = np.floor(x).astype(int)
    t = x - first
    weights = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    rows = np.repeat(np.arange(points.size), 4)
    columns = (first[:, None] + np.arange(4)).ravel()
    shape = (points.size, int(np.floor(length / spacing)) + 4)
    return sparse.csr_array((weights.ravel(), (rows, columns)), shape=shape)


@dataclass(frozen=True)
class _Lattice:
    """A B-spline field over an image, the same at every scale of the pyramid.

    Coefficients have shape (2, control rows, control columns) and are in pixels of the full image.
    """

    shape: tuple[int, int]

    def _axes(self, step: float, scale: int) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Bases at the centres of ``step`` pixels of an image smaller by ``scale``."""
        bases = []
        for length in self.shape:
            n = int(np.ceil(length // scale / step))
            bases.append(_basis(np.minimum((np.arange(n) + 0.5) * step * scale, length), _SPACING_PX, length))
        return bases[0], bases[1]

    def field(self, coefficients: NDArray[np.float64], scale: int = 1) -> NDArray[np.float64]:
        """Displacement [pixels of the image smaller by ``scale``], shape (2, rows, columns)."""
        rows, columns = self._axes(1.0, scale)
        return np.stack([rows @ (part @ columns.T.toarray()) for part in coefficients]) / scale

    def cells(self, scale: int) -> sparse.csr_array:
        """Basis at the centres of cells, shape (cells, control points)."""
        return sparse.csr_array(sparse.kron(*self._axes(_CELL_PX, scale), format="csr"))

    @cached_property
    def size(self) -> tuple[int, int]:
        rows, columns = self._axes(1.0, 1)
        return rows.shape[1], columns.shape[1]

    @cached_property
    def bending(self) -> sparse.csr_array:
        """Sum of squared second differences of both components, as a matrix."""
        rows, columns = self.size

        def difference(n: int, order: int) -> sparse.csr_array:
            matrix = sparse.eye_array(n, format="csr")
            for _ in range(order):
                matrix = matrix[1:] - matrix[:-1]
            return matrix

        parts = sparse.vstack(
            [
                sparse.kron(difference(rows, 2), sparse.eye_array(columns)),
                sparse.kron(sparse.eye_array(rows), difference(columns, 2)),
                np.sqrt(2.0) * sparse.kron(difference(rows, 1), difference(columns, 1)),
            ]
        )
        one = parts.T @ parts
        # a displacement of no bending at all is held by a hair, where there is no data
        return sparse.csr_array(sparse.block_diag([one, one]) + 1e-6 * sparse.eye_array(2 * rows * columns))


def _cell_sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over cells of an image, shape (rows, columns) to (cells,)."""
    for axis in (0, 1):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], _CELL_PX), axis=axis)
    return values.ravel()


def _step(
    fixed: NDArray[np.float32],
    moving: NDArray[np.float32],
    weight: NDArray[np.float32],
    there: NDArray[np.float32],
    field: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Gauss-Newton normal equations by cell: three of the matrix, two of the right-hand side."""
    at = np.indices(fixed.shape, dtype=np.float64) + field
    moved = map_coordinates(moving, at, order=1, mode="nearest")
    seen = map_coordinates(there, at, order=1, mode="constant", cval=0.0)
    weight = np.where(seen > 0.99, weight, 0.0)
    # likelihood of two images that share local structure of correlation r: what is noise in both counts
    # for nothing, and a negative r, contrast turned over, pulls the other way
    r = np.clip(local_correlation(fixed, moved), -_HIGHEST, _HIGHEST)
    sign, r = np.where(r < 0.0, -1.0, 1.0), np.abs(r)
    weight = weight * r / (1.0 - r**2)
    difference = weight * (fixed - sign * moved)
    # the mean of both gradients: second-order accurate (Malis, "Improving vision-based control", 2004)
    along, across = (0.5 * (a + sign * b) for a, b in zip(np.gradient(fixed), np.gradient(moved), strict=True))
    noise = float(0.5 * (fixed.var() + moved.var()))
    # the part r of both images' gradients is shared, the rest is noise that curves nothing
    curved = weight * np.maximum(r, _SHARED)
    products = (curved * along**2, curved * along * across, curved * across**2, along * difference, across * difference)
    return [_cell_sums(product.astype(np.float64)) / max(noise, 1e-12) for product in products]


def _matched(
    fixed: NDArray[np.float32], moving: NDArray[np.float32], field: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Both images filtered so that each spatial frequency counts by its coherence.

    The maximum-likelihood weighting of Knapp and Carter, "The generalized correlation method
    for estimation of time delay", IEEE TASSP 24 (1976), eq. 39, with spectra of the images as
    registered so far.
    """
    at = np.indices(fixed.shape, dtype=np.float64) + field
    moved = map_coordinates(moving, at, order=1, mode="nearest")
    moved = np.where(local_correlation(fixed, moved) < 0.0, -moved, moved)
    taper = np.outer(np.hanning(fixed.shape[0]), np.hanning(fixed.shape[1]))
    one, two = (fft.fft2(image * taper) for image in (fixed, moved))
    sigma = [_SPECTRUM_SMOOTHING * n for n in fixed.shape]
    spectra = ((one * two.conj()).real, np.abs(one) ** 2, np.abs(two) ** 2)
    cross, power_one, power_two = (gaussian_filter(spectrum, sigma, mode="wrap") for spectrum in spectra)
    power = np.sqrt(power_one * power_two) + 1e-12
    coherence = np.clip(cross / power, 0.0, _COHERENCE)
    response = np.sqrt(coherence / (1.0 - coherence**2) / power)
    if not response.any():
        return fixed, moving
    # the scale is free: it keeps the fixed image's power, against which the bending was chosen
    response *= np.sqrt(power.mean() / (response**2 * power).mean())
    one, two = (fft.ifft2(fft.fft2(image) * response).real.astype(np.float32) for image in (fixed, moving))
    return one, two


def _fitted(
    lattice: _Lattice,
    coefficients: NDArray[np.float64],
    scale: int,
    images: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]],
    bending: list[float],
) -> NDArray[np.float64]:
    """Coefficients after one Gauss-Newton step for each bending penalty."""
    cells = lattice.cells(scale)
    for weight in bending:
        parts = _step(*images, lattice.field(coefficients, scale))
        # in pixels of the full image a step is larger by the scale, a gradient smaller
        a00, a01, a11, b0, b1 = (part / scale**power for part, power in zip(parts, (2, 2, 2, 1, 1), strict=True))
        h00, h01, h11 = (cells.T @ (cells * a[:, None]) for a in (a00, a01, a11))
        penalty = weight * lattice.bending
        matrix = sparse.block_array([[h00, h01], [h01, h11]]) + penalty
        right = np.concatenate([cells.T @ b0, cells.T @ b1]) - penalty @ coefficients.ravel()
        coefficients = coefficients + spsolve(matrix.tocsc(), right).reshape(coefficients.shape)
    return coefficients


def gefolki(
    fixed_db: NDArray[np.float32],
    moving_db: NDArray[np.float32],
    keep: NDArray[np.bool_] | None = None,
    start: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Displacement field between two images of one size.

    Parameters
    ----------
    fixed_db, moving_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where there is none. At least 32 x 32 pixels.
    keep : ndarray of bool, shape (rows, columns), optional
        Pixels of the fixed image that count.
    start : ndarray, shape (2,), optional
        Shift to start from [pixels].

    Returns
    -------
    ndarray, shape (2, rows, columns)
        d with fixed(x) like moving(x + d(x)) [pixels].
    """
    lattice = _Lattice((fixed_db.shape[0], fixed_db.shape[1]))
    coefficients = np.zeros((2, *lattice.size))
    if start is not None:
        coefficients += np.asarray(start, dtype=np.float64)[:, None, None]
    kept = np.ones(fixed_db.shape, dtype=np.float32) if keep is None else keep.astype(np.float32)
    pyramid = [(fixed_db, moving_db, kept)]
    while len(pyramid) < _LEVELS and min(pyramid[-1][0].shape) >= 2 * _COARSEST_PX:
        fixed_db, moving_db, kept = pyramid[-1]
        pyramid.append((_halved(fixed_db), _halved(moving_db), _halved(kept)))
    for level in reversed(range(len(pyramid))):
        fixed_db, moving_db, kept = pyramid[level]
        fixed, moving = (gaussian_filter(rank_transform(image), _BLUR_PX) for image in (fixed_db, moving_db))
        weight = np.where(np.isfinite(fixed_db), kept, 0.0).astype(np.float32)
        there = np.isfinite(moving_db).astype(np.float32)
        bending = [_BENDING * stiffness for stiffness in _STIFFNESS]
        coefficients = _fitted(lattice, coefficients, 2**level, (fixed, moving, weight, there), bending)
    fixed, moving = _matched(rank_transform(fixed_db), rank_transform(moving_db), lattice.field(coefficients))
    bending = [_BENDING_MATCHED] * len(_STIFFNESS)
    return lattice.field(_fitted(lattice, coefficients, 1, (fixed, moving, weight, there), bending))
