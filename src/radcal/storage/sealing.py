"""Checksums stored in the first bytes of HDF5 and JSON files.

An HDF5 file starts with a user block of 512 bytes, which HDF5 libraries skip. The user block contains the SHA-256 of
all bytes after the block, and the number of these bytes. The second line of a JSON file contains the SHA-256 of all
bytes after this line.
"""

from __future__ import annotations

import hashlib
import re
from io import BufferedReader

BLOCK = 512
"""Length of the user block [bytes]; HDF5 allows no smaller user block."""

_HEADER = re.compile(rb"radcal sha256 ([0-9a-f]{64}) bytes (\d{1,18})\n\0+\Z")
_JSON_HEADER = re.compile(rb'\{\n "sha256": "([0-9a-f]{64})",\n')
_JSON_HEADER_BYTES = len('{\n "sha256": "",\n') + 64


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


def check_hdf5(handle: BufferedReader, size: int, whole: bool) -> None:
    """Compare the size and content of an open HDF5 file with the size and checksum in its user block.

    Parameters
    ----------
    handle : binary file
        Open file, positioned at its beginning.
    size : int
        Size of the file [bytes].
    whole : bool
        Whether the content is compared with the checksum; header and size are always checked.

    Raises
    ------
    Fault
        The file is damaged or has no header.
    """
    first = handle.read(BLOCK)
    match = _HEADER.match(first) if len(first) == BLOCK else None
    if match is None:
        raise Fault("is damaged (its first 512 bytes are no header)")
    if size - BLOCK != int(match[2]):
        raise Fault(f"is damaged ({size - BLOCK} bytes after the header, expected {int(match[2])})")
    _compare(handle, match[1], whole)


def check_json(handle: BufferedReader, whole: bool) -> None:
    """Compare the content of an open JSON file with its checksum; ``handle`` and ``whole`` as in :func:`check_hdf5`.

    Raises
    ------
    Fault
        The file is damaged or has no header.
    """
    match = _JSON_HEADER.fullmatch(handle.read(_JSON_HEADER_BYTES))
    if match is None:
        raise Fault("is damaged (no checksum in its second line)")
    _compare(handle, match[1], whole)


def _compare(handle: BufferedReader, expected: bytes, whole: bool) -> None:
    if whole and hashlib.file_digest(handle, "sha256").hexdigest() != expected.decode():
        raise Fault("is damaged (its contents differ from its checksum)")
