"""Acquisition geometry: everything about a pass that does not depend on the backscatter laws.

Image coordinates: axis 0 is slant range (row 0 nearest), axis 1 is azimuth.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt, map_coordinates, maximum_filter, minimum_filter

from radcal.config import Radar
from radcal.errors import SceneError, StoreError
from radcal.radar import SIMULATOR_VERSION
from radcal.radar.facets import (
    ANGLES_PER_RADIAN,
    LAID_OVER,
    OBJECT,
    VISIBLE,
    cells_of,
    count_facets,
    fill_facets,
    order_facets,
    shade,
)
from radcal.radar.footprints import (
    Boxes,
    Raised,
    Seen,
    Spots,
    add_up,
    locate,
    raise_boxes,
    share_out,
    stand,
    to_boxes_and_spots,
)
from radcal.radar.points import Points, not_pure
from radcal.radar.radiometry import of_sigma0
from radcal.radar.size import check_size, refinement
from radcal.radar.visibility import FAR_HALF, NEAR_HALF, laid_over
from radcal.scene.model import Scene
from radcal.scene.size import SceneSize
from radcal.storage.records import read_hdf5, write_hdf5

__all__ = [
    "Geometry",
    "local_incidence_cosine",
    "make_geometry",
    "read_geometry",
    "write_geometry",
]

_MOST_NAMES = 254  # largest number of materials, besides objects
_CELLS_AT_ONCE = 256  # number of the scene's rows in a block, which bounds memory
_HALO = 12  # cells beyond a stretch that its cubic spline takes in: what is further has no effect in single precision


@dataclass(frozen=True)
class Geometry:
    """Facets of the scene in the image of one pass.

    A *cell* is the contribution of one material to one pixel. Cells are in the order of pixels, within a pixel in the
    order of materials, and the facets of a cell are consecutive.

    Attributes
    ----------
    shape : (int, int)
        Image size: slant-range rows, azimuth columns.
    names : tuple of str
        Material names; id k is ``names[k - 1]``.
    cell_start : ndarray of int32, shape (pixels + 1,)
        First cell of each pixel, by flat image index.
    cell_material : ndarray of uint8, shape (cells,)
        Material id; one beyond the last for objects, whose sigma0 is 1.
    facet_start : ndarray of int32, shape (cells + 1,)
        First facet of each cell. A facet belongs to every pixel that it reaches.
    facet_incidence : ndarray of uint16, shape (facets,)
        Local incidence angle in units of 90 degrees / 65535.
    facet_weight : ndarray of float32, shape (facets,)
        Weight of the facet's sigma0 in the sum that is the pixel's value: the share of the pixel's slant range that the
        facet covers (``sigma0_local``: 1 in all, more in layover, less beside shadow), or its area in the pixel over
        the pixel's reference area. The weight of an object's facet is its part of the cross-section over the reference
        area.
    material : ndarray of uint8, shape ``shape``
        Material id where all visible facets of a pixel share one, else 0; 0 near objects, too.
    incidence_deg : ndarray of float32, shape ``shape``
        Mean local incidence of the pixel's visible ground [deg], NaN where there is none.
    layover : ndarray of bool, shape ``shape``
        Whether facets of separate places share the pixel, between which slant range decreases by more than a pixel.
    shadow : ndarray of bool, shape ``shape``
        Whether some of the pixel's facets, or all, are hidden or face away.
    flat_incidence_deg : ndarray of float64, shape (rows,)
        Incidence on flat ground at each row's slant range [deg].
    ground : ndarray of float32, shape (2, rows, columns)
        Mean row and column of the pixel's visible facets in the scene's grid, cell centres at
        whole numbers; NaN where there is none, and in a slant-range scene.
    point_row, point_column : ndarray of float64, shape (points,)
        Place of the visible point scatterers in the image, in ascending rows; pixel centres are at
        whole numbers.
    point_amplitude : ndarray of float32, shape (points,)
        Square root of the cross-section over the pixel's reference area.
    point_number : ndarray of uint32, shape (points,)
        Index of the entry in the scene's objects.
    """

    shape: tuple[int, int]
    names: tuple[str, ...]
    cell_start: NDArray[np.int32]
    cell_material: NDArray[np.uint8]
    facet_start: NDArray[np.int32]
    facet_incidence: NDArray[np.uint16]
    facet_weight: NDArray[np.float32]
    material: NDArray[np.uint8]
    incidence_deg: NDArray[np.float32]
    layover: NDArray[np.bool_]
    shadow: NDArray[np.bool_]
    flat_incidence_deg: NDArray[np.float64]
    ground: NDArray[np.float32]
    point_row: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    point_column: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    point_amplitude: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, dtype=np.float32))
    point_number: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, dtype=np.uint32))

    @property
    def points(self) -> Points:
        """Visible point scatterers."""
        return Points(self.point_row, self.point_column, self.point_amplitude, self.point_number)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Pixels that hold an echo of the scene, shape ``shape``."""
        return np.asarray(np.diff(self.cell_start).reshape(self.shape) > 0)

    def pixels(self, name: str, margin_px: int | NDArray[np.int64] = 0) -> NDArray[np.int64]:
        """Flat indices of the visible pixels that hold one material only.

        Parameters
        ----------
        name : str
            Material.
        margin_px : int or ndarray of int, shape ``shape``
            Pixels at most this far (in rows or columns) from a pixel of another
            material, a mixed or an invisible one, or from the image's border are masked.

        Returns
        -------
        ndarray of int64, ascending
        """
        inside = self.material == self.names.index(name) + 1
        if np.any(np.asarray(margin_px) > 0):
            # the scene is not simulated beyond the image's border, so that resolution cells along it are incomplete
            padded = np.pad(inside, 1)
            distance = distance_transform_cdt(padded, metric="chessboard")[1:-1, 1:-1]
            inside = distance > margin_px
        return np.flatnonzero(inside)


