"""Tables of objects: CSV files, vector layers and HDF5 files, checked row by row."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.errors import SceneError
from radcal.reading.intake import elsewhere, guarded
from radcal.reading.vectors import ENDINGS, read_vectors
from radcal.scene.objects import Objects, rectangles
from radcal.sections.scene import DBSM_LIMITS, WALL_DB_LIMITS, check_curve
from radcal.standing.cross_sections import LARGEST_ROWS, CrossSection, columns_of

if TYPE_CHECKING:
    import pandas as pd


_KEY = "scene.objects.path"
# column: smallest value, largest value, unit
_LIMITS: dict[str, tuple[float, float, str]] = {
    "length_m": (0.0, 10_000.0, "m"),
    "width_m": (0.0, 10_000.0, "m"),
    "heading_deg": (-360.0, 360.0, "degrees"),
    "height_m": (0.0, 1000.0, "m"),
    "rcs_dbsm": (*DBSM_LIMITS, "dBsm (10 log10 of square metres)"),
    "wall_sigma0_db": (*WALL_DB_LIMITS, "dB"),
    "bounce": (0.0, 1.0, "(0: no double bounce is added, 1: one is)"),
    "speed_mps": (0.0, 200.0, "m/s"),
}
_MAY_BE_EMPTY = ("rcs_dbsm", "wall_sigma0_db", "bounce")
_DEFAULTS = {"length_m": 0.0, "width_m": 0.0, "heading_deg": 0.0, "speed_mps": 0.0}
_TEXTS = ("aspect", "roof")
_COLUMNS = ("x_m", "y_m", *_LIMITS, *_TEXTS)


@dataclass(frozen=True)
class Place:
    """Position and extent of a scene on the map.

    Attributes
    ----------
    size_m : (float, float)
        Extent of the scene to the east and to the north [m].
    corner_m : (float, float)
        Coordinates of the scene's south-west corner in the scene's CRS [m]; zero if the scene has no CRS.
    crs : str or None
        CRS of the scene.
    """

    size_m: tuple[float, float]
    corner_m: tuple[float, float] = (0.0, 0.0)
    crs: str | None = None


def read_objects(
    path: Path, place: Place, layer: str | None = None, curves: Mapping[str, Any] | None = None,
    tables: Mapping[str, CrossSection] | None = None, permittivity: tuple[float, float] | None = None,
) -> Objects:  # fmt: skip
    """Read a table of objects and check every row.

    Parameters
    ----------
    path : Path
        File whose name ends with ``.csv``, ``.gpkg``, ``.shp``, ``.geojson``, ``.h5`` or ``.hdf5``.
    place : Place
        Position and extent of the scene. Positions in the table are in the scene's CRS or, if the scene has no CRS,
        relative to the scene's south-west corner.
    layer : str, optional
        Layer to be read from a file that has several layers.
    curves : mapping, optional
        For each aspect class in the table, curve of the cross-section over the aspect angle: pairs of aspect [deg] and
        cross-section [dBsm].
    tables : mapping, optional
        Tables of cross-sections, whose names are aspect classes, too.
    permittivity : (float, float), optional
        Relative permittivity of walls and of the ground in front of them.

    Returns
    -------
    Objects
        Objects in the order of the table's rows.

    Raises
    ------
    SceneError
        The file cannot be read as a table of objects, or a row contains an invalid value.
    """
    curves = dict(curves or {})
    ending = path.suffix.lower()
    if ending == ".csv":
        table = _csv(path)
    elif ending in ENDINGS:
        table = _vectors(path, layer, place)
    elif ending in (".h5", ".hdf5"):
        table, own = _hdf5(path, place)
        if twice := sorted(own.keys() & curves.keys()):
            raise SceneError(f"scene.objects.aspect.{twice[0]}: {path} has a class of that name, too: rename one.")
        curves |= own
    else:
        raise SceneError(f"{_KEY} is {path}, expected a file ending with .csv, {', '.join(ENDINGS)}, .h5 or .hdf5.")
    tables = tables or {}
    if twice := sorted(curves.keys() & {one.name for one in tables.values()}):
        raise SceneError(f"scene.objects.cross_sections: class {twice[0]!r} has a curve by aspect, too: rename one.")
    return _checked(table, path, place, curves, tables, permittivity)


def _error(path: Path, text: str) -> SceneError:
    return SceneError(f"{_KEY} ({path}) {text}")


def _csv(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        table = pd.read_csv(path, skipinitialspace=True, low_memory=False)
        header = pd.read_csv(path, skipinitialspace=True, header=None, nrows=1, dtype=str).iloc[0]
    except (OSError, ValueError) as error:  # pandas' exceptions are ValueErrors
        raise _error(path, f"cannot be read as CSV ({str(error).strip().splitlines()[0]}).") from None
    if not isinstance(table.index, pd.RangeIndex):  # pandas takes the first fields as names of rows
        raise _error(path, f"row 1 has more fields than the {len(header)} columns of the header, expected as many.")
    # pandas gives the second of two equal names a number
    return table.set_axis([given if isinstance(given, str) else k for k, given in enumerate(header)], axis=1)


def _hdf5(path: Path, place: Place) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Table of objects and curves of cross-section, from the groups ``objects`` and ``aspect`` of an HDF5 file."""
    import pandas as pd

    with guarded(path, partial(_error, path), "HDF5"), h5py.File(path, "r") as file:
        if (what := elsewhere(file)) is not None:
            raise _error(path, f"is not read: {what}.")
        group = file.get("objects")
        if not isinstance(group, h5py.Group):
            raise _error(path, "has no group 'objects', expected one with a dataset for each column.")
        if "crs" in group.attrs:
            _check_crs(path, str(group.attrs["crs"]), str(group.attrs["crs"]), place)
        columns = columns_of(group, "objects/", partial(_error, path))
        found = file.get("aspect", {})
        if not isinstance(found, h5py.Group | dict):
            raise _error(path, "aspect is not a group, expected one with a dataset for each aspect class.")
        curves = {}
        for name, data in found.items():
            if not isinstance(data, h5py.Dataset) or data.dtype.kind not in "fiu" or data.size > LARGEST_ROWS:
                raise _error(path, f"aspect/{name} is not a dataset of numbers.")
            if (wrong := check_curve(data[()])) is not None:
                raise _error(path, f"aspect/{name} {wrong}.")
            curves[name] = data[()]
        return pd.DataFrame(columns), curves


