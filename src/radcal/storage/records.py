"""HDF5 and JSON files with schema version, provenance and checksum, written atomically and inspected before reading.

``docs/records.md`` documents the layout and the attributes.
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
"""Environment variable that allows the results of a finished calibration to be replaced; the session sets it."""

_PACKAGES = ("numpy", "scipy", "h5py")


@contextlib.contextmanager
def write_hdf5(
    path: str | Path,
    kind: str,
    track_order: bool = False,
    protected: bool = False,
    alike: Callable[[h5py.File], bool] = lambda _: False,
) -> Iterator[h5py.File]:
    """Open a new HDF5 file that appears under ``path``, with checksum and provenance, after the ``with`` block.

    An existing file with the same content keeps its bytes, its provenance included; only its time stamp changes.
    Snakemake compares contents, so that the jobs that depend on the file do not run again.

    Parameters
    ----------
    path : path
        Path of the file.
    kind : str
        Kind of the file, a key of :data:`~radcal.storage.inspection.SCHEMAS`.
    track_order : bool
        Whether groups are read back in the order in which they were made.
    protected : bool
        Whether an existing file with other content is refused replacement while the results of a finished calibration
        stand in the same folder. The environment variable :data:`REPLACE` lifts the protection.
    alike : callable, optional
        Predicate of an existing protected file with other bytes: true where it holds the same values in the packing of
        an earlier version. Such a file is replaced.

    Raises
    ------
    ConfigError
        The file is protected.
    StoreError
        The file cannot be written.
    """
    path = Path(path)
    # The file is made in memory. On a full disk HDF5 would repeat the failed write of its buffers, each time with an
    # exception that cannot be caught.
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
                # a dataset, because HDF5 limits the size of attributes
                file["config"] = json.dumps(config, sort_keys=True, default=str)
        with made.getbuffer() as whole:
            whole[:BLOCK] = header(hashlib.sha256(whole[BLOCK:]).hexdigest(), len(whole))
            partial.write_bytes(whole)


def _protect(path: Path, kind: str, content: str, alike: Callable[[h5py.File], bool]) -> None:
    """Raise a ConfigError if a finished calibration was made with a file whose content differs from the new one."""
    if not (path.parent / "calibration.h5").is_file():
        return
    try:
        inspect_file(path, kind)
    except (Fault, OSError, StoreError):
        return  # a missing or damaged file need not be protected
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
    """Whether the file at ``path`` is undamaged, of this kind, and has content with this digest."""
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
        Path of a file that :func:`write_hdf5` wrote.
    kind : str
        Kind of the file, a key of :data:`~radcal.storage.inspection.SCHEMAS`.

    Raises
    ------
    DamagedError
        The file is damaged, of another version or of another case; it was set aside.
    StoreError
        The file is missing or cannot be read; nothing was changed.
    """
    path = Path(path)
    inspect(path, kind)
    # no lock is needed, because a visible file never changes
    with h5py.File(path, "r", locking=False) as file:
        yield file


def write_json(path: str | Path, data: Any, flat: bool = False) -> None:
    """Write plain data as JSON with a checksum, atomically.

    The file records neither a time nor a version. The same data therefore give the same bytes, and the jobs that
    depend on the file do not run again.

    Parameters
    ----------
    path : path
        Path of the file.
    data : plain data
        Content of the file, under the key ``data``.
    flat : bool
        Whether ``data`` is a mapping whose keys are written at the top level of the file.

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


def read_json(path: str | Path) -> Any:
    """Read the data of a JSON file that :func:`write_json` wrote.

    Raises
    ------
    DamagedError
        The file is damaged or of another case; it was set aside.
    StoreError
        The file is missing or cannot be read; nothing was changed.
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
