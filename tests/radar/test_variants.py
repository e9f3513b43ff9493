"""Wrong variants of geometry and radiometry: side, angles, areas, powers."""

import numpy as np
import pytest
from variants import agrees

from radcal.angles import depression_deg, incidence_deg
from radcal.config import Radar
from radcal.posterior.cells import area_db
from radcal.radar.earth import heading_at_scene, heading_of_sight
from radcal.radar.points import FINENESS, fine_taps
from radcal.radar.projection import make_geometry
from radcal.radar.radiometry import of_sigma0, with_noise_db
from radcal.radar.reflectivity import law_tables, reflectivity

ANGLES = np.array([23.0, 37.0, 52.0])
RAD = np.radians(ANGLES)
EARTH_M = 6_371_008.8


def test_area_factor_of_each_radiometry():
    sine, secant, one = np.sin(RAD), 1.0 / np.cos(RAD), np.ones(3)
    agrees(of_sigma0("beta0", ANGLES), 1.0 / sine, inverse=sine, cosine=secant, unit=one, degrees=1.0 / np.sin(ANGLES))
    for name in ("gamma0", "gamma0_rtc"):
        agrees(of_sigma0(name, ANGLES), secant, inverse=1.0 / secant, sine=1.0 / sine, tangent=np.tan(RAD))
    for name in ("sigma0_local", "sigma0_ref"):
        agrees(of_sigma0(name, ANGLES), one, beta0=1.0 / sine, gamma0=secant)


def test_noise_adds_in_power():
    law, noise = np.array([-12.0, -20.0, -31.0]), -22.0
    power = 10.0 ** (law / 10.0) + 10.0 ** (noise / 10.0)
    agrees(
        with_noise_db(law, noise),
        10.0 * np.log10(power),
        none=law,
        larger=np.maximum(law, noise),
        db_sum=law + noise,
        amplitudes=20.0 * np.log10(10.0 ** (law / 20.0) + 10.0 ** (noise / 20.0)),
        db_mean=0.5 * (law + noise),
        subtracted=10.0 * np.log10(np.abs(10.0 ** (law / 10.0) - 10.0 ** (noise / 10.0))),
    )


@pytest.mark.parametrize(("side", "sign"), [("right", 1.0), ("left", -1.0)])
@pytest.mark.parametrize("radiometry", ["sigma0_ref", "beta0", "gamma0", "sigma0_local"])
def test_tilted_plane(build_scene, side, sign, radiometry):
    """A plane that rises eastwards: it faces a radar in the west, and turns away from one in the east."""
    slope = 0.15
    radar = Radar(altitude_m=4e4, depression_deg=51.0, look_side=side, radiometry=radiometry)
    scene = build_scene(lambda east, north: slope * east, cells=(30, 60))
    geometry = make_geometry(scene, radar)
    middle = geometry.shape[0] // 2, geometry.shape[1] // 2
    flat, tilt = np.radians(geometry.flat_incidence_deg[middle[0]]), np.arctan(slope)
    local = flat - sign * tilt
    agrees(
        np.radians(geometry.incidence_deg[middle]),
        local,
        rtol=2e-3,
        look_side=flat + sign * tilt,
        level=flat,
        degrees=flat - sign * slope * 180.0 / np.pi,
    )
    area = np.sin(flat) / np.sin(local)  # of the ground in a pixel, over that of level ground
    found = area_db(geometry, radar).reshape(geometry.shape)[middle[0] - 3 : middle[0] + 4, 8:-8].mean()
    agrees(found, 10.0 * np.log10(area), atol=0.03, amplitude=20.0 * np.log10(area), inverse=-10.0 * np.log10(area))


def test_angles_over_a_spherical_earth():
    """The radar stands at (0, R + h), and the ground at the angle of incidence is found by the law of sines."""
    height, angle = 693e3, np.radians(39.0)
    nadir = np.arcsin(np.sin(angle) * EARTH_M / (EARTH_M + height))
    flat, off = 51.0, np.degrees(nadir)
    agrees(depression_deg(39.0, height), 90.0 - off, rtol=1e-9, flat_earth=flat, from_nadir=off, central=39.0 - off)
    agrees(incidence_deg(90.0 - off, height), 39.0, rtol=1e-9, flat_earth=off, from_horizon=51.0)
    assert np.isnan(incidence_deg(20.0, height))  # the line of sight does not meet the earth


