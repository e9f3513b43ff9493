"""Ordinary kriging of one output: length scales chosen by smt, and the model that they make, without smt."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.linalg import solve_triangular

from radcal.errors import SurrogateError

__all__ = ["THETA0", "Kriging", "Trained", "fixed", "leave_one_out_q2", "smt_krg", "train_one", "with_noise"]

# smt's default start (it takes one number for all dimensions)
THETA0 = 1e-2
_SMT_BOUNDS = (1e-6, 2e1)  # of length scales
_NUGGETS = (1e-10, 10.0)  # between smt's own jitter and hardly anything but noise


@cache
def _krg_class() -> Any:
    """Kriging class of smt, imported without smt's other surrogates.

    The package itself imports every surrogate, and with one of them matplotlib, a third of the whole. While the
    module of kriging is imported, an empty package stands in its place.
    """
    name = "smt.surrogate_models"
    if name in sys.modules:
        return import_module(name).KRG
    spec = find_spec(name)
    if spec is None:
        raise ImportError(f"No module named {name!r}", name=name)
    sys.modules[name] = module_from_spec(spec)
    try:
        return import_module(f"{name}.krg").KRG
    finally:
        del sys.modules[name]


def smt_krg(options: Mapping[str, Any]) -> tuple[Any, list[Any]]:
    """Return an smt KRG that keeps what its optimiser reports, and that list."""
    statuses: list[Any] = []

    class Watched(_krg_class()):  # type: ignore[misc]
        def _create_optimizer(self) -> Any:
            optimizer = super()._create_optimizer()
            inner = optimizer._minimize

            def watched(*args: Any, **kwargs: Any) -> Any:
                result = inner(*args, **kwargs)
                statuses.append(result)
                return result

            optimizer._minimize = watched
            return optimizer

    return Watched(print_global=False, **options), statuses


@dataclass(frozen=True)
class Trained:
    """What a training found.

    Attributes
    ----------
    theta : ndarray, shape (d,)
        Inverse squared length scales, in standardised coordinates.
    nugget : float
        Noise variance over the process's.
    q2 : float
        Leave-one-out Q2.
    status : str
        How the optimiser ended.
    process : float
        Variance of the process, in the output's unit squared.
    """

    theta: NDArray[np.float64]
    nugget: float
    q2: float
    status: str
    process: float


def leave_one_out_q2(parts: Mapping[str, Any], y: NDArray[np.float64]) -> float:
    """Leave-one-out Q2 in closed form (Dubrule, "Cross validation of kriging", 1983).

    Parameters
    ----------
    parts : mapping
        ``C``, lower Cholesky factor of the correlation matrix R, shape (n, n); ``Q``, orthonormal basis of C^-1 F, with
        F the trend's functions at the points, shape (n, 1); ``gamma``, R^-1 (y - F beta), shape (n, 1).
    y : ndarray, shape (n, 1)
        Standardised output.

    Returns
    -------
    float
        One minus the mean squared error of each point predicted from the others over the variance, no unit.
    """
    half = solve_triangular(parts["C"], np.eye(len(parts["C"])), lower=True)
    # P = R^-1 - R^-1 F (F' R^-1 F)^-1 F' R^-1 with Ft = C^-1 F = Q G
    inner = parts["Q"].T @ half
    diagonal = (half**2).sum(axis=0) - (inner**2).sum(axis=0)
    y = y.ravel()
    error = parts["gamma"].ravel() / diagonal
    return float(1.0 - (error**2).sum() / ((y - y.mean()) ** 2).sum())


class Kriging:
    """Ordinary kriging with squared exponential correlation of given length scales: mean and variance.

    Parameters
    ----------
    x : ndarray, shape (n, d)
        Points.
    y : ndarray, shape (n,)
        Output at the points.
    theta : ndarray, shape (d,)
        Inverse squared length scales, in standardised coordinates.
    nugget : float
        Noise variance over the process's.

    Raises
    ------
    SurrogateError
        The correlation matrix is singular.

    Attributes
    ----------
    q2, process : float
        Leave-one-out Q2, and variance of the process in the output's unit squared.

    Notes
    -----
    smt's model of the same length scales has the same numbers to the last bit (a test compares them). Importing smt
    takes longer than a search, and nine tenths of its answer to a few points, which the search asks for tens of
    thousands of times, is argument checking.

    References
    ----------
    Sacks et al., "Design and analysis of computer experiments" (1989), eqs. 7 and 9.
    """

    def __init__(
        self, x: NDArray[np.float64], y: NDArray[np.float64], theta: NDArray[np.float64], nugget: float
    ) -> None:
        (self._x, self._offset, self._scale), (y, mean, sd) = _standardised(x, 100.0), _standardised(y[:, None], 0.0)
        self._mean, self._sd, self._theta = float(mean[0]), float(sd[0]), theta
        n = len(x)
        first, second = np.triu_indices(n, 1)
        distance = np.abs(self._x[first] - self._x[second]) ** 2.0
        correlation = np.eye(n) * (1.0 + nugget)
        correlation[first, second] = correlation[second, first] = np.exp(-np.sum(theta * distance, axis=1))
        try:
            cholesky = linalg.cholesky(correlation, lower=True)
        except (linalg.LinAlgError, ValueError) as error:
            raise SurrogateError(f"kriging of {n} points is impossible ({error}).") from None
        trend = solve_triangular(cholesky, np.ones((n, 1)), lower=True)
        basis, factor = linalg.qr(trend, mode="economic")
        whitened = solve_triangular(cholesky, y, lower=True)
        beta = solve_triangular(factor, np.dot(basis.T, whitened))
        residual = whitened - np.dot(trend, beta)
        gamma = solve_triangular(cholesky.T, residual)
        self._beta, self._gamma, self._cholesky = float(beta[0, 0]), gamma[:, 0], cholesky
        self._ft, self._g = trend[:, 0], float(factor[0, 0])
        self.process = float(((residual**2.0).sum(axis=0) / n * sd**2.0)[0])
        self.q2 = leave_one_out_q2({"C": cholesky, "Q": basis, "gamma": gamma}, y)

    def _correlation(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        difference = ((points - self._offset) / self._scale)[:, None, :] - self._x
        return np.asarray(np.exp(-(difference**2) @ self._theta))

    def mean(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Prediction at points, shape (m, d) to (m,)."""
        return np.asarray(self._mean + self._sd * (self._beta + self._correlation(points) @ self._gamma))

    def variance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance of the prediction's error at points, shape (m, d) to (m,)."""
        half = solve_triangular(self._cholesky, self._correlation(points).T, lower=True)
        trend = (self._ft @ half - 1.0) / self._g
        return np.asarray(np.maximum(self.process * (1.0 - (half**2).sum(axis=0) + trend**2), 0.0))


