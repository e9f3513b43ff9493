"""Walls of boxes on the azimuth lines of a pass: echoes of the walls, and of the double bounce along their foot.

The grid of facets holds the ground and the roofs. The faces of a box that the radar sees are cut at the borders of the
azimuth lines, so that each piece has its exact position, length and height. Positions are in azimuth lines (axis 0) and
facets along a line (axis 1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.standing.bounce import alpha_deg, bounce_area_m2, reflected

_EDGE_ON = 1e-3  # cosine of phi below which a face is seen edge-on
_ROUNDING_M = 1e-6

Doubles = NDArray[np.float64]
Whole = NDArray[np.int64]
Rows = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Echoes:
    """Echoes of walls and of double bounces, one for each piece of a face in one azimuth line.

    Attributes
    ----------
    line, facet : ndarray of int64, shape (n,)
        Azimuth line of the piece, and the facet in front of its foot.
    number : ndarray of int64, shape (n,)
        Index of the object in the scene's list of objects.
    away_m : ndarray, shape (n,)
        Ground range of the face from the track [m].
    near_m, far_m : ndarray, shape (n,)
        Nearest and furthest slant range of the echo [m].
    area_m2 : ndarray, shape (n,)
        Cross-section [m2]; of a double bounce, cross-section divided by sigma0 of the ground.
    alpha_deg : ndarray, shape (n,)
        Incidence for the law of the ground [deg]; NaN for a wall.
    mask_m : ndarray, shape (n,)
        Slant range at which the ground begins that takes part in a double bounce [m].
    """

    line: Whole
    facet: Whole
    number: Whole
    away_m: Doubles
    near_m: Doubles
    far_m: Doubles
    area_m2: Doubles
    alpha_deg: Doubles
    mask_m: Doubles

    @classmethod
    def joined(cls, parts: Sequence[Echoes]) -> Echoes:
        """Echoes of several blocks of lines."""
        none = np.zeros(0, np.int64)
        return cls(*(np.concatenate([none, *(getattr(one, item.name) for one in parts)]) for item in fields(cls)))


def _pieces(boxes: Any, first: int, shape: tuple[int, ...]) -> tuple[Whole, Whole, Doubles, Doubles, Doubles]:
    """Box, line, position along the line [facets], length [widths of a line] and cosine of phi of each piece of a face.

    Of each box there are two faces whose outward normal has a component towards the radar.
    """
    last = first + shape[0]
    near = (boxes.place[:, 0] + boxes.reach[:, 0] > first) & (boxes.place[:, 0] - boxes.reach[:, 0] < last)
    chosen = np.flatnonzero(near & ((boxes.wall_sigma0 > 0.0) | boxes.bounce))
    ends, box = boxes.axis[chosen], np.tile(chosen, 2)
    sides = np.stack([ends[:, 1], -ends[:, 0]], axis=1)
    normal, along = np.concatenate([ends, sides]), np.concatenate([sides, ends])
    depth, length = np.concatenate([boxes.half[chosen], boxes.half[chosen, ::-1]]).T
    middle = boxes.place[box] - depth[:, None] * normal * np.sign(normal[:, 1:])
    cosine, reach = np.abs(along[:, 0]), np.abs(length * along[:, 0])
    low, high = (np.clip(middle[:, 0] + end, first, last) for end in (-reach, reach))
    face, line = _ranged(low, np.where(cosine > _EDGE_ON, high, low))
    begin, end = np.maximum(line, low[face]), np.minimum(line + 1, high[face])
    place = middle[face, 1] + (0.5 * (begin + end) - middle[face, 0]) * along[face, 1] / along[face, 0]
    kept = (place >= 0.0) & (place < shape[1])
    face, line, place, width = face[kept], line[kept], place[kept], (end - begin)[kept]
    return box[face], line - first, place, width / cosine[face], cosine[face]


def echoes(
    boxes: Any, polarisation: str, permittivity: tuple[float, ...] | None, first: int, owner: NDArray[np.int32],
    roof_m: Doubles, ground_m: Doubles, visible: Doubles, horizon: Doubles, edge_m: float, step_m: float,
    track_m: float, theta_deg: Callable[[Doubles, Doubles], Doubles],
) -> Echoes:  # fmt: skip
    """Echoes of the walls and of the double bounces of a block of azimuth lines.

    A wall is lit above the ray that passes over all that is nearer to the radar. A double bounce needs a lit foot on
    the ground; of the ground in front of it, the visible share counts. Arrays have the shape (lines, facets).

    Parameters
    ----------
    boxes : radcal.radar.footprints.Boxes
        Boxes of the pass.
    polarisation : str
        Polarisation of the pass; a cross-polarised pass has no double bounce.
    permittivity : tuple of float, or None
        Permittivities of :func:`.reflected`.
    first : int
        First line of the block.
    owner, roof_m : ndarray
        Index of the box on each facet, -1 without a box, and elevation of roof or ground [m].
    ground_m : ndarray
        Elevation of the ground at the middle of each facet [m].
    visible : ndarray
        Visible share of each facet; 0.5 for a partly visible one.
    horizon : ndarray
        Largest tangent of the angle from nadir nearer to the radar than the facet.
    edge_m, step_m : float
        Ground range of the first facet's near edge, and width of a line and of a facet [m].
    track_m : float
        Elevation of the radar [m].
    theta_deg : callable
        Incidence on level ground [deg] at a ground range and a depth below the radar [m].
    """
    box, line, place, length, cosine = _pieces(boxes, first, owner.shape)
    facet = place.astype(np.int64)
    # facets of the box itself that begin before the face, as their middles lie behind another face of the box
    while (own := (facet > 0) & (owner[line, np.maximum(facet - 1, 0)] == box)).any():
        facet = facet - own
    inside = owner[line, facet] == box
    in_front = np.maximum(facet - inside, 0)
    other = owner[line, in_front]
    of_other = (other >= 0) & (other != box)
    middle = np.clip(place - 0.5, 0.0, ground_m.shape[1] - 1.0)  # the ground is straight between middles
    left = np.minimum(middle.astype(np.int64), ground_m.shape[1] - 2)
    low, high = ground_m[line, left], ground_m[line, left + 1]
    foot, top = low + (middle - left) * (high - low), boxes.top_m[box]
    away, foot_down, top_down = edge_m + place * step_m, track_m - foot, track_m - top
    tangent = np.maximum(horizon[line, facet], 1e-9)
    lit_down = np.minimum(foot_down, away / tangent)
    seen = (lit_down > top_down) & ~(of_other & (roof_m[line, in_front] >= top))
    length_m, height_m = length * step_m, np.maximum(top - foot, 0.0)
    near_m, foot_m = np.hypot(away, top_down), np.hypot(away, foot_down)

    wall = seen & (boxes.wall_sigma0[box] > 0.0)
    wall_m2 = boxes.wall_sigma0[box] * (lit_down - top_down) * length_m
    walls = (near_m, np.hypot(away, lit_down), wall_m2, np.full(box.size, np.nan), near_m)

    theta = theta_deg(away, foot_down)
    phi = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    width_m = height_m * np.tan(np.radians(theta))  # of the ground in front, along the line
    lit = _lit_share(visible * (owner < 0), line, np.where(inside, facet, place), width_m / step_m)
    bounce = seen & boxes.bounce[box] & (lit_down >= foot_down - _ROUNDING_M) & ~of_other & (lit > 0.0)
    bounce &= polarisation in ("HH", "VV")
    gain = lit * reflected(theta, phi, polarisation, permittivity)
    bounce_m2 = bounce_area_m2(theta, phi, height_m, length_m) * gain
    bounces = (foot_m, foot_m, bounce_m2, alpha_deg(theta, phi), np.hypot(away - width_m, foot_down))

    where = (line + first, in_front, boxes.number[box], away)
    found = zip((*where, *walls), (*where, *bounces), strict=True)
    return Echoes(*(np.concatenate([of_wall[wall], of_bounce[bounce]]) for of_wall, of_bounce in found))


def _lit_share(bare: Doubles, line: Whole, place: Doubles, width: Doubles) -> Doubles:
    """Mean of a visible share over ``width`` facets in front of ``place``; ground beyond the scene is visible."""
    total = np.pad(np.cumsum(bare, axis=1), ((0, 0), (1, 0)))

    def until(end: Doubles) -> Doubles:
        inside = np.maximum(end, 0.0)
        k = np.minimum(inside.astype(np.int64), bare.shape[1] - 1)
        return np.asarray(total[line, k] + (inside - k) * bare[line, k] + np.minimum(end, 0.0))

    return np.asarray(np.clip((until(place) - until(place - width)) / np.maximum(width, 1e-9), 0.0, 1.0))


def in_pixels(
    line: Whole, near_row: Rows, far_row: Rows, per_column: float, left: int, shape: tuple[int, int]
) -> tuple[Whole, Whole, Whole, Doubles]:
    """Pixels that each echo reaches, sorted by pixel.

    Parameters
    ----------
    line : ndarray, shape (n,)
        Azimuth line of each echo.
    near_row, far_row : ndarray, shape (n,)
        Nearest and furthest row of each echo, as fractional numbers.
    per_column : float
        Number of azimuth lines per image column.
    left : int
        First column of a strip of the image.
    shape : (int, int)
        Rows and columns of the strip.

    Returns
    -------
    tuple of four ndarrays, shape (m,)
        Index of the echo, flat index of the pixel, place of the echo among those of its pixel, and share of the echo
        in the pixel.
    """
    rows, columns = shape
    index, column = _ranged(line / per_column, (line + 1) / per_column)
    beside = np.minimum(line[index] + 1, (column + 1) * per_column) - np.maximum(line[index], column * per_column)
    kept = (beside >= 1e-6) & (column >= left) & (column < left + columns)
    index, column, beside = index[kept], column[kept] - left, beside[kept]
    which, row = _ranged(near_row[index], np.floor(far_row[index]) + 1)
    index, pixel = index[which], row * columns + column[which]
    near, far = near_row[index], far_row[index]
    inside = np.minimum(far, row + 1) - np.maximum(near, row)
    share = np.where(far > near, inside / np.maximum(far - near, 1e-9), 1.0) * beside[which]
    order = np.argsort(pixel, kind="stable")
    order = order[((row >= 0) & (row < rows))[order]]
    index, pixel, share = index[order], pixel[order], share[order]
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    return index, pixel, np.arange(pixel.size) - np.repeat(first, np.diff(first, append=pixel.size)), share


def _ranged(low: Rows, high: Rows) -> tuple[Whole, Whole]:
    """Whole numbers whose unit intervals overlap each interval from ``low`` to ``high``, with the interval's index."""
    first = np.floor(low).astype(np.int64)
    count = np.where(high > low, np.ceil(high).astype(np.int64) - first, 0)
    index = np.repeat(np.arange(count.size), count)
    return index, first[index] + np.arange(index.size) - np.repeat(np.cumsum(count) - count, count)
