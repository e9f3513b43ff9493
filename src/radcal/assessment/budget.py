"""Budget of a law's uncertainty: what else than sampling, fields and surrogate stands between pixels and law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.measurement.levels import Levels

__all__ = ["FIELD_FREEDOM", "FLATTENING", "NORMAL_90", "Budget"]

FIELD_FREEDOM = 4.0
"""Degrees of freedom of the half-t priors of the standard deviations between and within fields (Gelman, "Prior
distributions for variance parameters in hierarchical models", Bayesian Analysis 1, 2006)."""

FLATTENING = 0.25
"""Share by which a law flattens, over the share by which the resolutions are coarser (docs/uncertainty.md)."""

NORMAL_90 = 1.6448536269514722
"""Half-width of the 90 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Budget:
    """Standard errors that the pixels themselves do not show.

    Attributes
    ----------
    level_db : float
        Of the level of the measured image [dB]: of its absolute calibration or, where an offset has been removed, of
        this offset.
    field_db : float
        Scale of the standard deviations between and within fields [dB].
    point_spread : float
        Relative, of the resolutions.
    incidence_log_sd : float
        Of the logarithm of the standard error of the local incidence.
    incidence_floor_deg : float
        Part of that error that is not stated [deg].
    noise_db : float
        Of the noise floor [dB].
    """

    level_db: float
    field_db: float
    point_spread: float
    incidence_log_sd: float
    incidence_floor_deg: float
    noise_db: float = 0.0

    @classmethod
    def of(cls, config: Uncertainty, levels: Levels) -> Budget:
        """Budget of a case, for images at these levels."""
        removed = levels.normalisation == "offset" and np.isfinite(levels.offset_error_db)
        return cls(
            level_db=float(levels.offset_error_db) if removed else config.level_db,
            field_db=config.field_db,
            point_spread=config.point_spread,
            incidence_log_sd=config.incidence_error,
            incidence_floor_deg=config.incidence_floor_deg,
            noise_db=config.noise_db,
        )

    def noise_errors_db(
        self, level_db: NDArray[np.float64], noise_db: float | NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Errors of measured levels [dB] by one standard error of the noise floor [dB], to first order, shape (n,).

        The derivative of 10 log10(signal + noise) by the noise in dB is the share of noise in the measured power, at
        most 1; 0 where no noise is known (-inf).
        """
        return np.asarray(self.noise_db * np.minimum(10.0 ** ((noise_db - level_db) / 10.0), 1.0))

    def incidence_error_deg(self, stated_deg: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard errors of the local incidence [deg], shapes (n,) and (m,) to (m, n), at standard normal z."""
        return np.hypot(stated_deg, self.incidence_floor_deg) * np.exp(self.incidence_log_sd * z)[:, None]

    def steepening(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Factor of the slopes by an error of the resolutions, shape (m,), at standard normal z; at least 0.1."""
        return np.maximum(1.0 - FLATTENING * self.point_spread * z, 0.1)
