"""Curves of a law for many X at once, on a fixed grid of local incidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.radar.laws import Law

__all__ = ["GRID_DEG", "PER_DEG", "Curves"]

Doubles = NDArray[np.float64]

PER_DEG = 4
"""Angles of the grid in a degree."""
GRID_DEG = np.linspace(0.0, 90.0, 90 * PER_DEG + 1)
"""Local incidence of the grid [deg]; between two angles a curve is taken as straight."""

_RAD = np.radians(GRID_DEG)


class Curves:
    """Curves of one law.

    A law whose formula takes arrays in place of numbers is evaluated at all X in one call, any other one by one.

    Parameters
    ----------
    law : Law
        With a curve.
    example : ndarray, shape (2, d)
        Two X, at which the single call is compared with two calls.
    """

    def __init__(self, law: Law, example: Doubles) -> None:
        self.law = law
        try:
            self._together = bool(
                np.allclose(self._at_once(example, _RAD), self._one_by_one(example, _RAD), rtol=1e-12, atol=0.0)
            )
        except (TypeError, ValueError):  # a formula of single numbers
            self._together = False

    def _at_once(self, parameters: Doubles, phi_rad: Doubles) -> Doubles:
        return np.ascontiguousarray(np.asarray(self.law(phi_rad[:, None], parameters.T)).reshape(phi_rad.size, -1).T)

    def _one_by_one(self, parameters: Doubles, phi_rad: Doubles) -> Doubles:
        return np.stack([self.law(phi_rad, x) for x in parameters])

    def __call__(self, parameters: Doubles, phi_rad: Doubles = _RAD) -> Doubles:
        """Sigma0 [dB] on the grid, shape (m, d) to (m, 361), or at k other angles [rad], to (m, k)."""
        return (self._at_once if self._together else self._one_by_one)(parameters, phi_rad)

    @staticmethod
    def at(levels_db: Doubles, angles_deg: Doubles) -> Doubles:
        """Levels at other angles [deg]: (m, 361) and (m, ...) or (1, ...) to (m, ...)."""
        m = len(levels_db)
        place = np.broadcast_to(angles_deg, (m, *angles_deg.shape[1:])).reshape(m, -1) * PER_DEG
        below = np.clip(place.astype(np.intp), 0, GRID_DEG.size - 2)
        share = place - below
        flat, first = levels_db.ravel(), below + GRID_DEG.size * np.arange(m)[:, None]
        found = flat[first] * (1.0 - share) + flat[first + 1] * share
        return np.asarray(found.reshape(m, *angles_deg.shape[1:]))
