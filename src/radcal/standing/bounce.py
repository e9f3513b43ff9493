"""Double bounce between a wall and the rough ground in front of it, by geometrical optics.

The wall is a plane mirror, so that the radar sees the ground in front of it a second time, mirrored. The facets of the
ground that send this echo back to the radar are those whose normal lies in the plane of mirroring: their local
incidence is alpha, for which the law of the ground gives the echo's strength. The paths from wall to ground and from
ground to wall are the same path in opposite directions; their echoes add in amplitude, and give four times the power of
one of them. Half the length of the path equals the slant range of the wall's foot, whatever the height of the point on
the wall. In a cross-polarised image there is no double bounce.

References
----------
Franceschetti, Iodice and Riccio, "A canonical problem in electromagnetic backscattering from buildings", IEEE TGRS 40
(2002), pages 1787-1801: the case of geometrical optics for wall and ground.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]


def alpha_deg(theta_deg: Doubles, phi_deg: Doubles) -> Doubles:
    """Incidence at which the ground's law is evaluated for the double bounce [deg].

    Parameters
    ----------
    theta_deg : ndarray
        Incidence on level ground at the wall's foot [deg].
    phi_deg : ndarray
        Horizontal angle between the wall's outward normal and the direction to the radar [deg].
    """
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.asarray(np.degrees(np.arctan(np.tan(theta) * np.abs(np.sin(phi)))))


def bounce_area_m2(theta_deg: Doubles, phi_deg: Doubles, height_m: Doubles, length_m: Doubles) -> Doubles:
    """Cross-section of the double bounce divided by sigma0(alpha) of the ground [m2], for a wall that reflects all.

    Parameters
    ----------
    theta_deg, phi_deg : ndarray
        The same as for :func:`alpha_deg` [deg].
    height_m, length_m : ndarray
        Height and lit length of the wall [m].
    """
    in_front = height_m * np.tan(np.radians(theta_deg)) * np.cos(np.radians(phi_deg))
    return np.asarray(4.0 * in_front * length_m)


def reflection(permittivity: float, incidence_deg: Doubles, polarisation: str) -> Doubles:
    """Power reflected by a smooth surface, of that which falls on it (Fresnel).

    Parameters
    ----------
    permittivity : float
        Relative permittivity of the reflecting body, a real number.
    incidence_deg : ndarray
        Angle between the ray and the normal of the surface [deg].
    polarisation : {'perpendicular', 'parallel'}
        Direction of the electric field, relative to the plane of ray and normal.

    References
    ----------
    Born and Wolf, "Principles of optics", section 1.5.2.
    """
    angle = np.radians(incidence_deg)
    cosine, inner = np.cos(angle), np.sqrt(permittivity - np.sin(angle) ** 2)
    outer = cosine if polarisation == "perpendicular" else permittivity * cosine
    return np.asarray(((outer - inner) / (outer + inner)) ** 2)


def reflected(
    theta_deg: Doubles, phi_deg: Doubles, polarisation: str, permittivity: tuple[float, ...] | None
) -> Doubles:
    """Factor G of the double bounce: loss at the wall, and change of the ground's reflection with the angle.

    Parameters
    ----------
    theta_deg, phi_deg : ndarray
        The same as for :func:`alpha_deg` [deg].
    polarisation : {'HH', 'VV'}
        Polarisation of the image. The electric field is taken as that of a wall that faces the radar (phi = 0).
    permittivity : tuple of float, or None
        Relative permittivity of walls and of the ground; without them G is 1.

    Returns
    -------
    ndarray
        |R_wall|^2 |R_ground(beta)|^2 / |R_ground(0)|^2 with cos(beta) = cos(theta) / cos(alpha). For the ground it is a
        ratio, because the ground's law contains its reflection at normal incidence on the facets already.
    """
    if permittivity is None:
        return np.ones(np.broadcast(theta_deg, phi_deg).shape)
    wall, ground = permittivity
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    field = "perpendicular" if polarisation == "HH" else "parallel"
    on_wall = np.degrees(np.arccos(np.sin(theta) * np.cos(phi)))
    beta = np.degrees(np.arccos(np.minimum(np.cos(theta) / np.cos(np.radians(alpha_deg(theta_deg, phi_deg))), 1.0)))
    ratio = reflection(ground, beta, field) / reflection(ground, np.zeros(1), field)
    return np.asarray(reflection(wall, on_wall, field) * ratio)
