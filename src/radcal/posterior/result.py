"""Posterior of the laws of all calibrated materials: band of sigma0, parameters, and error of the law's form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.laws import Law
from radcal.posterior.curves import GRID_DEG, curves_of
from radcal.posterior.effects import Shared
from radcal.posterior.radiometry import Radiometry
from radcal.storage.records import Stored

Doubles = NDArray[np.float64]

WHOLE_DEG = np.arange(91.0)
"""Whole degrees of incidence, at which curves are kept [deg]."""
_MEAN_POWER = np.log(10.0) / 20.0  # dB of mean power per dB^2 of variance of the fields: 0.115


@dataclass(frozen=True)
class Curve:
    """Curve of sigma0, the mean power of the ground at each local incidence, with its 90 % band.

    Attributes
    ----------
    incidence_deg : ndarray of float64, shape (a,), dimension scale
        Local incidence [deg].
    median_db : ndarray of float64, shape (a,)
        Median of sigma0 of the material [dB].
    p05_db : ndarray of float64, shape (a,)
        5 % quantile of sigma0 [dB].
    p95_db : ndarray of float64, shape (a,)
        95 % quantile of sigma0 [dB].
    systematic_db : ndarray of float64, shape (a,)
        Part of the band's half-width by level, radiometry, noise, incidence and point spread [dB].
    field_median_db : ndarray of float64, shape (a,)
        Median of sigma0 of the calibrated fields [dB].
    field_p05_db : ndarray of float64, shape (a,)
        5 % quantile of sigma0 of the calibrated fields [dB].
    field_p95_db : ndarray of float64, shape (a,)
        95 % quantile of sigma0 of the calibrated fields [dB].
    """

    incidence_deg: Doubles
    median_db: Doubles
    p05_db: Doubles
    p95_db: Doubles
    systematic_db: Doubles
    field_median_db: Doubles
    field_p05_db: Doubles
    field_p95_db: Doubles

    @property
    def half_width_db(self) -> Doubles:
        """Half of the width of the 90 % band [dB], shape (a,)."""
        return np.asarray(0.5 * (self.p95_db - self.p05_db))

    def at(self, incidence_deg: ArrayLike) -> Doubles:
        """5 % quantile, median and 95 % quantile of sigma0 at k angles [dB], shape (3, k)."""
        at, each = np.asarray(incidence_deg, dtype=np.float64), (self.p05_db, self.median_db, self.p95_db)
        return np.stack([np.interp(at, self.incidence_deg, values) for values in each])

    def half_widths_over(self, low_deg: float, high_deg: float) -> Doubles:
        """Half-widths of the 90 % band at 91 angles from ``low_deg`` to ``high_deg`` [dB], shape (91,)."""
        return np.interp(np.linspace(low_deg, high_deg, 91), self.incidence_deg, self.half_width_db)


@dataclass(frozen=True)
class LevelPoints:
    """Measured levels in k intervals of incidence, less the image's level and what the simulator adds to its law.

    Attributes
    ----------
    incidence_deg : ndarray of float64, shape (k,), dimension scale
        Mean local incidence of each interval [deg].
    level_db : ndarray of float64, shape (k,)
        Mean level of the cells of each interval [dB].
    error_db : ndarray of float64, shape (k,)
        Standard error of ``level_db`` by speckle, cells and fields [dB].
    predicted_db : ndarray of float64, shape (k, 3)
        5, 50 and 95 % quantile of the levels of other images of such ground [dB].
    p : float
        Share of such images whose levels lie further from the draws of the law than the measured.
    """

    incidence_deg: Doubles
    level_db: Doubles
    error_db: Doubles
    predicted_db: Doubles
    p: float


@dataclass(frozen=True)
class FormError:
    """Error of the form of a law over the incidence seen, less its mean.

    Attributes
    ----------
    rms_db : ndarray of float64, shape (3,)
        5, 50 and 95 % quantile of its root mean square [dB].
    noticed : bool
        Its 90 % interval leaves 0 at some angle.
    refuted : bool
        5 % quantile of its root mean square is above 1 dB.
    noticed_db : float
        Smallest bump that would be noticed in 9 of 10 images [dB].
    """

    rms_db: Doubles
    noticed: bool
    refuted: bool
    noticed_db: float


@dataclass(frozen=True)
class KeptDraws:
    """Up to 400 draws from the posterior of a law with d parameters, taken evenly from the sample.

    Attributes
    ----------
    parameters : ndarray of float64, shape (m, d)
        X of each draw.
    field_db : ndarray of float64, shape (m,)
        Standard deviation of the effects of fields [dB].
    cell_db : ndarray of float64, shape (m,)
        Standard deviation of the effects of cells [dB].
    form_db : ndarray of float64, shape (m, 91)
        Error of the law's form at each whole degree of incidence [dB].
    fields_db : ndarray of float64, shape (m,)
        Mean effect of the calibrated fields [dB].
    """

    parameters: Doubles
    field_db: Doubles
    cell_db: Doubles
    form_db: Doubles
    fields_db: Doubles

    def laws_db(self, law: Law) -> Doubles:
        """Levels of median fields [dB] by each draw on the grid of incidence, shape (m, 361): law and form error."""
        forms = [np.interp(GRID_DEG, WHOLE_DEG, one) for one in self.form_db]
        return np.asarray(curves_of(law, self.parameters) + np.stack(forms))

    def curves_db(self, law: Law) -> Doubles:
        """Mean power of the ground [dB] by each draw on the grid of incidence, (m, 361); the law must have a curve."""
        return np.asarray(self.laws_db(law) + (_MEAN_POWER * (self.field_db**2 + self.cell_db**2))[:, None])

    def field_curves_db(self, law: Law) -> Doubles:
        """Mean power of the calibrated fields [dB] by each draw on the grid of incidence, (m, 361)."""
        return np.asarray(self.laws_db(law) + self.fields_db[:, None] + _MEAN_POWER * self.cell_db[:, None] ** 2)


@dataclass(frozen=True)
class Constant:
    """Level of a material as one constant: generalised least squares mean of cells with effects of fields and cells.

    Attributes
    ----------
    mean_db : float
        Mean level, on level ground and without noise [dB].
    variance : float
        Variance of ``mean_db`` [dB^2].
    between_db : float
        Standard deviation of the effects of fields [dB].
    within_db : float
        Standard deviation of the effects of cells [dB].
    """

    mean_db: float
    variance: float
    between_db: float
    within_db: float


@dataclass(frozen=True)
class Predicted:
    """Predicted means of c cells or incidence-angle bins.

    Attributes
    ----------
    mean_db : ndarray of float64, shape (c,)
        Predicted mean [dB].
    p05_db : ndarray of float64, shape (c,)
        5 % quantile of the predictive distribution [dB].
    p95_db : ndarray of float64, shape (c,)
        95 % quantile of the predictive distribution [dB].
    """

    mean_db: Doubles
    p05_db: Doubles
    p95_db: Doubles

    def averaged(self, other: Predicted) -> Predicted:
        """Average with another prediction, of the means and of the quantiles, with equal weights.

        References
        ----------
        Lichtendahl, Grushka-Cockayne and Winkler, "Is it better to average probabilities or quantiles?", Management
        Science 59 (2013): a mixture of two calibrated distributions is too wide.
        """
        each = zip(vars(self).values(), vars(other).values(), strict=True)
        return Predicted(*(0.5 * (one + another) for one, another in each))


@dataclass(frozen=True)
class HeldOut:
    """Cells that were left out of the fit, with their predictions from the other cells.

    Attributes
    ----------
    patch : ndarray of int64, shape (c,)
        Field of each cell.
    incidence_deg : ndarray of float64, shape (c,)
        Mean local incidence [deg].
    measured_db : ndarray of float64, shape (c,)
        Measured mean, less what the simulator adds to its law [dB].
    law : Predicted
        Prediction by the model of the law alone.
    constant : Predicted
        Prediction by the constant alone.
    """

    patch: NDArray[np.int64]
    incidence_deg: Doubles
    measured_db: Doubles
    law: Predicted
    constant: Predicted

    @property
    def predicted(self) -> Predicted:
        """Prediction of other ground: the average of those of law and constant."""
        return self.law.averaged(self.constant)

    def rmse_db(self, by: Predicted) -> float:
        """Root mean square error of one of the predictions [dB]."""
        return float(np.sqrt(np.mean((self.measured_db - by.mean_db) ** 2)))

    def coverage_90(self, by: Predicted) -> float:
        """Share of the cells inside of the 90 % band of one of the predictions."""
        return float(np.mean((by.p05_db <= self.measured_db) & (self.measured_db <= by.p95_db)))


@dataclass(frozen=True)
class Posterior(Stored, kind="posterior"):
    """Posterior of one material's law with d parameters: quantiles, curve of sigma0, error of the form, kept draws.

    Attributes
    ----------
    sampled : bool
        Sampler has converged.
    ess : float
        Smallest effective sample size among the unknowns.
    r_hat : float
        Largest split R-hat among the unknowns.
    steps : int
        Steps of each walker of the sampler.
    cells : int
        Number of cells.
    fields : int
        Number of fields.
    parameters_p05 : ndarray of float64, shape (d,)
        5 % quantile of each parameter.
    parameters_p50 : ndarray of float64, shape (d,)
        Median of each parameter.
    parameters_p95 : ndarray of float64, shape (d,)
        95 % quantile of each parameter.
    looks : float
        Effective looks of the measured pixels inside of the cells.
    between_db : ndarray of float64, shape (3,)
        5, 50 and 95 % quantile of the standard deviation between fields [dB].
    within_db : ndarray of float64, shape (3,)
        5, 50 and 95 % quantile of the standard deviation within fields [dB].
    seen_deg : ndarray of float64, shape (passes, 2)
        5 and 95 % quantile of the local incidence of each pass [deg].
    parameters_model : ndarray of float64 or None, shape (d,)
        X in the bounds whose law is nearest to the median of sigma0.
    curve : Curve or None
        Curve of sigma0; absent for normalised images and laws without a curve.
    points : LevelPoints or None
        Measured levels to compare with ``curve``; absent without it.
    known_between_deg : tuple of float or None
        Ends of the interval in which sigma0 is determined; absent if it is at no angle [deg].
    known_half_width_db : float or None
        Largest half-width of the 90 % band in ``known_between_deg``; absent if there is none [dB].
    form : FormError or None
        Error of the law's form; absent where it cannot be told.
    draws : KeptDraws or None
        Draws from the posterior, for predictions.
    constant : Constant or None
        Level as one constant, for predictions; absent as ``curve``.
    held : HeldOut or None
        Predictions of held-out cells; absent without a section ``validation``.
    left_out : HeldOut or None
        Predictions of whole fields from the others; absent without a section ``validation``.
    """

    sampled: bool
    ess: float
    r_hat: float
    steps: int
    cells: int
    fields: int
    parameters_p05: Doubles
    parameters_p50: Doubles
    parameters_p95: Doubles
    looks: float
    between_db: Doubles
    within_db: Doubles
    seen_deg: Doubles
    parameters_model: Doubles | None = None
    curve: Curve | None = None
    points: LevelPoints | None = None
    known_between_deg: tuple[float, ...] | None = None
    known_half_width_db: float | None = None
    form: FormError | None = None
    draws: KeptDraws | None = None
    constant: Constant | None = None
    held: HeldOut | None = None
    left_out: HeldOut | None = None

    @property
    def middles_deg(self) -> Doubles:
        """Middle incidence of each pass [deg], rounded to tenths and increasing, without repeated angles."""
        return np.unique(np.round(self.seen_deg.mean(axis=1), 1))


@dataclass(frozen=True)
class Image(Stored, kind="image"):
    """What the fixed materials say of the measured images of p passes.

    Attributes
    ----------
    shared : mapping of str to Shared
        Shared effects by the area terms of the passes, the most probable ones first.
    laws_db : mapping of str to ndarray of float64
        5, 50 and 95 % quantile of image minus law, less the level, by material [dB].
    apart_db : mapping of str to ndarray of float64
        5, 50 and 95 % quantile of image minus law in its first pass, by material [dB].
    levels_db : ndarray of float64, shape (p, 3)
        5, 50 and 95 % quantile of the level of each pass [dB].
    sampled : bool
        Sampler has converged.
    radiometry : mapping of str to Radiometry
        Radiometry of each pass, by its number from 1.
    """

    shared: Mapping[str, Shared]
    laws_db: Mapping[str, Doubles]
    apart_db: Mapping[str, Doubles]
    levels_db: Doubles
    sampled: bool
    radiometry: Mapping[str, Radiometry]


def known_between(
    angle_deg: Doubles, half_width_db: Doubles, seen_deg: Sequence[Sequence[float]], known_db: float
) -> tuple[float, float] | None:
    """Largest interval of the incidence seen in which the half-width of the 90 % band is at most ``known_db``.

    Parameters
    ----------
    angle_deg, half_width_db : ndarray, shape (k,)
        Angles [deg], increasing, and half-widths there [dB].
    seen_deg : sequence of (float, float)
        5 and 95 % quantiles of the incidence in each pass [deg].
    known_db : float
        Largest half-width [dB].

    Returns
    -------
    (float, float) or None
        First and last angle of the interval [deg]; None if it holds fewer than two angles.
    """
    seen = np.any([(angle_deg >= low) & (angle_deg <= high) for low, high in seen_deg], axis=0)
    edges = np.diff(np.concatenate([[False], seen & (half_width_db <= known_db), [False]]).astype(np.int8))
    runs = np.flatnonzero(edges).reshape(-1, 2)
    if not runs.size:
        return None
    first, after = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return (float(angle_deg[first]), float(angle_deg[after - 1])) if after - first > 1 else None
