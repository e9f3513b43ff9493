"""How far the densities of runs with equal parameters scatter, from two such runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["noise_sentence", "noise_variance"]

Statistics = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]

_DRAWS = 60  # of the bootstrap: its variance is then known to 20 %
_UNLIKELY = 6.635  # chi-squared of one degree of freedom that is exceeded once in a hundred


def noise_variance(
    first: ArrayLike,
    again: ArrayLike,
    statistics: Statistics,
    rng: np.random.Generator,
    effective: float | None = None,
) -> NDArray[np.float64]:
    """Variance of the statistics among runs of equal X, from the same pixels of two of them.

    The two runs' difference squared, halved, estimates it with a single degree of freedom, too
    few to build on. Their pixels are many: drawn again with replacement, the same in both runs,
    they tell the variance of the difference (paired bootstrap; Efron and Tibshirani, "An
    introduction to the bootstrap", 1993, section 8.3) as far as the noise differs from pixel to
    pixel. What is common to all pixels of a run, such as a gain, only the difference itself can
    show: it counts where it is larger than the noise of the pixels explains (chi-squared, 1 %).

    Parameters
    ----------
    first, again : array_like, shape (n,)
        The material's pixels in two runs [dB], in the same order.
    statistics : callable
        Values [dB] and, of the bootstrap, places of the pixels drawn, to statistics of shape (n, 3).
    rng : Generator
        Source of the draws.
    effective : float, optional
        Number of independent pixels that n stand for; n if missing.

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


def noise_sentence(name: str, variance: ArrayLike) -> str:
    """Say how far equal parameters scatter.

    Parameters
    ----------
    name : str
        The material.
    variance : array_like, shape (n, 3)
        As :func:`noise_variance` gave it.
    """
    mean, log_sd, skewness = np.sqrt(np.asarray(variance, dtype=np.float64).mean(axis=0))
    return (
        f"{name}: between runs of equal parameters the mean scatters by {mean:.2g} dB, its standard "
        f"deviation by {100.0 * log_sd:.2g} %, its skewness by {skewness:.2g} (one standard deviation, from the "
        "repeated reference run); the surrogate takes no less than that for noise."
    )
