"""Expected width of the 90 % band of a law after a further pass, computed before the pass is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar, Uncertainty
from radcal.laws import Law
from radcal.posterior.cells import DB, cell_keys, members
from radcal.posterior.curves import NORMAL_90, levels_at
from radcal.posterior.result import KeptDraws
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db, with_noise_db
from radcal.scene.model import Scene
from radcal.targets.target_fit import fields_of

Doubles = NDArray[np.float64]

_FEWEST = 50  # least number of pixels, as for a target
_QUANTILES = (0.05, 0.95)
_SCORES = scipy.special.ndtri(np.arange(0.5, 400.0) / 400.0)  # of a standard normal distribution


@dataclass(frozen=True)
class View:
    """Pixels of one material that a planned pass would see, in n cells, which are those of the model (:mod:`.cells`).

    Attributes
    ----------
    pixels : ndarray of int, shape (p,)
        Flat indices of the material's usable pixels: without layover, shadow and margin, in a cell of 8 or more.
    incidence_deg : ndarray, shape (p,)
        Local incidence of these pixels [deg].
    cell : ndarray of int, shape (p,)
        Number of the cell of each pixel.
    patch : ndarray of int, shape (n,)
        Number of each cell's field; the numbers of a scene are the same in all passes.
    middle_deg : ndarray, shape (n,)
        Mean local incidence of each cell [deg].
    independent : ndarray, shape (n,)
        Number of independent pixels in each cell.
    noise_db : ndarray, shape (n,)
        Mean noise floor in each cell [dB].
    """

    pixels: NDArray[np.int64]
    incidence_deg: Doubles
    cell: NDArray[np.int64]
    patch: NDArray[np.int64]
    middle_deg: Doubles
    independent: Doubles
    noise_db: Doubles

    def means_db(self, curves_db: Doubles) -> Doubles:
        """Mean level of each cell with the noise added [dB], shape (m, n), by m curves on the grid, shape (m, 361)."""
        return with_noise_db(levels_at(curves_db, self.middle_deg), self.noise_db)

    def speckle_db2(self, looks: float) -> Doubles:
        """Variance of each cell's mean by speckle of ``looks`` looks [dB^2], shape (n,)."""
        return np.asarray(DB**2 * scipy.special.polygamma(1, looks * self.independent))