def local_incidence_cosine(
    along: NDArray[np.float64], across: NDArray[np.float64], to_radar: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Cosine of the local incidence angle from the surface's slopes.

    Parameters
    ----------
    along, across : ndarray, shape (ny, nx)
        Rise of the surface along azimuth, and along ground range away from the track [m/m].
    to_radar : (ndarray, ndarray), each broadcastable to (ny, nx)
        Components of the unit vector to the radar along ground range and up
        (zero Doppler: none along azimuth).

    Returns
    -------
    ndarray, shape (ny, nx)
        Product n . r of the unit normal n and the direction r to the radar; negative for surfaces that face away.

    References
    ----------
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE
    TGRS 34 (1996), eq. 10.
    """
    toward, up = to_radar
    return np.asarray((up - across * toward) / np.sqrt(1.0 + along**2 + across**2))


def make_geometry(scene: Scene, radar: Radar) -> Geometry:
    """Geometry of a scene in one pass.

    Raises
    ------
    ConfigError
        The image would be too large for any machine.
    SceneError
        The terrain reaches the height of the track, or nothing is visible.
    """
    if scene.elevation_m is None:
        return _slant_range_geometry(scene, radar)
    check_size(SceneSize(scene.material.size, scene.cell_m, scene.material.size), radar)
    return _terrain_geometry(scene, radar)


def _slant_range_geometry(scene: Scene, radar: Radar) -> Geometry:
    """Geometry of a slant-range scene: one facet for each labelled pixel, incidence by row."""
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


def _terrain_geometry(scene: Scene, radar: Radar) -> Geometry:
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
    track = mean + radar.altitude_m
    if track <= elevation.max():
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, the terrain rises "
            f"{elevation.max() - mean:.0f} m: fly higher."
        )
    centre = radar.altitude_m / np.tan(np.radians(radar.depression_deg))
    edges = np.arange(nx * k + 1) * step - nx * scene.cell_m / 2 + centre
    if edges[0] <= 0.0:
        raise SceneError(
            f"radar.depression_deg {radar.depression_deg:g} at radar.altitude_m {radar.altitude_m:g} puts the track "
            "over the scene: lower the depression angle or fly higher."
        )
    # slant range is counted from a point near the scene, for which single precision is enough
    base = float(np.hypot(radar.altitude_m, edges[0]))
    lines = Lines.empty(ny * k, nx * k)
    standing = None
    if scene.objects is not None and len(scene.objects):
        if len(scene.names) > _MOST_NAMES:
            raise SceneError(
                f"scene.objects: the scene has {len(scene.names)} material ids, expected at most {_MOST_NAMES} beside "
                "objects."
            )
        standing = to_boxes_and_spots(scene.objects, elevation, radar.look_side, k, step)
        if standing[0].top_m.size and track <= standing[0].top_m.max():
            raise SceneError(
                f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, an object rises "
                f"{standing[0].top_m.max() - mean:.0f} m: fly higher."
            )
    near, far = 0.0, np.inf
    for first in range(0, ny, _CELLS_AT_ONCE):
        last = min(ny, first + _CELLS_AT_ONCE)
        near_line, far_line = _lines(
            elevation, first, last, k, step, edges, track, base, radar.range_spacing_m, lines, standing
        )
        near, far = max(near, near_line), min(far, far_line)
    points = Points.none()
    if standing is not None:
        boxes, spots = standing
        share_out(
            lines.near_m, lines.far_m, lines.state, lines.area, lines.area.view(np.int32), boxes.rcs_m2, boxes.extent
        )
        points = _points(spots, radar, near, step)

    # rows from the first to the last range that every azimuth line reaches, so that the image lies within the scene
    rows = int((far - near) / radar.range_spacing_m)
    columns = int(ny * scene.cell_m / radar.azimuth_spacing_m)
    if rows < 8 or columns < 8:
        raise SceneError(f"the image of the scene would have {rows} x {columns} pixels: use a finer pixel spacing.")
    return _pixels(scene, radar, np.ascontiguousarray(material), lines, k, step, near, base, (rows, columns), points)


@dataclass(frozen=True)
class Lines:
    """Facets along the azimuth lines of the refined scene; arrays of shape (lines, facets).

    Slant ranges are counted from ``base``; those of a partly visible facet are of its visible part. ``hidden`` holds
    line, nearest and furthest slant range of the hidden parts, for every block of lines.
    """

    near_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    incidence: NDArray[np.uint16]
    area: NDArray[np.float32]
    state: NDArray[np.uint8]
    hidden: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]]

    @classmethod
    def empty(cls, lines: int, facets: int) -> Lines:
        """Uninitialised arrays for so many lines and facets."""
        shape = (lines, facets)
        return cls(
            np.empty(shape, np.float32),
            np.empty(shape, np.float32),
            np.empty(shape, np.uint16),
            np.empty(shape, np.float32),
            np.empty(shape, np.uint8),
            [],
        )


def _refined(
    block: NDArray[np.float64], rows: NDArray[np.float64], columns: NDArray[np.float64], cell_m: float
) -> NDArray[np.float64]:
    """Elevation between the cells' middles: a cubic spline, bilinear along walls, where a spline would swing."""
    at = np.meshgrid(rows, columns, indexing="ij")
    fine = map_coordinates(block, at, order=3, mode="nearest")
    # a slope of three between a cell's neighbours, which are two cells apart
    wall = maximum_filter(block, 3) - minimum_filter(block, 3) > 6.0 * cell_m
    if wall.any():
        steep = map_coordinates(wall.astype(np.uint8), at, order=0, mode="nearest") > 0
        fine = np.where(steep, map_coordinates(block, at, order=1, mode="nearest"), fine)
    return np.asarray(fine)


def _lines(
    elevation: NDArray[np.float64], first: int, last: int, k: int, step: float, edges: NDArray[np.float64],
    track: float, base: float, spacing_m: float, lines: Lines, standing: tuple[Boxes, Spots] | None,
) -> tuple[float, float]:  # fmt: skip
    """Fill the lines of some rows of cells; return the slant ranges [m] that all of them reach, from and to."""
    ny, nx = elevation.shape
    # elevation continues linearly beyond the scene's border, with one more line on each side for the slopes
    low, high = max(0, first - _HALO), min(ny, last + _HALO)
    beyond = ((_HALO - first + low, _HALO - high + last), (_HALO, _HALO))
    block = np.pad(elevation[low:high], beyond, mode="reflect", reflect_type="odd")
    if k == 1:
        fine = block[_HALO - 1 : _HALO + last - first + 1, _HALO:-_HALO]
    else:
        rows = (np.arange(-1, (last - first) * k + 1) + 0.5) / k - 0.5 + _HALO
        columns = (np.arange(nx * k) + 0.5) / k - 0.5 + _HALO
        fine = _refined(block, rows, columns, step * k)
    ground = 0.5 * (edges[1:] + edges[:-1])
    beyond_ground, fine = fine, fine[1:-1]
    # heights at the facets' edges: neighbours share them, so that facets tile slant range without gaps
    at_edges = np.empty((fine.shape[0], fine.shape[1] + 1))
    at_edges[:, 1:-1] = 0.5 * (fine[:, 1:] + fine[:, :-1])
    at_edges[:, 0], at_edges[:, -1] = 1.5 * fine[:, 0] - 0.5 * fine[:, 1], 1.5 * fine[:, -1] - 0.5 * fine[:, -2]
    reach = np.hypot(track - at_edges, edges)
    raised = Raised.none(fine) if standing is None else raise_boxes(standing[0], fine, first * k)
    seen = Seen.room(np.minimum(reach[:, 1:], reach[:, :-1]), np.maximum(reach[:, 1:], reach[:, :-1]))
    stand(
        raised.owner, raised.roof_m, at_edges, edges, ground, track, seen.near_m, seen.far_m, seen.share, seen.half,
        seen.hidden_m, seen.horizon, seen.extent_m,
    )  # fmt: skip
    if standing is not None:
        boxes, spots = standing
        add_up(raised.owner, seen.extent_m, boxes.extent)
        locate(
            spots.place, spots.height_m, beyond_ground, first * k, last * k, seen.horizon, edges, track, step,
            spots.slant_m,
        )  # fmt: skip
    visible = seen.share > 0.0
    laid = laid_over(np.hypot(track - raised.roof_m, ground), visible, spacing_m)
    part = slice(first * k, last * k)
    lines.near_m[part], lines.far_m[part] = seen.near_m - base, seen.far_m - base
    lines.incidence[part], lines.area[part] = _faces(beyond_ground, at_edges, seen, ground, track, step)
    lines.state[part] = visible * VISIBLE + laid * LAID_OVER
    standing_here = raised.owner >= 0
    # the cross-section of a facet is known only after the last line; until then its area holds the number of its box
    lines.area[part].view(np.int32)[standing_here] = raised.owner[standing_here]
    lines.state[part] |= standing_here * np.uint8(OBJECT)
    line, facet = np.nonzero(seen.hidden_m[1] > seen.hidden_m[0])
    hidden = [(extreme[line, facet] - base).astype(np.float32) for extreme in seen.hidden_m]
    lines.hidden.append((line + first * k, hidden[0], hidden[1]))
    return float(reach[:, 0].max()), float(reach[:, -1].min())


def _faces(
    fine: NDArray[np.float64], at_edges: NDArray[np.float64], seen: Seen, ground: NDArray[np.float64], track: float,
    step: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Incidence, in its units, and area [m2] of the visible parts of the facets of some lines.

    Where only one half of a facet is visible, the slope along ground range is that of this half.
    """
    slopes: list[NDArray[np.float64]] = list(np.gradient(fine, step))
    along, across = slopes[0][1:-1], slopes[1][1:-1]
    for half, rise in ((NEAR_HALF, fine[1:-1] - at_edges[:, :-1]), (FAR_HALF, at_edges[:, 1:] - fine[1:-1])):
        across = np.where(seen.half == half, rise / (0.5 * step), across)
    height = track - fine[1:-1]
    slant = np.hypot(height, ground)
    cosine = local_incidence_cosine(along, across, (-ground / slant, height / slant))
    area = step**2 * np.sqrt(1.0 + along**2 + across**2) * seen.share
    return np.round(np.arccos(np.clip(cosine, 0.0, 1.0)) * ANGLES_PER_RADIAN), area


def _pixels(
    scene: Scene, radar: Radar, material: NDArray[np.uint8], lines: Lines, k: int, step: float, near: float,
    base: float, shape: tuple[int, int], points: Points,
) -> Geometry:  # fmt: skip
    """Distribute the facets over the pixels that they reach."""
    rows, columns = shape
    per_column = radar.azimuth_spacing_m / step  # lines
    near_row, far_row, layover, shadow, counts = _counted(lines, radar, near - base, per_column, shape)
    total = int(counts.sum(dtype=np.int64))
    start = np.zeros(rows * columns + 1, dtype=np.int32)
    np.cumsum(counts, out=start[1:])
    facet_material = np.empty(total, dtype=np.uint8)
    incidence = np.empty(total, dtype=np.uint16)
    weight = np.empty(total, dtype=np.float32)
    place = np.empty((2, total), dtype=np.float32)
    local = radar.radiometry == "sigma0_local"
    # beyond all ids where there is no object
    objects = len(scene.names) + 1 if scene.objects is not None else 256
    fill_facets(
        near_row, far_row, lines.state, lines.incidence, lines.area, material, k, per_column, rows, columns, start,
        not local, objects, facet_material, incidence, weight, place,
    )  # fmt: skip
    middles = np.arange(0.5, rows, dtype=np.float64)
    flat = _flat_incidence_deg(radar, near + middles * radar.range_spacing_m)
    per_area = _per_area(radar, flat).astype(np.float32)
    cells = np.empty(rows * columns, dtype=np.uint16)
    pure = np.zeros(rows * columns, dtype=np.uint8)
    mean_incidence = np.full(rows * columns, np.nan, dtype=np.float32)
    ground = np.full((2, rows * columns), np.nan, dtype=np.float32)
    # for sigma0_local, divided by a pixel's width in lines, too
    of_ground = np.full(rows, 1.0 / per_column, dtype=np.float32) if local else per_area
    order_facets(
        start, columns, facet_material, incidence, weight, place, of_ground, per_area, objects, cells, pure,
        mean_incidence, ground,
    )  # fmt: skip
    cell_start = np.zeros(rows * columns + 1, dtype=np.int32)
    np.cumsum(cells, out=cell_start[1:])
    cell_material = np.empty(int(cell_start[-1]), dtype=np.uint8)
    facet_start = np.empty(int(cell_start[-1]) + 1, dtype=np.int32)
    facet_start[-1] = total
    cells_of(start, cell_start, facet_material, cell_material, facet_start)
    # refined lines and facets converted to the scene's cells, with east to the right for either look side
    ground = (ground + np.float32(0.5)) / np.float32(k) - np.float32(0.5)
    if radar.look_side == "left":
        ground[1] = scene.material.shape[1] - 1 - ground[1]
    not_pure(points, radar, pure.reshape(shape))
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
        point_row=points.row,
        point_column=points.column,
        point_amplitude=points.amplitude,
        point_number=points.number,
    )


def _counted(
    lines: Lines, radar: Radar, near_m: float, per_column: float, shape: tuple[int, int]
) -> tuple[NDArray[Any], ...]:
    """First and last row of every facet, masks of layover and shadow, and number of facets' parts in every pixel."""
    rows, columns = shape
    to_rows = (near_m, radar.range_spacing_m)
    near_row, far_row = (_rows(slant, *to_rows) for slant in (lines.near_m, lines.far_m))
    counts = np.zeros(rows * columns, dtype=np.uint16)
    layover, shadow = np.zeros((2, rows, columns), dtype=np.bool_)
    count_facets(near_row, far_row, lines.state, per_column, rows, columns, counts, layover, shadow)
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
    """Slant ranges as fractional rows of the image, from the near edge of the first row."""
    return ((slant_m - near_m) / spacing_m).astype(np.float32)


def _points(spots: Spots, radar: Radar, near: float, step: float) -> Points:
    """Visible point scatterers in the image, and those beyond its border whose sidelobes reach into it."""
    seen = np.isfinite(spots.slant_m)
    slant = np.asarray(spots.slant_m[seen], dtype=np.float64)
    row = (slant - near) / radar.range_spacing_m - 0.5
    order = np.argsort(row, kind="stable")
    amplitude = np.sqrt(spots.rcs_m2[seen] * _per_area(radar, _flat_incidence_deg(radar, slant)))
    return Points(
        row[order],
        (spots.place[seen, 0] * step / radar.azimuth_spacing_m - 0.5)[order],
        amplitude.astype(np.float32)[order],
        spots.number[seen][order],
    )


def _flat_incidence_deg(radar: Radar, slant_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Incidence on flat ground at a slant range [deg]."""
    return np.degrees(np.arccos(np.minimum(radar.altitude_m / slant_m, 1.0)))


def _per_area(radar: Radar, flat_incidence_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a pixel's reference area in the radiometry [1/m2]; for ``sigma0_local`` that of sigma0."""
    area = radar.range_spacing_m * radar.azimuth_spacing_m / np.sin(np.radians(flat_incidence_deg))
    return np.asarray(of_sigma0(radar.radiometry, flat_incidence_deg) / area)


def write_geometry(
    path: str | Path, geometry: Geometry, radar: Radar | None = None, immaterial: Iterable[str] = ()
) -> None:
    """Write a geometry to HDF5, atomically.

    Parameters
    ----------
    path : path
        The file.
    geometry : Geometry Geometry to write.
    radar : Radar, optional
        Pass, which is recorded in the file; passes that differ only in looks or noise have the same geometry.
    immaterial : iterable of str, optional
        Keys of the pass that change no run either; the file stays the same when only their values differ.

    Raises
    ------
    ConfigError
        A finished calibration in the same folder is of another pass. A geometry of the same pass by another version of
        the simulator is replaced.
    """
    described = None
    if radar is not None:
        described = _recorded_pass(Path(path), radar.model_dump_json(), set(immaterial))
    with write_hdf5(path, "geometry", protected=not _outdated(path, described)) as file:
        if described is not None:
            file.attrs["pass"] = described
        file.attrs["simulator"] = SIMULATOR_VERSION
        file.attrs["shape"] = geometry.shape
        file["names"] = list(geometry.names)
        for item in fields(Geometry)[2:]:
            values = getattr(geometry, item.name)
            # HDF5 cannot compress an empty dataset
            packed = {"compression": "gzip", "compression_opts": 1} if values.size else {}
            file.create_dataset(item.name, data=values, **packed)


def _outdated(path: str | Path, described: str | None) -> bool:
    """Whether a file holds the geometry of the same pass, made by another version of the simulator."""
    try:
        with read_hdf5(path, "geometry") as file:
            return bool(file.attrs.get("pass") == described and file.attrs.get("simulator") != SIMULATOR_VERSION)
    except StoreError:
        return False


def _recorded_pass(path: Path, ours: str, immaterial: Container[str]) -> str:
    """The pass as recorded in the file, where it differs only in immaterial keys; else the present pass."""

    def material(text: str) -> dict[str, Any]:
        return {key: value for key, value in json.loads(text).items() if key not in immaterial}

    # a file that cannot be read is replaced
    with contextlib.suppress(OSError, KeyError, ValueError), h5py.File(path, "r", locking=False) as file:
        theirs = str(file.attrs["pass"])
        if material(theirs) == material(ours):
            return theirs
    return ours


def read_geometry(path: str | Path) -> Geometry:
    """Read a geometry that :func:`write_geometry` wrote.

    Raises
    ------
    StoreError
        The file is missing, damaged, or of another version or case.
    """
    with read_hdf5(path, "geometry") as file:
        rows, columns = (int(n) for n in file.attrs["shape"])
        arrays = {item.name: file[item.name][()] for item in fields(Geometry)[2:]}
        return Geometry(shape=(rows, columns), names=tuple(file["names"].asstr()[()]), **arrays)
