"""Expected width of the 90 % band of a law after a further pass, computed before the pass is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.budget import Budget
from radcal.assessment.curves import GRID_DEG
from radcal.config import Radar, TargetConfig
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.ground import Blocks
from radcal.measurement.patches import label_patches, make_cells
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["Sight", "half_widths_after", "half_widths_now", "sight_of"]

Doubles = NDArray[np.float64]

_FEWEST = 50  # least number of pixels, as for a target
_QUANTILES = (0.05, 0.95)


@dataclass(frozen=True)
class Sight:
    """Pixels of one material that a planned pass would see, in n incidence-angle bins.

    Attributes
    ----------
    pixels : ndarray of int, shape (p,)
        Flat indices of the material's usable pixels: without layover, shadow and margin.
    incidence_deg : ndarray, shape (p,)
        Local incidence of these pixels [deg].
    edges_deg : ndarray, shape (n + 1,)
        Edges of the bins [deg].
    weights : ndarray, shape (n, 361)
        Share of each bin's pixels at each angle of the grid of incidence.
    patches, cells : ndarray, shape (n, n)
        Covariances of the bins' means that random effects of variance 1 cause: effects of the fields, and effects of
        the cells, that the bins share.
    independent : ndarray, shape (n,)
        Number of independent pixels in each bin.
    noise_db : ndarray, shape (n,)
        Mean noise floor in each bin [dB].
    """

    pixels: NDArray[np.int64]
    incidence_deg: Doubles
    edges_deg: Doubles
    weights: Doubles
    patches: Doubles
    cells: Doubles
    independent: Doubles
    noise_db: Doubles

    def means_db(self, curves_db: Doubles) -> Doubles:
        """Mean level of each bin with the noise added [dB], shape (m, n), from m curves on the grid, shape (m, 361)."""
        found = np.empty((len(curves_db), len(self.weights)))
        for k, weight in enumerate(self.weights):
            seen = np.flatnonzero(weight)
            power = 10.0 ** (curves_db[:, seen] / 10.0) + 10.0 ** (self.noise_db[k] / 10.0)
            found[:, k] = 10.0 * np.log10(power) @ weight[seen]
        return found

    def covariance(self, fields_db: Doubles, looks: float, budget: Budget, level_db: Doubles) -> Doubles:
        """Covariance of the errors of the bins' means [dB^2], shape (n, n), at mean levels ``level_db``, shape (n,).

        The covariance is the sum of the contributions of speckle, of fields and their cells (``fields_db``: standard
        deviations between and within fields), of the image's level, and of its noise floor.
        """
        between, within = fields_db
        speckle = float(log_speckle_cumulants(looks)[1])
        of_noise = budget.noise_errors_db(level_db, self.noise_db)
        common = np.full_like(self.patches, budget.level_db**2) + np.multiply.outer(of_noise, of_noise)
        return np.asarray(
            common + between**2 * self.patches + within**2 * self.cells + np.diag(speckle / self.independent)
        )


def sight_of(name: str, geometry: Geometry, radar: Radar, target: TargetConfig) -> Sight | None:
    """Pixels of a material that a planned pass would see; None for fewer than 50 usable pixels.

    Parameters
    ----------
    name : str
        Name of the material.
    geometry : Geometry
        Geometry of the pass.
    radar : Radar
        Radar of the pass, with its resolutions and its noise.
    target : TargetConfig
        Configuration of the target, with the margin to other materials and the number of pixels.
    """
    hidden = (geometry.layover | geometry.shadow).ravel()
    pixels = geometry.pixels(name, target.margin_px)
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
    patch = label_patches(geometry.material == geometry.names.index(name) + 1).ravel()[pixels]
    cells = make_cells(patch, Blocks.of(None, geometry.shape[0]).parts_of(pixels, geometry.shape[1])).of_pixel
    row = pixels // geometry.shape[1]
    noise = noise_floor_db(radar, geometry.flat_incidence_deg)[row]
    # each resolution cell counts as one independent pixel, and a target takes no more than its number of pixels
    spacing = radar.range_spacing_m * radar.azimuth_spacing_m
    of_resolution = spacing / (radar.range_resolution_m * radar.azimuth_resolution_m)
    share = min(of_resolution, target.pixels / pixels.size, 1.0)
    return Sight(
        pixels=pixels,
        incidence_deg=angle,
        edges_deg=edges,
        weights=weights / count[:, None],
        patches=_shared(member, patch, count),
        cells=_shared(member, cells, count),
        independent=np.maximum(count * share, 1.0),
        noise_db=np.bincount(member, noise, n) / count,
    )


def _shared(member: NDArray[np.int64], label: NDArray[np.int64], count: Doubles) -> Doubles:
    """Product of two bins' shares of pixels with the same label, summed over all labels, shape (n, n)."""
    _, number = np.unique(label, return_inverse=True)
    shares = np.zeros((count.size, int(number.max()) + 1))
    np.add.at(shares, (member, number), 1.0)
    shares /= count[:, None]
    return np.asarray(shares @ shares.T)


