"""What the mast sees of a scene: the power of each patch of ground and of each object, as a ratio to the noise.

The ground is sampled along rays from the mast. Refraction is that of an earth of 4/3 of its radius (Skolnik, "Radar
Handbook", 3rd edition, 2008, section 26.4), by which heights are lowered at a distance. A sample is in shadow if a
nearer one on its ray stands higher above the antenna's horizon.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.angles import MEAN_RADIUS_M
from radcal.config import Radar
from radcal.laws import Law
from radcal.laws.grazing import RURAL, land_clutter
from radcal.radar.facets import ANGLES_PER_RADIAN
from radcal.radar.reflectivity import law_tables
from radcal.scene.model import Scene
from radcal.scene.objects import Objects
from radcal.sections.ppi import Ppi
from radcal.signals.platform import LIGHT_MPS, carrier_hz, pulse_snr_m2
from radcal.standing.bounce import alpha_deg, bounce_area_m2, reflected

Array = NDArray[np.floating[Any]]
_Cells = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]

EARTH_M = 4.0 / 3.0 * MEAN_RADIUS_M
BINS_DEG = np.linspace(0.0, 90.0, 1801)
"""Edges of the classes of local incidence [deg] in which the visible ground is counted."""

_SAMPLES = 2_000_000  # largest number of samples at a time


@dataclass(frozen=True)
class Ground:
    """Mean power of the ground in each pulse's azimuth and gate, without the pattern of the antenna in azimuth.

    Attributes
    ----------
    speckled, land : ndarray of float64, shape (pulses of a turn, gates)
        Signal-to-noise ratio of a pulse from ground of laws, and from ground of land clutter.
    spread : ndarray of float64, shape (pulses of a turn, gates)
        Weibull spread of the land clutter times ``land``.
    seen : mapping of str to ndarray, shape (classes of BINS_DEG,)
        For each material, area of its visible ground by local incidence [m2].
    """

    speckled: Array
    land: Array
    spread: Array
    seen: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Points:
    """Visible objects within the range, as points.

    Attributes
    ----------
    azimuth_deg : ndarray, shape (n,)
        Bearing from the mast, clockwise from the grid's north [deg].
    gate : ndarray of int, shape (n,)
        Range gate.
    snr : ndarray, shape (n,)
        Signal-to-noise ratio of a pulse that points at the object.
    """

    azimuth_deg: Array
    gate: NDArray[np.intp]
    snr: Array


def site_of(scene: Scene, config: Ppi) -> tuple[float, float]:
    """Place of the mast, to the east and to the north of the corner of the scene's grid [m]."""
    ny, nx = scene.material.shape
    if config.site_m is None:
        return 0.5 * nx * scene.cell_m, 0.5 * ny * scene.cell_m
    if scene.transform is None:
        return config.site_m
    a, b, c, d, e, f = scene.transform
    column, row = np.linalg.solve([[a, b], [d, e]], np.subtract(config.site_m, (c, f)))
    return float(column) * scene.cell_m, float(row) * scene.cell_m


def echo_per_m2(config: Ppi, radar: Radar, range_m: Array, elevation_deg: Array) -> Array:
    """Signal-to-noise ratio of one pulse for each m2 of cross-section in the azimuth of the beam's axis.

    The one-way pattern is Gaussian.

    Parameters
    ----------
    config : Ppi
        Section ``ppi``.
    radar : Radar
        Pass, which gives the carrier.
    range_m, elevation_deg : ndarray
        Slant range [m], and elevation of the line of sight [deg], negative below the horizontal.
    """
    off = (elevation_deg - config.tilt_deg) / config.elevation_beam_deg
    control = np.minimum(1.0, range_m / config.stc_m) ** 4 if config.stc_m else 1.0
    constant = pulse_snr_m2(config, LIGHT_MPS / carrier_hz(radar)) / 10.0 ** (config.losses_db / 10.0)
    return np.asarray(constant * np.exp(-8.0 * math.log(2.0) * off**2) * control / range_m**4)


@dataclass(frozen=True)
class _Mast:
    """Antenna on a mast, and samples of rays from it; places are in metres from the corner of the scene's grid."""

    scene: Scene
    x_m: float
    y_m: float
    antenna_m: float  # elevation
    step_m: float
    distance_m: Array  # of the samples along a ray

    @classmethod
    def of(cls, scene: Scene, config: Ppi) -> _Mast:
        (x, y), step = site_of(scene, config), min(scene.cell_m, 0.5 * config.gate_m)
        distance = (np.arange(math.ceil(config.range_m / step)) + 0.5) * step
        antenna = _height_m(scene, np.array([x]), np.array([y])).item() + config.mast_m
        return cls(scene, x, y, antenna, step, distance)

    def tangent(self, distance: Array, bearing: Array, above_m: Any = 0.0) -> Array:
        """Tangent of the elevation at which the antenna sees the ground, or points above it."""
        ground = _height_m(self.scene, self.x_m + distance * np.sin(bearing), self.y_m + distance * np.cos(bearing))
        return np.asarray((ground + above_m - distance**2 / (2.0 * EARTH_M) - self.antenna_m) / distance)

    def rays(self, bearing: Array) -> tuple[_Cells, Array, Array]:
        """Cells of the samples of rays, tangents of their elevation, and largest tangents up to each sample."""
        x, y = self.x_m + self.distance_m * np.sin(bearing), self.y_m + self.distance_m * np.cos(bearing)
        cells, tangent = _cells(self.scene, x, y), self.tangent(self.distance_m, bearing)
        return cells, tangent, np.maximum.accumulate(np.where(cells[2], tangent, -np.inf), axis=1)


