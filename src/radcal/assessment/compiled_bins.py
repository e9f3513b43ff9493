"""Compiled functions for the likelihood of incidence-angle bins: cumulants of many curves, whitened differences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.radar.compiled import njit

__all__ = ["cumulants_at", "shifted_cumulants", "whitened"]

Doubles = NDArray[np.float64]

_PER_NEPER = 10.0 / np.log(10.0)


@njit()
def _at(curve: Doubles, place: float) -> float:
    """Level of a curve at a place on the grid of angles, interpolated linearly between two angles."""
    below = min(max(int(place), 0), curve.size - 2)
    share = place - below
    return float(curve[below] * (1.0 - share) + curve[below + 1] * share)


@njit()
def _cumulants(levels: Doubles, out: Doubles) -> None:
    mean = 0.0
    for level in levels:
        mean += level
    mean /= levels.size
    second = third = 0.0
    for level in levels:
        left = level - mean
        second += left * left
        third += left * left * left
    out[0], out[1], out[2] = mean, second / levels.size, third / levels.size


@njit()
def cumulants_at(curves: Doubles, places: Doubles, noise: float) -> Doubles:
    """Cumulants of the levels of each curve over the angles of each bin, with the power of the noise added.

    Parameters
    ----------
    curves : ndarray, shape (m, g)
        Levels of m curves on the grid of angles [dB].
    places : ndarray, shape (n, k)
        Places on the grid of angles, in steps of the grid, that represent each of n bins.
    noise : float
        Level of the noise [dB]; -inf for no noise.

    Returns
    -------
    ndarray, shape (m, n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3].
    """
    found = np.empty((len(curves), len(places), 3))
    levels = np.empty(places.shape[1])
    for m in range(len(curves)):
        for n in range(len(places)):
            for k in range(levels.size):
                level = _at(curves[m], places[n, k])
                if noise > -np.inf:
                    high, low = max(level, noise), min(level, noise)
                    level = high + _PER_NEPER * np.log1p(np.exp((low - high) / _PER_NEPER))
                levels[k] = level
            _cumulants(levels, found[m, n])
    return found


@njit()
def shifted_cumulants(
    curves: Doubles, places: Doubles, centre: float, slopes: Doubles, spreads: Doubles, offsets: Doubles
) -> Doubles:
    """Change of the cumulants of each bin by errors of the angles that represent the bin.

    Each place p on the grid of angles is replaced by several places, one for each offset:
    centre + slope * (p - centre) + spread * offset, limited to the grid.

    Parameters
    ----------
    curves : ndarray, shape (m, g)
        Levels of m curves on the grid of angles [dB].
    places : ndarray, shape (n, k)
        Places on the grid of angles, in steps of the grid, that represent each of n bins.
    centre : float
        Place about which the slopes stretch the other places, in steps of the grid.
    slopes, spreads : ndarray, shape (m, n)
        Factors of the distances from the centre, and spreads in steps of the grid, of each curve and bin.
    offsets : ndarray, shape (h,)
        Offsets in units of the spread, all of equal weight.

    Returns
    -------
    ndarray, shape (m, n, 3)
        Change of mean [dB], variance [dB^2] and third central moment [dB^3].
    """
    found = np.empty((len(curves), len(places), 3))
    before, after = np.empty(places.shape[1]), np.empty(places.shape[1] * offsets.size)
    cumulants = np.empty(3)
    last = curves.shape[1] - 1.0
    for m in range(len(curves)):
        for n in range(len(places)):
            for k in range(before.size):
                before[k] = _at(curves[m], places[n, k])
                middle = centre + slopes[m, n] * (places[n, k] - centre)
                for h in range(offsets.size):
                    place = min(max(middle + spreads[m, n] * offsets[h], 0.0), last)
                    after[k * offsets.size + h] = _at(curves[m], place)
            _cumulants(before, cumulants)
            _cumulants(after, found[m, n])
            found[m, n] -= cumulants
    return found


@njit()
def whitened(
    difference: Doubles,
    base: Doubles,
    between: Doubles,
    patches: Doubles,
    within: Doubles,
    cells: Doubles,
    log_sds: Doubles,
    error: Doubles,
) -> tuple[Doubles, Doubles]:
    """Differences whitened by the Cholesky factors of their covariances, and log-determinants of these factors.

    The covariance is the sum of four terms: ``base``; ``between * patches + within * cells`` for the means;
    ``log_sds``, multiplied by products of the variances ``between`` and ``within``, for the log standard deviations;
    and the squared errors on the diagonal.

    Parameters
    ----------
    difference : ndarray, shape (m, 3 n)
        Differences of the means [dB], then of the log standard deviations, then of the skewnesses, of n bins.
    base : ndarray, shape (3 n, 3 n)
        Part of the covariance that all m points share.
    between, within : ndarray, shape (m,)
        Variances between and within fields [dB^2].
    patches, cells : ndarray, shape (n, n)
        Covariances of the means by the effects of fields and of cells, for effects with a variance of 1 dB^2.
    log_sds : ndarray, shape (2, 2, n, n)
        Covariances of the log standard deviations for a product of two variances of 1 dB^4. The first two axes select
        the factors of the product: the variance between or within fields.
    error : ndarray, shape (m, 3)
        Standard errors of mean, log sd and skewness of each bin.

    Returns
    -------
    ndarray, shape (m, 3 n)
        Whitened differences; NaN where a covariance is not positive definite.
    ndarray, shape (m,)
        Logarithm of the determinant of the Cholesky factor.
    """
    size, n = difference.shape[1], len(patches)
    found, log_determinant = np.empty_like(difference), np.zeros(len(difference))
    factor = np.zeros((size, size))
    for m in range(len(difference)):
        for i in range(size):
            left = difference[m, i]
            for j in range(i + 1):
                value = base[i, j]
                if i < n:
                    value += between[m] * patches[i, j] + within[m] * cells[i, j]
                elif i < 2 * n and j >= n:
                    a, b = i - n, j - n
                    value += between[m] ** 2 * log_sds[0, 0, a, b] + within[m] ** 2 * log_sds[1, 1, a, b]
                    value += 2.0 * between[m] * within[m] * log_sds[0, 1, a, b]
                if i == j:
                    value += error[m, i // n] ** 2
                for k in range(j):
                    value -= factor[i, k] * factor[j, k]
                if i == j:
                    factor[i, i] = np.sqrt(value) if value > 0.0 else np.nan
                else:
                    factor[i, j] = value / factor[j, j]
                    left -= factor[i, j] * found[m, j]
            found[m, i] = left / factor[i, i]
            log_determinant[m] += np.log(factor[i, i])
    return found, log_determinant
