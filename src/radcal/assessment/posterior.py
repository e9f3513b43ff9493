"""Posterior of a material's law: laws that agree with the pixels, and incidence at which sigma0 is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from threadpoolctl import threadpool_limits

from radcal.assessment.curves import GRID_DEG, Curves
from radcal.assessment.known import (
    Band,
    Level,
    Modes,
    band_of,
    degrees,
    directions,
    known_between,
    level_words,
    modes_of,
    why_unknown,
)
from radcal.assessment.sampling import Sample, sample
from radcal.calibration.history import History
from radcal.calibration.objectives import Comparison, make_objectives
from radcal.calibration.steps import train_all
from radcal.calibration.surrogate import Surrogate
from radcal.config import Uncertainty, stages
from radcal.measurement.field_spread import spread_table
from radcal.measurement.levels import Levels
from radcal.measurement.target import Targets
from radcal.radar.laws import Law
from radcal.seeds import derived_seed
from radcal.storage.dataclass_groups import About, put, take
from radcal.storage.records import read_hdf5, write_hdf5

if TYPE_CHECKING:
    from radcal.assessment.unknowns import Model

__all__ = [
    "Curve",
    "Draws",
    "KeptDraws",
    "Posterior",
    "draw",
    "posterior_of",
    "posterior_on",
    "read_posterior",
    "sigma0_db",
    "summarised",
    "write_posterior",
]

Doubles = NDArray[np.float64]

_PRIOR_DRAWS, _FEWEST = 2000, 400
_KEPT = 400  # draws in the file; their 5 % quantile has a standard error of a tenth of a standard deviation
_QUANTILES = [0.05, 0.5, 0.95]
_FINE_DEG = 0.25
_MEAN_POWER = np.log(10.0) / 20.0  # dB of mean power per dB^2 of variance of the fields: 0.115


@dataclass(frozen=True)
class Curve:
    """Curve of sigma0, the mean power of the ground at each local incidence, with its 90 % band."""

    incidence_deg: Annotated[Doubles, About("local incidence", "deg", "a", scale=True)]
    median_db: Annotated[Doubles, About("median of sigma0", "dB", "a")]
    p05_db: Annotated[Doubles, About("5 % quantile of sigma0", "dB", "a")]
    p95_db: Annotated[Doubles, About("95 % quantile of sigma0", "dB", "a")]
    prior_half_width_db: Annotated[Doubles, About("half-width of the 90 % band of the priors alone", "dB", "a")]


@dataclass(frozen=True)
class KeptDraws:
    """Up to 400 draws from the posterior of a law with d parameters, taken evenly from the sample."""

    parameters: Annotated[Doubles, About("X of each draw", shape="m, d")]
    looks: Annotated[Doubles, About("effective looks of each draw", shape="m")]
    fields_db: Annotated[Doubles, About("standard deviations between and within fields of each draw", "dB", "m, 2")]

    def curves_db(self, law: Law) -> Doubles:
        """Mean power of the ground [dB] by each draw on the grid of incidence, (m, 361); the law must have a curve."""
        return np.asarray(Curves(law, self.parameters[[0, -1]])(self.parameters) + _power_of_fields_db(self.fields_db))

    def laws_db(self, curves_db: Doubles) -> Doubles:
        """Laws of the draws [dB], the levels of median fields, from the mean powers of the ground, shape (m, 361)."""
        return np.asarray(curves_db - _power_of_fields_db(self.fields_db))


@dataclass(frozen=True)
class Posterior:
    """Posterior of one material's law with d parameters: quantiles, curve of sigma0, modes and kept draws."""

    sampled: Annotated[
        bool, About("sampler has converged; if false, the quantiles are those of the linear (Gauss-Newton) covariance")
    ]
    ess: Annotated[float, About("smallest effective sample size among the unknowns")]
    r_hat: Annotated[float, About("largest split R-hat among the unknowns")]
    steps: Annotated[int, About("steps of each walker of the sampler")]
    parameters_p05: Annotated[Doubles, About("5 % quantile of each parameter", shape="d")]
    parameters_p50: Annotated[Doubles, About("median of each parameter", shape="d")]
    parameters_p95: Annotated[Doubles, About("95 % quantile of each parameter", shape="d")]
    looks: Annotated[Doubles, About("5, 50 and 95 % quantile of the effective looks", shape="3")]
    between_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the standard deviation between fields", "dB", "3")]
    within_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the standard deviation within fields", "dB", "3")]
    seen_deg: Annotated[Doubles, About("5 and 95 % quantile of the local incidence of each pass", "deg", "passes, 2")]
    combinations: Annotated[
        Doubles,
        About(
            "combinations of X, in standard deviations of the prior, one per row; the best known first", shape="d, d"
        ),
    ]
    combinations_left: Annotated[
        Doubles, About("ratio of the posterior to the prior standard deviation of each combination", shape="d")
    ]
    mode_share: Annotated[
        Doubles, About("share of the draws that lie in each mode (distinct group of curves)", shape="g")
    ]
    mode_parameters: Annotated[Doubles, About("X of the curve nearest to the median curve of each mode", shape="g, d")]
    sentences: Annotated[tuple[str, ...], About("remarks on sampler, modes and combinations of X")]
    curve: Annotated[Curve | None, About("curve of sigma0; absent for normalised images and laws without a curve")] = (
        None
    )
    known_between_deg: Annotated[
        tuple[float, ...] | None,
        About("ends of the interval in which sigma0 is known; absent if it is known at no angle", "deg"),
    ] = None
    known_half_width_db: Annotated[
        float | None, About("largest half-width of the 90 % band in `known_between_deg`; absent if there is none", "dB")
    ] = None
    draws: Annotated[KeptDraws | None, About("draws from the posterior, for predictions")] = None

    def levels(self) -> tuple[Level, ...]:
        """Sigma0 at the middle incidence of each pass, without repeated angles; empty for a law without a curve."""
        if self.curve is None:
            return ()
        seen, curve = dict.fromkeys(np.round(self.seen_deg.mean(axis=1), 1).tolist()), self.curve
        quantiles = (curve.median_db, curve.p05_db, curve.p95_db)
        return tuple(
            Level(deg, *(float(np.interp(deg, curve.incidence_deg, values)) for values in quantiles)) for deg in seen
        )

    def sentence(self, known_db: float, level_only: bool = False, withheld: str = "") -> str:
        """Sentence on where sigma0 is known.

        Parameters
        ----------
        known_db : float
            Largest half-width of the 90 % band at which sigma0 is called known [dB].
        level_only : bool
            Whether the material is seen at one incidence.
        withheld : str
            Reason why sigma0 is not called known whatever its band; otherwise empty.
        """
        if self.curve is None:
            return "the law has no curve in dB, so that only its parameters have intervals."
        if level_only:
            return f"seen at one incidence, from which no law can be known; its level is {level_words(self.levels())}."
        if self.known_between_deg is None or self.known_half_width_db is None:
            curve = self.curve
            half = 0.5 * (curve.p95_db - curve.p05_db)
            why = why_unknown(curve.incidence_deg, half, curve.prior_half_width_db, self.seen_deg, known_db, withheld)
            return f"sigma0 is called known nowhere over the incidence seen: {why}."
        return (
            f"sigma0 is known to +-{self.known_half_width_db:.1f} dB (90 %) {degrees(*self.known_between_deg)}; "
            "outside that it is not called known."
        )


