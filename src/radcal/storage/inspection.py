"""Inspection of files that radcal wrote, before they are parsed: checksum, kind, schema version and case.

The checksum is compared first, because a damaged file can crash the HDF5 library. A file that fails the inspection is
renamed by a command that makes it again, and stays as it is for one that only reads results; none is deleted.
"""

from __future__ import annotations

import os
from numbers import Integral
from pathlib import Path
from typing import Any

import h5py

from radcal.config.stages import SCHEMAS
from radcal.errors import DamagedError, RenamedFile, StoreError
from radcal.reading.intake import elsewhere
from radcal.storage.provenance import origin
from radcal.storage.sealing import Fault, check_hdf5, check_json


def inspect(path: str | Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Inspect a file; rename the file to ``*.damaged`` if it is damaged, or of another kind, version or case.

    An undamaged file of an earlier version is renamed to ``*.earlier``. Outside of a command on a case
    (:func:`.provenance`), only records of runs are renamed.

    Parameters
    ----------
    path : path
        Path of the file.
    kind : str or None
        Expected kind of an HDF5 file, a key of :data:`~radcal.config.stages.SCHEMAS`; None for a JSON file.
    most_bytes : int, optional
        Largest size of a file whose content is compared with its checksum [bytes]. In a larger file, only header and
        size are checked.

    Raises
    ------
    DamagedError
        The file is damaged, or of another kind, version or case; it was renamed.
    StoreError
        The file is missing or cannot be read; it was not renamed.
    """
    path = Path(path)
    try:
        number = path.stat().st_ino
        try:
            inspect_file(path, kind, most_bytes)
        except Fault as fault:
            if kind != "run" and origin().case is None:
                again = "type the command of its case again to have it made again (finished runs are kept)."
                raise DamagedError(f"{path}: {fault}; nothing was changed; {again}") from None
            raise set_aside(path, str(fault), number, path.with_suffix(fault.suffix)) from None
    except OSError as error:
        raise unreachable(path, error) from error


def unreachable(path: Path, error: OSError) -> StoreError:
    """StoreError about a file that the operating system cannot open or read."""
    if isinstance(error, FileNotFoundError):
        return StoreError(f"{path}: is missing; type the command of its case again to have it made.")
    reason = os.strerror(error.errno) if error.errno is not None else error
    return StoreError(f"{path}: cannot be read ({reason}); nothing was changed.")


def set_aside(path: Path, reason: str, number: int | None = None, aside: Path | None = None) -> DamagedError:
    """Rename a faulty file and return an error that states the reason and the new name.

    Parameters
    ----------
    path : path
        Path of the file.
    reason : str
        Fault of the file, as the predicate of a sentence about the file, such as "is damaged".
    number : int, optional
        Inode of the faulty file. If ``path`` now has another inode, a new file has replaced the faulty file, and no
        file is renamed.
    aside : path, optional
        New path of the file; by default ``path`` with the suffix ``.damaged``.
    """
    aside = aside or path.with_suffix(".damaged")
    try:
        if number is None or path.stat().st_ino == number:
            path.replace(aside)
    except FileNotFoundError:
        pass  # another job has already renamed the file
    except OSError as error:
        return DamagedError(
            f"{path}: {reason}, and cannot be set aside ({error.strerror}); remove it and type the same command again."
        )
    what = f"{path}: {reason}; set aside as {aside.name}"
    remedy = "type the same command again to have it made again (finished runs are kept)."
    return DamagedError(f"{what}; {remedy}", RenamedFile(what))


def inspect_file(path: Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Inspect a file without renaming it; the parameters are those of :func:`inspect`.

    Raises
    ------
    Fault
        The file is damaged, or of another kind, version or case.
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
            return
        check_hdf5(handle, size, whole)
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: file.attrs.get(name) for name in ("kind", "schema", "case", "hash")}
            outside = elsewhere(file)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # an error number comes from the operating system: the file cannot be read
        # this error occurs only if the content was not compared with the checksum
        raise Fault(f"is damaged ({error})") from None
    if outside is not None:
        raise Fault(f"is not what radcal wrote ({outside})")
    if found["kind"] != kind:
        raise Fault(f"is a file of kind {found['kind']!r}, expected {kind!r}")
    if kind == "run" and found["schema"] != SCHEMAS[kind]:
        # a run record of another version is not renamed, because the other version can still read the record
        raise StoreError(
            f"{path}: written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}; use the radcal that "
            "wrote it, or another case name."
        )
    if found["schema"] != SCHEMAS[kind]:
        text = f"was written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}"
        if isinstance(found["schema"], Integral) and int(found["schema"]) < SCHEMAS[kind]:
            raise Fault(f"is of an earlier version of radcal: it {text}", ".earlier")
        raise Fault(text)
    # the key alone identifies a run, so that every case may use its record
    if kind != "run":
        check_case(found["case"])
    elif found["hash"] != path.stem:
        raise Fault(f"holds the run {found['hash']}, expected {path.stem}")


def check_case(found: Any) -> None:
    """Compare the case name recorded in a file with the case of this job; an unknown name matches every case.

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
        No HDF5 file of a results folder has this name.
    """
    path = Path(path)
    if path.suffix == ".json":
        return None
    folders = {"runs": "run", "draws": "run", "posterior": "posterior", "strips": "geometry"}
    kind = folders.get(path.parent.name, path.stem)
    if kind not in SCHEMAS:
        raise KeyError(kind)
    return kind
