"""Inspection of radcal's own files before they are parsed: checksum, kind, schema version and case.

A damaged HDF5 file can crash the HDF5 library, therefore the checksum is compared first. A file that fails the
inspection is renamed, never deleted.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py

from radcal.errors import DamagedError, StoreError
from radcal.reading.intake import elsewhere
from radcal.storage.provenance import origin
from radcal.storage.sealing import Fault, check_hdf5, check_json

__all__ = ["SCHEMAS", "check_case", "inspect", "inspect_file", "kind_of", "set_aside", "unreachable"]

SCHEMAS: Mapping[str, int] = {
    "scene": 2,
    "geometry": 5,
    "measurement": 2,
    "registered": 2,
    "target": 5,
    "surrogate": 5,
    "run": 2,
    "calibration": 3,
}
"""Kinds of HDF5 files, and the schema version of each kind's layout."""


def inspect(path: str | Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Inspect a file; rename it to ``*.damaged`` if it is damaged or is not the file expected at its path.

    Parameters
    ----------
    path : path
        Path of the file.
    kind : str or None
        Kind expected, a key of :data:`SCHEMAS`; None for JSON.
    most_bytes : int, optional
        Largest size [bytes] of a file whose content is compared with its checksum. Header and size are compared in
        files of any size.

    Raises
    ------
    DamagedError
        The file is damaged, of another version or of another case; it was set aside.
    StoreError
        The file is missing or cannot be read; nothing was changed.
    """
    path = Path(path)
    try:
        number = path.stat().st_ino
        try:
            inspect_file(path, kind, most_bytes)
        except Fault as fault:
            raise set_aside(path, str(fault), number) from None
    except OSError as error:
        raise unreachable(path, error) from error


def unreachable(path: Path, error: OSError) -> StoreError:
    """Error for a file that the operating system cannot open or read."""
    if isinstance(error, FileNotFoundError):
        return StoreError(f"{path}: is missing; type the same command again to have it made.")
    reason = os.strerror(error.errno) if error.errno is not None else error
    return StoreError(f"{path}: cannot be read ({reason}); nothing was changed.")


def set_aside(path: Path, reason: str, number: int | None = None, aside: Path | None = None) -> DamagedError:
    """Rename a file to ``*.damaged`` and return an error that states the reason and the new name.

    Parameters
    ----------
    path : path
        Path of the file.
    reason : str
        Fault of the file, a clause with the file as its subject.
    number : int, optional
        Inode of the faulty file. A file with another inode, which has replaced it since, is not renamed.
    aside : path, optional
        New path, instead of the suffix ``.damaged``.
    """
    first = aside = aside or path.with_suffix(".damaged")
    while aside.exists() and (aside.is_dir() or path.is_dir()):  # a file may replace a file, but no folder
        aside = first.with_name(f"{first.name}-{int(aside.name.rpartition('-')[2]) + 1 if aside != first else 2}")
    try:
        if number is None or path.stat().st_ino == number:
            path.replace(aside)
        done = f"set aside as {aside.name}"
    except FileNotFoundError:  # another job was faster
        done = f"set aside as {aside.name}"
    except OSError as error:
        return DamagedError(
            f"{path}: {reason}, and cannot be set aside ({error.strerror}); remove it and type the same command again."
        )
    return DamagedError(
        f"{path}: {reason}; {done}; type the same command again to have it made again (finished runs are kept)."
    )


def inspect_file(path: Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Inspect a file without changing it; arguments as for :func:`inspect`.

    Raises
    ------
    Fault
        The file is damaged or is not the file expected there.
    StoreError
        The file is a run record of another schema version.
    OSError
        The file is missing or cannot be read.
    """
    if not path.is_file() and path.exists():
        raise Fault("is a folder or a device, expected a file")
    with path.open("rb") as handle:
        size = os.fstat(handle.fileno()).st_size
        whole = most_bytes is None or size <= most_bytes
        if kind is None:
            check_json(handle, whole)
        else:
            check_hdf5(handle, size, whole)
    if kind is None:
        return
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: file.attrs.get(name) for name in ("kind", "schema", "case", "hash")}
            outside = elsewhere(file)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # an error number comes from the operating system: the file cannot be read
        # reached only where the content was not compared with the checksum
        raise Fault(f"is damaged ({error})") from None
    if outside is not None:
        raise Fault(f"is not what radcal wrote ({outside})")
    if found["kind"] != kind:
        raise Fault(f"is a file of kind {found['kind']!r}, expected {kind!r}")
    if kind == "run" and found["schema"] != SCHEMAS[kind]:
        # a finished run of another version is not set aside, because that version can still read it
        raise StoreError(
            f"{path}: written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}; use the radcal that "
            "wrote it, or another case name."
        )
    if found["schema"] != SCHEMAS[kind]:
        raise Fault(f"was written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}")
    # a run is identified by its key alone, and any case may use it
    if kind != "run":
        check_case(found["case"])
    elif found["hash"] != path.stem:
        raise Fault(f"holds the run {found['hash']}, expected {path.stem}")


def check_case(found: Any) -> None:
    """Compare the case recorded in a file with the case of this job, where both are known.

    Raises
    ------
    Fault
        The two cases differ.
    """
    expected = origin().case
    if expected is not None and found is not None and found != expected:
        raise Fault(f"belongs to the case {found!r}, expected {expected!r}")


def kind_of(path: str | Path) -> str | None:
    """Kind of a file in a results folder, derived from the file's name; None for a JSON file.

    Raises
    ------
    KeyError
        The name is not that of an HDF5 file of a results folder.
    """
    path = Path(path)
    if path.suffix == ".json":
        return None
    kind = "run" if path.parent.name == "runs" else path.stem
    if kind not in SCHEMAS:
        raise KeyError(kind)
    return kind