def posterior_of(case: stages.Posterior, targets: Targets, history: History, name: str) -> Posterior:
    """Posterior of a material's law after a calibration, found without a simulator run.

    Parameters
    ----------
    case : stages.Posterior
        Configuration of uncertainty budget and sampler, and all that the training of the surrogate needs.
    targets : Targets
        Target of each calibrated material, in all passes.
    history : History
        All scored runs.
    name : str
        Name of the material.

    Returns
    -------
    Posterior
    """
    objectives = make_objectives(case, targets)
    objective = objectives[name]
    others = [
        spread_table([part.compared().ground for part in one.passes if part is not None])
        for other, one in objectives.items()
        if other != name
    ]
    training = train_all(history, case, {name: objective})[name]
    surrogate = Surrogate(training, objective, history.surprise(name))
    best = history.best(name).scores[name].parameters
    seed = derived_seed(case.seed, "posterior", name)
    levels = [one.levels for one in targets.passes]
    others += targets.other_fields.values()
    return posterior_on(objective, surrogate, levels, case.uncertainty, seed, best, others)


def posterior_on(
    objective: Comparison,
    surrogate: Surrogate,
    levels: Sequence[Levels],
    config: Uncertainty,
    seed: int,
    best: Sequence[float] | Doubles | None = None,
    others: Sequence[Doubles] = (),
) -> Posterior:
    """Posterior of a material's law, with a trained surrogate in place of the simulator.

    Parameters
    ----------
    objective : Comparison
        Objective of the material, which holds target, law and bounds.
    surrogate : Surrogate
        Surrogate that predicts the statistics of the bins at any X.
    levels : sequence of Levels
        Level normalisation of the measured image in each pass.
    config : Uncertainty
        Configuration of uncertainty budget and sampler.
    seed : int
        Seed of the sampler.
    best : array_like, shape (d,), optional
        X of the best run, from which one walker starts.
    others : sequence of ndarray
        Log likelihood of the variation of the fields of each other material (:class:`.FieldPrior`).

    Returns
    -------
    Posterior
    """
    from radcal.assessment.unknowns import Model  # late: its compiled functions are not needed to read a posterior

    model = Model(objective, surrogate, levels, config, others)
    return summarised(model, draw(model, config, seed, best), config.known_db)


