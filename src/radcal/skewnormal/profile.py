"""Confidence intervals of a fit: Wald intervals for large samples, profile-likelihood intervals for other samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.skewnormal.distribution import MAX_R, MAX_SKEWNESS
from radcal.skewnormal.likelihood import Fit, covariance, farthest, fit, objective, search, standardised

# for skewnesses up to this size, and for at least this number of values, 95 % Wald intervals contain the true value in
# 93 to 97 % of samples
_WALD_SKEWNESS = 0.9
_WALD_SIZE = 1000.0
# Ratio of two 95 % quantiles, by sample size and skewness: the quantile of the likelihood ratio at the true skewness,
# divided by the quantile of chi-square. Each ratio is determined from 2,000 samples, and is accurate to about 4 %:
# python benchmarks/skewnormal_fit.py --critical. At the half-normal limit the ratio is 0, because 95 % of half-normal
# samples have their maximum likelihood at this limit.
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
_LEAST_RATIO = 1e-3  # lower limit of the ratio, against rounding errors
_HOPELESS = 2.5  # root of a likelihood ratio minus root of its critical value, at which a search ends


def _critical(effective: float, v: float, level: float) -> float:
    """Critical value that the likelihood ratio at the true skewness exceeds with the probability 1 - level."""
    skewness = MAX_SKEWNESS * abs(math.tanh(v))
    column = int(np.clip(np.searchsorted(_SKEWNESSES, skewness) - 1, 0, _SKEWNESSES.size - 2))
    share = (skewness - _SKEWNESSES[column]) / (_SKEWNESSES[column + 1] - _SKEWNESSES[column])
    ratios = (1.0 - share) * _RATIOS[:, column] + share * _RATIOS[:, column + 1]
    return float(
        2.0
        * scipy.special.gammaincinv(0.5, level)
        * max(np.interp(math.log(effective), np.log(_SIZES), ratios), _LEAST_RATIO)
    )


def intervals(
    sample: ArrayLike, found: Fit, level: float = 0.95, effective: float | None = None
) -> NDArray[np.float64]:
    """Confidence intervals of a fit's centred parameters.

    For at least 1,000 independent values and a skewness of at most 0.9 in size, the intervals are the normal (Wald)
    intervals from :func:`covariance`. Otherwise an interval is the set of all values of a parameter whose likelihood
    ratio is below a critical value. The likelihood ratio of a value is twice the logarithm of the maximum of the
    likelihood over all parameters, divided by the maximum with the parameter fixed at this value. For mean and standard
    deviation, the critical value is the squared quantile of Student's t distribution with n - 3 degrees of freedom. For
    the skewness, critical values from the t or chi-square distribution are not accurate. The critical value of the
    skewness is therefore the quantile, at the probability ``level``, of the distribution of the likelihood ratio.

    The distribution of the skewness' likelihood ratio depends on sample size and skewness alone. For large samples, the
    distribution approaches the chi-square distribution with 1 degree of freedom. A simulation
    (``benchmarks/skewnormal_fit.py --critical``) determined the ratio of the likelihood ratio's 95 % quantile to the 95
    % quantile of chi-square. The critical value at any ``level`` is the quantile of chi-square at this level times the
    ratio found at 95 %.

    The intervals are computed from the likelihood without penalty, because an interval describes the parameter and not
    the penalised estimate. If the likelihood ratio does not reject the largest possible skewness, the interval of the
    skewness is one-sided and ends at the largest skewness. A one-sided interval contains all values of the skewness
    that a test of size ``1 - level`` does not reject. The confidence level of a one-sided interval is therefore also
    ``level``.

    Parameters
    ----------
    sample : array_like, shape (n,)
        Fitted values [dB].
    found : Fit
        Fit to the sample.
    level : float
        Confidence level, between 0 and 1.
    effective : float, optional
        Effective sample size: the log-likelihood of the n values is scaled to this number of independent values. The
        default is n; a number below 8 is replaced by 8.

    Returns
    -------
    ndarray, shape (3, 2)
        Lower and upper bounds of mean [dB], standard deviation [dB] and skewness; the bound of the skewness is
        +-0.99527 if the half-normal limit is not rejected.

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
    if not 0.0 < level < 1.0:
        raise ValueError(f"expected a level between 0 and 1, found {level:g}")
    y, centre, scale = standardised(sample)
    if found.penalised:
        found = fit(sample)
    size = max(float(effective or y.size), 8.0)
    if size >= _WALD_SIZE and abs(found.cp[2]) <= _WALD_SKEWNESS:
        half = scipy.special.ndtri(0.5 + 0.5 * level) * np.sqrt(np.diagonal(covariance(sample, found, size)))
        if np.isfinite(half).all():
            return found.cp[:, None] + np.outer(half, [-1.0, 1.0])
    profile = _Profile(y, size, (found.cp - [centre, 0.0, 0.0]) / [scale, scale, 1.0])
    student = float(scipy.special.stdtrit(size - 3.0, 0.5 + 0.5 * level) ** 2)
    mean = [centre + scale * profile.bound(0, side, lambda _: student) for side in (-1.0, 1.0)]
    sd = [scale * math.exp(profile.bound(1, side, lambda _: student)) for side in (-1.0, 1.0)]
    v = [profile.bound(2, side, lambda v: _critical(size, v, level)) for side in (-1.0, 1.0)]
    skewness = [MAX_SKEWNESS * math.tanh(end) for end in v]
    return np.array([mean, sd, skewness])


