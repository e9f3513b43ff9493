"""Objects among the facets of the terrain: boxes that stand on the ground, and point scatterers.

The roof of a box is level. The roof's elevation is the object's height plus the mean elevation of the ground in the
box's footprint. A box has facets on its roof and on the walls that face the radar. The other walls have no facets:
walls parallel to the line of sight are seen edge-on, and walls at the back are hidden. If walls and roof of a box
scatter apart, its facets are those of the roof alone, and :mod:`radcal.standing.faces` computes the walls. The same
module computes the double bounce between boxes and ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.compiled import njit
from radcal.radar.visibility import FAR_HALF, NEAR_HALF, part_seen, seen_from, slant_extent
from radcal.scene.objects import Objects, Walls

_SAMPLES = 5  # samples along each side of a footprint, for the mean elevation of its ground


@dataclass(frozen=True)
class Boxes:
    """Objects that are modelled as boxes, with coordinates in azimuth lines (axis 0) and facets along a line (axis 1).

    Attributes
    ----------
    place : ndarray of float64, shape (n, 2)
        Centre of the footprint, in lines and facets from the near end of the first line.
    axis : ndarray of float64, shape (n, 2)
        Unit vector along the heading, in lines and facets.
    half : ndarray of float64, shape (n, 2)
        Half the length and half the width of the footprint, in units of a line's width.
    reach : ndarray of float64, shape (n, 2)
        Half the extent of the footprint, in lines along axis 0 and in facets along axis 1.
    top_m : ndarray of float64, shape (n,)
        Elevation of the roof [m].
    rcs_m2 : ndarray of float64, shape (n,)
        Cross-section towards the radar [m2].
    extent : ndarray of float64, shape (n,)
        Extent in slant range of the box's facets, visible or hidden, summed over facets and lines [m]. The sum is
        complete after the last block of lines.
    number : ndarray of int64, shape (n,)
        Index of the object in the scene's list of objects.
    roof : ndarray of uint8, shape (n,)
        Number of the roof's material, from 1, in the scene's list of roofs; 0 for a box with a cross-section.
    wall_sigma0 : ndarray of float64, shape (n,)
        sigma0 of the walls [linear]; 0 for a box with a cross-section.
    bounce : ndarray of bool, shape (n,)
        Whether the double bounce is added.
    """

    place: NDArray[np.float64]
    axis: NDArray[np.float64]
    half: NDArray[np.float64]
    reach: NDArray[np.float64]
    top_m: NDArray[np.float64]
    rcs_m2: NDArray[np.float64]
    extent: NDArray[np.float64]
    number: NDArray[np.int64]
    roof: NDArray[np.uint8]
    wall_sigma0: NDArray[np.float64]
    bounce: NDArray[np.bool_]


@dataclass(frozen=True)
class Spots:
    """Objects that are modelled as point scatterers, with coordinates in azimuth lines and facets along a line.

    Attributes
    ----------
    place : ndarray of float64, shape (n, 2)
        Position, in lines and facets from the near end of the first line.
    height_m : ndarray of float64, shape (n,)
        Height above the ground [m].
    rcs_m2 : ndarray of float64, shape (n,)
        Cross-section towards the radar [m2].
    number : ndarray of uint32, shape (n,)
        Index of the object in the scene's list of objects.
    slant_m : ndarray of float64, shape (n,)
        Slant range [m]; NaN for a hidden point, and until the point's line is computed.
    """

    place: NDArray[np.float64]
    height_m: NDArray[np.float64]
    rcs_m2: NDArray[np.float64]
    number: NDArray[np.uint32]
    slant_m: NDArray[np.float64]


@njit()
def _holds(line: Any, facet: Any, place: Any, axis: Any, half: Any) -> Any:
    """Whether the centre of a facet lies in a footprint."""
    down, across = line + 0.5 - place[0], facet + 0.5 - place[1]
    along, beside = down * axis[0] + across * axis[1], down * axis[1] - across * axis[0]
    return abs(along) <= half[0] and abs(beside) <= half[1]


@njit()
def _covers(place: Any, axis: Any, half: Any, reach: Any, shape: Any, found: Any) -> None:
    """Mask of the objects whose footprint holds the middle of at least one facet, written to ``found``."""
    for i in range(place.shape[0]):
        found[i] = False
        low, high = max(0, int(place[i, 0] - reach[i, 0])), min(shape[0], int(place[i, 0] + reach[i, 0]) + 1)
        left, right = max(0, int(place[i, 1] - reach[i, 1])), min(shape[1], int(place[i, 1] + reach[i, 1]) + 1)
        for line in range(low, high):
            for facet in range(left, right):
                if not found[i] and _holds(line, facet, place[i], axis[i], half[i]):
                    found[i] = True


@njit()
def _between(grid: Any, row: Any, column: Any) -> Any:
    """Value of ``grid`` at a fractional row and column, by bilinear interpolation; constant beyond the border."""
    row, column = min(max(row, 0.0), grid.shape[0] - 1.0), min(max(column, 0.0), grid.shape[1] - 1.0)
    r, c = min(int(row), grid.shape[0] - 2), min(int(column), grid.shape[1] - 2)
    p, q = row - r, column - c
    upper = (1.0 - q) * grid[r, c] + q * grid[r, c + 1]
    return (1.0 - p) * upper + p * ((1.0 - q) * grid[r + 1, c] + q * grid[r + 1, c + 1])


@njit()
def _mean_ground(elevation: Any, k: Any, place: Any, axis: Any, half: Any, mean: Any) -> None:
    """Mean elevation of the ground in each footprint, written to ``mean``."""
    for i in range(place.shape[0]):
        total = 0.0
        for m in range(_SAMPLES):
            for n in range(_SAMPLES):
                along = half[i, 0] * ((2 * m + 1) / _SAMPLES - 1.0)
                beside = half[i, 1] * ((2 * n + 1) / _SAMPLES - 1.0)
                line = place[i, 0] + along * axis[i, 0] + beside * axis[i, 1]
                facet = place[i, 1] + along * axis[i, 1] - beside * axis[i, 0]
                total += _between(elevation, line / k - 0.5, facet / k - 0.5)
        mean[i] = total / _SAMPLES**2


def to_boxes_and_spots(
    objects: Objects, elevation: NDArray[np.float64], look_side: str, k: int, step: float, rcs_m2: NDArray[np.float64]
) -> tuple[Boxes, Spots]:
    """Division of the scene's objects into boxes and point scatterers, with positions in lines and facets of a pass.

    An object becomes a point scatterer if it has no footprint, or if no facet has its middle in the object's footprint.
    A box without a cross-section of its own is left out in the latter case.

    Parameters
    ----------
    objects : Objects
        Objects of the scene.
    elevation : ndarray, shape (ny, nx)
        Elevation of the cells [m]; along axis 1, the cell nearest to the radar comes first.
    look_side : str
        ``right`` if the radar looks east, ``left`` if it looks west.
    k : int
        Number of azimuth lines in a cell, and of facets along each line in a cell.
    step : float
        Width of a line, and of a facet along a line [m].
    rcs_m2 : ndarray, shape (n,)
        Cross-sections towards the radar [m2]; NaN for a box without a cross-section of its own.
    """
    ny, nx = elevation.shape
    right = look_side == "right"
    place = np.stack([objects.y_m, objects.x_m if right else nx * k * step - objects.x_m], axis=1) / step
    bearing = np.radians(objects.heading_deg)
    axis = np.stack([np.cos(bearing), np.sin(bearing) if right else -np.sin(bearing)], axis=1)
    half = 0.5 * np.stack([objects.length_m, objects.width_m], axis=1) / step
    reach = np.abs(axis) * half[:, :1] + np.abs(axis[:, ::-1]) * half[:, 1:]
    box = np.zeros(len(objects), dtype=np.bool_)
    _covers(place, axis, half, reach, (ny * k, nx * k), box)
    box &= objects.extended
    mean = np.empty(np.count_nonzero(box))
    _mean_ground(elevation, k, place[box], axis[box], half[box], mean)
    n = len(objects)
    walls = objects.walls or Walls(np.full(n, -1, np.int16), np.full(n, np.nan), np.zeros(n, np.bool_))
    boxes = Boxes(
        place[box], axis[box], half[box], reach[box], mean + objects.height_m[box], rcs_m2[box], np.zeros(mean.size),
        np.flatnonzero(box), (walls.roof[box] + 1).astype(np.uint8),
        np.nan_to_num(10.0 ** (walls.sigma0_db[box] / 10.0)), walls.bounce[box],
    )  # fmt: skip
    spot = ~box & ~np.isnan(rcs_m2)
    number = np.flatnonzero(spot).astype(np.uint32)
    spots = Spots(place[spot], objects.height_m[spot], rcs_m2[spot], number, np.full(number.size, np.nan))
    return boxes, spots


def bearing_deg(look_side: str) -> float:
    """Direction from the scene to the radar, clockwise from the grid's north [deg]."""
    # at zero Doppler, a radar that looks east is due west of the places that it sees
    return 270.0 if look_side == "right" else 90.0


