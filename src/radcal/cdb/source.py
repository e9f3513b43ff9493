"""Source of scenes ``cdb``: an OGC CDB 1.x database."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.cdb.features import read_features
from radcal.cdb.materials import MOST_BARE, NO_TILE, CdbMapping, material_ids
from radcal.cdb.mosaic import AREA, POST, Lattice, Log, heights, imagery
from radcal.config import expand_path
from radcal.errors import SceneError
from radcal.findings import Finding, Severity
from radcal.reading.cdb import CdbFile, cdb_files, imagery_files, step_deg
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.crs import named_datum
from radcal.scene.grid import grid_of_degrees, pixel_m
from radcal.scene.model import Scene, picture_step
from radcal.scene.raster import nearest_materials, resampled
from radcal.sections.scene import CdbScene
from radcal.vectors.features import burnt, list_unmapped, objects_of, placed
from radcal.vectors.mapping import read_mapping

_DATUM = "WGS 84 ellipsoid", "by the standard; the heights are used as they are"
_COARSE_POSTS = 3.0  # distance of posts [cells] from which it is a warning


def _tiles(files: Sequence[CdbFile], dataset: int) -> list[CdbFile]:
    """Tiles of the first raster of a dataset, such as the primary terrain elevation."""
    return [one for one in files if (one.dataset, one.first, one.second, one.path.suffix) == (dataset, 1, 1, ".tif")]


def _lattices(files: Sequence[CdbFile], config: CdbScene, root: Path) -> tuple[Lattice, Lattice]:
    """Lattices of the finest posts and of the finest elements of raster material; without material, those of posts."""
    posts, elements = (max(_tiles(files, k), key=lambda one: one.level, default=None) for k in (1, 5))
    if posts is None:
        raise SceneError(f"scene.root: {root} has no elevation (dataset 001) in scene.bounds.")
    step = (elements or posts).step
    return Lattice.sampled(config.bounds, posts.step, POST), Lattice.sampled(config.bounds, step, AREA)


def cdb_scene(config: CdbScene, heading_deg: float) -> Scene:
    """Scene of the finest levels that are there, with objects, lines and areas.

    Parameters
    ----------
    config : CdbScene
        Section ``scene``.
    heading_deg : float
        Heading of the track to which the grid is turned, clockwise from north [deg].

    Raises
    ------
    ConfigError
        The folder or the mapping does not exist.
    SceneError
        The database has no elevation in the bounds, or too many cells of unmapped materials; or the grid or the mapping
        is wrong.
    """
    root = expand_path(config.root, "scene.root", folder=True)
    mapping = read_mapping(expand_path(config.materials, "scene.materials"), "scene.materials", CdbMapping)
    log = Log(root)
    to_posts, to_elements = _lattices(cdb_files(root, config.bounds), config, root)
    boxes = np.array([to_posts.box, to_elements.box])
    files = cdb_files(root, (*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)))
    pictures = imagery_files(root, config.bounds)
    for one in (*files, *pictures):
        if one.fault:
            log.left_out(one.path, one.fault)
    grid = grid_of_degrees(config.bounds, config.crs, config.cell_m, to_elements.step, heading_deg)
    heights_m, of_heights = heights(_tiles(files, 1), to_posts, log)
    with log.causes():
        ids, mixtures, of_ids = material_ids(files, to_elements, mapping, log)
    step = picture_step((grid.rows, grid.columns))
    picture, of_picture = imagery([one for one in pictures if not one.fault], grid, step, log)
    for about, levels in (("elevation", of_heights), ("material", of_ids), ("imagery", of_picture)):
        if shares := _shares(levels):
            log.append(Finding("cdb_levels", "note", "scene.root", {"dataset": about, "levels": shares}))
    features = placed(read_features(files, mapping.attributes, log), "EPSG:4326", grid)
    list_unmapped(features, mapping, log)
    given = config.vertical_datum
    datum = _DATUM if given is None else (named_datum(given), "from scene.vertical_datum")

    with (
        log.causes(),
        to_posts.source(root, heights_m, np.nan) as elevation,
        to_elements.source(root, ids, NO_TILE) as materials,
        to_elements.source(root, mixtures.astype(np.uint8), NO_TILE) as mixture,
    ):
        cover = nearest_materials(materials, grid)
        drawn = burnt(cover.ids, features, grid, mapping, log)
        pure = (drawn == 0) | (drawn != cover.ids)
        mixed = (nearest_materials(mixture, grid).ids > 0) & ~pure if mixtures.any() else None
        cover = replace(cover, ids=drawn, names=mapping.names)
        scene = resampled(config.source, elevation, cover, grid, datum, heading_deg, most_bare=MOST_BARE)
        post_m = float(np.sqrt(np.prod(pixel_m(elevation, grid.crs, grid.box))))
    # the finest level may be damaged
    post_m *= max(1.0, step_deg(int(of_heights.max()), 1)[1] / to_posts.step[1])
    cells = post_m / grid.cell_m
    severity: Severity = "warning" if cells > _COARSE_POSTS else "note"
    log.append(Finding("cdb_posts", severity, "scene.root", {"post_m": post_m, "cells": cells}))
    assert scene.elevation_m is not None  # noqa: S101 - a scene on the map has heights
    objects = objects_of(features, grid, scene.elevation_m, mapping, config.cross_sections, log)
    return replace(scene, findings=(*scene.findings, *log), objects=objects, mixed=mixed, imagery=picture)


def _shares(levels: NDArray[np.int8]) -> str:
    """Levels with their shares, the finest first."""
    level, count = np.unique(levels[levels > -99], return_counts=True)
    parts = zip(level[::-1].tolist(), count[::-1] / max(count.sum(), 1), strict=True)
    return ", ".join(f"{'L' if one >= 0 else 'LC'}{abs(one):02d} ({share:.1%})" for one, share in parts)


class CdbSource(SceneSource):
    """Source ``cdb``."""

    section = CdbScene

    @staticmethod
    def size(config: CdbScene) -> SceneSize:
        """Size of the grid, from the names of the files."""
        root = expand_path(config.root, "scene.root", folder=True)
        lattices = _lattices(cdb_files(root, config.bounds), config, root)
        grid = grid_of_degrees(config.bounds, config.crs, config.cell_m, lattices[1].step, 0.0)
        cells = grid.rows * grid.columns
        return SceneSize(cells, grid.cell_m, max(cells, *(one.rows * one.columns for one in lattices)))

    make = staticmethod(cdb_scene)
