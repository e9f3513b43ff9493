"""Computation of the geometry: projection of a scene into the image of one pass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.angles import MEAN_RADIUS_M
from radcal.config import Radar
from radcal.errors import SceneError
from radcal.radar.earth import LineOfSight, line_of_sight
from radcal.radar.facets import (
    ANGLES_PER_RADIAN,
    cells_of,
    count_facets,
    fill_facets,
    flatten_terrain,
    order_facets,
    shade,
)
from radcal.radar.footprints import Boxes, Spots, share_out, to_boxes_and_spots
from radcal.radar.geometry import Geometry, PointScatterers
from radcal.radar.lines import BLOCK, Lines, fill_lines
from radcal.radar.points import not_pure
from radcal.radar.radiometry import of_sigma0
from radcal.radar.size import check_size, refinement
from radcal.scene.base import SceneSize
from radcal.scene.crs import earth_radius_m, ground_per_grid
from radcal.scene.model import Scene

__all__ = ["make_geometry"]

_LARGEST_KM = 1000.0  # a smaller altitude may be one in km: low orbits lie below 1000 km
_MOST_NAMES = 254  # largest number of materials, not counting objects


def make_geometry(scene: Scene, radar: Radar, onto: Geometry | None = None) -> Geometry:
    """Geometry of the image of a scene in one pass.

    Parameters
    ----------
    scene : Scene
        Scene.
    radar : Radar
        Pass.
    onto : Geometry, optional
        Geometry whose image grid is used: a geometry of the same pass over other relief with the same mean elevation
        and extent. By default the image covers all slant ranges at which every azimuth line has ground.

    Raises
    ------
    ConfigError
        The image would have too many facets or pixels.
    SceneError
        The terrain reaches the height of the track, the track passes over the scene, or no part of the scene is
        visible. The error is also raised if the image would have fewer than 8 rows or columns, or too many parts of
        facets, or if the grid of the scene is made for another heading of the track.
    """
    if scene.elevation_m is None:
        return _slant_range_geometry(scene, radar)
    if (scene.heading_deg or 0.0) != radar.heading_deg:
        raise SceneError(
            f"radar.heading_deg is {radar.heading_deg:g}, the scene's grid is made for {scene.heading_deg or 0:g}: "
            "expected the same heading in all passes."
        )
    check_size(SceneSize(scene.material.size, scene.cell_m, scene.material.size), radar)
    return _terrain_geometry(scene, radar, onto)


def _slant_range_geometry(scene: Scene, radar: Radar) -> Geometry:
    """Geometry of a slant-range scene: each labelled pixel is one facet with the incidence angle of its row."""
    assert scene.incidence_deg is not None  # noqa: S101 - a scene has either elevation or incidence
    rows, columns = shape = (scene.material.shape[0], scene.material.shape[1])
    labelled = scene.material > 0
    if not labelled.any():
        raise SceneError("no part of the scene is visible to the radar.")
    cells = int(np.count_nonzero(labelled))
    weight = of_sigma0(radar.radiometry, scene.incidence_deg)
    angles = np.round(np.radians(scene.incidence_deg) * ANGLES_PER_RADIAN).astype(np.uint16)
    return Geometry(
        shape=shape,
        names=scene.names,
        cell_start=np.concatenate([[0], np.cumsum(labelled)]).astype(np.int32),
        cell_material=scene.material[labelled],
        facet_start=np.arange(cells + 1, dtype=np.int32),
        facet_incidence=np.broadcast_to(angles[:, None], shape)[labelled],
        facet_weight=np.broadcast_to(weight[:, None], shape)[labelled].astype(np.float32),
        material=scene.material,
        incidence_deg=np.where(labelled, scene.incidence_deg[:, None], np.nan).astype(np.float32),
        layover=np.zeros(shape, dtype=np.bool_),
        shadow=np.zeros(shape, dtype=np.bool_),
        flat_incidence_deg=scene.incidence_deg.astype(np.float64),
        ground=np.full((2, rows, columns), np.nan, dtype=np.float32),
    )


def _terrain_geometry(scene: Scene, radar: Radar, onto: Geometry | None) -> Geometry:
    """Geometry of a scene with terrain: facets of the refined elevation model, seen from a straight track."""
    elevation = scene.elevation_m
    assert elevation is not None  # noqa: S101 - checked by the caller
    material = scene.material
    if radar.look_side == "left":  # ground range grows westward
        elevation, material = elevation[:, ::-1], material[:, ::-1]
    k = refinement(scene.cell_m, radar)
    step = scene.cell_m / k
    ny, nx = elevation.shape
    mean = float(elevation.mean())
    seen = _sight(scene, radar, mean)
    track = mean + seen.height_m
    if track <= elevation.max():
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, the terrain rises "
            f"{elevation.max() - mean:.0f} m: fly higher{_in_km(radar)}."
        )
    edges = np.arange(nx * k + 1) * step - nx * scene.cell_m / 2 + seen.ground_m
    if edges[0] <= 0.0:
        raise SceneError(
            f"radar.depression_deg {radar.depression_deg:g} at radar.altitude_m {radar.altitude_m:g} puts the track "
            f"over the scene: lower the depression angle or fly higher{_in_km(radar)}."
        )
    # slant ranges are stored relative to a base slant range near the scene, so that single precision is enough
    base = float(np.hypot(seen.height_m, edges[0]))
    lines = Lines.empty(ny * k, nx * k)
    elevation = seen.lowered(elevation, scene.cell_m)
    standing = _standing(scene, radar, elevation, track, k, step)
    near, far = 0.0, np.inf
    for first in range(0, ny * k, BLOCK * k):
        last = min(ny * k, first + BLOCK * k)
        near_line, far_line = fill_lines(
            elevation, first, last, k, step, edges, track, base, radar.range_spacing_m, lines, standing, seen
        )
        near, far = max(near, near_line), min(far, far_line)
    if onto is not None:
        near = seen.slant_range_m(onto.flat_incidence_deg[0]) - 0.5 * radar.range_spacing_m
    points = PointScatterers.none()
    if standing is not None:
        boxes, spots = standing
        share_out(
            len(lines.near_m), lines.near_m, lines.far_m, lines.state, lines.area, lines.area.view(np.int32),
            boxes.rcs_m2, boxes.extent,
        )  # fmt: skip
        points = _points(spots, radar, seen, near, step)

    # the rows cover the slant ranges at which every azimuth line has ground, so that the image lies within the scene
    rows = int((far - near) / radar.range_spacing_m) if onto is None else onto.shape[0]
    columns = int(ny * scene.cell_m / radar.azimuth_spacing_m)
    if rows < 8 or columns < 8:
        raise SceneError(f"the image of the scene would have {rows} x {columns} pixels: use a finer pixel spacing.")
    material = np.ascontiguousarray(material)
    return _pixels(scene, radar, seen, material, lines, k, step, near, base, (rows, columns), points)


def _sight(scene: Scene, radar: Radar, mean_m: float) -> LineOfSight:
    """Position of the track relative to the scene's centre, over ground at the scene's mean elevation."""
    if radar.earth == "flat":
        return line_of_sight(radar)
    radius, along, across = MEAN_RADIUS_M, 1.0, 1.0
    if scene.crs is not None and scene.transform is not None:
        ny, nx = scene.material.shape
        a, b, c, d, e, f = scene.transform
        centre = (a * nx / 2 + b * ny / 2 + c, d * nx / 2 + e * ny / 2 + f)
        radius = earth_radius_m(scene.crs, centre, radar.heading_deg + 90.0)  # along ground range
        along, across = (ground_per_grid(scene.crs, centre, axis) for axis in ((b, e), (a, d)))
    higher = 1.0 + mean_m / radius  # distances on the ground grow with elevation
    return line_of_sight(radar, radius + mean_m, (along * higher, across * higher))


def _standing(
    scene: Scene, radar: Radar, elevation: NDArray[np.float64], track: float, k: int, step: float
) -> tuple[Boxes, Spots] | None:
    """Boxes and point scatterers of the scene's objects on the refined elevation model; None without objects."""
    if scene.objects is None or not len(scene.objects):
        return None
    if len(scene.names) > _MOST_NAMES:
        raise SceneError(
            f"scene.objects: the scene has {len(scene.names)} material ids, expected at most {_MOST_NAMES} beside "
            "objects."
        )
    standing = to_boxes_and_spots(scene.objects, elevation, radar.look_side, k, step)
    if standing[0].top_m.size and track <= standing[0].top_m.max():
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, an object rises "
            f"{standing[0].top_m.max() - elevation.mean():.0f} m: fly higher{_in_km(radar)}."
        )
    return standing


