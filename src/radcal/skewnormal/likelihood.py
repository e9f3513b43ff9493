"""Maximum likelihood of the skew normal, plain and penalised, and the covariance of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.errors import FitError
from radcal.skewnormal.distribution import MAX_R, MAX_SKEWNESS, B, centred, log_likelihood

_ALPHA_LIMIT = 1e7  # alpha of the half-normal limit, in place of infinity
# The penalty c1 log(1 + c2 alpha^2) has the slope alpha / (2 (e1 + e2 alpha^2)), as the modified score has. e1 = 1/3
# follows from small alpha, e2 = (int u^2 N(u)^2 / Phi(u) du) / (int u^4 N(u)^2 / Phi(u) du) from large alpha. Then c1 =
# 1 / (4 e2) and c2 = e2 / e1.
_C1 = 0.8759126
_C2 = 0.8562498
_NORMAL = 0.5 * float(np.log(2.0 * np.pi) + 1.0)  # negative mean log-likelihood of a normal fit
_SCAN = (-1.0, -0.3, 0.1, 0.4, 0.8, 1.2, 1.7, 2.3, 3.0, 4.0)  # starting values of v, with skewness = 0.99527 tanh v
_STEPS = 60
_GRADIENT = 1e-9
_ROUNDING = 1e-14  # tolerance of a mean log-likelihood of standardised values
# smallest |tanh v|; a smaller value changes the density only by rounding errors, but causes a division by zero
_SHARE_FLOOR = 1e-6


@dataclass(frozen=True)
class Fit:
    """Maximum likelihood fit of a skew normal.

    Attributes
    ----------
    dp, cp : ndarray, shape (3,)
        Direct and centred parameters.
    at_boundary : bool
        Whether the likelihood grows up to the largest possible skewness, so that it has no maximum at a finite alpha.
        The value of alpha in ``dp`` then stands for infinity.
    """

    dp: NDArray[np.float64]
    cp: NDArray[np.float64]
    at_boundary: bool


def _unpack(u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Direct parameters (xi, omega, alpha) as functions of u = (mean, log sd, v), with first and second derivatives.

    The skewness is the largest possible skewness times tanh v.
    """
    mean, log_sd, v = map(float, u)
    sd = math.exp(log_sd)
    t, log_t = math.tanh(v), math.log(_SHARE_FLOOR)
    if abs(t) < _SHARE_FLOOR:
        t = math.copysign(_SHARE_FLOOR, v)
    else:
        log_t = math.log1p(-2.0 / (math.exp(2.0 * abs(v)) + 1.0))
    root3 = math.copysign(abs(t) ** (1.0 / 3.0), t)
    r = MAX_R * root3
    root = math.sqrt(1.0 + r**2)
    # alpha = r / (b sqrt(rest)), where rest is computed without cancellation, so that alpha grows as exp(v) without
    # limit
    rest = -math.expm1(2.0 / 3.0 * log_t)
    bend = 1.0 / math.cosh(v) ** 2
    r1 = MAX_R / 3.0 / root3**2 * bend
    r2 = -2.0 * r1 * (bend / (3.0 * t) + t)
    alpha1 = rest**-1.5 / B
    alpha2 = 3.0 * (1.0 - B**2) * r * rest**-2.5 / B**3
    dp = np.array([mean - sd * r, sd * root, r / (B * math.sqrt(rest))])
    jacobian = np.array([[1.0, -sd * r, -sd * r1], [0.0, sd * root, sd * r / root * r1], [0.0, 0.0, alpha1 * r1]])
    by_sd = (-sd * r1, sd * r / root * r1, 0.0)
    second = np.zeros((3, 3, 3))
    second[:, 1, 1] = -sd * r, sd * root, 0.0
    second[:, 1, 2] = by_sd
    second[:, 2, 1] = by_sd
    second[:, 2, 2] = -sd * r2, sd * (r1**2 / root**3 + r / root * r2), alpha2 * r1**2 + alpha1 * r2
    return dp, jacobian, second


