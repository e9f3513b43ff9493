"""Recommended predictor of other fields: a weighted average of law and constant, decided on the calibrated ground."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
_IDENTIFIED = 2.0  # see GroundLaw.identified
_INSIDE = 0.5  # least share of the law's variance among cells at which means of cells can test the law
_WEIGHTS = np.linspace(0.0, 1.0, 1001)
Doubles = NDArray[np.float64]


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
    weight : float
        Weight of the law in the average of law and constant that the fields left out ask for, between 0 and 1
        (:func:`leave_fields_out`); NaN for fewer than two fields.
    """

    rmse_law_db: float
    rmse_constant_db: float
    gain: Gain
    power: float
    weight: float


@dataclass(frozen=True)
class Recommendation:
    """Predictor recommended for other fields: constant + weight (law - constant).

    Attributes
    ----------
    weight : float
        Weight of the law, from 0 (the constant) to 1 (the law).
    why : str
        Text with the reason.
    """

    weight: float
    why: str

    @property
    def predictor(self) -> Literal["law", "average", "constant"]:
        """Name of the predictor; ``average`` is the weighted average of law and constant."""
        return "constant" if self.weight == 0.0 else "law" if self.weight == 1.0 else "average"

    def levels_db(self, law_db: ArrayLike, constant_db: ArrayLike) -> Doubles:
        """Means of cells by the recommended predictor [dB], from those by law and constant."""
        law, constant = np.asarray(law_db, dtype=np.float64), np.asarray(constant_db, dtype=np.float64)
        return np.asarray(constant + self.weight * (law - constant))


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
    r"""Leave out each tenth of the fields in turn (each field, if there are few), and predict it from the other fields.

    The weight of the law is the slope of a regression through the origin. The measured means of cells minus the
    predictions by the constant are regressed on the predictions by the law minus those by the constant, with
    generalised least squares. Each field has a random level and a random gradient (:func:`trend`), and the cells of a
    field share the error of the constant. The prior of the weight is uniform between 0 and 1, and the weight is its
    posterior mean: near 1/2 if the fields left out say little.

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
    Breiman, "Stacked regressions", Machine Learning 24 (1996): weights of predictors, not negative, from predictions of
    data left out.
    Diebold and Pauly, "The use of prior information in forecast combination", International Journal of Forecasting 6
    (1990): a prior shrinks such weights to equal weights.
    """
    ground = found.ground
    fold = fold_of_fields(ground.patch)
    parts = []
    asked = np.zeros(2)
    for k in range(int(fold.max()) + 1 if fold.any() else 0):
        rest, out = ground.part(fold != k), ground.part(fold == k)
        if rest.values_db.size < FEWEST:
            continue
        others = replace(constant, ground=rest)
        made = predict(refit(found, rest), others, out)
        made = made.part(made.count >= _FEW_PIXELS)
        if not made.count.size:
            continue
        parts.append(made)
        departure, difference = made.mean_db - made.constant_db, (made.law_db - made.constant_db)[:, None]
        of = (made.patch, made.incidence_deg, made.own, found.spread.between, others.variance)
        asked += np.append(*_regression(departure, difference, *of))
    unknown = float("nan")
    if not parts:
        return FieldCheck(unknown, unknown, Gain(unknown, float("inf"), 0), 0.0, unknown)
    mean, law, level, patch, common, own = (
        np.concatenate([getattr(part, key) for part in parts])
        for key in ("mean_db", "law_db", "constant_db", "patch", "common", "own")
    )
    gain = Gain.of(*field_gains(patch, mean - law, mean - level))
    return FieldCheck(
        rmse_law_db=float(np.sqrt(np.mean((mean - law) ** 2))),
        rmse_constant_db=float(np.sqrt(np.mean((mean - level) ** 2))),
        gain=gain,
        power=power(patch, law - level, common, own),
        weight=_weight(*asked) if gain.fields >= 2 else unknown,
    )