def _in_km(radar: Radar) -> str:
    """Question whether an altitude that is too low was given in km."""
    if radar.altitude_m >= _LARGEST_KM:
        return ""
    return f" (is {radar.altitude_m:g} in km? radar.altitude_m: {1000.0 * radar.altitude_m:g})"


def _pixels(
    scene: Scene, radar: Radar, seen: LineOfSight, material: NDArray[np.uint8], lines: Lines, k: int, step: float,
    near: float, base: float, shape: tuple[int, int], points: PointScatterers,
) -> Geometry:  # fmt: skip
    """Geometry of the image, computed from the facets of all lines; a facet belongs to every pixel that it reaches."""
    rows, columns = shape
    per_column = radar.azimuth_spacing_m / step  # number of lines per image column
    near_row, far_row, layover, shadow, counts = _counted(lines, radar, near - base, per_column, shape)
    total = int(counts.sum(dtype=np.int64))
    start = np.zeros(rows * columns + 1, dtype=np.int32)
    np.cumsum(counts, out=start[1:])
    facet_material, incidence = np.empty(total, dtype=np.uint8), np.empty(total, dtype=np.uint16)
    weight = np.empty(total, dtype=np.float32)
    place = np.empty((2, total), dtype=np.float32)
    local = radar.radiometry == "sigma0_local"
    # material id of objects; in a scene without objects, a number above all ids
    objects = len(scene.names) + 1 if scene.objects is not None else 256
    fill_facets(
        columns, near_row, far_row, lines.state, lines.incidence, lines.area, material, k, per_column, rows, columns,
        start, not local, objects, facet_material, incidence, weight, place,
    )  # fmt: skip
    flat = seen.flat_incidence_deg(near + np.arange(0.5, rows) * radar.range_spacing_m)
    per_area = _per_area(radar, flat).astype(np.float32)
    cells = np.empty(rows * columns, dtype=np.uint16)
    pure = np.zeros(rows * columns, dtype=np.uint8)
    mean_incidence = np.full(rows * columns, np.nan, dtype=np.float32)
    ground = np.full((2, rows * columns), np.nan, dtype=np.float32)
    # weights of sigma0_local are divided by the width of a pixel in lines
    of_ground = np.full(rows, 1.0 / per_column, dtype=np.float32) if local else per_area
    order_facets(
        rows, start, columns, facet_material, incidence, weight, place, of_ground, per_area, objects, cells, pure,
        mean_incidence, ground,
    )  # fmt: skip
    if radar.radiometry == "gamma0_rtc":
        flatten_terrain(rows * columns, start, facet_material, incidence, weight, objects)
    cell_start = np.zeros(cells.size + 1, dtype=np.int32)
    np.cumsum(cells, out=cell_start[1:])
    cell_material = np.empty(int(cell_start[-1]), dtype=np.uint8)
    facet_start = np.empty(int(cell_start[-1]) + 1, dtype=np.int32)
    facet_start[-1] = facet_material.size
    cells_of(cells.size, start, cell_start, facet_material, cell_material, facet_start)
    # lines and facets are converted to the scene's rows and columns; columns grow eastward for either look side
    ground = (ground + np.float32(0.5)) / np.float32(k) - np.float32(0.5)
    if radar.look_side == "left":
        ground[1] = scene.material.shape[1] - 1 - ground[1]
    not_pure(points, radar, pure.reshape(shape))
    if scene.mixed is not None:
        spacing_m = max(radar.azimuth_spacing_m, radar.range_spacing_m / float(np.sin(np.radians(flat.min()))))
        pure[_near(scene.mixed, ground, int(np.ceil(spacing_m / scene.cell_m)) | 1)] = 0
    return Geometry(
        shape=shape,
        names=scene.names,
        cell_start=cell_start,
        cell_material=cell_material,
        facet_start=facet_start,
        facet_incidence=incidence,
        facet_weight=weight,
        material=pure.reshape(shape),
        incidence_deg=mean_incidence.reshape(shape),
        layover=layover,
        shadow=shadow | (cells == 0).reshape(shape),
        flat_incidence_deg=flat,
        ground=ground.reshape(2, *shape),
        earth_radius_m=None if radar.earth == "flat" else seen.radius_m,
        point_row=points.row,
        point_column=points.column,
        point_amplitude=points.amplitude,
        point_number=points.number,
    )


