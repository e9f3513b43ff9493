"""Simulator behind the run store: a recorded run is read, a new one is simulated and recorded."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from radcal.config import Material, Radar, stages
from radcal.errors import SimulatorError
from radcal.radar.laws import EXTERNAL
from radcal.simulators.protocol import Simulator
from radcal.storage.files import digest
from radcal.storage.lock import claimed
from radcal.storage.runs import Parameters, Record, RunStore

if TYPE_CHECKING:
    from radcal.radar.geometry import Geometry

__all__ = ["Runner"]


def _law_description(material: Material) -> dict[str, Any]:
    """Part of a run's description that names the law of a material, without its parameters."""
    description: dict[str, Any] = {"law": material.law}
    # each only where the law does not fix it: runs of other laws keep the keys they had before there were any
    if material.angles_deg:
        description["angles_deg"] = material.angles_deg
    if material.law == EXTERNAL:
        description["names"] = list(material.parameter_names)
    if any(material.integers):
        description["integer"] = [
            name for name, x in zip(material.parameter_names, material.integers, strict=True) if x
        ]
    return description


class Runner:
    """Simulator behind the run store: a recorded run is read, a new one is simulated and recorded.

    Parameters
    ----------
    store : RunStore
        Where the runs are.
    simulator : Simulator
        Called for runs that are not in the store.
    geometry : Geometry
        Pixels of the materials.
    scene_identity : str
        Digest of the scene.
    case : stages.Simulation
        Pass, laws and materials to record.
    """

    def __init__(
        self, store: RunStore, simulator: Simulator, geometry: Geometry, scene_identity: str, case: stages.Simulation
    ) -> None:
        self._store = store
        self._simulator = simulator
        self._geometry = geometry
        self._scene_identity = scene_identity
        self._radar: Radar = case.radar
        self._not_told = case.simulator.not_told
        self._fuller: dict[str, str] | None = None
        self._laws = {name: _law_description(material) for name, material in case.materials.items()}
        self._recorded = case.calibrated
        self._keep_images = case.simulator.keep_images

    def description(self, parameters: Parameters, noise_seed: int, repeat: bool = False) -> dict[str, Any]:
        """Plain data that determine a run's numbers; their digest is the run's key."""
        unknown = {"frequency_ghz"} if self._radar.frequency_ghz is None else set()  # keys as before there was one
        return {
            "simulator": dict(self._simulator.identity),
            "scene": self._scene_identity,
            "pass": self._radar.model_dump(mode="json", exclude=unknown | self._not_told),
            "materials": {
                name: {**law, "parameters": [float(x) for x in parameters[name]]} for name, law in self._laws.items()
            },
            "noise_seed": noise_seed,
            **({"repeat": True} if repeat else {}),
        }

    def without_masks(self, description: Mapping[str, Any]) -> dict[str, Any]:
        """Description without settings that this simulator does not receive, which earlier versions recorded."""
        told = {key: value for key, value in description.get("pass", {}).items() if key not in self._not_told}
        return {**description, "pass": told}

    def _find(self, key: str, image: bool) -> Record | None:
        """Record of a run, also under a key of an earlier version, with settings the simulator does not receive."""
        found = self._store.get(key, self._recorded, image)
        if found is not None or not self._not_told:
            return found
        if self._fuller is None:
            self._fuller = {}
            for path in sorted(self._store.folder.glob("[!.]*.h5")):
                # whether it is whole is asked where it is taken
                with contextlib.suppress(OSError, KeyError, ValueError), h5py.File(path, "r", locking=False) as file:
                    theirs = json.loads(str(file.attrs["description"]))
                    if theirs != (told := self.without_masks(theirs)):
                        self._fuller[digest(told)] = path.stem
        fuller = self._fuller.get(key)
        return None if fuller is None else self._store.get(fuller, self._recorded, image)

    def take(self, other: RunStore, key: str) -> bool:
        """Copy a record from another store unless this one has it; False where it lacks pixels that are recorded."""
        if self._store.get(key, self._recorded) is None:
            record = other.get(key, self._recorded)
            if record is None:
                return False
            self._store.put(record, other.description(key))
        return True

    def run(self, parameters: Parameters, noise_seed: int, image: bool = False, repeat: bool = False) -> Record:
        """Return the run of these parameters, simulating only if the store does not have it.

        Parameters
        ----------
        parameters : mapping
            Every material's parameters.
        noise_seed : int
            Seed of speckle and noise.
        image : bool
            Ask for the whole image too.
        repeat : bool
            Ask for a second run of the same parameters and seed, which has a record of its own.

        Raises
        ------
        SimulatorError
            The simulator's image has the wrong size or values that are not finite.
        """
        description = self.description(parameters, noise_seed, repeat)
        key = digest(description)
        found = self._found(key, image)
        if found is not None:
            return found
        with claimed(self._store.folder, key):
            # a job of a workflow that was killed may have been at this very run
            found = self._found(key, image)
            return found if found is not None else self._simulate(key, description, parameters, noise_seed, image)

    def _found(self, key: str, image: bool) -> Record | None:
        """Record of a run, None if its number of pixels is not that of this geometry."""
        record = self._find(key, image)
        if record is not None and any(record.pixels_db[name].size != n for name, n in self._sizes.items()):
            return None
        return record

    @cached_property
    def _sizes(self) -> Mapping[str, int]:
        return {name: self._geometry.pixels(name).size for name in self._recorded}

    def _simulate(
        self, key: str, description: Mapping[str, Any], parameters: Parameters, noise_seed: int, image: bool
    ) -> Record:
        """Simulate and record a run."""
        started = time.perf_counter()
        image_db = self._simulator.run(parameters, noise_seed)
        seconds = time.perf_counter() - started
        if image_db.shape != self._geometry.shape:
            raise SimulatorError(
                f"run {key}: the simulator's image has {image_db.shape} pixels, expected {self._geometry.shape}."
            )
        pixels = {name: image_db.ravel()[self._geometry.pixels(name)] for name in self._recorded}
        for name, values in pixels.items():
            if not np.isfinite(values).all():
                raise SimulatorError(
                    f"run {key}: {np.count_nonzero(~np.isfinite(values))} of {values.size} pixels of {name!r} are not "
                    f"finite at {name} = {list(parameters[name])}."
                )
        record = Record(key, pixels, image_db if image or self._keep_images else None, seconds)
        self._store.put(record, description)
        return record