def _standardised(
    values: NDArray[np.float64], smallest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Columns of mean 0 and sd 1, with mean and sd; columns of an sd up to so many machine epsilons keep theirs."""
    values = np.ascontiguousarray(values)
    mean, sd = np.mean(values, axis=0), values.std(axis=0, ddof=1)
    sd[sd <= smallest * np.finfo(np.float64).eps] = 1.0
    return (values - mean) / sd, mean, sd


def train_one(x: NDArray[np.float64], y: NDArray[np.float64], options: Mapping[str, Any]) -> Trained:
    """Train one output by smt.

    Parameters
    ----------
    x : ndarray, shape (n, d)
        Points.
    y : ndarray, shape (n,)
        Output at the points.
    options : mapping
        Of ``smt.surrogate_models.KRG``.

    Returns
    -------
    Trained
        The length scales, and how the optimiser ended.

    Raises
    ------
    SurrogateError
        smt has no model.
    """
    model, statuses = smt_krg(options)
    model.set_training_values(x, y[:, None])
    printed = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        warnings.simplefilter("ignore")
        try:
            model.train()
        except Exception as error:
            raise SurrogateError(f"smt could not train on {len(x)} points ({error}).") from None
    theta = np.asarray(model.optimal_theta, dtype=np.float64).ravel()
    if options.get("hyper_opt") == "NoOp":
        status = "fixed"
    elif "failed" in printed.getvalue() or not any(np.isfinite(s.fun) for s in statuses):
        status = "failed"
    else:
        best = min(statuses, key=lambda s: float(np.asarray(s.fun).ravel()[0]))
        # smt gives its optimiser few evaluations; stopping there, above the start, is its normal end
        status = "converged" if best.success else "evaluations used up"
        if not best.success and np.allclose(theta, options["theta0"]):
            status = "failed"
    nugget = float(np.ravel(model.optimal_noise)[0]) if options.get("eval_noise") else float(model.options["nugget"])
    q2 = leave_one_out_q2(model.optimal_par, model.y_norma)
    return Trained(theta, nugget, q2, status, float(np.ravel(model.optimal_par["sigma2"])[0]))


def _taken(x: NDArray[np.float64], y: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length scales that smt takes for these: the same but for the last digit, others where they are out of bounds."""
    if ((theta < _SMT_BOUNDS[0]) | (theta > _SMT_BOUNDS[1])).any():
        return train_one(x, y, {"theta0": theta.tolist(), "hyper_opt": "NoOp"}).theta
    return np.asarray(10.0 ** np.log10(theta))


def fixed(x: NDArray[np.float64], y: NDArray[np.float64], theta: NDArray[np.float64], nugget: float) -> Kriging:
    """Kriging model with length scales that a training found: the same in every job and process."""
    return Kriging(x, y, _taken(x, y, theta), nugget)


def with_noise(x: NDArray[np.float64], y: NDArray[np.float64], found: Trained, variance: float) -> Trained:
    """Raise the nugget until it stands for a noise of this variance, and choose the length scales again with it."""
    from scipy.optimize import brentq

    def excess(nugget: float, process: float) -> float:
        """Log of the noise that a nugget stands for, over the variance asked."""
        return float(np.log(nugget * process / variance))

    def raised(theta: NDArray[np.float64]) -> float:
        def missed(log_nugget: float) -> float:
            nugget = float(np.exp(log_nugget))
            return excess(nugget, fixed(x, y, theta, nugget).process)

        low, high = np.log([_NUGGETS[0], _NUGGETS[1]])
        # nugget times process variance rises with the nugget, up to the variance of the runs
        if excess(_NUGGETS[1], fixed(x, y, theta, _NUGGETS[1]).process) <= 0.0:
            return _NUGGETS[1]
        if excess(_NUGGETS[0], fixed(x, y, theta, _NUGGETS[0]).process) >= 0.0:
            return _NUGGETS[0]
        return float(np.exp(brentq(missed, low, high, xtol=1e-2)))

    if found.nugget > 0.0 and excess(found.nugget, found.process) >= 0.0:
        return found
    theta = found.theta
    with contextlib.suppress(SurrogateError):
        theta = train_one(x, y, {"theta0": theta.tolist(), "nugget": raised(theta)}).theta
    nugget, theta = raised(theta), _taken(x, y, theta)
    model = Kriging(x, y, theta, nugget)
    return replace(found, theta=theta, nugget=nugget, q2=model.q2, process=model.process)