class _Profile:
    """Profile likelihood of a standardised sample for the mean, for log sd, and for v (skewness = 0.99527 tanh v)."""

    def __init__(self, y: NDArray[np.float64], size: float, cp: NDArray[np.float64]) -> None:
        self._y, self._size = y, size
        mean, sd, skewness = cp.tolist()
        v = float(np.arctanh(np.clip(skewness / MAX_SKEWNESS, -1.0, 1.0)))
        far = farthest(y.size)
        self._top = np.array([mean, math.log(sd), np.clip(v, -far, far)])
        self._least = min(objective(self._top, y)[0], self._limit(math.copysign(1.0, skewness)))

    def _limit(self, sign: float, mean: float | None = None, sd: float | None = None) -> float:
        """Minimum of the objective at the half-normal limit; ``mean`` and ``sd`` are varied unless they are given."""
        y = sign * self._y
        edge = float(y.min())
        if mean is None:
            # the likelihood grows as the edge of the half-normal density approaches the smallest value of the sample
            squares = float(np.mean((y - edge) ** 2))
            omega2 = squares if sd is None else sd**2 * (1.0 + MAX_R**2)
        else:
            # edge = mean - MAX_R sd; sd is the root of the derivative with respect to sd, or larger, so that no value
            # lies beyond the edge
            offset, squares = float(y.mean()) - sign * mean, float(np.mean((y - sign * mean) ** 2))
            curve = 1.0 + MAX_R**2
            sd = (MAX_R * offset + math.sqrt((MAX_R * offset) ** 2 + 4.0 * curve * squares)) / (2.0 * curve)
            sd = max(sd, (sign * mean - edge) / MAX_R)
            omega2 = sd**2 * curve
            squares += 2.0 * sd * MAX_R * offset + (sd * MAX_R) ** 2
        return 0.5 * (math.log(omega2) + squares / omega2 - math.log(2.0 / math.pi))

    def _ratio(self, k: int, value: float, near: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Likelihood ratio of a value of the k-th parameter, and parameters of the maximum likelihood at this value."""
        free = tuple(j for j in range(3) if j != k)
        start = near.copy()
        start[k] = value
        starts, least = [start], np.inf
        if k != 2:
            sign = math.copysign(1.0, near[2])
            least = self._limit(sign, value) if k == 0 else self._limit(sign, sd=math.exp(value))
            # the likelihood is flat at large v; the search starts at a smaller v, because a smaller skewness may have a
            # larger likelihood together with another mean or sd
            start[2] = sign * min(abs(start[2]), 2.0)
            if self._y.size < 200 and abs(start[2]) > 1.2:
                starts.append(np.array([start[0], start[1], 0.7 * sign]))
        ends = [search(start, self._y, 0.0, free, 1e-5) for start in starts]
        u, lowest = min(ends, key=lambda end: end[1])
        return 2.0 * self._size * (min(lowest, least) - self._least), u

    def of_skewness(self, v: float) -> float:
        """Likelihood ratio at the skewness 0.99527 tanh v; an infinite v stands for the half-normal limit."""
        if math.isinf(v):
            return 2.0 * self._size * (self._limit(math.copysign(1.0, v)) - self._least)
        return self._ratio(2, v, self._top)[0]

    def bound(self, k: int, side: float, critical: Callable[[float], float]) -> float:
        """Upper (side 1) or lower (side -1) bound of the k-th parameter, where the likelihood ratio is ``critical``."""
        near = self._top

        @cache  # cached, because a search starts from the previous result, and might end elsewhere if repeated
        def excess(value: float) -> float:
            nonlocal near
            ratio, near = self._ratio(k, value, near)
            # square roots, because these are nearly linear functions of the value and therefore easy to interpolate
            return math.sqrt(max(ratio, 0.0)) - math.sqrt(critical(value))

        if k == 2 and self.of_skewness(side * np.inf) <= critical(side * np.inf):
            return side * np.inf
        step = (2.2, 1.8, 3.0)[k] / math.sqrt(self._size)
        # beyond a rejected skewness the likelihood may rise again, unless it is far below the maximum
        hopeless, end = (_HOPELESS, side * farthest(self._y.size)) if k == 2 else (0.0, side * np.inf)
        tried = [float(near[k])]
        while excess(tried[-1]) <= hopeless and side * tried[-1] < side * end:
            tried.append(tried[-1] + side * step)
            step *= 1.4
        # close to the half-normal limit, the critical value is so small that even the ratio at the estimate may exceed
        # it
        last = max((place for place, value in enumerate(tried) if excess(value) <= 0.0), default=len(tried) - 1)
        if last == len(tried) - 1:
            return tried[last] if excess(tried[last]) <= 0.0 else tried[0]
        inside, outside = tried[last : last + 2]
        return float(scipy.optimize.brentq(excess, inside, outside, xtol=3e-4 / math.sqrt(self._size), rtol=1e-12))
