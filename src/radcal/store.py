"""The run store: one content-addressed HDF5 record per simulator run.

A record is named by the hash of all that determines its numbers: simulator identity,
scene, pass, law and parameters of every material, noise seed. Every stage that needs a run
asks the store first; a run that is there is never made again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.config import Case, Material, Radar
from radcal.disclosure import disclosed
from radcal.errors import DamagedError, SimulatorError, StoreError
from radcal.files import digest
from radcal.intake import elsewhere
from radcal.lock import claimed
from radcal.radar.laws import EXTERNAL
from radcal.records import inspect, is_sealed, set_aside, write_hdf5
from radcal.simulators.protocol import Simulator

if TYPE_CHECKING:
    from radcal.radar.geometry import Geometry

__all__ = ["Parameters", "Record", "RunStore", "Runner"]

_UNSEALED = 1  # the schema of records of the time before files had checksums of their own
Parameters = Mapping[str, Sequence[float]]

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Record:
    """Result of one run.

    Attributes
    ----------
    key : str
        Hash of the run.
    pixels_db : mapping
        Material to the backscatter [dB, float32] of its visible pixels, in the order of
        ``Geometry.pixels(material)``.
    image_db : ndarray of float32 or None
        Whole image [dB], where it was kept.
    seconds : float
        Wall time of the simulator.
    """

    key: str
    pixels_db: Mapping[str, NDArray[np.float32]]
    image_db: NDArray[np.float32] | None
    seconds: float

    def largest_difference_db(self, other: Record) -> float:
        """Largest absolute difference between the pixels of this run and another's [dB]."""
        each = [np.max(np.abs(values - other.pixels_db[name]), initial=0.0) for name, values in self.pixels_db.items()]
        return float(max(each, default=0.0))


def _checksum(pixels_db: Mapping[str, NDArray[np.float32]], image_db: NDArray[np.float32] | None) -> str:
    """SHA-256 of the numbers of a record that has no other checksum."""
    total = hashlib.sha256()
    for name in sorted(pixels_db):
        total.update(name.encode())
        total.update(np.ascontiguousarray(pixels_db[name], dtype="<f4").tobytes())
    if image_db is not None:
        total.update(np.ascontiguousarray(image_db, dtype="<f4").tobytes())
    return total.hexdigest()


class RunStore:
    """Records in a folder, one file each.

    Parameters
    ----------
    folder : path
        ``results/<case>/runs``.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def path(self, key: str) -> Path:
        """File of a record."""
        return self.folder / f"{key}.h5"

    def get(self, key: str, materials: Iterable[str], image: bool = False) -> Record | None:
        """Return a record if it is there and holds what is asked, else None.

        A damaged file is set aside under the name ``*.damaged`` and counts as missing. Records of schema 1,
        which have a checksum of their numbers only, are read like others.

        Raises
        ------
        StoreError
            The file is sound as far as one can tell but cannot be read: no permission, a
            failing disk, another version's.
        """
        record = self._read(key)
        if record is None or not set(materials) <= record.pixels_db.keys() or (image and record.image_db is None):
            return None
        return record

    def _read(self, key: str) -> Record | None:
        path = self.path(key)
        try:
            number = path.stat().st_ino
            sealed = is_sealed(path)
            if sealed:
                inspect(path, "run")
            # records never change once they are visible: no lock is needed to read one
            with h5py.File(path, "r", locking=False) as file:
                if not sealed and (outside := elsewhere(file)) is not None:
                    raise KeyError(outside)
                if not sealed and file.attrs["schema"] != _UNSEALED:
                    raise KeyError("schema")
                if file.attrs["hash"] != key:
                    raise KeyError("hash")
                pixels = {name: item[()] for name, item in file["pixels_db"].items()}
                whole = file["image_db"][()] if "image_db" in file else None
                seconds = float(file.attrs["seconds"])
                if not sealed and file.attrs["checksum"] != _checksum(pixels, whole):
                    raise KeyError("checksum")
        except FileNotFoundError:
            return None
        except DamagedError as error:
            logger.warning("%s", error)
            return None
        except (OSError, KeyError, RuntimeError, TypeError, ValueError, AttributeError) as error:
            # what h5py raises on a damaged file depends on where the damage is; an error number is
            # the system's word that the file could not be reached
            if isinstance(error, OSError) and error.errno is not None:
                raise StoreError(
                    f"{path}: cannot be read ({os.strerror(error.errno)}); nothing was changed."
                ) from error
            logger.warning("%s", set_aside(path, f"is damaged ({error})", number))
            return None
        return Record(key, pixels, whole, seconds)

    def description(self, key: str) -> dict[str, Any]:
        """Description of a record (:meth:`Runner.description`), with hashes in place of secrets.

        Raises
        ------
        StoreError
            There is no such record, or it cannot be read.
        """
        if self._read(key) is None:
            raise StoreError(f"{self.path(key)}: is missing; type the same command again to have it made.")
        try:
            with h5py.File(self.path(key), "r", locking=False) as file:
                return disclosed(json.loads(str(file.attrs["description"])))
        except (OSError, KeyError, ValueError) as error:
            raise StoreError(f"{self.path(key)}: cannot be read ({error}).") from None

    def put(self, record: Record, description: Mapping[str, Any]) -> None:
        """Write a record; it becomes visible complete, with what an earlier one of the same run held besides."""
        earlier = self._read(record.key)
        if earlier is not None:
            image = record.image_db if record.image_db is not None else earlier.image_db
            record = Record(record.key, {**earlier.pixels_db, **record.pixels_db}, image, record.seconds)
        with write_hdf5(self.path(record.key), "run") as file:
            file.attrs["hash"] = record.key
            file.attrs["description"] = json.dumps(disclosed(description), sort_keys=True)
            file.attrs["seconds"] = record.seconds
            file.attrs["unit"] = "dB"
            for name, values in record.pixels_db.items():
                file.create_dataset(f"pixels_db/{name}", data=values, dtype="f4", compression="gzip")
            if record.image_db is not None:
                file.create_dataset(
                    "image_db", data=record.image_db, dtype="f4", compression="gzip", compression_opts=1
                )


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
    case : Case
        Pass, laws and materials to record.
    """

    def __init__(
        self, store: RunStore, simulator: Simulator, geometry: Geometry, scene_identity: str, case: Case
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
