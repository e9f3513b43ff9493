"""Curves of sigma0 of one law for many X at once, on a fixed grid of local incidence."""

from __future__ import annotations

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


class Curves:
    """Curves of sigma0 of one backscatter law, for many X at once.

    If the formula of the law accepts arrays in place of numbers, all X are evaluated in one call. A
    formula of single numbers is called once for each X.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    example : ndarray, shape (2, d)
        Two X, with which it is tried whether a single call gives the result of two calls.
    """

    def __init__(self, law: Law, example: Doubles) -> None:
        self.law = law
        try:
            self._together = bool(
                np.allclose(self._at_once(example, _RAD), self._one_by_one(example, _RAD), rtol=1e-12, atol=0.0)
            )
        except (TypeError, ValueError):  # the formula accepts single numbers only
            self._together = False

    def _at_once(self, parameters: Doubles, phi_rad: Doubles) -> Doubles:
        return np.ascontiguousarray(np.asarray(self.law(phi_rad[:, None], parameters.T)).reshape(phi_rad.size, -1).T)

    def _one_by_one(self, parameters: Doubles, phi_rad: Doubles) -> Doubles:
        return np.stack([self.law(phi_rad, x) for x in parameters])

    def __call__(self, parameters: Doubles, phi_rad: Doubles = _RAD) -> Doubles:
        """Sigma0 [dB] for m vectors X, shape (m, d), on the grid, shape (m, 361), or at k angles [rad], (m, k)."""
        return (self._at_once if self._together else self._one_by_one)(parameters, phi_rad)

    @staticmethod
    def at(levels_db: Doubles, angles_deg: Doubles) -> Doubles:
        """Levels at angles [deg], shape (m, ...) or (1, ...), interpolated from curves on the grid, shape (m, 361)."""
        m = len(levels_db)
        place = np.broadcast_to(angles_deg, (m, *angles_deg.shape[1:])).reshape(m, -1) * PER_DEG
        below = np.clip(place.astype(np.intp), 0, GRID_DEG.size - 2)
        share = place - below
        flat, first = levels_db.ravel(), below + GRID_DEG.size * np.arange(m)[:, None]
        found = flat[first] * (1.0 - share) + flat[first + 1] * share
        return np.asarray(found.reshape(m, *angles_deg.shape[1:]))