def view_of(name: str, geometry: Geometry, radar: Radar, margin_px: int, scene: Scene | None = None) -> View | None:
    """Pixels of a material that a planned pass would see; None for fewer than 50 usable pixels.

    Parameters
    ----------
    name : str
        Name of the material.
    geometry : Geometry
        Geometry of the pass.
    radar : Radar
        Radar of the pass, with its resolutions and its noise.
    margin_px : int
        Margin to other materials [pixels].
    scene : Scene, optional
        Scene, which numbers the fields as in the fit; by default the fields are the connected areas of the image.
    """
    hidden, width = (geometry.layover | geometry.shadow).ravel(), geometry.shape[1]
    pixels = geometry.pixels(name, margin_px)
    pixels = pixels[~hidden[pixels]]
    angle = geometry.incidence_deg.ravel().astype(np.float64)
    field = fields_of(name, geometry, scene)[pixels]
    inside, cell, patch = members(cell_keys(pixels, field, angle[pixels], width))
    pixels = pixels[inside]
    if pixels.size < _FEWEST:
        return None
    count = np.bincount(cell)
    noise = noise_floor_db(radar, geometry.flat_incidence_deg)[pixels // width]
    # each resolution cell counts as one independent pixel
    spacing = radar.range_spacing_m * radar.azimuth_spacing_m
    share = min(spacing / (radar.range_resolution_m * radar.azimuth_resolution_m), 1.0)
    return View(
        pixels=pixels,
        incidence_deg=angle[pixels],
        cell=cell,
        patch=patch,
        middle_deg=np.bincount(cell, angle[pixels]) / count,
        independent=np.maximum(count * share, 1.0),
        noise_db=np.bincount(cell, noise) / count,
    )


def common_errors(
    views: Sequence[View], levels_db: Doubles, field_db: float, config: Uncertainty, common_level: bool = False
) -> Doubles:
    """Errors that n means of cells share, as columns of effects of variance 1 [dB], shape (n, f + 2 p).

    The effects are those of f fields with the standard deviation ``field_db``, which are the same in all p passes, and
    the errors of each pass's level and noise floor. The noise floor counts by the share of noise in the power.

    Parameters
    ----------
    views : sequence of View
        Cells of each pass.
    levels_db : ndarray, shape (n,)
        Levels of the cells of all passes [dB].
    field_db : float
        Standard deviation of the effects of fields [dB].
    config : Uncertainty
        Standard errors of level and noise floor.
    common_level : bool
        Whether all passes have one error of the level.
    """
    patch, noise_db = (np.concatenate([getattr(one, key) for one in views]) for key in ("patch", "noise_db"))
    of_pass = np.repeat(np.eye(len(views)), [one.patch.size for one in views], axis=0)
    level = np.where(common_level, [1.0] + [0.0] * (len(views) - 1), of_pass)
    share = np.minimum(10.0 ** ((noise_db - levels_db) / 10.0), 1.0)
    fields = np.equal(patch[:, None], np.unique(patch))
    return np.hstack([field_db * fields, config.level_db * level, config.noise_db * share[:, None] * of_pass])


def half_widths_now(curves_db: Doubles) -> Doubles:
    """Half-width of the pointwise 90 % band of m curves at k angles [dB], shape (m, k) to (k,)."""
    low, high = np.quantile(curves_db, _QUANTILES, axis=0)
    return np.asarray(0.5 * (high - low))


def half_widths_after(
    draws: KeptDraws,
    law: Law,
    own: Sequence[View],
    further: Sequence[View],
    looks: float,
    config: Uncertainty,
    of: NDArray[np.int64],
    common_level: bool = False,
) -> Doubles:
    """Expected half-width of the 90 % band after further passes [dB], by the linear-Gaussian preposterior covariance.

    Draws of law and form error give the joint covariance of the curve and of the predicted means of the cells, in the
    passes that the calibration has and in the further passes. A field has the same effect in all passes. Given a draw,
    the means measured in the own passes tell of the errors that the cells share, so that the conditional distribution
    of these errors replaces the unconditional one: a further pass does not measure again what the fields have in
    common. The covariance of the curve after the further passes does not depend on the values that will be measured.
    It is computed for the draws and the shared errors as unknowns, whose number does not grow with that of the cells.

    The half-widths follow from quantiles, as those of the present band, and not from variances: the standard deviations
    of fields have a posterior with a heavy tail, so that a few draws would determine the variances. Curves and
    predicted means are replaced by normal scores with the half-widths of their distributions (Gaussian anamorphosis).

    Parameters
    ----------
    draws : KeptDraws
        The m draws from the posterior.
    law : Law
        Law of the material.
    own : sequence of View
        Pixels of the passes that the calibration has.
    further : sequence of View
        Pixels that each further pass would see.
    looks : float
        Effective looks of a pixel inside of a cell.
    config : Uncertainty
        Standard errors of level and noise floor, which are independent between passes.
    of : ndarray of int, shape (k,)
        Indices of the k angles of the grid at which the half-width is wanted.
    common_level : bool
        Whether all passes have one error of the level, as if the same fixed laws give it.

    Returns
    -------
    ndarray, shape (k,)

    References
    ----------
    Chaloner and Verdinelli, "Bayesian experimental design: a review", Statistical Science 10 (1995), section 2.2;
    Evensen, "The ensemble Kalman filter", Ocean Dynamics 53 (2003), for covariances from draws; Bertino, Evensen and
    Wackernagel, "Sequential data assimilation techniques in oceanography", International Statistical Review 71 (2003),
    for Gaussian anamorphosis.
    """
    wanted = draws.curves_db(law)[:, of]
    now = half_widths_now(wanted)
    views, laws, m = [*own, *further], draws.laws_db(law), len(wanted)
    means = np.concatenate([one.means_db(laws) for one in views], axis=1)
    field, cell = _equivalent_sd(draws.field_db), _equivalent_sd(draws.cell_db)
    common = common_errors(views, means.mean(axis=0), field, config, common_level)
    weight = 1.0 / (np.concatenate([one.speckle_db2(looks) for one in views]) + cell**2)
    first = sum(one.patch.size for one in own)  # cell of the further passes
    # each draw is an unknown of variance 1
    seen, left = _normal_scores(means).T / np.sqrt(m), _normal_scores(wanted).T / np.sqrt(m)
    weighted = common[:first].T * weight[:first]
    precision = np.eye(common.shape[1]) + weighted @ common[:first]
    given = np.linalg.solve(precision, weighted @ seen[:first])
    columns = np.hstack([seen[first:] - common[first:] @ given, common[first:]])
    information = scipy.linalg.block_diag(np.eye(m), precision) + (columns.T * weight[first:]) @ columns
    padded = np.pad(left, ((0, 0), (0, len(precision))))
    before, after = (left**2).sum(axis=1), (padded * np.linalg.solve(information, padded.T).T).sum(axis=1)
    return np.asarray(now * np.sqrt(np.clip(after, 0.0, None) / np.maximum(before, 1e-12)))


def _normal_scores(values: Doubles) -> Doubles:
    """Normal scores of m draws, shape (m, k), with mean 0 and the half-width of the 90 % interval of each column.

    The draws keep their order; their standard deviation is the half-width between the 5 and 95 % quantiles, divided by
    that of the standard normal distribution.
    """
    ranks = values.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    scores = scipy.special.ndtri((ranks + 0.5) / len(values))
    return np.asarray(scores / np.sqrt((scores**2).mean(axis=0)) * half_widths_now(values) / NORMAL_90)


def _equivalent_sd(sd: Doubles) -> float:
    """Standard deviation of the normal distribution with the 90 % interval of a mixture of m, shape (m,).

    The mixture consists of normal distributions of mean 0 and equal weights with the standard deviations ``sd``.
    """
    return float(np.quantile(np.abs(np.multiply.outer(_SCORES, sd)), 0.9) / np.quantile(np.abs(_SCORES), 0.9))