def _counted(
    lines: Lines, radar: Radar, near_m: float, per_column: float, shape: tuple[int, int]
) -> tuple[NDArray[Any], ...]:
    """First and last row of each facet, masks of layover and shadow, and number of facets that reach each pixel."""
    rows, columns = shape
    to_rows = (near_m, radar.range_spacing_m)
    near_row, far_row = _rows(lines.near_m, *to_rows), _rows(lines.far_m, *to_rows)
    counts = np.zeros(rows * columns, dtype=np.uint16)
    layover, shadow = np.zeros((2, rows, columns), dtype=np.bool_)
    count_facets(columns, near_row, far_row, lines.state, per_column, rows, columns, counts, layover, shadow)
    for line, nearest, furthest in lines.hidden:
        shade(line, _rows(nearest, *to_rows), _rows(furthest, *to_rows), per_column, shadow)
    total = int(counts.sum(dtype=np.int64))
    if total == 0:
        raise SceneError("no part of the scene is visible to the radar.")
    if total >= 2**31:
        raise SceneError(
            f"the image would hold {total:,} parts of facets, more than {2**31:,}: use a coarser pixel spacing or a "
            "smaller scene."
        )
    return near_row, far_row, layover, shadow, counts


def _rows(slant_m: NDArray[np.float32], near_m: float, spacing_m: float) -> NDArray[np.float32]:
    """Slant ranges [m] converted to fractional rows of the image, counted from the near edge of the first row."""
    return ((slant_m - near_m) / spacing_m).astype(np.float32)


