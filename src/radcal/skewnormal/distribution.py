"""Density and parametrisations of the skew-normal distribution, and random numbers drawn from the distribution."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

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
    return np.asarray(0.5 * np.log(2.0 / np.pi) - np.log(omega) - 0.5 * z**2 + scipy.special.log_ndtr(alpha * z))


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
    return np.asarray(np.clip(scipy.special.ndtr(z) - 2.0 * scipy.special.owens_t(z, alpha), 0.0, 1.0))


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
