r"""The skew-normal distribution: density, parametrisations, maximum likelihood, distances.

Direct parameters (DP) are (xi, omega, alpha), centred parameters (CP) are (mean, standard
deviation, skewness). All values are backscatter in dB, so xi, omega, mean and sd are in dB.

References
----------
Azzalini, "A class of distributions which includes the normal ones", Scand. J. Statist. 12
(1985). Azzalini and Capitanio, "The Skew-Normal and Related Families" (2014), sections 2.1
(density), 3.1 (likelihood, centred parametrisation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, ndtr, owens_t

from radcal.errors import FitError

__all__ = [
    "MAX_SKEWNESS",
    "Fit",
    "cdf",
    "centred",
    "covariance",
    "density",
    "density_rms",
    "direct",
    "fit",
    "hellinger",
    "kolmogorov_smirnov",
    "log_likelihood",
    "sample",
    "target_grid",
]

_B = np.sqrt(2.0 / np.pi)
# skewness of the half-normal, the limit of large |alpha|
MAX_SKEWNESS = float((4.0 - np.pi) / 2.0 * _B**3 / (1.0 - _B**2) ** 1.5)
# the search stops here, at alpha about 120; beyond it only the limit itself is tried
_SKEWNESS_LIMIT = 0.9950
_ALPHA_LIMIT = 1e7  # stands for infinity
_STEPS = 60
_GRADIENT = 1e-9
# a smaller skewness changes no density by more than rounding, but divides by zero on the way to alpha
_SKEWNESS_FLOOR = 1e-7


def direct(cp: ArrayLike) -> NDArray[np.float64]:
    """Centred to direct parameters.

    Parameters
    ----------
    cp : array_like, shape (..., 3)
        Mean [dB], standard deviation [dB], skewness, |skewness| < 0.99527.

    Returns
    -------
    ndarray, shape (..., 3)
        xi [dB], omega [dB], alpha.

    Raises
    ------
    ValueError
        A standard deviation is not positive or a skewness is out of reach.
    """
    mean, sd, skewness = np.moveaxis(np.asarray(cp, dtype=np.float64), -1, 0)
    if np.any(sd <= 0) or np.any(np.abs(skewness) >= MAX_SKEWNESS):
        raise ValueError(f"expected sd > 0 and |skewness| < {MAX_SKEWNESS:.5f}")
    # skewness = (4-pi)/2 r^3 with r = b delta / sqrt(1 - b^2 delta^2)
    r = np.cbrt(2.0 * skewness / (4.0 - np.pi))
    delta = r / (_B * np.sqrt(1.0 + r**2))
    omega = sd * np.sqrt(1.0 + r**2)
    return np.stack([mean - sd * r, omega, delta / np.sqrt(1.0 - delta**2)], axis=-1)


def centred(dp: ArrayLike) -> NDArray[np.float64]:
    """Direct to centred parameters.

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
    shift = _B * alpha / np.hypot(1.0, alpha)
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
    """Distribution function Phi(z) - 2 T(z, alpha), T Owen's function; shapes as :func:`density`."""
    xi, omega, alpha = np.asarray(dp, dtype=np.float64)
    z = (np.asarray(x, dtype=np.float64) - xi) / omega
    return np.asarray(np.clip(ndtr(z) - 2.0 * owens_t(z, alpha), 0.0, 1.0))


def log_likelihood(x: ArrayLike, dp: ArrayLike) -> float:
    """Sum of the log density over the sample ``x`` [dB]."""
    return float(_log_density(np.asarray(x, dtype=np.float64), np.asarray(dp, dtype=np.float64)).sum())


@dataclass(frozen=True)
class Fit:
    """A maximum likelihood fit.

    Attributes
    ----------
    dp, cp : ndarray, shape (3,)
        Direct and centred parameters.
    n : int
        Sample size.
    at_boundary : bool
        The likelihood still grows at the largest skewness: alpha stands for infinity.
    """

    dp: NDArray[np.float64]
    cp: NDArray[np.float64]
    n: int
    at_boundary: bool


