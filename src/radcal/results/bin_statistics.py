"""Part of the archive that compares measured and simulated statistics of incidence-angle bins, and the prior of X."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.inference.moments import from_cumulants, to_cumulants
from radcal.objectives import Comparison
from radcal.objectives.history import History, Score
from radcal.posterior.curves import curves_of
from radcal.proposals.surrogate import Surrogate, Training

Doubles = NDArray[np.float64]

_HALF_STEP = 0.005  # half of 1 % of the width of the bounds
_TRIED, _KEPT = 40_000, 2_000  # points of which the draws from a prior are chosen, and draws


@dataclass(frozen=True)
class BinStatistics:
    """Mean, log sd and skewness of the b incidence-angle bins of one material, the bins of all passes in order.

    Attributes
    ----------
    in_pass : ndarray of int64, shape (b,)
        Number of the pass of each bin, from 1.
    incidence_deg : ndarray of float64, shape (b,)
        Mean local incidence of each bin [deg].
    measured : ndarray of float64, shape (b, 3)
        Statistics of the measured pixels [dB, 1, 1].
    error : ndarray of float64, shape (b, 3)
        Standard deviation of simulated minus measured by speckle, cells and fields [dB, 1, 1].
    calibrated : ndarray of float64, shape (b, 3)
        Statistics expected of the best run, at its effective looks and with fields [dB, 1, 1].
    start : ndarray of float64 or None, shape (b, 3)
        The same of the reference run; absent if it has another law [dB, 1, 1].
    sensitivity : ndarray of float64 or None, shape (b, 3, d)
        Change of a simulated statistic, by the surrogate, over 1 % of each bound's width [dB, 1, 1].
    """

    in_pass: NDArray[np.int64]
    incidence_deg: Doubles
    measured: Doubles
    error: Doubles
    calibrated: Doubles
    start: Doubles | None = None
    sensitivity: Doubles | None = None


def bin_statistics(comparison: Comparison, history: History, training: Training | None = None) -> BinStatistics | None:
    """Statistics of the incidence-angle bins of one material; None for an objective without bins.

    Parameters
    ----------
    comparison : Comparison
        Objective of the material.
    history : History
        All scored runs.
    training : Training, optional
        Surrogate by all runs, from which the sensitivities at the best X follow as central differences.
    """
    name = comparison.material.name
    best, first = history.best(name), history.runs[0].scores[name]
    parts = [(k, part.moments) for k, part in enumerate(comparison.passes) if part is not None]
    shown = [(k, moments) for k, moments in parts if moments is not None]
    if not shown:
        return None
    measured = [from_cumulants(moments.classes.cumulants) for _, moments in shown]

    def expected(score: Score) -> Doubles:
        found = []
        for (k, moments), values in zip(shown, measured, strict=True):
            own = comparison.in_pass(k, score)
            residuals = moments(np.asarray(own.parameters), own.looks, to_cumulants(own.statistics))
            found.append(values + moments.differences(residuals))
        return np.concatenate(found)

    return BinStatistics(
        in_pass=np.repeat([k + 1 for k, _ in shown], [moments.classes.size for _, moments in shown]),
        incidence_deg=np.concatenate([moments.classes.nodes_deg.mean(axis=1) for _, moments in shown]),
        measured=np.concatenate(measured),
        error=np.concatenate([np.sqrt(np.diag(moments.covariance)).reshape(3, -1).T for _, moments in shown]),
        calibrated=expected(best),
        start=expected(first) if first.own_law else None,
        sensitivity=None if training is None else _sensitivity(Surrogate(training, comparison), best.parameters),
    )


def _sensitivity(surrogate: Surrogate, parameters: list[float]) -> Doubles:
    """Change of each statistic over 1 % of the width of each bound, shape (b, 3, d), about an X in the bounds.

    References
    ----------
    Hill and Tiedeman, "Effective Groundwater Model Calibration" (2007), chapter 4: scaled sensitivities.
    """
    middle = np.clip(surrogate.unit(parameters), _HALF_STEP, 1.0 - _HALF_STEP)
    step = _HALF_STEP * np.eye(middle.size)
    change = surrogate.predict(middle + step) - surrogate.predict(middle - step)
    return np.asarray(np.moveaxis(change, 0, -1))


def prior_draws(comparison: Comparison, rng: np.random.Generator) -> Doubles:
    """Draws from the prior of X: uniform inside the bounds, times the prior on the law's curve, shape (2000, d).

    References
    ----------
    Rubin, "Using the SIR algorithm to simulate posterior distributions", Bayesian Statistics 3 (1988): sampling,
    importance, resampling.
    """
    low, high = comparison.material.box.T
    x = low + rng.random((_TRIED, low.size)) * (high - low)
    x = np.where(comparison.material.integer, np.round(x), x)
    prior = next(part for part in comparison.passes if part is not None).prior
    if prior is None:
        return np.asarray(x[:_KEPT])
    log = -0.5 * (prior.of_curves(curves_of(prior.law, x, np.radians(prior.angles_deg)), x) ** 2).sum(axis=1)
    chance = np.exp(log - log.max())
    return np.asarray(x[rng.choice(_TRIED, _KEPT, p=chance / chance.sum())])
