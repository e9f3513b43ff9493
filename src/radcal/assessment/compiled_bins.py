"""Compiled parts of the bins' likelihood: cumulants over many angles of many curves, and whitened differences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.radar.compiled import njit

__all__ = ["cumulants_at", "shifted_cumulants", "whitened"]

Doubles = NDArray[np.float64]

_PER_NEPER = 10.0 / np.log(10.0)


@njit()
def _at(curve: Doubles, place: float) -> float:
    """Level at a place on the grid, between whose angles a curve is straight."""
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
    """Cumulants of the levels of a bin, with noise added.

    Parameters
    ----------
    curves : ndarray, shape (m, g)
        Levels on the grid [dB].
    places : ndarray, shape (n, k)
        Places on the grid, in steps of the grid, that stand for each of n bins.
    noise : float
        Level of the noise [dB], -inf for none.

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
    """Change of the cumulants of a bin by errors of its places.

    A place p becomes the places centre + slope (p - centre) + spread offset, for each of the offsets, inside the grid.

    Parameters
    ----------
    curves : ndarray, shape (m, g)
        Levels on the grid [dB].
    places : ndarray, shape (n, k)
        Places on the grid, in steps of the grid, that stand for each of n bins.
    centre : float
        Place that a slope leaves where it is.
    slopes, spreads : ndarray, shape (m, n)
        By curve and bin; the spreads in steps of the grid.
    offsets : ndarray, shape (h,)
        Of equal weight.

    Returns
    -------
    ndarray, shape (m, n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] afterwards minus those before.
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
    """Differences in standard deviations, by the Cholesky factors of their covariances, and log-determinants.

    The covariance is ``base``, plus ``between * patches + within * cells`` for the means, plus that of the log sds by
    products of both variances, plus the squared errors.

    Parameters
    ----------
    difference : ndarray, shape (m, 3 n)
        All means, log sds and skewnesses.
    base : ndarray, shape (3 n, 3 n)
        Covariance.
    between, within : ndarray, shape (m,)
        Variances between and within fields.
    patches, cells : ndarray, shape (n, n)
        Covariance of the means for variances of 1.
    log_sds : ndarray, shape (2, 2, n, n)
        Covariance of the log sds for variances of 1, by product of the variances between and within.
    error : ndarray, shape (m, 3)
        Standard errors of mean, log sd and skewness of each bin.

    Returns
    -------
    ndarray, shape (m, 3 n)
        NaN where a covariance is not positive definite.
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
