"""Expected width of the 90 % band of a law after a further pass, computed before the pass is measured."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from radcal.assessment.budget import NORMAL_90, Budget
from radcal.assessment.curves import GRID_DEG
from radcal.assessment.posterior import KeptDraws
from radcal.config import Radar, TargetConfig
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.ground import Blocks
from radcal.measurement.patches import label_patches, make_cells, patches_seen
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.radar.texture import log_speckle_cumulants
from radcal.scene.model import Scene

__all__ = ["Sight", "equivalent_sd", "half_widths_after", "half_widths_now", "normal_scores", "sight_of"]

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
    fields : ndarray of int, shape (f,)
        Numbers of the fields in the scene, which are the same in all passes; empty if fields have no numbers.
    shares : ndarray, shape (n, f)
        Share of each bin's pixels that lies in each field.
    """

    pixels: NDArray[np.int64]
    incidence_deg: Doubles
    edges_deg: Doubles
    weights: Doubles
    patches: Doubles
    cells: Doubles
    independent: Doubles
    noise_db: Doubles
    fields: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    shares: Doubles = field(default_factory=lambda: np.empty((0, 0)))

    def in_common(self, other: Sight) -> Doubles:
        """Covariance of the bins' means in two passes, shape (n, n'), caused by effects of fields of variance 1."""
        found = np.zeros((len(self.weights), len(other.weights)))
        for number in np.intersect1d(self.fields, other.fields):
            found += np.multiply.outer(
                self.shares[:, self.fields == number][:, 0], other.shares[:, other.fields == number][:, 0]
            )
        return found

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


def sight_of(
    name: str, geometry: Geometry, radar: Radar, target: TargetConfig, scene: Scene | None = None
) -> Sight | None:
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
    scene : Scene, optional
        Scene, which numbers the fields as in the fit; by default the fields are the connected areas of the image, and
        have no numbers in common with other passes.
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
    number = geometry.names.index(name) + 1
    shown = geometry.material == number
    labels = label_patches(shown) if scene is None else patches_seen(shown, scene.material == number, geometry.ground)
    patch = labels.ravel()[pixels]
    fields, shares = _shares(member, patch, count)
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
        patches=shares @ shares.T,
        cells=_shared(member, cells, count),
        independent=np.maximum(count * share, 1.0),
        noise_db=np.bincount(member, noise, n) / count,
        fields=np.empty(0, dtype=np.int64) if scene is None else fields,
        shares=shares[:, :0] if scene is None else shares,
    )


def _shares(member: NDArray[np.int64], label: NDArray[np.int64], count: Doubles) -> tuple[NDArray[np.int64], Doubles]:
    """Labels, shape (f,), and share of each bin's pixels that has each label, shape (n, f)."""
    labels, number = np.unique(label, return_inverse=True)
    shares = np.zeros((count.size, labels.size))
    np.add.at(shares, (member, number), 1.0)
    return labels, shares / count[:, None]


def _shared(member: NDArray[np.int64], label: NDArray[np.int64], count: Doubles) -> Doubles:
    """Product of two bins' shares of pixels with the same label, summed over all labels, shape (n, n)."""
    _, shares = _shares(member, label, count)
    return np.asarray(shares @ shares.T)


def half_widths_now(curves_db: Doubles) -> Doubles:
    """Half-width of the pointwise 90 % band of m curves at k angles [dB], shape (m, k) to (k,)."""
    low, high = np.quantile(curves_db, _QUANTILES, axis=0)
    return np.asarray(0.5 * (high - low))


