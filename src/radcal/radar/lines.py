"""Facets along the azimuth lines of a refined elevation model: slant range, incidence, area and visibility."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.compiled import njit, threaded
from radcal.radar.earth import LineOfSight, upright
from radcal.radar.facets import ANGLES_PER_RADIAN, LAID_OVER, OBJECT, PARTLY, ROOF, VISIBLE
from radcal.radar.footprints import Boxes, Spots, locate, raise_boxes, stand
from radcal.radar.visibility import FAR_HALF, NEAR_HALF, laid_over
from radcal.standing.faces import Echoes, echoes

BLOCK = 256
"""Number of the scene's rows in a block, whose cubic spline is computed at once; smaller blocks need less memory."""

HALO = 12
"""Cells beyond a block that enter its cubic spline; those further away have no effect in single precision."""

ENDS = (0, 1, -2, -1)
"""Facets of a line of which :func:`ends` uses the elevation."""


@njit()
def local_incidence_cosine(along: Any, across: Any, toward: Any, up: Any) -> Any:
    """Cosine of the local incidence angle, computed from the surface's slopes.

    Parameters
    ----------
    along, across : float
        Slope of the surface along azimuth, and along ground range away from the track [m/m].
    toward, up : float
        Ground-range and vertical components of the unit vector to the radar; its azimuth component is 0 (zero Doppler).

    Returns
    -------
    float
        Product n . r of the unit normal n and the direction r to the radar; negative for surfaces that face away.

    References
    ----------
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE
    TGRS 34 (1996), eq. 10.
    """
    return (up - across * toward) / np.sqrt(1.0 + along**2 + across**2)


@dataclass(frozen=True)
class Lines:
    """Facets along the azimuth lines of the refined scene; arrays have the shape (lines, facets).

    Attributes
    ----------
    near_m, far_m : ndarray of float32
        Nearest and furthest slant range of the visible part of each facet, relative to a base slant range [m].
    incidence : ndarray of uint16
        Local incidence angle in units of 90 degrees / 65535.
    area : ndarray of float32
        Area of the visible part of the facet [m2]; for an object's facet, its part of the object's cross-section [m2].
    state : ndarray of uint8
        Bit flags of each facet: visible, in layover, part of an object, partly hidden. The upper four bits are the
        number of a roof's material, from 1, in the scene's list of roofs; 0 for all other facets.
    height_m : ndarray of float32
        Elevation of the ground, or of the roof of a box [m]; empty unless it was asked for.
    hidden : list of (ndarray, ndarray, ndarray)
        Hidden parts of partly visible facets, with one entry of the list for each block of lines. An entry holds the
        line of each facet, and the nearest and furthest slant range of the facet's hidden part, relative to the base
        slant range [m].
    echoes : list of Echoes
        Echoes of walls and of double bounces, with one entry of the list for each block of lines.
    """

    near_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    incidence: NDArray[np.uint16]
    area: NDArray[np.float32]
    state: NDArray[np.uint8]
    height_m: NDArray[np.float32]
    hidden: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]]
    echoes: list[Echoes]

    @classmethod
    def empty(cls, lines: int, facets: int, heights: bool = False) -> Lines:
        """Uninitialised arrays for a number of lines and of facets per line, with or without heights."""
        shape = (lines, facets)
        near_m, far_m, area = (np.empty(shape, np.float32) for _ in range(3))
        incidence, state = np.empty(shape, np.uint16), np.empty(shape, np.uint8)
        height_m = np.empty(shape if heights else (0, 0), np.float32)
        return cls(near_m, far_m, incidence, area, state, height_m, [], [])


