"""Incidence and depression angles of a radar that sees level ground on a spherical earth."""

from __future__ import annotations

import math

MEAN_RADIUS_M = 6_371_008.8  # mean of the semi-axes of GRS 80 (Moritz, "Geodetic Reference System 1980", 2000: R1)


def incidence_deg(depression_deg: float, altitude_m: float, radius_m: float = MEAN_RADIUS_M) -> float:
    """Incidence angle on level ground of a spherical earth, from the depression angle of the radar.

    Parameters
    ----------
    depression_deg : float
        Angle below the horizontal at which the radar sees the ground [deg].
    altitude_m : float
        Height of the radar above the sphere [m].
    radius_m : float
        Radius of the sphere [m].

    Returns
    -------
    float
        Incidence angle [deg], which is larger than the angle at the radar from nadir; NaN if the line of sight does not
        meet the sphere.

    References
    ----------
    Curlander and McDonough, "Synthetic Aperture Radar: Systems and Signal Processing" (1991), section 1.2: law of sines
    in the triangle of earth's centre, radar and target.
    """
    sine = (1.0 + altitude_m / radius_m) * math.cos(math.radians(depression_deg))
    return math.degrees(math.asin(sine)) if abs(sine) < 1.0 else math.nan


def depression_deg(incidence_deg: float, altitude_m: float, radius_m: float = MEAN_RADIUS_M) -> float:
    """Depression angle of the radar [deg] from the incidence angle [deg]: the inverse of :func:`incidence_deg`."""
    return math.degrees(math.acos(math.sin(math.radians(incidence_deg)) / (1.0 + altitude_m / radius_m)))
