"""Facets along the azimuth lines of a refined elevation model: slant range, incidence, area and visibility."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, maximum_filter, minimum_filter

from radcal.radar.facets import ANGLES_PER_RADIAN, LAID_OVER, OBJECT, VISIBLE
from radcal.radar.footprints import Boxes, Raised, Seen, Spots, add_up, locate, raise_boxes, stand
from radcal.radar.visibility import FAR_HALF, NEAR_HALF, laid_over

__all__ = ["Lines", "fill_lines", "local_incidence_cosine"]

_HALO = 12  # cells beyond a stretch that its cubic spline takes in: what is further has no effect in single precision


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


def fill_lines(
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
