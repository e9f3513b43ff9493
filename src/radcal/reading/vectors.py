"""Vector layers (GeoPackage, shapefile, GeoJSON), read by GDAL in a process of its own with limits of memory and time.

A driver of GDAL may follow what a file says to other files, and a GeoPackage may hold views whose computation never
ends. The first bytes therefore decide about the driver, and a limit of CPU time ends the process.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import RadcalError
from radcal.processes import apart
from radcal.reading.intake import guarded

# ending of the file's name: first bytes, driver of GDAL, and what the driver's name for a file begins with
ENDINGS = {
    ".gpkg": (b"SQLite format 3\0", "GPKG", ""),
    ".shp": (b"\0\0\x27\x0a", "ESRI Shapefile", ""),
    ".geojson": (b"{", "GeoJSON", "GeoJSON:"),
}
_TABLES = {".dbf": (b"", "ESRI Shapefile", "")}  # the first byte of a dBASE table is one of many versions
_LARGEST_FILE = 4_000_000_000  # largest size of a file [bytes]
_LARGEST_LAYER = 30_000_000  # largest number of features
_LONGEST_S = 300  # longest CPU time for reading a layer [s]
_SHAPEFILE = (".shx", ".dbf", ".prj", ".cpg")


@dataclass(frozen=True)
class VectorLayer:
    """Features of a layer.

    Attributes
    ----------
    name : str
        Name of the layer.
    crs : str or None
        CRS, by its authority code or as WKT.
    geometries : ndarray (features,) of bytes or None
        Geometry of each feature as well-known binary; None for a feature without a geometry.
    columns : dict of str to ndarray (features,)
        Attributes by name; the names in a shapefile have at most ten letters.
    """

    name: str
    crs: str | None
    geometries: NDArray[np.object_]
    columns: dict[str, NDArray[Any]]


def vector_files(path: Path) -> list[Path]:
    """Other files that belong to a vector file: those of a shapefile that exist."""
    endings = _SHAPEFILE if path.suffix.lower() == ".shp" else ()
    return [other for ending in endings if (other := path.with_suffix(ending)).exists()]


def read_vectors(path: Path, layer: str | None, refused: Callable[[str], RadcalError], key: str = "") -> VectorLayer:
    """Features of a layer in a GeoPackage, shapefile or GeoJSON file.

    Parameters
    ----------
    path : Path
        File whose name has one of the `ENDINGS`.
    layer : str or None
        Name of the layer; None for the only layer with geometries.
    refused : callable
        Function from the end of a sentence to the exception, as for :func:`radcal.reading.intake.guarded`.
    key : str
        Configuration key that names the layer, for messages.

    Raises
    ------
    RadcalError
        The file is not of the format that its name says, is damaged, or takes too much memory or time.

    References
    ----------
    GDAL, "Vector drivers", https://gdal.org/drivers/vector/
    """
    found = read_layers([path], lambda _, text: refused(text), layer, key)[0]
    if isinstance(found, RadcalError):
        raise found
    return found


def read_layers(
    paths: Sequence[Path], refused: Callable[[Path, str], RadcalError], layer: str | None = None, key: str = ""
) -> list[VectorLayer | RadcalError]:
    """Features of vector files, and rows of dBASE tables without a shapefile, in one process for all of them.

    If this process ends early, each file is read in a process of its own.

    Parameters
    ----------
    paths : sequence of path
        Files whose names have one of the `ENDINGS`, or end with ``.dbf``.
    refused : callable
        Function from a file and the end of a sentence to the exception.
    layer, key : str
        The same as for :func:`read_vectors`.

    Returns
    -------
    list of VectorLayer or RadcalError
        For each file its features, or the reason why it cannot be read.
    """
    from concurrent.futures.process import BrokenProcessPool  # imported here, because every job imports this module

    def every() -> list[VectorLayer | RadcalError]:
        found: list[VectorLayer | RadcalError] = []
        for path in paths:
            try:
                found.append(_read(path, layer, partial(refused, path), key))
            except RadcalError as error:
                found.append(error)
        return found

    if not paths:
        return []
    try:
        return apart(every, _LONGEST_S)
    except BrokenProcessPool:
        if len(paths) > 1:
            return [one for path in paths for one in read_layers([path], refused, layer, key)]
        reason = f"it ended the process that read it, or took more than {_LONGEST_S} s of CPU time"
        return [refused(paths[0], f"cannot be read as a vector file ({reason}).")]


def _read(path: Path, layer: str | None, refused: Callable[[str], RadcalError], key: str) -> VectorLayer:
    if path.suffix.lower() == ".dbf":  # a table alone: GDAL would open the shapefile beside it, which may be empty
        with tempfile.TemporaryDirectory() as folder:
            for file in (path, *(one for one in map(path.with_suffix, (".cpg", ".dbt")) if one.exists())):
                (Path(folder) / f"table{file.suffix.lower()}").symlink_to(file.absolute())
            return _opened(Path(folder) / "table.dbf", None, refused, key)
    return _opened(path, layer, refused, key)


def _opened(path: Path, layer: str | None, refused: Callable[[str], RadcalError], key: str) -> VectorLayer:
    first, driver, prefix = (ENDINGS | _TABLES)[path.suffix.lower()]
    with guarded(path, refused, "a vector file"):
        if (size := path.stat().st_size) > _LARGEST_FILE:
            raise refused(f"has {size} bytes, expected at most {_LARGEST_FILE}.")
        with path.open("rb") as file:
            if not file.read(1000).removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n").startswith(first):
                raise refused(f"cannot be read as a vector file (it does not begin as one of {driver}).")
        import pyogrio

        warnings.simplefilter("ignore")  # in this process alone
        name = f"{prefix}{path.absolute()}"
        if (found := pyogrio.read_info(name, layer=0)["driver"]) != driver:
            raise refused(f"cannot be read as a vector file (it is one of {found}, expected {driver}).")
        layers = [str(one) for one, kind in pyogrio.list_layers(name) if kind is not None or first == b""]
        if layer is None and len(layers) != 1:
            which = f"the layers {', '.join(layers)}: name one as {key}" if layers else "no layer"
            raise refused(f"has {which}.")
        if layer is not None and layer not in layers:
            raise refused(f"has the layers {', '.join(layers) or 'none'}, {key} is {layer!r}.")
        layer = layer or layers[0]
        limit = _LARGEST_LAYER + 1
        if driver == "ESRI Shapefile":  # whose number of features is that of its bytes; pyogrio allocates the limit
            limit = min(limit, max(1, pyogrio.read_info(name, layer=layer)["features"]))
        about, _, geometries, columns = pyogrio.raw.read(name, layer=layer, max_features=limit)
        if geometries is None:  # a table
            geometries = np.full(len(columns[0]) if columns else 0, None)
        if len(geometries) > _LARGEST_LAYER:
            raise refused(f"has more than {_LARGEST_LAYER} rows.")
        return VectorLayer(layer, about["crs"], geometries, dict(zip(about["fields"], columns, strict=True)))
