"""Writers and readers of HDF5 and JSON files with schema version, provenance and checksum.

Files are written atomically and inspected before they are read. ``docs/records.md`` documents the layout of the files.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import platform
import shutil
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import h5py
from pydantic import ConfigDict, TypeAdapter, ValidationError

from radcal.config.stages import SCHEMAS
from radcal.errors import StoreError
from radcal.storage.dataclass_groups import put, take
from radcal.storage.files import atomic, file_sha256
from radcal.storage.inspection import check_case, inspect, inspect_file, set_aside, unreachable
from radcal.storage.provenance import origin
from radcal.storage.sealing import BLOCK, Fault, header

T = TypeVar("T")

CHECKSUMS = "checksums"
"""Key of a JSON list of the checksums of files whose format leaves no place for one."""
_PACKAGES = ("numpy", "scipy", "h5py")
version = functools.cache(metadata.version)  # each call parses a file, and a record makes four


class _Partial(io.FileIO):
    """Temporary file of HDF5, whose failed writes are raised by :meth:`check`, after HDF5 has closed the file.

    On a full disk, HDF5 would repeat the failed write of its buffers, and each attempt would raise an exception that
    cannot be caught.
    """

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all bytes; the system's call writes at most 2 GiB."""
        rest = memoryview(data).cast("B")
        total = len(rest)
        try:
            while rest:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.failure = self.failure or error
        return total

    def check(self) -> None:
        """Raise the error of the first failed write."""
        if self.failure is not None:
            raise self.failure

    def sha256(self) -> str:
        """SHA-256 of all bytes after the user block."""
        self.seek(BLOCK)
        return hashlib.file_digest(self, "sha256").hexdigest()


@contextlib.contextmanager
def write_hdf5(path: str | Path, kind: str) -> Iterator[h5py.File]:
    """Yield a new HDF5 file, which is written to ``path`` with checksum and provenance after the ``with`` block.

    If ``path`` already has the same content, the earlier bytes are kept, including the provenance; only the time stamp
    changes. Snakemake then finds no change, and does not repeat the jobs that depend on the file.

    Parameters
    ----------
    path : path
        Path of the file.
    kind : str
        Kind of the file, one of the keys of :data:`~radcal.config.stages.SCHEMAS`.

    Raises
    ------
    StoreError
        The file cannot be written.
    """
    path = Path(path)
    with atomic(path) as partial, _Partial(partial, "w+") as made:
        try:
            with h5py.File(made, "w", userblock_size=BLOCK, alignment_threshold=4096, alignment_interval=64) as file:
                file.attrs["kind"] = kind
                file.attrs["schema"] = SCHEMAS[kind]
                if (case := origin().case) is not None:
                    file.attrs["case"] = case
                yield file
        finally:
            made.check()
        content = made.sha256()
        if _holds(path, kind, content):
            made.close()
            shutil.copyfile(path, partial)
            return
        with h5py.File(made, "r+") as file:
            file.attrs["content"] = content
            file.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
            file.attrs["radcal"] = version("radcal")
            if "versions" not in file.attrs:
                versions = {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}
                file.attrs["versions"] = json.dumps(versions)
            config = origin().config
            if config is not None and "config" not in file.attrs:
                # a dataset, because HDF5 limits the size of attributes
                file["config"] = json.dumps(config, sort_keys=True, default=str)
        total, size = made.sha256(), made.tell()
        made.seek(0)
        made.write(header(total, size))
        made.check()


@contextlib.contextmanager
def plain_hdf5(path: str | Path) -> Iterator[h5py.File]:
    """Yield a new HDF5 file for other programs, without checksum and provenance, which is then written to ``path``.

    Raises
    ------
    StoreError
        The file cannot be written.
    """
    with atomic(path) as partial, _Partial(partial, "w+") as made:
        try:
            with h5py.File(made, "w") as file:
                yield file
        finally:
            made.check()


def _holds(path: Path, kind: str, content: str) -> bool:
    """Whether the file at ``path`` is undamaged, of the given kind, and its content has the given digest."""
    with contextlib.suppress(Fault, OSError):
        inspect_file(path, kind)
        with h5py.File(path, "r", locking=False) as file:
            return bool(file.attrs.get("content") == content)
    return False


