"""Kriging of a run's density parameters as functions of X."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from radcal import skewnormal
from radcal.calibration.class_surrogate import ClassRuns
from radcal.errors import SurrogateError
from radcal.storage.layout import put, take
from radcal.storage.records import read_hdf5, write_hdf5

__all__ = ["OUTPUTS", "Surrogate", "leave_one_out_q2", "read_surrogates", "to_direct", "write_surrogates"]

Outputs = Literal["centred", "direct"]
OUTPUTS: dict[Outputs, tuple[str, str, str]] = {
    "centred": ("mean", "log sd", "skewness"),
    "direct": ("xi", "omega", "alpha"),
}
_SKEWNESS_LIMIT = 0.995
# the library's default start (it takes one number for all dimensions)
_THETA0 = 1e-2
_NUGGETS = (1e-10, 10.0)  # between smt's own jitter and hardly anything but noise
_RETRIES: tuple[dict[str, Any], ...] = (
    {"n_start": 20, "theta0": [1e-1]},
    {"n_start": 10, "hyper_opt": "Cobyla"},
    {"n_start": 10, "hyper_opt": "Cobyla", "nugget": 1e-10},
)


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


def _krg(options: Mapping[str, Any]) -> tuple[Any, list[Any]]:
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


def leave_one_out_q2(model: Any) -> float:
    """Leave-one-out Q2 in closed form (Dubrule, "Cross validation of kriging", 1983)."""
    parts = model.optimal_par
    identity = np.eye(len(parts["C"]))
    half = solve_triangular(parts["C"], identity, lower=True)
    # P = R^-1 - R^-1 F (F' R^-1 F)^-1 F' R^-1 with Ft = C^-1 F = Q G
    inner = parts["Q"].T @ half
    diagonal = (half**2).sum(axis=0) - (inner**2).sum(axis=0)
    y = model.y_norma.ravel()
    error = parts["gamma"].ravel() / diagonal
    return float(1.0 - (error**2).sum() / ((y - y.mean()) ** 2).sum())


class _Predictor:
    """A trained smt model's mean and variance, without what smt spends around them.

    The search asks for a few points at a time, tens of thousands of times; nine tenths of
    smt's answer is argument checking in scikit-learn's distance function. The formulas are
    those of ordinary kriging (Sacks et al., "Design and analysis of computer experiments",
    1989, eqs. 7 and 9) with the squared exponential correlation.
    """

    def __init__(self, model: Any) -> None:
        parts = model.optimal_par
        self._offset, self._scale, self._x = model.X_offset, model.X_scale, model.X_norma
        self._theta = np.asarray(model.optimal_theta, dtype=np.float64).ravel()
        self._mean, self._sd = float(np.ravel(model.y_mean)[0]), float(np.ravel(model.y_std)[0])
        self._beta, self._gamma = float(np.ravel(parts["beta"])[0]), np.ravel(parts["gamma"])
        self._cholesky, self._ft, self._g = parts["C"], np.ravel(parts["Ft"]), float(np.ravel(parts["G"])[0])
        self._variance = float(np.ravel(parts["sigma2"])[0])

    def _correlation(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        difference = ((points - self._offset) / self._scale)[:, None, :] - self._x
        return np.asarray(np.exp(-(difference**2) @ self._theta))

    def mean(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._mean + self._sd * (self._beta + self._correlation(points) @ self._gamma))

    def variance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        half = solve_triangular(self._cholesky, self._correlation(points).T, lower=True)
        trend = (self._ft @ half - 1.0) / self._g
        return np.asarray(np.maximum(self._variance * (1.0 - (half**2).sum(axis=0) + trend**2), 0.0))


@dataclass(frozen=True)
class _Trained:
    model: Any
    theta: NDArray[np.float64]
    nugget: float
    q2: float
    status: str


def _train_one(x: NDArray[np.float64], y: NDArray[np.float64], options: Mapping[str, Any]) -> _Trained:
    """Train one output; say how the optimiser ended."""
    model, statuses = _krg(options)
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
    return _Trained(model, theta, nugget, leave_one_out_q2(model), status)


def _with_noise(x: NDArray[np.float64], y: NDArray[np.float64], found: _Trained, variance: float) -> _Trained:
    """Raise the nugget until it stands for a noise of this variance, and choose the length scales again with it."""
    from scipy.optimize import brentq

    def fixed(nugget: float, theta: NDArray[np.float64]) -> _Trained:
        return _train_one(x, y, {"theta0": theta.tolist(), "nugget": nugget, "hyper_opt": "NoOp"})

    def excess(trained: _Trained) -> float:
        """Log of the noise that a training stands for, over the variance asked."""
        process = float(np.ravel(trained.model.optimal_par["sigma2"])[0])
        return float(np.log(trained.nugget * process / variance))

    def raised(theta: NDArray[np.float64]) -> float:
        low, high = np.log([_NUGGETS[0], _NUGGETS[1]])
        # nugget times process variance rises with the nugget, up to the variance of the runs
        if excess(fixed(_NUGGETS[1], theta)) <= 0.0:
            return _NUGGETS[1]
        if excess(fixed(_NUGGETS[0], theta)) >= 0.0:
            return _NUGGETS[0]
        return float(np.exp(brentq(lambda log: excess(fixed(float(np.exp(log)), theta)), low, high, xtol=1e-2)))

    if found.nugget > 0.0 and excess(found) >= 0.0:
        return found
    theta = found.theta
    with contextlib.suppress(SurrogateError):
        theta = _train_one(x, y, {"theta0": theta.tolist(), "nugget": raised(theta)}).theta
    return replace(fixed(raised(theta), theta), status=found.status)


class Surrogate:
    """One kriging model per density parameter, on the unit box of X.

    Parameters
    ----------
    bounds : array_like, shape (d, 2)
        Box of X.
    parameters : array_like, shape (n, d)
        Training points.
    dp : array_like, shape (n, 3)
        Their densities: xi [dB], omega [dB], alpha.
    outputs : {'centred', 'direct'}
        (mean [dB], log sd, skewness) or (xi [dB], omega [dB], alpha).
    noisy : bool
        Whether equal parameters give unequal densities: a nugget is then estimated with the
        length scales, and the surrogate smooths instead of interpolating.
    noise_variance : array_like, shape (3,), optional
        Variance of mean [dB2], log sd and skewness among runs of equal parameters, where it has been
        measured. The nugget is then taken at least so large that nugget times process variance is
        this: from few runs the likelihood alone cannot tell noise from a short length scale. Not
        used for direct outputs.
    integer : array_like of bool, shape (d,), optional
        Which parameters are whole numbers, between bounds that are whole.

    Raises
    ------
    SurrogateError
        NaN in the training data, too few points, or no training succeeded.

    Attributes
    ----------
    theta : ndarray, shape (3, d)
        Inverse squared length scales of each output, in smt's standardised coordinates.
    nugget, q2 : ndarray, shape (3,)
        Nugget (noise variance over the process's, as on the diagonal of the correlation
        matrix; Rasmussen and Williams, "Gaussian Processes for Machine Learning", eq. 2.20)
        and leave-one-out Q2 of each output.
    status : list of str
        How each output's optimiser ended.

    Notes
    -----
    smt given three outputs at once trains one length scale for all and fails silently;
    each output has its own model here, its optimiser's status and its leave-one-out Q2
    are kept and a failed training is retried from elsewhere.
    """

    def __init__(
        self,
        bounds: ArrayLike,
        parameters: ArrayLike,
        dp: ArrayLike,
        outputs: Outputs = "centred",
        noisy: bool = False,
        noise_variance: ArrayLike | None = None,
        integer: ArrayLike | None = None,
    ) -> None:
        self.bounds = np.asarray(bounds, dtype=np.float64)
        self.integer = np.zeros(len(self.bounds), bool) if integer is None else np.asarray(integer, dtype=np.bool_)
        self.outputs: Outputs = outputs
        self.noisy = noisy
        known = noise_variance is not None and noisy and outputs == "centred"
        self.noise_variance = np.asarray(noise_variance if known else [0.0] * 3, dtype=np.float64)
        self.parameters = np.asarray(parameters, dtype=np.float64)
        self.dp = np.asarray(dp, dtype=np.float64)
        for name, array in (("parameters", self.parameters), ("densities", self.dp)):
            if not np.isfinite(array).all():
                raise SurrogateError(f"the surrogate's training {name} hold values that are not finite.")
        if len(self.parameters) < 3:
            raise SurrogateError(f"a surrogate needs at least 3 runs, found {len(self.parameters)}.")
        self._values = self.dp if outputs == "direct" else _learnt(self.dp)
        self._models: list[Any] = []
        self._predictors: list[_Predictor] = []

    def unit(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """X to the unit box."""
        low, high = self.bounds.T
        return np.asarray((np.asarray(parameters, dtype=np.float64) - low) / (high - low))

    def scaled(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Unit box to X, inside the bounds to the last bit, whole parameters rounded."""
        low, high = self.bounds.T
        x = np.clip(low + np.asarray(unit, dtype=np.float64) * (high - low), low, high)
        return np.asarray(np.where(self.integer, np.round(x), x))

    def snapped(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Points of the unit box that are simulated in place of these: whole parameters rounded."""
        unit = np.asarray(unit, dtype=np.float64)
        return np.where(self.integer, self.unit(self.scaled(unit)), unit) if self.integer.any() else unit

    def train(self, start: ArrayLike | None = None, retry: bool = True) -> Surrogate:
        """Optimise the length scales.

        Parameters
        ----------
        start : array_like, shape (3, d), optional
            Length scales to start from, for a single local search; without them the
            library's own multi-start is used.
        retry : bool
            Search again where the optimiser failed or Q2 is not positive; without it the
            library's first word stands, unless it has none.

        Returns
        -------
        Surrogate
            Itself.

        Raises
        ------
        SurrogateError
            No attempt gave a finite likelihood.
        """
        x = self.unit(self.parameters)
        noise = {"eval_noise": True, "hyper_opt": "Cobyla"} if self.noisy else {}  # smt has no other optimiser for it
        trained = []
        for k in range(3):
            first: dict[str, Any] = {"theta0": [_THETA0]}
            if start is not None:
                first = {"theta0": np.asarray(start, dtype=np.float64)[k].tolist(), "n_start": 1}
            best: _Trained | None = None
            failure = SurrogateError("")
            for attempt, options in enumerate((first, *_RETRIES)):
                try:
                    found = _train_one(x, self._values[:, k], {"theta0": [_THETA0], **options, **noise})
                except SurrogateError as error:
                    failure = error
                    continue
                if best is None or found.q2 > best.q2:
                    best = found
                # an output that two searches from many starts cannot predict is noise at these points:
                # more searching does not help, more runs may
                if not retry or (best.status != "failed" and (best.q2 > 0.0 or attempt > 0 or start is not None)):
                    break
            if best is None:
                raise SurrogateError(f"kriging of {OUTPUTS[self.outputs][k]}: {failure}")
            if self.noise_variance[k] > 0.0:
                best = _with_noise(x, self._values[:, k], best, float(self.noise_variance[k]))
            trained.append(best)
        # the models just trained are let go: rebuilt from their length scales they agree to the last
        # bit with those that another job or process rebuilds
        self.restore(
            [t.theta for t in trained],
            [t.nugget for t in trained],
            [t.q2 for t in trained],
            [t.status for t in trained],
        )
        return self

    def restore(self, theta: ArrayLike, nugget: ArrayLike, q2: ArrayLike, status: Sequence[str]) -> Surrogate:
        """Take what a training found, shapes (3, d), (3,), (3,), (3,); the models are rebuilt when first asked."""
        self.theta = np.asarray(theta, dtype=np.float64)
        self.nugget = np.asarray(nugget, dtype=np.float64)
        self.q2 = np.asarray(q2, dtype=np.float64)
        self.status = [str(s) for s in status]
        self._models, self._predictors = [], []
        return self

    def models(self) -> list[Any]:
        """The smt models, one per output (rebuilt where only their length scales are known)."""
        if not self._models:
            x = self.unit(self.parameters)
            self._models = [
                _train_one(
                    x,
                    self._values[:, k],
                    {"theta0": self.theta[k].tolist(), "nugget": float(self.nugget[k]), "hyper_opt": "NoOp"},
                ).model
                for k in range(3)
            ]
        return self._models

    def __getstate__(self) -> dict[str, Any]:
        # smt's models are rebuilt rather than sent from process to process
        return {**self.__dict__, "_models": [], "_predictors": []}

    def _fast(self) -> list[_Predictor]:
        if not self._predictors:
            self._predictors = [_Predictor(model) for model in self.models()]
        return self._predictors

    def predict(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Learnt outputs at points of the unit box, shape (n, d) to (n, 3)."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        return np.column_stack([output.mean(points) for output in self._fast()])

    def standard_error(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Kriging standard error of the outputs, shape (n, d) to (n, 3)."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        return np.sqrt(np.column_stack([output.variance(points) for output in self._fast()]))

    def centred(self, values: ArrayLike) -> NDArray[np.float64]:
        """Learnt outputs to (mean [dB], log sd, skewness), shape (..., 3)."""
        values = np.asarray(values, dtype=np.float64)
        if self.outputs == "centred":
            return values
        xi, omega, alpha = np.moveaxis(values, -1, 0)
        return _learnt(np.stack([xi, np.maximum(omega, 1e-6), alpha], axis=-1))


def to_direct(learnt: ArrayLike) -> NDArray[np.float64]:
    """(mean [dB], log sd, skewness) to DP, a skewness out of reach drawn to the limit."""
    mean, log_sd, skewness = np.moveaxis(np.asarray(learnt, dtype=np.float64), -1, 0)
    skewness = np.clip(skewness, -_SKEWNESS_LIMIT, _SKEWNESS_LIMIT)
    return skewnormal.direct(np.stack([mean, np.exp(np.clip(log_sd, -20.0, 20.0)), skewness], axis=-1))


def _learnt(dp: NDArray[np.float64]) -> NDArray[np.float64]:
    """DP to (mean [dB], log sd, skewness)."""
    mean, sd, skewness = np.moveaxis(skewnormal.centred(dp), -1, 0)
    return np.stack([mean, np.log(sd), skewness], axis=-1)


@dataclass(frozen=True)
class _Kriging:
    """Data and hyper-parameters of a :class:`Surrogate`, under the names of its arguments and attributes."""

    outputs: Outputs
    status: tuple[str, ...]
    bounds: NDArray[np.float64]
    integer: NDArray[np.bool_]
    parameters: NDArray[np.float64]
    dp: NDArray[np.float64]
    theta: NDArray[np.float64]
    nugget: NDArray[np.float64]
    q2: NDArray[np.float64]

    @classmethod
    def of(cls, surrogate: Surrogate) -> _Kriging:
        return cls(**{item.name: getattr(surrogate, item.name) for item in fields(cls)})

    def rebuilt(self) -> Surrogate:
        surrogate = Surrogate(self.bounds, self.parameters, self.dp, self.outputs, integer=self.integer)
        return surrogate.restore(self.theta, self.nugget, self.q2, self.status)


@dataclass(frozen=True)
class _Stored:
    """Content of a file: one mapping or the other, as the objective asks."""

    densities: Mapping[str, _Kriging]
    classes: Mapping[str, ClassRuns]


def write_surrogates(path: str | Path, surrogates: Mapping[str, Surrogate | ClassRuns]) -> None:
    """Store surrogates as data and hyper-parameters, atomically; of classes of incidence the data are all."""
    densities = {name: _Kriging.of(one) for name, one in surrogates.items() if isinstance(one, Surrogate)}
    classes = {name: one for name, one in surrogates.items() if isinstance(one, ClassRuns)}
    with write_hdf5(path, "surrogate") as file:
        put(file, _Stored(densities, classes))


def read_surrogates(path: str | Path) -> dict[str, Surrogate | ClassRuns]:
    """Rebuild the surrogates that :func:`write_surrogates` stored.

    Raises
    ------
    StoreError
        The file is missing, damaged, or of another version or case.
    """
    with read_hdf5(path, "surrogate") as file:
        stored = take(file, _Stored)
    return {**{name: one.rebuilt() for name, one in stored.densities.items()}, **stored.classes}
