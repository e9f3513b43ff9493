"""Geometry against analytic normals, rays and brute force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from radcal.config import Radar
from radcal.errors import SceneError
from radcal.radar.geometry import (
    Geometry,
    local_incidence_cosine,
    make_geometry,
    read_geometry,
    shadowed,
    write_geometry,
)
from radcal.scene.model import Scene

ALTITUDE = 1000.0
SIDE = 200.0  # of the tiny scenes [m]
Build = Callable[..., Scene]


def assert_equal(a: Geometry, b: Geometry) -> None:
    for field in fields(Geometry):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, np.ndarray):
            assert x.dtype == y.dtype
            np.testing.assert_array_equal(x, y)
        else:
            assert x == y


def plane_incidence_deg(radar: Radar, shape: tuple[int, int], across: float, along: float) -> np.ndarray:
    """Incidence of each pixel on z = across x + along y, x away from the track, from its analytic normal."""
    ground = ALTITUDE / np.tan(np.radians(radar.depression_deg))
    x = np.linspace(-SIDE / 2, SIDE / 2, 4001)
    y = (np.arange(shape[1]) + 0.5) * radar.azimuth_spacing_m - SIDE / 2
    towards = np.stack(
        np.broadcast_arrays(-(ground + x), 0.0, ALTITUDE - across * x - along * y[:, None]), axis=-1
    )  # columns, x, (ground range, azimuth, up)
    slant = np.linalg.norm(towards, axis=-1)
    normal = np.array([-across, -along, 1.0]) / np.sqrt(1 + across**2 + along**2)
    incidence = np.degrees(np.arccos(towards @ normal / slant))
    centres = slant[:, 0].max() + (np.arange(shape[0]) + 0.5) * radar.range_spacing_m
    return np.stack([np.interp(centres, s, i) for s, i in zip(slant, incidence, strict=True)], axis=1)


@pytest.mark.parametrize("depression", [30.0, 45.0, 60.0])
@pytest.mark.parametrize(
    ("across", "along"), [(0.0, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3), (0.2, 0.25)]
)
def test_incidence_on_planes(build_scene: Build, depression: float, across: float, along: float) -> None:
    radar = Radar(altitude_m=ALTITUDE, depression_deg=depression, range_spacing_m=1.0, azimuth_spacing_m=3.0)
    geometry = make_geometry(build_scene(lambda east, north: across * east + along * north), radar)
    expected = plane_incidence_deg(radar, geometry.shape, across, along)
    rows = geometry.shape[0]
    inside = np.s_[rows // 4 : -rows // 4, 10:-10]  # the spline bends at the scene's edge
    assert rows > 20
    np.testing.assert_allclose(geometry.incidence_deg[inside], expected[inside], atol=0.1)


def test_flat_ground_fills_every_pixel_and_its_facets_agree(build_scene: Build, radar: Radar) -> None:
    geometry = make_geometry(build_scene(lambda east, north: 0 * east), radar)
    assert geometry.facets.min() >= 1
    assert (geometry.material == 1).all()
    assert geometry.facets.sum() == geometry.facet_pixel.size
    assert geometry.shape[1] == int(SIDE / radar.azimuth_spacing_m)
    near, far = (np.hypot(ALTITUDE, ALTITUDE + x) for x in (-SIDE / 2, SIDE / 2))
    assert geometry.shape[0] == pytest.approx((far - near) / radar.range_spacing_m, abs=2)
    # one angle per slant range: cos(incidence) = altitude / slant range
    slant = near + (geometry.facet_pixel // geometry.shape[1] + 0.5) * radar.range_spacing_m
    np.testing.assert_allclose(np.cos(geometry.facet_incidence_rad), ALTITUDE / slant, atol=2e-3)


@pytest.mark.parametrize(("across", "along"), [(0.0, 0.0), (0.7, 0.0), (-0.4, 0.0), (0.0, 0.5), (0.4, -0.5)])
def test_local_incidence_cosine_is_normal_times_direction(across: float, along: float) -> None:
    y, x = np.mgrid[0:6, 0:7] * 2.0
    toward, up = -np.sin(np.radians(40.0)), np.cos(np.radians(40.0))
    found = local_incidence_cosine(across * x + along * y, 2.0, (np.array(toward), np.array(up)))
    normal = np.cross([1, 0, across], [0, 1, along])  # of two tangents: ground range and azimuth
    expected = normal @ [toward, 0, up] / np.linalg.norm(normal)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_slope_steeper_than_the_look_angle_faces_away() -> None:
    x = np.arange(5.0) * np.ones((3, 1))
    look = np.radians(40.0)
    for slope_deg, sign in [(49.0, 1), (51.0, -1)]:  # falls away from the radar
        cosine = local_incidence_cosine(
            -np.tan(np.radians(slope_deg)) * x, 1.0, (-np.sin(look) * np.ones(1), np.cos(look) * np.ones(1))
        )
        assert (np.sign(cosine) == sign).all()


def test_wall_casts_a_shadow_of_the_analytic_length() -> None:
    altitude, wall, top, step = 500.0, 10.0, 400.0, 0.05
    ground = np.arange(300.0, 500.0, step)
    height = np.where(np.abs(ground - top) < step / 2, wall, 0.0)
    hidden = shadowed(np.arctan2(ground, altitude - height)[None, :])[0]
    assert not hidden[ground <= top].any()
    # similar triangles: the ray over the top meets the ground at top H / (H - h)
    length = top * wall / (altitude - wall)
    assert np.count_nonzero(hidden) * step == pytest.approx(length, abs=2 * step)
    assert hidden[(ground > top + step / 2) & (ground < top + length - step)].all()


def test_shadow_is_per_azimuth_line() -> None:
    look = np.array([[0.1, 0.3, 0.2, 0.29, 0.31], [0.1, 0.2, 0.3, 0.4, 0.5]])
    assert shadowed(look).tolist() == [[False, False, True, True, False], [False] * 5]


@pytest.mark.parametrize("look_side", ["right", "left"])
def test_wall_leaves_empty_pixels_behind_it(build_scene: Build, look_side: str) -> None:
    altitude, depression, wall = 500.0, 30.0, 12.0
    radar = Radar(
        altitude_m=altitude, depression_deg=depression, look_side=look_side, range_spacing_m=1, azimuth_spacing_m=1,
        range_resolution_m=2, azimuth_resolution_m=2,
    )  # fmt: skip
    scene = build_scene(lambda east, north: wall * (np.abs(east) < 8.0), cells=(24, 160), cell_m=1.0)
    geometry = make_geometry(scene, radar)
    height = altitude + scene.elevation_m.mean()
    top = altitude / np.tan(np.radians(depression)) + 8.0
    end = top * height / (height - wall)
    length = np.hypot(end, height) - np.hypot(top, height - wall)  # along the ray, as in the image
    assert length > 20
    empty = geometry.facets == 0
    assert np.count_nonzero(empty, axis=0)[4:-4] == pytest.approx(length, abs=3)  # the spline rounds the wall
    assert (geometry.material[empty] == 0).all()
    assert np.isnan(geometry.incidence_deg[empty]).all()
    assert np.isfinite(geometry.incidence_deg[~empty]).all()
    assert geometry.shadow[empty].all()
    # in front, the wall's top is nearer than its foot by what it rises towards the radar
    foot = altitude / np.tan(np.radians(depression)) - 8.0
    depth = np.hypot(foot, height) - np.hypot(foot, height - wall)
    assert depth > 4
    assert np.count_nonzero(geometry.layover, axis=0)[4:-4] == pytest.approx(depth, abs=3)


def test_left_mirrors_right(scene: Scene, radar: Radar) -> None:
    mirrored = replace(scene, material=scene.material[:, ::-1], elevation_m=scene.elevation_m[:, ::-1])
    right = make_geometry(scene, radar)
    left = make_geometry(mirrored, radar.model_copy(update={"look_side": "left"}))
    ground = left.ground.copy()  # the scene's columns run east whichever way the radar looks
    ground[1] = scene.material.shape[1] - 1 - ground[1]
    np.testing.assert_allclose(ground, right.ground, atol=1e-4)
    assert_equal(replace(left, ground=right.ground), right)
    other = make_geometry(scene, radar.model_copy(update={"look_side": "left"}))
    assert not np.array_equal(other.material, right.material)
    # the dyke is in the west: near for a radar that looks east, far for one that looks west
    assert right.material[5, 40] == 1
    assert other.material[5, 40] == 2


def test_facets_are_sorted_by_material_and_add_up(geometry: Geometry, scene: Scene) -> None:
    assert (np.diff(geometry.facet_material) >= 0).all()
    rows, columns = geometry.shape
    assert 0 <= geometry.facet_pixel.min() <= geometry.facet_pixel.max() < rows * columns
    counted = np.zeros(rows * columns, dtype=int)
    seen = [set() for _ in counted]
    for pixel, material in zip(geometry.facet_pixel, geometry.facet_material, strict=True):
        counted[pixel] += 1
        seen[pixel].add(int(material))
    np.testing.assert_array_equal(geometry.facets.ravel(), counted)
    np.testing.assert_array_equal(geometry.material.ravel(), [s.pop() if len(s) == 1 else 0 for s in seen])
    assert (geometry.material == 0).any()  # some are mixed
    some = geometry.facet_pixel == geometry.pixels("grass")[7]
    assert geometry.incidence_deg.ravel()[geometry.pixels("grass")[7]] == pytest.approx(
        np.degrees(geometry.facet_incidence_rad[some]).mean(), abs=1e-4
    )
    assert geometry.facet_incidence_rad.min() >= 0
    assert geometry.facet_incidence_rad.max() < np.pi / 2


@pytest.mark.parametrize("margin", [0, 1, 2, 4])
@pytest.mark.parametrize("name", ["dyke", "grass"])
def test_margin_leaves_out_pixels_near_another_material(geometry: Geometry, name: str, margin: int) -> None:
    own = geometry.material == geometry.names.index(name) + 1
    expected = []
    for row, column in np.argwhere(own):
        window = np.s_[max(0, row - margin) : row + margin + 1, max(0, column - margin) : column + margin + 1]
        inside = min(row, column, own.shape[0] - 1 - row, own.shape[1] - 1 - column) >= margin
        if inside and own[window].all():  # beyond the image's border nothing is known
            expected.append(row * own.shape[1] + column)
    assert len(expected) > 50
    np.testing.assert_array_equal(geometry.pixels(name, margin), expected)


def test_hdf5_round_trip_is_exact(geometry: Geometry, tmp_path: Path) -> None:
    write_geometry(tmp_path / "geometry.h5", geometry)
    assert_equal(read_geometry(tmp_path / "geometry.h5"), geometry)


def test_track_below_the_terrain(build_scene: Build) -> None:
    peak = build_scene(lambda east, north: 300.0 * np.exp(-(east**2 + north**2) / 400.0))
    with pytest.raises(SceneError, match=r"radar.altitude_m is 150 m .* terrain rises 2\d\d m: fly higher"):
        make_geometry(peak, Radar(altitude_m=150.0))


def test_track_over_the_scene(build_scene: Build) -> None:
    flat = build_scene(lambda east, north: 0 * east)
    with pytest.raises(SceneError, match=r"radar.depression_deg 80 at radar.altitude_m 500 .* lower the depression"):
        make_geometry(flat, Radar(altitude_m=500.0, depression_deg=80.0))


def test_pixels_larger_than_the_scene(build_scene: Build) -> None:
    flat = build_scene(lambda east, north: 0 * east)
    with pytest.raises(SceneError, match=r"\d+ x 5 pixels: use a finer pixel spacing"):
        make_geometry(flat, Radar(altitude_m=ALTITUDE, azimuth_spacing_m=40.0, azimuth_resolution_m=50.0))


def test_scene_without_materials_is_invisible(build_scene: Build) -> None:
    labels = Scene("x", ("a",), np.zeros((9, 9), dtype=np.uint8), None, 1.0, np.linspace(30, 40, 9))
    with pytest.raises(SceneError, match="no part of the scene is visible"):
        make_geometry(labels, Radar())


def test_slant_range_scene_has_one_facet_per_labelled_pixel() -> None:
    labels = np.array([[1, 1, 0], [2, 2, 1]], dtype=np.uint8)
    geometry = make_geometry(Scene("x", ("a", "b"), labels, None, 1.0, np.array([20.0, 50.0])), Radar())
    assert geometry.shape == (2, 3)
    np.testing.assert_array_equal(geometry.material, labels)
    np.testing.assert_array_equal(geometry.facets, labels > 0)
    np.testing.assert_allclose(geometry.incidence_deg, [[20, 20, np.nan], [50, 50, 50]], atol=1e-5)
    assert geometry.pixels("a").tolist() == [0, 1, 5]
