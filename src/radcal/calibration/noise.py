"""How far the densities of runs with equal parameters scatter, from two such runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal

__all__ = ["noise_sentence", "noise_variance"]

_DRAWS = 60  # of the bootstrap: its variance is then known to 20 %
_UNLIKELY = 6.635  # chi-squared of one degree of freedom that is exceeded once in a hundred


def _learnt(values: NDArray[np.float64], penalised: bool) -> NDArray[np.float64]:
    mean, sd, skewness = skewnormal.centred(skewnormal.fit(values, penalised).dp)
    return np.array([mean, np.log(sd), skewness])


def noise_variance(
    first: ArrayLike,
    again: ArrayLike,
    rng: np.random.Generator,
    effective: float | None = None,
    penalised: bool = False,
) -> NDArray[np.float64]:
    """Variance of a density's parameters among runs of equal X, from the same pixels of two of them.

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
    rng : Generator
        Source of the draws.
    effective : float, optional
        Number of independent pixels that n stand for; n if missing.
    penalised : bool
        Whether densities are fitted by penalised likelihood.

    Returns
    -------
    ndarray, shape (3,)
        Variance of mean [dB2], log standard deviation and skewness; exactly 0 for equal runs.
    """
    pair = [np.asarray(values, dtype=np.float64) for values in (first, again)]
    n = pair[0].size

    def difference(index: NDArray[np.int64]) -> NDArray[np.float64]:
        return _learnt(pair[0][index], penalised) - _learnt(pair[1][index], penalised)

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
    variance : array_like, shape (3,)
        As :func:`noise_variance` gave it.
    """
    mean, log_sd, skewness = np.sqrt(np.asarray(variance, dtype=np.float64))
    return (
        f"{name}: between runs of equal parameters the density's mean scatters by {mean:.2g} dB, its standard "
        f"deviation by {100.0 * log_sd:.2g} %, its skewness by {skewness:.2g} (one standard deviation, from the "
        "repeated reference run); the surrogate takes no less than that for noise."
    )
