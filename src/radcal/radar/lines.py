"""Facets along the azimuth lines of a refined elevation model: slant range, incidence, area and visibility."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, maximum_filter, minimum_filter

from radcal.radar.earth import LineOfSight
from radcal.radar.facets import ANGLES_PER_RADIAN, LAID_OVER, OBJECT, VISIBLE
from radcal.radar.footprints import Boxes, Raised, Spots, VisibleParts, add_up, locate, raise_boxes, stand
from radcal.radar.visibility import FAR_HALF, NEAR_HALF, laid_over

__all__ = ["Lines", "fill_lines", "local_incidence_cosine", "refined_elevation"]

_HALO = 12  # cells beyond a block that enter its cubic spline; those further away have no effect in single precision


def local_incidence_cosine(
    along: NDArray[np.float64], across: NDArray[np.float64], to_radar: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Cosine of the local incidence angle, computed from the surface's slopes.

    Parameters
    ----------
    along, across : ndarray, shape (ny, nx)
        Slope of the surface along azimuth, and along ground range away from the track [m/m].
    to_radar : (ndarray, ndarray), each broadcastable to (ny, nx)
        Ground-range and vertical components of the unit vector to the radar; its azimuth component is 0 (zero Doppler).

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
        Bit flags of each facet: visible, in layover, part of an object.
    hidden : list of (ndarray, ndarray, ndarray)
        Hidden parts of partly visible facets, with one entry of the list for each block of lines. An entry holds the
        line of each facet, and the nearest and furthest slant range of the facet's hidden part, relative to the base
        slant range [m].
    """

    near_m: NDArray[np.float32]
    far_m: NDArray[np.float32]
    incidence: NDArray[np.uint16]
    area: NDArray[np.float32]
    state: NDArray[np.uint8]
    hidden: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]]

    @classmethod
    def empty(cls, lines: int, facets: int) -> Lines:
        """Uninitialised arrays for a number of lines and of facets per line."""
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
    """Elevation interpolated between cell centres: by cubic splines, but bilinear at walls, where splines oscillate."""
    at = np.meshgrid(rows, columns, indexing="ij")
    fine = map_coordinates(block, at, order=3, mode="nearest")
    # a wall has a slope above 3 between the neighbours of a cell, which are two cells apart
    wall = maximum_filter(block, 3) - minimum_filter(block, 3) > 6.0 * cell_m
    if wall.any():
        steep = map_coordinates(wall.astype(np.uint8), at, order=0, mode="nearest") > 0
        fine = np.where(steep, map_coordinates(block, at, order=1, mode="nearest"), fine)
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
    block = np.pad(elevation, _HALO, mode="reflect", reflect_type="odd")
    rows, columns = ((np.arange(n * k) + 0.5) / k - 0.5 + _HALO for n in elevation.shape)
    return _refined(block, rows, columns, cell_m)


