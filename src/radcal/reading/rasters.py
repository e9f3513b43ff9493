"""Opening of rasters with an explicit list of GDAL drivers, after a check of every file that a raster refers to.

By default GDAL chooses a driver from the content of a file. GDAL opens a ``.tif`` file that contains XML as a mosaic
(VRT) or a map service (WMS). A mosaic or a map service can make GDAL read any file of the machine or send network
requests.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from radcal.reading.intake import LARGEST_VALUES, elsewhere, read_xml

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
