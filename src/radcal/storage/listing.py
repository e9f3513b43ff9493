"""Lists of checksums for files whose format leaves no place for a checksum: table of runs, report, figures."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from radcal.storage.files import file_sha256
from radcal.storage.records import write_json
from radcal.storage.sealing import Fault

_KEY = "checksums"


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
    write_json(path, {_KEY: {Path(file).relative_to(folder).as_posix(): file_sha256(Path(file)) for file in files}})


def listed(data: Any) -> Mapping[str, str]:
    """Checksums by file name from the content of a JSON file; empty if the file is not a list of checksums."""
    found = data.get(_KEY) if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def faulty(folder: str | Path, checksums: Mapping[str, str]) -> dict[Path, str]:
    """Listed files that are missing or differ from their checksum, each with a text that describes the fault.

    Parameters
    ----------
    folder : path
        Folder of the list.
    checksums : mapping
        Checksums from :func:`listed`.

    Raises
    ------
    Fault
        A listed file does not lie below the folder.
    OSError
        A file cannot be read.
    """
    found = {}
    top = Path(os.path.realpath(folder))
    for name, expected in checksums.items():
        path = Path(folder) / name
        if "\0" in name or top not in Path(os.path.realpath(path)).parents:
            raise Fault(f"names {name!r}, expected a file below {folder}")
        if not path.exists():
            found[path] = "is missing"
        elif not path.is_file():
            found[path] = "is no file"
        elif file_sha256(path) != expected:
            found[path] = "is damaged or was changed (it differs from its checksum)"
    return found
