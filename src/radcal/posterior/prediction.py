"""Predictions of mean levels of other ground, and of cells that are left out of the fit.

The predictor is the average, with equal weights, of the law's posterior predictive mean and of a constant, the
generalised least squares mean of the cells with random effects of fields and cells. The quantiles of its band are the
averages of those of the two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.ground.patches import Residuals, Spread, gls_mean, patch_effects, spreads
from radcal.posterior.calibrated import LawModel
from radcal.posterior.curves import NORMAL_90
from radcal.posterior.result import Constant, HeldOut, Predicted

Doubles = NDArray[np.float64]

_FOLDS = 10
_FEWEST = 3  # cells to which a model is fitted
_REFIT = {"walkers": 64, "steps": 1000}
_KEPT = 1000  # draws of a refit
_UNKNOWN = 1e-9  # prior information on a constant [1/dB^2]: practically none


def constant_of(values_db: Doubles, variance: Doubles, patch: NDArray[np.int64]) -> Constant:
    """Constant level of cells [dB] with given variances of speckle and fields, shape (n,) each."""
    known = np.array([[_UNKNOWN]])
    (spread,) = spreads([Residuals(values_db - values_db.mean(), variance, patch, np.ones((patch.size, 1)), known)])
    return Constant(*gls_mean(values_db, variance, patch, spread), spread.between, spread.within)


def predict(draws_db: Doubles, level_db: Doubles, sd_db: Doubles) -> Predicted:
    """Prediction of n means: average of those by the law and by the constant.

    Parameters
    ----------
    draws_db : ndarray, shape (m, n)
        Draws from the law's posterior predictive distribution of the means [dB].
    level_db, sd_db : ndarray, shape (n,)
        Means by the constant, and their standard errors [dB].
    """
    return _by_law(draws_db, draws_db.mean(axis=0)).averaged(_by_constant(level_db, sd_db))


def _by_law(draws_db: Doubles, mean_db: Doubles) -> Predicted:
    return Predicted(mean_db, *np.quantile(draws_db, [0.05, 0.95], axis=0))


def _by_constant(level_db: Doubles, sd_db: Doubles) -> Predicted:
    return Predicted(level_db, level_db - NORMAL_90 * sd_db, level_db + NORMAL_90 * sd_db)


def left_out(model: LawModel, fold: NDArray[np.int64], seed: int) -> HeldOut | None:
    """Predict the cells of each fold from the cells of all other folds; None if no cells are left out.

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
    parts = []
    for k in np.unique(fold[fold >= 0]):
        out = fold == k
        if np.count_nonzero(~out) < _FEWEST:
            continue
        rest = model.part(~out, model.config.model_copy(update=_REFIT))
        own = (model.patch[out], model.incidence_deg[out], model.measured_db[out])
        law, constant = _of_law(model, rest, out, seed, int(k)), _of_constant(rest, own[0], model.variance[out])
        parts.append([*own, *vars(law).values(), *vars(constant).values()])
    if not parts:
        return None
    patch, angle, measured, *each = (np.concatenate(column) for column in zip(*parts, strict=True))
    return HeldOut(patch, angle, measured, Predicted(*each[:3]), Predicted(*each[3:]))


def _of_law(model: LawModel, rest: LawModel, out: NDArray[np.bool_], seed: int, fold: int) -> Predicted:
    """Prediction of the cells of a mask by the law fitted to the rest."""
    rng = np.random.default_rng([seed, fold])
    draws = rest.drawn(seed).thinned(_KEPT)
    labels, effects = rest.field_effects(draws, rng)
    fields, of = np.unique(model.patch[out], return_inverse=True)
    place, seen = _located(labels, fields)
    known = effects[:, place]
    unknown = draws.field_db[:, None] * rng.standard_normal(known.shape)
    levels = model.levels(draws)[:, out]
    expected = levels.mean(axis=0) + np.where(seen, known.mean(axis=0), 0.0)[of]
    levels = levels + np.where(seen, known, unknown)[:, of]
    errors = np.sqrt(draws.cell_db[:, None] ** 2 + model.variance[out])
    return _by_law(levels + errors * rng.standard_normal(levels.shape), expected)


def _of_constant(rest: LawModel, patch: NDArray[np.int64], variance: Doubles) -> Predicted:
    """Prediction of cells with given fields and variances of speckle, shape (n,), by a constant of other cells."""
    constant = constant_of(rest.measured_db, rest.variance, rest.patch)
    between, spread = constant.between_db**2, Spread(constant.between_db, constant.within_db)
    residual_db = rest.measured_db - constant.mean_db
    labels, effect_db, left = patch_effects(residual_db, rest.variance, rest.patch, spread)
    place, known = _located(labels, patch)
    unknown = np.where(known, left[place] / between, 1.0)
    level = constant.mean_db + np.where(known, effect_db[place], 0.0)
    # the effect of a known field corrects the error of the mean
    field = unknown * between + unknown**2 * constant.variance
    return _by_constant(level, np.sqrt(field + constant.within_db**2 + variance))


def _located(labels: NDArray[np.int64], wanted: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Places of numbers among increasing numbers, and whether each of them is there."""
    place = np.minimum(np.searchsorted(labels, wanted), labels.size - 1)
    return place, labels[place] == wanted


def field_check(model: LawModel, seed: int) -> HeldOut | None:
    """Predict whole fields: each tenth of the fields in turn is left out, or each field if there are few."""
    return left_out(model, np.unique(model.patch, return_inverse=True)[1] % _FOLDS, seed)