def _refined(
    block: NDArray[np.float64], rows: NDArray[np.float64], columns: NDArray[np.float64], cell_m: float
) -> NDArray[np.float64]:
    """Elevation interpolated between cell centres: by cubic splines, but bilinear at walls, where splines oscillate."""
    at = np.meshgrid(rows, columns, indexing="ij")
    fine = scipy.ndimage.map_coordinates(block, at, order=3, mode="nearest")
    # a wall has a slope above 3 between the neighbours of a cell, which are two cells apart
    wall = scipy.ndimage.maximum_filter(block, 3) - scipy.ndimage.minimum_filter(block, 3) > 6.0 * cell_m
    if wall.any():
        steep = scipy.ndimage.map_coordinates(wall.astype(np.uint8), at, order=0, mode="nearest") > 0
        fine = np.where(steep, scipy.ndimage.map_coordinates(block, at, order=1, mode="nearest"), fine)
    return np.asarray(fine)


def refined_elevation(elevation: NDArray[np.float64], k: int, cell_m: float) -> NDArray[np.float64]:
    """Elevation of the facets of a scene, at the middles of k x k parts of each cell.

    Parameters
    ----------
    elevation : ndarray, shape (ny, nx)
        Elevation of the cells' middles [m].
    k : int
        Number of parts along each side of a cell.
    cell_m : float
        Cell size [m].

    Returns
    -------
    ndarray, shape (ny k, nx k)
        Elevation [m], interpolated in the same way as for the facets of an image.
    """
    if k == 1:
        return elevation
    block = np.pad(elevation, HALO, mode="reflect", reflect_type="odd")
    rows, columns = ((np.arange(n * k) + 0.5) / k - 0.5 + HALO for n in elevation.shape)
    return _refined(block, rows, columns, cell_m)