def _height_m(scene: Scene, x: Array, y: Array) -> Array:
    assert scene.elevation_m is not None  # noqa: S101 - checked before
    places = np.stack([y, x]) / scene.cell_m - 0.5
    return np.asarray(scipy.ndimage.map_coordinates(scene.elevation_m, places, order=1, mode="nearest"))


def _cells(scene: Scene, x: Array, y: Array) -> _Cells:
    """Row and column of each place, and whether it lies in the scene."""
    ny, nx = scene.material.shape
    row, column = (np.floor(each / scene.cell_m).astype(np.intp) for each in (y, x))
    inside = (row >= 0) & (row < ny) & (column >= 0) & (column < nx)
    return np.clip(row, 0, ny - 1), np.clip(column, 0, nx - 1), inside


def ground_of(
    scene: Scene, config: Ppi, radar: Radar, laws: Mapping[str, Law], parameters: Mapping[str, Sequence[float]]
) -> Ground:
    """Power of all ground that the mast sees.

    Parameters
    ----------
    scene : Scene
        Scene with elevations.
    config : Ppi
        Section ``ppi``.
    radar : Radar
        Pass, which gives carrier, band and polarisation.
    laws, parameters : mapping
        Law of each material, and its parameters.
    """
    assert scene.elevation_m is not None  # noqa: S101 - checked before
    slope_north, slope_east = (np.gradient(scene.elevation_m, scene.cell_m, axis=k) for k in (0, 1))
    mast = _Mast.of(scene, config)
    distance = mast.distance_m
    # rays as close as the cells at the largest distance, a whole number of them for each pulse
    rays = math.ceil(2.0 * math.pi * config.range_m / scene.cell_m / config.turn)
    at_once = max(1, _SAMPLES // (rays * distance.size))
    sums = np.zeros((3, config.turn * config.gates))
    seen = {name: np.zeros(BINS_DEG.size - 1) for name in laws}
    tables = {name: RURAL if rows == "rural" else rows for name, rows in config.land.items()}
    for first in range(0, config.turn, at_once):
        pulse = np.arange(first, min(first + at_once, config.turn))
        # a pulse's own azimuths lie about its pointing
        bearing = 2.0 * np.pi * ((pulse[:, None] + (np.arange(rays) + 0.5) / rays - 0.5) / config.turn).reshape(-1, 1)
        east, north = np.sin(bearing), np.cos(bearing)
        (row, column, inside), tangent, horizon = mast.rays(bearing)
        lit = inside & (tangent >= horizon)
        slope_x, slope_y = slope_east[row, column], slope_north[row, column]
        away = slope_x * east + slope_y * north - distance / EARTH_M  # slope along the ray, over the sunken earth
        tilt = 1.0 + away**2 + (slope_x * north - slope_y * east) ** 2
        towards = (away - tangent) / np.sqrt(tilt * (1.0 + tangent**2))  # cosine of the local incidence
        slant = distance * np.sqrt(1.0 + tangent**2)
        lit &= (towards > 0.0) & (slant < config.gates * config.gate_m)
        which = np.nonzero(lit)
        area = distance[which[1]] * mast.step_m * (2.0 * np.pi / (config.turn * rays)) * np.sqrt(tilt[lit])
        elevation = np.degrees(np.arctan(tangent[lit]))
        power = area * echo_per_m2(config, radar, slant[lit], elevation)
        place = pulse[which[0] // rays] * config.gates + (slant[lit] / config.gate_m).astype(np.intp)
        phi = np.arccos(towards[lit])
        material = scene.material[row[lit], column[lit]]
        sunken = np.degrees(distance[which[1]] / EARTH_M)
        for name, law in laws.items():
            own = material == scene.names.index(name) + 1
            seen[name] += np.histogram(np.degrees(phi[own]), BINS_DEG, weights=area[own])[0]
            if name in tables:
                level, spread = land_clutter(-elevation[own] - sunken[own], tables[name])
                clutter = power[own] * 10.0 ** (level / 10.0)
                sums[1] += np.bincount(place[own], clutter, minlength=sums.shape[1])
                sums[2] += np.bincount(place[own], clutter * spread, minlength=sums.shape[1])
            else:
                clutter = power[own] * 10.0 ** (law(phi[own], parameters[name]) / 10.0)
                sums[0] += np.bincount(place[own], clutter, minlength=sums.shape[1])
    speckled, land, spread = sums.reshape(3, config.turn, config.gates)
    return Ground(speckled, land, spread, seen)


def _standing_m2(
    scene: Scene, objects: Objects, distance_m: Array, bearing_deg: Array, theta_deg: Array,
    foot: NDArray[np.bool_], polarisation: str, tables: Array,
) -> Array:  # fmt: skip
    """Cross-section of roof, walls and double bounce of each object [m2].

    ``bearing_deg`` is the direction to the mast, ``theta_deg`` the incidence on level ground at the foot; from 90
    degrees on there is neither roof nor double bounce. ``foot`` is whether the mast sees the foot. The ground in front
    of a wall that takes part in the double bounce ends at the mast.
    """
    if (walls := objects.walls) is None:
        return np.zeros(len(objects))
    above = theta_deg < 90.0
    theta = np.where(above, theta_deg, 45.0)

    def sigma0(material: NDArray[Any], angle_deg: Array) -> Array:
        return np.asarray(tables[material, np.rint(np.radians(angle_deg) * ANGLES_PER_RADIAN).astype(np.intp)])

    roofs = np.array([0, *(scene.names.index(name) + 1 for name in walls.roofs)])[walls.roof + 1]
    total = np.where(above, sigma0(roofs, theta) * objects.length_m * objects.width_m, 0.0)
    bounce = walls.bounce & foot & above & (polarisation in ("HH", "VV"))
    bouncing_m = np.minimum(objects.height_m, distance_m / np.tan(np.radians(theta)))
    wall_m = np.nan_to_num(10.0 ** (walls.sigma0_db / 10.0)) * objects.height_m
    sides = (objects.length_m, objects.width_m), (objects.width_m, objects.length_m)
    for turn in range(4):
        (deep, length), normal = sides[turn % 2], np.radians(objects.heading_deg + 90.0 * turn)
        cosine = np.cos(np.radians(bearing_deg) - normal)
        ahead = 0.5 * (deep + scene.cell_m)  # middle of the cell in front of the foot
        row, column, inside = _cells(scene, objects.x_m + ahead * np.sin(normal), objects.y_m + ahead * np.cos(normal))
        phi = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        gain = reflected(theta, phi, polarisation, walls.permittivity)
        gain *= sigma0(scene.material[row, column] * inside, alpha_deg(theta, phi))
        area = bounce_area_m2(theta, phi, bouncing_m, length) * gain
        total += np.where(cosine > 1e-3, wall_m * length + np.where(bounce, area, 0.0), 0.0)
    return total


def points_of(
    scene: Scene, config: Ppi, radar: Radar, laws: Mapping[str, Law], parameters: Mapping[str, Sequence[float]]
) -> Points:
    """Objects that the mast sees; an object's cross-section is at its height above the middle of its footprint.

    That of a box with a roof is the sum of roof, walls and double bounce, whose foot the mast sees. Ground hides an
    object from as far as a cell before it. The arguments are those of :func:`ground_of`.
    """
    if (objects := scene.objects) is None:
        return Points(np.zeros(0), np.zeros(0, np.intp), np.zeros(0))
    mast = _Mast.of(scene, config)
    x, y = objects.x_m - mast.x_m, objects.y_m - mast.y_m
    distance, bearing = np.maximum(np.hypot(x, y), 1e-3), np.arctan2(x, y)
    own, foot = (mast.tangent(distance, bearing, up) for up in (objects.height_m, 0.0))
    nearer, horizon = np.searchsorted(mast.distance_m, distance - scene.cell_m), np.full(len(objects), -np.inf)
    for some in np.array_split(np.flatnonzero(nearer), len(objects) * mast.distance_m.size // _SAMPLES + 1):
        horizon[some] = mast.rays(bearing[some, None])[2][np.arange(some.size), nearer[some] - 1]
    slant, elevation, bearing_deg = distance * np.sqrt(1.0 + own**2), np.degrees(np.arctan(own)), np.degrees(bearing)
    sigma = objects.cross_section_m2((bearing_deg + 180.0) % 360.0, -elevation, radar.band, radar.polarisation)
    tables, grazing = law_tables(scene.names, laws, parameters), -np.arctan(foot) - distance / EARTH_M
    sigma = np.nan_to_num(sigma) + _standing_m2(  # boxes with a roof have no cross-section of their own
        scene, objects, distance, bearing_deg + 180.0, 90.0 - np.degrees(grazing), foot >= horizon, radar.polarisation,
        tables,
    )  # fmt: skip
    shown = (own >= horizon) & (slant < config.gates * config.gate_m) & (sigma > 0.0)
    snr = sigma * echo_per_m2(config, radar, slant, elevation)
    return Points(bearing_deg[shown] % 360.0, (slant[shown] / config.gate_m).astype(np.intp), snr[shown])
