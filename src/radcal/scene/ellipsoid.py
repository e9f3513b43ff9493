"""Ellipsoid under a scene: its radius of curvature, and the scale of the scene's grid."""

from __future__ import annotations

import math

from radcal.scene.crs import transformer

__all__ = ["earth_radius_m", "ground_per_grid"]

_HALF_M = 1000.0  # half of the distance over which the scale of a grid is computed


def earth_radius_m(crs: str, place: tuple[float, float], azimuth_deg: float) -> float:
    """Radius of curvature of the ellipsoid at a place, along a given direction.

    Parameters
    ----------
    crs : str
        Projected CRS, with its ellipsoid.
    place : (float, float)
        Coordinates of the place in the CRS [m].
    azimuth_deg : float
        Direction, clockwise from north [deg].

    Returns
    -------
    float
        Radius of the normal section [m], by Euler's formula from the radii of the meridian and of the prime vertical.

    References
    ----------
    Torge and Mueller, "Geodesy" (4th edition, 2012), section 4.1.3.
    """
    from pyproj import CRS

    plane = CRS.from_user_input(crs)
    _, latitude = transformer(plane, plane.geodetic_crs).transform(*place)
    ellipsoid = plane.ellipsoid
    assert ellipsoid is not None  # noqa: S101 - every geodetic datum has an ellipsoid
    major, ratio = ellipsoid.semi_major_metre, 1.0 - (ellipsoid.semi_minor_metre / ellipsoid.semi_major_metre) ** 2
    root = math.sqrt(1.0 - ratio * math.sin(math.radians(latitude)) ** 2)
    meridian, vertical = major * (1.0 - ratio) / root**3, major / root
    azimuth = math.radians(azimuth_deg)
    return 1.0 / (math.cos(azimuth) ** 2 / meridian + math.sin(azimuth) ** 2 / vertical)


def ground_per_grid(crs: str, place: tuple[float, float], direction: tuple[float, float]) -> float:
    """Distance on the ellipsoid per distance in a grid, at a place and along a direction: inverse of the scale factor.

    Parameters
    ----------
    crs : str
        Projected CRS.
    place : (float, float)
        Coordinates of the place in the CRS [m].
    direction : (float, float)
        Direction in the CRS, a vector of any length.

    Returns
    -------
    float
        Ratio of a geodesic to its length in the grid, over 2 km about the place.

    References
    ----------
    Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987), chapter 4: scale factor.
    """
    from pyproj import CRS

    plane = CRS.from_user_input(crs)
    half = _HALF_M / math.hypot(*direction)
    x, y = ([p - half * v, p + half * v] for p, v in zip(place, direction, strict=True))
    longitude, latitude = transformer(plane, plane.geodetic_crs).transform(x, y)
    geod = plane.get_geod()
    assert geod is not None  # noqa: S101 - every geodetic datum has an ellipsoid
    return float(geod.inv(longitude[0], latitude[0], longitude[1], latitude[1])[2]) / (2.0 * _HALF_M)
