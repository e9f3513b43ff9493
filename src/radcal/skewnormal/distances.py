"""Distances between two skew-normal densities."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.skewnormal.distribution import cdf, centred, density


def target_grid(dp: ArrayLike, points: int = 1000) -> NDArray[np.float64]:
    """Evenly spaced points at which densities are compared, from mean - 5 sd to mean + 5 sd of the target [dB]."""
    mean, sd, _ = centred(dp)
    return np.linspace(mean - 5.0 * sd, mean + 5.0 * sd, points)


def density_rms(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Root mean square difference of two densities at the points of :func:`target_grid`.

    Parameters
    ----------
    dp, target_dp : array_like, shape (3,)
        Direct parameters of the simulated and the target density.

    Returns
    -------
    float
        sqrt(mean_k (f(t_k) - f_target(t_k))^2) [1/dB], the mean over 1,000 points t_k.
    """
    t = target_grid(target_dp)
    return float(np.sqrt(np.mean((density(t, dp) - density(t, target_dp)) ** 2)))


def _common_grid(dp: ArrayLike, target_dp: ArrayLike) -> NDArray[np.float64]:
    """Evenly spaced points that cover both densities: each density from mean - 8 sd to mean + 8 sd [dB]."""
    means, sds, _ = np.moveaxis(centred(np.stack([np.asarray(dp), np.asarray(target_dp)])), -1, 0)
    return np.linspace((means - 8.0 * sds).min(), (means + 8.0 * sds).max(), 8001)


def hellinger(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Hellinger distance of two densities, 0 (equal) to 1 (disjoint)."""
    t = _common_grid(dp, target_dp)
    # the squared distance is 1 - overlap, computed in a form without cancellation
    squared = 0.5 * np.trapezoid((np.sqrt(density(t, dp)) - np.sqrt(density(t, target_dp))) ** 2, t)
    return float(np.sqrt(min(1.0, max(0.0, squared))))


def kolmogorov_smirnov(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Largest difference between the distribution functions of two skew-normal densities, 0 to 1."""
    t = _common_grid(dp, target_dp)
    return float(np.max(np.abs(cdf(t, dp) - cdf(t, target_dp))))
