"""What the mast sees, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from variants import agrees

from radcal.config import case_from
from radcal.laws import law_for
from radcal.ppi.ground import BINS_DEG, ground_of, points_of, site_of
from radcal.ppi.scan import one_turn
from radcal.scene.objects import Objects, Walls
from radcal.signals.platform import carrier_hz

GAMMA = {"dyke": law_for("constant_gamma")}
X = {"dyke": [-12.0]}
RADAR = case_from({}).radar


def section(**keys):
    return case_from({"ppi": keys}).ppi


def level(east, north):
    return 7.0 + 0.0 * east


def radar_equation_db(range_m, square_db):
    """Default radar at 10 GHz in decibels: 25 kW x 0.1 us, gain 31, losses 3, noise figure 5; square in dBsm."""
    energy, wavelength, boltzmann = -26.02, -15.23, -203.98  # dBJ, dBm, dBJ of 290 K
    return energy + 62.0 + 2.0 * wavelength + square_db - 32.98 - 3.0 - 5.0 - boltzmann - 40.0 * np.log10(range_m)


def test_level_ground_has_the_power_of_the_radar_equation(build_scene):
    """Within 0.1 dB, with the two-way beam: sigma0 x R x width sqrt(pi / (8 ln 2)) x gate."""
    scene, config = build_scene(level, cells=(400, 400)), section(pulses=1, range_m=900, elevation_beam_deg=60)
    ground = ground_of(scene, config, RADAR, GAMMA, X)
    sweep = one_turn(ground, points_of(scene, config, RADAR, GAMMA, X), config, 1)
    gate = 50
    at = sweep.range_m[gate]
    grazing = np.arcsin(30.0 / at) - at / (2.0 * 4.0 / 3.0 * 6.371e6)
    area = at * np.radians(1.2) * np.sqrt(np.pi / (8.0 * np.log(2.0))) * 15.0
    pattern_db = -24.0 * ((np.degrees(grazing) - 2.0) / 60.0) ** 2 * np.log10(2.0) * 10.0 / 3.0103
    right = radar_equation_db(at, -12.0 + 10.0 * np.log10(np.sin(grazing) * area)) + pattern_db
    mean = 10.0 * np.log10(ground.speckled[:, gate].mean() * config.turn / 360.0 * 1.2 * np.sqrt(np.pi / 8 / np.log(2)))
    agrees(mean, right, atol=0.1, beam=right + 1.23, gamma=right - 10.0 * np.log10(np.sin(grazing)))
    assert 10.0 * np.log10(sweep.snr[:, gate].mean()) == pytest.approx(right, abs=0.25)  # speckle of 300 beams


def test_ground_behind_a_wall_is_in_shadow(build_scene):
    """A wall of 20 m at 300 m, seen from 30 m, hides the ground to 900 m."""
    scene = build_scene(lambda east, north: 20.0 * ((east > 300.0) & (east < 305.0)), cells=(40, 440), cell_m=5.0)
    config = section(range_m=1080, prf_hz=400, rotation_rpm=12)
    ground = ground_of(scene, config, RADAR, GAMMA, X)
    east, west = ground.speckled[round(config.turn / 4)], ground.speckled[round(config.turn * 3 / 4)]
    range_m = (np.arange(config.gates) + 0.5) * 15.0
    assert set(range_m[(east == 0.0) & (range_m > 30.0)]) == {at for at in range_m if 315.0 < at < 900.0}
    assert (west > 0.0)[range_m > 30.0].all()


def test_the_horizon_is_that_of_an_earth_of_four_thirds(build_scene):
    """From 30 m over level ground, sqrt(2 (4/3) R h) = 22.6 km; of the earth itself 19.5 km."""
    scene = build_scene(level, cells=(8, 520), cell_m=50.0)
    config = section(site_m=[10.0, 200.0], range_m=25_900, prf_hz=2000, gate_m=100)
    ground = ground_of(scene, config, RADAR, GAMMA, X)
    farthest = 100.0 * (np.flatnonzero(ground.speckled[config.turn // 4])[-1] + 0.5)
    agrees(farthest, np.sqrt(2.0 * 4.0 / 3.0 * 6.371e6 * 30.0), atol=150.0, earth=np.sqrt(2.0 * 6.371e6 * 30.0))


def test_incidence_is_that_of_the_slope(build_scene):
    """A plane rises to the east by 0.2; 1000 m east of a mast of 100 m the line of sight rises by 0.1."""
    patch = np.full((40, 200), 2, dtype=np.uint8)
    patch[18:22, 99:105] = 1
    scene = build_scene(lambda east, north: 0.2 * east, cells=(40, 200), cell_m=10.0, material=patch)
    config = section(site_m=[20.0, 200.0], range_m=1500, mast_m=100.0)
    seen = ground_of(scene, config, RADAR, GAMMA, X).seen["dyke"]
    found = np.average(0.5 * (BINS_DEG[1:] + BINS_DEG[:-1]), weights=seen)
    both = np.sqrt(1.04 * 1.01)
    agrees(np.cos(np.radians(found)), 0.1 / both, atol=2e-3, sign=0.3 / both, level=0.1 / np.sqrt(1.01) + 0.1)
    assert seen.sum() == pytest.approx(40.0 * 60.0 * np.sqrt(1.04), rel=0.03)


def test_land_clutter_takes_the_place_of_law_and_speckle(build_scene):
    scene = build_scene(level, cells=(400, 400))
    law, land = section(range_m=900), section(range_m=900, land={"dyke": [[0.0, -30.0, 2.0]]})
    of_law, of_land = (ground_of(scene, each, RADAR, GAMMA, X) for each in (law, land))
    assert not of_land.speckled.any()
    grazing = np.arcsin(30.0 / 757.5)
    difference = 10.0 * np.log10(of_land.land[:, 50].mean() / of_law.speckled[:, 50].mean())
    assert difference == pytest.approx(-30.0 + 12.0 - 10.0 * np.log10(np.sin(grazing)), abs=0.1)
    np.testing.assert_allclose(of_land.spread, 2.0 * of_land.land)


def objects(x_m, y_m, height_m):
    n = len(x_m)
    zero, number = np.zeros(n), np.zeros(n, dtype=np.int16)
    curve = np.array([[0.0, 10.0], [90.0, 30.0], [180.0, 20.0], [270.0, 0.0]])
    return Objects(
        np.array(x_m), np.array(y_m), zero, zero, zero, np.array(height_m), zero * np.nan, number,
        curves={"car": curve},
    )  # fmt: skip


def test_objects_have_the_power_of_the_radar_equation_and_their_aspect(build_scene):
    """From the middle at (500, 500): one in the north, seen from behind at 180 degrees, one in the east at 270."""
    scene = replace(build_scene(level, cells=(200, 200)), objects=objects([500.0, 900.0], [800.0, 500.0], [30.0, 30.0]))
    found = points_of(scene, section(tilt_deg=0.0), RADAR, GAMMA, X)
    np.testing.assert_allclose(found.azimuth_deg, [0.0, 90.0], atol=1e-9)
    np.testing.assert_array_equal(found.gate, [20, 26])
    right = radar_equation_db(np.array([300.0, 400.0]), np.array([20.0, 0.0]))
    agrees(10.0 * np.log10(found.snr), right, atol=0.02, towards=right + [-10.0, 30.0], one_way=right / 2.0)
    held = points_of(scene, section(tilt_deg=0.0, stc_m=600.0), RADAR, GAMMA, X)
    np.testing.assert_allclose(held.snr / found.snr, [1 / 16.0, 16.0 / 81.0])


def test_objects_behind_a_wall_are_hidden_unless_they_are_tall(build_scene):
    """A wall of 20 m at 200 m, seen from 30 m: at 400 m it hides what stands below 10 m."""
    wall = build_scene(lambda east, north: 20.0 * ((east > 200.0) & (east < 205.0)), cells=(200, 200))
    scene = replace(wall, objects=objects([900.0, 900.0, 100.0], [500.0, 500.0, 500.0], [8.0, 12.0, 1.0]))
    np.testing.assert_allclose(points_of(scene, section(), RADAR, GAMMA, X).azimuth_deg, [90.0, 270.0])


@pytest.mark.parametrize("screen_m", [0.0, 7.0])
def test_a_box_has_the_cross_section_of_roof_walls_and_double_bounce(build_scene, screen_m):
    """300 m to the east of the mast, turned by 20 degrees; a screen hides the foot, or nothing does."""
    scene = build_scene(
        lambda east, north: screen_m * ((east > 240.0) & (east < 250.0)), cells=(40, 200), names=("dyke", "tiles")
    )
    laws, parameters = GAMMA | {"tiles": GAMMA["dyke"]}, X | {"tiles": [-5.0]}
    one = objects([800.0], [100.0], [5.0])
    box = replace(
        one, length_m=np.array([12.0]), width_m=np.array([8.0]), heading_deg=np.array([20.0]), aspect=one.aspect - 1,
        walls=Walls(one.aspect, np.array([-8.0]), np.array([True]), ("tiles",)),
    )  # fmt: skip
    plain = replace(box, rcs_dbsm=np.zeros(1), walls=None)
    walled, unit = (
        points_of(replace(scene, objects=each), section(), RADAR, laws, parameters).snr for each in (box, plain)
    )
    tangent = 300.0 / 30.0
    theta, phi = np.arctan(tangent), np.radians([20.0, 70.0])
    alpha = np.arctan(tangent * np.sin(phi))
    bounce = 4.0 * 10.0**-1.2 * np.cos(alpha) * 5.0 * tangent * np.cos(phi) * [12.0, 8.0]
    expected = 10.0**-0.5 * np.cos(theta) * 96.0 + 10.0**-0.8 * 5.0 * 20.0
    if not screen_m:
        expected += bounce.sum()
    assert walled / unit == pytest.approx(expected, rel=0.01)


def test_site_and_carrier(build_scene):
    scene = build_scene(level, cells=(20, 60))
    assert site_of(scene, section()) == (150.0, 50.0)
    assert site_of(scene, section(site_m=[12.0, 34.0])) == (12.0, 34.0)
    turned = replace(scene, crs="EPSG:32616", transform=(3.0, 4.0, 7000.0, -4.0, 3.0, 9000.0))
    np.testing.assert_allclose(site_of(turned, section(site_m=[7000.0 + 70.0, 9000.0 - 10.0])), (50.0, 50.0))
    assert carrier_hz(RADAR) == 10e9
    assert carrier_hz(RADAR.model_copy(update={"frequency_ghz": 9.4})) == 9.4e9
