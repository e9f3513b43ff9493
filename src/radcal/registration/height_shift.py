"""Displacement of an image with the height of the ground, which shows an image without terrain correction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.findings import Finding
from radcal.radar.geometry import Geometry
from radcal.registration.displacement import squares
from radcal.registration.registered import Registered
from radcal.scene.model import Scene

_SQUARE_PX = 8  # side of the squares whose means are compared: the displacement is smooth
_TILES = 4  # tiles in each direction, one of which is left out at a time
_FEWEST = 10  # smallest number of squares in a tile
_LEAST_PX = 0.5  # smallest displacement (sd) of an image without terrain correction that counts as visible
_CERTAIN = 4.0  # standard errors
_LEAST_SHARE = 0.2  # of the displacement of an image without terrain correction


@dataclass(frozen=True)
class HeightShift:
    """Change of the displacement that a registration has found with the height of the ground.

    Attributes
    ----------
    m_per_m : float
        Displacement along slant range per height [m/m]; negative if high ground lies too near to the radar.
    error : float
        Standard error, from tiles that are left out one at a time [m/m].
    ellipsoid : float
        Displacement per height of an image that is geocoded on the ellipsoid [m/m]: minus the cosine of the incidence.
    """

    m_per_m: float
    error: float
    ellipsoid: float

    @property
    def doubtful(self) -> bool:
        """Whether the displacement is significant, and at least a fifth of that of an image on the ellipsoid."""
        return abs(self.m_per_m) > max(_CERTAIN * self.error, _LEAST_SHARE * abs(self.ellipsoid))


def height_shift(registered: Registered, geometry: Geometry, scene: Scene, radar: Radar) -> HeightShift | None:
    """Regression of a registration's displacement along slant range on the height of the ground.

    Trends of displacement and height, of second degree in rows and columns, are left out. Neighbouring pixels have the
    same error, because the displacement is smooth: the standard error is the jackknife's, with 16 tiles of the image.

    Parameters
    ----------
    registered : Registered
        Registered measured image.
    geometry : Geometry
        Geometry of the pass.
    scene : Scene
        Scene with the heights.
    radar : Radar
        Pass; only its spacing in slant range is used.

    Returns
    -------
    HeightShift or None
        Regression; None if the image was not moved, or if the relief is so low that the displacement of an image
        without terrain correction would have a standard deviation below half a pixel.

    References
    ----------
    Schreier, "SAR Geocoding: Data and Systems" (1993): displacement of elevated ground. Efron and Tibshirani, "An
    Introduction to the Bootstrap" (1993), section 11.2: jackknife.
    """
    if not registered.applied or scene.elevation_m is None:
        return None
    used = np.isfinite(geometry.ground).all(axis=0) & ~(geometry.layover | geometry.shadow)
    height = np.full(geometry.shape, np.nan)
    height[used] = scipy.ndimage.map_coordinates(
        scene.elevation_m, geometry.ground[:, used].astype(np.float64), order=1
    )
    moved_m = np.where(used, registered.displacement_px[0].astype(np.float64), np.nan) * radar.range_spacing_m
    # NaN for a square in which any value is missing
    heights, moves = (squares(values, _SQUARE_PX).mean(axis=(1, 3)) for values in (height, moved_m))
    known = np.isfinite(heights) & np.isfinite(moves)
    row, column = np.nonzero(known)
    rows, columns = known.shape
    tile = row * _TILES // rows * _TILES + column * _TILES // columns
    if np.bincount(tile, minlength=_TILES**2).min() < _FEWEST:
        return None
    down, right = row / rows, column / columns
    trend = np.stack([np.ones(row.size), down, right, down**2, down * right, right**2], axis=1)
    ellipsoid = -float(np.cos(np.radians(geometry.flat_incidence_deg)).mean())
    relief = heights[known] - trend @ np.linalg.lstsq(trend, heights[known], rcond=None)[0]
    if abs(ellipsoid) * relief.std() < _LEAST_PX * radar.range_spacing_m:
        return None
    regressors = np.column_stack([heights[known] - heights[known].mean(), trend])

    def slope(kept: NDArray[np.bool_]) -> float:
        return float(np.linalg.lstsq(regressors[kept], moves[known][kept], rcond=None)[0][0])

    without = np.array([slope(tile != left_out) for left_out in range(_TILES**2)])
    error = float(np.sqrt((_TILES**2 - 1) * np.var(without)))
    return HeightShift(slope(np.ones(tile.size, dtype=np.bool_)), error, ellipsoid)


def with_height_finding(registered: Registered, geometry: Geometry, scene: Scene, radar: Radar) -> Registered:
    """Registered image with a warning if its displacement follows the height of the ground.

    Parameters
    ----------
    registered, geometry, scene, radar
        Arguments of :func:`height_shift`.
    """
    found, measurement = height_shift(registered, geometry, scene, radar), registered.measurement
    if found is None or not found.doubtful:
        return registered
    numbers = {"m_per_m": found.m_per_m, "error_m_per_m": found.error, "ellipsoid_m_per_m": found.ellipsoid}
    warning = Finding("height_shift", "warning", measurement.source, numbers)
    return replace(registered, measurement=replace(measurement, findings=(*measurement.findings, warning)))
