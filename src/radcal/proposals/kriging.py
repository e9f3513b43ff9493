"""Ordinary kriging of several outputs with a common correlation; length scales maximise their posterior."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.errors import SurrogateError

Doubles = NDArray[np.float64]

_LOG_SD = 1.0  # log standard deviation of the prior of a length scale; its median is 1, the width of the box
# starts of the searches for the length scales, in widths of the box: the first start of each group and, if it is
# another one, the start of the group with the highest posterior density; outputs that vary fast or hardly at all have
# a maximum that no search from 0.3 or 3 reaches
_STARTS = ((1.0,), (0.3, 0.1, 0.03), (3.0, 10.0))
_SCALES = (0.02, 50.0)
JITTER = 1e-10  # nugget without noise
_MOST_NOISE = 10.0  # largest nugget, in variances of the process
_FACTOR_SD = 0.3  # standard deviation of the prior of the factor of a baseline
_IMPOSSIBLE = 1e10  # negative logarithm of the posterior density where the matrix has no factor
_ROUNDS = 4  # alternations between fits of the length scales and of the nugget
# from more points without noise on, the starts are tried with a part of the points, and the best is improved with all
_MANY, _PART, _EVALUATIONS = 400, 250, 10
_NUGGETS = (1e-13, 1e-4)  # of many points: starts of the search
_LEAST_NUGGET = 5e-17  # for each of many points; with less, the rounded correlation matrix often has no factor
_TIMES = 10.0 ** np.arange(8)  # multiples of the nugget, tried until the correlation matrix has a factor
_REFINEMENTS = 2  # steps against the smoothing by the nugget of a smooth output


class Kriging:
    """Ordinary kriging, with one squared exponential correlation for all outputs and a constant for each output.

    Many points without noise need a nugget for the factor of their correlation matrix alone; its smoothing is removed
    from the weights by Riley's refinement.

    Parameters
    ----------
    x : array_like, shape (k, d)
        Distinct points of the unit box.
    y : array_like, shape (k, n)
        Outputs at the points.
    scales : array_like, shape (d,)
        Length scales, in widths of the box.
    nugget : float
        Ratio of the variance of the noise to the variance of the process.

    Raises
    ------
    SurrogateError
        The correlation matrix is singular.

    Attributes
    ----------
    nugget : float
        Nugget used: the least power of ten (up to 1e7) times the given one with which the rounded correlation matrix
        has a factor.
    process : float
        Restricted-likelihood estimate of the variance of the process, pooled over the outputs; 0 for a single point.

    References
    ----------
    Sacks et al., "Design and analysis of computer experiments" (1989), eqs. 7 and 9; Santner, Williams and Notz, "The
    Design and Analysis of Computer Experiments", 2nd edition (2018), section 3.3 (restricted likelihood); Riley,
    "Solving systems of linear equations with a positive definite, symmetric, but possibly ill-conditioned matrix",
    Mathematical Tables and Other Aids to Computation 9 (1955).
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, scales: ArrayLike, nugget: float = JITTER) -> None:
        self._x, self._y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        self._scales = np.asarray(scales, dtype=np.float64)
        correlation = self._correlation(self._x)
        for times in _TIMES:
            self.nugget = nugget * times
            matrix = correlation + self.nugget * np.eye(len(self._x))
            try:
                self._factor = scipy.linalg.cho_factor(matrix, lower=True)
                break
            except (np.linalg.LinAlgError, ValueError) as error:
                if times == _TIMES[-1]:
                    raise SurrogateError(f"kriging of {len(self._x)} points is impossible ({error}).") from None
        self._ones = scipy.linalg.cho_solve(self._factor, np.ones(len(self._x)))
        self._constant = self._ones @ self._y / self._ones.sum()
        left = self._y - self._constant
        self._weights = scipy.linalg.cho_solve(self._factor, left)
        for _ in range(_REFINEMENTS if len(self._x) > _MANY and self.nugget < JITTER else 0):
            # error of the prediction at the points themselves
            off = left - matrix @ self._weights + self.nugget * self._weights
            self._weights = self._weights + scipy.linalg.cho_solve(self._factor, off)
        freedom = self._y.shape[1] * (len(self._x) - 1)
        self.process = float((left * self._weights).sum() / freedom) if freedom else 0.0

    def _correlation(self, points: Doubles) -> Doubles:
        away = (points[:, None] - self._x) / self._scales
        return np.asarray(np.exp(-0.5 * (away**2).sum(axis=-1)))

    def mean(self, points: Doubles) -> Doubles:
        """Predicted outputs, shape (m, n), at points of the unit box, shape (m, d)."""
        return np.asarray(self._constant + self._correlation(points) @ self._weights)

    def variance(self, points: Doubles) -> Doubles:
        """Variance of the prediction error at points, shape (m, d) to (m,); it is the same for all outputs."""
        near = self._correlation(points)
        known = (near * scipy.linalg.cho_solve(self._factor, near.T).T).sum(axis=1)
        trend = (1.0 - near @ self._ones) ** 2 / self._ones.sum()
        return np.asarray(self.process * np.maximum(1.0 - known + trend, 0.0))

    @cached_property
    def _projected(self) -> Doubles:
        """Inverse of the correlation matrix, projected so that the constant of the outputs is left out."""
        inverse = scipy.linalg.cho_solve(self._factor, np.eye(len(self._x)))
        return np.asarray(inverse - np.outer(self._ones, self._ones) / self._ones.sum())

    @cached_property
    def excess(self) -> float:
        """Mean square of the standardised leave-one-out errors, at least 1."""
        if len(self._x) < 2 or self.process <= 0.0:
            return 1.0
        standardised = self.leave_one_out() ** 2 * np.diag(self._projected)[:, None] / self.process
        return max(1.0, float(standardised.mean()))

    def leave_one_out(self) -> Doubles:
        """Error of the prediction of each point from all other points, with unchanged length scales, shape (k, n).

        References
        ----------
        Dubrule, "Cross validation of kriging in a unique neighborhood", Mathematical Geology 15 (1983).
        """
        return np.asarray(self._projected @ self._y / np.diag(self._projected)[:, None])