@pytest.mark.parametrize(("side", "turn"), [("right", 90.0), ("left", -90.0)])
def test_heading_is_at_right_angles_to_the_sight(side, turn):
    longitude, latitude, bearing = 6.2, 51.7, 103.0  # bearing of the sight at the scene, away from the satellite
    lon, lat, az = np.radians([longitude, latitude, bearing])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    away = np.sin(az) * east + np.cos(az) * np.cross(up, east)
    place = EARTH_M * up
    satellite = place - 9e5 * (np.sin(0.7) * away - np.cos(0.7) * up)
    right = (bearing - turn) % 360.0
    agrees(
        heading_of_sight(satellite, place, longitude, latitude, side),
        right,
        other_side=(bearing + turn) % 360.0,
        line_of_sight=bearing,
        towards_radar=(bearing + 180.0 - turn) % 360.0,
        mathematical=(90.0 - bearing - turn) % 360.0,
        axes=(90.0 - bearing) % 360.0,
    )
    # the same triangle on the sphere: from the point below the satellite, meridians converge
    arc = np.radians(33.0) - np.arcsin(np.sin(np.radians(33.0)) * EARTH_M / (EARTH_M + 693e3))
    below = np.cos(arc) * up - np.sin(arc) * away
    there = np.cos(arc) * away + np.sin(arc) * up
    lon_below, lat_below = np.arctan2(below[1], below[0]), np.arcsin(below[2])
    east_below = np.array([-np.sin(lon_below), np.cos(lon_below), 0.0])
    at_below = np.degrees(np.arctan2(there @ east_below, there @ np.cross(below, east_below)))
    assert abs(np.degrees(lat_below) - latitude) > 0.5
    agrees(
        heading_at_scene((at_below - turn) % 360.0, 33.0, 693e3, latitude, side),
        right,
        rtol=1e-4,
        unchanged=(at_below - turn) % 360.0,
        backwards=(2.0 * at_below - bearing - turn) % 360.0,
        other_side=(bearing + turn) % 360.0,
    )


def test_power_of_a_law_is_a_tenth_of_its_decibels():
    class Table:
        names, formula = ("a",), "a - phi"

        def __call__(self, phi_rad, x):
            return x[0] - 8.0 * np.asarray(phi_rad)

    tables = law_tables(("grass", "crops"), {"crops": Table()}, {"crops": [-7.0]})
    level = -7.0 - 8.0 * np.radians(30.0)
    agrees(
        [tables[2, round(65535 / 3)], tables[1].max(), tables[3].min()],
        [10.0 ** (level / 10.0), 0.0, 1.0],
        rtol=1e-4,
        amplitude=[10.0 ** (level / 20.0), 0.0, 1.0],
        degrees=[10.0 ** (-(7.0 + 8.0 * 30.0) / 10.0), 0.0, 1.0],
        from_grazing=[10.0 ** ((-7.0 - 8.0 * np.radians(60.0)) / 10.0), 0.0, 1.0],
    )


def test_power_of_a_pixel_is_the_sum_over_its_facets(scene, radar):
    """Independent of which facets a pixel has: every facet by its own angle, not the pixel's mean angle."""
    geometry = make_geometry(scene, radar)
    phi = np.linspace(0.0, np.pi / 2.0, 65536)
    tables = np.zeros((4, 65536), np.float32)
    tables[1], tables[2], tables[3] = np.cos(phi) ** 9, 0.3 * np.cos(phi), 1.0
    first = geometry.facet_start[geometry.cell_start]
    id_of = np.repeat(geometry.cell_material, np.diff(geometry.facet_start))
    power = geometry.facet_weight * tables[id_of, geometry.facet_incidence]
    right = np.add.reduceat(power, first[:-1]) * (np.diff(first) > 0)
    mean = np.add.reduceat(geometry.facet_weight, first[:-1]) * tables[1, 65535 * 3 // 7]
    found = reflectivity(geometry, tables).image.ravel()
    agrees(found, right, rtol=1e-4, atol=1e-7, amplitudes=np.sqrt(right), mean_angle=mean, mean=right / 2.0)


@pytest.mark.parametrize(("resolution", "spacing"), [(2.0, 1.4), (3.3, 1.1)])
def test_echo_of_a_point_has_unit_energy_wherever_it_lies(resolution, spacing):
    taps = fine_taps(resolution, spacing).astype(np.float64)
    energy = np.array([(taps[k::FINENESS] ** 2).sum() for k in range(FINENESS)])
    agrees(
        energy,
        np.ones(FINENESS),
        rtol=2e-3,
        of_all_taps=np.full(FINENESS, 1.0 / FINENESS),
        peak_of_one=energy / taps.max() ** 2,
        amplitudes=[np.abs(taps[k::FINENESS]).sum() for k in range(FINENESS)],
    )
