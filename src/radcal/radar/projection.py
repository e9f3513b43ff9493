"""Computation of the geometry: projection of a scene into the image of one pass."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.angles import MEAN_RADIUS_M
from radcal.config import Radar
from radcal.errors import ConfigError, SceneError
from radcal.radar.earth import LineOfSight, line_of_sight
from radcal.radar.facets import (
    ANGLES_PER_RADIAN,
    cells_of,
    count_facets,
    fill_facets,
    flatten_terrain,
    order_facets,
)
from radcal.radar.footprints import Boxes, Spots, bearing_deg, to_boxes_and_spots
from radcal.radar.geometry import Frame, Geometry, PointScatterers, Strip, starts
from radcal.radar.lines import BLOCK, ENDS, HALO, Lines, blocks, ends, fill_lines, ground_of, share_out
from radcal.radar.points import not_pure
from radcal.radar.radiometry import of_sigma0
from radcal.radar.size import check_size, refinement
from radcal.scene.base import SceneSize
from radcal.scene.crs import earth_radius_m, ground_per_grid
from radcal.scene.model import Scene
from radcal.speckle.response import impulse_response
from radcal.standing.faces import Echoes, in_pixels

_LARGEST_KM = 1000.0  # a smaller altitude may be one in km: low orbits lie below 1000 km
_MOST_ROOFS = 15  # of which a facet's state has room for the number
_MOST_NAMES = 254  # largest number of materials, not counting objects


def make_geometry(
    scene: Scene,
    radar: Radar,
    onto: Geometry | None = None,
    strip: Strip | None = None,
) -> Geometry:
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
    strip : Strip, optional
        Strip of the image to compute, of :func:`strips_of`. All values are bit for bit those of the whole image. By
        default the whole image.

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
    _check(scene, radar)
    return _terrain_geometry(scene, radar, onto, strip)


def _check(scene: Scene, radar: Radar) -> None:
    """Raise an error if a scene with terrain has another heading than the pass, or an image that is too large."""
    if (scene.heading_deg or 0.0) != radar.heading_deg:
        raise SceneError(
            f"radar.heading_deg is {radar.heading_deg:g}, the scene's grid is made for {scene.heading_deg or 0:g}: "
            "expected the same heading in all passes."
        )
    check_size(SceneSize(scene.material.size, scene.cell_m, scene.material.size), radar)


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


@dataclass(frozen=True)
class View:
    """Position of a pass relative to a scene with terrain, and the division of the scene into lines and facets.

    Attributes
    ----------
    seen : LineOfSight
        Position of the track.
    track_m : float
        Elevation of the track [m].
    edges_m : ndarray
        Ground range of the facets' edges [m].
    base_m : float
        Slant range near the scene, to which slant ranges are relative, so that single precision is enough [m].
    k, step_m : int, float
        Number of facets along each side of a cell, and width of a facet [m].
    """

    seen: LineOfSight
    track_m: float
    edges_m: NDArray[np.float64]
    base_m: float
    k: int
    step_m: float


@dataclass(frozen=True)
class LitFacets:
    """Facets of a scene with terrain as the radar sees them, before they are divided among the pixels of an image.

    Attributes
    ----------
    view : View
        Position of the pass.
    lines : Lines
        Facets of all azimuth lines.
    material : ndarray of uint8, shape (ny, nx)
        Material id of each cell of the scene; ground range grows with the column.
    spots : Spots or None
        Point scatterers; None in a scene without objects.
    roofs : ndarray of uint8
        Material ids of the scene's list of roofs.
    """

    view: View
    lines: Lines
    material: NDArray[np.uint8]
    spots: Spots | None
    roofs: NDArray[np.uint8]


def lit_facets(scene: Scene, radar: Radar, k: int | None = None) -> LitFacets:
    """Facets of the refined elevation model of a scene, seen from a straight track.

    Parameters
    ----------
    scene : Scene
        Scene with elevation.
    radar : Radar
        Pass.
    k : int, optional
        Number of facets along each side of a cell; the facets then also have their heights. By default the fewest for
        which no facet is larger than a pixel, without heights.

    Returns
    -------
    LitFacets
        Facets with slant range, incidence, area and visibility at zero Doppler.

    Raises
    ------
    SceneError
        The terrain or an object reaches the height of the track, or the track passes over the scene.
    """
    elevation = _facing(scene.elevation_m, radar)
    mean = _mean_m(scene.elevation_m)
    view = _view(scene, radar, mean, float(elevation.max()), k)
    lines, spots, _, _ = _seen_lines(scene, radar, view, mean, slice(0, len(elevation) * view.k), k is not None)
    return LitFacets(view, lines, np.ascontiguousarray(_facing(scene.material, radar)), spots, _roof_ids(scene))


def _view(scene: Scene, radar: Radar, mean_m: float, highest_m: float, k: int | None = None) -> View:
    nx, k = scene.material.shape[1], k or refinement(scene.cell_m, radar)
    step = scene.cell_m / k
    seen = _sight(scene, radar, mean_m)
    track = mean_m + seen.height_m
    if track <= highest_m:
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, the terrain rises "
            f"{highest_m - mean_m:.0f} m: fly higher{_in_km(radar)}."
        )
    edges = np.arange(nx * k + 1) * step - nx * scene.cell_m / 2 + seen.ground_m
    if edges[0] <= 0.0:
        raise SceneError(
            f"radar.depression_deg {radar.depression_deg:g} at radar.altitude_m {radar.altitude_m:g} puts the track "
            f"over the scene: lower the depression angle or fly higher{_in_km(radar)}."
        )
    return View(seen, track, edges, float(np.hypot(seen.height_m, edges[0])), k, step)


def make_frame(scene: Scene, radar: Radar) -> Frame:
    """Frame of the strips of a scene's image in one pass; raises the errors of :func:`make_geometry`.

    Some rows are used at a time, so that a scene of :func:`.scene_on_disk` need not fit into memory.
    """
    elevation = scene.elevation_m
    if elevation is None:
        raise SceneError("simulator.strips: a scene in slant range has no strips, expected 1.")
    _check(scene, radar)
    mean = _mean_m(elevation)
    highest = max(float(elevation[first : first + BLOCK].max()) for first in range(0, len(elevation), BLOCK))
    view, near, far = _view(scene, radar, mean, highest), 0.0, np.inf
    for first, last in blocks(0, len(elevation) * view.k, view.k):
        rows = slice(max(0, first // view.k - HALO), last // view.k + HALO)
        surface = np.zeros(elevation.shape)  # of which these rows alone need memory
        surface[rows] = _facing(elevation[rows], radar)
        surface = _lowered(view.seen, surface, scene.cell_m, rows)
        near_line, far_line = ends(
            ground_of(surface, first, last, view.k, scene.cell_m, ENDS)[1:-1], view.edges_m, view.track_m
        )
        near, far = max(near, near_line), min(far, far_line)
    return Frame(mean, highest, near, far)


def _mean_m(elevation: NDArray[np.float64] | None) -> float:
    """Mean of a scene's elevations [m], read by rows; the sum of the rows' sums is rounded once."""
    assert elevation is not None  # noqa: S101 - a scene with terrain
    rows = (elevation[first : first + BLOCK].sum(axis=1) for first in range(0, len(elevation), BLOCK))
    return math.fsum(np.concatenate(list(rows))) / float(np.prod(elevation.shape))


def strips_of(lines: int, cell_m: float, radar: Radar, number: int, frame: Frame) -> list[Strip]:
    """Division of an image into strips of a multiple of 256 rows of the scene, and a halo for the impulse response.

    Parameters
    ----------
    lines : int
        Number of the scene's rows, which are along azimuth.
    cell_m : float
        Cell size [m].
    radar : Radar
        Pass.
    number : int
        Number of strips.
    frame : Frame
        Frame of the image, of :func:`make_frame`.

    Raises
    ------
    ConfigError
        The scene has fewer blocks of 256 rows than strips.
    """
    most = math.ceil(lines / BLOCK)
    if number > most:
        raise ConfigError(
            f"simulator.strips is {number}: the scene has {lines} rows in azimuth, expected at most {most} strips, "
            f"of {BLOCK} rows or more each."
        )
    columns = int(lines * cell_m / radar.azimuth_spacing_m)
    starts = [round(part * most // number * BLOCK * cell_m / radar.azimuth_spacing_m) for part in range(number)]
    # points beyond the filter's reach, but in the same or the next pixel, may still contribute
    halo = len(impulse_response(radar.azimuth_resolution_m, radar.azimuth_spacing_m)) // 2 + 2
    return [
        Strip(first, last, max(0, first - halo), min(columns, last + halo), columns, frame)
        for first, last in itertools.pairwise([*starts, columns])
    ]


def _facing(array: NDArray[Any] | None, radar: Radar) -> NDArray[Any]:
    """Cells of a scene in the order of ground range along axis 1."""
    assert array is not None  # noqa: S101 - a scene with terrain
    return array if radar.look_side == "right" else array[:, ::-1]


def _lowered(seen: LineOfSight, elevation: NDArray[np.float64], cell_m: float, rows: slice) -> NDArray[np.float64]:
    """Elevation, on a curved earth lowered; then only ``rows`` are filled, which alone need memory."""
    if math.isinf(seen.radius_m):
        return elevation
    surface = np.zeros(elevation.shape)
    surface[rows] = seen.lowered(elevation[rows], cell_m)
    return surface


def _terrain_geometry(scene: Scene, radar: Radar, onto: Geometry | None, strip: Strip | None) -> Geometry:
    """Geometry of a scene with terrain: facets of the refined elevation model, seen from a straight track."""
    elevation, material = _facing(scene.elevation_m, radar), _facing(scene.material, radar)
    frame = strip.frame if strip is not None else None
    heights = (_mean_m(scene.elevation_m), float(elevation.max())) if frame is None else (frame.mean_m, frame.highest_m)
    view = _view(scene, radar, *heights)
    seen, k, step = view.seen, view.k, view.step_m
    columns = int(len(elevation) * scene.cell_m / radar.azimuth_spacing_m)
    low, high = (0, len(elevation) * k) if strip is None else _lines_of(strip, scene, radar, k, step)
    part, rows = slice(low, high), _rows_of(slice(low, high), k)
    lines, spots, near, far = _seen_lines(scene, radar, view, heights[0], part)
    if frame is not None:
        near, far = frame.near_m, frame.far_m
    if onto is not None:
        near = seen.slant_range_m(onto.flat_incidence_deg[0]) - 0.5 * radar.range_spacing_m
    # the rows cover the slant ranges at which every azimuth line has ground, so that the image lies within the scene
    count = int((far - near) / radar.range_spacing_m) if onto is None else onto.shape[0]
    if count < 8 or columns < 8:
        raise SceneError(f"the image of the scene would have {count} x {columns} pixels: use a finer pixel spacing.")
    place, points = strip or Strip.whole(columns), PointScatterers.none()
    if spots is not None:
        points = _points(spots, radar, seen, near, step, place.left)
    for slant in (lines.near_m[part], lines.far_m[part], *(one for _, *both in lines.hidden for one in both)):
        np.subtract(slant, np.float32(near - view.base_m), out=slant)  # in place, to fractional rows of the image
        np.divide(slant, np.float32(radar.range_spacing_m), out=slant)
    if not material.flags.c_contiguous:
        material = np.zeros(material.shape, dtype=np.uint8)
        material[rows] = _facing(scene.material, radar)[rows]
    parts = _collected(scene, radar, material, lines, k, step, near, count, place)
    del lines  # about half of the memory
    made = _pixels(scene, radar, seen, parts, k, step, near, points)
    return made if strip is None else replace(made, strip=strip)


def _rows_of(part: slice, k: int) -> slice:
    """Rows of the scene that the facets on some lines depend on."""
    return slice(max(0, part.start // k // BLOCK * BLOCK - HALO), (-(-part.stop // k) // BLOCK + 1) * BLOCK + HALO)


def _seen_lines(
    scene: Scene, radar: Radar, view: View, mean_m: float, part: slice, heights: bool = False
) -> tuple[Lines, Spots | None, float, float]:
    """Facets on the lines ``part``, points, and the interval of slant ranges in which each of these lines has ground.

    All lines have memory, which the operating system gives only to those that are written.
    """
    (ny, nx), k = scene.material.shape, view.k
    surface = _lowered(view.seen, _facing(scene.elevation_m, radar), scene.cell_m, _rows_of(part, k))
    lines = Lines.empty(ny * k, nx * k, heights)
    standing = _standing(scene, radar, surface, view, mean_m, part)
    near, far = 0.0, np.inf
    walls = None if scene.objects is None else scene.objects.walls
    bounce = None if walls is None else (radar.polarisation, walls.permittivity)
    for first, last in blocks(part.start, part.stop, k):
        near_line, far_line = fill_lines(
            surface, first, last, k, view.step_m, view.edges_m, view.track_m, view.base_m, radar.range_spacing_m,
            lines, standing, view.seen, bounce,
        )  # fmt: skip
        near, far = max(near, near_line), min(far, far_line)
    if standing is None:
        return lines, None, near, far
    boxes, spots = standing
    share_out(lines, part, boxes)
    return lines, spots, near, far


def _lines_of(strip: Strip, scene: Scene, radar: Radar, k: int, step: float) -> tuple[int, int]:
    """First line that a strip needs, and the line after the last: those of its columns and of objects across them."""
    lines, per_column = scene.material.shape[0] * k, radar.azimuth_spacing_m / step
    beyond = 1
    if scene.objects is not None and len(scene.objects):
        beyond += math.ceil(float(np.hypot(scene.objects.length_m, scene.objects.width_m).max()) / step)
    high = lines if strip.right == strip.columns else math.ceil(strip.right * per_column) + beyond
    return max(0, math.floor(strip.left * per_column) - beyond), min(lines, high)


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
    scene: Scene, radar: Radar, elevation: NDArray[np.float64], view: View, mean_m: float, part: slice
) -> tuple[Boxes, Spots] | None:
    """Boxes and point scatterers of the scene's objects on the refined elevation model; None without objects.

    Only the boxes on the lines ``part`` have the heights of their roofs.
    """
    if scene.objects is None or not len(scene.objects):
        return None
    if len(scene.names) > _MOST_NAMES:
        raise SceneError(
            f"scene.objects: the scene has {len(scene.names)} material ids, expected at most {_MOST_NAMES} beside "
            "objects."
        )
    objects, cell_m = scene.objects, scene.cell_m
    across_m = objects.x_m if radar.look_side == "right" else elevation.shape[1] * cell_m - objects.x_m
    cells = (np.stack([objects.y_m, across_m]) / cell_m).astype(int)
    row, column = np.minimum(cells, np.array(elevation.shape)[:, None] - 1)
    down_m = view.track_m - elevation[row, column]
    above = 90.0 - view.seen.level_incidence_deg(view.edges_m[0] + across_m, down_m)
    rcs_m2 = objects.cross_section_m2(bearing_deg(radar.look_side), above, radar.band, radar.polarisation)
    boxes, spots = to_boxes_and_spots(objects, elevation, radar.look_side, view.k, view.step_m, rcs_m2)
    if objects.walls is not None and len(objects.walls.roofs) > _MOST_ROOFS:
        raise SceneError(
            f"scene.objects has {len(objects.walls.roofs)} materials of roofs, expected at most {_MOST_ROOFS}."
        )
    on_lines = (boxes.place[:, 0] >= part.start) & (boxes.place[:, 0] < part.stop)
    highest = float(boxes.top_m[on_lines].max(initial=-np.inf))
    if view.track_m <= highest:
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, an object rises "
            f"{highest - mean_m:.0f} m: fly higher{_in_km(radar)}."
        )
    return boxes, spots


def _in_km(radar: Radar) -> str:
    """Question whether an altitude that is too low was given in km."""
    if radar.altitude_m >= _LARGEST_KM:
        return ""
    return f" (is {radar.altitude_m:g} in km? radar.altitude_m: {1000.0 * radar.altitude_m:g})"


@dataclass(frozen=True)
class _Parts:
    """Parts of visible facets, sorted by pixel; a facet has a part in every pixel that it reaches."""

    layover: NDArray[np.bool_]
    shadow: NDArray[np.bool_]
    start: NDArray[np.int32]  # first part of each pixel
    material: NDArray[np.uint8]
    incidence: NDArray[np.uint16]
    weight: NDArray[np.float32]
    place: NDArray[np.float32]  # line and index along the line of the facet, as fill_facets has them
    masked: NDArray[np.int64]  # pixels of double bounces, and of the ground that takes part
    bounces: NDArray[np.float64]


def _objects_id(scene: Scene) -> int:
    """Material id of objects; in a scene without objects, a number above all ids."""
    return len(scene.names) + 1 if scene.objects is not None else 256


def _roof_ids(scene: Scene) -> NDArray[np.uint8]:
    """Material ids of the scene's list of roofs."""
    roofs = () if scene.objects is None or scene.objects.walls is None else scene.objects.walls.roofs
    return np.array([scene.names.index(name) + 1 for name in roofs] or [0], dtype=np.uint8)