def _unpack(u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(mean, log sd, v) to DP and d DP / du, with skewness = limit tanh v."""
    mean, log_sd, v = u
    sd = np.exp(log_sd)
    skewness = _SKEWNESS_LIMIT * np.tanh(v)
    if abs(skewness) < _SKEWNESS_FLOOR:
        skewness = np.copysign(_SKEWNESS_FLOOR, skewness)
    r = np.cbrt(2.0 * skewness / (4.0 - np.pi))
    root = np.sqrt(1.0 + r**2)
    delta = r / (_B * root)
    tail = 1.0 - delta**2
    dp = np.array([mean - sd * r, sd * root, delta / np.sqrt(tail)])
    dr = r / (3.0 * skewness) * (_SKEWNESS_LIMIT - skewness**2 / _SKEWNESS_LIMIT)
    jacobian = np.array(
        [
            [1.0, -sd * r, -sd * dr],
            [0.0, sd * root, sd * r / root * dr],
            [0.0, 0.0, tail**-1.5 / (_B * root**3) * dr],
        ]
    )
    return dp, jacobian


def _objective(
    u: NDArray[np.float64], x: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Negative mean log-likelihood, its gradient in u, and the part of its Hessian that counts at an optimum."""
    (xi, omega, alpha), jacobian = _unpack(u)
    z = (x - xi) / omega
    w = alpha * z
    log_phi = log_ndtr(w)
    value = np.log(omega) + np.mean(0.5 * z**2 - log_phi) - 0.5 * np.log(2.0 / np.pi)
    ratio = np.exp(-0.5 * w**2 - 0.5 * np.log(2.0 * np.pi) - log_phi)  # N(w) / Phi(w)
    curved = -ratio * (w + ratio)  # its derivative
    z1, z2, r0, r1 = z.mean(), np.mean(z**2), ratio.mean(), np.mean(z * ratio)
    c0, c1, c2 = curved.mean(), np.mean(z * curved), np.mean(z**2 * curved)
    gradient = np.array([(alpha * r0 - z1) / omega, (1.0 - z2 + alpha * r1) / omega, -r1])
    # Azzalini and Capitanio 2014, section 3.1.1; a smooth change of variables adds to a Hessian
    # only what is multiplied by the gradient, which vanishes at the optimum
    mixed = (r0 + alpha * c1) / omega
    hessian = np.array(
        [
            [(1.0 - alpha**2 * c0) / omega**2, (2.0 * z1 - alpha * r0 - alpha**2 * c1) / omega**2, mixed],
            [0.0, (3.0 * z2 - 1.0 - 2.0 * alpha * r1 - alpha**2 * c2) / omega**2, (r1 + alpha * c2) / omega],
            [0.0, 0.0, -c2],
        ]
    )
    hessian = np.triu(hessian) + np.triu(hessian, 1).T
    return float(value), jacobian.T @ gradient, jacobian.T @ hessian @ jacobian


def _search(u: NDArray[np.float64], x: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Newton's method with a positive definite matrix and step halving; the point and its objective."""
    value, gradient, hessian = _objective(u, x)
    for _ in range(_STEPS):
        if np.abs(gradient).max() < _GRADIENT:
            break
        scales, directions = np.linalg.eigh(hessian)
        scales = np.maximum(np.abs(scales), 1e-6 * np.abs(scales).max())
        step = -directions @ ((directions.T @ gradient) / scales)
        step *= min(1.0, 2.0 / np.abs(step).max())  # far out in v the likelihood is flat
        for _ in range(40):
            trial = _objective(u + step, x)
            if trial[0] <= value + 1e-4 * gradient @ step:
                break
            step *= 0.5
        else:
            break  # rounding: no step lowers it any more
        u = u + step
        value, gradient, hessian = trial
    return u, value


def _limit(x: NDArray[np.float64], sign: float) -> NDArray[np.float64]:
    """Fit of the half-normal distribution, which large alpha tends to, as DP."""
    y = sign * x
    omega = float(np.sqrt(np.mean((y - y.min()) ** 2)))
    # the smallest value lies where Phi(alpha z) has just become 1
    return np.array([sign * (y.min() - 6.0 * omega / _ALPHA_LIMIT), omega, sign * _ALPHA_LIMIT])


def fit(sample: ArrayLike) -> Fit:
    """Maximum likelihood fit of a skew normal.

    The search runs in (mean, log sd, skewness), where the likelihood is regular at
    alpha = 0 (Azzalini and Capitanio 2014, section 3.1.4), from the sample's moments, by
    Newton's method. Where the likelihood grows up to the largest skewness, the limit, a
    half-normal distribution, is tried too.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].

    Returns
    -------
    Fit

    Raises
    ------
    FitError
        Fewer than 8 values, values that are not finite or all equal.
    """
    x = np.asarray(sample, dtype=np.float64).ravel()
    if x.size < 8:
        raise FitError(f"a skew-normal fit needs at least 8 values, found {x.size}.")
    if not np.isfinite(x).all():
        raise FitError(
            f"a skew-normal fit needs finite values, found {np.count_nonzero(~np.isfinite(x))} that are not."
        )
    centre, scale = x.mean(), x.std()
    if scale <= 1e-9 * max(1.0, abs(centre)):
        raise FitError(f"a skew-normal fit needs values that differ, all {x.size} are {centre:g} dB.")
    y = (x - centre) / scale
    skewness = np.mean(y**3)
    (mean, log_sd, v), lowest = _search(np.array([0.0, 0.0, np.arctanh(np.clip(skewness, -0.9, 0.9))]), y)
    # small or very skewed samples may have a second maximum, or none before the limit
    limit = _limit(y, float(np.sign(skewness) or 1.0))
    limit_value = -log_likelihood(y, limit) / y.size
    if abs(skewness) > 0.7 or limit_value < lowest + 0.05:
        other, value = _search(np.array([0.0, 0.0, np.copysign(np.arctanh(0.99), skewness)]), y)
        if value < lowest:
            (mean, log_sd, v), lowest = other, value
    skewness = _SKEWNESS_LIMIT * np.tanh(v)
    dp = direct([mean, np.exp(log_sd), skewness])
    at_boundary = bool(abs(skewness) > 0.99)
    if limit_value < lowest:
        dp, at_boundary = limit, True
    dp = np.array([centre + scale * dp[0], scale * dp[1], dp[2]])
    return Fit(dp=dp, cp=centred(dp), n=x.size, at_boundary=at_boundary)


def covariance(sample: ArrayLike, found: Fit, effective: float | None = None) -> NDArray[np.float64]:
    """Covariance of a fit's centred parameters, from the observed information.

    Parameters
    ----------
    sample : array_like, shape (n,)
        What was fitted [dB].
    found : Fit
        Its fit.
    effective : float, optional
        Number of independent values that the sample stands for; n without it.

    Returns
    -------
    ndarray, shape (3, 3)
        Covariance of (mean [dB], standard deviation [dB], skewness). NaN at the boundary,
        where the likelihood has no maximum inside.

    References
    ----------
    Azzalini and Capitanio 2014, section 3.1.4: the information is regular in these
    parameters, at alpha = 0 too.
    """
    if found.at_boundary:
        return np.full((3, 3), np.nan)
    x = np.asarray(sample, dtype=np.float64).ravel()
    mean, sd, skewness = found.cp
    y = (x - mean) / sd
    u = np.array([0.0, 0.0, np.arctanh(skewness / _SKEWNESS_LIMIT)])
    # differences of the analytic gradient: the matrix of the search divides by alpha near 0
    steps = 1e-3 * np.eye(3)
    columns = [(_objective(u + step, y)[1] - _objective(u - step, y)[1]) / 2e-3 for step in steps]
    information = 0.5 * (np.stack(columns) + np.stack(columns).T)
    scales = np.array([sd, sd, _SKEWNESS_LIMIT * (1.0 - (skewness / _SKEWNESS_LIMIT) ** 2)])
    return np.asarray(np.linalg.inv(information) * np.outer(scales, scales) / (effective or x.size))


def sample(dp: ArrayLike, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw skew-normal numbers.

    Parameters
    ----------
    dp : array_like, shape (3,)
        xi [dB], omega [dB], alpha.
    n : int
        How many.
    rng : Generator
        Source of the numbers.

    Returns
    -------
    ndarray, shape (n,)
        delta |U0| + sqrt(1 - delta^2) U1, scaled and shifted (Azzalini and Capitanio 2014, eq. 2.13) [dB].
    """
    xi, omega, alpha = np.asarray(dp, dtype=np.float64)
    delta = alpha / np.hypot(1.0, alpha)
    u0, u1 = rng.standard_normal((2, n))
    return np.asarray(xi + omega * (delta * np.abs(u0) + u1 / np.hypot(1.0, alpha)))


def target_grid(dp: ArrayLike, points: int = 1000) -> NDArray[np.float64]:
    """Points on which densities are compared: mean +- 5 sd of the target, evenly spaced [dB]."""
    mean, sd, _ = centred(dp)
    return np.linspace(mean - 5.0 * sd, mean + 5.0 * sd, points)


def density_rms(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Root mean square difference of two densities on the target's grid.

    Parameters
    ----------
    dp, target_dp : array_like, shape (3,)
        Direct parameters of the simulated and the target density.

    Returns
    -------
    float
        sqrt(mean_k (f(t_k) - f_target(t_k))^2) [1/dB], 1,000 points.
    """
    t = target_grid(target_dp)
    return float(np.sqrt(np.mean((density(t, dp) - density(t, target_dp)) ** 2)))


def hellinger(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Hellinger distance of two densities, 0 (equal) to 1 (disjoint)."""
    means, sds, _ = np.moveaxis(centred(np.stack([np.asarray(dp), np.asarray(target_dp)])), -1, 0)
    t = np.linspace((means - 8.0 * sds).min(), (means + 8.0 * sds).max(), 8001)
    # 1 - overlap in the form that does not cancel
    squared = 0.5 * np.trapezoid((np.sqrt(density(t, dp)) - np.sqrt(density(t, target_dp))) ** 2, t)
    return float(np.sqrt(min(1.0, max(0.0, squared))))


def kolmogorov_smirnov(dp: ArrayLike, target_dp: ArrayLike) -> float:
    """Largest difference of the two distribution functions, 0 to 1."""
    means, sds, _ = np.moveaxis(centred(np.stack([np.asarray(dp), np.asarray(target_dp)])), -1, 0)
    t = np.linspace((means - 8.0 * sds).min(), (means + 8.0 * sds).max(), 8001)
    return float(np.max(np.abs(cdf(t, dp) - cdf(t, target_dp))))
