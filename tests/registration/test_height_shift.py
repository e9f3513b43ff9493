"""Displacement that follows the height of the ground, and displacement that does not."""

from dataclasses import replace

import numpy as np
import pytest
import registration_samples
from registration_samples import PLAIN, registered_by
from scipy.ndimage import map_coordinates

from radcal.config import Radar
from radcal.measurement.synthetic import smooth_warp
from radcal.radar.projection import make_geometry
from radcal.registration.height_shift import HeightShift, height_shift, with_height_finding

RADAR = Radar(
    altitude_m=4000.0, depression_deg=50.0, range_resolution_m=4.0, azimuth_resolution_m=6.0, range_spacing_m=3.0,
    azimuth_spacing_m=5.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def hills(build_scene):
    """Hills with slopes of 10 degrees (sd) on ground that rises by 10 % to the east."""
    rough = registration_samples.hills((300, 260), 10.0)
    return build_scene(lambda east, _: rough + 0.1 * east, cells=(300, 260))


@pytest.fixture(scope="module")
def geometry(hills):
    return make_geometry(hills, RADAR)


def by_height(scene, geometry, m_per_m, seed=3):
    """Warp of 2 pixels (rms), and a displacement along slant range with the height of the ground."""
    field = smooth_warp(geometry.shape, 2.0, np.random.default_rng(seed))
    height = map_coordinates(scene.elevation_m, np.nan_to_num(geometry.ground), order=1, mode="nearest")
    field[0] += m_per_m * height / RADAR.range_spacing_m
    return registered_by(field)


@pytest.mark.parametrize("m_per_m", [-0.38, 0.27])
def test_change_with_height_is_found(hills, geometry, m_per_m):
    found = height_shift(by_height(hills, geometry, m_per_m), geometry, hills, RADAR)
    assert found.doubtful
    assert found.m_per_m == pytest.approx(m_per_m, abs=3.0 * found.error)
    assert 0.005 < found.error < 0.05
    assert found.ellipsoid == pytest.approx(-np.sin(np.radians(50.0)), abs=0.02)


@pytest.mark.slow
def test_a_warp_that_has_nothing_to_do_with_heights_is_not_told(hills, geometry):
    """The standard error is that of a smooth displacement: of twenty, few are further from 0 than two errors."""
    found = [height_shift(by_height(hills, geometry, 0.0, seed), geometry, hills, RADAR) for seed in range(20)]
    assert [one is not None and one.doubtful for one in found] == [False] * 20
    ratios = np.array([one.m_per_m / one.error for one in found if one is not None])
    assert 0.6 < np.sqrt(np.mean(ratios**2)) < 1.4


@pytest.mark.parametrize(
    ("m_per_m", "error", "doubtful"),
    [(-0.21, 0.04, True), (-0.21, 0.06, False), (-0.15, 0.01, False), (0.17, 0.02, True)],
)
def test_only_what_is_certain_and_large_is_told(m_per_m, error, doubtful):
    """A fifth of 0.8 m is 0.16 m."""
    assert HeightShift(m_per_m, error, -0.8).doubtful == doubtful


def test_where_heights_say_nothing(hills, geometry, build_scene):
    told = by_height(hills, geometry, -0.5)
    assert height_shift(replace(told, applied=False), geometry, hills, RADAR) is None
    assert height_shift(told, geometry, replace(hills, elevation_m=None), RADAR) is None
    # half a pixel of 3 m is a relief (sd) of 2 m; a plane has none
    for surface in (lambda east, _: 0.1 * east, lambda east, north: np.sin(east / 60.0) * np.cos(north / 80.0)):
        low = build_scene(surface, cells=(300, 260))
        assert height_shift(by_height(low, geometry, -0.5), geometry, low, RADAR) is None
    small = build_scene(lambda east, north: 40.0 * np.sin(east / 30.0) * np.cos(north / 20.0), cells=(40, 60))
    seen = make_geometry(small, RADAR)
    assert height_shift(by_height(small, seen, -0.5), seen, small, RADAR) is None


def test_the_warning_gives_the_direction_and_what_the_ellipsoid_would_do(hills, geometry):
    for m_per_m in (-0.38, 0.3):
        told = by_height(hills, geometry, m_per_m)
        plain, found = with_height_finding(told, geometry, hills, RADAR).measurement.findings
        assert plain is PLAIN
        assert (found.code, found.severity, found.about) == ("height_shift", "warning", "a.tif")
        assert found.numbers["m_per_m"] == pytest.approx(m_per_m, abs=0.08)
        assert found.numbers["ellipsoid_m_per_m"] == pytest.approx(-0.76, abs=0.005)
    right = by_height(hills, geometry, 0.0)
    assert with_height_finding(right, geometry, hills, RADAR).measurement.findings == (PLAIN,)