def _collected(
    scene: Scene, radar: Radar, material: NDArray[np.uint8], lines: Lines, k: int, step: float, near: float, rows: int,
    strip: Strip,
) -> _Parts:  # fmt: skip
    """Parts of the facets in the pixels of a strip; the extents of the facets in ``lines`` are in image rows."""
    left, columns = strip.left, strip.right - strip.left
    per_column = radar.azimuth_spacing_m / step  # number of lines per image column
    counts = np.zeros(rows * columns, dtype=np.uint16)
    layover, shadow = np.zeros((2, rows, columns), dtype=np.bool_)
    extents = lines.near_m, lines.far_m, lines.state
    count_facets(columns, *extents, per_column, left, rows, columns, counts, layover, shadow)
    for line, nearest, furthest in lines.hidden:
        shadow.ravel()[in_pixels(line, nearest, furthest, per_column, left, (rows, columns))[1]] = True
    upright = Echoes.joined(lines.echoes)
    begin, end, mask = ((at - near) / radar.range_spacing_m for at in (upright.near_m, upright.far_m, upright.mask_m))
    echo, pixel, turn, share = in_pixels(upright.line, begin, end, per_column, left, (rows, columns))
    at_first = counts[pixel] + turn
    np.add.at(counts, pixel, 1)
    total = int(counts.sum(dtype=np.int64))
    if total == 0:
        raise SceneError("no part of the scene is visible to the radar.")
    if total >= 2**31:
        raise SceneError(
            f"the image would hold {total:,} parts of facets, more than {2**31:,}: use a coarser pixel spacing or a "
            "smaller scene."
        )
    start = starts(counts)
    del counts
    wall = np.isnan(upright.alpha_deg)
    ground = material[upright.line // k, upright.facet // k]
    bounced = np.setdiff1d(echo, np.flatnonzero(wall))
    columns_of_bounces = np.stack([upright.number, ground, upright.alpha_deg.round()])[:, bounced]
    parts = _Parts(
        layover, shadow, start, np.empty(total, np.uint8), np.empty(total, np.uint16), np.empty(total, np.float32),
        np.empty((2, total), np.float32),
        in_pixels(upright.line[~wall], mask[~wall], end[~wall], per_column, left, (rows, columns))[1],
        np.unique(columns_of_bounces, axis=1),
    )  # fmt: skip
    fill_facets(
        columns, *extents, lines.incidence, lines.area, material, k, per_column, left, rows, columns, start,
        radar.radiometry != "sigma0_local", _objects_id(scene), _roof_ids(scene), parts.material, parts.incidence,
        parts.weight, parts.place,
    )  # fmt: skip
    at = start[pixel] + at_first
    parts.material[at] = np.where(wall, _objects_id(scene), ground)[echo]
    parts.incidence[at] = np.nan_to_num(np.radians(upright.alpha_deg) * ANGLES_PER_RADIAN).round()[echo]
    parts.weight[at] = upright.area_m2[echo] * share
    parts.place[:, at] = -1 - np.stack([upright.line, upright.facet])[:, echo]
    return parts


def _pixels(
    scene: Scene, radar: Radar, seen: LineOfSight, parts: _Parts, k: int, step: float, near: float,
    points: PointScatterers,
) -> Geometry:  # fmt: skip
    """Geometry of a strip of the image, computed from the parts of the facets in its pixels."""
    rows, columns = shape = parts.shadow.shape
    start, facet_material, incidence, weight = parts.start, parts.material, parts.incidence, parts.weight
    local = radar.radiometry == "sigma0_local"
    flat = seen.flat_incidence_deg(near + np.arange(0.5, rows) * radar.range_spacing_m)
    per_area = _per_area(radar, flat).astype(np.float32)
    cells = np.empty(rows * columns, dtype=np.uint16)
    pure = np.zeros(rows * columns, dtype=np.uint8)
    mean_incidence = np.full(rows * columns, np.nan, dtype=np.float32)
    ground = np.full((2, rows * columns), np.nan, dtype=np.float32)
    # weights of sigma0_local are divided by the width of a pixel in lines
    width = radar.azimuth_spacing_m / step
    of_ground = np.full(rows, 1.0 / width, dtype=np.float32) if local else per_area
    order_facets(
        rows, start, columns, facet_material, incidence, weight, parts.place, of_ground, per_area, cells, pure,
        mean_incidence, ground,
    )  # fmt: skip
    if radar.radiometry == "gamma0_rtc":
        flatten_terrain(rows * columns, start, parts.place, incidence, weight)
    cell_start = starts(cells)
    cell_material = np.empty(int(cell_start[-1]), dtype=np.uint8)
    facet_start = np.empty(int(cell_start[-1]) + 1, dtype=np.int32)
    facet_start[-1] = facet_material.size
    cells_of(cells.size, start, cell_start, facet_material, cell_material, facet_start)
    # lines and facets are converted to the scene's rows and columns; columns grow eastward for either look side
    ground += np.float32(0.5)
    ground /= np.float32(k)
    ground -= np.float32(0.5)
    if radar.look_side == "left":
        ground[1] = scene.material.shape[1] - 1 - ground[1]
    not_pure(points, radar, pure.reshape(shape))
    pure[parts.masked] = 0
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
        layover=parts.layover,
        shadow=parts.shadow | (cells == 0).reshape(shape),
        flat_incidence_deg=flat,
        ground=ground.reshape(2, *shape),
        earth_radius_m=None if radar.earth == "flat" else seen.radius_m,
        point_row=points.row,
        point_column=points.column,
        point_amplitude=points.amplitude,
        point_number=points.number,
        bounces=parts.bounces,
    )


