"""Summary of the draws from the posterior of a law: quantiles, band of sigma0, and the law nearest to its median."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.laws import Law
from radcal.posterior.calibrated import FORMS, Draws, LawModel, Parameters
from radcal.posterior.cells import STEP_DEG
from radcal.posterior.curves import GRID_DEG, NORMAL_90, PER_DEG
from radcal.posterior.effects import Observed, form_basis
from radcal.posterior.result import WHOLE_DEG, Curve, FormError, KeptDraws, LevelPoints, Posterior, known_between

Doubles = NDArray[np.float64]

_FORM_KNOT_DEG = 2.0
_KEPT = 400
_QUANTILES = [0.05, 0.5, 0.95]
_LAST_DEG = 85
_NORMALS = 19  # quantiles of a normal distribution that stand for random replicates of each draw
_TRIED = 3  # draws from which the nearest law is searched


class Form:
    """Components of the error of a law's form.

    Parameters
    ----------
    incidence_deg : ndarray, shape (n,)
        Incidence of the cells [deg].
    """

    def __init__(self, incidence_deg: Doubles) -> None:
        last = np.ceil(incidence_deg.max()) + 2.0 * _FORM_KNOT_DEG
        self._knots = np.arange(np.floor(incidence_deg.min()), last, _FORM_KNOT_DEG)

    def columns(self, incidence_deg: Doubles) -> Doubles:
        """Columns at angles [deg], shape (n, 8), constant beyond the cells."""
        return form_basis(np.clip(incidence_deg, self._knots[0], self._knots[-1]), self._knots, FORMS)


def _kept(draws: Draws, form: Form | None) -> KeptDraws:
    """Draws with the error of the form at whole degrees."""
    forms = np.zeros((len(draws.parameters), WHOLE_DEG.size))
    if form is not None:
        forms = draws.form @ form.columns(WHOLE_DEG).T
    return KeptDraws(draws.parameters, draws.field_db, draws.cell_db, forms, draws.fields_db)


def summary(
    observed: Observed,
    draws: Draws,
    form: Form | None,
    seen: Sequence[tuple[float, float]],
    error: FormError | None,
) -> Posterior:
    """Posterior without a band of sigma0."""
    low, middle, high = np.quantile(draws.parameters, _QUANTILES, axis=0)
    sampler = draws.sample
    cells = [one for one in observed.cells if one.size]
    return Posterior(
        sampled=sampler.converged,
        ess=sampler.ess,
        r_hat=sampler.r_hat,
        steps=sampler.steps,
        cells=observed.size,
        fields=int(np.unique(observed.together("patch")).size),
        parameters_p05=low,
        parameters_p50=middle,
        parameters_p95=high,
        looks=float(np.average([one.looks for one in cells], weights=[one.size for one in cells])),
        between_db=np.quantile(draws.field_db, _QUANTILES),
        within_db=np.quantile(draws.cell_db, _QUANTILES),
        seen_deg=np.array(seen),
        form=error,
        draws=_kept(draws.thinned(_KEPT), form),
    )


def without_cells(box: ArrayLike, seen: Sequence[tuple[float, float]]) -> Posterior:
    """Posterior of a law of which no cell was seen: quantiles of its X in the bounds, shape (d, 2), and no band."""
    bounds, unknown = np.asarray(box, dtype=np.float64), np.full(3, np.nan)
    low, middle, high = (bounds @ [1.0 - share, share] for share in _QUANTILES)
    nothing = float("nan")
    return Posterior(True, nothing, nothing, 0, 0, 0, low, middle, high, nothing, unknown, unknown, np.array(seen))


def with_band(
    found: Posterior, law: Law, draws: Draws, form: Form | None, parameters: Parameters, known_db: float | None
) -> Posterior:
    """Posterior with the band of sigma0, where it is determined, and the law nearest to its median."""
    every = _kept(draws, form)
    curves = every.curves_db(law)
    low, middle, high = np.quantile(curves, _QUANTILES, axis=0)
    field_low, field_middle, field_high = np.quantile(every.field_curves_db(law), _QUANTILES, axis=0)
    width, seen = 0.5 * (high - low), found.seen_deg.tolist()
    known = None if known_db is None else known_between(GRID_DEG, width, seen, known_db)
    inside = np.zeros(GRID_DEG.size, np.bool_) if known is None else (known[0] <= GRID_DEG) & (known[1] >= GRID_DEG)
    whole = slice(None, _LAST_DEG * PER_DEG + 1, PER_DEG)
    return replace(
        found,
        parameters_model=_nearest(law, parameters, draws.parameters, curves, middle, seen),
        curve=Curve(
            incidence_deg=GRID_DEG[whole],
            median_db=middle[whole],
            p05_db=low[whole],
            p95_db=high[whole],
            systematic_db=NORMAL_90 * _explained(curves[:, whole], draws.common),
            field_median_db=field_middle[whole],
            field_p05_db=field_low[whole],
            field_p95_db=field_high[whole],
        ),
        known_between_deg=known,
        known_half_width_db=float(width[inside].max()) if known is not None else None,
    )


def points_of(model: LawModel, signal_db: Doubles, draws: Draws, own: Draws) -> LevelPoints:
    """Levels of cells without noise [dB], shape (n,), in their intervals of incidence, weighted by pixels.

    Of ``own``, draws of the model itself, the posterior predictive distribution of the levels follows, with its p-value
    for the sum of squares of the levels less their expectation, divided by their covariance.

    References
    ----------
    Gelman, Meng and Stern, "Posterior predictive assessment of model fitness via realized discrepancies", Statistica
    Sinica 6 (1996).
    """
    interval = model.incidence_deg // STEP_DEG
    weights = (interval == np.unique(interval)[:, None]) * model.pixels
    weights = weights / weights.sum(axis=1, keepdims=True)
    shares = weights @ np.equal(model.patch[:, None], np.unique(model.patch))
    field, cell = np.median(draws.field_db), np.median(draws.cell_db)
    variance = weights**2 @ (model.variance + cell**2) + field**2 * (shares**2).sum(axis=1)
    level = weights @ signal_db
    own = own.thinned(_KEPT)
    fields, cells = own.field_db[:, None, None] ** 2, own.cell_db[:, None, None] ** 2
    covariance = (weights * model.variance) @ weights.T + cells * (weights @ weights.T) + fields * (shares @ shares.T)
    away = (model.measured_db - model.levels(own)) @ weights.T
    squares = (away * np.linalg.solve(covariance, away[..., None])[..., 0]).sum(axis=1)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    replicates = level - away + sd * scipy.special.ndtri((np.arange(_NORMALS) + 0.5) / _NORMALS)[:, None, None]
    predicted = np.quantile(replicates.reshape(-1, level.size), _QUANTILES, axis=0).T
    p = float(scipy.special.gammaincc(0.5 * level.size, 0.5 * squares).mean())
    return LevelPoints(weights @ model.incidence_deg, level, np.sqrt(variance), predicted, p)


def _explained(curves: Doubles, common: Doubles) -> Doubles:
    """Standard deviation of curves, (m, k), that their regression on the common effects, (m, q), explains, (k,)."""
    away = common - common.mean(axis=0)
    fitted = away @ np.linalg.lstsq(away, curves - curves.mean(axis=0), rcond=1e-10)[0]
    return np.asarray(fitted.std(axis=0))


def _nearest(
    law: Law, parameters: Parameters, x: Doubles, curves: Doubles, median: Doubles, seen: Sequence[Sequence[float]]
) -> Doubles:
    """X in the bounds whose law is nearest to the median of sigma0 over the incidence seen (least squares)."""
    inside = np.any([(low <= GRID_DEG) & (high >= GRID_DEG) for low, high in seen], axis=0)
    inside[np.abs(GRID_DEG - np.mean(seen)).argmin()] = True
    rad, wanted = np.radians(GRID_DEG[inside]), median[inside]
    low, high = parameters.box.T
    scale = np.maximum(high - low, 1e-12)

    def away(unit: Doubles) -> Doubles:
        return np.asarray(law(rad, low + unit * scale)) - wanted

    starts = x[np.argsort(((curves[:, inside] - wanted) ** 2).mean(axis=1))[:_TRIED]]
    if parameters.integer.any():
        return np.asarray(starts[0])
    units = [np.clip((start - low) / scale, 1e-6, 1.0 - 1e-6) for start in starts]
    found = [scipy.optimize.least_squares(away, unit, bounds=(0.0, 1.0)) for unit in units]
    return np.asarray(low + min(found, key=lambda one: float(one.cost)).x * scale)
