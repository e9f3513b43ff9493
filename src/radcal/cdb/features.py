"""Features of a database: points become objects, lines and areas become materials of the cells below them.

References
----------
OGC 15-113r6, sections 5.7.1 (instances, and classes by CNAM; sizes BBW along x, BBL along y, BBH; AO1 from true north
clockwise to the y axis) and tables 5-24 to 5-30 (component selectors).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from radcal.cdb.mapping import CdbMapping
from radcal.cdb.mosaic import Log
from radcal.errors import RadcalError
from radcal.findings import Finding
from radcal.reading.cdb import CdbFile
from radcal.reading.vectors import VectorLayer, read_shapefiles
from radcal.scene.crs import transformer
from radcal.scene.grid import Grid
from radcal.scene.objects import Objects

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["burnt", "objects_of", "read_features"]

_DATASETS = (100, 101, 201, 204)
_POINTS, _LINES, _AREAS = 1, 3, 5  # selectors T of the features; that of their classes is one more
_EMPTY_SHP, _EMPTY_DBF = 100, 33  # sizes of files without a record [bytes]
_LARGEST_M = 200.0  # largest side of a box that is raised
_NUMBERS = ["AO1", "AHGT", "SCALX", "SCALY", "SCALZ", "BBH", "BBL", "BBW", "HGT", "WGP"]


def read_features(files: Sequence[CdbFile], log: Log) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Points, and lines and areas, of all levels; files that cannot be read are left out with a finding.

    Returns
    -------
    pandas.DataFrame
        Points: column ``shape`` with the geometry in degrees, ``FACC`` with the feature code, and a column for each
        number of instance or class, NaN where neither has it.
    pandas.DataFrame
        Lines and areas, in the same columns.
    """
    import pandas as pd
    import shapely

    classes = {
        one: one.path.with_name(one.path.name.replace(f"_T{one.second:03d}_", f"_T{one.second + 1:03d}_"))
        for one in files
        if one.dataset in _DATASETS and one.second in (_POINTS, _LINES, _AREAS) and one.path.suffix == ".shp"
        and one.path.stat().st_size != _EMPTY_SHP
    }  # fmt: skip
    classes = {one: path.with_suffix(".dbf") for one, path in classes.items()}
    tables = [path for path in classes.values() if path.is_file() and path.stat().st_size > _EMPTY_DBF]
    paths = [*(one.path for one in classes), *tables]
    read = dict(zip(paths, read_shapefiles(paths, log.refused), strict=True))
    for path, result in read.items():
        if isinstance(result, RadcalError):
            log.left_out(path, result)
    empty = pd.DataFrame({name: np.zeros(0) for name in _NUMBERS}).assign(FACC="", shape=None)
    points, others = [empty], [empty]
    for one, path in classes.items():
        layer, table = read[one.path], read.get(path)
        if isinstance(layer, RadcalError):
            continue
        found = _joined(layer, None if isinstance(table, RadcalError) else table)
        single = shapely.get_type_id(found["shape"]) == shapely.GeometryType.POINT
        placed = single if one.second == _POINTS else shapely.get_dimensions(found["shape"]) > 0
        kept = found[(found["FACC"] != "").to_numpy() & placed]
        if lost := len(found) - len(kept):
            log.left_out(one.path, f"{lost} of its features, which have no class or no geometry of their kind")
        if len(kept):
            (points if one.second == _POINTS else others).append(kept)
    found_points, found_others = (pd.concat(parts[1:] or parts, ignore_index=True) for parts in (points, others))
    return found_points, found_others


def _joined(layer: VectorLayer, table: VectorLayer | None) -> pd.DataFrame:
    """Features with the attributes of their class, by the class name CNAM; those of the instance count first."""
    import pandas as pd
    import shapely

    own, of_class = (
        pd.DataFrame({} if one is None else {name.upper(): values for name, values in one.columns.items()})
        for one in (layer, table)
    )
    if "CNAM" in own and "CNAM" in of_class:
        of_class = of_class.drop_duplicates("CNAM").set_index("CNAM").reindex(own["CNAM"]).set_axis(own.index)
        own = own.combine_first(of_class)
    own = own.reindex(index=range(len(layer.geometries)), columns=[*_NUMBERS, "FACC"])
    numbers = own[_NUMBERS].apply(pd.to_numeric, errors="coerce").astype(np.float64)
    joined: pd.DataFrame = numbers.assign(
        FACC=own["FACC"].astype(object).fillna("").astype(str), shape=shapely.from_wkb(layer.geometries)
    )
    return joined


