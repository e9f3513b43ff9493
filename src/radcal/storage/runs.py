"""Run store: one HDF5 record per simulator run, named after a hash of all inputs of the run.

The inputs are simulator identity, scene, pass, law and parameters of every material, and noise seed. Every stage that
needs a run first looks up the run's record in the store. A recorded run is therefore never simulated again.
"""

from __future__ import annotations

import contextlib
import json
import logging
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.config.disclosure import disclosed
from radcal.errors import DamagedError
from radcal.storage.inspection import inspect, set_aside, unreachable
from radcal.storage.records import read_hdf5, write_hdf5

Parameters = Mapping[str, Sequence[float]]

logger = logging.getLogger(__name__)

_TIMED = 50  # most records of which the median time is taken


@dataclass(frozen=True)
class Record:
    """Result of one simulator run in one pass, as the run store keeps it.

    Attributes
    ----------
    key : str
        Hash of the run.
    pixels_db : mapping of str to ndarray of float32
        Backscatter of the visible pixels by material [dB], in the order of ``Geometry.pixels(material)``.
    image_db : ndarray of float32 or None
        Whole image [dB]; None if the image was not recorded.
    seconds : float
        Wall time of the simulator [s].
    draws : tuple of Record
        Records of further speckle draws with the same parameters, each with a separate file in the run store.
    """

    key: str
    pixels_db: Mapping[str, NDArray[np.float32]]
    image_db: NDArray[np.float32] | None
    seconds: float
    draws: tuple[Record, ...] = ()

    def largest_difference_db(self, other: Record) -> float:
        """Largest absolute difference between the pixels of this run and those of another run [dB]."""
        each = [np.max(np.abs(values - other.pixels_db[name]), initial=0.0) for name, values in self.pixels_db.items()]
        return float(max(each, default=0.0))


class RunStore:
    """Folder of run records, with one file for each run.

    Parameters
    ----------
    folder : path
        Folder ``results/<case>/runs``.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def path(self, key: str) -> Path:
        """Path of the record of the run with the hash ``key``."""
        return self.folder / f"{key}.h5"

    def get(self, key: str, materials: Iterable[str], image: bool = False) -> Record | None:
        """Record of the run with the hash ``key``; None if the store lacks the record or a requested part of it.

        A damaged file is renamed to ``*.damaged`` and counts as missing.

        Parameters
        ----------
        key : str
            Hash of the run.
        materials : iterable of str
            Materials whose pixels the record must contain.
        image : bool
            Whether the record must contain the whole image.

        Raises
        ------
        StoreError
            The file is not known to be damaged but cannot be read: permission is missing, the disk failed, or another
            version of radcal wrote the file.
        """
        record = self._read(key)
        if record is None or not set(materials) <= record.pixels_db.keys() or (image and record.image_db is None):
            return None
        return record

    def _read(self, key: str) -> Record | None:
        path = self.path(key)
        try:
            number = path.stat().st_ino
            inspect(path, "run")
            # no lock is needed, because a record never changes after its file was renamed to this path
            with h5py.File(path, "r", locking=False) as file:
                pixels = {name: item[()] for name, item in file["pixels_db"].items()}
                whole = file["image_db"][()] if "image_db" in file else None
                seconds = float(file.attrs["seconds"])
        except FileNotFoundError:
            return None
        except OSError as error:
            raise unreachable(path, error) from error
        except (DamagedError, KeyError, RuntimeError, TypeError, ValueError, AttributeError) as error:
            damaged = isinstance(error, DamagedError)
            logger.warning("%s", error if damaged else set_aside(path, f"is damaged ({error})", number))
            return None
        return Record(key, pixels, whole, seconds)

    def description(self, key: str) -> dict[str, Any]:
        """Description of a recorded run (:meth:`Runner.description`), with hashes in place of environment variables.

        Raises
        ------
        StoreError
            The record is missing or cannot be read.
        """
        with read_hdf5(self.path(key), "run") as file:
            return disclosed(json.loads(str(file.attrs["description"])))

    def put(self, record: Record, description: Mapping[str, Any]) -> None:
        """Write a record atomically.

        If the store has an earlier record of the run, the new record keeps the materials and the image that only the
        earlier record contains.
        """
        earlier = self._read(record.key)
        if earlier is not None:
            image = record.image_db if record.image_db is not None else earlier.image_db
            record = Record(record.key, {**earlier.pixels_db, **record.pixels_db}, image, record.seconds)
        with write_hdf5(self.path(record.key), "run") as file:
            file.attrs["hash"] = record.key
            file.attrs["description"] = json.dumps(disclosed(description), sort_keys=True)
            file.attrs["seconds"] = record.seconds
            file.attrs["unit"] = "dB"
            file.create_group("pixels_db")  # empty in a forward run, which calibrates nothing
            for name, values in record.pixels_db.items():
                file.create_dataset(f"pixels_db/{name}", data=values, dtype="f4", compression="gzip")
            if record.image_db is not None:
                file.create_dataset(
                    "image_db", data=record.image_db, dtype="f4", compression="gzip", compression_opts=1
                )


def median_seconds(folder: str | Path) -> float | None:
    """Median wall time of at most 50 runs of a folder of records [s]; None without a readable record.

    Parameters
    ----------
    folder : path
        Folder ``results/<case>/runs``, which need not exist.
    """
    seconds = []
    for path in sorted(Path(folder).glob("[!.]*.h5"))[:_TIMED]:  # named by hashes, so that the first are any
        with contextlib.suppress(OSError, KeyError, ValueError, TypeError), h5py.File(path, "r", locking=False) as file:
            seconds.append(float(file.attrs["seconds"]))
    return statistics.median(seconds) if seconds else None
