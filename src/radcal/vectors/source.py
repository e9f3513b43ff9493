"""Source of scenes ``vectors``: a raster of elevation, and the features of a vector file."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radcal.config import expand_path
from radcal.errors import SceneError
from radcal.findings import Finding
from radcal.reading.vectors import VectorLayer, read_vectors
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.crs import crs_from, horizontal
from radcal.scene.grid import Grid, opened, scene_grid, subdivision
from radcal.scene.model import Scene
from radcal.scene.raster import Cover, datum_of, resampled
from radcal.sections.scene import VectorScene
from radcal.vectors.features import NUMBERS, burnt, list_unmapped, objects_of, placed
from radcal.vectors.mapping import VectorMapping, read_mapping, text_of

if TYPE_CHECKING:
    import pandas as pd
    from pyproj import CRS


_STOREY_M = 3.0  # height of a storey
_NUMBER = r"^\s*(\d+(?:\.\d*)?)\s*m?\s*$"  # number in a text, with or without the unit


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
