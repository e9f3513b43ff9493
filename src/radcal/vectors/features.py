"""Features of vector layers: lines and areas become materials of the cells below them, points and areas objects.

The source ``vectors`` of scenes has the features of a vector file, beside a raster of elevation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import expand_path
from radcal.errors import SceneError
from radcal.findings import Finding
from radcal.reading.vectors import VectorLayer, read_vectors
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.crs import crs_from, horizontal, transformer
from radcal.scene.grid import Grid, opened, scene_grid, subdivision
from radcal.scene.model import Scene
from radcal.scene.objects import Objects, rectangles
from radcal.scene.raster import Cover, datum_of, resampled
from radcal.sections.scene import VectorScene
from radcal.standing.cross_sections import cross_sections
from radcal.vectors.mapping import FeatureClass, FeatureMapping, VectorMapping, read_mapping, text_of

if TYPE_CHECKING:
    import pandas as pd
    from pyproj import CRS

NUMBERS = ("length_m", "width_m", "height_m", "heading_deg", "base_m", "absolute", "line_m")
_LARGEST_M = 200.0  # largest side of a box that is raised
_LEAST_M2 = 0.01  # least area of a footprint
_MOST_LISTED = 20  # most frequent classes that a finding lists
_STOREY_M = 3.0  # height of a storey
_NUMBER = r"^\s*(\d+(?:\.\d*)?)\s*m?\s*$"  # number in a text, with or without the unit


def placed(features: pd.DataFrame, crs: CRS | str, grid: Grid) -> pd.DataFrame:
    """Features that lie on a grid, in its CRS.

    Parameters
    ----------
    features : pandas.DataFrame
        Column ``shape`` with geometries; texts in columns of attributes; and in columns of ``NUMBERS``, with NaN where
        there is none: sides of the box of a point, along and across its heading [m]; height [m]; bearing of its front
        from true north [deg]; height of its foot [m], above the datum where ``absolute`` is positive, else above the
        ground; width of a line [m].
    crs : pyproj.CRS or str
        CRS of the geometries.
    grid : Grid
        Grid of the scene.
    """
    import shapely

    to_grid = transformer(crs, grid.crs)
    shapes = shapely.transform(features["shape"].to_numpy(), lambda at: np.column_stack(to_grid.transform(*at.T)))
    # without a finite place: empty, or outside of where the grid's CRS is defined
    shapes[~np.isfinite(shapely.bounds(shapes)).all(axis=1)] = None
    near = shapely.intersects(shapes, shapely.box(*grid.box))
    found: pd.DataFrame = features.assign(shape=shapes)[near].reset_index(drop=True)
    return found


def burnt(
    ids: NDArray[np.uint8], features: pd.DataFrame, grid: Grid, mapping: FeatureMapping, log: list[Finding]
) -> NDArray[np.uint8]:
    """Material ids with those of lines and areas, by the centres of cells; later surfaces of a mapping lie above.

    A line that is narrower than a cell, or has no width, is one cell wide, and listed in a finding.

    Parameters
    ----------
    ids : ndarray of uint8, shape (rows, columns)
        Material ids below the features.
    features : pandas.DataFrame
        Features of :func:`placed`.
    grid : Grid
        Grid of the scene.
    mapping : FeatureMapping
        Materials of the features.
    log : list of Finding
        Findings, to which this function adds.
    """
    import shapely
    from rasterio.features import rasterize
    from rasterio.transform import from_origin

    shapes, surfaces = features["shape"].to_numpy().copy(), list(mapping.surfaces.values())
    dimensions = shapely.get_dimensions(shapes)
    which = np.where(dimensions > 0, mapping.fitting(features, mapping.surfaces), -1)
    line = (dimensions == 1) & (which >= 0)
    usual = np.array([*(one.width_m or 0.0 for one in surfaces), 0.0])[which]
    own = features["line_m"].to_numpy()
    width = np.where(own > 0, own, usual)
    wide = line & (width >= grid.cell_m)
    shapes[wide] = shapely.buffer(shapes[wide], width[wide] / 2, cap_style="flat")
    which[shapely.is_empty(shapes)] = -1  # lines without a length
    number = {name: k for k, name in mapping.names.items()}
    order = [k for k in np.argsort(which, kind="stable") if which[k] >= 0]
    drawn = [(shapes[k], number[surfaces[which[k]].material]) for k in order]
    if not drawn:
        return ids
    found = ids[::-1].copy()
    rasterize(drawn, out=found, transform=from_origin(grid.west, grid.box[3], grid.cell_m, grid.cell_m))
    log.append(Finding("features_burnt", "note", "scene", {"features": len(drawn)}))
    _list(log, "features_narrow", np.array(list(mapping.surfaces))[which[line & ~wide]])
    return found[::-1]


def objects_of(
    features: pd.DataFrame, grid: Grid, ground_m: NDArray[np.float64], mapping: FeatureMapping, tables: str | None,
    log: list[Finding],
) -> Objects | None:  # fmt: skip
    """Boxes of the points and footprints inside of a grid that fit a class of objects; None if there is none.

    The box of a footprint is the smallest rectangle around it. Features without a size, or with a side above 200 m, are
    listed in findings.

    Parameters
    ----------
    features, grid, mapping, log
        As for :func:`burnt`.
    ground_m : ndarray, shape (rows, columns)
        Heights of the scene's cells [m].
    tables : str or None
        File of ``scene.cross_sections``.

    Raises
    ------
    ConfigError
        The file does not exist.
    SceneError
        It cannot be read, or lacks a class that the mapping names.
    """
    import pandas as pd
    import shapely

    which = mapping.fitting(features, mapping.features)
    named = (which >= 0) & (shapely.get_dimensions(features["shape"].to_numpy()) != 1)
    table, keys = features[named], np.array(list(mapping.features))[which[named]]
    classes = [one.model_dump() for one in mapping.features.values()]
    usual = pd.DataFrame(classes, columns=list(FeatureClass.model_fields)).iloc[which[named]]
    names = ["length_m", "width_m", "height_m"]
    size = np.where(table[names] > 0, table[names], usual[names].astype(np.float64)).T
    shapes = table["shape"].to_numpy()
    area = shapely.area(shapes) > _LEAST_M2
    x, y = shapely.get_coordinates(shapely.centroid(shapes)).T.copy()
    heading = np.nan_to_num(table["heading_deg"].to_numpy()) + _true_north_deg(grid, x, y)
    x[area], y[area], size[0, area], size[1, area], heading[area] = rectangles(shapes[area])
    inside = (x >= grid.west) & (x < grid.box[2]) & (y >= grid.south) & (y < grid.box[3])
    sized = inside & (size > 0).all(axis=0)
    small = sized & (size[:2].max(axis=0) <= _LARGEST_M)
    for finding, listed in (("without_size", inside & ~sized), ("large", sized & ~small)):
        _list(log, f"features_{finding}", keys[listed])
    if not small.any():
        return None
    x, y, (length, width, height) = x[small] - grid.west, y[small] - grid.south, size[:, small]
    cells = (np.stack([y, x]) / grid.cell_m).astype(int)
    ground = ground_m[*np.minimum(cells, [[grid.rows - 1], [grid.columns - 1]])]
    # a shape without heights stands on the ground, also where heights are those above the datum
    absolute = table["absolute"].to_numpy()[small] > 0
    base = np.nan_to_num(table["base_m"].to_numpy()[small] - np.where(absolute, ground, 0.0))
    found = cross_sections(tables, "scene.cross_sections")
    known = list(dict.fromkeys(one.name for one in found.values()))
    if lacking := {one.cross_section for one in mapping.features.values()} - {None, *known}:
        raise SceneError(f"scene.cross_sections has no class {min(map(str, lacking))!r}, found {known}.")
    usual = usual[small]
    decibels, of_wall, bounce = usual[["rcs_db_per_m2", "wall_sigma0_db", "bounce"]].to_numpy(dtype=np.float64).T
    columns = {
        "x_m": x,
        "y_m": y,
        "length_m": length,
        "width_m": width,
        "heading_deg": heading[small] % 360.0,
        "height_m": np.maximum(height + base, 0.0),
        "rcs_dbsm": decibels + 10.0 * np.log10(length * width),
        "wall_sigma0_db": of_wall,
        "bounce": bounce,
    }
    named_classes, roofs = (usual[name].fillna("").to_numpy(dtype=str) for name in ("cross_section", "roof"))
    permittivity = None if mapping.permittivity is None else mapping.permittivity.pair
    return Objects.of(columns, named_classes, roofs, found, permittivity)


def _true_north_deg(grid: Grid, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bearing of true north in a grid at each place [deg]; it differs by the convergence of the meridians."""
    to_grid = transformer("EPSG:4326", grid.crs)
    longitude, latitude = to_grid.transform(x, y, direction="INVERSE")
    x_north, y_north = to_grid.transform(longitude, latitude + 1e-5)
    return np.asarray(np.degrees(np.arctan2(x_north - x, y_north - y)))


