"""Run store: one HDF5 record per simulator run, named after a hash of all inputs of the run; and indexes of runs.

The inputs are simulator identity, scene, pass, law and parameters of every material, and noise seed. Every stage that
needs a run first looks up the run's record in the store. A recorded run is therefore never simulated again. An index is
a JSON list of runs in the store, with the hash and the parameters of each run.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import h5py
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from radcal.config.disclosure import disclosed
from radcal.errors import DamagedError, StoreError
from radcal.storage.records import (
    from_json,
    inspect,
    read_hdf5,
    read_json,
    set_aside,
    unreachable,
    write_hdf5,
    write_json,
)

Parameters = Mapping[str, Sequence[float]]

logger = logging.getLogger(__name__)

_TIMED = 50  # most records of which the median time is taken
Key = Annotated[str, Field(pattern=r"^\w+$")]  # a file name, which stays below the folder of the runs


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

    @property
    def draws_s(self) -> float:
        """Wall time of the simulator for all draws [s]."""
        return self.seconds + sum(draw.seconds for draw in self.draws)

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


@dataclass(frozen=True)
class IndexedRun:
    """Entry of an index, for one run in the run store.

    Attributes
    ----------
    key : str
        Hash of the run, which is also the file name of its record.
    parameters : mapping
        Law parameters X by material.
    difference_db : float or None
        For a repeated reference run, largest difference of its pixels from the first reference run [dB]; else None.
    draws : tuple of str
        Hashes of the records of the run's further speckle draws.
    """

    key: Key
    parameters: Parameters
    difference_db: float | None = None
    draws: tuple[Key, ...] = ()

    @classmethod
    def of(cls, record: Record, parameters: Parameters, difference_db: float | None = None) -> IndexedRun:
        """Index entry of the run to which a stored record belongs."""
        return cls(record.key, parameters, difference_db, tuple(draw.key for draw in record.draws))


def write_index(path: str | Path, runs: Iterable[IndexedRun]) -> None:
    """Write an index to a JSON file; empty fields are omitted."""
    write_json(path, [{name: value for name, value in asdict(run).items() if value not in (None, ())} for run in runs])


def read_index(path: str | Path) -> list[IndexedRun]:
    """Read an index written by :func:`write_index`.

    Raises
    ------
    StoreError
        The file is missing or damaged, or holds no index.
    """
    return from_json(list[IndexedRun], read_json(path), path)


def indexed(
    files: Iterable[str | Path], runs: str | Path, materials: Sequence[str], image: bool = False
) -> Iterator[tuple[Record, Parameters]]:
    """Iterator over records and parameters of all runs listed in several indexes, in the order of the indexes.

    Parameters
    ----------
    files : iterable of path
        Paths of the indexes.
    runs : path
        Folder of the run store.
    materials : sequence of str
        Materials whose pixels each record must contain.
    image : bool
        Whether each record must also contain the whole image.

    Raises
    ------
    StoreError
        The store lacks a listed run, or the record of a listed run lacks a material or the image.
    """
    store = RunStore(runs)
    for file in files:
        for run in read_index(file):
            draws = tuple(record_of(store, file, key, materials) for key in run.draws)
            yield replace(record_of(store, file, run.key, materials, image), draws=draws), run.parameters


def in_all_passes(passes: Iterable[Iterable[tuple[Record, Parameters]]]) -> Iterator[tuple[list[Record], Parameters]]:
    """Records of each run in all passes, from the records of all runs in each pass.

    Raises
    ------
    StoreError
        The passes differ in the parameters or in the number of their runs.
    """
    for found in itertools.zip_longest(*passes, fillvalue=(None, None)):
        records, each = zip(*found, strict=True)
        if any(parameters != each[0] for parameters in each):
            raise StoreError("the indexes of the passes list runs of different parameters; delete them and type again.")
        yield list(records), each[0]


def record_of(store: RunStore, file: str | Path, key: str, materials: Sequence[str], image: bool = False) -> Record:
    """Record of a run that the index ``file`` lists; a missing record raises a StoreError."""
    record = store.get(key, materials, image)
    if record is None:
        wanted = ", ".join([*materials, *["the whole image"] * image])
        raise StoreError(
            f"{store.path(key)}: missing, damaged or without {wanted}, though {file} lists it; delete {file} and type "
            "the same command again to make this run again."
        )
    return record
