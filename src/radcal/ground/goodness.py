"""Goodness of fit of a skew normal to a sample of backscatter values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.errors import FitError

_DRAWS = 99


@dataclass(frozen=True)
class Goodness:
    """Distances between a sample and the skew normal fitted to it.

    Attributes
    ----------
    ks : float
        Kolmogorov-Smirnov distance, the largest difference between the distribution functions of sample and fit.
    ad_p : float
        p-value of the Anderson-Darling statistic, which gives the tails more weight than ``ks`` does: share of
        bootstrap samples with a larger statistic for their own fit.
    """

    ks: float
    ad_p: float


def kolmogorov_smirnov(values: NDArray[np.float64], dp: ArrayLike) -> float:
    """Kolmogorov-Smirnov distance of sorted values."""
    below, share = skewnormal.cdf(values, dp), np.arange(values.size + 1) / values.size
    return float(max(np.max(share[1:] - below), np.max(below - share[:-1])))


def anderson_darling(values: NDArray[np.float64], dp: ArrayLike) -> float:
    """Anderson-Darling statistic of sorted values."""
    inside = np.clip(skewnormal.cdf(values, dp), 1e-12, 1.0 - 1e-12)
    odd = 2 * np.arange(1, values.size + 1) - 1
    return float(-values.size - np.mean(odd * (np.log(inside) + np.log1p(-inside[::-1]))))


def goodness_of_fit(
    sample: ArrayLike,
    dp: ArrayLike,
    rng: np.random.Generator,
    effective: float | None = None,
    draws: int = _DRAWS,
    penalised: bool = False,
) -> Goodness:
    """Compare a sample with the skew normal fitted to it, by parametric bootstrap.

    The parameters are estimated from the sample itself, so that tables of p-values for known parameters do not apply.
    Therefore a skew normal is fitted to each bootstrap sample, too, and the p-value follows from the distances between
    these samples and their fits.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].
    dp : array_like, shape (3,)
        Fitted xi [dB], omega [dB], alpha.
    rng : Generator
        Random generator of the bootstrap samples.
    effective : float, optional
        Effective sample size, by default the number of values. The bootstrap samples have this size, and
        Anderson-Darling statistics are divided by the sample size before they are compared.
    draws : int
        Number of bootstrap samples.
    penalised : bool
        Whether the parameters are from a penalised fit; the bootstrap samples are then fitted in the same way.

    Returns
    -------
    Goodness

    References
    ----------
    Stute, Gonzalez Manteiga and Presedo Quindimil, "Bootstrap based goodness-of-fit-tests",
    Metrika 40 (1993).
    """
    values = np.sort(np.asarray(sample, dtype=np.float64).ravel())
    ad = anderson_darling(values, dp)
    n = values.size if effective is None else int(np.clip(round(effective), 8, values.size))
    further = 0
    for _ in range(draws):
        drawn = np.sort(skewnormal.sample(dp, n, rng))
        try:
            further += anderson_darling(drawn, skewnormal.fit(drawn, penalised).dp) >= ad * n / values.size
        except FitError:  # all values are equal, which hardly happens
            continue
    # the sample itself counts as one of the bootstrap samples (Davison and Hinkley 1997, eq. 4.11)
    return Goodness(kolmogorov_smirnov(values, dp), (1.0 + further) / (1.0 + draws))
