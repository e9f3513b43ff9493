"""Kriging of a run's density parameters as functions of X."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.calibration.class_surrogate import ClassRuns
from radcal.calibration.kriging import THETA0, Kriging, Trained, fixed, train_one, with_noise
from radcal.errors import SurrogateError
from radcal.storage.layout import put, take
from radcal.storage.records import read_hdf5, write_hdf5

__all__ = ["OUTPUTS", "Surrogate", "read_surrogates", "to_direct", "write_surrogates"]

Outputs = Literal["centred", "direct"]
OUTPUTS: dict[Outputs, tuple[str, str, str]] = {
    "centred": ("mean", "log sd", "skewness"),
    "direct": ("xi", "omega", "alpha"),
}
_SKEWNESS_LIMIT = 0.995
_RETRIES: tuple[dict[str, Any], ...] = (
    {"n_start": 20, "theta0": [1e-1]},
    {"n_start": 10, "hyper_opt": "Cobyla"},
    {"n_start": 10, "hyper_opt": "Cobyla", "nugget": 1e-10},
)


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
        self._models: list[Kriging] = []

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
            first: dict[str, Any] = {"theta0": [THETA0]}
            if start is not None:
                first = {"theta0": np.asarray(start, dtype=np.float64)[k].tolist(), "n_start": 1}
            best: Trained | None = None
            failure = SurrogateError("")
            for attempt, options in enumerate((first, *_RETRIES)):
                try:
                    found = train_one(x, self._values[:, k], {"theta0": [THETA0], **options, **noise})
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
                best = with_noise(x, self._values[:, k], best, float(self.noise_variance[k]))
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
        self._models = []
        return self

    def models(self) -> list[Kriging]:
        """Kriging models, one per output (rebuilt where only their length scales are known)."""
        if not self._models:
            x = self.unit(self.parameters)
            self._models = [fixed(x, self._values[:, k], self.theta[k], float(self.nugget[k])) for k in range(3)]
        return self._models

    def __getstate__(self) -> dict[str, Any]:
        # models are rebuilt rather than sent from process to process
        return {**self.__dict__, "_models": []}

    def predict(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Learnt outputs at points of the unit box, shape (n, d) to (n, 3)."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        return np.column_stack([output.mean(points) for output in self.models()])

    def standard_error(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Kriging standard error of the outputs, shape (n, d) to (n, 3)."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        return np.sqrt(np.column_stack([output.variance(points) for output in self.models()]))

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
