"""The simulator that radcal ships."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.radar.geometry import Geometry
from radcal.radar.image import ImageFormation, reflectivity
from radcal.radar.laws import EXTERNAL, LAWS, Law, law_for

__all__ = ["BuiltinSimulator"]

# raised whenever the same input gives another image
_VERSION = 1


class BuiltinSimulator:
    """Backscatter laws on facets to a multilooked complex image.

    Parameters
    ----------
    geometry : Geometry
        Facets of the pass.
    radar : Radar
        The pass.
    laws : mapping
        Material name to its law (``Case.laws``), or to the name of one without knots.

    Raises
    ------
    ConfigError
        A law has no curve: another simulator's.
    """

    def __init__(self, geometry: Geometry, radar: Radar, laws: Mapping[str, Law | str]) -> None:
        self._geometry = geometry
        self._laws = {
            name: law_for(law, frequency_ghz=radar.frequency_ghz, polarisation=radar.polarisation)
            if isinstance(law, str)
            else law
            for name, law in laws.items()
        }
        for name, law in self._laws.items():
            if not law.has_curve:
                raise ConfigError(
                    f"materials.{name}.law is {EXTERNAL}, which only simulator.kind: command can simulate, expected "
                    f"one of {sorted(LAWS)}."
                )
        self._formation = ImageFormation(radar, geometry.shape)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Name and version."""
        return {"kind": "builtin", "version": _VERSION}

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass; see :class:`radcal.simulators.protocol.Simulator`."""
        return self._formation.intensity_db(reflectivity(self._geometry, self._laws, parameters), noise_seed)
