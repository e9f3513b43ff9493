"""Predictions of the mean levels of cells by law and by constant, each without and with effects of fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.constant import Constant
from radcal.calibration.grounds import GroundLaw
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Effects

__all__ = ["Prediction", "predict"]

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Measured and predicted means of cells [dB], or of blocks that hold several cells.

    Attributes
    ----------
    patch, block, count : ndarray of int, shape (n,)
        Label of the field (-1 for the mean of a block), number of the part of a block, and number of pixels.
    mean_db, incidence_deg : ndarray, shape (n,)
        Measured mean [dB], and mean local incidence [deg].
    law_db, law_patch_db, constant_db, constant_patch_db : ndarray, shape (n,)
        Means predicted by law and by constant [dB], each without and with the effects of calibrated fields.
    common, own : ndarray, shape (n,)
        Two terms of the variance of the error of the prediction by law and field effects [dB^2]: that of the errors
        that cells of a field share (effect of the field, error of the law), and that of the error of a single cell.
    slope : ndarray, shape (n, d + 1)
        Derivatives of the prediction by law and field effects with respect to X and log looks.
    effect_variance : ndarray, shape (n,)
        Variance of the field's effect [dB^2].
    """

    patch: NDArray[np.int64]
    block: NDArray[np.int64]
    count: NDArray[np.int64]
    mean_db: Doubles
    incidence_deg: Doubles
    law_db: Doubles
    law_patch_db: Doubles
    constant_db: Doubles
    constant_patch_db: Doubles
    common: Doubles
    own: Doubles
    slope: Doubles
    effect_variance: Doubles

    def part(self, mask: NDArray[np.bool_]) -> Prediction:
        """Predictions restricted to the cells of a mask."""
        return Prediction(**{key: value[mask] for key, value in vars(self).items()})

    def in_blocks(self, covariance: Doubles) -> Prediction:
        """Predictions averaged over blocks; ``covariance`` is that of X and log looks, shape (d + 1, d + 1)."""
        block, of = np.unique(self.block, return_inverse=True)
        count = np.bincount(of, self.count).astype(np.int64)
        share = self.count / count[of]

        def over(values: Doubles) -> Doubles:
            return np.asarray(np.bincount(of, values, block.size), dtype=np.float64)

        slope = np.stack([over(share * column) for column in self.slope.T], axis=-1)
        effects = over(share**2 * self.effect_variance)  # no patch has two cells in one block
        averaged = ("mean_db", "incidence_deg", "law_db", "law_patch_db", "constant_db", "constant_patch_db")
        return Prediction(
            patch=np.full(block.size, -1, dtype=np.int64),
            block=block.astype(np.int64),
            count=count,
            **{key: over(share * getattr(self, key)) for key in averaged},
            common=effects + np.einsum("kd,de,ke->k", slope, covariance, slope),
            own=over(share**2 * self.own),
            slope=slope,
            effect_variance=effects,
        )

    @property
    def sd_db(self) -> Doubles:
        """Standard deviation of the error of the prediction by law and field effects [dB], shape (n,)."""
        return np.asarray(np.sqrt(self.common + self.own))


def _known(effects: Effects, patch: NDArray[np.int64], between: float) -> tuple[Doubles, Doubles, NDArray[np.int64]]:
    """Effect of each cell's field, variance of this effect, and its place in ``effects`` (-1 for an unknown field)."""
    place = np.minimum(np.searchsorted(effects.patch, patch), effects.patch.size - 1)
    known = effects.patch[place] == patch
    effect = np.where(known, effects.effect_db[place], 0.0)
    return effect, np.where(known, effects.variance[place], between**2), np.where(known, place, -1)


def predict(found: GroundLaw, constant: Constant, ground: Ground) -> Prediction:
    """Predict the mean levels of the cells of a ground by law and by constant.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to the calibrated ground.
    constant : Constant
        Constant fitted to the calibrated ground.
    ground : Ground
        Ground to predict; its fields have the labels that they have in the calibrated ground.

    Returns
    -------
    Prediction

    References
    ----------
    Robinson, "That BLUP is a good thing: the estimation of random effects", Statistical Science 6 (1991):
    predictions of random effects, and their variances with the errors of the fixed effects.
    """
    cells, spread, effects = ground.cells, found.spread, found.effects
    law = cells.mean(found.levels_db(ground.incidence_deg))
    slope = cells.mean(found.slopes(ground.incidence_deg))
    # an error of the law also changes the effects of the patches, which are found from residuals of the law
    seen = found.ground
    pulled = seen.cells.mean(found.slopes(seen.incidence_deg)) * effects.weight[:, None]
    of = np.searchsorted(effects.patch, seen.cells.patch)
    taken = np.stack([np.bincount(of, column, effects.patch.size) for column in pulled.T], axis=-1)
    effect, effect_variance, place = _known(effects, cells.patch, spread.between)
    slope = slope - np.where(place[:, None] >= 0, taken[place], 0.0)
    level = np.full(law.size, constant.level_db)
    return Prediction(
        patch=cells.patch,
        block=cells.block,
        count=cells.count,
        mean_db=cells.mean(ground.values_db),
        incidence_deg=cells.mean(ground.incidence_deg),
        law_db=law,
        law_patch_db=law + effect,
        constant_db=level,
        constant_patch_db=level + _known(constant.effects, cells.patch, constant.spread.between)[0],
        common=effect_variance + np.einsum("kd,de,ke->k", slope, found.fit.covariance, slope),
        own=spread.within**2 + ground.sampling,
        slope=slope,
        effect_variance=effect_variance,
    )
