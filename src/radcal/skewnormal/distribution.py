"""Density and parametrisations of the skew-normal distribution, distances of two densities, and random numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, ndtr, owens_t

__all__ = [
    "MAX_R",
    "MAX_SKEWNESS",
    "B",
    "cdf",
    "centred",
    "density",
    "density_rms",
    "direct",
    "hellinger",
    "kolmogorov_smirnov",
    "log_likelihood",
    "sample",
    "target_grid",
]

B = np.sqrt(2.0 / np.pi)  # mean of the half-normal
# skewness of the half-normal, the limit of large |alpha|
MAX_SKEWNESS = float((4.0 - np.pi) / 2.0 * B**3 / (1.0 - B**2) ** 1.5)
MAX_R = float(B / np.sqrt(1.0 - B**2))  # ratio of mean to standard deviation of the half-normal


def direct(cp: ArrayLike) -> NDArray[np.float64]:
    """Direct parameters (xi, omega, alpha) computed from centred parameters.

    Parameters
    ----------
    cp : array_like, shape (..., 3)
        Mean [dB], standard deviation [dB], and skewness, which is below 0.99527 in size.

    Returns
    -------
    ndarray, shape (..., 3)
        xi [dB], omega [dB], alpha.

    Raises
    ------
    ValueError
        A standard deviation is not positive, or a skewness is 0.99527 or more in size.
    """
    mean, sd, skewness = np.moveaxis(np.asarray(cp, dtype=np.float64), -1, 0)
    if np.any(sd <= 0) or np.any(np.abs(skewness) >= MAX_SKEWNESS):
        raise ValueError(f"expected sd > 0 and |skewness| < {MAX_SKEWNESS:.5f}")
    # skewness = (4-pi)/2 r^3 with r = b delta / sqrt(1 - b^2 delta^2)
    r = np.cbrt(2.0 * skewness / (4.0 - np.pi))
    delta = r / (B * np.sqrt(1.0 + r**2))
    omega = sd * np.sqrt(1.0 + r**2)
    return np.stack([mean - sd * r, omega, delta / np.sqrt(1.0 - delta**2)], axis=-1)


def centred(dp: ArrayLike) -> NDArray[np.float64]:
    """Centred parameters (mean, standard deviation, skewness) computed from direct parameters.

    Parameters
    ----------
    dp : array_like, shape (..., 3)
        xi [dB], omega [dB], alpha.

    Returns
    -------
    ndarray, shape (..., 3)
        Mean [dB], standard deviation [dB], skewness.

    Raises
    ------
    ValueError
        An omega is not positive.
    """
    xi, omega, alpha = np.moveaxis(np.asarray(dp, dtype=np.float64), -1, 0)
    if np.any(omega <= 0):
        raise ValueError("expected omega > 0")
    shift = B * alpha / np.hypot(1.0, alpha)
    spread = np.sqrt(1.0 - shift**2)
    return np.stack([xi + omega * shift, omega * spread, (4.0 - np.pi) / 2.0 * (shift / spread) ** 3], axis=-1)


def _log_density(x: NDArray[np.float64], dp: NDArray[np.float64]) -> NDArray[np.float64]:
    xi, omega, alpha = dp
    z = (x - xi) / omega
    return np.asarray(0.5 * np.log(2.0 / np.pi) - np.log(omega) - 0.5 * z**2 + log_ndtr(alpha * z))


def density(x: ArrayLike, dp: ArrayLike) -> NDArray[np.float64]:
    """Probability density (2 / omega) N(z) Phi(alpha z), z = (x - xi) / omega.

    Parameters
    ----------
    x : array_like
        Backscatter [dB], any shape.
    dp : array_like, shape (3,)
        xi [dB], omega [dB], alpha.

    Returns
    -------
    ndarray
        Density [1/dB], shape of ``x``.
    """
    return np.exp(_log_density(np.asarray(x, dtype=np.float64), np.asarray(dp, dtype=np.float64)))


def cdf(x: ArrayLike, dp: ArrayLike) -> NDArray[np.float64]:
    """Distribution function Phi(z) - 2 T(z, alpha), where T is Owen's function; shapes as in :func:`density`."""
    xi, omega, alpha = np.asarray(dp, dtype=np.float64)
    z = (np.asarray(x, dtype=np.float64) - xi) / omega
    return np.asarray(np.clip(ndtr(z) - 2.0 * owens_t(z, alpha), 0.0, 1.0))


def log_likelihood(x: ArrayLike, dp: ArrayLike) -> float:
    """Sum of the log density over the sample ``x`` [dB]."""
    return float(_log_density(np.asarray(x, dtype=np.float64), np.asarray(dp, dtype=np.float64)).sum())


def sample(dp: ArrayLike, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Random sample of a skew-normal distribution.

    Parameters
    ----------
    dp : array_like, shape (3,)
        xi [dB], omega [dB], alpha.
    n : int
        Number of values.
    rng : Generator
        Random generator.

    Returns
    -------
    ndarray, shape (n,)
        Values delta |U0| + sqrt(1 - delta^2) U1, scaled and shifted (Azzalini and Capitanio 2014, eq. 2.13) [dB].
    """
    xi, omega, alpha = np.asarray(dp, dtype=np.float64)
    delta = alpha / np.hypot(1.0, alpha)
    u0, u1 = rng.standard_normal((2, n))
    return np.asarray(xi + omega * (delta * np.abs(u0) + u1 / np.hypot(1.0, alpha)))


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
