"""Backscatter law: curve of sigma0 over the local incidence angle, with names, units and bounds of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import ConfigError

EXTERNAL = "external"  # law of a material whose backscatter only the simulator can compute
OF_PASS = ("frequency_ghz", "polarisation")  # conditions that section radar gives
_LEAST_COSINE = 1e-6
Intervals = tuple[tuple[float, float], ...]


def seen_rad(incidence_deg: ArrayLike) -> NDArray[np.float64]:
    """91 angles [rad] from the 5 % to the 95 % quantile of the local incidence of a material's pixels [deg]."""
    low, high = np.quantile(np.asarray(incidence_deg, dtype=np.float64), [0.05, 0.95])
    return np.radians(np.linspace(float(low), float(high), 91))


@dataclass(frozen=True)
class Law:
    """Backscatter law with names, units, bounds and limits of its parameters.

    Attributes
    ----------
    function : callable or None
        Function ``(phi_rad, parameters) -> sigma0 [dB]``. The keyword arguments of the function are the conditions in
        ``needs``. None for an external law.
    names, units : tuple of str
        Name and unit of each parameter; empty for a law whose knots are not yet bound.
    bounds : tuple of (float, float) or None
        Default bounds of the search for each parameter; None if no publication gives bounds.
    valid_deg : (float, float)
        Smallest and largest incidence angle for which the law is valid [deg].
    limits : tuple of (float, float) or None
        Range of permitted values of each parameter; None for no limits.
    needs : tuple of str
        Conditions that must still be bound: ``frequency_ghz`` and ``polarisation`` of the pass, ``angles_deg`` of the
        material, and any others, whose values the material gives as ``conditions``.
    polarisations : tuple of str
        Polarisations for which the law has numbers.
    doubt : callable or None
        Function ``(parameters) -> str | None``, whose keyword arguments are the conditions in ``needs``. The function
        returns a clause for a warning if the parameters lie outside the range of the law's data, else None.
    log_normal : mapping
        Weak log-normal priors of some parameters, by parameter name: each is the median, in the parameter's unit, and
        the standard deviation of the natural logarithm.
    formula, source : str
        Texts for the documentation.
    description : mapping
        Plain data that identify the law without its parameters, for the description of a run: its name, and what the
        case file gives for it; of a law of another distribution also the name and version of the distribution.
    """

    function: Callable[..., NDArray[np.float64]] | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    bounds: Intervals | None = None
    valid_deg: tuple[float, float] = (0.0, 90.0)
    limits: Intervals | None = None
    needs: tuple[str, ...] = ()
    polarisations: tuple[str, ...] = ("HH", "HV", "VH", "VV")
    doubt: Callable[..., str | None] | None = None
    log_normal: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    formula: str = ""
    source: str = ""
    description: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the law in the case file."""
        return str(self.description.get("law", ""))

    def __call__(self, phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
        """Sigma0 [dB] at local incidence angles [rad].

        Raises
        ------
        ConfigError
            The law has no curve, or a condition is not bound.
        """
        if self.function is None:
            raise ConfigError(
                f"law {EXTERNAL!r} of the parameters {list(self.names)} has no curve, expected a law of radcal's own: "
                "only the simulator knows what backscatter they make."
            )
        if self.needs:
            key = f"radar.{self.needs[0]}" if self.needs[0] in OF_PASS else f"{self.needs[0]} of the material"
            raise ConfigError(f"{key} is missing: law {self.name!r} depends on it.")
        return self.function(phi_rad, parameters)

    @property
    def has_curve(self) -> bool:
        """Whether the law can be evaluated; external laws can only be simulated."""
        return self.function is not None

    def largest_difference_db(self, first: ArrayLike, second: ArrayLike, incidence_deg: ArrayLike) -> float:
        """Largest difference in sigma0 [dB] between two curves of the law, at the angles of :func:`seen_rad`.

        Parameters
        ----------
        first, second : array_like, shape (d,)
            Parameters of the two curves.
        incidence_deg : array_like
            Local incidence of a material's pixels [deg].
        """
        phi = seen_rad(incidence_deg)
        return float(np.abs(self(phi, first) - self(phi, second)).max())

    def bound(self, **conditions: Any) -> Law:
        """Law with the given conditions bound to it; conditions that are None or not needed are ignored."""
        known = {key: value for key, value in conditions.items() if key in self.needs and value is not None}
        if not known:
            return self
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
        """Share of the given angles [deg] that are outside of the law's valid angles; non-finite angles are ignored."""
        angle = np.asarray(incidence_deg, dtype=np.float64)
        angle = angle[np.isfinite(angle)]
        low, high = self.valid_deg
        return float(np.mean((angle < low) | (angle > high))) if angle.size else 0.0


def cosine(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosine of an incidence angle, limited to at least 1e-6, so that powers in dB stay finite."""
    return np.asarray(np.maximum(np.cos(phi), _LEAST_COSINE))