def blocks(low: int, high: int, k: int) -> Iterator[tuple[int, int]]:
    """First line, and line after the last, of each block of the scene's rows from line ``low`` to ``high - 1``."""
    while low < high:
        last = min(high, (low // (BLOCK * k) + 1) * BLOCK * k)
        yield low, last
        low = last


def ground_of(
    elevation: NDArray[np.float64], first: int, last: int, k: int, cell_m: float, facets: tuple[int, ...] | None = None
) -> NDArray[np.float64]:
    """Elevation of the facets on the lines ``first`` to ``last - 1`` of a block, and on one more line on each side.

    ``facets`` are the indices of the facets of each line that are wanted; by default all. Beyond the scene's border,
    the elevation is extrapolated by odd reflection.
    """
    ny, nx = elevation.shape
    top = first // k // BLOCK * BLOCK
    bottom = min(ny, top + BLOCK)
    if k == 1:
        top, bottom, halo = first, last, (1, 0)
    else:
        halo = (HALO, HALO)
    low, high = max(0, top - halo[0]), min(ny, bottom + halo[0])
    beyond = ((halo[0] - top + low, halo[0] - high + bottom), (halo[1], halo[1]))
    block = np.pad(elevation[low:high], beyond, mode="reflect", reflect_type="odd")
    if k == 1:
        return block if facets is None else block[:, facets]
    rows = (np.arange(first - 1 - top * k, last + 1 - top * k) + 0.5) / k - 0.5 + HALO
    columns = (np.arange(nx * k) + 0.5) / k - 0.5 + HALO
    return _refined(block, rows, columns if facets is None else columns[list(facets)], cell_m)


def fill_lines(
    elevation: NDArray[np.float64], first: int, last: int, k: int, step: float, edges: NDArray[np.float64],
    track: float, base: float, spacing_m: float, lines: Lines, standing: tuple[Boxes, Spots] | None, sight: LineOfSight,
    bounce: tuple[str, tuple[float, ...] | None] | None = None,
) -> tuple[float, float]:  # fmt: skip
    """Compute the facets of consecutive lines in a block of the scene's rows, and store them in ``lines``.

    Parameters
    ----------
    elevation : ndarray, shape (ny, nx)
        Elevation of the scene [m], lowered for a curved earth; ground range grows with the column.
    first, last : int
        First line, and the line after the last; both lie in one block of ``BLOCK`` rows.
    k : int
        Number of lines, and of facets along a line, per cell of the scene.
    step : float
        Width of a line, and of a facet along ground range [m].
    edges : ndarray, shape (nx k + 1,)
        Ground range of the facets' edges from the track [m].
    track : float
        Height of the track, in the datum of the elevation [m].
    base : float
        Slant range [m] that is subtracted from all slant ranges in ``lines``.
    spacing_m : float
        Slant-range pixel spacing of the image [m].
    lines : Lines
        Facets of all lines; the facets of these lines are overwritten.
    standing : (Boxes, Spots) or None
        Boxes and point scatterers of the scene; the extents of the boxes and the slant ranges of the points are
        updated.
    sight : LineOfSight
        Position of the track.
    bounce : (str, tuple of float or None), optional
        Polarisation of the pass, and permittivities of walls and ground, if boxes have walls.

    Returns
    -------
    (float, float)
        Nearest and furthest slant range [m] of the interval in which every one of these lines has ground.
    """
    fine = ground_of(elevation, first, last, k, step * k)
    ground = 0.5 * (edges[1:] + edges[:-1])
    owner, roof_m = raise_boxes(None if standing is None else standing[0], fine[1:-1], first)
    horizon, extent = np.empty((2, last - first, ground.size))
    hidden = np.empty((2, last - first, ground.size), dtype=np.float32)
    part, line_m = slice(first, last), (np.arange(first, last) + 0.5 - 0.5 * len(elevation) * k) * step
    _fill(
        last - first, fine, owner, np.zeros(1, np.uint8) if standing is None else standing[0].roof,
        roof_m, edges, ground, track, base, spacing_m, step, step**2, line_m,
        (sight.height_m, sight.radius_m, *sight.stretch), sight.verticals(ground), lines.near_m[part],
        lines.far_m[part], lines.incidence[part], lines.area[part], lines.area[part].view(np.int32),
        lines.state[part], horizon, extent, hidden,
    )  # fmt: skip
    if lines.height_m.size:
        lines.height_m[part] = roof_m
    if standing is not None:
        boxes, spots = standing
        np.add.at(boxes.extent, owner[owner >= 0], extent[owner >= 0])
        locate(spots.place, spots.height_m, fine, first, last, horizon, edges, track, step, spots.slant_m)
        if bounce is not None:
            state = lines.state[part]
            seen = (state & VISIBLE > 0) - 0.5 * (state & PARTLY > 0)
            found = echoes(
                boxes, *bounce, first, owner, roof_m, fine[1:-1], seen, horizon, float(edges[0]), step, track,
                sight.level_incidence_deg,
            )  # fmt: skip
            lines.echoes.append(found)
    line, facet = np.nonzero(lines.state[part] & PARTLY)
    lines.hidden.append((line + first, hidden[0, line, facet], hidden[1, line, facet]))
    return ends(fine[1:-1], edges, track)


def share_out(lines: Lines, part: slice, boxes: Boxes) -> None:
    """Radar cross-section of each facet of a box on the lines ``part`` [m2], written to ``lines.area``.

    The cross-section of a box is divided among its facets in proportion to their extent in slant range, so that the box
    is evenly bright in slant range. Hidden facets and hidden parts of facets return no echo: their share of the
    cross-section is lost. Until then, ``lines.area`` holds the index of each facet's box, as an integer.
    """
    state, area = lines.state[part], lines.area[part]
    held = state & OBJECT > 0
    owner = area.view(np.int32)[held]
    extent = lines.far_m[part][held] - lines.near_m[part][held]
    area[held] = boxes.rcs_m2[owner] * (np.where(state[held] & VISIBLE, extent, np.float32(0.0)) / boxes.extent[owner])


def ends(fine: NDArray[np.float64], edges: NDArray[np.float64], track: float) -> tuple[float, float]:
    """Slant ranges [m] between which every line has ground, from the first and last two elevations of the lines [m]."""
    near = np.hypot(track - (1.5 * fine[:, 0] - 0.5 * fine[:, 1]), edges[0])
    far = np.hypot(track - (1.5 * fine[:, -1] - 0.5 * fine[:, -2]), edges[-1])
    return float(near.max()), float(far.min())


@threaded
def _fill(
    part: Any, fine: Any, owner: Any, roofs: Any, roof: Any, edges: Any, middles: Any, track: Any, base: Any,
    apart: Any, step: Any, face_m2: Any, line_m: Any, sight: Any, verticals: Any, out_near: Any, out_far: Any,
    out_incidence: Any, out_area: Any, out_owner: Any, out_state: Any, out_horizon: Any, out_extent: Any,
    out_hidden: Any,
) -> None:  # fmt: skip
    """Facets of lines, one line after the other; ``part`` is the first line, and the line after the last.

    Neighbouring facets share the height at their common edge, so that they cover slant range without gaps. The
    cross-section of an object's facet is known only after the last line. Until then the array of areas holds the
    number of the facet's box (``out_owner`` is the same memory as ``out_area``).
    """
    n = middles.size
    at_edges, near, far, slant = np.empty(n + 1), np.empty(n), np.empty(n), np.empty(n)
    share, half, laid = np.empty(n, np.float32), np.empty(n, np.uint8), np.empty(n, np.bool_)
    hidden = np.empty((2, n))
    height, radius, stretch = sight[0], sight[1], (sight[2], sight[3])
    for line in range(part[0], part[1]):
        ground, above, below = fine[line + 1], fine[line + 2], fine[line]
        at_edges[0], at_edges[n] = 1.5 * ground[0] - 0.5 * ground[1], 1.5 * ground[n - 1] - 0.5 * ground[n - 2]
        for f in range(1, n):
            at_edges[f] = 0.5 * (ground[f] + ground[f - 1])
        reach = np.hypot(track - at_edges[0], edges[0])
        for f in range(n):
            beyond = np.hypot(track - at_edges[f + 1], edges[f + 1])
            near[f], far[f], reach = min(reach, beyond), max(reach, beyond), beyond
            slant[f] = np.hypot(track - roof[line, f], middles[f])
        stand(
            owner[line], roofs, roof[line], at_edges, edges, middles, track, near, far, share, half, hidden,
            out_horizon[line], out_extent[line],
        )  # fmt: skip
        laid_over(slant, share, apart, laid)
        for f in range(n):
            along = (above[f] - below[f]) / (2.0 * step)
            # if only one half of a facet is visible, the slope along ground range is that of the visible half
            if half[f] == NEAR_HALF:
                across = (ground[f] - at_edges[f]) / (0.5 * step)
            elif half[f] == FAR_HALF:
                across = (at_edges[f + 1] - ground[f]) / (0.5 * step)
            else:
                left, right = max(f - 1, 0), min(f + 1, n - 1)
                across = (ground[right] - ground[left]) / ((right - left) * step)
            vertical = (verticals[0, f], verticals[1, f], verticals[2, f], verticals[3, f], verticals[4, f])
            along, across, toward, up = upright(
                along, across, middles[f], track - ground[f], line_m[line], height, radius, stretch, vertical
            )
            cosine = min(max(local_incidence_cosine(along, across, toward, up), 0.0), 1.0)
            out_incidence[line, f] = np.uint16(np.rint(np.arccos(cosine) * ANGLES_PER_RADIAN))
            out_near[line, f], out_far[line, f] = near[f] - base, far[f] - base
            state = (VISIBLE if share[f] > 0.0 else 0) | (LAID_OVER if laid[f] else 0)
            if hidden[1, f] > hidden[0, f]:
                state |= PARTLY
                out_hidden[0, line, f], out_hidden[1, line, f] = hidden[0, f] - base, hidden[1, f] - base
            if owner[line, f] >= 0 and roofs[owner[line, f]]:
                level = np.arctan2(middles[f], track - roof[line, f]) + verticals[1, f]
                out_incidence[line, f] = np.uint16(np.rint(level * ANGLES_PER_RADIAN))
                out_state[line, f] = state | roofs[owner[line, f]] << ROOF
                out_area[line, f] = face_m2 * share[f]
            elif owner[line, f] >= 0:
                out_state[line, f] = state | OBJECT
                out_owner[line, f] = owner[line, f]
            else:
                out_state[line, f] = state
                out_area[line, f] = face_m2 * np.sqrt(1.0 + along**2 + across**2) * share[f]