def list_unmapped(features: pd.DataFrame, mapping: FeatureMapping, log: list[Finding]) -> None:
    """Add a finding that lists the features of :func:`placed` that fit no key of a mapping."""
    import shapely

    points = shapely.get_dimensions(features["shape"].to_numpy()) == 0
    surface, thing = (mapping.fitting(features, keys) < 0 for keys in (mapping.surfaces, mapping.features))
    others = features[thing & (surface | points)]
    texts = np.full(len(others), "", dtype=object)
    for name in mapping.attributes:
        value = others[name].to_numpy()
        label = value if name == mapping.attribute else f"{name}=" + value
        texts = np.where((texts == "") & (value != ""), label, texts)
    _list(log, "features_unmapped", np.where(texts == "", "without an attribute", texts))


def _list(log: list[Finding], code: str, classes: Iterable[str]) -> None:
    """Add a finding that lists classes with their numbers of features, if there are any."""
    names, counts = np.unique(np.asarray(classes, dtype=str), return_counts=True)
    if not len(names):
        return
    most = np.sort(np.argsort(-counts, kind="stable")[:_MOST_LISTED])
    listed = ", ".join(f"{names[k]} ({counts[k]})" for k in most) + ", ..." * (len(names) > _MOST_LISTED)
    log.append(Finding(code, "note", "scene", {"features": int(counts.sum()), "codes": listed}))


