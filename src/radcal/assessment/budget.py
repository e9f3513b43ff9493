"""Uncertainty budget of a law: standard errors of level, noise floor, incidence and resolutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.measurement.levels import Levels

__all__ = ["FIELD_FREEDOM", "FLATTENING", "NORMAL_90", "Budget", "level_contradicted"]

FIELD_FREEDOM = 2.0
"""Degrees of freedom of the half-t priors of the standard deviations between and within fields (Gelman, "Prior
distributions for variance parameters in hierarchical models", Bayesian Analysis 1, 2006): the prior counts as much as
the fields of two materials."""

FLATTENING = 0.25
"""Ratio of the relative flattening of a law to the relative error of the resolutions (docs/uncertainty.md)."""

NORMAL_90 = 1.6448536269514722
"""Half-width of the 90 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class Budget:
    """Uncertainty budget of a law: standard errors that the pixels themselves do not show.

    Attributes
    ----------
    level_db : float
        Standard error of the level of the measured image [dB]: that of the absolute calibration or, if an offset has
        been removed from the image, that of the offset.
    field_db : float
        Scale of the priors on the standard deviations between and within fields [dB].
    point_spread : float
        Relative standard error of the resolutions.
    incidence_log_sd : float
        Standard deviation of the logarithm of the standard error of the local incidence.
    incidence_floor_deg : float
        Part of the standard error of the local incidence that is added in quadrature to the stated part [deg].
    noise_db : float
        Standard error of the noise floor [dB].
    """

    level_db: float
    field_db: float
    point_spread: float
    incidence_log_sd: float
    incidence_floor_deg: float
    noise_db: float = 0.0

    @classmethod
    def of(cls, config: Uncertainty, levels: Levels) -> Budget:
        """Uncertainty budget of a case; the level's standard error is that of the removed offset, if there is one."""
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
        """Errors of measured levels [dB] if the noise floor is off by one standard error, to first order, shape (n,).

        The derivative of 10 log10(signal + noise) with respect to the noise in dB is the share of noise in the
        measured power. The share of noise is limited to 1; it is 0 if ``noise_db`` is -inf (no noise known).
        """
        return np.asarray(self.noise_db * np.minimum(10.0 ** ((noise_db - level_db) / 10.0), 1.0))

    def incidence_error_deg(self, stated_deg: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard errors of the local incidence [deg], shape (m, n), for n stated errors and m normal deviates z."""
        return np.hypot(stated_deg, self.incidence_floor_deg) * np.exp(self.incidence_log_sd * z)[:, None]

    def steepening(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Factor (0.1 or more) on the slope of a law if the resolutions are off by z standard errors, shape (m,)."""
        return np.maximum(1.0 - FLATTENING * self.point_spread * z, 0.1)


def level_contradicted(config: Uncertainty, passes: Sequence[Levels]) -> str:
    """Clause on the measured images whose level the materials of fixed laws contradict; empty if there are none.

    A level is contradicted if its offset is significant (:attr:`.Levels.significant`) and larger than the 90 % interval
    of the budget's error of the level. The band of sigma0 then does not contain an error that radcal has measured.
    """
    several = len(passes) > 1
    found = [
        f"the measured image {f'of pass {number} ' * several}{levels.lies}"
        for number, levels in enumerate(passes, start=1)
        if levels.significant and abs(levels.offset_db) > NORMAL_90 * Budget.of(config, levels).level_db
    ]
    return f"{' and '.join(found)}: set target.normalisation: offset, or mend level or laws" if found else ""
