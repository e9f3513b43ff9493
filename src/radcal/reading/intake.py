"""Protection against untrusted files: links to other files, excessive memory, changes while a file is read.

Rasters are opened with an explicit list of GDAL drivers, after a check of every file that a raster refers to. By
default GDAL chooses a driver from the content of a file. GDAL opens a ``.tif`` file that contains XML as a mosaic (VRT)
or a map service (WMS). A mosaic or a map service can make GDAL read any file of the machine or send network requests.
"""

from __future__ import annotations

import contextlib
import os
import resource
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from radcal.errors import RadcalError

LARGEST_VALUES = 100_000_000  # largest number of values read from a file if the expected size is unknown
_LARGEST_XML = 100_000_000  # largest size of an XML file [bytes]
_PAGES = Path("/proc/self/statm")
_SPARE_BYTES = 1 << 30  # additional memory for libraries and their buffers
DRIVERS = (
    "GTiff", "ENVI", "EHdr", "NITF", "HDF5", "HDF5Image", "netCDF", "JP2OpenJPEG", "SRTMHGT", "DTED", "AAIGrid", "PNG",
    "JPEG",
)  # fmt: skip
"""GDAL drivers for formats that store all numbers in the raster file, or in a file with a name derived from it."""

_HEAD_BYTES = 65536  # number of first bytes that are checked; GDAL reads fewer bytes to choose a driver
# texts by which GDAL recognises a mosaic, anywhere in the first bytes
_MARKS = (b"<VRTDataset", b"<GDALTileIndexDataset")
# XML elements that gdalbuildvrt and gdal_translate write into a mosaic; only SourceFilename names a file
_ELEMENTS = frozenset(
    """
    VRTDataset SRS GeoTransform Metadata MDI VRTRasterBand NoDataValue ColorInterp Description UnitType Offset Scale
    CategoryNames Category ColorTable Entry HideNoDataValue Histograms HistItem HistMin HistMax BucketCount
    IncludeOutOfRange Approximate HistCounts SimpleSource ComplexSource AveragedSource SourceFilename SourceBand
    SourceProperties SrcRect DstRect NODATA ScaleOffset ScaleRatio SrcMin SrcMax DstMin DstMax Exponent Clamp LUT
    ColorTableComponent UseMaskBand MaskBand GCPList GCP BlockXSize BlockYSize
    """.split()  # noqa: SIM905 - a list of fifty lines reads worse
)
_NETWORK_OFF = {
    "CPL_VSIL_CURL_ALLOWED_FILENAME": "/no/network/file/is/read",
    "GDAL_HTTP_PROXY": "127.0.0.1:9",  # the port of the discard protocol, where nothing answers
    "GDAL_HTTP_CONNECTTIMEOUT": "1",
    "GDAL_VRT_ENABLE_PYTHON": "NO",
    "GDAL_VRT_RAWRASTERBAND_ALLOWED_SOURCE": "SIBLING_OR_CHILD_OF_VRT_PATH",
}


class RasterRefused(ValueError):
    """Refusal of a raster; the text of the exception is the reason, which error messages quote after the file name."""


@contextmanager
def open_raster(path: Path, folders: Sequence[Path] = (), **settings: str) -> Iterator[Any]:
    """Context with an open raster; rasterio's warning about a missing georeference is suppressed.

    Parameters
    ----------
    path : path
        Raster in a format of :data:`DRIVERS`, or a VRT whose name ends with ``.vrt``.
    folders : sequence of path
        Folders in which the source files of a VRT may lie, besides the folder of the VRT.
    **settings : str
        Configuration options of GDAL.

    Yields
    ------
    rasterio.DatasetReader

    Raises
    ------
    RasterRefused
        The raster would make GDAL read a file that is not allowed.
    rasterio.errors.RasterioError
        No driver of :data:`DRIVERS` can open the file.
    """
    import rasterio

    path = path.absolute()
    _check(path)
    mosaic = _is_vrt(path)
    with warnings.catch_warnings(), rasterio.Env(**_NETWORK_OFF, **settings):
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        if mosaic:
            path = path.resolve()
            for source in _sources(path, folders):
                _opened(source, DRIVERS).close()
        with _opened(path, ["VRT"] if mosaic else DRIVERS) as raster:
            yield raster


@contextmanager
def in_memory(values: NDArray[Any], crs: str, transform: Any, nodata: float | None = None) -> Iterator[Any]:
    """Context with an open raster of one band that is no file.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        Values of the pixels.
    crs : str
        CRS as code or WKT.
    transform : affine.Affine
        Transform from columns and rows of pixels to the CRS.
    nodata : float, optional
        Value that stands for no data.

    Yields
    ------
    rasterio.DatasetReader
    """
    import rasterio

    height, width = values.shape
    size = {"height": height, "width": width, "count": 1, "dtype": values.dtype}
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", crs=crs, transform=transform, nodata=nodata, **size) as raster:
            raster.write(values, 1)
        with memory.open() as raster:
            yield raster


