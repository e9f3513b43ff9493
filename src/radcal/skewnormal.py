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

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

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
    "intervals",
    "kolmogorov_smirnov",
    "likelihood_ratio",
    "log_likelihood",
    "sample",
    "target_grid",
]

_B = np.sqrt(2.0 / np.pi)
# skewness of the half-normal, the limit of large |alpha|
MAX_SKEWNESS = float((4.0 - np.pi) / 2.0 * _B**3 / (1.0 - _B**2) ** 1.5)
_MAX_R = float(_B / np.sqrt(1.0 - _B**2))  # mean over sd of the half-normal
_ALPHA_LIMIT = 1e7  # stands for infinity
# the penalty c1 log(1 + c2 alpha^2) has the slope alpha / (2 (e1 + e2 alpha^2)) of the modified score, e1 = 1/3 from
# small alpha, e2 = int u^2 N(u)^2 / Phi(u) du / int u^4 N(u)^2 / Phi(u) du from large: c1 = 1 / (4 e2), c2 = e2 / e1
_C1 = 0.8759126
_C2 = 0.8562498
_NORMAL = 0.5 * float(np.log(2.0 * np.pi) + 1.0)  # mean negative log-likelihood of a standardised sample as a normal
_SCAN = (-1.0, -0.3, 0.1, 0.4, 0.8, 1.2, 1.7, 2.3, 3.0, 4.0)  # artanh of the share of the largest skewness
# up to here, and from so many values, Wald intervals cover the truth in 93 to 97 % of samples
_WALD_SKEWNESS = 0.9
_WALD_SIZE = 1000.0
# 95 % quantile of the likelihood ratio of the true skewness over that of chi square, by sample size and skewness;
# 2,000 samples each, so about 4 %: python benchmarks/skewnormal_fit.py --critical. At the limit it is 0, because
# 95 % of half-normal samples have their maximum there
_SIZES = np.array([50.0, 100.0, 200.0, 400.0, 800.0])
_SKEWNESSES = np.array([0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.993, 0.9945, 0.9951, MAX_SKEWNESS])
_RATIOS = np.array(
    [
        [1.290, 1.423, 1.582, 1.733, 1.762, 1.744, 1.543, 1.237, 0.700, 0.479, 0.269, 0.000],
        [1.091, 1.032, 1.054, 1.328, 1.296, 1.659, 1.708, 1.687, 1.055, 0.760, 0.450, 0.000],
        [0.983, 1.076, 1.086, 1.104, 1.072, 1.169, 1.189, 1.744, 1.524, 1.193, 0.754, 0.000],
        [1.004, 0.998, 1.086, 1.091, 1.008, 1.024, 1.025, 1.316, 1.778, 1.624, 1.149, 0.000],
        [0.957, 0.982, 1.041, 1.017, 0.980, 1.078, 0.959, 1.025, 1.393, 1.828, 1.565, 0.000],
    ]
)
_LEAST_RATIO = 1e-3  # for rounding
_HOPELESS = 2.5  # excess of the root of a likelihood ratio over its critical value
_STEPS = 60
_GRADIENT = 1e-9
_ROUNDING = 1e-14  # of a mean log-likelihood of standardised values
# a smaller skewness changes no density by more than rounding, but divides by zero on the way to alpha
_SHARE_FLOOR = 1e-6


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
        The likelihood grows up to the largest skewness: alpha stands for infinity.
    penalised : bool
        The penalised likelihood was maximised.
    """

    dp: NDArray[np.float64]
    cp: NDArray[np.float64]
    n: int
    at_boundary: bool
    penalised: bool = False


def _unpack(
    u: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(mean, log sd, v) to DP, d DP / du and d^2 DP / du^2, with skewness = largest tanh v."""
    mean, log_sd, v = map(float, u)
    sd = math.exp(log_sd)
    t, log_t = math.tanh(v), math.log(_SHARE_FLOOR)
    if abs(t) < _SHARE_FLOOR:
        t = math.copysign(_SHARE_FLOOR, v)
    else:
        log_t = math.log1p(-2.0 / (math.exp(2.0 * abs(v)) + 1.0))
    root3 = math.copysign(abs(t) ** (1.0 / 3.0), t)
    r = _MAX_R * root3
    root = math.sqrt(1.0 + r**2)
    # alpha = r / (b sqrt(rest)); without cancellation alpha grows as exp(v), so that v is of use up to any alpha
    rest = -math.expm1(2.0 / 3.0 * log_t)
    bend = 1.0 / math.cosh(v) ** 2
    r1 = _MAX_R / 3.0 / root3**2 * bend
    r2 = -2.0 * r1 * (bend / (3.0 * t) + t)
    alpha1 = rest**-1.5 / _B
    alpha2 = 3.0 * (1.0 - _B**2) * r * rest**-2.5 / _B**3
    dp = np.array([mean - sd * r, sd * root, r / (_B * math.sqrt(rest))])
    jacobian = np.array([[1.0, -sd * r, -sd * r1], [0.0, sd * root, sd * r / root * r1], [0.0, 0.0, alpha1 * r1]])
    by_sd = (-sd * r1, sd * r / root * r1, 0.0)
    second = np.zeros((3, 3, 3))
    second[:, 1, 1] = -sd * r, sd * root, 0.0
    second[:, 1, 2] = by_sd
    second[:, 2, 1] = by_sd
    second[:, 2, 2] = -sd * r2, sd * (r1**2 / root**3 + r / root * r2), alpha2 * r1**2 + alpha1 * r2
    return dp, jacobian, second


