"""Backscatter law: a curve of sigma0 over the local incidence angle, and what is known about its parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import ConfigError

__all__ = ["EXTERNAL", "Law", "cosine"]

EXTERNAL = "external"  # the law of a material whose backscatter the simulator alone knows
_LEAST_COSINE = 1e-6
Intervals = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Law:
    """A backscatter law and what is known about its parameters.

    Attributes
    ----------
    function : callable or None
        ``(phi_rad, parameters) -> sigma0 [dB]``; keywords for what ``needs`` lists. None: the curve
        is known to the simulator alone.
    names, units : tuple of str
        One per parameter; empty until the knots of a law that needs them are bound.
    bounds : tuple of (float, float) or None
        Default search box; None where nothing published gives one.
    valid_deg : (float, float)
        Incidence angles that the law was made for [deg].
    limits : tuple of (float, float) or None
        What parameters may be at all; None: anything.
    needs : tuple of str
        What must still be bound: ``frequency_ghz``, ``polarisation``, ``angles_deg``.
    doubt : callable or None
        ``(parameters) -> str | None``, in words why the parameters lie outside of what the law was
        made for; keywords for what ``needs`` lists.
    formula, source, remark : str
        For the documentation.
    """

    function: Callable[..., NDArray[np.float64]] | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    bounds: Intervals | None = None
    valid_deg: tuple[float, float] = (0.0, 90.0)
    limits: Intervals | None = None
    needs: tuple[str, ...] = ()
    doubt: Callable[..., str | None] | None = None
    formula: str = ""
    source: str = ""
    remark: str = ""

    def __call__(self, phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the law: angle [rad] to sigma0 [dB]; a ConfigError if it has no curve."""
        if self.function is None:
            raise ConfigError(
                f"law {EXTERNAL!r} of the parameters {list(self.names)} has no curve, expected a law of radcal's own: "
                "only the simulator knows what backscatter they make."
            )
        return self.function(phi_rad, parameters)

    @property
    def has_curve(self) -> bool:
        """Whether it can be evaluated, rather than simulated only."""
        return self.function is not None

    def bound(self, **conditions: Any) -> Law:
        """Return the law that knows these conditions; None and what it does not need are passed over."""
        known = {key: value for key, value in conditions.items() if key in self.needs and value is not None}
        law = replace(
            self,
            function=partial(self.function, **known) if self.function is not None else None,
            doubt=partial(self.doubt, **known) if self.doubt is not None else None,
            needs=tuple(key for key in self.needs if key not in known),
        )
        if "angles_deg" in known:
            angles = [float(angle) for angle in known["angles_deg"]]
            names = tuple(f"sigma0_{angle:.10g}deg" for angle in angles)
            law = replace(law, names=names, units=("dB",) * len(angles), valid_deg=(angles[0], angles[-1]))
        return law

    def outside(self, incidence_deg: ArrayLike) -> float:
        """Share of these angles [deg] that lie outside of the valid ones; those that are not finite do not count."""
        angle = np.asarray(incidence_deg, dtype=np.float64)
        angle = angle[np.isfinite(angle)]
        low, high = self.valid_deg
        return float(np.mean((angle < low) | (angle > high))) if angle.size else 0.0


def cosine(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosine of an incidence angle that never quite vanishes: powers in dB stay finite."""
    return np.asarray(np.maximum(np.cos(phi), _LEAST_COSINE))