def _opened(path: Path, drivers: Sequence[str]) -> Any:
    """Raster, opened by one of the drivers; a raster whose overviews lie in another file is refused."""
    from rasterio.io import DatasetReader

    raster = DatasetReader(str(path), driver=list(drivers))  # rasterio.open takes one driver alone
    if raster.tags(ns="OVERVIEWS"):
        raster.close()
        raise RasterRefused(f"{path.name} names another file for its overviews, which is not followed")
    return raster


def check_blocks(raster: Any) -> None:
    """Raise an error if a raster has too large blocks, because GDAL always decompresses a whole block.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        Open raster.

    Raises
    ------
    RasterRefused
        A block has more than :data:`radcal.reading.intake.LARGEST_VALUES` pixels.
    """
    for rows, columns in raster.block_shapes:
        if rows * columns > LARGEST_VALUES:
            raise RasterRefused(f"it has blocks of {rows} x {columns} pixels, expected at most {LARGEST_VALUES:.0e}")


def raster_files(path: Path, folders: Sequence[Path] = ()) -> list[Path]:
    """Further files that GDAL reads with a raster: source files of a VRT, headers, world files, metadata.

    Parameters
    ----------
    path : path
        Path of a raster or of any other file.
    folders : sequence of path
        Folders in which the source files of a VRT may lie, besides the folder of the VRT.

    Raises
    ------
    RasterRefused
        The file is a VRT that radcal does not read.
    """
    sources = _sources(path.resolve(), folders) if _is_vrt(path) else []
    return [*(file for raster in (path, *sources) for file in _beside(raster)), *sources]


def _is_vrt(path: Path) -> bool:
    return path.suffix.lower() == ".vrt"


def _beside(path: Path) -> list[Path]:
    """Existing files that GDAL reads with a raster because their names derive from the raster's name."""
    kind = path.suffix[1:]
    endings = (".hdr", ".prj", ".wld", *([f".{kind[0]}{kind[-1]}w", f".{kind}w"] if kind else []))
    names = [path.with_suffix(ending) for ending in endings]
    names += [path.with_name(path.name + ending) for ending in (".aux.xml", ".msk", ".ovr", ".hdr")]
    return sorted({name for name in names if name != path and name.is_file()})


def _check(path: Path) -> None:
    """Refuse a raster if its content, or a mask or overviews beside it, would make GDAL read further files."""
    if not _is_vrt(path):
        head = _head(path)
        xml = head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<") or head[:2] in (b"\xff\xfe", b"\xfe\xff")
        if xml or any(mark in head for mark in _MARKS):
            raise RasterRefused(
                f"{path.name} holds XML, which is read as a mosaic (VRT) only in a file whose name ends with .vrt"
            )
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                if (what := elsewhere(file)) is not None:
                    raise RasterRefused(f"in {path.name} {what}, which is not followed")
    for other in _beside(path):
        if other.suffix in (".msk", ".ovr") and _head(other)[:4] not in _TIFF:
            raise RasterRefused(f"{other.name} beside it is not a TIFF")


_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)


def _sources(path: Path, folders: Sequence[Path]) -> list[Path]:
    """Paths of the source files of a VRT, after a check of the VRT and of each source file."""
    try:
        root = read_xml(path)
    except (OSError, ValueError) as error:
        raise RasterRefused(f"{path.name}: {error}") from None
    for element in root.iter():
        if not isinstance(element.tag, str):
            continue  # an XML comment
        kind = f"{element.tag} {element.get('subClass', '')}".strip()
        if kind not in _ELEMENTS:
            raise RasterRefused(f"{path.name} has {kind}, expected a mosaic as gdalbuildvrt makes it")
    allowed = [folder.resolve() for folder in (path.parent, *folders)]
    sources = {
        _source(path, str(element.text or ""), element.get("relativeToVRT") == "1", allowed)
        for element in root.iter("SourceFilename")
    }
    for source in sources:
        _check(source)
    return sorted(sources)


def _source(path: Path, text: str, relative: bool, allowed: Sequence[Path]) -> Path:
    """Path of one source of a VRT; a source outside the allowed folders is refused."""
    expected = f"expected a file below {' or '.join(map(str, allowed))}"
    if ":" in text or text.startswith("/vsi") or not (relative or text.startswith("/")):
        raise RasterRefused(f"{path.name} names the source {text!r}, {expected}")
    source = (path.parent / text).resolve()
    if not any(source.is_relative_to(folder) for folder in allowed):
        raise RasterRefused(f"{path.name} names the source {text!r}, {expected}")
    if not source.is_file() or _is_vrt(source):
        what = "which is a mosaic itself" if source.is_file() else "which is no file"
        raise RasterRefused(f"{path.name} names the source {text!r}, {what}, expected a raster")
    return source


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
