"""Positions of places on the ground in a ground-range image, from orbit and slant range (range-Doppler geocoding)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from radcal.scene.crs import transformer

Array = NDArray[np.float64]

_STEPS = 12
_DONE_S = 1e-7  # a millimetre of the flight


@dataclass(frozen=True)
class Look:
    """Incidence angle, directions of flight and look, and altitude of the radar, for places on the ground.

    Attributes
    ----------
    incidence_deg : ndarray, shape (k,)
        Angle between the normal of the ellipsoid and the direction to the radar [deg].
    heading_deg : ndarray, shape (k,)
        Direction of the flight, at right angles to the look direction over the ground, clockwise from true north [deg,
        0 to 360].
    right : ndarray of bool, shape (k,)
        Whether the radar looks to the right of its flight.
    altitude_m : ndarray, shape (k,)
        Height of the radar above the ellipsoid [m].
    """

    incidence_deg: Array
    heading_deg: Array
    right: NDArray[np.bool_]
    altitude_m: Array


@dataclass(frozen=True)
class GroundRange:
    """Orbit of an image, and conversion from slant range to the pixels of the image's lines.

    All times are counted from the time of the first line of the image [s].

    Attributes
    ----------
    orbit_s : ndarray, shape (n,)
        Times of the state vectors, ascending, n >= 4.
    position_m, velocity_m_s : ndarray, shape (n, 3)
        Positions and velocities of the radar in geocentric coordinates that turn with the earth (WGS 84).
    line_s : float
        Time between two neighbouring lines.
    conversion_s : ndarray, shape (m,)
        Times for which the polynomials of ``coefficients`` hold, ascending; between two of these times, ground range is
        interpolated linearly.
    near_m : ndarray, shape (m,)
        Slant range that is subtracted before each polynomial is evaluated [m].
    coefficients : ndarray, shape (m, c)
        Coefficients of the polynomials that give ground range [m] from slant range [m], lowest power first.
    range_spacing_m : float
        Pixel spacing in ground range [m].
    shape : (int, int)
        Lines and pixels of the image.

    References
    ----------
    Small and Schubert, "Guide to Sentinel-1 Geocoding", UZH-S1-GC-AD (2019): zero-Doppler time, slant range and the
    conversion to ground range. Schreier, "SAR Geocoding: Data and Systems" (1993), chapter 4.
    """

    orbit_s: Array
    position_m: Array
    velocity_m_s: Array
    line_s: float
    conversion_s: Array
    near_m: Array
    coefficients: Array
    range_spacing_m: float
    shape: tuple[int, int]

    def positions(self, longitude_deg: Array, latitude_deg: Array, height_m: Array) -> tuple[Array, Array]:
        """Line and pixel at which the image shows each of the given places.

        Parameters
        ----------
        longitude_deg, latitude_deg : ndarray, shape (k,)
            Places on WGS 84 [deg].
        height_m : ndarray, shape (k,)
            Heights above the ellipsoid [m].

        Returns
        -------
        line, pixel : ndarray, shape (k,)
            Positions in the image, with pixel centres at whole numbers; NaN for places that the image does not show.
        """
        place = _geocentric(longitude_deg, latitude_deg, height_m)
        time = self._zero_doppler(place)
        slant = np.linalg.norm(place - self._orbit(time), axis=-1)
        ground = between(  # counted from the first pixel of a line [m]
            self.conversion_s, time, lambda k, there: polyval(slant[there] - self.near_m[k], self.coefficients[k])
        )
        line, pixel = time / self.line_s, ground / self.range_spacing_m
        rows, columns = self.shape
        inside = (line >= -0.5) & (line < rows - 0.5) & (pixel >= -0.5) & (pixel < columns - 0.5)
        return np.where(inside, line, np.nan), np.where(inside, pixel, np.nan)

    def look(self, longitude_deg: Array, latitude_deg: Array, height_m: Array) -> Look:
        """Incidence angle, flight direction, look side and altitude for places; parameters as in :meth:`positions`."""
        place = _geocentric(longitude_deg, latitude_deg, height_m)
        time = self._zero_doppler(place)
        radar, velocity = self._orbit(time), self._orbit(time, 1)
        longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
        east = np.stack([-np.sin(longitude), np.cos(longitude), np.zeros_like(longitude)], axis=-1)
        up = np.stack(
            [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
        )
        ray = (place - radar) / np.linalg.norm(place - radar, axis=-1, keepdims=True)
        azimuth = np.degrees(np.arctan2((ray * east).sum(-1), (ray * np.cross(up, east)).sum(-1)))
        right = (np.cross(ray, velocity) * up).sum(-1) > 0
        return Look(
            np.degrees(np.arccos(np.clip(-(ray * up).sum(-1), -1.0, 1.0))),
            np.where(right, azimuth - 90.0, azimuth + 90.0) % 360.0,
            right,
            np.asarray(transformer("EPSG:4978", "EPSG:4979").transform(*np.moveaxis(radar, -1, 0))[2]),
        )

    @cached_property
    def _orbit(self) -> Any:
        # between state vectors 10 s apart, the interpolation error is below a millimetre
        return scipy.interpolate.CubicHermiteSpline(self.orbit_s, self.position_m, self.velocity_m_s)

    def _zero_doppler(self, place: Array) -> Array:
        """Time at which the line of sight to a place is perpendicular to the velocity [s], by Newton's method."""
        time = np.full(place.shape[:-1], 0.5 * self.shape[0] * self.line_s)
        first, last = self.orbit_s[0], self.orbit_s[-1]
        for _ in range(_STEPS):
            ray, velocity = place - self._orbit(time), self._orbit(time, 1)
            slope = (ray * self._orbit(time, 2)).sum(-1) - (velocity**2).sum(-1)
            step = (ray * velocity).sum(-1) / slope
            time = np.clip(time - step, first, last)  # for places far from the image the result is an end of the orbit
            if np.abs(step).max(initial=0.0) < _DONE_S:
                break
        return time


def between(knots: Array, at: Array, values: Callable[[int, NDArray[np.bool_]], Array]) -> Array:
    """Values of a quantity between knots, by linear interpolation; beyond the outer knots, those of the nearest knot.

    Parameters
    ----------
    knots : ndarray, shape (n,)
        Places of the knots, ascending.
    at : ndarray, shape (k,)
        Places at which the quantity is sought.
    values : callable
        Function from the number of a knot, and a mask of the places, to the values at these places by this knot.
    """
    found = np.empty(at.shape)
    before = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 1)
    for k in np.unique(before):
        there, after = before == k, min(int(k) + 1, len(knots) - 1)
        lower, upper = values(int(k), there), values(after, there)
        apart = knots[after] - knots[k]
        share = np.clip((at[there] - knots[k]) / apart, 0.0, 1.0) if apart > 0 else 0.0
        found[there] = lower + share * (upper - lower)
    return found


def _geocentric(longitude_deg: Array, latitude_deg: Array, height_m: Array) -> Array:
    """Geocentric coordinates [m] of places on WGS 84, shape (..., 3)."""
    return np.stack(transformer("EPSG:4979", "EPSG:4978").transform(longitude_deg, latitude_deg, height_m), axis=-1)