@dataclass(frozen=True)
class Draws:
    """Draws from posterior and prior of a model, (m, dimension) and (k, dimension), and the result of the sampler."""

    posterior: Doubles
    prior: Doubles
    sample: Sample


def draw(model: Model, config: Uncertainty, seed: int, best: Sequence[float] | Doubles | None = None) -> Draws:
    """Draws from a model's posterior by the sampler or, if it does not converge, by the Gauss-Newton covariance.

    Parameters
    ----------
    model : Model
        Model with the log densities of prior and likelihood.
    config : Uncertainty
        Configuration of the sampler.
    seed : int
        Seed of the random numbers.
    best : array_like, shape (d,), optional
        X of the best run, from which one walker starts.
    """
    with threadpool_limits(1):  # one thread: sums then have a fixed order
        return _drawn(model, config, seed, best)


def _drawn(model: Model, config: Uncertainty, seed: int, best: Sequence[float] | Doubles | None) -> Draws:
    rng = np.random.default_rng(seed)
    before = model.from_prior(_PRIOR_DRAWS, rng)
    start = rng.standard_normal((config.walkers, model.dimension))
    if len(before) < _FEWEST:
        before = model.points(sample(model.log_prior, None, start, config.steps, derived_seed(seed, "prior")).draws)
    if best is not None:
        start[0, : model.d] = ndtri(np.clip(model.surrogate.unit(best), 1e-6, 1.0 - 1e-6))
    found = sample(
        model.log_prior,
        lambda deviates: model.log_likelihood(model.points(deviates)),
        start,
        config.steps,
        derived_seed(seed, "posterior"),
    )
    points = model.points(found.draws) if found.converged else model.linear(model.points(found.best[None])[0], rng)
    return Draws(points, before, found)


def sigma0_db(model: Model, points: Doubles) -> Doubles:
    """Mean power of the ground [dB] for m points of a posterior, on the grid of incidence, shape (m, 361).

    The levels of fields scatter in dB about the law. The mean power of fields therefore lies above the law, by
    ln(10)/20 dB for each dB^2 of their variance. The law must have a curve.
    """
    assert model.curves is not None  # noqa: S101
    fields = model.unknowns(points)
    more = _power_of_fields_db(np.stack([fields.between_db, fields.within_db], axis=1))
    return np.asarray(model.curves(model.parameters(points)) + more)


