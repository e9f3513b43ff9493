"""Goodness of fit of a skew normal, and the effective sample size of correlated pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.errors import FitError

__all__ = ["Goodness", "effective_sample_size", "goodness_of_fit"]

_DRAWS = 99
_GROUPS, _GROUP = 24, 30  # groups of incidence in which a mean is taken: their largest number, and their least size
_REACH_PX = 6  # lag beyond which speckle is assumed to be uncorrelated


@dataclass(frozen=True)
class Goodness:
    """Distances between a sample and the skew normal fitted to it.

    Attributes
    ----------
    ks : float
        Kolmogorov-Smirnov distance, the largest difference of the distribution functions.
    ks_p : float
        p-value: share of bootstrap samples with a larger distance to their own fit.
    ad : float
        Anderson-Darling statistic, which weighs the tails more.
    ad_p : float
        p-value of ``ad``.
    """

    ks: float
    ks_p: float
    ad: float
    ad_p: float


def _distances(values: NDArray[np.float64], dp: ArrayLike) -> tuple[float, float]:
    """Kolmogorov-Smirnov distance and Anderson-Darling statistic of sorted values."""
    n = values.size
    below = skewnormal.cdf(values, dp)
    rank = np.arange(1, n + 1)
    ks = float(max(np.max(rank / n - below), np.max(below - (rank - 1) / n)))
    inside = np.clip(below, 1e-12, 1.0 - 1e-12)
    ad = -n - np.mean((2 * rank - 1) * (np.log(inside) + np.log1p(-inside[::-1])))
    return ks, float(ad)


def goodness_of_fit(
    sample: ArrayLike,
    dp: ArrayLike,
    rng: np.random.Generator,
    effective: float | None = None,
    draws: int = _DRAWS,
    penalised: bool = False,
) -> Goodness:
    """Compare a sample with the skew normal fitted to it, by parametric bootstrap.

    The parameters are estimated from the sample with which the fit is compared, so that tables of p-values for known
    parameters do not apply. Therefore a skew normal is fitted to each bootstrap sample, too, and the p-values follow
    from these fits.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].
    dp : array_like, shape (3,)
        Fitted xi [dB], omega [dB], alpha.
    rng : Generator
        Random generator of the bootstrap samples.
    effective : float, optional
        Number of independent values that the sample stands for; the bootstrap samples have
        that many, and their Anderson-Darling statistics are compared per value.
    draws : int
        Bootstrap samples.
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
    ks, ad = _distances(values, dp)
    n = values.size if effective is None else int(np.clip(round(effective), 8, values.size))
    further = np.zeros(2)
    for _ in range(draws):
        drawn = np.sort(skewnormal.sample(dp, n, rng))
        try:
            distances = _distances(drawn, skewnormal.fit(drawn, penalised).dp)
        except FitError:  # all values are equal, which hardly happens
            continue
        further += np.array(distances) >= (ks, ad * n / values.size)
    # the sample itself counts as one of the bootstrap samples (Davison and Hinkley 1997, eq. 4.11)
    ks_p, ad_p = (1.0 + further) / (1.0 + draws)
    return Goodness(ks, float(ks_p), ad, float(ad_p))


def _without_trend(values: NDArray[np.float64], incidence_deg: ArrayLike) -> NDArray[np.float64]:
    """Values minus their mean at each incidence: a straight line in each of some groups of about equal size."""
    angle, left = np.asarray(incidence_deg, dtype=np.float64), values.copy()
    for group in np.array_split(np.argsort(angle, kind="stable"), max(1, min(_GROUPS, angle.size // _GROUP))):
        away, level = angle[group] - angle[group].mean(), values[group] - values[group].mean()
        left[group] = level - away * (away @ level) / max(float(away @ away), 1e-12)
    return left


def effective_sample_size(
    image_db: NDArray[np.float32],
    inside: NDArray[np.int64],
    drawn: NDArray[np.int64],
    incidence_deg: NDArray[np.float32] | None = None,
) -> float:
    """Number of independent pixels whose mean would have the same variance as the mean of the correlated pixels drawn.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB].
    inside : ndarray of int
        Flat indices of the material's finite pixels, from which the correlation is taken.
    drawn : ndarray of int, shape (n,)
        Flat indices of the pixels drawn, among ``inside``.
    incidence_deg : ndarray, shape (rows, columns), optional
        Local incidence [deg]. The mean of the material at each incidence is subtracted, because what any law explains
        is no correlation of the pixels; without it, the mean of the whole material.

    Returns
    -------
    float
        n^2 over the sum of the correlations of all pairs, between 1 and n.

    References
    ----------
    Bayley and Hammersley, "The effective number of independent observations in an
    autocorrelated time series", J. R. Statist. Soc. Suppl. 8 (1946).
    """
    from scipy import fft  # every process of the workflow imports this module, and few call it

    shape = image_db.shape
    size = tuple(fft.next_fast_len(n + _REACH_PX + 1, real=True) for n in shape)

    def pairs(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum of products of all pairs of pixels at each lag, in both directions."""
        spectrum = fft.rfft2(values, s=size)
        lags = fft.irfft2(np.abs(spectrum) ** 2, s=size)
        window = np.arange(-_REACH_PX, _REACH_PX + 1)
        return np.asarray(lags[np.ix_(window, window)])

    there = np.zeros(image_db.size)
    there[inside] = 1.0
    values = np.zeros(image_db.size)
    of_material = image_db.ravel()[inside].astype(np.float64)
    if incidence_deg is None:
        values[inside] = of_material - of_material.mean()
    else:
        values[inside] = _without_trend(of_material, incidence_deg.ravel()[inside])
    count = pairs(there.reshape(shape))
    products = pairs(values.reshape(shape))
    variance = products[_REACH_PX, _REACH_PX] / count[_REACH_PX, _REACH_PX]
    if variance <= 0.0:
        return 1.0
    correlation = np.where(count > 0.5, products / np.maximum(count, 1.0), 0.0) / variance
    # covariance at the largest lags comes from changes of level within the material, not from speckle
    edge = np.ones_like(correlation, dtype=bool)
    edge[1:-1, 1:-1] = False
    floor = float(np.mean(correlation[edge & (count > 0.5)])) if np.any(edge & (count > 0.5)) else 0.0
    correlation = np.clip((correlation - floor) / max(1.0 - floor, 1e-6), 0.0, 1.0)
    chosen = np.zeros(image_db.size)
    chosen[drawn] = 1.0
    n = float(drawn.size)
    return float(np.clip(n**2 / (pairs(chosen.reshape(shape)) * correlation).sum(), 1.0, n))