def _points(spots: Spots, radar: Radar, seen: LineOfSight, near: float, step: float, left: int) -> PointScatterers:
    """Visible point scatterers with their position and amplitude in the image, sorted by row."""
    shown = np.isfinite(spots.slant_m)
    slant = np.asarray(spots.slant_m[shown], dtype=np.float64)
    row = (slant - near) / radar.range_spacing_m - 0.5
    order = np.argsort(row, kind="stable")
    amplitude = np.sqrt(spots.rcs_m2[shown] * _per_area(radar, seen.flat_incidence_deg(slant)))
    return PointScatterers(
        row[order],
        (spots.place[shown, 0] * step / radar.azimuth_spacing_m - 0.5)[order] - left,
        amplitude.astype(np.float32)[order],
        spots.number[shown][order],
    )


def _near(cells: NDArray[np.bool_], ground: NDArray[np.float32], size: int) -> NDArray[np.bool_]:
    """Whether the ground of pixels, in rows and columns of the scene, has one of the cells within a square of cells."""
    found = np.zeros(ground.shape[1], dtype=np.bool_)
    seen = np.isfinite(ground).all(axis=0)
    row, column = np.rint(ground[:, seen]).astype(np.int64)
    first = max(0, int(row.min(initial=0)) - size)
    found[seen] = scipy.ndimage.maximum_filter(cells[first : int(row.max(initial=0)) + size + 1], size)[
        row - first, column
    ]
    return found


def _per_area(radar: Radar, flat_incidence_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a pixel's reference area in the pass's radiometry [1/m2]; ``sigma0_local`` uses the area of sigma0."""
    area = radar.range_spacing_m * radar.azimuth_spacing_m / np.sin(np.radians(flat_incidence_deg))
    return np.asarray(of_sigma0(radar.radiometry, flat_incidence_deg) / area)
