"""Dense registration of two radar images: GeFolki, with the smoothness of the field estimated from the images.

GeFolki compares the ranks of pixels instead of intensities, allows the contrast to be inverted locally, and refines the
field by Gauss-Newton steps from coarse to fine scales (Plyer, Colin-Koeniguer and Weissgerber, "A new coregistration
algorithm for recent applications on urban SAR images", IEEE GRSL 12 (2015); Brigot et al., "Adaptation and evaluation
of an optical flow method applied to coregistration of forest remote sensing images", IEEE JSTARS 9 (2016)).

This module differs from the two papers on GeFolki in three points. First, the papers solve for the displacement of each
pixel from windows that shrink from step to step. In speckle, most of the gradient in a window is noise, and the best
size of the window depends on the smoothness of the displacement, which is not known beforehand. This module therefore
estimates one displacement field for the whole image, with a Gaussian process as prior. The standard deviation and the
correlation length of the prior are those under which the images are most probable
(:mod:`radcal.registration.spline_field`). Second, the papers choose between equal and inverted contrast of the two
images. This module weights each pixel by the likelihood of two images with the observed local correlation, which may be
positive or negative. With this weight, homogeneous ground, where both images hold only speckle, adds no noise. In the
last steps, spatial frequencies are weighted by their coherence, so that frequencies that hold only speckle add no
noise, either. Third, the papers rank a pixel within a window, which removes contrasts that are wider than the window.
This module ranks it within the whole image. Mean and variance of the ranks in a window are unknown quantities of the
likelihood, so that two images whose levels or contrasts differ locally still agree. ``benchmarks/registration.py``
measures the accuracy of the displacement field.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.processes import one_thread
from radcal.registration.displacement import squares
from radcal.registration.spline_field import CELL_PX, Data, Lattice, Prior, SplinePosterior

# chosen on the even seeds of benchmarks/registration.py
_RANK_RADIUS = 16
_BLUR_PX = 0.7
_SPECTRUM_SMOOTHING = 12 / 512  # width of the smoothing of power spectra [cycles per pixel]
_COHERENCE = 0.95  # largest coherence that is counted
_COARSEST_PX = 96
_LEVELS = 4
_WINDOW_PX = 33
_HIGHEST = 0.8  # largest local correlation that is counted
_SHARED = 0.2  # smallest local correlation in the curvature of the cost
_START = Prior(spread_px=3.0, length_px=256.0)  # a smooth field, so that the first steps converge
_STEPS_COARSEST = 4
_STEPS = 2
_STEPS_MATCHED = 4
_MISFIT = 1.2  # ratio of actual to posterior standard error; the local correlations come from the same fit
_NOISE_CELLS = 2  # side of the blocks whose gradients scatter independently [cells]
_NOISE = 1.5  # factor on the noise: neighbouring blocks are correlated, and their scatter underestimates it


def rank_transform(image_db: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rank of each pixel's value among the values within 16 rows and columns.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value. Any monotonic scale gives the same ranks.

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        Rank from -1 (smallest of the neighbourhood) to 1 (largest); 0 where a pixel has no value.
    """
    from skimage.filters.rank import equalize  # the local histogram's distribution function at the centre

    valid = np.isfinite(image_db)
    if not valid.any():
        return np.zeros(image_db.shape, dtype=np.float32)
    low, high = np.percentile(image_db[valid], [0.2, 99.8])
    steps = np.clip((image_db - low) / max(float(high - low), 1e-6) * 255.0, 0.0, 255.0)
    steps = np.where(valid, steps, 0.0).astype(np.uint8)
    square = np.ones((2 * _RANK_RADIUS + 1,) * 2, dtype=np.uint8)
    rank = equalize(steps, square, mask=valid.astype(np.uint8)).astype(np.float32) / 127.5 - 1.0
    return np.where(valid, rank, 0.0).astype(np.float32)