def _weight(information: float, right: float) -> float:
    """Mean of a weight between 0 and 1 with the log likelihood right * weight - information * weight^2 / 2."""
    likelihood = right * _WEIGHTS - 0.5 * information * _WEIGHTS**2
    density = np.exp(likelihood - likelihood.max())
    return float(density @ _WEIGHTS / density.sum())


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
    design = np.stack([np.ones(law.size), law - np.average(law, weights=cells.count)], axis=-1)
    information, right = _regression(mean, design, cells.patch, incidence, own, spread.between)
    inverse = np.linalg.pinv(information)
    return float((inverse @ right)[1] ** 2 / max(inverse[1, 1], 1e-12))


def _regression(
    values_db: Doubles,
    design: Doubles,
    patch: NDArray[np.int64],
    incidence_deg: Doubles,
    own: Doubles,
    between: float,
    shared: float = 0.0,
) -> tuple[Doubles, Doubles]:
    """Normal equations of means of cells in generalised least squares, with a level and a gradient of each field.

    Parameters
    ----------
    values_db : ndarray, shape (cells,)
        Means of cells [dB].
    design : ndarray, shape (cells, d)
        Regressors.
    patch, incidence_deg, own : ndarray, shape (cells,)
        Field, mean incidence [deg], and variance of the error of each cell alone [dB^2].
    between : float
        Standard deviation of the fields' levels and gradients [dB].
    shared : float
        Variance of a further error that the cells of a field share [dB^2].

    Returns
    -------
    information : ndarray, shape (d, d)
        Inverse covariance of the coefficients.
    right : ndarray, shape (d,)
        Product of the information with the coefficients.
    """
    information, right = np.zeros((design.shape[1],) * 2), np.zeros(design.shape[1])
    for label in np.unique(patch):
        of = patch == label
        z = incidence_deg[of] - incidence_deg[of].mean()
        z /= max(float(z.std()), 1e-9)
        covariance = np.diag(own[of]) + between**2 * (1.0 + np.outer(z, z)) + shared
        weighted = np.linalg.solve(covariance, design[of])
        information += design[of].T @ weighted
        right += weighted.T @ values_db[of]
    return information, right


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
    - With two or more fields, the average of law and constant is recommended, with the weight that whole fields that
      were left out ask for.
    - With one field, the law is recommended if it is identified and explains more than a gradient inside the field
      would.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to the calibrated ground.
    check : FieldCheck
        Errors of the predictions of left-out fields, as :func:`leave_fields_out` returns them.
    known_db : float
        Largest half-width of the law's 90 % band [dB] with which the law is used (``uncertainty.known_db``).

    Returns
    -------
    Recommendation
    """
    width, gain, identified = half_width_db(found), check.gain, found.identified >= _IDENTIFIED
    if not width <= known_db:
        return Recommendation(
            0.0,
            f"the law's linear 90 % band over the 5-95 % of the incidence, without the level's error, reaches "
            f"+-{width:.3g} dB, more than {known_db:.3g} dB",
        )
    if share_among_cells(found) < _INSIDE:
        if identified:
            return Recommendation(1.0, "its change with incidence is seen inside of the parts of fields")
        return Recommendation(0.0, "its change with incidence is not shown to exceed its error")
    if gain.fields >= 2:
        return Recommendation(
            check.weight,
            f"the law's error on fields left out is {gain.ratio:.2f} times the constant's, geometric mean over "
            f"{gain.fields} fields, one standard error {np.exp(-gain.mean - gain.error):.2f} to "
            f"{np.exp(-gain.mean + gain.error):.2f}: {'' if gain.better else 'not '}better by more than this error",
        )
    if identified and trend(found) >= _TREND:
        return Recommendation(1.0, "its change with incidence exceeds what gradients inside of one field would make")
    return Recommendation(
        0.0, "its change with incidence is not shown to exceed what gradients inside of one field would make"
    )