def _objective(
    u: NDArray[np.float64], x: NDArray[np.float64], penalty: float = 0.0
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Negative mean log-likelihood, its gradient and its Hessian in u.

    ``penalty`` is the factor of c1 log(1 + c2 alpha^2): 1/n in a penalised fit of n values.
    """
    dp, jacobian, second = _unpack(u)
    xi, omega, alpha = dp.tolist()
    z = (x - xi) / omega
    w = alpha * z
    log_phi = log_ndtr(w)
    n = x.size
    ratio = np.exp(-0.5 * w * w - 0.5 * math.log(2.0 * math.pi) - log_phi)  # N(w) / Phi(w)
    curved = -ratio * (w + ratio)  # its derivative
    one = np.ones(n)
    sums = np.stack([one, z, z * z]) @ np.stack([z, ratio, curved, log_phi], axis=1) / n
    z1, r0, c0, mean_log_phi = sums[0].tolist()
    z2, r1, c1, _ = sums[1].tolist()
    c2 = float(sums[2, 2])
    value = math.log(omega) + 0.5 * z2 - mean_log_phi - 0.5 * math.log(2.0 / math.pi)
    gradient = np.array([(alpha * r0 - z1) / omega, (1.0 - z2 + alpha * r1) / omega, -r1])
    # Azzalini and Capitanio 2014, section 3.1.1
    mixed = (r0 + alpha * c1) / omega
    ab = (2.0 * z1 - alpha * r0 - alpha**2 * c1) / omega**2
    bc = (r1 + alpha * c2) / omega
    hessian = np.array(
        [
            [(1.0 - alpha**2 * c0) / omega**2, ab, mixed],
            [ab, (3.0 * z2 - 1.0 - 2.0 * alpha * r1 - alpha**2 * c2) / omega**2, bc],
            [mixed, bc, -c2],
        ]
    )
    if penalty:
        q = 1.0 + _C2 * alpha**2
        value += penalty * _C1 * math.log(q)
        gradient[2] += penalty * 2.0 * _C1 * _C2 * alpha / q
        hessian[2, 2] += penalty * 2.0 * _C1 * _C2 * (2.0 - q) / q**2
    return value, gradient @ jacobian, jacobian.T @ hessian @ jacobian + (gradient @ second.reshape(3, 9)).reshape(3, 3)


def _search(
    u: NDArray[np.float64],
    x: NDArray[np.float64],
    penalty: float = 0.0,
    free: tuple[int, ...] = (0, 1, 2),
    tolerance: float = _GRADIENT,
) -> tuple[NDArray[np.float64], float]:
    """Newton's method with a positive definite matrix and step halving; the point and its objective.

    Only the coordinates ``free`` move. The search ends where alpha is so large that the sample
    cannot tell the density from the half-normal limit (see :func:`_limit`), unless a penalty
    draws it back.
    """
    far = np.inf if penalty else _far(x.size)
    moving = np.array(free)
    value, gradient, hessian = _objective(u, x, penalty)
    for _ in range(_STEPS):
        slope = gradient[moving]
        if np.abs(slope).max() < tolerance:
            break
        scales, directions = np.linalg.eigh(hessian[np.ix_(moving, moving)])
        scales = np.maximum(np.abs(scales), 1e-6 * np.abs(scales).max())
        step = np.zeros(3)
        step[moving] = -directions @ ((directions.T @ slope) / scales)
        step *= min(1.0, 2.0 / np.abs(step).max())  # far out in v the likelihood is flat
        expected = gradient @ step
        while -expected > _ROUNDING:
            trial = _objective(u + step, x, penalty)
            if trial[0] <= value + 1e-4 * expected:
                break
            step *= 0.5
            expected *= 0.5
        else:  # no step lowers it by more than rounding: what is left shows in the gradient only
            trial = _objective(u + step, x, penalty)
            if np.abs(trial[1][moving]).max() < np.abs(slope).max():
                u, value = u + step, trial[0]
            break
        # the penalty's own cusp at alpha = 0 is reached by ever shorter steps from both sides
        caught = penalty > 0.0 and u[2] * (u[2] + step[2]) < 0.0 and max(abs(u[2]), abs(u[2] + step[2])) < 0.1
        u = u + step
        value, gradient, hessian = trial
        if caught or (abs(u[2]) > far and 2 in free):
            break
    return u, value


def _far(n: int) -> float:
    """Value of v whose density n values cannot tell from the limit: alpha times the smallest z is about 10."""
    return math.log(8.0 * n)


def _valleys(
    x: NDArray[np.float64], sign: float, penalty: float
) -> list[tuple[NDArray[np.float64], tuple[float, float]]]:
    """Minima of the objective over mean and sd on a grid of the skewness, and between which v they lie."""
    u, path = np.array([0.0, 0.0, sign * _SCAN[0]]), []
    for v in _SCAN:
        u, value = _search(np.array([u[0], u[1], sign * v]), x, penalty, (0, 1), 1e-2)
        path.append((value, u))
    values = np.array([np.inf, *(value for value, _ in path), np.inf])
    lowest = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]))
    ends = (-np.inf, *_SCAN, np.inf)
    return [(path[k][1], (ends[k], ends[k + 2])) for k in lowest]


def _limit(x: NDArray[np.float64], sign: float) -> NDArray[np.float64]:
    """Fit of the half-normal distribution, which large alpha tends to, as DP."""
    y = sign * x
    omega = float(np.sqrt(np.mean((y - y.min()) ** 2)))
    # the smallest value lies where Phi(alpha z) has just become 1
    return np.array([sign * (y.min() - 6.0 * omega / _ALPHA_LIMIT), omega, sign * _ALPHA_LIMIT])


def _standardised(sample: ArrayLike) -> tuple[NDArray[np.float64], float, float]:
    """Values less their mean over their standard deviation, the mean and the deviation."""
    x = np.asarray(sample, dtype=np.float64).ravel()
    if x.size < 8:
        raise FitError(f"a skew-normal fit needs at least 8 values, found {x.size}.")
    if not np.isfinite(x).all():
        raise FitError(
            f"a skew-normal fit needs finite values, found {np.count_nonzero(~np.isfinite(x))} that are not."
        )
    centre, scale = float(x.mean()), float(x.std())
    if scale <= 1e-9 * max(1.0, abs(centre)):
        raise FitError(f"a skew-normal fit needs values that differ, all {x.size} are {centre:g} dB.")
    return (x - centre) / scale, centre, scale


def fit(sample: ArrayLike, penalised: bool = False) -> Fit:
    """Maximum likelihood fit of a skew normal.

    The search runs in (mean, log sd, skewness), where the likelihood is regular at
    alpha = 0 (Azzalini and Capitanio 2014, section 3.1.4), from the sample's moments, by
    Newton's method. Where the likelihood grows up to the largest skewness, the limit, a
    half-normal distribution, is tried too.

    The penalised log-likelihood is less by c1 log(1 + c2 alpha^2), which stands for the first
    order bias correction of alpha: its maximum is at a finite alpha for every sample. It is
    never smooth at alpha = 0, where it always has a local maximum: a sample whose skewness is
    less than about 0.8 standard errors is fitted by a normal density.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].
    penalised : bool
        Maximise the penalised likelihood.

    Returns
    -------
    Fit

    Raises
    ------
    FitError
        Fewer than 8 values, values that are not finite or all equal.

    References
    ----------
    Azzalini and Arellano-Valle, "Maximum penalized likelihood estimation for skew-normal and
    skew-t distributions", J. Stat. Plan. Inference 143 (2013); Azzalini and Capitanio 2014,
    section 3.1.8.
    """
    y, centre, scale = _standardised(sample)
    penalty = 1.0 / y.size if penalised else 0.0
    skewness = np.mean(y**3)
    sign = float(np.sign(skewness) or 1.0)
    limit = _limit(y, sign)
    limit_value = -log_likelihood(y, limit) / y.size
    u, lowest = _search(np.array([0.0, 0.0, np.arctanh(np.clip(skewness, -0.9, 0.9))]), y, penalty)
    # small or very skewed samples may have several maxima, or none before the limit
    if y.size < 200 or abs(skewness) > 0.7 or limit_value < lowest + 0.05:
        for start, (below, above) in _valleys(y, sign, penalty):
            if not below < sign * u[2] < above:  # that one is known
                other, value = _search(start, y, penalty)
                if value < lowest:
                    u, lowest = other, value
    dp = _unpack(u)[0]
    at_boundary = not penalised and bool(limit_value < lowest + _GRADIENT)
    if at_boundary:
        dp = limit
    elif lowest >= _NORMAL:  # the search divides by alpha
        dp = np.array([0.0, 1.0, 0.0])
    dp = np.array([centre + scale * dp[0], scale * dp[1], dp[2]])
    return Fit(dp=dp, cp=centred(dp), n=y.size, at_boundary=at_boundary, penalised=penalised)


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
    u = np.array([0.0, 0.0, np.arctanh(skewness / MAX_SKEWNESS)])
    # near alpha = 0 the likelihood has a term in |skewness|^(4/3) times the sample's excess kurtosis, whose second
    # derivative is infinite there: the curvature is taken over the reach of the skewness' standard error instead
    reach = np.array([0.0, 0.0, min(0.3, math.sqrt(6.0 / x.size))])
    information = _objective(u, y)[2]
    information[2] = (_objective(u + reach, y)[1] - _objective(u - reach, y)[1]) / (2.0 * reach[2])
    information[:2, 2] = information[2, :2]
    scales = np.array([sd, sd, MAX_SKEWNESS * (1.0 - (skewness / MAX_SKEWNESS) ** 2)])
    if np.linalg.eigvalsh(information)[0] <= 0.0:
        return np.full((3, 3), np.nan)
    return np.asarray(np.linalg.inv(information) * np.outer(scales, scales) / (effective or x.size))


def likelihood_ratio(sample: ArrayLike, skewness: float) -> float:
    """Twice the log of the likelihood's maximum over its maximum at a given skewness.

    It is unchanged by shift and scale of the sample.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].
    skewness : float
        Its supposed skewness; the half-normal limit from +-0.99527 on.

    Returns
    -------
    float
        Likelihood ratio statistic (Cox and Hinkley 1974, section 9.3).

    Raises
    ------
    FitError
        The sample cannot be fitted.
    """
    y = _standardised(sample)[0]
    profile = _Profile(y, float(y.size), fit(y).cp)
    return profile.of_skewness(
        math.atanh(skewness / MAX_SKEWNESS) if abs(skewness) < MAX_SKEWNESS else skewness * np.inf
    )


def _critical(effective: float, v: float, level: float) -> float:
    """Value that the likelihood ratio of the true skewness exceeds with probability 1 - level."""
    from scipy.stats import chi2

    skewness = MAX_SKEWNESS * abs(math.tanh(v))
    column = int(np.clip(np.searchsorted(_SKEWNESSES, skewness) - 1, 0, _SKEWNESSES.size - 2))
    share = (skewness - _SKEWNESSES[column]) / (_SKEWNESSES[column + 1] - _SKEWNESSES[column])
    ratios = (1.0 - share) * _RATIOS[:, column] + share * _RATIOS[:, column + 1]
    return float(chi2.ppf(level, 1) * max(np.interp(math.log(effective), np.log(_SIZES), ratios), _LEAST_RATIO))


def intervals(
    sample: ArrayLike, found: Fit, level: float = 0.95, effective: float | None = None
) -> NDArray[np.float64]:
    """Confidence intervals of a fit's centred parameters.

    From 1,000 independent values, and up to a skewness of 0.9, these are the normal (Wald)
    intervals of :func:`covariance`. Otherwise they are the values at which the profile
    likelihood is not too far below its maximum: for mean and standard deviation by the square of
    Student's t with n - 3 degrees of freedom, for the skewness by the quantile of the likelihood
    ratio itself. That ratio is unchanged by shift and scale, so that its distribution depends on
    sample size and skewness alone, and was simulated (``benchmarks/skewnormal_fit.py
    --critical``): it is that of chi square, 1 degree of freedom, only for large samples. The 95 %
    quantile was; those of other levels are taken as in the same proportion to chi square's.

    Whichever fit was made, the likelihood is taken without penalty: the interval is about the
    parameter, not about its estimate. At the boundary the interval of the skewness is one-sided,
    as it is wherever the largest skewness is not rejected; each value in it has passed the same
    test of ``1 - level``, so that its level is ``level`` there too.

    Parameters
    ----------
    sample : array_like, shape (n,)
        What was fitted [dB].
    found : Fit
        Its fit.
    level : float
        Confidence, between 0 and 1.
    effective : float, optional
        Number of independent values that the sample stands for, by which the log-likelihood is
        scaled; n without it. Less than 8 is taken as 8.

    Returns
    -------
    ndarray, shape (3, 2)
        Lower and upper bounds of mean [dB], standard deviation [dB] and skewness, which ends at
        +-0.99527 where the half-normal limit is not rejected.

    Raises
    ------
    FitError
        The sample cannot be fitted.
    ValueError
        The level is not between 0 and 1.

    References
    ----------
    Cox and Hinkley, "Theoretical Statistics" (1974), sections 7.2 and 9.3 (intervals as the
    values that tests accept, likelihood ratio). Azzalini and Capitanio 2014, section 3.1.
    """
    from scipy.stats import norm, t

    if not 0.0 < level < 1.0:
        raise ValueError(f"expected a level between 0 and 1, found {level:g}")
    y, centre, scale = _standardised(sample)
    if found.penalised:
        found = fit(sample)
    size = max(float(effective or y.size), 8.0)
    if size >= _WALD_SIZE and abs(found.cp[2]) <= _WALD_SKEWNESS:
        half = norm.ppf(0.5 + 0.5 * level) * np.sqrt(np.diagonal(covariance(sample, found, size)))
        if np.isfinite(half).all():
            return found.cp[:, None] + np.outer(half, [-1.0, 1.0])
    profile = _Profile(y, size, (found.cp - [centre, 0.0, 0.0]) / [scale, scale, 1.0])
    student = float(t.ppf(0.5 + 0.5 * level, size - 3.0) ** 2)
    mean = [centre + scale * profile.bound(0, side, lambda _: student) for side in (-1.0, 1.0)]
    sd = [scale * math.exp(profile.bound(1, side, lambda _: student)) for side in (-1.0, 1.0)]
    v = [profile.bound(2, side, lambda v: _critical(size, v, level)) for side in (-1.0, 1.0)]
    skewness = [MAX_SKEWNESS * math.tanh(end) for end in v]
    return np.array([mean, sd, skewness])


class _Profile:
    """Profile likelihood of standardised values in each of (mean, log sd, v)."""

    def __init__(self, y: NDArray[np.float64], size: float, cp: NDArray[np.float64]) -> None:
        self._y, self._size = y, size
        mean, sd, skewness = cp.tolist()
        v = float(np.arctanh(np.clip(skewness / MAX_SKEWNESS, -1.0, 1.0)))
        far = _far(y.size)
        self._top = np.array([mean, math.log(sd), np.clip(v, -far, far)])
        self._least = min(_objective(self._top, y)[0], self._limit(math.copysign(1.0, skewness)))

    def _limit(self, sign: float, mean: float | None = None, sd: float | None = None) -> float:
        """Objective at the half-normal limit, largest likelihood over what is not given."""
        y = sign * self._y
        edge = float(y.min())
        if mean is None:
            # the closer the edge is to the smallest value, the better
            squares = float(np.mean((y - edge) ** 2))
            omega2 = squares if sd is None else sd**2 * (1.0 + _MAX_R**2)
        else:
            # edge = mean - R sd: the root of the derivative in sd, and no value beyond the edge
            offset, squares = float(y.mean()) - sign * mean, float(np.mean((y - sign * mean) ** 2))
            curve = 1.0 + _MAX_R**2
            sd = (_MAX_R * offset + math.sqrt((_MAX_R * offset) ** 2 + 4.0 * curve * squares)) / (2.0 * curve)
            sd = max(sd, (sign * mean - edge) / _MAX_R)
            omega2 = sd**2 * curve
            squares += 2.0 * sd * _MAX_R * offset + (sd * _MAX_R) ** 2
        return 0.5 * (math.log(omega2) + squares / omega2 - math.log(2.0 / math.pi))

    def _ratio(self, k: int, value: float, near: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Twice the log-likelihood ratio of a value of the k-th, and where it is attained."""
        free = tuple(j for j in range(3) if j != k)
        start = near.copy()
        start[k] = value
        starts, least = [start], np.inf
        if k != 2:
            sign = math.copysign(1.0, near[2])
            least = self._limit(sign, value) if k == 0 else self._limit(sign, sd=math.exp(value))
            # far out the likelihood is flat in v: a smaller skewness may be likelier where mean or sd move
            start[2] = sign * min(abs(start[2]), 2.0)
            if self._y.size < 200 and abs(start[2]) > 1.2:
                starts.append(np.array([start[0], start[1], 0.7 * sign]))
        ends = [_search(start, self._y, 0.0, free, 1e-5) for start in starts]
        u, lowest = min(ends, key=lambda end: end[1])
        return 2.0 * self._size * (min(lowest, least) - self._least), u

    def of_skewness(self, v: float) -> float:
        """Twice the log-likelihood ratio of a skewness; an infinite v is the half-normal limit."""
        if math.isinf(v):
            return 2.0 * self._size * (self._limit(math.copysign(1.0, v)) - self._least)
        return self._ratio(2, v, self._top)[0]

    def bound(self, k: int, side: float, critical: Callable[[float], float]) -> float:
        """Where the ratio exceeds its critical value, up (side 1) or down (-1) from the maximum."""
        from scipy.optimize import brentq

        near = self._top

        @cache  # the search starts from the value before: asked again, it might end elsewhere
        def excess(value: float) -> float:
            nonlocal near
            ratio, near = self._ratio(k, value, near)
            # of square roots, which grow evenly
            return math.sqrt(max(ratio, 0.0)) - math.sqrt(critical(value))

        if k == 2 and self.of_skewness(side * np.inf) <= critical(side * np.inf):
            return side * np.inf
        step = (2.2, 1.8, 3.0)[k] / math.sqrt(self._size)
        # the likelihood of a skewness may rise again beyond one that is rejected, unless it is far below
        hopeless, end = (_HOPELESS, side * _far(self._y.size)) if k == 2 else (0.0, side * np.inf)
        tried = [float(near[k])]
        while excess(tried[-1]) <= hopeless and side * tried[-1] < side * end:
            tried.append(tried[-1] + side * step)
            step *= 1.4
        # close to the half-normal limit the critical value is so small that the maximum itself may exceed it
        last = max((place for place, value in enumerate(tried) if excess(value) <= 0.0), default=len(tried) - 1)
        if last == len(tried) - 1:
            return tried[last] if excess(tried[last]) <= 0.0 else tried[0]
        inside, outside = tried[last : last + 2]
        return float(brentq(excess, inside, outside, xtol=3e-4 / math.sqrt(self._size), rtol=1e-12))


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
