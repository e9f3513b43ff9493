"""Statistics of values in dB: mean, log standard deviation, skewness; from cumulants and skew-normal densities."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.image.looks import looks_of_log_variance

STATISTICS = ("mean", "log sd", "skewness")
_SKEWNESS_LIMIT = 0.995  # the skewness of a skew normal is below 0.9953 in size


def from_cumulants(cumulants: ArrayLike) -> NDArray[np.float64]:
    """Mean [dB], log sd and skewness from mean [dB], variance [dB^2] and third cumulant [dB^3], shape (..., 3)."""
    values = np.asarray(cumulants, dtype=np.float64)
    mean, variance, third = (values[..., k] for k in range(3))
    return np.stack([mean, 0.5 * np.log(variance), third / variance**1.5], axis=-1)


def to_cumulants(statistics: ArrayLike) -> NDArray[np.float64]:
    """Mean [dB], variance [dB^2] and third cumulant [dB^3] from mean [dB], log sd and skewness, shape (..., 3)."""
    mean, log_sd, skewness = np.moveaxis(np.asarray(statistics, dtype=np.float64), -1, 0)
    sd = np.exp(np.clip(log_sd, -20.0, 20.0))
    return np.stack([mean, sd**2, skewness * sd**3], axis=-1)


def from_dp(dp: ArrayLike) -> NDArray[np.float64]:
    """Mean [dB], log sd and skewness of skew normals with xi [dB], omega [dB] and alpha, shape (..., 3)."""
    mean, sd, skewness = np.moveaxis(skewnormal.centred(dp), -1, 0)
    return np.stack([mean, np.log(sd), skewness], axis=-1)


def to_dp(statistics: ArrayLike) -> NDArray[np.float64]:
    """Skew-normal xi [dB], omega [dB] and alpha from mean [dB], log sd and skewness, which is limited to +-0.995."""
    mean, log_sd, skewness = np.moveaxis(np.asarray(statistics, dtype=np.float64), -1, 0)
    skewness = np.clip(skewness, -_SKEWNESS_LIMIT, _SKEWNESS_LIMIT)
    return skewnormal.direct(np.stack([mean, np.exp(np.clip(log_sd, -20.0, 20.0)), skewness], axis=-1))


def sampling_covariance(variance_db2: float, effective: float, levels_db2: float = 0.0) -> NDArray[np.float64]:
    """Sampling covariance of mean, log sd and skewness of log-gamma values that vary about fixed levels.

    Parameters
    ----------
    variance_db2 : float
        Variance of the values about their levels [dB^2], which also determines the looks of their gamma distribution.
    effective : float
        Number of independent values.
    levels_db2 : float
        Variance of the levels [dB^2], which have a normal distribution.

    Returns
    -------
    ndarray, shape (3, 3)
        Covariance of mean [dB], natural logarithm of the standard deviation, and skewness, to first order in the
        inverse number of values.

    References
    ----------
    Stuart and Ord, "Kendall's Advanced Theory of Statistics", vol. 1, 6th edition (1994), section 12.16:
    covariances of k-statistics in terms of cumulants, with which the result agrees for equal levels.
    """
    looks = looks_of_log_variance(variance_db2)
    sd = float(np.sqrt(scipy.special.polygamma(1, looks)))
    # standardised cumulants of orders 3 to 6
    c3, c4, c5, c6 = (float(scipy.special.polygamma(r - 1, looks)) / sd**r for r in range(3, 7))
    v = levels_db2 / variance_db2
    # influence functions, with levels l and deviations e: e of the mean, (l + e)^2 - E_e (l + e)^2 of the variance, and
    # (l + e)^3 - E_e (l + e)^3 - 3 (v + 1) e of the third moment; k has the means of their products over l and e
    k = np.array(
        [
            [1.0, c3, c4],
            [c3, c4 + 2.0 + 4.0 * v, c5 + 6.0 * c3 + 6.0 * v * c3],
            [c4, c5 + 6.0 * c3 + 6.0 * v * c3, c6 + 9.0 * c4 + 9.0 * c3**2 + 6.0 + 9.0 * v * (c4 + 2.0) + 18.0 * v**2],
        ]
    )
    whole = 1.0 + v
    to = np.array(
        [
            [np.sqrt(variance_db2), 0.0, 0.0],
            [0.0, 0.5 / whole, 0.0],
            [0.0, -1.5 * c3 / whole**2.5, 1.0 / whole**1.5],
        ]
    )
    return np.asarray(to @ k @ to.T / effective)
