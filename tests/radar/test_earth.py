"""Curved earth against an independent computation in earth-centred coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from pyproj import CRS, Geod, Transformer
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from radcal.config import Radar
from radcal.radar.earth import LineOfSight
from radcal.radar.facets import LAID_OVER, VISIBLE
from radcal.radar.lines import Lines
from radcal.radar.projection import lit_facets, make_geometry
from radcal.scene.crs import ground_per_grid, label, turned
from radcal.scene.model import Scene

CELLS, CELL_M, MEAN_M = 200, 100.0, 300.0  # 20 x 20 km
SPACE = CRS.from_epsg(4978)  # earth-centred, earth-fixed
TO_SPACE = Transformer.from_crs(CRS.from_epsg(4979), SPACE, always_xy=True)


def in_space(longitude, latitude, height):
    return np.stack(TO_SPACE.transform(longitude, latitude, height), axis=-1)


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


@dataclass
class Truth:
    """What a satellite at a constant height above the ellipsoid sees of points in space at zero Doppler."""

    points: np.ndarray
    slant_m: np.ndarray
    to_satellite: np.ndarray
    along_m: np.ndarray
    satellite: np.ndarray


def seen_from_orbit(scene, radar):
    """Zero-Doppler geometry of all cells, on the ellipsoid, without any of radcal's geometry."""
    to_space = Transformer.from_crs(CRS.from_user_input(scene.crs).to_3d(), SPACE, always_xy=True)
    to_place = Transformer.from_crs(SPACE, CRS.from_epsg(4979), always_xy=True)
    x = (np.arange(CELLS) + 0.5 - CELLS / 2) * CELL_M
    across, along = np.meshgrid(x, x)
    points = np.stack(to_space.transform(across, along, scene.elevation_m), axis=-1)

    def at(*place):
        return np.array(to_space.transform(*place))

    mean_m = float(scene.elevation_m.mean())
    middle = at(0.0, 0.0, mean_m)
    up = unit(at(0.0, 0.0, mean_m + 1000.0) - middle)
    forward = unit(at(0.0, 100.0, mean_m) - at(0.0, -100.0, mean_m))
    side = np.cross(forward, up) * (1.0 if radar.look_side == "right" else -1.0)
    angle = math.radians(float(radar.incidence_deg or 0.0))
    sight_line = math.cos(angle) * up - math.sin(angle) * side

    def height(slant):
        return float(to_place.transform(*(middle + slant * sight_line))[2])

    wanted = mean_m + radar.altitude_m
    satellite = middle + brentq(lambda s: height(s) - wanted, radar.altitude_m, 4 * radar.altitude_m) * sight_line
    longitude, latitude, high = to_place.transform(*satellite)
    overhead = unit(in_space(longitude, latitude, high + 1000.0) - satellite)
    velocity = unit(np.cross(overhead, sight_line))
    velocity *= np.sign(velocity @ forward)
    east = np.array([-math.sin(math.radians(longitude)), math.cos(math.radians(longitude)), 0.0])
    bearing = math.degrees(math.atan2(velocity @ east, velocity @ np.cross(overhead, east)))
    steps = np.linspace(-14_000.0, 14_000.0, 57)
    same = np.ones_like(steps)
    track = Geod(ellps="WGS84").fwd(longitude * same, latitude * same, bearing * same, steps)
    orbit = CubicSpline(steps, in_space(track[0], track[1], high * same))
    when = (points - satellite) @ velocity
    for _ in range(6):  # Newton's method for a line of sight across the velocity
        moving = orbit(when, 1)
        when = when + ((points - orbit(when)) * moving).sum(axis=-1) / (moving**2).sum(axis=-1)
    to_satellite = orbit(when) - points
    return Truth(points, np.linalg.norm(to_satellite, axis=-1), unit(to_satellite), when, satellite)


def make_scene(latitude, heading, relief, mean_m=MEAN_M, grid=None):
    """Scene on a grid that is turned to the heading, or on another ``grid`` whose origin is the scene's centre."""
    utm = CRS.from_epsg(32633)
    place = Transformer.from_crs("OGC:CRS84", utm, always_xy=True).transform(15.3, latitude)
    crs = grid or label(turned(utm, place, heading))
    x = (np.arange(CELLS) + 0.5 - CELLS / 2) * CELL_M
    heights = relief(*np.meshgrid(x, x)) + np.zeros((CELLS, CELLS))
    corner = -CELLS / 2 * CELL_M
    return Scene(
        "earth", ("grass",), np.ones((CELLS, CELLS), dtype=np.uint8), heights - heights.mean() + mean_m, CELL_M,
        crs=crs, transform=(CELL_M, 0.0, corner, 0.0, CELL_M, corner), heading_deg=heading or None,
    )  # fmt: skip


def hills(across, along):
    """Hills 300 m high, with slopes up to 13 degrees."""
    return 150.0 * np.sin(across * 2 * np.pi / 4000.0 + 1.0) * np.cos(along * 2 * np.pi / 5200.0 + 0.3)


def flat(across, along):
    return np.zeros_like(across)


