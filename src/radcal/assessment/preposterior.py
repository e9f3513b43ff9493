"""Expected width of the 90 % band of a law after a further pass, computed before the pass is measured."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.special import ndtri, polygamma

from radcal.assessment.cells import DB, cell_keys, with_noise_db
from radcal.assessment.curves import GRID_DEG, NORMAL_90
from radcal.assessment.posterior import KeptDraws
from radcal.config import Radar, Uncertainty
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.target_fit import fields_of
from radcal.radar.geometry import Geometry
from radcal.radar.laws import Law
from radcal.radar.radiometry import noise_floor_db
from radcal.scene.model import Scene

__all__ = ["Sight", "equivalent_sd", "half_widths_after", "half_widths_now", "normal_scores", "sight_of"]

Doubles = NDArray[np.float64]

_FEWEST = 50  # least number of pixels, as for a target
_QUANTILES = (0.05, 0.95)
_SCORES = ndtri(np.arange(0.5, 400.0) / 400.0)  # of a standard normal distribution


@dataclass(frozen=True)
class Sight:
    """Pixels of one material that a planned pass would see, in n incidence-angle bins.

    The mean of a bin is the average over its pixels of the mean power of their cells in dB (:mod:`.cells`).

    Attributes
    ----------
    pixels : ndarray of int, shape (p,)
        Flat indices of the material's usable pixels: without layover, shadow and margin.
    incidence_deg : ndarray, shape (p,)
        Local incidence of these pixels [deg].
    edges_deg : ndarray, shape (n + 1,)
        Edges of the bins [deg].
    cell : ndarray of int, shape (p,)
        Number of the cell of each pixel.
    weights : ndarray, shape (n, 361)
        Share of each bin's pixels at each angle of the grid of incidence.
    cells : ndarray, shape (n, n)
        Covariance of the bins' means by effects of cells of variance 1.
    independent : ndarray, shape (n,)
        Number of independent pixels in each bin.
    noise_db : ndarray, shape (n,)
        Mean noise floor in each bin [dB].
    fields : ndarray of int, shape (f,)
        Numbers of the fields, increasing; those of a scene are the same in all passes.
    shares : ndarray, shape (n, f)
        Share of each bin's pixels that lies in each field.
    """

    pixels: NDArray[np.int64]
    incidence_deg: Doubles
    edges_deg: Doubles
    cell: NDArray[np.intp]
    weights: Doubles
    cells: Doubles
    independent: Doubles
    noise_db: Doubles
    fields: NDArray[np.int64]
    shares: Doubles

    def in_common(self, other: Sight) -> Doubles:
        """Covariance of the bins' means in two passes, shape (n, n'), caused by effects of fields of variance 1."""
        _, own, others = np.intersect1d(self.fields, other.fields, return_indices=True)
        return np.asarray(self.shares[:, own] @ other.shares[:, others].T)

    def means_db(self, curves_db: Doubles) -> Doubles:
        """Mean level of each bin with the noise added [dB], shape (m, n), from m curves on the grid, shape (m, 361)."""
        each = zip(self.weights, self.noise_db, strict=True)
        return np.stack([with_noise_db(curves_db, noise) @ weight for weight, noise in each], axis=1)

    def covariance(
        self, field_db: Doubles, cell_db: Doubles, looks: float, config: Uncertainty, level_db: Doubles
    ) -> Doubles:
        """Covariances of the errors of the bins' means [dB^2], shape (..., n, n), at mean levels, shape (n,).

        The errors are those of speckle of ``looks`` looks, of fields and cells with standard deviations of shape (...),
        of the image's level, and of its noise floor, which counts by the share of noise in the power.
        """
        share = np.minimum(10.0 ** ((self.noise_db - level_db) / 10.0), 1.0)
        common = config.level_db**2 + config.noise_db**2 * np.multiply.outer(share, share)
        speckle = np.diag(DB**2 * polygamma(1, looks * self.independent))
        of_fields = np.square(field_db)[..., None, None] * self.in_common(self)
        return np.asarray(common + speckle + of_fields + np.square(cell_db)[..., None, None] * self.cells)


def sight_of(name: str, geometry: Geometry, radar: Radar, margin_px: int, scene: Scene | None = None) -> Sight | None:
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
    hidden = (geometry.layover | geometry.shadow).ravel()
    pixels = geometry.pixels(name, margin_px)
    pixels = pixels[~hidden[pixels]]
    if pixels.size < _FEWEST:
        return None
    angle = geometry.incidence_deg.ravel()[pixels].astype(np.float64)
    edges = incidence_edges(angle, "auto")
    member = class_of(angle, edges)
    n = len(edges) - 1
    count = np.bincount(member, minlength=n).astype(np.float64)
    nearest = np.rint(angle / (GRID_DEG[1] - GRID_DEG[0])).astype(np.intp)
    weights = np.zeros((n, GRID_DEG.size))
    np.add.at(weights, (member, nearest), 1.0)
    field = fields_of(name, geometry, scene)[pixels]
    _, cell = np.unique(cell_keys(pixels, field, angle, geometry.shape[1]), axis=1, return_inverse=True)
    fields, shares = _shares(member, field, count)
    _, of_cells = _shares(member, cell.ravel(), count)
    noise = noise_floor_db(radar, geometry.flat_incidence_deg)[pixels // geometry.shape[1]]
    # each resolution cell counts as one independent pixel
    spacing = radar.range_spacing_m * radar.azimuth_spacing_m
    share = min(spacing / (radar.range_resolution_m * radar.azimuth_resolution_m), 1.0)
    return Sight(
        pixels=pixels,
        incidence_deg=angle,
        edges_deg=edges,
        cell=cell.ravel(),
        weights=weights / count[:, None],
        cells=of_cells @ of_cells.T,
        independent=np.maximum(count * share, 1.0),
        noise_db=np.bincount(member, noise, n) / count,
        fields=fields,
        shares=shares,
    )


def _shares(member: NDArray[np.int64], label: NDArray[np.int64], count: Doubles) -> tuple[NDArray[np.int64], Doubles]:
    """Labels, shape (f,), and share of each bin's pixels that has each label, shape (n, f)."""
    labels, number = np.unique(label, return_inverse=True)
    shares = np.zeros((count.size, labels.size))
    np.add.at(shares, (member, number), 1.0)
    return labels, shares / count[:, None]


