"""Position of the track relative to the ground, over a flat or a curved earth.

Over a curved earth, the ground is modelled as a sphere with the ellipsoid's radius of curvature at the scene. The scene
is computed in the plane that touches the sphere at the scene's centre. Elevations are lowered by the depth of the
sphere below this plane, which depends on ground range alone. At the scene's centre, slant range and incidence angle are
the same as on the sphere. Elevations are not lowered along azimuth, because an orbit follows the curvature of the
earth. For the local incidence, slopes and the direction to the radar are given relative to the local vertical
(:func:`upright`). ``docs/simulator.md`` gives the errors of this approximation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.angles import MEAN_RADIUS_M, depression_deg, incidence_deg
from radcal.compiled import njit
from radcal.config import Radar

Doubles = NDArray[np.float64]


def heading_at_scene(
    heading_deg: float, incidence_deg: float, altitude_m: float, latitude_deg: float, look_side: str = "right"
) -> float:
    """Heading of a satellite's track at the scene, computed from the heading at the point below the satellite.

    For an orbit, the heading at the scene differs from the heading at the point below the satellite by some degrees,
    because meridians converge between the two places. Annotations of products give the heading below the satellite;
    ``radar.heading_deg`` is the heading at the scene. The result has an error of up to 0.4 degrees, because the height
    of an orbit above the ellipsoid is not constant; the result of :func:`heading_of_sight` is exact.

    Parameters
    ----------
    heading_deg : float
        Heading at the point below the satellite, relative to the ground, clockwise from north [deg].
    incidence_deg : float
        Incidence on level ground at the scene [deg].
    altitude_m : float
        Height of the track above the ground [m].
    latitude_deg : float
        Latitude of the scene [deg].
    look_side : str
        ``right`` or ``left``.

    Returns
    -------
    float
        Heading at the scene, perpendicular to the direction to the satellite, clockwise from north [deg], 0 to 360.

    References
    ----------
    Napier's analogies for the spherical triangle of pole, point below the satellite, and scene. Snyder, "Map
    projections: a working manual", USGS Professional Paper 1395 (1987), chapter 5, has the formulas of spherical
    triangles.
    """
    side = 90.0 if look_side == "right" else -90.0
    arc = math.radians(incidence_deg + depression_deg(incidence_deg, altitude_m) - 90.0)
    look = math.radians((heading_deg + side + 180.0) % 360.0 - 180.0)
    colatitude = math.radians(90.0 - latitude_deg)
    at_pole = math.asin(math.sin(arc) * math.sin(abs(look)) / math.sin(colatitude))
    ratio = math.sin(0.5 * (colatitude + arc)) / math.sin(0.5 * (colatitude - arc))
    at_scene = 2.0 * math.atan2(1.0, math.tan(0.5 * (abs(look) - at_pole)) * ratio)
    return (math.degrees(math.copysign(math.pi - at_scene, look)) - side) % 360.0


def heading_of_sight(
    satellite_m: ArrayLike, place_m: ArrayLike, longitude_deg: float, latitude_deg: float, look_side: str = "right"
) -> float:
    """Heading of a track at the scene, perpendicular to the line of sight from a satellite at zero Doppler.

    Parameters
    ----------
    satellite_m, place_m : array_like, shape (3,)
        Earth-centred, earth-fixed coordinates [m] of the satellite and of the scene's centre, at the time at which the
        satellite sees the scene's centre at zero Doppler.
    longitude_deg, latitude_deg : float
        Geodetic longitude and latitude of the scene's centre [deg].
    look_side : str
        ``right`` or ``left``.

    Returns
    -------
    float
        Heading at the scene, clockwise from north [deg], 0 to 360; the value for the key ``radar.heading_deg``.
    """
    away = np.asarray(place_m, dtype=np.float64) - np.asarray(satellite_m, dtype=np.float64)
    longitude, latitude = math.radians(longitude_deg), math.radians(latitude_deg)
    east = away @ [-math.sin(longitude), math.cos(longitude), 0.0]
    along = [-math.sin(latitude) * math.cos(longitude), -math.sin(latitude) * math.sin(longitude), math.cos(latitude)]
    bearing = math.degrees(math.atan2(east, away @ along))
    return (bearing - (90.0 if look_side == "right" else -90.0)) % 360.0


@dataclass(frozen=True)
class LineOfSight:
    """Position of the track relative to the scene's centre, in the vertical plane across the track.

    Attributes
    ----------
    height_m : float
        Height of the track above the tangent plane of the earth at the scene's centre and mean elevation [m].
    ground_m : float
        Distance in the tangent plane from the point below the track to the scene's centre [m].
    altitude_m : float
        Height of the track above the ground at the point below the track [m]; equal to ``height_m`` over a flat earth.
    radius_m : float
        Radius of the earth at the scene's mean elevation [m]; infinite for a flat earth.
    stretch : (float, float)
        Distance on the ground, at the scene's mean elevation, per distance in the scene's grid: along azimuth, and
        along ground range. Without effect for a flat earth.
    """

    height_m: float
    ground_m: float
    altitude_m: float
    radius_m: float
    stretch: tuple[float, float] = (1.0, 1.0)

    def flat_incidence_deg(self, slant_m: ArrayLike) -> NDArray[np.float64]:
        """Incidence angle [deg] of level ground at the slant range ``slant_m``."""
        slant = np.asarray(slant_m, dtype=np.float64)
        if math.isinf(self.radius_m):
            return np.asarray(np.degrees(np.arccos(np.minimum(self.height_m / slant, 1.0))))
        altitude, radius = self.altitude_m, self.radius_m
        # law of cosines, with the difference of the large squares written out
        cosine = (altitude * (altitude + 2.0 * radius) - slant**2) / (2.0 * radius * slant)
        return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1.0))))

    def level_incidence_deg(self, ground_m: Doubles, down_m: Doubles) -> Doubles:
        """Incidence angle [deg] of level ground at any elevation.

        Parameters
        ----------
        ground_m, down_m : ndarray
            Distance from the track in the tangent plane, and depth below the track with lowered elevations [m].
        """
        tilt = (ground_m - self.ground_m) / self.radius_m
        return np.asarray(np.degrees(np.arctan2(ground_m, down_m) + tilt))

    def slant_range_m(self, flat_incidence_deg: float) -> float:
        """Slant range [m] at which level ground has the incidence angle ``flat_incidence_deg``."""
        cosine = np.cos(np.radians(flat_incidence_deg))
        if math.isinf(self.radius_m):
            return float(self.height_m / cosine)
        return _slant_range_m(float(cosine), self.altitude_m, self.radius_m)

    def lowered(self, elevation_m: NDArray[np.float64], cell_m: float) -> NDArray[np.float64]:
        """Elevations lowered by the depth of a curved earth below its tangent plane at the scene's centre.

        Parameters
        ----------
        elevation_m : ndarray, shape (ny, nx)
            Elevation of the cells [m]; axis 1 is ground range.
        cell_m : float
            Cell size [m].

        Returns
        -------
        ndarray, shape (ny, nx)
            Elevation minus u^2 / 2R [m], where u is the distance from the scene's centre along ground range and R is
            the radius of the earth.
        """
        columns = elevation_m.shape[1]
        along = (np.arange(columns) + 0.5 - 0.5 * columns) * cell_m
        return np.asarray(elevation_m - along**2 / (2.0 * self.radius_m))

    def verticals(self, ground_m: Doubles) -> Doubles:
        """What :func:`upright` needs of the local vertical at each facet of a line.

        At the distance u from the scene's centre along ground range, the vertical is tilted by u / R away from the
        track.

        Parameters
        ----------
        ground_m : ndarray, shape (facets,)
            Distance of the facets from the track in the tangent plane [m].

        Returns
        -------
        ndarray, shape (5, facets)
            Depth of the sphere below its tangent plane [m]; tilt of the vertical [rad], its cosine and its sine;
            tangent of the latitude relative to the track. All but the cosine are 0 for a flat earth.
        """
        from_centre = ground_m - self.ground_m
        tilt = from_centre / self.radius_m
        latitude = math.atan2(self.ground_m, self.radius_m + self.height_m) + tilt
        below = from_centre**2 / (2.0 * self.radius_m)
        return np.stack([below, tilt, np.cos(tilt), np.sin(tilt), np.tan(latitude)])


@njit()
def upright(
    along: Any, across: Any, ground: Any, down: Any, line_m: Any, height: Any, radius: Any, stretch: Any, vertical: Any
) -> tuple[Any, Any, Any, Any]:
    """Slopes of a facet and direction to the radar relative to the local vertical.

    The slopes of the lowered elevations contain the tilt of the vertical as a difference of slopes, which equals a
    rotation by this angle for level ground only. The tilt is therefore taken from the slopes, and the direction to the
    radar is rotated instead. The scale of the grid and the elevation change distances on the ground, and hence slopes.
    Lines of equal azimuth converge away from the track, as meridians converge towards a pole. The horizontal axes are
    rotated by the angle of convergence, so that the direction to the radar has no azimuth component. On a flat earth
    nothing changes.

    Parameters
    ----------
    along, across : float
        Slopes of the lowered elevations along azimuth, and along ground range away from the track [m/m].
    ground, down : float
        Distance of the facet from the track in the tangent plane, and depth below the track with lowered elevations
        [m].
    line_m : float
        Position of the facet's line along azimuth, relative to the scene's centre [m].
    height, radius, stretch : float, float, (float, float)
        Attributes of :class:`LineOfSight`.
    vertical : ndarray, shape (5,)
        Column of :meth:`LineOfSight.verticals`.

    Returns
    -------
    (float, float, float, float)
        Slopes perpendicular to the line of sight, and along it, away from the track [m/m]; horizontal component
        (negative, towards the track) and vertical component of the unit vector to the radar.

    References
    ----------
    Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987), chapters 3 (scale factor) and 5
    (convergence of the meridians on a sphere, longitude difference times sine of latitude; here for a graticule whose
    equator is the track).
    """
    below, tilt, cosine, sine, tangent = vertical
    # elevation above the scene's mean, without the lowering
    scale = 1.0 + (height - down + below) / radius
    along, across = along / (stretch[0] * scale), (across + tilt) / (stretch[1] * scale)
    turn, slant = line_m / radius * tangent, np.hypot(ground, down)
    # to first order, because the angle of convergence is below 0.5 degrees
    toward, up = (-ground * cosine - down * sine) / slant, (down * cosine - ground * sine) / slant
    return along + across * turn, across - along * turn, toward, up


def _slant_range_m(cosine: float, altitude_m: float, radius_m: float) -> float:
    """Slant range [m] from a track to a sphere, computed from the cosine of the incidence angle on the sphere."""
    # the positive root of r^2 + 2 R cos(theta) r = H (H + 2R), in the form without cancellation
    product, half = altitude_m * (altitude_m + 2.0 * radius_m), radius_m * cosine
    return product / (half + math.sqrt(half**2 + product))


def line_of_sight(
    radar: Radar, radius_m: float = MEAN_RADIUS_M, stretch: tuple[float, float] = (1.0, 1.0)
) -> LineOfSight:
    """Position of the track of a pass relative to the scene's centre.

    Parameters
    ----------
    radar : Radar
        Pass.
    radius_m : float
        Radius of the earth at the scene's mean elevation [m]; without effect for ``earth: flat``.
    stretch : (float, float)
        Distance on the ground per distance in the scene's grid (:class:`LineOfSight`); without effect for
        ``earth: flat``.
    """
    if radar.earth == "flat":
        ground = float(radar.altitude_m / np.tan(np.radians(radar.depression_deg)))
        return LineOfSight(radar.altitude_m, ground, radar.altitude_m, math.inf)
    incidence = radar.incidence_deg
    if incidence is None:
        incidence = incidence_deg(radar.depression_deg, radar.altitude_m, radius_m)
    angle = math.radians(incidence)
    slant = _slant_range_m(math.cos(angle), radar.altitude_m, radius_m)
    return LineOfSight(slant * math.cos(angle), slant * math.sin(angle), radar.altitude_m, radius_m, stretch)
