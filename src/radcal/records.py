"""HDF5 and JSON files with schema version, provenance and checksum.

An HDF5 file starts with a user block of 512 bytes, which HDF5 libraries skip. It holds the SHA-256 and the number
of all bytes that follow. A JSON file starts with the SHA-256 of what follows. Both are compared before anything is
parsed, because a damaged HDF5 file can crash the library that reads it.

Layout and attributes are documented in ``docs/records.md``.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import platform
import re
import shutil
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

import h5py

from radcal.disclosure import disclosed
from radcal.errors import ConfigError, DamagedError, StoreError
from radcal.files import atomic, first_difference
from radcal.intake import elsewhere

__all__ = [
    "REPLACE",
    "SCHEMAS",
    "inspect",
    "inspect_file",
    "is_sealed",
    "kind_of",
    "provenance",
    "read_hdf5",
    "read_json",
    "seal",
    "set_aside",
    "write_hdf5",
    "write_json",
]

SCHEMAS: Mapping[str, int] = {
    "scene": 2,
    "geometry": 5,
    "measurement": 1,
    "registered": 1,
    "target": 3,
    "surrogate": 3,
    "run": 2,
    "calibration": 2,
}
"""What kinds of HDF5 files there are, and the version of each one's layout."""

REPLACE = "RADCAL_REPLACE"
"""Environment variable that the Snakefile sets where finished results may be replaced by those of another scene."""

_BLOCK = 512  # the smallest user block that HDF5 allows [bytes]
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEADER = re.compile(rb"radcal sha256 ([0-9a-f]{64}) bytes (\d{1,18})\n\0+\Z")
_JSON_HEADER = re.compile(rb'\{\n "sha256": "([0-9a-f]{64})",\n')
_JSON_HEADER_BYTES = len('{\n "sha256": "",\n') + 64
_CHUNK = 1 << 20
_PACKAGES = ("numpy", "scipy", "h5py")


@dataclass(frozen=True)
class _Origin:
    case: str | None = None
    config: Mapping[str, Any] | None = None


_UNKNOWN = _Origin()
_origin: ContextVar[_Origin] = ContextVar("origin", default=_UNKNOWN)


class _Fault(Exception):
    """Why a file is not what was written."""


