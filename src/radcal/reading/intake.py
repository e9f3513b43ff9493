"""Protection against untrusted files: links to other files, excessive memory, changes while a file is read."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py

from radcal.errors import RadcalError

LARGEST_VALUES = 100_000_000  # largest number of values read from a file if the expected size is unknown
_LARGEST_XML = 100_000_000  # largest size of an XML file [bytes]
_PAGES = Path("/proc/self/statm")
_SPARE_BYTES = 1 << 30  # additional memory for libraries and their buffers


@contextlib.contextmanager
def bounded_memory(values: int) -> Iterator[None]:
    """Context that limits the memory for reading a file, because a compressed file can expand a thousandfold.

    Parameters
    ----------
    values : int
        Expected number of values in the file. The limit is 64 bytes per value (four copies of a complex number), plus
        2^30 bytes.

    Raises
    ------
    MemoryError
        The ``with`` block needs more memory. A limit is only set on Linux.
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
    """Context that raises an error if a file changes while the ``with`` block reads it.

    Raises
    ------
    ValueError
        Size, time stamp or inode of the file changed during the ``with`` block.
    """
    before = path.stat()
    yield
    after = path.stat()
    if (before.st_size, before.st_mtime_ns, before.st_ino) != (after.st_size, after.st_mtime_ns, after.st_ino):
        raise ValueError("it changed while it was read")


@contextlib.contextmanager
def guarded(
    path: Path, refused: Callable[[str], RadcalError], called: str, values: int = LARGEST_VALUES
) -> Iterator[None]:
    """Context that reads an untrusted file: with a limit of memory, and with one sentence for all errors of libraries.

    Parameters
    ----------
    path : path
        File that the ``with`` block reads.
    refused : callable
        Function from the end of a sentence, such as "cannot be read as a raster (it is damaged).", to the exception
        whose message begins with the configuration key and the path.
    called : str
        Name of the file's format in error messages, such as "a raster".
    values : int
        Expected number of values in the file, as in :func:`bounded_memory`.
    """
    try:
        with unchanged(path), bounded_memory(values):
            yield
    except RadcalError:
        raise
    except MemoryError:
        reason = f"it takes far more memory than {values:,} pixels do"
        raise refused(f"cannot be read as {called} ({reason}).") from None
    except Exception as error:  # the libraries' exceptions for damaged files have no common base class
        # rasterio's message is only "see the previous exception", so that the cause is quoted instead
        reason = " ".join(str(error.__cause__ or error).split()) or type(error).__name__
        raise refused(f"cannot be read as {called} ({reason}).") from None


def parse_xml(text: bytes) -> Any:
    """Root element of an XML document; entities, document types and external references are refused or ignored.

    Parameters
    ----------
    text : bytes
        Bytes of the XML document.

    Returns
    -------
    lxml.etree._Element

    Raises
    ------
    ValueError
        The text is not XML, or declares a document type, which could define entities.
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


def read_xml(path: Path) -> Any:
    """Root element of the XML document in a file, as :func:`parse_xml` reads it.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        The path is that of a folder or a device, the file is too large, or :func:`parse_xml` refuses its content.
    """
    size = path.stat().st_size
    if not path.is_file():
        raise ValueError("it is a folder or a device, expected a file")
    if size > _LARGEST_XML:
        raise ValueError(f"it has {size} bytes, expected at most {_LARGEST_XML}")
    return parse_xml(path.read_bytes())


def elsewhere(file: h5py.File) -> str | None:
    """Text that names the first part of an HDF5 file that refers to another file; None if there is no reference.

    Parameters
    ----------
    file : h5py.File
        Open HDF5 file.

    Returns
    -------
    str or None
        Text for an error message about the first external link, external storage or virtual dataset; None if the file
        contains all its data.
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