def objects_of(
    points: pd.DataFrame, grid: Grid, ground_m: NDArray[np.float64], mapping: CdbMapping, log: Log
) -> Objects | None:
    """Boxes of the points inside of a grid whose feature codes the mapping names; None if there is none.

    Points of other codes, without a size, or with a side above 200 m, are listed in findings. A point with AHGT has its
    height above the datum, others above the ground.

    Parameters
    ----------
    points : pandas.DataFrame
        Points of :func:`read_features`.
    grid : Grid
        Grid of the scene.
    ground_m : ndarray, shape (rows, columns)
        Heights of the scene's cells [m].
    mapping : CdbMapping
        Class of objects of each feature code.
    log : Log
        Findings, to which this function adds.
    """
    import shapely

    to_grid = transformer("EPSG:4326", grid.crs).transform
    longitude, latitude, z = shapely.get_coordinates(points["shape"], include_z=True).T
    x, y = (np.asarray(at) for at in to_grid(longitude, latitude))
    # true north, whose direction in the grid differs by the convergence of the meridians
    x_north, y_north = (np.asarray(at) for at in to_grid(longitude, latitude + 1e-5))
    of = {name: points[name].to_numpy() for name in _NUMBERS}
    scale = {name: np.where(of[f"SCAL{name}"] > 0, of[f"SCAL{name}"], 1.0) for name in "XYZ"}
    every = {
        "x": x - grid.west,
        "y": y - grid.south,
        "length": of["BBL"] * scale["Y"],
        "width": of["BBW"] * scale["X"],
        "height": np.where(of["BBH"] > 0, of["BBH"], of["HGT"]) * scale["Z"],
        "heading": np.nan_to_num(of["AO1"]) + np.degrees(np.arctan2(x_north - x, y_north - y)),
        "z": np.nan_to_num(z),
        "absolute": of["AHGT"] > 0,
    }
    size = np.stack([every[name] for name in ("length", "width", "height")])
    code = points["FACC"]
    inside = (every["x"] >= 0) & (x < grid.box[2]) & (every["y"] >= 0) & (y < grid.box[3])
    named = inside & code.isin(list(mapping.features)).to_numpy()
    sized = named & (size > 0).all(axis=0)
    small = sized & (size[:2].max(axis=0, initial=0.0) <= _LARGEST_M)
    for finding, listed in (("codes", inside & ~named), ("without_size", named & ~sized), ("large", sized & ~small)):
        _list(log, f"cdb_{finding}", code[listed])
    if not small.any():
        return None
    use, code = {name: values[small] for name, values in every.items()}, code[small]
    ground = ground_m[(use["y"] / grid.cell_m).astype(int), (use["x"] / grid.cell_m).astype(int)]
    classes = [mapping.features[one] for one in code]
    kinds, kind = np.unique([own.kind or one for own, one in zip(classes, code, strict=True)], return_inverse=True)
    return Objects(
        x_m=use["x"],
        y_m=use["y"],
        length_m=use["length"],
        width_m=use["width"],
        heading_deg=use["heading"] % 360.0,
        height_m=np.maximum(use["height"] + use["z"] - np.where(use["absolute"], ground, 0.0), 0.0),
        rcs_dbsm=np.array([own.rcs_db_per_m2 for own in classes]) + 10.0 * np.log10(use["length"] * use["width"]),
        aspect=np.full(len(classes), -1, dtype=np.int16),
        kind=kind.astype(np.int16),
        kinds=tuple(str(name) for name in kinds),
    )


def _list(log: Log, finding: str, codes: pd.Series[str]) -> None:
    """Add a finding that lists feature codes with their numbers of features, if there are any."""
    if len(codes):
        listed = ", ".join(f"{name} ({count})" for name, count in codes.value_counts().sort_index().items())
        log.append(Finding(finding, "note", "scene.root", {"features": len(codes), "codes": listed}))


def burnt(ids: NDArray[np.uint8], others: pd.DataFrame, grid: Grid, mapping: CdbMapping, log: Log) -> NDArray[np.uint8]:
    """Material ids with those of lines and areas, by the centres of cells.

    A line has its width (WGP); a line narrower than a cell is one cell wide, and counted in a finding.
    """
    import shapely
    from rasterio.features import rasterize
    from rasterio.transform import from_origin

    to_grid = transformer("EPSG:4326", grid.crs)
    shapes = shapely.transform(others["shape"].to_numpy(), lambda at: np.column_stack(to_grid.transform(*at.T)))
    near = shapely.intersects(shapes, shapely.box(*grid.box)).astype(bool)
    _list(log, "cdb_codes", others["FACC"][near & ~others["FACC"].isin(list(mapping.surfaces))])
    line = shapely.get_dimensions(shapes) == 1
    width = np.where(line, others["WGP"].fillna(0.0), 0.0).astype(np.float64)
    wide = width >= grid.cell_m
    shapes[wide] = shapely.buffer(shapes[wide], width[wide] / 2, cap_style="flat")
    number = {name: k for k, name in mapping.names.items()}
    found, drawn = ids.copy(), np.zeros(len(shapes), dtype=np.bool_)
    top_left = from_origin(grid.west, grid.box[3], grid.cell_m, grid.cell_m)
    for code, name in mapping.surfaces.items():
        own = near & (others["FACC"] == code).to_numpy()
        drawn |= own
        if own.any():
            found[rasterize(shapes[own], ids.shape, transform=top_left)[::-1] > 0] = number[name]
    if drawn.any():
        numbers = {"features": int(drawn.sum()), "narrow": int((drawn & line & ~wide).sum())}
        log.append(Finding("cdb_burnt", "note", "scene.root", numbers))
    return found
