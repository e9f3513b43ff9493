"""Recommended predictor of other fields: the law, if it is known well and predicts fields better, else a constant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.budget import NORMAL_90
from radcal.assessment.constant import Constant
from radcal.assessment.gain import Gain, field_gains, power
from radcal.assessment.passes import law_sd_db
from radcal.assessment.prediction import predict
from radcal.calibration.grounds import GroundLaw, refit
from radcal.measurement.classes import FEWEST
from radcal.radar.laws import seen_rad

__all__ = [
    "FieldCheck",
    "Recommendation",
    "fold_of_fields",
    "half_width_db",
    "leave_fields_out",
    "recommend",
    "share_among_cells",
    "trend",
]

_FOLDS = 10
_FEW_PIXELS = 20  # least number of pixels in a cell whose mean is compared
_TREND = 4.0  # least squared coefficient over its variance: two standard errors, squared
_MANY = 4  # least number of fields whose scatter alone gives a standard error: three degrees of freedom
_IDENTIFIED = 2.0  # see GroundLaw.identified
_INSIDE = 0.5  # least share of the law's variance among cells at which means of cells can test the law


@dataclass(frozen=True)
class FieldCheck:
    """Errors of the predictions of whole fields that were left out of the fit, so that their effects are unknown.

    Attributes
    ----------
    rmse_law_db, rmse_constant_db : float
        Root mean square errors of the predicted means of cells, by the law and by the constant of the other fields
        [dB]; NaN for fewer than two fields.
    gain : Gain
        Gain of the law over the constant.
    power : float
        Power of the comparison of law and constant (:func:`radcal.assessment.gain.power`).
    """

    rmse_law_db: float
    rmse_constant_db: float
    gain: Gain
    power: float


@dataclass(frozen=True)
class Recommendation:
    """Predictor recommended for other fields, and a text with the reason."""

    predictor: Literal["law", "constant"]
    why: str


def fold_of_fields(patch: NDArray[np.int64], folds: int = _FOLDS) -> NDArray[np.int64]:
    """Cross-validation fold of each pixel: the fields, in the order of their labels, are assigned to the folds in turn.

    Returns
    -------
    ndarray of int, shape (pixels,)
        Fold of each pixel. All pixels of a field are in one fold; successive labels are in different folds.
    """
    labels, of = np.unique(patch, return_inverse=True)
    return np.asarray(np.arange(labels.size) % max(1, min(folds, labels.size)))[np.ravel(of)]


def leave_fields_out(found: GroundLaw, constant: Constant) -> FieldCheck:
    """Leave out each tenth of the fields in turn (each field, if there are few), and predict it from the other fields.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to all fields; each time, it is refitted to the other fields with the same variances.
    constant : Constant
        Constant fitted to all fields.

    Returns
    -------
    FieldCheck

    References
    ----------
    Roberts et al., "Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic
    structure", Ecography 40 (2017): whole groups are left out.
    """
    ground = found.ground
    fold = fold_of_fields(ground.patch)
    parts = []
    for k in range(int(fold.max()) + 1 if fold.any() else 0):
        rest, out = ground.part(fold != k), ground.part(fold == k)
        if rest.values_db.size < FEWEST:
            continue
        made = predict(refit(found, rest), replace(constant, ground=rest), out)
        parts.append(made.part(made.count >= _FEW_PIXELS))
    parts = [part for part in parts if part.count.size]
    if not parts:
        return FieldCheck(float("nan"), float("nan"), Gain(float("nan"), float("inf"), 0), 0.0)
    mean, law, level, patch, common, own = (
        np.concatenate([getattr(part, key) for part in parts])
        for key in ("mean_db", "law_db", "constant_db", "patch", "common", "own")
    )
    return FieldCheck(
        rmse_law_db=float(np.sqrt(np.mean((mean - law) ** 2))),
        rmse_constant_db=float(np.sqrt(np.mean((mean - level) ** 2))),
        gain=Gain.of(*field_gains(patch, mean - law, mean - level)),
        power=power(patch, law - level, common, own),
    )


def half_width_db(found: GroundLaw) -> float:
    """Largest half-width of the linear (Gauss-Newton) 90 % band of sigma0 over the 5-95 % of the incidence [dB].

    The band describes the law at the true incidence (``docs/uncertainty.md``). The band of the mean of dB values would
    also depend on the looks. The error of the image level is not part of the band, because law and constant share it.
    """
    method = found.method
    sd = law_sd_db(method.law, method.bounds, found.fit, seen_rad(found.ground.incidence_deg))
    return float(NORMAL_90 * sd.max())


def trend(found: GroundLaw) -> float:
    """Evidence that the level changes with the incidence as the law says, and not by gradients inside single fields.

    The cell means are regressed on the law with generalised least squares. Each field has a random level and a random
    gradient in z, the standardised incidence inside the field. Level and gradient both have the standard deviation
    between fields. If a material has few fields, random gradients inside the fields look like a law.

    Returns
    -------
    float
        Squared regression coefficient of the law, divided by the variance of the coefficient.

    References
    ----------
    Gelman and Hill, "Data Analysis Using Regression and Multilevel/Hierarchical Models" (2007), chapter 13:
    varying intercepts and slopes.
    """
    ground, spread = found.ground, found.spread
    cells = ground.cells
    mean, law, incidence = (
        cells.mean(values) for values in (ground.values_db, found.levels_db(ground.incidence_deg), ground.incidence_deg)
    )
    own = ground.sampling + spread.within**2
    shape = law - np.average(law, weights=cells.count)
    information, right = np.zeros((2, 2)), np.zeros(2)
    for patch in np.unique(cells.patch):
        of = cells.patch == patch
        z = incidence[of] - incidence[of].mean()
        z /= max(float(z.std()), 1e-9)
        covariance = np.diag(own[of]) + spread.between**2 * (1.0 + np.outer(z, z))
        design = np.stack([np.ones(z.size), shape[of]], axis=-1)
        weighted = np.linalg.solve(covariance, design)
        information += design.T @ weighted
        right += weighted.T @ mean[of]
    inverse = np.linalg.pinv(information)
    return float((inverse @ right)[1] ** 2 / max(inverse[1, 1], 1e-12))


def share_among_cells(found: GroundLaw) -> float:
    """Ratio (0 to 1) of the variance of the law between the means of cells to its variance over all pixels."""
    cells, level = found.ground.cells, found.levels_db(found.ground.incidence_deg)
    left = level - cells.mean(level)[cells.of_pixel]
    return 1.0 - float(np.var(left)) / max(float(np.var(level)), 1e-12)


def recommend(found: GroundLaw, check: FieldCheck, known_db: float) -> Recommendation:
    """Recommended predictor for other fields of the material, decided on the calibrated ground alone.

    The constant is recommended if the half-width of the law's 90 % band exceeds 1.5 dB anywhere between 5 and 95 % of
    the incidence. For a narrower band, the recommendation depends on the fields and cells:

    - If less than half of the law's variance lies between the means of cells, the law is recommended if it is
      identified. The means of cells then cannot test the law, but the pixels inside the cells can, whatever the effects
      of fields.
    - With four or more fields, the law is recommended if whole fields that were left out are predicted better by the
      law of the other fields than by their constant, beyond the standard error.
    - With two or three fields, the law must, in addition, be identified and explain more than gradients inside the
      fields would, because the standard error from so few fields is hardly known.
    - With one field, the law is recommended if it is identified and explains more than a gradient inside the field
      would.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to the calibrated ground.
    check : FieldCheck
        Errors of the predictions of left-out fields, as :func:`leave_fields_out` returns them.
    known_db : float
        Largest half-width of the law's 90 % band [dB] with which the law is recommended (``uncertainty.known_db``).

    Returns
    -------
    Recommendation
    """
    width, gain, identified = half_width_db(found), check.gain, found.identified >= _IDENTIFIED
    if not width <= known_db:
        return Recommendation(
            "constant",
            f"the law's linear 90 % band, without the level's error, is +-{width:.3g} dB, more than {known_db:.3g} dB",
        )
    if share_among_cells(found) < _INSIDE:
        if identified:
            return Recommendation("law", "its change with incidence is seen inside of the parts of fields")
        return Recommendation("constant", "its change with incidence is not shown to exceed its error")
    if gain.fields >= 2:
        error = f"{gain.ratio:.2f} times the constant's, geometric mean over {gain.fields} fields, one standard error "
        error += f"{np.exp(-gain.mean - gain.error):.2f} to {np.exp(-gain.mean + gain.error):.2f}"
        if not gain.better:
            return Recommendation("constant", f"the law's error on fields left out is {error}")
        if gain.fields >= _MANY:
            return Recommendation("law", f"the law's error on fields left out is {error}")
    many = f"{gain.fields} fields" if gain.fields >= 2 else "one field"
    if identified and trend(found) >= _TREND:
        return Recommendation("law", f"its change with incidence exceeds what gradients inside of {many} would make")
    return Recommendation(
        "constant", f"its change with incidence is not shown to exceed what gradients inside of {many} would make"
    )