def _points(spots: Spots, radar: Radar, seen: LineOfSight, near: float, step: float) -> PointScatterers:
    """Visible point scatterers with their position and amplitude in the image, sorted by row."""
    shown = np.isfinite(spots.slant_m)
    slant = np.asarray(spots.slant_m[shown], dtype=np.float64)
    row = (slant - near) / radar.range_spacing_m - 0.5
    order = np.argsort(row, kind="stable")
    amplitude = np.sqrt(spots.rcs_m2[shown] * _per_area(radar, seen.flat_incidence_deg(slant)))
    return PointScatterers(
        row[order],
        (spots.place[shown, 0] * step / radar.azimuth_spacing_m - 0.5)[order],
        amplitude.astype(np.float32)[order],
        spots.number[shown][order],
    )


def _near(cells: NDArray[np.bool_], ground: NDArray[np.float32], size: int) -> NDArray[np.bool_]:
    """Whether the ground of pixels, in rows and columns of the scene, has one of the cells within a square of cells."""
    from scipy.ndimage import maximum_filter

    found = np.zeros(ground.shape[1], dtype=np.bool_)
    seen = np.isfinite(ground).all(axis=0)
    row, column = np.rint(ground[:, seen]).astype(np.int64)
    found[seen] = maximum_filter(cells, size)[row, column]
    return found


def _per_area(radar: Radar, flat_incidence_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a pixel's reference area in the pass's radiometry [1/m2]; ``sigma0_local`` uses the area of sigma0."""
    area = radar.range_spacing_m * radar.azimuth_spacing_m / np.sin(np.radians(flat_incidence_deg))
    return np.asarray(of_sigma0(radar.radiometry, flat_incidence_deg) / area)