def objective(
    u: NDArray[np.float64], x: NDArray[np.float64], penalty: float = 0.0
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Negative mean log-likelihood, plus the penalty if there is one, with its gradient and Hessian.

    Parameters
    ----------
    u : ndarray, shape (3,)
        Mean, log of the standard deviation, and v, with skewness = 0.99527 tanh v.
    x : ndarray, shape (n,)
        Standardised values.
    penalty : float
        Factor of the penalty c1 log(1 + c2 alpha^2): 1/n in a penalised fit of n values, 0 in a fit without penalty.

    Returns
    -------
    value : float
    gradient : ndarray, shape (3,)
        First derivatives of the value with respect to u.
    hessian : ndarray, shape (3, 3)
        Second derivatives of the value with respect to u.

    References
    ----------
    Azzalini and Capitanio 2014, section 3.1.1.
    """
    dp, jacobian, second = _unpack(u)
    xi, omega, alpha = dp.tolist()
    z = (x - xi) / omega
    w = alpha * z
    log_phi = scipy.special.log_ndtr(w)
    n = x.size
    ratio = np.exp(-0.5 * w * w - 0.5 * math.log(2.0 * math.pi) - log_phi)  # N(w) / Phi(w)
    curved = -ratio * (w + ratio)  # derivative of the ratio
    powers, terms = np.empty((3, n)), np.empty((n, 4))  # this takes half the time of np.stack
    powers[0], powers[1], powers[2] = 1.0, z, z * z
    terms[:, 0], terms[:, 1], terms[:, 2], terms[:, 3] = z, ratio, curved, log_phi
    sums = powers @ terms / n
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


def search(
    u: NDArray[np.float64],
    x: NDArray[np.float64],
    penalty: float = 0.0,
    free: tuple[int, ...] = (0, 1, 2),
    tolerance: float = _GRADIENT,
) -> tuple[NDArray[np.float64], float]:
    """Minimise :func:`objective` by Newton's method, with the Hessian made positive definite and with step halving.

    A penalty keeps alpha finite. Without a penalty, the search also ends if alpha is so large that the sample does not
    distinguish the density from the half-normal limit (see :func:`fit`).

    Parameters
    ----------
    u : ndarray, shape (3,)
        Starting point, in the coordinates of :func:`objective`.
    x, penalty
        As for :func:`objective`.
    free : tuple of int
        Coordinates of u that are varied.
    tolerance : float
        Largest component of the gradient at which the search ends.

    Returns
    -------
    u : ndarray, shape (3,)
        Coordinates at the end of the search.
    value : float
        Objective at ``u``.
    """
    # at this v, alpha (x - xi) / omega is about 10 for the smallest of the values
    far = np.inf if penalty else math.log(8.0 * x.size)
    moving = np.array(free)
    value, gradient, hessian = objective(u, x, penalty)
    for _ in range(_STEPS):
        slope = gradient[moving]
        if np.abs(slope).max() < tolerance:
            break
        scales, directions = np.linalg.eigh(hessian[moving[:, None], moving])
        scales = np.maximum(np.abs(scales), 1e-6 * np.abs(scales).max())
        step = np.zeros(3)
        step[moving] = -directions @ ((directions.T @ slope) / scales)
        step *= min(1.0, 2.0 / np.abs(step).max())  # at large v the likelihood is flat, and Newton steps are too long
        expected = gradient @ step
        while -expected > _ROUNDING:
            trial = objective(u + step, x, penalty)
            if trial[0] <= value + 1e-4 * expected:
                break
            step *= 0.5
            expected *= 0.5
        else:  # no step lowers the objective by more than rounding; the gradient decides about the last step
            trial = objective(u + step, x, penalty)
            if np.abs(trial[1][moving]).max() < np.abs(slope).max():
                u, value = u + step, trial[0]
            break
        # the penalty has a cusp at alpha = 0, which the search would approach from both sides in ever shorter steps
        caught = penalty > 0.0 and u[2] * (u[2] + step[2]) < 0.0 and max(abs(u[2]), abs(u[2] + step[2])) < 0.1
        u = u + step
        value, gradient, hessian = trial
        if caught or (abs(u[2]) > far and 2 in free):
            break
    return u, value


def fit(sample: ArrayLike, penalised: bool = False) -> Fit:
    """Maximum likelihood fit of a skew normal.

    Newton's method searches in the parameters (mean, log sd, skewness), in which the likelihood is regular at alpha = 0
    (Azzalini and Capitanio 2014, section 3.1.4). The search starts from the sample's moments. In a fit without penalty,
    the half-normal distribution, which is the limit of infinite alpha, is the result if its likelihood is at least as
    large as the maximum found.

    The penalised log-likelihood is the log-likelihood minus the penalty c1 log(1 + c2 alpha^2), which corrects the bias
    of alpha to first order. The maximum of the penalised log-likelihood is at a finite alpha for every sample. At alpha
    = 0 the penalised log-likelihood always has a cusp, which is a local maximum. A sample whose skewness is smaller
    than about 0.8 standard errors is therefore fitted by a normal density.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Backscatter [dB].
    penalised : bool
        Whether to maximise the penalised likelihood.

    Returns
    -------
    Fit

    Raises
    ------
    FitError
        The sample has fewer than 8 values, values that are not finite, or only equal values.

    References
    ----------
    Azzalini and Arellano-Valle, "Maximum penalized likelihood estimation for skew-normal and
    skew-t distributions", J. Stat. Plan. Inference 143 (2013); Azzalini and Capitanio 2014,
    section 3.1.8.
    """
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
    y = (x - centre) / scale
    penalty = 1.0 / y.size if penalised else 0.0
    skewness = np.mean(y**3)
    sign = float(np.sign(skewness) or 1.0)
    # the half-normal distribution is the limit of the density for large alpha; its xi is chosen so that alpha z is 6,
    # and Phi(alpha z) practically 1, at the smallest value of the sample
    least = (sign * y).min()
    omega = float(np.sqrt(np.mean((sign * y - least) ** 2)))
    limit = np.array([sign * (least - 6.0 * omega / _ALPHA_LIMIT), omega, sign * _ALPHA_LIMIT])
    limit_value = -log_likelihood(y, limit) / y.size
    u, lowest = search(np.array([0.0, 0.0, np.arctanh(np.clip(skewness, -0.9, 0.9))]), y, penalty)
    # the likelihood of a small or very skewed sample may have several maxima, or no maximum at a finite alpha
    if y.size < 200 or abs(skewness) > 0.7 or limit_value < lowest + 0.05:
        start, path = np.array([0.0, 0.0, sign * _SCAN[0]]), []
        for v in _SCAN:  # the objective is minimised over mean and sd at each point of a grid of v
            start, value = search(np.array([start[0], start[1], sign * v]), y, penalty, (0, 1), 1e-2)
            path.append((value, start))
        values = np.array([np.inf, *(value for value, _ in path), np.inf])
        ends = (-np.inf, *_SCAN, np.inf)
        for k in np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])):
            if not ends[k] < sign * u[2] < ends[k + 2]:  # the minimum in this interval is already known
                other, value = search(path[k][1], y, penalty)
                if value < lowest:
                    u, lowest = other, value
    dp = _unpack(u)[0]
    at_boundary = not penalised and bool(limit_value < lowest + _GRADIENT)
    if at_boundary:
        dp = limit
    elif lowest >= _NORMAL:  # the best is the normal density (alpha = 0), where the search would divide by zero
        dp = np.array([0.0, 1.0, 0.0])
    dp = np.array([centre + scale * dp[0], scale * dp[1], dp[2]])
    return Fit(dp=dp, cp=centred(dp), at_boundary=at_boundary)


def covariance(sample: ArrayLike, found: Fit, effective: float | None = None) -> NDArray[np.float64]:
    """Covariance of a fit's centred parameters, computed from the observed information.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Fitted values [dB].
    found : Fit
        Fit to the sample.
    effective : float, optional
        Effective sample size: number of independent values with the information of the sample. By default n.

    Returns
    -------
    ndarray, shape (3, 3)
        Covariance of (mean [dB], standard deviation [dB], skewness). NaN if the fit is at the boundary
        (``found.at_boundary``), or if the information matrix is not positive definite.

    References
    ----------
    Azzalini and Capitanio 2014, section 3.1.4: the information is regular in the centred parameters, even at alpha = 0.
    """
    if found.at_boundary:
        return np.full((3, 3), np.nan)
    x = np.asarray(sample, dtype=np.float64).ravel()
    mean, sd, skewness = found.cp
    y = (x - mean) / sd
    u = np.array([0.0, 0.0, np.arctanh(skewness / MAX_SKEWNESS)])
    # Near alpha = 0 the likelihood has a term in |skewness|^(4/3) times the sample's excess kurtosis, whose second
    # derivative is infinite at 0. The curvature is therefore a difference quotient over about one standard error of the
    # skewness.
    step = np.array([0.0, 0.0, min(0.3, math.sqrt(6.0 / x.size))])
    information = objective(u, y)[2]
    information[2] = (objective(u + step, y)[1] - objective(u - step, y)[1]) / (2.0 * step[2])
    information[:2, 2] = information[2, :2]
    scales = np.array([sd, sd, MAX_SKEWNESS * (1.0 - (skewness / MAX_SKEWNESS) ** 2)])
    if np.linalg.eigvalsh(information)[0] <= 0.0:
        return np.full((3, 3), np.nan)
    return np.asarray(np.linalg.inv(information) * np.outer(scales, scales) / (effective or x.size))
