"""HDF5 and JSON files with schema version, provenance and checksum: written whole, inspected before they are read.

Layout and attributes are documented in ``docs/records.md``.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import platform
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py

from radcal.errors import ConfigError, StoreError
from radcal.storage.disclosure import disclosed
from radcal.storage.files import atomic, first_difference
from radcal.storage.inspection import SCHEMAS, check_case, inspect, inspect_file, set_aside, unreachable
from radcal.storage.provenance import origin
from radcal.storage.sealing import BLOCK, Fault, header

__all__ = ["REPLACE", "read_hdf5", "read_json", "write_hdf5", "write_json"]

REPLACE = "RADCAL_REPLACE"
"""Environment variable that the Snakefile sets where finished results may be replaced by those of another scene."""

_PACKAGES = ("numpy", "scipy", "h5py")


@contextlib.contextmanager
def write_hdf5(
    path: str | Path,
    kind: str,
    track_order: bool = False,
    protected: bool = False,
    alike: Callable[[h5py.File], bool] = lambda _: False,
) -> Iterator[h5py.File]:
    """Open a new HDF5 file that becomes visible under ``path`` only when complete, with checksum and provenance.

    If the file there holds the same already, it is left as it is but for its time stamp: what was made again
    without a difference keeps its first provenance, and for a later command of Snakemake, which compares contents,
    nothing that depends on it is out of date.

    Parameters
    ----------
    path : path
        The file.
    kind : str
        Key of :data:`~radcal.storage.inspection.SCHEMAS`.
    track_order : bool
        Groups are read back in the order in which they were made.
    protected : bool
        Refuse to change the file while a finished calibration that rests on it stands beside it, unless the
        environment variable :data:`REPLACE` is set.
    alike : callable, optional
        Whether a protected file of other bytes holds the same, as an earlier version packed it: it is then replaced.

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
        with h5py.File(made, "w", track_order=track_order, userblock_size=BLOCK) as file:
            file.attrs["kind"] = kind
            file.attrs["schema"] = SCHEMAS[kind]
            if (case := origin().case) is not None:
                file.attrs["case"] = case
            yield file
        content = hashlib.sha256(made.getbuffer()[BLOCK:]).hexdigest()
        if protected and REPLACE not in os.environ:
            _protect(path, kind, content, alike)
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
            config = origin().config
            if config is not None and "config" not in file.attrs:
                # a dataset: HDF5 bounds the size of attributes
                file["config"] = json.dumps(config, sort_keys=True, default=str)
        with made.getbuffer() as whole:
            whole[:BLOCK] = header(hashlib.sha256(whole[BLOCK:]).hexdigest(), len(whole))
            partial.write_bytes(whole)


def _protect(path: Path, kind: str, content: str, alike: Callable[[h5py.File], bool]) -> None:
    """Raise if a finished calibration rests on a file of other content."""
    if not (path.parent / "calibration.h5").is_file():
        return
    try:
        inspect_file(path, kind)
    except (Fault, OSError, StoreError):
        return  # nothing that could be kept
    with h5py.File(path, "r", locking=False) as file:
        if file.attrs["content"] == content or alike(file):
            return
        theirs = disclosed(json.loads(file["config"].asstr()[()])) if "config" in file else {}
        made_by = str(file.attrs["radcal"])
    ours = json.loads(json.dumps(origin().config or {}, default=str))
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


def _holds(path: Path, kind: str, content: str) -> bool:
    """Whether a sound file of a kind has this content."""
    with contextlib.suppress(Fault, OSError):
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
        Key of :data:`~radcal.storage.inspection.SCHEMAS`.

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
    case = origin().case
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
        raise unreachable(path, error) from error
    del outer["sha256"]
    if "data" not in outer:
        return outer
    try:
        check_case(outer.get("case"))
    except Fault as fault:
        raise set_aside(path, str(fault)) from None
    return outer["data"]
