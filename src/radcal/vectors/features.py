"""Features of vector layers: lines and areas become materials of the cells below them, points and areas objects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SceneError
from radcal.findings import Finding
from radcal.scene.crs import transformer
from radcal.scene.grid import Grid
from radcal.scene.objects import Objects, rectangles
from radcal.standing.cross_sections import cross_sections
from radcal.vectors.mapping import FeatureClass, FeatureMapping

if TYPE_CHECKING:
    import pandas as pd
    from pyproj import CRS


NUMBERS = ("length_m", "width_m", "height_m", "heading_deg", "base_m", "absolute", "line_m")
_LARGEST_M = 200.0  # largest side of a box that is raised
_LEAST_M2 = 0.01  # least area of a footprint
_MOST_LISTED = 20  # most frequent classes that a finding lists


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
