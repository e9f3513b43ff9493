"""Curves of sigma0 of one law for many X at once, on a fixed grid of local incidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.laws import Law

Doubles = NDArray[np.float64]

NORMAL_90 = 1.6448536269514722
"""Half-width of the 90 % interval of a normal distribution, in standard deviations."""
PER_DEG = 4
"""Number of angles per degree in the grid of local incidence."""
GRID_DEG = np.linspace(0.0, 90.0, 90 * PER_DEG + 1)
"""Angles of the grid of local incidence [deg]; between two angles, curves are interpolated linearly."""

_RAD = np.radians(GRID_DEG)


def curves_of(law: Law, parameters: Doubles, phi_rad: Doubles = _RAD) -> Doubles:
    """Sigma0 [dB] of a law with a curve for m X, shape (m, d), on the grid, shape (m, 361), or at k angles, (m, k)."""
    levels = np.asarray(law(phi_rad[:, None], parameters.T))
    return np.ascontiguousarray(levels.reshape(phi_rad.size, -1).T)


def levels_at(curves_db: Doubles, angles_deg: Doubles) -> Doubles:
    """Levels of m curves on the grid [dB], shape (m, 361), at k angles [deg]: linear interpolation, shape (m, k)."""
    return np.stack([np.interp(angles_deg, GRID_DEG, curve) for curve in curves_db])
