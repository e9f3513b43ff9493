"""Places of pixels on the ground of a scene, and of the scene on the earth, with the date of the collection."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np
import scipy

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.radar.earth import line_of_sight
from radcal.scene.crs import longitude_latitude
from radcal.scene.model import Scene
from radcal.signals.platform import Collection, Doubles
from radcal.simulators.forward import Flown

_INVENTED_UTC = "2026-01-01T00:00:00Z"  # start of collections over the built-in scene
_BUILTIN = (36.6244, -84.1825)  # latitude and longitude of the middle of the built-in scene, in its elevation model


def image_places(made: Flown) -> Doubles:
    """Azimuth, ground range and elevation of the pixels of a pass, shape (rows, columns, 3) [m].

    A pixel lies on the ground that the fast image has there. Where it has none, the elevation is that of the nearest
    pixel with ground.
    """
    radar, geometry, scene = made.case.radar, made.geometry, made.scene
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    bare = np.isnan(geometry.ground[0])
    nearest = scipy.ndimage.distance_transform_edt(bare, return_distances=False, return_indices=True)
    height = scipy.ndimage.map_coordinates(scene.elevation_m, geometry.ground[:, *nearest], order=1, mode="nearest")
    rows, columns = geometry.shape
    below = scene.elevation_m.mean() + line_of_sight(radar).height_m - height
    azimuth = np.broadcast_to((np.arange(columns) + 0.5) * radar.azimuth_spacing_m, (rows, columns))
    return np.stack([azimuth, np.sqrt(rows_m(made)[:, None] ** 2 - below**2), height], axis=2)


def rows_m(made: Flown) -> Doubles:
    """Slant range of the rows of a pass, shape (rows,) [m]."""
    first = line_of_sight(made.case.radar).slant_range_m(made.geometry.flat_incidence_deg[0])
    return np.asarray(first + np.arange(made.geometry.shape[0]) * made.case.radar.range_spacing_m)


@dataclass(frozen=True)
class Site:
    """Scene's middle and unit vectors along azimuth, ground range and up, in earth-centred coordinates."""

    origin_m: Doubles
    axes: Doubles
    middle_m: Doubles  # coordinates of the scene's middle in azimuth, ground range and elevation

    def ecf(self, place_m: Doubles) -> Doubles:
        """Earth-centred coordinates of places in the tangent plane at the scene's middle, shape (n, 3) [m]."""
        return np.asarray(self.origin_m + self.turned(place_m - self.middle_m))

    def turned(self, vector: Doubles) -> Doubles:
        """Earth-centred components of vectors, shape (n, 3)."""
        return np.asarray(vector @ self.axes)


def origin(case: Part, scene: Scene) -> tuple[float, float]:
    """Latitude and longitude of the scene's middle [deg]."""
    if case.signals.origin is not None:
        return case.signals.origin
    ny, nx = scene.material.shape
    if (found := longitude_latitude(scene, 0.5 * nx * scene.cell_m, 0.5 * ny * scene.cell_m)) is not None:
        return float(found[1]), float(found[0])
    if case.scene.source == "builtin":
        return _BUILTIN
    raise ConfigError("signals.origin is missing, expected latitude and longitude: the scene is not on a map.")


def start_utc(case: Part) -> datetime:
    """Start of the collection."""
    if case.signals.start_utc is None and case.scene.source != "builtin":
        raise ConfigError("signals.start_utc is missing, expected the date and time of the first pulse.")
    return datetime.fromisoformat(case.signals.start_utc or _INVENTED_UTC)


def site_of(case: Part, scene: Scene, one: Collection) -> Site:
    """Place of the scene's middle on the earth, with its directions; asked for if the scene is not on a map."""
    from sarkit import wgs84

    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    mean, heading = float(scene.elevation_m.mean()), np.radians(case.radar.heading_deg)
    llh = np.array([*origin(case, scene), mean])
    north, east = wgs84.north(llh), wgs84.east(llh)
    ground = one.side * (np.cos(heading) * east - np.sin(heading) * north)
    middle = np.array([0.5 * scene.elevation_m.shape[0] * scene.cell_m, one.reference_m[0, 1], mean])
    azimuth = np.cos(heading) * north + np.sin(heading) * east
    return Site(wgs84.geodetic_to_cartesian(llh), np.stack([azimuth, ground, wgs84.up(llh)]), middle)