def half_widths_now(curves_db: Doubles) -> Doubles:
    """Half-width of the pointwise 90 % band of m curves at k angles [dB], shape (m, k) to (k,)."""
    low, high = np.quantile(curves_db, _QUANTILES, axis=0)
    return np.asarray(0.5 * (high - low))


def half_widths_after(
    curves_db: Doubles, sights: Sequence[Sight], fields_db: Doubles, looks: float, budget: Budget, of: NDArray[np.int64]
) -> Doubles:
    """Expected half-width of the 90 % band after further passes [dB], by the linear-Gaussian preposterior covariance.

    Draws from the posterior give the joint covariance of the curve and of the predicted means of the bins. The
    covariance of the curve after the further passes follows from the joint covariance and from the covariance of the
    measurement errors, and does not depend on the values that will be measured. The present half-width follows from
    quantiles of the draws, because the band may be skewed. The expected half-width is the present one, multiplied by
    the ratio of the curve's standard deviations after and before the further passes.

    Parameters
    ----------
    curves_db : ndarray, shape (m, 361)
        Curves of the draws on the grid of incidence [dB].
    sights : sequence of Sight
        Pixels that each further pass would see.
    fields_db : ndarray, shape (2,)
        Standard deviations between and within fields [dB].
    looks : float
        Effective looks of the material.
    budget : Budget
        Uncertainty budget, with the standard errors of level and noise floor.
    of : ndarray of int, shape (k,)
        Indices of the k angles of the grid at which the half-width is wanted.

    Returns
    -------
    ndarray, shape (k,)

    References
    ----------
    Chaloner and Verdinelli, "Bayesian experimental design: a review", Statistical Science 10 (1995), section 2.2;
    Evensen, "The ensemble Kalman filter", Ocean Dynamics 53 (2003), for covariances from draws.
    """
    wanted = curves_db[:, of]
    left = wanted - wanted.mean(axis=0)
    before = (left**2).mean(axis=0)
    after = before.copy()
    if sights:
        means = [one.means_db(curves_db) for one in sights]
        seen = np.concatenate(means, axis=1)
        seen = seen - seen.mean(axis=0)
        covariance = seen.T @ seen / len(seen)
        ends = np.cumsum([0, *(one.shape[1] for one in means)])
        for one, mean, first, last in zip(sights, means, ends, ends[1:], strict=False):
            covariance[first:last, first:last] += one.covariance(fields_db, looks, budget, mean.mean(axis=0))
        across = left.T @ seen / len(seen)
        after = before - np.einsum("ki,ki->k", across, np.linalg.solve(covariance, across.T).T)
    ratio = np.sqrt(np.clip(after, 0.0, None) / np.maximum(before, 1e-12))
    return np.asarray(half_widths_now(wanted) * ratio)