def half_widths_after(
    curves_db: Doubles,
    draws: KeptDraws,
    own: Sequence[Sight],
    further: Sequence[Sight],
    budget: Budget,
    of: NDArray[np.int64],
) -> Doubles:
    """Expected half-width of the 90 % band after further passes [dB], by the linear-Gaussian preposterior covariance.

    Draws from the posterior give the joint covariance of the curve and of the predicted means of the bins, in the
    passes that the calibration has and in the further passes. The errors of the means are correlated between passes,
    because a field has the same effect in all passes. The draws already contain the means measured in the own passes,
    so that their errors are known up to the law: the conditional distribution of the errors in the further passes,
    given the errors in the own passes, replaces the unconditional one. What fields have in common is then not measured
    again by a further pass. The covariance of the curve after the further passes does not depend on the values that
    will be measured.

    The half-widths follow from quantiles, as those of the present band, and not from variances: the standard deviations
    of fields have a posterior with a heavy tail, so that a few draws would determine the variances. Curves and
    predicted means are replaced by normal scores with the half-widths of their distributions (Gaussian anamorphosis).

    Parameters
    ----------
    curves_db : ndarray, shape (m, 361)
        Curves of the draws on the grid of incidence [dB].
    draws : KeptDraws
        The m draws from the posterior.
    own : sequence of Sight
        Pixels of the passes that the calibration has.
    further : sequence of Sight
        Pixels that each further pass would see.
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
    Evensen, "The ensemble Kalman filter", Ocean Dynamics 53 (2003), for covariances from draws; Bertino, Evensen and
    Wackernagel, "Sequential data assimilation techniques in oceanography", International Statistical Review 71 (2003),
    for Gaussian anamorphosis.
    """
    wanted = curves_db[:, of]
    now = half_widths_now(wanted)
    if not further:
        return now
    fields_db, looks = equivalent_sd(draws.fields_db), float(np.median(draws.looks))
    means = [one.means_db(draws.laws_db(curves_db)) for one in (*own, *further)]
    # the mean of speckle in dB depends on the looks
    seen = normal_scores(np.concatenate(means, axis=1) + log_speckle_cumulants(draws.looks)[:, :1])
    errors = _errors([*own, *further], [mean.mean(axis=0) for mean in means], fields_db, looks, budget)
    first = sum(mean.shape[1] for mean in means[: len(own)])  # index of the first bin of the further passes
    given = np.linalg.solve(errors[:first, :first], errors[:first, first:]).T
    innovation = seen[:, first:] - seen[:, :first] @ given.T
    left = normal_scores(wanted)
    covariance = innovation.T @ innovation / len(seen) + errors[first:, first:] - given @ errors[:first, first:]
    across = left.T @ innovation / len(seen)
    before = (left**2).mean(axis=0)
    after = before - np.einsum("ki,ki->k", across, np.linalg.solve(covariance, across.T).T)
    return np.asarray(now * np.sqrt(np.clip(after, 0.0, None) / np.maximum(before, 1e-12)))


def _errors(
    sights: Sequence[Sight], levels_db: Sequence[Doubles], fields_db: Doubles, looks: float, budget: Budget
) -> Doubles:
    """Covariance of the errors of the means of all passes' bins [dB^2], with the effects of fields in common."""
    whole = block_diag(
        *(one.covariance(fields_db, looks, budget, level) for one, level in zip(sights, levels_db, strict=True))
    )
    ends = np.cumsum([0, *(len(one.weights) for one in sights)])
    for i, j in itertools.permutations(range(len(sights)), 2):
        shared = sights[i].in_common(sights[j])
        whole[ends[i] : ends[i + 1], ends[j] : ends[j + 1]] = fields_db[0] ** 2 * shared
    return np.asarray(whole)


def normal_scores(values: Doubles) -> Doubles:
    """Normal scores of m draws, shape (m, k), with mean 0 and the half-width of the 90 % interval of each column.

    The draws keep their order; their standard deviation is the half-width between the 5 and 95 % quantiles, divided by
    that of the standard normal distribution.
    """
    ranks = values.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    scores = ndtri((ranks + 0.5) / len(values))
    return np.asarray(scores / np.sqrt((scores**2).mean(axis=0)) * half_widths_now(values) / NORMAL_90)


def equivalent_sd(sd: Doubles) -> Doubles:
    """Standard deviation of the normal distribution with the 90 % interval of a mixture, shape (m, k) to (k,).

    Each column of ``sd`` holds the standard deviations of m normal distributions with mean 0 and equal weights.
    """
    found = np.zeros(sd.shape[1])
    for k, each in enumerate(sd.T):
        if (least := each[each > 0.0]).size > 0.1 * each.size:  # else more than 90 % of the values are 0
            outside = each.size - least.size

            def excess(x: float, each: Doubles = least, outside: int = outside, whole: int = each.size) -> float:
                return float((ndtr(x / each).sum() + outside) / whole) - _QUANTILES[1]

            found[k] = brentq(excess, 0.0, 4.0 * float(least.max())) / NORMAL_90
    return found