def half_widths_now(curves_db: Doubles) -> Doubles:
    """Half-width of the pointwise 90 % band of m curves at k angles [dB], shape (m, k) to (k,)."""
    low, high = np.quantile(curves_db, _QUANTILES, axis=0)
    return np.asarray(0.5 * (high - low))


def half_widths_after(
    draws: KeptDraws,
    law: Law,
    own: Sequence[Sight],
    further: Sequence[Sight],
    looks: float,
    config: Uncertainty,
    of: NDArray[np.int64],
    common_level: bool = False,
) -> Doubles:
    """Expected half-width of the 90 % band after further passes [dB], by the linear-Gaussian preposterior covariance.

    Draws of law and form error give the joint covariance of the curve and of the predicted means of the bins, in the
    passes that the calibration has and in the further passes. A field has the same effect in all passes. Given a draw,
    the means measured in the own passes give their errors, so that the conditional distribution of the errors in the
    further passes replaces the unconditional one: a further pass does not measure again what the fields have in common.
    The covariance of the curve after the further passes does not depend on the values that will be measured.

    The half-widths follow from quantiles, as those of the present band, and not from variances: the standard deviations
    of fields have a posterior with a heavy tail, so that a few draws would determine the variances. Curves and
    predicted means are replaced by normal scores with the half-widths of their distributions (Gaussian anamorphosis).

    Parameters
    ----------
    draws : KeptDraws
        The m draws from the posterior.
    law : Law
        Law of the material.
    own : sequence of Sight
        Pixels of the passes that the calibration has.
    further : sequence of Sight
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
    if not further:
        return now
    sights, laws = [*own, *further], draws.laws_db(law)
    means = [one.means_db(laws) for one in sights]
    seen = normal_scores(np.concatenate(means, axis=1))
    field, cell = equivalent_sd(draws.field_db), equivalent_sd(draws.cell_db)
    levels = [mean.mean(axis=0) for mean in means]
    errors = block_diag(
        *(one.covariance(field, cell, looks, config, at) for one, at in zip(sights, levels, strict=True))
    )
    ends = np.cumsum([0, *(len(one.weights) for one in sights)])
    for i, j in itertools.permutations(range(len(sights)), 2):
        shared = field**2 * sights[i].in_common(sights[j]) + common_level * config.level_db**2
        errors[ends[i] : ends[i + 1], ends[j] : ends[j + 1]] = shared
    first = ends[len(own)]  # bin of the further passes
    given = np.linalg.solve(errors[:first, :first], errors[:first, first:]).T
    innovation = seen[:, first:] - seen[:, :first] @ given.T
    left = normal_scores(wanted)
    covariance = innovation.T @ innovation / len(seen) + errors[first:, first:] - given @ errors[:first, first:]
    across = left.T @ innovation / len(seen)
    before = (left**2).mean(axis=0)
    after = before - np.einsum("ki,ki->k", across, np.linalg.solve(covariance, across.T).T)
    return np.asarray(now * np.sqrt(np.clip(after, 0.0, None) / np.maximum(before, 1e-12)))


def normal_scores(values: Doubles) -> Doubles:
    """Normal scores of m draws, shape (m, k), with mean 0 and the half-width of the 90 % interval of each column.

    The draws keep their order; their standard deviation is the half-width between the 5 and 95 % quantiles, divided by
    that of the standard normal distribution.
    """
    ranks = values.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    scores = ndtri((ranks + 0.5) / len(values))
    return np.asarray(scores / np.sqrt((scores**2).mean(axis=0)) * half_widths_now(values) / NORMAL_90)


def equivalent_sd(sd: Doubles) -> Doubles:
    """Standard deviation of the normal distribution with the 90 % interval of a mixture of m, shape (m,) to ().

    The mixture consists of normal distributions of mean 0 and equal weights with the standard deviations ``sd``.
    """
    return np.asarray(np.quantile(np.abs(np.multiply.outer(_SCORES, sd)), 0.9) / np.quantile(np.abs(_SCORES), 0.9))
