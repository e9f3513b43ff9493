"""Indexes of runs: JSON lists of runs in the run store, with the hash and the parameters of each run."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from radcal.errors import StoreError
from radcal.storage.records import from_json, read_json, write_json
from radcal.storage.runs import Parameters, Record, RunStore

Key = Annotated[str, Field(pattern=r"^\w+$")]  # a file name, which stays below the folder of the runs


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
