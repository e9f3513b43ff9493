"""Checks of untrusted files before they are read: links to other files, memory, changes during the read."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py

__all__ = ["LARGEST_VALUES", "bounded_memory", "elsewhere", "parse_xml", "unchanged"]

LARGEST_VALUES = 100_000_000  # largest part of a raster that is read where no expected size is known
_PAGES = Path("/proc/self/statm")
_SPARE_BYTES = 1 << 30  # memory for libraries and their buffers


@contextlib.contextmanager
def bounded_memory(values: int) -> Iterator[None]:
    """Limit of the memory that a read may take, since a compressed file can expand a thousandfold.

    Parameters
    ----------
    values : int
        Numbers that the file is expected to hold; each may take 64 bytes (four copies of complex numbers), and
        2^30 bytes come on top.

    Raises
    ------
    MemoryError
        The block needs more memory. On other systems than Linux there is no limit.
    """
    try:
        used = int(_PAGES.read_text(encoding="ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    given = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min([used + 64 * values + _SPARE_BYTES, *given]), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@contextlib.contextmanager
def unchanged(path: Path) -> Iterator[None]:
    """Context that refuses a file if it changes while it is read.

    Raises
    ------
    ValueError
        Size or time stamp changed in the block.
    """
    before = path.stat()
    yield
    after = path.stat()
    if (before.st_size, before.st_mtime_ns, before.st_ino) != (after.st_size, after.st_mtime_ns, after.st_ino):
        raise ValueError("it changed while it was read")


def parse_xml(text: bytes) -> Any:
    """Root of an XML document, parsed without entities, document types or external references.

    Parameters
    ----------
    text : bytes
        The document.

    Returns
    -------
    lxml.etree._Element

    Raises
    ------
    ValueError
        The text is not XML, or it declares a document type, without which there are no entities.
    """
    from lxml import etree

    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        raise ValueError(f"its XML cannot be parsed: {error.msg}") from None
    if root.getroottree().docinfo.doctype:
        raise ValueError("its XML declares a document type, with which entities could be smuggled in")
    return root


def elsewhere(file: h5py.File) -> str | None:
    """Words for a message on the first external link or external storage of an HDF5 file; None if it has neither.

    Parameters
    ----------
    file : h5py.File
        Open.

    Returns
    -------
    str or None
        Words on the first external link, external storage or virtual dataset; None where the file holds all data
        itself.
    """
    found: list[str] = []

    def of_link(name: bytes, info: Any) -> None:
        if info.type not in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT):
            found.append(f"{name.decode(errors='replace')!r} is a link to another file")

    def of_object(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            if item.is_virtual:
                found.append(f"{name!r} is a virtual dataset, made of other files")
            elif item.external:
                found.append(f"{name!r} keeps its numbers in another file")

    file.id.links.visit(of_link, info=True)
    file.visititems(of_object)
    return found[0] if found else None