def fill_lines(
    elevation: NDArray[np.float64], first: int, last: int, k: int, step: float, edges: NDArray[np.float64],
    track: float, base: float, spacing_m: float, lines: Lines, standing: tuple[Boxes, Spots] | None,
    earth: LineOfSight | None = None,
) -> tuple[float, float]:  # fmt: skip
    """Compute the facets of a block of the scene's rows, and store them in ``lines``.

    Parameters
    ----------
    elevation : ndarray, shape (ny, nx)
        Elevation of the scene [m]; ground range grows with the column.
    first, last : int
        First row of the block, and the row after the block's last row.
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
        Facets of all lines; the facets of the block are overwritten.
    standing : (Boxes, Spots) or None
        Boxes and point scatterers of the scene; the extents of the boxes and the slant ranges of the points are
        updated.
    earth : LineOfSight, optional
        Position of the track over a curved earth, for which the elevation is lowered; by default the earth is flat.

    Returns
    -------
    (float, float)
        Nearest and furthest slant range [m] of the interval in which every line of the block has ground.
    """
    ny, nx = elevation.shape
    # beyond the scene's border the elevation is extrapolated by odd reflection; slopes need one more line on each side
    low, high = max(0, first - _HALO), min(ny, last + _HALO)
    beyond = ((_HALO - first + low, _HALO - high + last), (_HALO, _HALO))
    block = np.pad(elevation[low:high], beyond, mode="reflect", reflect_type="odd")
    if k == 1:
        # contiguous, as refined ground is, so that functions are compiled for one type of array only
        fine = np.ascontiguousarray(block[_HALO - 1 : _HALO + last - first + 1, _HALO:-_HALO])
    else:
        rows = (np.arange(-1, (last - first) * k + 1) + 0.5) / k - 0.5 + _HALO
        columns = (np.arange(nx * k) + 0.5) / k - 0.5 + _HALO
        fine = _refined(block, rows, columns, step * k)
    ground = 0.5 * (edges[1:] + edges[:-1])
    beyond_ground, fine = fine, fine[1:-1]
    # neighbouring facets share the height at their common edge, so that they cover slant range without gaps
    at_edges = np.empty((fine.shape[0], fine.shape[1] + 1))
    at_edges[:, 1:-1] = 0.5 * (fine[:, 1:] + fine[:, :-1])
    at_edges[:, 0], at_edges[:, -1] = 1.5 * fine[:, 0] - 0.5 * fine[:, 1], 1.5 * fine[:, -1] - 0.5 * fine[:, -2]
    reach = np.hypot(track - at_edges, edges)
    raised = Raised.none(fine) if standing is None else raise_boxes(standing[0], fine, first * k)
    seen = VisibleParts.room(np.minimum(reach[:, 1:], reach[:, :-1]), np.maximum(reach[:, 1:], reach[:, :-1]))
    stand(
        len(fine), raised.owner, raised.roof_m, at_edges, edges, ground, track, seen.near_m, seen.far_m, seen.share,
        seen.half, seen.hidden_m, seen.horizon, seen.extent_m,
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
    line_m = (np.arange(first * k, last * k) + 0.5 - 0.5 * ny * k) * step
    faces = _faces(beyond_ground, at_edges, seen, ground, track, step, earth, line_m)
    lines.incidence[part], lines.area[part] = faces
    lines.state[part] = visible * VISIBLE + laid * LAID_OVER
    standing_here = raised.owner >= 0
    # The cross-section of an object's facet is known only after the last line. Until then the array of areas holds the
    # number of the facet's box.
    lines.area[part].view(np.int32)[standing_here] = raised.owner[standing_here]
    lines.state[part] |= standing_here * np.uint8(OBJECT)
    line, facet = np.nonzero(seen.hidden_m[1] > seen.hidden_m[0])
    hidden = [(extreme[line, facet] - base).astype(np.float32) for extreme in seen.hidden_m]
    lines.hidden.append((line + first * k, hidden[0], hidden[1]))
    return float(reach[:, 0].max()), float(reach[:, -1].min())


def _faces(
    fine: NDArray[np.float64], at_edges: NDArray[np.float64], seen: VisibleParts, ground: NDArray[np.float64],
    track: float, step: float, earth: LineOfSight | None, line_m: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Incidence (in units of 90 degrees / 65535) and visible area [m2] of the facets of a block of lines.

    If only one half of a facet is visible, the slope along ground range is the slope of the visible half. ``line_m`` is
    the position of the lines along azimuth, relative to the scene's centre [m]; it is used on a curved earth only.
    """
    slopes: list[NDArray[np.float64]] = list(np.gradient(fine, step))
    along, across = slopes[0][1:-1], slopes[1][1:-1]
    for half, rise in ((NEAR_HALF, fine[1:-1] - at_edges[:, :-1]), (FAR_HALF, at_edges[:, 1:] - fine[1:-1])):
        across = np.where(seen.half == half, rise / (0.5 * step), across)
    height = track - fine[1:-1]
    slant = np.hypot(height, ground)
    to_radar = (-ground / slant, height / slant)
    if earth is not None:
        upright = earth.upright(along, across, ground, height, line_m)
        along, across, to_radar = upright.along, upright.across, upright.to_radar
    cosine = local_incidence_cosine(along, across, to_radar)
    area = step**2 * np.sqrt(1.0 + along**2 + across**2) * seen.share
    return np.round(np.arccos(np.clip(cosine, 0.0, 1.0)) * ANGLES_PER_RADIAN), area
