"""Constant level of a material, with which its law is compared; both have random effects of fields and cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from radcal.measurement.ground import Ground
from radcal.measurement.patches import Effects, Residuals, Spread, gls_mean, patch_effects, spreads

__all__ = ["Constant", "constants"]

_UNKNOWN = 1e-9  # prior information on the level [1/dB^2]: practically none


@dataclass(frozen=True)
class Constant:
    """Constant level fitted to the means of a material's cells by generalised least squares.

    Attributes
    ----------
    ground : Ground
        Pixels to which the constant is fitted.
    spread : Spread
        Between-field and within-field standard deviation about the constant [dB].
    """

    ground: Ground
    spread: Spread

    @cached_property
    def _cells(self) -> tuple[float, float]:
        cells = self.ground.cells
        return gls_mean(cells.mean(self.ground.values_db), self.ground.sampling, cells.patch, self.spread)

    @property
    def level_db(self) -> float:
        """Constant level of the material [dB]."""
        return self._cells[0]

    @property
    def variance(self) -> float:
        """Variance of the error of the constant level [dB^2]."""
        return self._cells[1]

    @cached_property
    def effects(self) -> Effects:
        """Random effects of the fields to which the constant is fitted."""
        cells = self.ground.cells
        residual = cells.mean(self.ground.values_db) - self.level_db
        return patch_effects(residual, self.ground.sampling, cells.patch, self.spread)


def constants(grounds: Mapping[str, Ground]) -> dict[str, Constant]:
    """Constant levels of several materials, with variances between and within fields estimated together."""
    residuals = []
    for ground in grounds.values():
        cells = ground.cells
        mean = cells.mean(ground.values_db)
        slopes = np.ones((mean.size, 1))
        residuals.append(Residuals(mean - mean.mean(), ground.sampling, cells.patch, slopes, np.array([[_UNKNOWN]])))
    found = spreads(residuals) if residuals else []
    return {name: Constant(ground, spread) for (name, ground), spread in zip(grounds.items(), found, strict=True)}
