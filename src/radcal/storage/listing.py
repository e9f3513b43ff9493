"""Lists of checksums for files that cannot hold a checksum themselves: table of runs, report, figures."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from radcal.storage.records import write_json

__all__ = ["faulty", "listed", "write_listing"]

_KEY = "checksums"


def write_listing(path: str | Path, files: Iterable[str | Path]) -> None:
    """Write a list of SHA-256 checksums of files that lie in the folder of the list or below it.

    Parameters
    ----------
    path : path
        Path of the list. The rule that makes the files also makes the list, so that Snakemake removes both before they
        are made again, and the list never describes earlier files.
    files : iterable of path
        Files in the list's folder or below it.

    Raises
    ------
    StoreError
        The folder or the disk refuses the list.
    """
    folder = Path(path).parent
    write_json(path, {_KEY: {Path(file).relative_to(folder).as_posix(): _sha256(Path(file)) for file in files}})


def listed(data: Any) -> Mapping[str, str]:
    """File names and checksums in the content of a list of checksums; empty for any other content."""
    found = data.get(_KEY) if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def faulty(folder: str | Path, checksums: Mapping[str, str]) -> dict[Path, str]:
    """Listed files that are missing or differ from their checksum, each with the reason.

    Parameters
    ----------
    folder : path
        Folder of the list.
    checksums : mapping
        Checksums from :func:`listed`.

    Raises
    ------
    OSError
        A file cannot be read.
    """
    found = {}
    for name, expected in checksums.items():
        path = Path(folder) / name
        if not path.exists():
            found[path] = "is missing"
        elif not path.is_file():
            found[path] = "is no file"
        elif _sha256(path) != expected:
            found[path] = "is damaged or was changed (it differs from its checksum)"
    return found


def _sha256(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()