def _whole_ranks(image_db: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rank of each value in the whole image, from -1 to 1; a pixel without a value gets the rank of the nearest one."""
    valid = np.isfinite(image_db)
    ranks = np.zeros(image_db.shape, dtype=np.float32)
    if not valid.any():
        return ranks
    _, place, count = np.unique(image_db[valid], return_inverse=True, return_counts=True)
    ranks[valid] = ((2 * np.cumsum(count) - count) / place.size - 1.0)[place]
    nearest = scipy.ndimage.distance_transform_edt(~valid, return_distances=False, return_indices=True)
    return np.asarray(ranks[tuple(nearest)])


def _halved(image_db: NDArray[np.float32]) -> NDArray[np.float32]:
    """Image of half the size, with the mean of the valid pixels in each square of 2 x 2 pixels."""
    blocks = squares(image_db, 2)
    there = np.isfinite(blocks)
    total = np.where(there, blocks, 0.0).sum(axis=(1, 3))
    count = there.sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def local_correlation(
    first: NDArray[np.float32], second: NDArray[np.float32], window_px: int = _WINDOW_PX
) -> NDArray[np.float32]:
    """Local correlation of two zero-mean images in square windows.

    Parameters
    ----------
    first, second : ndarray, shape (rows, columns)
        Rank transforms, 0 where a pixel has no value.
    window_px : int
        Width of the window [pixels].

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        Correlation between -1 and 1, 0 where a window holds no value.
    """
    both = [scipy.ndimage.uniform_filter(product, window_px) for product in (first * second, first**2, second**2)]
    norm = np.sqrt(np.maximum(both[1] * both[2], 0.0))
    return np.where(norm > 1e-6, both[0] / np.maximum(norm, 1e-6), 0.0).astype(np.float32)


def _cell_sums(values: NDArray[np.float64], size: int = CELL_PX) -> NDArray[np.float64]:
    """Sums over square cells of an image: shape (rows, columns) to (cell rows, cell columns)."""
    for axis in (0, 1):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], size), axis=axis)
    return values


@dataclass(frozen=True)
class Level:
    """Two images at one scale.

    Attributes
    ----------
    scale : int
        Side of a pixel of this level in pixels of the full image.
    fixed, moving : ndarray of float32, shape (rows, columns)
        Ranks in the whole image.
    weight, there : ndarray of float32, shape (rows, columns)
        ``weight`` is 1 where the fixed image has a value, and ``there`` is 1 where the moving image has a value; both
        are 0 elsewhere.
    """

    scale: int
    fixed: NDArray[np.float32]
    moving: NDArray[np.float32]
    weight: NDArray[np.float32]
    there: NDArray[np.float32]

    def mirrored(self, along: slice, across: slice) -> Level:
        """Level whose moving image is mirrored, by slices for its rows and columns."""
        return replace(self, moving=self.moving[along, across], there=self.there[along, across])


@dataclass(frozen=True)
class Flow:
    """Displacement field with its posterior distribution.

    Attributes
    ----------
    displacement_px : ndarray, shape (2, rows, columns)
        Displacement d, such that fixed(x) corresponds to moving(x + d(x)) [pixels].
    posterior : SplinePosterior
        Posterior distribution of the field's coefficients.
    """

    displacement_px: NDArray[np.float64]
    posterior: SplinePosterior

    def standard_error_px(self) -> NDArray[np.float64]:
        """Standard error of the displacement's length [pixels], shape (rows, columns)."""
        return _MISFIT * self.posterior.standard_error_px()


def pyramid(fixed_db: NDArray[np.float32], moving_db: NDArray[np.float32]) -> list[Level]:
    """Ranks of two images at all scales, the finest scale first.

    Parameters
    ----------
    fixed_db, moving_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.
    """
    levels: list[Level] = []
    while True:
        ranks = (_whole_ranks(image) for image in (fixed_db, moving_db))
        there = (np.isfinite(image).astype(np.float32) for image in (fixed_db, moving_db))
        levels.append(Level(2 ** len(levels), *ranks, *there))
        if len(levels) == _LEVELS or min(fixed_db.shape) < 2 * _COARSEST_PX:
            return levels
        fixed_db, moving_db = _halved(fixed_db), _halved(moving_db)


def _step(level: Level, field: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Gauss-Newton normal equations of each cell: three entries of the matrix and two of the right-hand side."""
    at = np.indices(level.fixed.shape, dtype=np.float64) + field
    moved = scipy.ndimage.map_coordinates(level.moving, at, order=1, mode="nearest")
    fixed, moved = (image - scipy.ndimage.uniform_filter(image, _WINDOW_PX) for image in (level.fixed, moved))
    seen = scipy.ndimage.map_coordinates(level.there, at, order=1, mode="constant", cval=0.0)
    weight = np.where(seen > 0.99, level.weight, 0.0)
    # likelihood of two images with local correlation r and unknown local means and variances: noise in both has no
    # weight, and a negative r (inverse contrast) reverses the sign
    r = np.clip(local_correlation(fixed, moved), -_HIGHEST, _HIGHEST)
    sign, r = np.where(r < 0.0, -1.0, 1.0), np.abs(r)
    variance, of_moved = (scipy.ndimage.uniform_filter(image**2, _WINDOW_PX) for image in (fixed, moved))
    weight = weight * r / (1.0 - r**2) / np.sqrt(np.maximum(variance * of_moved, 1e-12))
    difference = weight * (fixed - sign * moved)
    # the mean of both gradients: second-order accurate (Malis, "Improving vision-based control", 2004)
    along, across = (0.5 * (a + sign * b) for a, b in zip(np.gradient(fixed), np.gradient(moved), strict=True))
    # the share r of both images' gradients is common; the rest is noise without curvature
    curved = weight * np.maximum(r, _SHARED)
    products = (curved * along**2, curved * along * across, curved * across**2, along * difference, across * difference)
    # in pixels of the full image, a step is larger and a gradient is smaller by the factor ``scale``
    units = (level.scale**power for power in (2, 2, 2, 1, 1))
    return [_cell_sums(product.astype(np.float64)) / unit for product, unit in zip(products, units, strict=True)]


def _data(lattice: Lattice, level: Level, coefficients: NDArray[np.float64], start: NDArray[np.float64]) -> Data:
    """Quadratic approximation, about given coefficients, of the log-likelihood as a function of coefficients - start.

    The noise is estimated from the scatter of the log-likelihood's gradients between blocks of the image (White,
    Econometrica 50 (1982), eq. 3.2).
    """
    cells = lattice.cells(level.scale)
    parts = _step(level, lattice.field(coefficients, level.scale))
    pulls, curves = (
        sum(np.square(_cell_sums(b, _NOISE_CELLS)).sum() for b in parts[3:]),
        parts[0].sum() + parts[2].sum(),
    )
    noise = max(_NOISE * float(pulls) / max(float(curves), 1e-12), 1e-12)
    a00, a01, a11, b0, b1 = (part.ravel() / noise for part in parts)
    h00, h01, h11 = (cells.T @ (cells * a[:, None]) for a in (a00, a01, a11))
    matrix = scipy.sparse.csr_array(scipy.sparse.block_array([[h00, h01], [h01, h11]]))
    pull = np.concatenate([cells.T @ b0, cells.T @ b1]) + matrix @ (coefficients - start).ravel()
    return Data(lattice, lattice.bands(matrix), pull[lattice.order])


def _matched(level: Level, field: NDArray[np.float64]) -> Level:
    """Both images filtered so that each spatial frequency is weighted by its coherence.

    The weights are the maximum-likelihood weights of Knapp and Carter, "The generalized correlation method for
    estimation of time delay", IEEE TASSP 24 (1976), eq. 39. The weights are computed from the spectra of the fixed
    image and of the moving image, which is first displaced by ``field``.
    """
    fixed, moving = level.fixed, level.moving
    at = np.indices(fixed.shape, dtype=np.float64) + field
    moved = scipy.ndimage.map_coordinates(moving, at, order=1, mode="nearest")
    moved = np.where(local_correlation(fixed, moved) < 0.0, -moved, moved)
    taper = np.outer(np.hanning(fixed.shape[0]), np.hanning(fixed.shape[1])).astype(np.float32)
    one, two = (scipy.fft.fft2(image * taper) for image in (fixed, moved))
    sigma = [_SPECTRUM_SMOOTHING * n for n in fixed.shape]
    spectra = ((one * two.conj()).real, np.abs(one) ** 2, np.abs(two) ** 2)
    cross, power_one, power_two = (scipy.ndimage.gaussian_filter(spectrum, sigma, mode="wrap") for spectrum in spectra)
    power = np.sqrt(power_one * power_two) + 1e-12
    coherence = np.clip(cross / power, 0.0, _COHERENCE)
    response = np.sqrt(coherence / (1.0 - coherence**2) / power)
    if not response.any():
        return level
    # the scale is arbitrary; this one keeps the fixed image's power
    response *= np.sqrt(power.mean() / (response**2 * power).mean())
    one, two = (scipy.fft.ifft2(scipy.fft.fft2(image) * response).real.astype(np.float32) for image in (fixed, moving))
    return replace(level, fixed=one, moving=two)


def find_flow(
    levels: list[Level],
    keep: NDArray[np.bool_] | None = None,
    start: NDArray[np.float64] | None = None,
    prior: Prior | None = None,
) -> Flow:
    """Displacement field between two images.

    Parameters
    ----------
    levels : list of Level
        From :func:`pyramid`.
    keep : ndarray of bool, shape (rows, columns), optional
        Pixels of the fixed image that are used; by default all.
    start : ndarray, shape (2,), optional
        Shift in rows and columns at which the search starts [pixels].
    prior : Prior, optional
        Standard deviation and correlation length of the field; by default they are estimated from the images.
    """
    lattice = Lattice((levels[0].fixed.shape[0], levels[0].fixed.shape[1]))
    origin = np.zeros((2, *lattice.size))
    if start is not None:
        origin += np.asarray(start, dtype=np.float64)[:, None, None]
    if keep is not None:
        kept = [keep.astype(np.float32)]
        for _ in levels[1:]:
            kept.append(_halved(kept[-1]))
        levels = [replace(level, weight=level.weight * part) for level, part in zip(levels, kept, strict=True)]
    coefficients, near = origin, prior or _START

    def step(level: Level, choose: bool) -> SplinePosterior:
        data = _data(lattice, level, coefficients, origin)
        return data.best(near) if choose and prior is None else data.given(near)

    with one_thread():  # one thread, for a fixed order of sums; from coarse to fine scales
        coarse = levels[1:] or levels
        for level in reversed(coarse):
            fixed, moving = (scipy.ndimage.gaussian_filter(image, _BLUR_PX) for image in (level.fixed, level.moving))
            blurred = replace(level, fixed=fixed, moving=moving)
            steps = _STEPS_COARSEST if level is coarse[-1] else _STEPS
            for n in range(steps):
                posterior = step(blurred, choose=n == steps - 1)
                coefficients, near = origin + posterior.coefficients(), posterior.prior
        for n in range(_STEPS_MATCHED):
            if n % 2 == 0:
                matched = _matched(levels[0], lattice.field(coefficients))
            posterior = step(matched, choose=n % 2 == 0)
            coefficients, near = origin + posterior.coefficients(), posterior.prior
        return Flow(lattice.field(coefficients), posterior)


def gefolki_px(
    _fixed: NDArray[np.float32],
    _moving: NDArray[np.float32],
    _start: NDArray[np.float64] | None,
    found_px: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Displacement [pixels] as a :class:`.Method`: the one that is found for the error of every method."""
    return found_px