def orbit_pass(**keys):
    return Radar(
        **{
            "altitude_m": 693e3, "incidence_deg": 38.0, "heading_deg": 192.0, "range_spacing_m": 70.0,
            "range_resolution_m": 140.0, "azimuth_spacing_m": 100.0, "azimuth_resolution_m": 200.0, **keys,
        }
    )  # fmt: skip


@dataclass
class Facets:
    lines: Lines
    slant_m: np.ndarray
    seen: LineOfSight


def facets_of(scene, radar):
    """Facets of the scene, one for each cell, as the geometry of the image is made from."""
    # pixels at least as large as cells, so that cells are not divided
    lit = lit_facets(scene, radar.model_copy(update={"range_spacing_m": 120.0, "range_resolution_m": 240.0}))
    assert lit.view.k == 1
    return Facets(lit.lines, 0.5 * (lit.lines.near_m.astype(float) + lit.lines.far_m) + lit.view.base_m, lit.view.seen)


def local_incidence_deg(truth):
    normal = np.cross(np.gradient(truth.points, axis=1), np.gradient(truth.points, axis=0))
    return np.degrees(np.arccos((unit(normal) * truth.to_satellite).sum(axis=-1)))


PASSES = [
    (42.0, {"heading_deg": 192.0, "incidence_deg": 38.0}),
    (5.0, {"heading_deg": 12.0, "incidence_deg": 30.0, "look_side": "left"}),
    (-33.0, {"heading_deg": 348.0, "incidence_deg": 23.0, "altitude_m": 628e3}),
    (68.0, {"heading_deg": 281.0, "incidence_deg": 45.0, "altitude_m": 514e3, "look_side": "left"}),
]


@pytest.mark.parametrize(("latitude", "keys"), PASSES)
def test_slant_range_and_azimuth_are_those_of_the_ellipsoid(latitude, keys):
    radar = orbit_pass(**keys)
    scene = make_scene(latitude, radar.heading_deg, hills)
    truth, facets = seen_from_orbit(scene, radar), facets_of(scene, radar)
    inside = (slice(1, -1), slice(1, -1))
    slant = facets.slant_m[:, ::-1] if radar.look_side == "left" else facets.slant_m
    # slant range from the scene's centre, in rows of Sentinel-1 GRD, which are 10 m on the ground
    middle = float(np.linalg.norm(truth.satellite - np.array(centre_in_space(scene))))
    error = (slant - facets.seen.slant_range_m(radar.incidence_deg)) - (truth.slant_m - middle)
    rows = error / (10.0 * math.sin(math.radians(radar.incidence_deg)))
    assert np.abs(rows[inside]).max() < 0.45
    assert np.sqrt(np.mean(rows[inside] ** 2)) < 0.15
    # azimuth lines of radcal are parallel; those of an orbit converge
    x = (np.arange(CELLS) + 0.5 - CELLS / 2) * CELL_M
    per_m = np.polyfit(np.repeat(x, CELLS), truth.along_m.ravel(), 1)[0]
    columns = (truth.along_m / per_m - x[:, None]) / 10.0
    assert np.abs(columns - columns.mean()).max() < 0.4


def steep(across, along):
    """Hills with slopes up to 40 degrees, in all directions."""
    return 685.0 * np.sin(across * 2 * np.pi / 4900.0 + 1.0) * np.cos(along * 2 * np.pi / 5200.0 + 0.3)


# transverse Mercator with a scale of 0.995 at the scene's centre, as far from the central meridian of a zone
SMALLER = "+proj=tmerc +lat_0=42 +lon_0=15.3 +k=0.995 +datum=WGS84 +units=m"


@pytest.mark.parametrize(
    ("latitude", "keys", "mean_m", "grid"),
    [
        *((latitude, keys, 700.0, None) for latitude, keys in PASSES),
        (42.0, {"heading_deg": 0.0}, 3500.0, None),
        (42.0, {"heading_deg": 0.0, "look_side": "left"}, 700.0, SMALLER),
        (42.0, {"heading_deg": 192.0, "altitude_m": 20_000.0, "incidence_deg": 42.0}, 700.0, None),
    ],
)
def test_incidence_on_slopes_of_40_degrees_is_that_of_the_ellipsoid(latitude, keys, mean_m, grid):
    radar = orbit_pass(**keys)
    scene = make_scene(latitude, radar.heading_deg, steep, mean_m, grid)
    slopes = np.degrees(np.arctan(np.hypot(*np.gradient(scene.elevation_m, CELL_M))))
    assert 39.5 < slopes.max() < 41.5
    truth, facets = seen_from_orbit(scene, radar), facets_of(scene, radar)
    found, whole = facets.lines.incidence.astype(float) * 90.0 / 65535.0, (facets.lines.state & VISIBLE) != 0
    if radar.look_side == "left":
        found, whole = found[:, ::-1], whole[:, ::-1]
    expected = local_incidence_deg(truth)
    # a facet of which one half is visible, near a crest or a shadow, has the incidence of this half
    whole = whole & ~ends(~whole) & (expected < 87.0)
    whole[[0, -1]] = whole[:, [0, -1]] = False
    assert whole.mean() > 0.8
    assert np.ptp(expected[whole]) > 60.0
    assert np.abs(found - expected)[whole].max() < 0.007


