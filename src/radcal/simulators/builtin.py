"""Built-in simulator, which applies backscatter laws to the facets of a scene and adds speckle and noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.config.part import Part
from radcal.laws import Law
from radcal.radar import simulator_version
from radcal.radar.geometry import Geometry
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.radiometry import noise_floor_db
from radcal.radar.reflectivity import Reflectivity, law_tables, reflectivity


@dataclass(frozen=True)
class _Last:
    """Seed, parameters, reflectivity, image and thinning factors of the last run, which the next run partly reuses.

    The image has a whole number of looks. If the configured number of looks is not whole, ``thinning`` contains the
    factors that reduce the image's number of looks to the configured number; else ``thinning`` is None.
    """

    noise_seed: int
    parameters: Mapping[str, Sequence[float]]
    cells: Reflectivity
    image: NDArray[np.float32]
    thinning: NDArray[np.float32] | None


class BuiltinSimulator:
    """Built-in simulator, which makes a multilooked intensity image from backscatter laws on facets.

    Parameters
    ----------
    geometry : Geometry
        Facets of the pass.
    radar : Radar
        The pass.
    laws : mapping
        Law of each material.
    """

    def __init__(self, geometry: Geometry, radar: Radar, laws: Mapping[str, Law]) -> None:
        self._geometry, self._version = geometry, simulator_version(radar.earth)
        self._laws = laws
        noise_db = noise_floor_db(radar, geometry.flat_incidence_deg)
        self._formation = ImageFormation(radar, geometry.shape, noise_db, geometry.points, geometry.strip)
        self._last: _Last | None = None

    @classmethod
    def of(cls, case: Part, geometry: Geometry, geometry_path: str | Path) -> BuiltinSimulator:  # noqa: ARG003
        """Simulator of the configured pass."""
        return cls(geometry, case.radar, case.laws)

    @property
    def identity(self) -> Mapping[str, Any]:
        """Name and version of the simulator."""
        return {"kind": "builtin", "version": self._version}

    def expected(self, parameters: Mapping[str, Sequence[float]]) -> NDArray[np.float32]:
        """Expected image [dB] of the materials' X, with noise and without speckle, shape (rows, columns).

        Point scatterers are left out.
        """
        cells = reflectivity(self._geometry, law_tables(self._geometry.names, self._laws, parameters))
        return decibels(self._formation.expected(cells).astype(np.float32))

    def looks(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> Iterator[NDArray[np.complex64]]:
        """Complex looks, as :meth:`radcal.simulators.base.Looks.looks` specifies.

        If the configured number of looks is not whole, it is rounded up, and the amplitudes are thinned like the
        intensity of :meth:`run`.
        """
        cells = reflectivity(self._geometry, law_tables(self._geometry.names, self._laws, parameters))
        thinning = self._formation.thinning(noise_seed)
        share = np.float32(1.0) if thinning is None else np.sqrt(thinning)
        for look in range(self._formation.looks):
            yield self._formation.look(cells, noise_seed, look) * share

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass, as :meth:`radcal.simulators.base.Simulator.run` specifies.

        If the noise seed equals the noise seed of the last run, the simulator only recomputes the cells and image tiles
        of materials with changed parameters. The image is bit for bit equal to a completely recomputed image.
        """
        parameters = {name: tuple(parameters[name]) for name in self._laws if name in self._geometry.names}
        last, self._last = self._last, None  # this run overwrites the arrays of the last run, or needs their memory
        if last is None or last.noise_seed != noise_seed:
            cells = reflectivity(self._geometry, law_tables(self._geometry.names, self._laws, parameters))
            image, thinning = self._formation.intensity(cells, noise_seed), self._formation.thinning(noise_seed)
        else:
            others = {name: law for name, law in self._laws.items() if parameters[name] != last.parameters[name]}
            changed = np.array([False, *(name in others for name in self._geometry.names), False])  # the last: objects
            tables = law_tables(self._geometry.names, others, parameters)
            cells = reflectivity(self._geometry, tables, last.cells, changed)
            image = self._formation.intensity(cells, noise_seed, last.image, self._formation.touched(cells, changed))
            thinning = last.thinning
        self._last = _Last(noise_seed, parameters, cells, image, thinning)
        return decibels(image if thinning is None else image * thinning)
