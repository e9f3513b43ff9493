"""Variance of the statistics among runs of equal parameters, estimated from two runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.findings import Finding

Statistics = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]

_DRAWS = 60  # bootstrap samples, which give the variance with an error of 20 %
_UNLIKELY = 6.635  # chi-squared of one degree of freedom that is exceeded once in a hundred


def noise_variance(
    first: ArrayLike, again: ArrayLike, statistics: Statistics, rng: np.random.Generator, effective: float | None = None
) -> NDArray[np.float64]:
    """Variance of the statistics among runs of equal X, estimated from the same pixels of two runs.

    Half the squared difference between the statistics of the two runs estimates the variance, but with a single degree
    of freedom. A paired bootstrap (Efron and Tibshirani, "An introduction to the bootstrap", 1993, section 8.3) is more
    precise: it draws pixels with replacement, the same ones in both runs, and takes the variance of the differences.
    The bootstrap only sees noise that differs from pixel to pixel. Noise that all pixels of a run share, such as a
    random gain, appears in the squared difference alone. The squared difference is therefore used if it exceeds the
    bootstrap variance significantly (chi-squared, 1 %).

    Parameters
    ----------
    first, again : array_like, shape (n,)
        The material's pixels in two runs [dB], in the same order.
    statistics : callable
        Function from values [dB] and indices of the drawn pixels to statistics, shape (n, 3).
    rng : Generator
        Source of the random numbers.
    effective : float, optional
        Effective sample size of the n pixels; n if missing.

    Returns
    -------
    ndarray, shape (n, 3)
        Variance of mean [dB2], log standard deviation and skewness; exactly 0 for equal runs.
    """
    pair = [np.asarray(values, dtype=np.float64) for values in (first, again)]
    n = pair[0].size

    def difference(index: NDArray[np.int64]) -> NDArray[np.float64]:
        return statistics(pair[0], index) - statistics(pair[1], index)

    drawn = np.array([difference(rng.integers(n, size=n)) for _ in range(_DRAWS)])
    correlated = max(1.0, n / effective) if effective else 1.0
    pixels = 0.5 * correlated * drawn.var(axis=0, ddof=1)
    whole = 0.5 * difference(np.arange(n)) ** 2
    return np.asarray(np.where(whole > _UNLIKELY * pixels, whole, pixels))


def scatter(name: str, variance: ArrayLike) -> Finding:
    """Standard deviations of a material's statistics among runs of equal parameters.

    Parameters
    ----------
    name : str
        Name of the material.
    variance : array_like, shape (n, 3)
        Variance of the statistics, from :func:`noise_variance`.
    """
    mean, log_sd, skewness = np.sqrt(np.asarray(variance, dtype=np.float64).mean(axis=0)).tolist()
    return Finding("scatter", "note", name, {"mean_db": mean, "sd_percent": 100.0 * log_sd, "skewness": skewness})