def centre_in_space(scene):
    crs = CRS.from_user_input(scene.crs).to_3d()
    return Transformer.from_crs(crs, SPACE, always_xy=True).transform(0.0, 0.0, MEAN_M)


def test_level_ground_of_an_image_has_the_ellipsoids_incidence():
    radar = orbit_pass()
    scene = make_scene(42.0, 192.0, flat)
    truth, geometry = seen_from_orbit(scene, radar), make_geometry(scene, radar)
    row, column = np.clip(np.rint(geometry.ground).astype(int), 0, CELLS - 1)
    # one cell is 0.006 degrees of incidence
    gradient = np.gradient(local_incidence_deg(truth), axis=1)[row, column] * (geometry.ground[1] - column)
    expected = local_incidence_deg(truth)[row, column] + gradient
    inner = (slice(4, -4), slice(4, -4))
    assert np.abs(geometry.incidence_deg - expected)[inner].max() < 0.005
    assert np.abs(geometry.flat_incidence_deg[:, None] - expected)[inner].max() < 0.01
    assert np.ptp(geometry.flat_incidence_deg) > 0.8
    assert geometry.earth_radius_m == pytest.approx(6_371_000, abs=20_000)
    # over a flat earth, the look angle of 33.7 degrees would be the incidence
    level = Radar(altitude_m=693e3, depression_deg=radar.centre_depression_deg)
    assert 90.0 - level.depression_deg < 38.0 - 4.0


@pytest.mark.parametrize(("incidence", "least_hidden", "least_laid"), [(62.0, 0.2, 0.0), (28.0, 0.0, 0.1)])
def test_shadow_and_layover_are_those_of_rays_in_space(incidence, least_hidden, least_laid):
    """Cliffs, which hide the ground behind them, or are nearer to the radar than the ground before them."""

    def cliffs(across, along):
        return 260.0 * (np.floor(across / 700.0) % 2 == 1) + 90.0 * (np.floor(along / 2300.0) % 2)

    radar = orbit_pass(incidence_deg=incidence, altitude_m=514e3)
    scene = make_scene(42.0, 192.0, cliffs)
    truth, facets = seen_from_orbit(scene, radar), facets_of(scene, radar)
    # angle at the satellite from the vertical; every row of cells is seen across the track
    angle = np.arccos(truth.to_satellite @ unit(truth.satellite))
    hidden = angle < np.maximum.accumulate(angle, axis=1) - 1e-9
    shadow = (facets.lines.state & VISIBLE) == 0
    assert hidden.mean() > least_hidden
    # cells at the ends of shadows are visible in part
    assert np.mean((shadow != hidden) & ~ends(hidden)) < 0.001
    seen = np.where(hidden, np.nan, truth.slant_m)
    furthest = np.fmax.accumulate(seen, axis=1)
    nearest = np.fmin.accumulate(seen[:, ::-1], axis=1)[:, ::-1]
    laid = ~hidden & ((furthest > truth.slant_m + 120.0) | (nearest < truth.slant_m - 120.0))
    assert laid.mean() >= least_laid
    found = (facets.lines.state & LAID_OVER) != 0
    assert np.mean((found != laid) & ~ends(laid) & ~ends(hidden)) < 0.005


def ends(mask):
    """Cells next to a change of a mask along ground range."""
    change = np.zeros(mask.shape, dtype=bool)
    change[:, 1:] |= mask[:, 1:] != mask[:, :-1]
    change[:, :-1] |= mask[:, 1:] != mask[:, :-1]
    return change


def test_scale_of_a_grid():
    """0.9996 on the central meridian of UTM, 2 at 60 degrees in Mercator; plate carree has 2 along parallels alone."""
    utm = Transformer.from_crs("OGC:CRS84", "EPSG:32633", always_xy=True).transform(15.0, 42.0)
    assert ground_per_grid("EPSG:32633", utm, (0.0, 3.0)) == pytest.approx(1.0 / 0.9996, abs=1e-7)
    assert ground_per_grid("EPSG:32633", utm, (2.0, 2.0)) == pytest.approx(1.0 / 0.9996, abs=1e-7)
    sphere = "+proj=merc +R=6371000 +units=m"
    place = Transformer.from_crs(CRS(sphere).geodetic_crs, sphere, always_xy=True).transform(10.0, 60.0)
    assert ground_per_grid(sphere, place, (0.0, -1.0)) == pytest.approx(0.5, abs=1e-6)
    plate = "+proj=eqc +R=6371000 +units=m"
    place = Transformer.from_crs(CRS(plate).geodetic_crs, plate, always_xy=True).transform(10.0, 60.0)
    assert ground_per_grid(plate, place, (5.0, 0.0)) == pytest.approx(0.5, abs=1e-6)
    assert ground_per_grid(plate, place, (0.0, 5.0)) == pytest.approx(1.0, abs=1e-6)