@contextlib.contextmanager
def read_hdf5(path: str | Path, kind: str) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading after its checksum, kind, schema version and case have been checked.

    Parameters
    ----------
    path : path
        Path of a file written by :func:`write_hdf5`.
    kind : str
        Expected kind of the file, one of the keys of :data:`~radcal.config.stages.SCHEMAS`.

    Raises
    ------
    DamagedError
        The file is damaged, or of another kind, version or case; it was renamed to ``*.damaged`` or ``*.earlier``.
    StoreError
        The file is missing, cannot be read, or holds other contents than radcal writes; it was not renamed.
    """
    path = Path(path)
    inspect(path, kind)
    # no lock is needed, because a file never changes after it has been renamed to this path
    with understood(path), h5py.File(path, "r", locking=False) as file:
        yield file


def write_json(path: str | Path, data: Any, flat: bool = False) -> None:
    """Write plain data to a JSON file with a checksum, atomically.

    The file contains neither a time nor a version of radcal. Equal data therefore give equal bytes, and Snakemake does
    not repeat the jobs that depend on the file.

    Parameters
    ----------
    path : path
        Path of the file.
    data : plain data
        Content of the file, written under the key ``data``.
    flat : bool
        Whether ``data`` is a mapping whose keys become keys of the file's top level, instead of the key ``data``.

    Raises
    ------
    StoreError
        The file cannot be written.
    ValueError
        A number is NaN or infinite.
    """
    case = origin().case
    outer: dict[str, Any] = dict(data) if flat else {**({"case": case} if case is not None else {}), "data": data}
    rest = json.dumps(outer, indent=1, allow_nan=False).removeprefix("{\n") + "\n"
    with atomic(path) as partial:
        total = hashlib.sha256(rest.encode()).hexdigest()
        partial.write_text(f'{{\n "sha256": "{total}",\n{rest}', encoding="utf-8")


def write_listing(path: str | Path, files: Iterable[str | Path]) -> None:
    """Write a JSON list with the SHA-256 checksum of each given file.

    Parameters
    ----------
    path : path
        Path of the list. One workflow rule must write both the listed files and the list. Snakemake then removes both
        before the rule runs again, so that the list always belongs to the present files.
    files : iterable of path
        Files in the folder of the list or in its subfolders.

    Raises
    ------
    StoreError
        The list cannot be written.
    """
    folder = Path(path).parent
    write_json(
        path, {CHECKSUMS: {Path(file).relative_to(folder).as_posix(): file_sha256(Path(file)) for file in files}}
    )


def read_json(path: str | Path) -> Any:
    """Read the data from a JSON file written by :func:`write_json`.

    Raises
    ------
    DamagedError
        The file is damaged, or of another case; it was renamed to ``*.damaged``.
    StoreError
        The file is missing, cannot be read, or is no JSON; it was not renamed.
    """
    path = Path(path)
    inspect(path, None)
    try:
        with understood(path):
            outer = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreachable(path, error) from error
    del outer["sha256"]
    if "data" not in outer:
        return outer
    try:
        check_case(outer.get("case"))
    except Fault as fault:
        raise set_aside(path, str(fault)) from None
    return outer["data"]


@contextlib.contextmanager
def understood(path: str | Path) -> Iterator[None]:
    """Context that uses the contents of an undamaged file, and raises a StoreError if they are not what radcal writes.

    Parameters
    ----------
    path : path
        Path of the file, for the error message.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise StoreError(
            f"{path}: holds other contents than radcal writes ({what}): use the version of radcal that wrote it, or "
            "delete the file and type the command of its case again to make it again (finished runs are kept)."
        ) from error


def from_json(kind: type[T], data: Any, path: str | Path) -> T:
    """Dataclass, or list or mapping of dataclasses, from the data of a JSON file.

    Parameters
    ----------
    kind : type
        Type of the result, such as ``list[Run]``; numbers and texts must have exactly the types of its fields.
    data : plain data
        Data of the file; keys of fields with a default may be missing.
    path : path
        Path of the file, for the error message.

    Raises
    ------
    StoreError
        The data have an unknown key, lack a key, or have a value of another type than its field.
    """
    try:
        found: T = _adapter(kind).validate_json(json.dumps(data))  # type: ignore[arg-type]
        return found
    except ValidationError as error:
        first = error.errors()[0]
    with understood(path):
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}, found {first['input']!r:.40}")


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind, config=ConfigDict(extra="forbid", strict=True))


def write_item(path: str | Path, kind: str, item: Any) -> None:
    """Write a dataclass to an HDF5 file of a kind, atomically."""
    with write_hdf5(path, kind) as file:
        put(file, item)


def read_item(path: str | Path, kind: str, cls: type[T]) -> T:
    """Read what :func:`write_item` wrote; raises the errors of :func:`.read_hdf5`."""
    with read_hdf5(path, kind) as file:
        return take(file, cls)
