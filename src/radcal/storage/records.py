"""Writers and readers of HDF5 and JSON files with schema version, provenance and checksum.

Files are written atomically and inspected before they are read. ``docs/records.md`` documents the layout of the files.

The checksum is compared first, because a damaged file can crash the HDF5 library. A file that fails the inspection is
renamed by a command that makes it again, and stays as it is for one that only reads results; none is deleted.

An HDF5 file starts with a user block of 512 bytes, which HDF5 libraries skip. The user block contains the SHA-256 of
all bytes after the block, and the number of these bytes. The second line of a JSON file contains the SHA-256 of all
bytes after this line.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import os
import platform
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextvars import ContextVar
from datetime import UTC, datetime
from importlib import metadata
from numbers import Integral
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import h5py
from pydantic import ConfigDict, TypeAdapter, ValidationError

from radcal.config.disclosure import disclosed
from radcal.config.stages import SCHEMAS
from radcal.errors import DamagedError, RenamedFile, StoreError
from radcal.reading.intake import elsewhere
from radcal.storage.dataclass_groups import put, take
from radcal.storage.files import atomic, file_sha256

T = TypeVar("T")

CHECKSUMS = "checksums"
"""Key of a JSON list of the checksums of files whose format leaves no place for one."""
_PACKAGES = ("numpy", "scipy", "h5py")
version = functools.cache(metadata.version)  # each call parses a file, and a record makes four
BLOCK = 512
"""Length of the user block [bytes]; HDF5 allows no smaller user block."""

# first bytes of a file, with the SHA-256 of the rest and the number of its bytes; their length; text if they are others
_HDF5 = (
    re.compile(rb"radcal sha256 ([0-9a-f]{64}) bytes (\d{1,18})\n\0+"), BLOCK, "its first 512 bytes are no header",
)  # fmt: skip
_JSON = (
    re.compile(rb'\{\n "sha256": "([0-9a-f]{64})",\n'),
    len('{\n "sha256": "",\n') + 64,
    "no checksum in its second line",
)
_origin: ContextVar[tuple[str | None, dict[str, Any] | None]] = ContextVar("origin", default=(None, None))
"""Case name and configuration that are recorded in files written inside the present :func:`provenance` context."""


@contextlib.contextmanager
def provenance(case: str | None = None, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Context in which every written file records case and configuration, and files of another case are refused.

    Parameters
    ----------
    case : str, optional
        Name of the case. Without a name, files of every case can be read.
    config : mapping, optional
        Sections of the configuration that determine the content of the files.
    """
    token = _origin.set((case, disclosed(config) if config is not None else None))
    try:
        yield
    finally:
        _origin.reset(token)


class Fault(Exception):
    """Fault found in a file.

    Parameters
    ----------
    text : str
        Predicate of a sentence about the file, such as "is damaged".
    suffix : str
        Suffix of the name under which the file is set aside; ``.earlier`` for an undamaged file of an earlier version.
    """

    def __init__(self, text: str, suffix: str = ".damaged") -> None:
        super().__init__(text)
        self.suffix = suffix


def header(total: str, size: int) -> bytes:
    """Content of the user block of an HDF5 file of ``size`` bytes; ``total`` is the SHA-256 of all bytes after it."""
    return f"radcal sha256 {total} bytes {size - BLOCK}\n".encode().ljust(BLOCK, b"\0")


def inspect(path: str | Path, kind: str | None, most_bytes: int | None = None) -> None:
    """Inspect a file; rename the file to ``*.damaged`` if it is damaged, or of another kind, version or case.

    An undamaged file of an earlier version is renamed to ``*.earlier``. Outside of a command on a case
    (:func:`provenance`), only records of runs are renamed.

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
            if kind != "run" and _origin.get()[0] is None:
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
        form, length, lacking = _JSON if kind is None else _HDF5
        first = handle.read(length)
        seal = form.fullmatch(first) if len(first) == length else None
        if seal is None:
            raise Fault(f"is damaged ({lacking})")
        if kind is not None and size - BLOCK != int(seal[2]):
            raise Fault(f"is damaged ({size - BLOCK} bytes after the header, expected {int(seal[2])})")
        whole = most_bytes is None or size <= most_bytes
        if whole and hashlib.file_digest(handle, "sha256").hexdigest() != seal[1].decode():
            raise Fault("is damaged (its contents differ from its checksum)")
    if kind is None:
        return
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
    expected, _ = _origin.get()
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
    case, config = _origin.get()
    with atomic(path) as partial, _Partial(partial, "w+") as made:
        try:
            with h5py.File(made, "w", userblock_size=BLOCK, alignment_threshold=4096, alignment_interval=64) as file:
                file.attrs["kind"] = kind
                file.attrs["schema"] = SCHEMAS[kind]
                if case is not None:
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
    case, _ = _origin.get()
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


class Stored:
    """Base class of dataclasses that have a kind of HDF5 files of their own."""

    _kind: ClassVar[str]

    def __init_subclass__(cls, kind: str) -> None:
        """Name the kind of a class, one of :data:`radcal.config.stages.SCHEMAS`."""
        cls._kind = kind

    def write(self, path: str | Path) -> None:
        """Write the content to a file, atomically."""
        with write_hdf5(path, self._kind) as file:
            put(file, self)

    @classmethod
    def read(cls, path: str | Path, without: Collection[str] = ()) -> Self:
        """Content of a file, except the fields ``without``; raises the errors of :func:`read_hdf5`."""
        with read_hdf5(path, cls._kind) as file:
            return take(file, cls, without)