def _power_of_fields_db(fields_db: Doubles) -> Doubles:
    """Excess of the mean power over the law [dB], from the fields' standard deviations, shape (m, 2) to (m, 1)."""
    between, within = fields_db.T
    return np.asarray(_MEAN_POWER * (between**2 + within**2))[:, None]


def _kept(model: Model, points: Doubles) -> KeptDraws:
    """Draws taken evenly from a sample of points; all points if the sample is small."""
    some = points[np.unique(np.linspace(0, len(points) - 1, _KEPT).round().astype(np.intp))]
    unknowns = model.unknowns(some)
    fields_db = np.stack([unknowns.between_db, unknowns.within_db], axis=1)
    return KeptDraws(np.asarray(model.parameters(some)), unknowns.looks, fields_db)


def summarised(model: Model, found: Draws, known_db: float) -> Posterior:
    """Posterior summarised from draws: quantiles, band of sigma0, incidence at which it is known, modes, sentences."""
    x, before, sampler = model.parameters(found.posterior), model.parameters(found.prior), found.sample
    unknowns = model.unknowns(found.posterior)
    low, middle, high = np.quantile(x, _QUANTILES, axis=0)
    sentences, curve, known, half = [], None, None, None
    if not sampler.converged:
        sentences.append(
            f"the sampler has not converged (effective sample size {sampler.ess:.0f}, R-hat {sampler.r_hat:.2f} after "
            f"{sampler.steps} steps): intervals are those of the linear (Gauss-Newton) covariance, which may "
            "be too narrow where the law is not linear in its parameters."
        )
    modes = Modes(np.ones(1), middle[None])
    if model.curves is not None:
        curves = sigma0_db(model, found.posterior)
        # bands in steps of a quarter of a degree, of which every fourth is kept
        fine, prior = band_of(curves, _FINE_DEG), band_of(sigma0_db(model, found.prior), _FINE_DEG)
        known = None if model.level_only else known_between(fine, prior, model.seen_deg, known_db)
        if known is not None:
            half = float(fine.half_width_db[(fine.incidence_deg >= known[0]) & (fine.incidence_deg <= known[1])].max())
        curve, modes = _curve(fine, prior), modes_of(curves, x, model.seen_deg)
        if len(modes.share) > 1:
            each = ", ".join(f"{100.0 * one:.0f} %" for one in modes.share)
            sentences.append(
                f"{len(modes.share)} distinct laws agree with the pixels ({each} of the sample; a further "
                "law that no walker found would not be seen)."
            )
    axes = directions(x, before)
    sentences.append(axes.sentence(model.names))
    return Posterior(
        sampled=sampler.converged,
        ess=sampler.ess,
        r_hat=sampler.r_hat,
        steps=sampler.steps,
        parameters_p05=low,
        parameters_p50=middle,
        parameters_p95=high,
        looks=np.quantile(unknowns.looks, _QUANTILES),
        between_db=np.quantile(unknowns.between_db, _QUANTILES),
        within_db=np.quantile(unknowns.within_db, _QUANTILES),
        seen_deg=np.array(model.seen_deg),
        combinations=axes.weights,
        combinations_left=axes.ratio,
        mode_share=modes.share,
        mode_parameters=modes.parameters,
        sentences=tuple(sentences),
        curve=curve,
        known_between_deg=known,
        known_half_width_db=half,
        draws=_kept(model, found.posterior),
    )


def _curve(fine: Band, prior: Band) -> Curve:
    whole = slice(None, None, round(1.0 / (GRID_DEG[1] - GRID_DEG[0])))
    return Curve(
        fine.incidence_deg[whole],
        fine.median_db[whole],
        fine.p05_db[whole],
        fine.p95_db[whole],
        prior.half_width_db[whole],
    )


def write_posterior(path: str | Path, posterior: Posterior) -> None:
    """Write a posterior to HDF5, atomically."""
    with write_hdf5(path, "posterior") as file:
        put(file, posterior)


def read_posterior(path: str | Path) -> Posterior:
    """Read a posterior that :func:`write_posterior` wrote; raises the errors of :func:`.read_hdf5`."""
    with read_hdf5(path, "posterior") as file:
        return take(file, Posterior)