def baseline_factor(x: Doubles, y: Doubles, baseline: Doubles) -> float:
    """Factor of the baseline in y(x) = factor * baseline(x) + constant + Gaussian process, for one output.

    Generalised least squares with a length scale of one width of the box; the prior of the factor is normal, with mean
    1 and standard deviation 0.3. With a few runs, the variance of the process is drawn to its value for a factor of 1.

    Parameters
    ----------
    x : ndarray, shape (k, d)
        At least two distinct points of the unit box.
    y, baseline : ndarray, shape (k,)
        Output at the points, and its baseline.

    References
    ----------
    Kennedy and O'Hagan, "Predicting the output from a complex computer code when fast approximations are available",
    Biometrika 87 (2000), eq. 1 and section 3.
    """
    freedom, scales = len(x) - 1, np.ones(x.shape[1])

    def process(factor: float) -> float:
        return Kriging(x, (y - factor * baseline)[:, None], scales).process

    weights = Kriging(x, baseline[:, None], scales)._projected @ baseline
    factor, first = 1.0, process(1.0)
    for _ in range(_ROUNDS):
        variance = (freedom * process(factor) + first) / (freedom + 1)
        prior = max(variance, 1e-300) / _FACTOR_SD**2
        factor = float((y @ weights + prior) / (baseline @ weights + prior))
    return factor