@contextlib.contextmanager
def provenance(case: str | None = None, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Every file written in the block says where it comes from; every file read must be of the same case.

    Parameters
    ----------
    case : str, optional
        Name of the case; without it files of any case are read.
    config : mapping, optional
        Sections of the configuration that the work depends on.
    """
    token = _origin.set(_Origin(case, disclosed(config) if config is not None else None))
    try:
        yield
    finally:
        _origin.reset(token)


@contextlib.contextmanager
def write_hdf5(path: str | Path, kind: str, track_order: bool = False, protected: bool = False) -> Iterator[h5py.File]:
    """Open a new HDF5 file that becomes visible under ``path`` only when complete, with checksum and provenance.

    If the file there holds the same already, it is left as it is but for its time stamp: what was made again
    without a difference keeps its first provenance, and for a later command of Snakemake, which compares contents,
    nothing that depends on it is out of date.

    Parameters
    ----------
    path : path
        The file.
    kind : str
        Key of :data:`SCHEMAS`.
    track_order : bool
        Groups are read back in the order in which they were made.
    protected : bool
        Refuse to change the file while a finished calibration that rests on it stands beside it, unless the
        environment variable :data:`REPLACE` is set.

    Raises
    ------
    ConfigError
        The file is protected.
    StoreError
        The folder or the disk refuses the file.
    """
    path = Path(path)
    # made in memory: on a full disk HDF5 tries again and again to write what it holds, with an exception each
    # time that nobody can catch
    made = io.BytesIO()
    with atomic(path) as partial:
        with h5py.File(made, "w", track_order=track_order, userblock_size=_BLOCK) as file:
            file.attrs["kind"] = kind
            file.attrs["schema"] = SCHEMAS[kind]
            if (case := _origin.get().case) is not None:
                file.attrs["case"] = case
            yield file
        content = hashlib.sha256(made.getbuffer()[_BLOCK:]).hexdigest()
        if protected and REPLACE not in os.environ:
            _protect(path, kind, content)
        if _holds(path, kind, content):
            shutil.copyfile(path, partial)
            return
        with h5py.File(made, "r+") as file:
            file.attrs["content"] = content
            file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
            file.attrs["radcal"] = version("radcal")
            if "versions" not in file.attrs:
                versions = {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
                file.attrs["versions"] = json.dumps(versions)
            config = _origin.get().config
            if config is not None and "config" not in file.attrs:
                # a dataset: HDF5 bounds the size of attributes
                file["config"] = json.dumps(config, sort_keys=True, default=str)
        with made.getbuffer() as whole:
            whole[:_BLOCK] = _header(hashlib.sha256(whole[_BLOCK:]).hexdigest(), len(whole))
            partial.write_bytes(whole)


def _protect(path: Path, kind: str, content: str) -> None:
    """Raise if a finished calibration rests on a file of other content."""
    if not (path.parent / "calibration.h5").is_file():
        return
    try:
        inspect_file(path, kind)
    except (_Fault, OSError, StoreError):
        return  # nothing that could be kept
    with h5py.File(path, "r", locking=False) as file:
        if file.attrs["content"] == content:
            return
        theirs = disclosed(json.loads(file["config"].asstr()[()])) if "config" in file else {}
        made_by = str(file.attrs["radcal"])
    ours = json.loads(json.dumps(_origin.get().config or {}, default=str))
    if theirs != ours:
        why = first_difference(theirs, ours)
    elif made_by != version("radcal"):
        why = f"it was made by radcal {made_by}, this is {version('radcal')}"
    else:
        why = "the files that it is made from are others"
    raise ConfigError(
        f"{path.parent} holds a finished calibration of another {kind} ({why}), which stays as it is: give this one a "
        "name of its own (case: ...), or add --config replace=true to have those results replaced (runs are kept)."
    )


def _header(total: str, size: int) -> bytes:
    """The first bytes of an HDF5 file of this size and this SHA-256 of the rest."""
    return f"radcal sha256 {total} bytes {size - _BLOCK}\n".encode().ljust(_BLOCK, b"\0")


def _holds(path: Path, kind: str, content: str) -> bool:
    """Whether a sound file of a kind has this content."""
    with contextlib.suppress(_Fault, OSError):
        inspect_file(path, kind)
        with h5py.File(path, "r", locking=False) as file:
            return bool(file.attrs.get("content") == content)
    return False


@contextlib.contextmanager
def read_hdf5(path: str | Path, kind: str) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading after its checksum, kind, schema and case have been compared.

    Parameters
    ----------
    path : path
        What :func:`write_hdf5` wrote.
    kind : str
        Key of :data:`SCHEMAS`.

    Raises
    ------
    DamagedError
        The file is damaged, of another version or of another case; it was set aside.
    StoreError
        It is missing or cannot be reached; nothing was changed.
    """
    path = Path(path)
    inspect(path, kind)
    # files never change once they are visible: no lock is needed to read one
    with h5py.File(path, "r", locking=False) as file:
        yield file


def inspect(path: str | Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Compare a file with what it says of itself; set it aside if it is something else.

    Parameters
    ----------
    path : path
        The file.
    kind : str or None
        Key of :data:`SCHEMAS`, None for JSON.
    most_bytes : int, optional
        Of larger files only header and size are compared.

    Raises
    ------
    DamagedError
        The file is damaged, of another version or of another case; it was set aside.
    StoreError
        It is missing or cannot be reached; nothing was changed.
    """
    path = Path(path)
    try:
        number = path.stat().st_ino
        try:
            inspect_file(path, kind, most_bytes)
        except _Fault as fault:
            raise set_aside(path, str(fault), number) from None
    except OSError as error:
        raise _unreachable(path, error) from error


def _unreachable(path: Path, error: OSError) -> StoreError:
    if isinstance(error, FileNotFoundError):
        return StoreError(f"{path}: is missing; type the same command again to have it made.")
    reason = os.strerror(error.errno) if error.errno is not None else error
    return StoreError(f"{path}: cannot be read ({reason}); nothing was changed.")


def set_aside(path: Path, reason: str, number: int | None = None, aside: Path | None = None) -> DamagedError:
    """Rename a file to ``*.damaged`` and return the error that says so.

    Parameters
    ----------
    path : path
        The file.
    reason : str
        What is wrong with it.
    number : int, optional
        Its inode: if another file has taken its place since, that one stays.
    aside : path, optional
        The new name, if it is another one.
    """
    first = aside = aside or path.with_suffix(".damaged")
    while aside.exists() and (aside.is_dir() or path.is_dir()):  # only a file takes the place of a file
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
    """Raise what is wrong with a file, without touching it."""
    if not path.is_file() and path.exists():
        raise _Fault("is a folder or a device, expected a file")
    with path.open("rb") as handle:
        size = os.fstat(handle.fileno()).st_size
        whole = most_bytes is None or size <= most_bytes
        if kind is None:
            _check_json(handle, whole)
        else:
            _check_hdf5(handle, size, whole)
    if kind is None:
        return
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = {name: file.attrs.get(name) for name in ("kind", "schema", "case", "hash")}
            outside = elsewhere(file)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the system's word that it cannot be reached
        # only where the whole was not compared
        raise _Fault(f"is damaged ({error})") from None
    if outside is not None:
        raise _Fault(f"is not what radcal wrote ({outside})")
    if found["kind"] != kind:
        raise _Fault(f"is a file of kind {found['kind']!r}, expected {kind!r}")
    if kind == "run" and found["schema"] != SCHEMAS[kind]:
        # a finished run of another version is not for this one to set aside
        raise StoreError(
            f"{path}: written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}; use the radcal that "
            "wrote it, or another case name."
        )
    if found["schema"] != SCHEMAS[kind]:
        raise _Fault(f"was written with schema {found['schema']}, this radcal reads {SCHEMAS[kind]}")
    # a run is what its key says, whichever case made it
    if kind != "run":
        _check_case(found["case"])
    elif found["hash"] != path.stem:
        raise _Fault(f"holds the run {found['hash']}, expected {path.stem}")


def _check_case(found: Any) -> None:
    expected = _origin.get().case
    if expected is not None and found is not None and found != expected:
        raise _Fault(f"belongs to the case {found!r}, expected {expected!r}")


def _check_hdf5(handle: IO[bytes], size: int, whole: bool) -> None:
    header = handle.read(_BLOCK)
    if header.startswith(_SIGNATURE):
        raise _Fault("has no checksum (an earlier version wrote it)")
    match = _HEADER.match(header) if len(header) == _BLOCK else None
    if match is None:
        raise _Fault("is damaged (its first 512 bytes are no header)")
    if size - _BLOCK != int(match[2]):
        raise _Fault(f"is damaged ({size - _BLOCK} bytes after the header, expected {int(match[2])})")
    if whole and _sha256(handle) != match[1].decode():
        raise _Fault("is damaged (its contents differ from its checksum)")


def _check_json(handle: IO[bytes], whole: bool) -> None:
    match = _JSON_HEADER.fullmatch(handle.read(_JSON_HEADER_BYTES))
    if match is None:
        raise _Fault("is damaged, or an earlier version wrote it (no checksum in its second line)")
    if whole and _sha256(handle) != match[1].decode():
        raise _Fault("is damaged (its contents differ from its checksum)")


def _sha256(handle: IO[bytes]) -> str:
    """SHA-256 of the rest of an open file."""
    total = hashlib.sha256()
    while chunk := handle.read(_CHUNK):
        total.update(chunk)
    return total.hexdigest()


def is_sealed(path: str | Path) -> bool:
    """Whether an HDF5 file has a checksum, which those of the first versions have not.

    Raises
    ------
    OSError
        It cannot be reached.
    """
    if not Path(path).is_file() and Path(path).exists():
        return True  # no file at all: that is for whoever inspects it to say
    with Path(path).open("rb") as handle:
        return handle.read(len(_SIGNATURE)) != _SIGNATURE


def seal(path: str | Path) -> None:
    """Write the checksum of a closed HDF5 file into its first 512 bytes.

    Parameters
    ----------
    path : path
        A file with a user block of 512 bytes; one that :func:`write_hdf5` made and that was changed on purpose.

    Raises
    ------
    OSError
        It cannot be read or written.
    """
    path = Path(path)
    with path.open("r+b") as handle:
        handle.seek(_BLOCK)
        header = _header(_sha256(handle), path.stat().st_size)
        handle.seek(0)
        handle.write(header)


def kind_of(path: str | Path) -> str | None:
    """Kind of a file of a results folder, by its name: None for JSON.

    Raises
    ------
    KeyError
        No such HDF5 file belongs there.
    """
    path = Path(path)
    if path.suffix == ".json":
        return None
    kind = "run" if path.parent.name == "runs" else path.stem
    if kind not in SCHEMAS:
        raise KeyError(kind)
    return kind


def write_json(path: str | Path, data: Any, flat: bool = False) -> None:
    """Write plain data as JSON with a checksum, atomically.

    It holds no time and no version: made again without a difference it is the same file byte for byte, and
    nothing that depends on it is out of date.

    Parameters
    ----------
    path : path
        The file.
    data : plain data
        Kept under the key ``data``.
    flat : bool
        The keys of ``data`` become those of the file.

    Raises
    ------
    StoreError
        The folder or the disk refuses the file.
    ValueError
        A number is NaN or infinite.
    """
    case = _origin.get().case
    outer: dict[str, Any] = dict(data) if flat else {**({"case": case} if case is not None else {}), "data": data}
    rest = json.dumps(outer, indent=1, allow_nan=False).removeprefix("{\n") + "\n"
    with atomic(path) as partial:
        total = hashlib.sha256(rest.encode()).hexdigest()
        partial.write_text(f'{{\n "sha256": "{total}",\n{rest}', encoding="utf-8")


def read_json(path: str | Path) -> Any:
    """Read what :func:`write_json` wrote.

    Raises
    ------
    DamagedError
        The file is damaged or of another case; it was set aside.
    StoreError
        It is missing or cannot be reached; nothing was changed.
    """
    path = Path(path)
    inspect(path, None)
    try:
        outer = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise _unreachable(path, error) from error
    del outer["sha256"]
    if "data" not in outer:
        return outer
    try:
        _check_case(outer.get("case"))
    except _Fault as fault:
        raise set_aside(path, str(fault)) from None
    return outer["data"]
