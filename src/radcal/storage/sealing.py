"""Checksums of files, kept in their first bytes.

An HDF5 file starts with a user block of 512 bytes, which HDF5 libraries skip. It holds the SHA-256 and the number
of all bytes that follow. A JSON file starts with the SHA-256 of what follows.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import IO

__all__ = ["BLOCK", "Fault", "check_hdf5", "check_json", "header", "is_sealed", "seal"]

BLOCK = 512
"""Length of the user block, the smallest that HDF5 allows [bytes]."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HEADER = re.compile(rb"radcal sha256 ([0-9a-f]{64}) bytes (\d{1,18})\n\0+\Z")
_JSON_HEADER = re.compile(rb'\{\n "sha256": "([0-9a-f]{64})",\n')
_JSON_HEADER_BYTES = len('{\n "sha256": "",\n') + 64
_CHUNK = 1 << 20


class Fault(Exception):
    """Why a file is not what was written."""


def header(total: str, size: int) -> bytes:
    """First bytes of an HDF5 file of a size [bytes] and a SHA-256 of all that follows them."""
    return f"radcal sha256 {total} bytes {size - BLOCK}\n".encode().ljust(BLOCK, b"\0")


def check_hdf5(handle: IO[bytes], size: int, whole: bool) -> None:
    """Compare an open HDF5 file with its header.

    Parameters
    ----------
    handle : binary file
        At its beginning.
    size : int
        Of the file [bytes].
    whole : bool
        Compare the contents too, not the header and the size alone.

    Raises
    ------
    Fault
        It is not what was written.
    """
    first = handle.read(BLOCK)
    if first.startswith(_SIGNATURE):
        raise Fault("has no checksum (an earlier version wrote it)")
    match = _HEADER.match(first) if len(first) == BLOCK else None
    if match is None:
        raise Fault("is damaged (its first 512 bytes are no header)")
    if size - BLOCK != int(match[2]):
        raise Fault(f"is damaged ({size - BLOCK} bytes after the header, expected {int(match[2])})")
    if whole and _sha256(handle) != match[1].decode():
        raise Fault("is damaged (its contents differ from its checksum)")


def check_json(handle: IO[bytes], whole: bool) -> None:
    """Compare an open JSON file with its header; parameters as for :func:`check_hdf5`.

    Raises
    ------
    Fault
        It is not what was written.
    """
    match = _JSON_HEADER.fullmatch(handle.read(_JSON_HEADER_BYTES))
    if match is None:
        raise Fault("is damaged, or an earlier version wrote it (no checksum in its second line)")
    if whole and _sha256(handle) != match[1].decode():
        raise Fault("is damaged (its contents differ from its checksum)")


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
        A file with a user block of 512 bytes: one that :func:`~radcal.storage.records.write_hdf5` made and that was
        changed on purpose.

    Raises
    ------
    OSError
        It cannot be read or written.
    """
    path = Path(path)
    with path.open("r+b") as handle:
        handle.seek(BLOCK)
        first = header(_sha256(handle), path.stat().st_size)
        handle.seek(0)
        handle.write(first)