def _error(path: Path, text: str) -> SceneError:
    return SceneError(f"scene.materials: {path} {text}")


def vector_scene(config: VectorScene, heading_deg: float = 0.0) -> Scene:
    """Scene of a raster of elevation, with materials and objects from the features of a vector file.

    Parameters
    ----------
    config : VectorScene
        Section ``scene``.
    heading_deg : float
        Heading of the track, as for :func:`radcal.scene.raster.raster_scene`.

    Raises
    ------
    ConfigError
        A file does not exist, or the mapping is not YAML.
    SceneError
        A file cannot be read, the mapping is wrong or names an attribute that no layer has, a layer has no CRS, or no
        feature gives a material to a cell.
    """
    path = expand_path(config.materials, "scene.materials")
    mapping = read_mapping(expand_path(config.names, "scene.names"), "scene.names", VectorMapping)
    log: list[Finding] = []
    with opened("scene.elevation", config) as elevation:
        datum = datum_of(elevation, config)
        grid = scene_grid(elevation, elevation, config, heading_deg)
        features, crs = _read(path, mapping, grid, log)
        ids = np.full((grid.rows, grid.columns), len(mapping.grounds), dtype=np.uint8)
        ids = burnt(ids, features, grid, mapping, log)
        cover = Cover(ids, mapping.names, "drawn at the centres of cells", "scene.materials", path, crs)
        scene = resampled(config.source, elevation, cover, grid, datum, heading_deg, config.elevation_error_m)
    list_unmapped(features, mapping, log)
    assert scene.elevation_m is not None  # noqa: S101 - a scene on the map has heights
    objects = objects_of(features, grid, scene.elevation_m, mapping, config.cross_sections, log)
    return replace(scene, findings=(*scene.findings, *log), objects=objects)


def _read(path: Path, mapping: VectorMapping, grid: Grid, log: list[Finding]) -> tuple[pd.DataFrame, CRS]:
    """Features of all layers in the CRS of a grid, and the CRS of the first layer."""
    import pandas as pd

    names: list[str | None] = [*mapping.layers] or [None]
    layers = [read_vectors(path, name, partial(_error, path), "layers in scene.names") for name in names]
    if lacking := [name for name in mapping.attributes if all(name not in one.columns for one in layers)]:
        known = ", ".join(dict.fromkeys(name for one in layers for name in one.columns))
        raise SceneError(f"scene.names names the attribute {lacking[0]!r}, {path} has {known or 'none'}.")
    found, crs = [], [_crs(path, one) for one in layers]
    for layer, own in zip(layers, crs, strict=True):
        table = _table(layer, mapping)
        if lost := int(table["shape"].isna().sum()):
            log.append(Finding("features_without_place", "warning", f"layer {layer.name}", {"features": lost}))
        found.append(placed(table, own, grid))
    return pd.concat(found, ignore_index=True), crs[0]


def _crs(path: Path, layer: VectorLayer) -> CRS:
    from pyproj.exceptions import CRSError

    try:
        return horizontal(crs_from(layer.crs or ""))
    except CRSError:
        raise _error(path, f"layer {layer.name!r} has the CRS {str(layer.crs)[:60]}, expected a known one.") from None


def _table(layer: VectorLayer, mapping: VectorMapping) -> pd.DataFrame:
    """Features of a layer with the attributes of a mapping, for :func:`radcal.vectors.features.placed`.

    References
    ----------
    OpenStreetMap Wiki, "Simple 3D Buildings" (a storey is 3 m high), "Key:height" and "Key:width" (metres by default).
    """
    import pandas as pd
    import shapely

    own = pd.DataFrame(layer.columns)
    texts = own.reindex(columns=mapping.attributes).map(text_of)

    def number(name: str) -> pd.Series[float]:
        texts = own.reindex(columns=[name])[name].astype(str)
        return texts.str.extract(_NUMBER, expand=False).astype(np.float64)

    numbers: dict[str, Any] = {
        **dict.fromkeys(NUMBERS, np.nan),
        "height_m": number(mapping.height).fillna(_STOREY_M * number(mapping.storeys)),
        "heading_deg": number(mapping.heading),
        "line_m": number(mapping.width),
    }
    table: pd.DataFrame = texts.assign(shape=shapely.from_wkb(layer.geometries, on_invalid="ignore"), **numbers)
    return table


class VectorSource(SceneSource):
    """Source ``vectors``."""

    section = VectorScene

    @staticmethod
    def size(config: VectorScene) -> SceneSize:
        """Size of the grid, from the raster of elevation."""
        with opened("scene.elevation", config) as elevation:
            grid = scene_grid(elevation, elevation, config)
            cells = grid.rows * grid.columns
            return SceneSize(cells, grid.cell_m, cells * subdivision(elevation, grid) ** 2)

    make = staticmethod(vector_scene)