def train(x: Doubles, y: Doubles, noise_variance: float | None = 0.0) -> tuple[Doubles, float]:
    """Length scales and nugget that maximise their posterior density, from a few starts of the search.

    The prior of a length scale is log-normal; its median is the width of the box, and its log standard deviation is 1.
    A few runs do not determine a length scale, and their likelihood alone would often choose one so short that a run
    tells nothing about its neighbourhood. The constants of the outputs and the variance of the process are integrated
    out of the likelihood.

    Parameters
    ----------
    x : ndarray, shape (k, d)
        Distinct points of the unit box.
    y : ndarray, shape (k, n)
        Outputs at the points.
    noise_variance : float or None
        Variance of the outputs among runs of equal X; None for noise of unknown variance, which is then estimated
        together with the length scales.

    Returns
    -------
    scales : ndarray, shape (d,)
        Length scales, in widths of the box.
    nugget : float
        Ratio of the variance of the noise to the variance of the process.
    """
    d = x.shape[1]
    if len(x) < 2:
        return np.ones(d), JITTER
    squares = (x[:, None] - x[None]) ** 2
    limits = [tuple(np.log(_SCALES))] * d
    if len(x) > _MANY and noise_variance == 0.0:
        return _of_many(x, y)
    free = noise_variance is None
    if free:
        limits.append((np.log(JITTER), np.log(_MOST_NOISE)))
    nugget, scales = JITTER, np.ones(d)
    for _ in range(_ROUNDS if noise_variance else 1):
        if noise_variance:
            process = Kriging(x, y, scales, nugget).process
            nugget = float(np.clip(noise_variance / max(process, 1e-300), JITTER, _MOST_NOISE))
        starts = []
        for group in _STARTS:
            places = [np.log([start] * d + [1e-2] * free) for start in group]
            highest = int(np.argmin([_minus_log_posterior(at, squares, y, nugget)[0] for at in places]))
            starts += [places[k] for k in sorted({0, highest})]
        found = [
            scipy.optimize.minimize(
                _minus_log_posterior, start, args=(squares, y, nugget), jac=True, method="L-BFGS-B", bounds=limits
            )
            for start in starts
        ]
        best = min(found, key=lambda result: float(result.fun)).x
        scales = np.exp(best[:d])
        nugget = float(np.exp(best[d])) if free else nugget
    return np.asarray(scales), nugget


def _of_many(x: Doubles, y: Doubles) -> tuple[Doubles, float]:
    """Length scales and nugget of many points without noise.

    Many points tell how smooth an output is: for statistics of runs, the likelihood prefers nuggets of 1e-9 to 1e-4,
    for closed forms the least possible one.
    """
    d, part = x.shape[1], np.linspace(0, len(x) - 1, _PART).astype(int)
    start = np.log(train(x[part], y[part])[0])
    squares = (x[:, None] - x[None]) ** 2
    limits = [tuple(np.log(_SCALES))] * d + [(np.log(_LEAST_NUGGET * len(x)), np.log(_MOST_NOISE))]
    found = [
        scipy.optimize.minimize(
            _minus_log_posterior, [*start, np.log(nugget)], (squares, y, nugget), "L-BFGS-B",
            jac=True, bounds=limits, options={"maxfun": _EVALUATIONS},
        )
        for nugget in _NUGGETS
    ]  # fmt: skip
    best = np.exp(min(found, key=lambda result: float(result.fun)).x)
    return best[:d], float(best[d])


def _minus_log_posterior(log: Doubles, squares: Doubles, y: Doubles, nugget: float) -> tuple[float, Doubles]:
    """Negative logarithm of the product of restricted likelihood and prior, with its gradient.

    The gradient is taken with respect to the logarithms of the length scales and, if it is estimated, of the nugget.
    """
    (k, n), d = y.shape, squares.shape[2]
    inverse_squares = np.exp(-2.0 * log[:d])
    correlation = np.exp(-0.5 * squares @ inverse_squares)
    nugget = float(np.exp(log[d])) if len(log) > d else nugget
    try:
        factor = scipy.linalg.cho_factor(correlation + nugget * np.eye(k), lower=True)
    except np.linalg.LinAlgError:
        return _IMPOSSIBLE, np.zeros_like(log)
    inverse = scipy.linalg.cho_solve(factor, np.eye(k))
    ones = inverse.sum(axis=0)
    weights = (inverse - np.outer(ones, ones) / ones.sum()) @ y
    rest = max(float((y * weights).sum()), 1e-300)
    freedom = n * (k - 1)
    log_determinant = 2.0 * np.log(np.diag(factor[0])).sum() + np.log(ones.sum())
    value = 0.5 * (freedom * np.log(rest) + n * log_determinant)
    slopes = [correlation * squares[:, :, j] * inverse_squares[j] for j in range(d)]
    slopes += [nugget * np.eye(k)] * (len(log) - d)
    gradient = np.array(
        [
            0.5 * (-freedom * (weights * (slope @ weights)).sum() / rest
                   + n * ((inverse * slope).sum() - ones @ slope @ ones / ones.sum()))
            for slope in slopes
        ]
    )  # fmt: skip
    away = np.append(log[:d], np.zeros(len(log) - d)) / _LOG_SD
    return value + 0.5 * float((away**2).sum()), gradient + away / _LOG_SD
