"""Posterior of the laws of all calibrated materials: band of sigma0, parameters, and error of the law's form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.laws import Law
from radcal.posterior.curves import GRID_DEG, curves_of
from radcal.posterior.effects import Shared
from radcal.posterior.radiometry import Radiometry
from radcal.storage.dataclass_groups import About

Doubles = NDArray[np.float64]

WHOLE_DEG = np.arange(91.0)
"""Whole degrees of incidence, at which curves are kept [deg]."""
_MEAN_POWER = np.log(10.0) / 20.0  # dB of mean power per dB^2 of variance of the fields: 0.115


@dataclass(frozen=True)
class Curve:
    """Curve of sigma0, the mean power of the ground at each local incidence, with its 90 % band."""

    incidence_deg: Annotated[Doubles, About("local incidence", "deg", "a", scale=True)]
    median_db: Annotated[Doubles, About("median of sigma0 of the material", "dB", "a")]
    p05_db: Annotated[Doubles, About("5 % quantile of sigma0", "dB", "a")]
    p95_db: Annotated[Doubles, About("95 % quantile of sigma0", "dB", "a")]
    systematic_db: Annotated[
        Doubles,
        About("part of the band's half-width by level, radiometry, noise, incidence and point spread", "dB", "a"),
    ]
    field_median_db: Annotated[Doubles, About("median of sigma0 of the calibrated fields", "dB", "a")]
    field_p05_db: Annotated[Doubles, About("5 % quantile of sigma0 of the calibrated fields", "dB", "a")]
    field_p95_db: Annotated[Doubles, About("95 % quantile of sigma0 of the calibrated fields", "dB", "a")]

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
    """Measured levels in k intervals of incidence, less the image's level and what the simulator adds to its law."""

    incidence_deg: Annotated[Doubles, About("mean local incidence of each interval", "deg", "k", scale=True)]
    level_db: Annotated[Doubles, About("mean level of the cells of each interval", "dB", "k")]
    error_db: Annotated[Doubles, About("standard error of `level_db` by speckle, cells and fields", "dB", "k")]
    predicted_db: Annotated[
        Doubles, About("5, 50 and 95 % quantile of the levels of other images of such ground", "dB", "k, 3")
    ]
    p: Annotated[
        float, About("share of such images whose levels lie further from the draws of the law than the measured")
    ]


@dataclass(frozen=True)
class FormError:
    """Error of the form of a law over the incidence seen, less its mean."""

    rms_db: Annotated[Doubles, About("5, 50 and 95 % quantile of its root mean square", "dB", "3")]
    noticed: Annotated[bool, About("its 90 % interval leaves 0 at some angle")]
    refuted: Annotated[bool, About("5 % quantile of its root mean square is above 1 dB")]
    noticed_db: Annotated[float, About("smallest bump that would be noticed in 9 of 10 images", "dB")]


@dataclass(frozen=True)
class KeptDraws:
    """Up to 400 draws from the posterior of a law with d parameters, taken evenly from the sample."""

    parameters: Annotated[Doubles, About("X of each draw", shape="m, d")]
    field_db: Annotated[Doubles, About("standard deviation of the effects of fields", "dB", "m")]
    cell_db: Annotated[Doubles, About("standard deviation of the effects of cells", "dB", "m")]
    form_db: Annotated[Doubles, About("error of the law's form at each whole degree of incidence", "dB", "m, 91")]
    fields_db: Annotated[Doubles, About("mean effect of the calibrated fields", "dB", "m")]

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
    """Level of a material as one constant: generalised least squares mean of cells with effects of fields and cells."""

    mean_db: Annotated[float, About("mean level, on level ground and without noise", "dB")]
    variance: Annotated[float, About("variance of `mean_db`", "dB^2")]
    between_db: Annotated[float, About("standard deviation of the effects of fields", "dB")]
    within_db: Annotated[float, About("standard deviation of the effects of cells", "dB")]


