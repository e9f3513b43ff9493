"""Predictions of mean levels of cells of other ground, and their errors on ground that is left out of the fit.

The predictor is the average, with equal weights, of the law's posterior predictive mean and of a constant, the
generalised least squares mean of the cells with random effects of fields and cells. The quantiles of its band are the
averages of those of the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.calibrated import LawModel
from radcal.assessment.curves import NORMAL_90, Curves
from radcal.assessment.posterior import FieldCheck, HeldOut, KeptDraws
from radcal.measurement.patches import Effects, Residuals, Spread, gls_mean, patch_effects, spreads
from radcal.radar.laws import Law

__all__ = ["Constant", "Predicted", "constant_of", "field_check", "left_out", "predict"]

Doubles = NDArray[np.float64]

_FOLDS = 10
_FEWEST = 3  # cells to which a model is fitted
_REFIT = {"walkers": 64, "steps": 1000}
_KEPT = 1000  # draws of a refit
_UNKNOWN = 1e-9  # prior information on a constant [1/dB^2]: practically none


@dataclass(frozen=True)
class Constant:
    """Constant level of a material: its mean and variance, spread of fields and cells, and effects of the fields."""

    mean_db: float
    variance: float
    spread: Spread
    effects: Effects

    def of_cells(self, patch: NDArray[np.int64], variance: Doubles) -> tuple[Doubles, Doubles]:
        """Predicted means of cells with given fields and variances of speckle, and standard errors [dB], shape (n,)."""
        place = np.minimum(np.searchsorted(self.effects.patch, patch), self.effects.patch.size - 1)
        known = self.effects.patch[place] == patch
        unknown = np.where(known, self.effects.variance[place] / self.spread.between**2, 1.0)
        field = unknown * self.spread.between**2 + unknown**2 * self.variance  # a known field corrects the mean's error
        level = self.mean_db + np.where(known, self.effects.effect_db[place], 0.0)
        return level, np.sqrt(field + self.spread.within**2 + variance)


@dataclass(frozen=True)
class Predicted:
    """Predicted means of cells: mean, 5 % and 95 % quantile of the predictive distribution [dB], shape (n,) each."""

    mean_db: Doubles
    p05_db: Doubles
    p95_db: Doubles


def constant_of(values_db: Doubles, variance: Doubles, patch: NDArray[np.int64]) -> Constant:
    """Constant level of cells [dB] with given variances of speckle and fields, shape (n,) each."""
    known = np.array([[_UNKNOWN]])
    (spread,) = spreads([Residuals(values_db - values_db.mean(), variance, patch, np.ones((patch.size, 1)), known)])
    mean, of_mean = gls_mean(values_db, variance, patch, spread)
    return Constant(mean, of_mean, spread, patch_effects(values_db - mean, variance, patch, spread))


def _band(by_law: Doubles, level: Doubles, sd: Doubles) -> Doubles:
    """Averages of the 5 and 95 % quantiles of draws of the cells by the law, (m, n), and of the constant's, (2, n).

    References
    ----------
    Lichtendahl, Grushka-Cockayne and Winkler, "Is it better to average probabilities or quantiles?", Management
    Science 59 (2013): a mixture of two calibrated distributions is too wide.
    """
    by_constant = level + NORMAL_90 * sd * np.array([[-1.0], [1.0]])
    return np.asarray(0.5 * (np.quantile(by_law, [0.05, 0.95], axis=0) + by_constant))


def predict(
    draws: KeptDraws, law: Law, constant: Constant, incidence_deg: Doubles, variance: Doubles, seed: int
) -> Predicted:
    """Predict the means of cells of fields that were not seen, on level ground and without noise.

    Parameters
    ----------
    draws : KeptDraws
        Draws from the posterior of a law.
    law : Law
        The law, which must have a curve.
    constant : Constant
        Constant level of the same cells.
    incidence_deg, variance : ndarray, shape (n,)
        Mean local incidence of each cell [deg], and variance of the speckle of its mean [dB^2].
    seed : int
        Seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    levels = Curves.at(draws.laws_db(law), incidence_deg[None])
    sd = np.sqrt((draws.field_db**2 + draws.cell_db**2)[:, None] + variance)
    by_constant = constant.of_cells(np.full(incidence_deg.size, -1), variance)
    band = _band(levels + sd * rng.standard_normal(levels.shape), *by_constant)
    return Predicted(0.5 * (levels.mean(axis=0) + by_constant[0]), *band)


def left_out(model: LawModel, fold: NDArray[np.int64], seed: int) -> HeldOut:
    """Predict the cells of each fold from the cells of all other folds.

    The effects of fields with cells in other folds are taken from these, those of other fields are unknown.

    Parameters
    ----------
    model : LawModel
        Model of all cells.
    fold : ndarray of int, shape (n,)
        Fold of each cell; cells of a negative fold are never left out.
    seed : int
        Seed of the random numbers.

    References
    ----------
    Roberts et al., "Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic
    structure", Ecography 40 (2017): whole groups are left out.
    """
    parts, angle = [np.empty((8, 0))], model.incidence_deg
    for k in np.unique(fold[fold >= 0]):
        out = fold == k
        if np.count_nonzero(~out) < _FEWEST:
            continue
        rng = np.random.default_rng([seed, int(k)])
        rest = model.part(~out, model.config.model_copy(update=_REFIT))
        draws = rest.drawn(seed).thinned(_KEPT)
        labels, effects = rest.field_effects(draws, rng)
        patch, variance = model.patch[out], model.variance[out]
        fields, of = np.unique(patch, return_inverse=True)
        place = np.minimum(np.searchsorted(labels, fields), labels.size - 1)
        seen, known = labels[place] == fields, effects[:, place]
        unknown = draws.field_db[:, None] * rng.standard_normal(known.shape)
        levels = model.levels(draws)[:, out]
        expected = levels.mean(axis=0) + np.where(seen, known.mean(axis=0), 0.0)[of]
        levels = levels + np.where(seen, known, unknown)[:, of]
        levels += np.sqrt(draws.cell_db[:, None] ** 2 + variance) * rng.standard_normal(levels.shape)
        level, sd = constant_of(rest.measured_db, rest.variance, rest.patch).of_cells(patch, variance)
        mean = 0.5 * (expected + level)
        band = _band(levels, level, sd)
        parts.append(np.stack([patch, angle[out], model.measured_db[out], mean, *band, expected, level]))
    patch, *rows = np.concatenate(parts, axis=1)
    return HeldOut(patch.astype(np.int64), *rows)


def field_check(model: LawModel, seed: int) -> FieldCheck:
    """Errors on whole fields: each tenth of the fields in turn is left out, or each field if there are few."""
    labels, of = np.unique(model.patch, return_inverse=True)
    if labels.size < 2:
        nothing = float("nan")
        return FieldCheck(0, 0, nothing, nothing, nothing, nothing)
    found = left_out(model, of % _FOLDS, seed)
    return FieldCheck(
        np.unique(found.patch).size,
        found.patch.size,
        found.rmse_db(),
        found.rmse_db("law_db"),
        found.rmse_db("constant_db"),
        found.coverage_90,
    )
