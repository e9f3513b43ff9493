"""Incidence-angle bins of a material in a pass, and predicted differences of measured and simulated means of a bin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.preposterior import View, common_errors
from radcal.config import Uncertainty
from radcal.ground.bins import class_of, incidence_edges
from radcal.laws import Law
from radcal.posterior.cells import DB
from radcal.posterior.curves import GRID_DEG
from radcal.posterior.result import Constant, Posterior

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class PredictionBins:
    """Incidence-angle bins of a material in a pass, whose means are averages over parts of cells, weighted by pixels.

    The mean of a part is its mean power in dB.

    Attributes
    ----------
    edges_deg : ndarray, shape (b + 1,)
        Edges of the bins [deg].
    parts : View
        Pixels of the pass, in n parts of cells, each of which lies in one bin.
    weights : ndarray, shape (b, n)
        Weight of each part in the mean of each bin.
    """

    edges_deg: Doubles
    parts: View
    weights: Doubles

    @classmethod
    def of(cls, view: View) -> PredictionBins:
        """Bins of the usable pixels, with the cells divided at the edges of the bins."""
        angle = view.incidence_deg
        edges = incidence_edges(angle, "auto")
        size = edges.size - 1
        found, part = np.unique(view.cell * size + class_of(angle, edges), return_inverse=True)
        of, count = found // size, np.bincount(part)
        parts = replace(
            view,
            cell=part,
            patch=view.patch[of],
            middle_deg=np.bincount(part, angle) / count,
            independent=np.maximum(view.independent[of] * count / np.bincount(view.cell)[of], 1.0),
            noise_db=view.noise_db[of],
        )
        weights = np.equal(found % size, np.arange(size)[:, None]) * count
        return cls(edges, parts, weights / weights.sum(axis=1, keepdims=True))

    @property
    def member(self) -> NDArray[np.int64]:
        """Bin of each pixel, shape (p,)."""
        return class_of(self.parts.incidence_deg, self.edges_deg)

    def levels_db(self, image_db: Doubles) -> Doubles:
        """Mean of each bin [dB], shape (b,), from the values of the pixels [dB], shape (p,).

        A pixel with NaN has no value; the mean of a bin without values is NaN.
        """
        has, size = np.isfinite(image_db), len(self.weights)
        _, part, count = np.unique(self.parts.cell[has], return_inverse=True, return_counts=True)
        level = DB * np.log(np.bincount(part, 10.0 ** (image_db[has] / 10.0)) / count)
        member = self.member[has]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.bincount(member, level[part], size) / np.bincount(member, minlength=size))


def predictive_db(
    posterior: Posterior,
    law: Law,
    start: Sequence[float],
    bins: PredictionBins,
    config: Uncertainty,
    rng: np.random.Generator,
) -> Doubles:
    """Draws of measured minus simulated means of the bins of a pass [dB], shape (m, b).

    Each draw of the posterior moves the simulated means by its law and form error minus the simulated law. Effects of
    fields and cells with the draw's standard deviations, speckle of measured and simulated pixels, and errors of the
    image's level and noise floor are added.

    Parameters
    ----------
    posterior : Posterior
        Posterior of the law, with m draws.
    law : Law
        Law of the material.
    start : sequence of float, shape (d,)
        X with which the image was simulated.
    bins : PredictionBins
        Bins of the material in the pass.
    config : Uncertainty
        Standard errors of level and noise floor.
    rng : numpy.random.Generator
        Generator of the random errors.
    """
    draws, parts = posterior.draws, bins.parts
    assert draws is not None  # noqa: S101 - asked for by the caller
    means = parts.means_db(draws.laws_db(law))
    common = common_errors([parts], means.mean(axis=0), 1.0, config)
    effects = rng.standard_normal((len(means), common.shape[1]))
    effects[:, :-2] *= draws.field_db[:, None]  # the last two columns are level and noise floor
    # half the looks: speckle of the measured and of the simulated pixels
    own = np.sqrt(draws.cell_db[:, None] ** 2 + parts.speckle_db2(0.5 * posterior.looks))
    errors = effects @ common.T + own * rng.standard_normal(means.shape)
    simulated = parts.means_db(np.asarray(law(np.radians(GRID_DEG), start))[None])
    return np.asarray((means - simulated + errors) @ bins.weights.T)


def by_constant_db(
    constant: Constant, looks: float, law: Law, start: Sequence[float], bins: PredictionBins, config: Uncertainty
) -> tuple[Doubles, Doubles]:
    """Measured minus simulated means of the bins by a constant level, and standard errors [dB], shape (b,) each.

    ``looks`` are those of the measured pixels inside of cells; for the rest see :func:`predictive_db`.
    """
    parts, weights = bins.parts, bins.weights
    level = parts.means_db(np.full((1, GRID_DEG.size), constant.mean_db))[0]
    simulated = parts.means_db(np.asarray(law(np.radians(GRID_DEG), start))[None])[0]
    common = weights @ common_errors([parts], level, constant.between_db, config)
    variance = (common**2).sum(axis=1) + weights**2 @ parts.speckle_db2(0.5 * looks)
    # cells of one incidence differ from a constant alike, by the slope of the law
    return weights @ (level - simulated), np.sqrt(variance + constant.within_db**2 + constant.variance)
