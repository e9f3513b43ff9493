"""Simulator whose images are focused from raw signals (``simulator.product: focused``)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.config.stages import model_of
from radcal.radar import simulator_version
from radcal.radar.geometry import Geometry
from radcal.radar.projection import LitFacets
from radcal.radar.radiometry import nesz_db
from radcal.radar.reflectivity import law_tables
from radcal.scene.model import Scene
from radcal.signals.focus import check, focused
from radcal.signals.history import RawSignal, kept
from radcal.signals.places import rows_m
from radcal.signals.platform import collection, nesz
from radcal.signals.scatterers import Scatterers, drawn_on, facets_of
from radcal.simulators.forward import Flown
from radcal.storage.files import digest

_VERSION = 2  # part of the key of a run: raised when the image of the same settings changes

Looks = NDArray[np.complex64]


class FocusedSimulator:
    """Simulator of focused images, on the pixels of the fast image and in its radiometry.

    The amplitude of the image is the sum of those of its materials. What does not change from run to run, namely fixed
    materials, objects and noise, is simulated once for each seed; a run adds the calibrated materials. Noise has the
    level of ``radar.nesz_db`` at all ranges; that of a receiver alone grows with range.

    Parameters
    ----------
    case : Part
        Sections ``radar`` and ``materials`` of the pass; platform and antenna are the defaults of section ``signals``.
    scene : Scene
        Scene.
    geometry : Geometry
        Geometry of the pass.
    folder : path, optional
        Folder in which the unchanged part of the image is kept; by default it is made for each run.

    Raises
    ------
    ConfigError
        Radar or scene do not suit raw signals (:func:`~radcal.signals.focus.check`).
    """

    def __init__(self, case: Part, scene: Scene, geometry: Geometry, folder: Path | None = None) -> None:
        flown = model_of("seed", "signals", "radars", "materials").model_validate({"radar": case.radar})
        flown = flown.model_copy(update={"materials": case.materials})  # not validated again, as hidden laws are not
        check(flown, scene)
        self._flown, self._one, self._folder = Flown(flown, scene, geometry), collection(flown, scene), folder

    @property
    def identity(self) -> Mapping[str, Any]:
        """Name and version of the simulator."""
        return {"kind": "builtin", "version": simulator_version("flat"), "focused": _VERSION}

    @cached_property
    def _facets(self) -> LitFacets:
        return facets_of(self._flown.case.radar, self._flown.scene, self._one.facet_m)

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass, as :meth:`radcal.simulators.base.Simulator.run` specifies."""
        power = np.mean(np.abs(self._summed(parameters, noise_seed)) ** 2, axis=0, dtype=np.float64)
        return np.asarray(10.0 * np.log10(np.maximum(power, np.finfo(np.float32).tiny)), np.float32)

    def looks(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> Iterator[Looks]:
        """Complex looks, as :meth:`radcal.simulators.base.Looks.looks` specifies."""
        yield from self._summed(parameters, noise_seed)

    def _summed(self, parameters: Mapping[str, Sequence[float]], seed: int) -> Looks:
        """Complex looks of all materials, shape (looks, rows, columns)."""
        case, scene = self._flown.case, self._flown.scene
        tables = law_tables(scene.names, case.laws, parameters)
        changing = np.array([False, *(name in case.calibrated for name in scene.names), False])[:, None]

        def unchanged() -> Looks:
            nothing = Scatterers(np.empty((0, 3)), np.empty(0, np.complex64))
            noise = focused(self._one, RawSignal(self._one, nothing, seed)[:], self._flown)
            incidence = self._flown.geometry.flat_incidence_deg
            level = 10.0 ** (nesz_db(case.radar, incidence) / 10.0) / nesz(self._one, rows_m(self._flown), incidence)
            return self._focused(tables * ~changing, seed) + noise * np.sqrt(level).astype(np.float32)[:, None]

        # the tables say all of laws and parameters
        fixed = hashlib.sha256(tables * ~changing).hexdigest()
        described = [self.identity, scene.identity, case.radar.described(), seed, fixed]
        looks = kept(self._folder, digest(described), unchanged)
        if changing.any():
            looks += self._focused(tables * changing, seed)
        return looks

    def _focused(self, tables: NDArray[np.float32], seed: int) -> Looks:
        one, found = replace(self._one, noise_m2=0.0), drawn_on(self._facets, tables, self._flown.case.radar, seed)
        return focused(one, RawSignal(one, found, seed)[:], self._flown)