def _check_crs(path: Path, text: str, name: str, place: Place) -> None:
    """Raise an error if the CRS of a table differs from the scene's CRS."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    from radcal.scene.crs import crs_from, horizontal, same_place

    if place.crs is None:
        raise _error(
            path, f"is in {name}, the scene has no CRS: expected metres from its south-west corner, without a CRS."
        )
    try:
        crs = crs_from(text)
    except CRSError:
        raise _error(path, f"is in {name}, which is not a known CRS, expected {_short(place.crs)}.") from None
    if not same_place(horizontal(crs), CRS.from_user_input(place.crs)):
        raise _error(
            path,
            f"is in {name} ({crs.name}), the scene in {_short(place.crs)}: convert it, for example with "
            "ogr2ogr -t_srs.",
        )


def _short(crs: str) -> str:
    """Short text for a CRS in an error message: its authority code, or the name in its WKT."""
    return crs if len(crs) < 40 else crs.split('"')[1] if '"' in crs else crs[:40]


def _vectors(path: Path, layer: str | None, place: Place) -> pd.DataFrame:
    """Table of objects from a layer of points or polygons; the smallest rectangle around a polygon replaces it."""
    import pandas as pd

    found = read_vectors(path, layer, partial(_error, path), "scene.objects.layer")
    if found.crs is not None:
        _check_crs(path, found.crs, _short(found.crs), place)
    elif place.crs is not None:
        raise _error(path, f"layer {found.name!r} has no CRS, expected {_short(place.crs)}, the scene's.")
    whole = {name[:10]: name for name in _COLUMNS} if path.suffix.lower() == ".shp" else {}
    table = pd.DataFrame({whole.get(name, name): values for name, values in found.columns.items()})
    return table.assign(**_rectangles(path, found.geometries, table))


def _rectangles(path: Path, geometries: NDArray[Any], table: pd.DataFrame) -> dict[str, NDArray[Any]]:
    """Position of each point or polygon of a layer; for polygons, also size and heading of the rectangle around it."""
    import pandas as pd
    import shapely

    try:
        shapes = shapely.from_wkb(geometries)
    except shapely.errors.GEOSException as error:
        raise _error(path, f"has a geometry that cannot be read ({error}).") from None
    kinds = shapely.get_type_id(shapes)
    single = (kinds >= shapely.GeometryType.MULTIPOINT) & (shapely.get_num_geometries(shapes) == 1)
    shapes = np.where(single, shapely.get_geometry(shapes, 0), shapes)
    kinds = shapely.get_type_id(shapes)
    point, polygon = kinds == shapely.GeometryType.POINT, kinds == shapely.GeometryType.POLYGON
    wrong = np.flatnonzero(~(point | polygon) | shapely.is_empty(shapes) | (polygon & (shapely.area(shapes) <= 0.0)))
    if wrong.size:
        shape = shapes[wrong[0]]
        what = "without a geometry" if shape is None else repr(shapely.to_wkt(shape)[:40])
        raise _error(path, f"row {wrong[0] + 1} is {what}, expected a point or a polygon with an area.")
    columns = {"x_m": np.zeros(len(geometries)), "y_m": np.zeros(len(geometries))}
    columns["x_m"][point], columns["y_m"][point] = shapely.get_x(shapes[point]), shapely.get_y(shapes[point])
    if not polygon.any():
        return columns
    for name in ("length_m", "width_m", "heading_deg"):
        given = pd.to_numeric(table[name].fillna(0.0), errors="coerce") if name in table else 0.0
        columns[name] = np.where(polygon & (name != "heading_deg"), 0.0, given)
    x, y, length, width, axis = rectangles(shapes[polygon])
    for name, values in (("x_m", x), ("y_m", y), ("length_m", length), ("width_m", width)):
        columns[name][polygon] = values
    # of the two directions along a rectangle, the heading is the one that is closer to the given heading
    turned = np.abs((columns["heading_deg"][polygon] - axis + 180.0) % 360.0 - 180.0) > 90.0
    columns["heading_deg"][polygon] = (axis + 180.0 * turned) % 360.0
    return columns


def _numbers(table: pd.DataFrame, name: str, path: Path, may_be_empty: bool) -> NDArray[np.float64]:
    """Column of a table as numbers; an empty entry becomes NaN if ``may_be_empty``, else it raises an error."""
    import pandas as pd

    if name not in table:
        if name in _DEFAULTS:
            return np.full(len(table), _DEFAULTS[name])
        if may_be_empty:
            return np.full(len(table), np.nan)
        raise _error(path, f"has no column {name!r}, found {', '.join(map(str, table.columns))}.")
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=np.float64)
    empty = table[name].isna().to_numpy()
    wrong = ~np.isfinite(values) & ~(empty if may_be_empty else False)
    if wrong.any():
        row = int(np.argmax(wrong))
        value = table[name].iloc[row]
        found = "empty" if empty[row] else repr(value) if isinstance(value, str) else str(value)
        raise _error(path, f"row {row + 1}: {name} is {found}, expected a finite number.")
    return values


def _texts(table: pd.DataFrame, name: str) -> NDArray[np.str_]:
    if name not in table:
        return np.full(len(table), "")
    return table[name].astype(object).fillna("").astype(str).str.strip().to_numpy(dtype=str)


def _checked(
    table: pd.DataFrame, path: Path, place: Place, curves: Mapping[str, Any], tables: Mapping[str, CrossSection],
    permittivity: tuple[float, float] | None,
) -> Objects:  # fmt: skip
    """Objects from the rows of a table; the first row with an invalid value raises an error."""
    table = table.rename(columns=lambda name: str(name).strip())
    if (twice := table.columns[table.columns.duplicated()]).size:
        raise _error(path, f"has the column {twice[0]!r} twice, expected once.")
    for name in table.columns:
        meant = difflib.get_close_matches(name.lower(), _COLUMNS, n=1, cutoff=0.75)
        if name not in _COLUMNS and meant and meant[0] not in table.columns:
            raise _error(path, f"has an unknown column {name!r} (did you mean {meant[0]!r}?).")
    if not len(table):
        raise _error(path, "has no rows, expected one for each object.")
    classes, roofs = _texts(table, "aspect"), _texts(table, "roof")
    by_aspect, apart = classes != "", roofs != ""
    total = ~by_aspect & ~apart
    values = {
        name: _numbers(table, name, path, name in _MAY_BE_EMPTY and (name != "rcs_dbsm" or not total.all()))
        for name in ("x_m", "y_m", *_LIMITS)
    }

    def refuse(wrong: NDArray[np.bool_], name: str, expected: str) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            raise _error(path, f"row {row + 1}: {name} is {values[name][row]:.10g}, expected {expected}.")

    for name, (low, high, unit) in _LIMITS.items():
        refuse((values[name] < low) | (values[name] > high), name, f"{low:g} to {high:g} {unit}")
    both = "length_m and width_m both positive, or both 0 for a point scatterer"
    for name, other in (("length_m", "width_m"), ("width_m", "length_m")):
        refuse((values[name] == 0.0) & (values[other] > 0.0), name, both)
    for name, corner, size in zip(("x_m", "y_m"), place.corner_m, place.size_m, strict=True):
        outside = (values[name] < corner) | (values[name] > corner + size)
        refuse(outside, name, f"{corner:.10g} to {corner + size:.10g}, the scene's extent")
    known = [*curves, *dict.fromkeys(one.name for one in tables.values())]
    for row in np.flatnonzero(by_aspect & ~np.isin(classes, known))[:1]:
        raise _error(
            path,
            f"row {row + 1}: aspect is {str(classes[row])!r}, expected a class of scene.objects.aspect, of "
            f"scene.objects.cross_sections or of the file ({', '.join(known) or 'none'}).",
        )
    _check_roofs(path, apart, by_aspect, values)
    refuse(by_aspect & np.isfinite(values["rcs_dbsm"]), "rcs_dbsm", "it empty where the row has an aspect class")
    for row in np.flatnonzero(total & np.isnan(values["rcs_dbsm"]))[:1]:
        raise _error(path, f"row {row + 1}: rcs_dbsm is empty, expected a number, an aspect class or a roof.")
    values["x_m"] = values["x_m"] - place.corner_m[0]
    values["y_m"] = values["y_m"] - place.corner_m[1]
    if not values["speed_mps"].any():
        del values["speed_mps"]
    return Objects.of(values, classes, roofs, tables, permittivity, curves)


def _check_roofs(
    path: Path, apart: NDArray[np.bool_], by_aspect: NDArray[np.bool_], values: Mapping[str, NDArray[np.float64]]
) -> None:
    """Raise an error for the first row whose roof, walls and cross-section contradict each other."""
    wall, point = np.isfinite(values["wall_sigma0_db"]), values["length_m"] == 0.0
    bounce = values["bounce"]
    for wrong, text in (
        (apart & ~wall, "wall_sigma0_db is empty, expected the sigma0 of the walls [dB] beside a roof"),
        (wall & ~apart, "wall_sigma0_db is given, expected a roof beside it"),
        (apart & by_aspect, "has a roof and an aspect class, expected one of them"),
        (apart & np.isfinite(values["rcs_dbsm"]), "rcs_dbsm is given, expected it empty where the row has a roof"),
        (np.isfinite(bounce) & ~np.isin(bounce, (0.0, 1.0)), "bounce is not 0 or 1"),
        (point & (apart | (bounce == 1.0)), "has a roof or a bounce, expected length_m and width_m beside them"),
    ):
        for row in np.flatnonzero(wrong)[:1]:
            raise _error(path, f"row {row + 1}: {text}.")