@dataclass(frozen=True)
class Predicted:
    """Predicted means of c cells or incidence-angle bins."""

    mean_db: Annotated[Doubles, About("predicted mean", "dB", "c")]
    p05_db: Annotated[Doubles, About("5 % quantile of the predictive distribution", "dB", "c")]
    p95_db: Annotated[Doubles, About("95 % quantile of the predictive distribution", "dB", "c")]

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
    """Cells that were left out of the fit, with their predictions from the other cells."""

    patch: Annotated[NDArray[np.int64], About("field of each cell", shape="c")]
    incidence_deg: Annotated[Doubles, About("mean local incidence", "deg", "c")]
    measured_db: Annotated[Doubles, About("measured mean, less what the simulator adds to its law", "dB", "c")]
    law: Annotated[Predicted, About("prediction by the model of the law alone")]
    constant: Annotated[Predicted, About("prediction by the constant alone")]

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
class Posterior:
    """Posterior of one material's law with d parameters: quantiles, curve of sigma0, error of the form, kept draws."""

    sampled: Annotated[bool, About("sampler has converged")]
    ess: Annotated[float, About("smallest effective sample size among the unknowns")]
    r_hat: Annotated[float, About("largest split R-hat among the unknowns")]
    steps: Annotated[int, About("steps of each walker of the sampler")]
    cells: Annotated[int, About("number of cells")]
    fields: Annotated[int, About("number of fields")]
    parameters_p05: Annotated[Doubles, About("5 % quantile of each parameter", shape="d")]
    parameters_p50: Annotated[Doubles, About("median of each parameter", shape="d")]
    parameters_p95: Annotated[Doubles, About("95 % quantile of each parameter", shape="d")]
    looks: Annotated[float, About("effective looks of the measured pixels inside of the cells")]
    between_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the standard deviation between fields", "dB", "3")]
    within_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the standard deviation within fields", "dB", "3")]
    seen_deg: Annotated[Doubles, About("5 and 95 % quantile of the local incidence of each pass", "deg", "passes, 2")]
    parameters_model: Annotated[
        Doubles | None, About("X in the bounds whose law is nearest to the median of sigma0", shape="d")
    ] = None
    curve: Annotated[Curve | None, About("curve of sigma0; absent for normalised images and laws without a curve")] = (
        None
    )
    points: Annotated[LevelPoints | None, About("measured levels to compare with `curve`; absent without it")] = None
    known_between_deg: Annotated[
        tuple[float, ...] | None,
        About("ends of the interval in which sigma0 is determined; absent if it is at no angle", "deg"),
    ] = None
    known_half_width_db: Annotated[
        float | None, About("largest half-width of the 90 % band in `known_between_deg`; absent if there is none", "dB")
    ] = None
    form: Annotated[FormError | None, About("error of the law's form; absent where it cannot be told")] = None
    draws: Annotated[KeptDraws | None, About("draws from the posterior, for predictions")] = None
    constant: Annotated[Constant | None, About("level as one constant, for predictions; absent as `curve`")] = None
    held: Annotated[HeldOut | None, About("predictions of held-out cells; absent without a section `validation`")] = (
        None
    )
    left_out: Annotated[
        HeldOut | None, About("predictions of whole fields from the others; absent without a section `validation`")
    ] = None

    @property
    def middles_deg(self) -> Doubles:
        """Middle incidence of each pass [deg], rounded to tenths and increasing, without repeated angles."""
        return np.unique(np.round(self.seen_deg.mean(axis=1), 1))


@dataclass(frozen=True)
class Image:
    """What the fixed materials say of the measured images of p passes."""

    shared: Annotated[
        Mapping[str, Shared], About("shared effects by the area terms of the passes, the most probable ones first")
    ]
    laws_db: Annotated[
        Mapping[str, Doubles], About("5, 50 and 95 % quantile of image minus law, less the level, by material", "dB")
    ]
    apart_db: Annotated[
        Mapping[str, Doubles], About("5, 50 and 95 % quantile of image minus law in its first pass, by material", "dB")
    ]
    levels_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the level of each pass", "dB", "p, 3")]
    sampled: Annotated[bool, About("sampler has converged")]
    radiometry: Annotated[Mapping[str, Radiometry], About("radiometry of each pass, by its number from 1")]


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
