"""Curves of sigma0 of one law for many X at once, on a fixed grid of local incidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.radar.laws import Law

__all__ = ["GRID_DEG", "NORMAL_90", "PER_DEG", "Curves"]

Doubles = NDArray[np.float64]

NORMAL_90 = 1.6448536269514722
"""Half-width of the 90 % interval of a normal distribution, in standard deviations."""
PER_DEG = 4
"""Number of angles per degree in the grid of local incidence."""
GRID_DEG = np.linspace(0.0, 90.0, 90 * PER_DEG + 1)
"""Angles of the grid of local incidence [deg]; between two angles, curves are interpolated linearly."""

_RAD = np.radians(GRID_DEG)


@dataclass(frozen=True)
class Curves:
    """Curves of sigma0 of one backscatter law with a curve, for many X at once."""

    law: Law

    def __call__(self, parameters: Doubles, phi_rad: Doubles = _RAD) -> Doubles:
        """Sigma0 [dB] for m vectors X, shape (m, d), on the grid, shape (m, 361), or at k angles [rad], (m, k)."""
        levels = np.asarray(self.law(phi_rad[:, None], parameters.T))
        return np.ascontiguousarray(levels.reshape(phi_rad.size, -1).T)

    @staticmethod
    def at(levels_db: Doubles, angles_deg: Doubles) -> Doubles:
        """Levels at angles [deg], shape (m, k) or (1, k), interpolated from curves on the grid, shape (m, 361)."""
        each = np.broadcast_to(angles_deg, (len(levels_db), angles_deg.shape[1]))
        return np.stack([np.interp(at, GRID_DEG, curve) for at, curve in zip(each, levels_db, strict=True)])
