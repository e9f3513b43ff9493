"""Surrogate of the simulator: statistics of a run as the sum of a baseline and the kriged discrepancy of the runs."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.config import SurrogateConfig
from radcal.errors import SurrogateError
from radcal.inference.moments import STATISTICS, from_dp, to_dp
from radcal.objectives import Comparison
from radcal.proposals.kriging import JITTER, Kriging, baseline_factor, train
from radcal.proposals.smt_kriging import train_smt
from radcal.storage.records import Stored

_JUDGED = 4  # least number of runs with which leave-one-out errors decide whether the baseline is kept


@dataclass(frozen=True)
class Training:
    """Data and hyper-parameters of a surrogate.

    Attributes
    ----------
    parameters : ndarray, shape (k, d)
        Distinct X of the runs.
    statistics : ndarray, shape (k, n, 3)
        Mean [dB], log sd and skewness of each incidence-angle bin.
    scales : ndarray, shape (3, d)
        Length scales of each statistic along each parameter, in widths of the bounds.
    nugget : ndarray, shape (3,)
        Ratio of the variance of the noise to the variance of the Gaussian process, for each statistic.
    baseline : ndarray, shape (3,)
        Factor of the baseline in each statistic's prediction; 0 if the prediction leaves the baseline out.
    q2 : ndarray, shape (3,)
        Leave-one-out Q2 of each statistic: one minus the ratio of mean squared error to variance; NaN for one run.
    status : tuple of str
        ``trained`` or ``failed`` for each statistic; only training by the library smt can fail.
    direct : bool
        Whether kriging learns (xi [dB], omega [dB], alpha) in place of (mean, log sd, skewness).
    """

    parameters: NDArray[np.float64]
    statistics: NDArray[np.float64]
    scales: NDArray[np.float64]
    nugget: NDArray[np.float64]
    baseline: NDArray[np.float64]
    q2: NDArray[np.float64]
    status: tuple[str, ...]
    direct: bool = False

    def of_run(self, parameters: ArrayLike) -> Training:
        """Training by one of the runs alone, with baseline: the discrepancy of the run then holds at every X.

        Parameters
        ----------
        parameters : array_like, shape (d,)
            X of the run.
        """
        one = (self.parameters == np.asarray(parameters)).all(axis=1)
        kept = np.ones(len(STATISTICS))
        q2 = np.full(len(STATISTICS), np.nan)
        return replace(self, parameters=self.parameters[one], statistics=self.statistics[one], baseline=kept, q2=q2)

    def sentence(self) -> str:
        """Sentence on the leave-one-out Q2 of each statistic, factors of the baseline, and failed training."""
        found = ", ".join(f"{name} {q2:.3f}" for name, q2 in zip(STATISTICS, self.q2, strict=True))
        alone = [name for name, factor in zip(STATISTICS, self.baseline, strict=True) if not factor]
        failed = [name for name, status in zip(STATISTICS, self.status, strict=True) if status == "failed"]
        factors = zip(STATISTICS, self.baseline, strict=True)
        times = [f"{name} by {factor:.2g}" for name, factor in factors if factor not in (0.0, 1.0)]
        notes = (("without baseline", alone), ("baseline multiplied", times), ("training failed", failed))
        more = "".join(f"; {text}: {', '.join(names)}" for text, names in notes if names)
        return f"leave-one-out Q2 of {len(self.parameters)} runs: {found}{more}"


class Surrogate:
    """Surrogate of the simulator: statistics y(X) = baseline(X) + constant + Gaussian process.

    The baseline follows from law, speckle and noise without any run. A simulator adds other effects (area of facets,
    neighbouring materials, one sample of speckle), which change little with X; kriging learns them from the runs. All
    incidence-angle bins of a statistic share one correlation function.

    Parameters
    ----------
    training : Training
        Data and hyper-parameters.
    objective : Comparison
        Baseline and bounds of the material, and which of its parameters are whole numbers.
    surprise : ndarray, shape (3,), optional
        Ratio of the squared errors of verified predictions to the kriging variance, for each statistic
        (:meth:`radcal.objectives.history.History.surprise`).

    References
    ----------
    Kennedy and O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63 (2001): discrepancy as a
    Gaussian process; Bandler et al., "Space mapping: the state of the art", IEEE Trans. Microwave Theory Tech. 52
    (2004).
    """

    def __init__(self, training: Training, objective: Comparison, surprise: NDArray[np.float64] | None = None) -> None:
        self.training, self._shift = training, np.zeros(len(STATISTICS))
        self._surprise = np.ones(len(STATISTICS)) if surprise is None else surprise
        self.bounds, self.integer = objective.material.box, objective.material.integer
        self.parameters = training.parameters
        self._baseline = objective.baseline if training.baseline.any() else None
        self._shape = training.statistics.shape[1:]
        learnt = _learnt(training.statistics, training.direct) - self._base(self.parameters)
        unit = self.unit(self.parameters)
        self._first = np.mean(learnt[0] ** 2, axis=0) * (training.baseline != 0.0)  # used if it is the only run
        self._models = [
            Kriging(unit, learnt[..., k], training.scales[k], float(training.nugget[k])) for k in range(len(STATISTICS))
        ]

    def drawn(self, seed: int) -> Surrogate:
        """Draw of the surrogate: predictions are off by normal numbers of standard errors, one for each statistic.

        Mean and variance at each X are those of a draw of the Gaussian process. After a single run, for which kriging
        has no variance, the errors are those of :meth:`error`.
        """
        draw = copy.copy(self)
        draw._shift = np.random.default_rng(seed).standard_normal(len(STATISTICS))
        return draw

    def unit(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Parameters X, scaled by their bounds to the unit box."""
        low, high = self.bounds.T
        return np.asarray((np.asarray(parameters, dtype=np.float64) - low) / (high - low))

    def scaled(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Parameters X at points of the unit box, never outside the bounds; whole-number parameters are rounded."""
        low, high = self.bounds.T
        x = np.clip(low + np.asarray(unit, dtype=np.float64) * (high - low), low, high)
        return np.asarray(np.where(self.integer, np.round(x), x))

    def snapped(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Points of the unit box with whole-number parameters rounded to values that can be simulated."""
        unit = np.asarray(unit, dtype=np.float64)
        return np.where(self.integer, self.unit(self.scaled(unit)), unit)

    def _base(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Baseline of the statistics at m parameter vectors X, shape (m, n, 3); 0 for statistics without baseline."""
        if self._baseline is None:
            return np.zeros((len(parameters), *self._shape))
        return self._baseline(parameters) * self.training.baseline

    def predict(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Predicted statistics, shape (m, n, 3), at points of the unit box, shape (m, d)."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        low, high = self.bounds.T
        learnt = self._base(low + points * (high - low)) + np.stack([model.mean(points) for model in self._models], -1)
        if self._shift.any():
            alone = len(self.parameters) == 1
            error = self.error(points)[:, None] if alone else self.standard_error(points)
            learnt = learnt + self._shift * error
        if not self.training.direct:
            return learnt
        xi, omega, alpha = np.moveaxis(learnt, -1, 0)
        return from_dp(np.stack([xi, np.maximum(omega, 1e-6), alpha], axis=-1))

    def error(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Standard error of the predicted statistics, checked against leave-one-out errors, shape (m, d) to (m, 3).

        The kriging variance is multiplied by the larger of two factors if this exceeds 1: the mean square of the
        standardised leave-one-out errors, and ``surprise``. Length scales from few runs are uncertain, and the kriging
        variance alone may be too small. Leave-one-out errors are computed with length scales that all runs determine. A
        verified prediction was made before the run that verifies it.
        With a single run, the mean square of its difference from the baseline serves as variance of the process, and
        one width of the bounds as length scale. All errors are 0 if kriging learns (xi, omega, alpha).

        References
        ----------
        Bastos and O'Hagan, "Diagnostics for Gaussian process emulators", Technometrics 51 (2009).
        """
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        if self.training.direct:
            return np.zeros((len(points), len(STATISTICS)))
        if len(self.parameters) == 1:
            apart = ((points - self.unit(self.parameters)) ** 2).sum(axis=1)
            return np.asarray(np.sqrt(self._first * -np.expm1(-apart)[:, None]))
        variance = np.stack([model.variance(points) for model in self._models], axis=-1)
        excess = np.maximum([model.excess for model in self._models], self._surprise)
        return np.asarray(np.sqrt(excess * variance))

    def standard_error(self, unit: ArrayLike) -> NDArray[np.float64]:
        """Kriging standard error of the statistics, shape (m, d) to (m, n, 3); 0 if (xi, omega, alpha) are learnt."""
        points = np.atleast_2d(np.asarray(unit, dtype=np.float64))
        if self.training.direct:
            return np.zeros((len(points), *self._shape))
        error = np.sqrt(np.stack([model.variance(points) for model in self._models], axis=-1))
        return np.repeat(error[:, None], self._shape[0], axis=1)


def _learnt(statistics: NDArray[np.float64], direct: bool) -> NDArray[np.float64]:
    return to_dp(statistics) if direct else statistics


def train_surrogate(
    objective: Comparison,
    parameters: NDArray[np.float64],
    statistics: NDArray[np.float64],
    config: SurrogateConfig,
    noise_variance: NDArray[np.float64] | None = None,
    noisy: bool = False,
) -> Training:
    """Choose the length scales of each statistic, and the factor of its baseline: 1, 0 or the one that the runs show.

    From four runs on, the factor with the smallest leave-one-out errors is chosen; before, the factor is 1. The runs
    are asked for a factor of their own if there is a single bin (Kennedy and O'Hagan, "Predicting the output from a
    complex computer code when fast approximations are available", Biometrika 87 (2000), eq. 1).

    Parameters
    ----------
    objective : Comparison
        Baseline and bounds of the material.
    parameters : ndarray, shape (k, d)
        Distinct X of the runs.
    statistics : ndarray, shape (k, n, 3)
        Mean [dB], log sd and skewness of each incidence-angle bin.
    config : SurrogateConfig
        Outputs and training of the kriging.
    noise_variance : ndarray, shape (n, 3), optional
        Variance of the statistics among runs of equal X, if it has been measured.
    noisy : bool
        Whether runs of equal X differ.

    Returns
    -------
    Training

    Raises
    ------
    SurrogateError
        If training values are not finite, or no kriging model can be trained.
    """
    for name, array in (("parameters", parameters), ("statistics", statistics)):
        if not np.isfinite(array).all():
            raise SurrogateError(f"the surrogate's training {name} hold values that are not finite.")
    low, high = objective.material.box.T
    unit = (parameters - low) / (high - low)
    direct = config.outputs == "direct"
    values = _learnt(statistics, direct)
    base = None
    if config.baseline and not direct and objective.baseline is not None:
        base = objective.baseline(parameters)
    found, factors = [], []
    for k in range(len(STATISTICS)):
        # the measured variance is that of (mean, log sd, skewness), not of (xi, omega, alpha)
        noise = None if noise_variance is None or direct else float(noise_variance[:, k].mean())
        noise = noise if noisy else 0.0
        one, of = values[..., k], np.zeros_like(values[..., k]) if base is None else base[..., k]
        candidates = [0.0] if base is None else [1.0]
        if base is not None and len(unit) >= _JUDGED:
            candidates.append(0.0)
            if one.shape[1] == 1 and config.training != "smt":  # bins differ: no factor holds for all of them
                candidates.append(baseline_factor(unit, one[:, 0], of[:, 0]))
        tried = []
        for left in (one - factor * of for factor in candidates):
            if config.training == "smt":
                scales, nugget, status = train_smt(unit, left[:, 0], noisy=noise != 0.0)
                nugget = max(nugget, JITTER if noise != 0.0 else 0.0)
            else:
                (scales, nugget), status = train(unit, left, noise), "trained"
            errors = Kriging(unit, left, scales, nugget).leave_one_out() if len(unit) > 1 else np.full(1, np.nan)
            tried.append((scales, nugget, float((errors**2).sum()), status))
        chosen = int(np.argmin([squares for _, _, squares, _ in tried]))
        found.append(tried[chosen])
        factors.append(candidates[chosen])
    each_scales, nuggets, squares, statuses = zip(*found, strict=True)
    variation = ((values - values.mean(axis=0)) ** 2).sum(axis=(0, 1))
    q2 = 1.0 - np.array(squares) / np.where(variation > 0.0, variation, np.nan)
    return Training(
        parameters=parameters,
        statistics=statistics,
        scales=np.stack(each_scales),
        nugget=np.array(nuggets),
        baseline=np.array(factors),
        q2=q2,
        status=statuses,
        direct=direct,
    )


@dataclass(frozen=True)
class Trainings(Stored, kind="surrogate"):
    """Data and hyper-parameters of the surrogates of all materials.

    Attributes
    ----------
    materials : mapping
        Training by material.
    """

    materials: Mapping[str, Training]