@njit()
def _raise(chosen: Any, place: Any, axis: Any, half: Any, reach: Any, top: Any, first: Any, owner: Any) -> None:
    """Index of the highest box on each facet, written to ``owner``; of several equally high boxes, the lowest index."""
    lines, facets = owner.shape
    for i in chosen:
        low, high = int(np.floor(place[i, 0] - reach[i, 0])) - first, int(place[i, 0] + reach[i, 0]) + 1 - first
        left, right = max(0, int(place[i, 1] - reach[i, 1])), min(facets, int(place[i, 1] + reach[i, 1]) + 1)
        for line in range(max(0, low), min(lines, high)):
            for facet in range(left, right):
                other = owner[line, facet]
                if (other < 0 or top[other] < top[i]) and _holds(line + first, facet, place[i], axis[i], half[i]):
                    owner[line, facet] = i


def raise_boxes(
    boxes: Boxes | None, ground_m: NDArray[np.float64], first: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Index and roof elevation of the box that covers each facet of a block of azimuth lines.

    Parameters
    ----------
    boxes : Boxes or None
        Boxes of the scene.
    ground_m : ndarray, shape (lines, facets)
        Elevation of the ground [m].
    first : int
        First line of the block.

    Returns
    -------
    owner : ndarray of int32, shape (lines, facets)
        Index of the box that stands on a facet; -1 if no box does.
    roof_m : ndarray, shape (lines, facets)
        Elevation of the box's roof [m]; elevation of the ground if no box stands on the facet, or if the ground is
        higher.
    """
    owner = np.full(ground_m.shape, -1, dtype=np.int32)
    if boxes is None or not len(boxes.place):
        return owner, ground_m
    low, high = boxes.place[:, 0] - boxes.reach[:, 0], boxes.place[:, 0] + boxes.reach[:, 0]
    chosen = np.flatnonzero((high >= first) & (low <= first + len(ground_m)))
    _raise(chosen, boxes.place, boxes.axis, boxes.half, boxes.reach, boxes.top_m, first, owner)
    # where the ground rises above a roof, the height is that of the ground
    return owner, np.where(owner >= 0, np.maximum(ground_m, boxes.top_m[owner]), ground_m)


@njit()
def stand(
    owner: Any, alone: Any, roof: Any, at_edges: Any, edges: Any, middles: Any, track: Any, near: Any, far: Any,
    share: Any, half: Any, hidden: Any, horizon: Any, extent: Any,
) -> None:  # fmt: skip
    """Compute the visible part of each facet of a line; all arrays have the shape (facets,), unless another is given.

    Parameters
    ----------
    owner, roof : ndarray
        Line of the arrays of :func:`raise_boxes`.
    alone : ndarray, shape (boxes,)
        Nonzero for a box whose facets are those of its roof alone.
    at_edges : ndarray, shape (facets + 1,)
        Elevation of the ground at the facets' edges [m].
    edges, middles : ndarray, shape (facets + 1,), (facets,)
        Ground range of the facets' edges and middles [m].
    track : float
        Elevation of the radar [m].
    near, far : ndarray of float64
        On entry, nearest and furthest slant range of each facet of the ground without boxes; as a result, of each
        facet's visible part, or of the whole facet if it is hidden [m].
    share : ndarray of float32
        Result: visible share of a facet of the ground, 0 to 1. The share of a facet of a box is 1 if any part of the
        facet is visible, else 0; of a box whose roof scatters apart, it is the visible share of the roof.
    half : ndarray of uint8
        Result: ``NEAR_HALF`` or ``FAR_HALF`` if the visible part of a facet lies in this half alone; else 0.
    hidden : ndarray of float64, shape (2, facets)
        Result: nearest and furthest slant range of the hidden part of a partly visible facet [m]; 0 for other facets.
    horizon : ndarray of float64
        Result: largest tangent of the angle from nadir among all places on the line that are nearer to the radar.
    extent : ndarray of float64
        Result: extent in slant range of a whole facet of a box, including its hidden part [m].
    """
    before = -np.inf
    for f in range(owner.size):
        horizon[f] = before
        share[f], half[f] = 0.0, 0
        hidden[0, f], hidden[1, f] = 0.0, 0.0
        down = track - roof[f]
        if owner[f] < 0:
            first, last = track - at_edges[f], track - at_edges[f + 1]
            place = edges[f], first, middles[f], down, edges[f + 1], last
            start, end = part_seen(*place, before)
            if start < end:
                share[f] = end - start
                if start > 0.0 or end < 1.0:
                    half[f] = NEAR_HALF if end <= 0.5 else FAR_HALF if start >= 0.5 else 0
                    near[f], far[f] = slant_extent(start, end, *place)
                    low, high = slant_extent(0.0 if start > 0.0 else end, 1.0 if end < 1.0 else start, *place)
                    hidden[0, f], hidden[1, f] = low, high
            before = max(before, middles[f] / down, edges[f + 1] / last)
            continue
        foot = at_edges[f]
        if f > 0 and owner[f - 1] >= 0:
            foot = roof[f - 1]
        wall = not alone[owner[f]] and foot < roof[f] and (f == 0 or owner[f - 1] != owner[f])
        start = seen_from(edges[f], down, edges[f + 1], down, before)
        share[f] = 1.0 - start if alone[owner[f]] or start >= 1.0 else 1.0
        foot_down = track - foot if wall else down
        near[f], far[f], extent[f] = _of_box(edges[f], edges[f + 1], start, down, foot_down, before)
        if 0.0 < start < 1.0:
            hidden[0, f], hidden[1, f] = np.hypot(edges[f], down), near[f]
        before = max(before, edges[f + 1] / down)  # a level roof is visible up to its far edge


@njit()
def _of_box(first: Any, last: Any, start: Any, down: Any, foot_down: Any, before: Any) -> tuple[Any, Any, Any]:
    """Nearest and furthest slant range of the visible part of a box's facet, and the whole facet's slant extent [m].

    The roof reaches from ground range ``first`` to ``last``, at the depth ``down`` below the radar; its visible part
    begins at the fraction ``start`` of its length. The foot of the wall at the roof's near edge is ``foot_down`` below
    the radar.
    """
    whole_near, whole_far = np.hypot(first, down), max(np.hypot(last, down), np.hypot(first, foot_down))
    if start >= 1.0:
        return whole_near, whole_far, whole_far - whole_near
    nearest, furthest = np.hypot(first + start * (last - first), down), np.hypot(last, down)
    if before > 0.0:  # the wall is visible above the ray that passes over the highest obstacle in front
        foot_down = min(foot_down, first / before)
    if foot_down > down:
        furthest = max(furthest, np.hypot(first, foot_down))
    return nearest, furthest, whole_far - whole_near


@njit()
def locate(
    place: Any, height: Any, ground: Any, first: Any, last: Any, horizon: Any, edges: Any, track: Any, step: Any,
    slant: Any,
) -> None:  # fmt: skip
    """Slant range of visible point scatterers on the lines ``first`` to ``last - 1``; for hidden points it stays NaN.

    ``ground`` is the elevation of the ground on these lines and on one more line on each side [m].
    """
    facets = horizon.shape[1]
    for i in range(place.shape[0]):
        if place[i, 0] < first or place[i, 0] >= last:
            continue
        line, f = int(place[i, 0]) - first, min(max(int(place[i, 1]), 0), facets - 1)
        up = track - _between(ground, place[i, 0] - first + 0.5, place[i, 1] - 0.5) - height[i]
        away = edges[0] + place[i, 1] * step
        # the horizon leaves out the point's own facet, whose ground would hide points in the near half of this facet
        if away / up >= horizon[line, f]:
            slant[i] = np.hypot(away, up)
