"""Geometry against analytic normals, rays and brute force."""

import numpy as np
import pytest
from geometry_samples import METRE

from radcal.config import Radar
from radcal.errors import SceneError
from radcal.radar.facets import order_facets
from radcal.radar.geometry import read_geometry, write_geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.storage.dataclass_groups import same

ALTITUDE = 1000.0
SIDE = 200.0  # of the tiny scenes [m]


def weights(geometry):
    """Sum of the facets' weights in every pixel."""
    total = np.concatenate([[0.0], np.cumsum(geometry.facet_weight, dtype=float)])
    first = geometry.facet_start[geometry.cell_start]
    return np.diff(total[first]).reshape(geometry.shape)


@pytest.mark.parametrize("look_side", ["right", "left"])
def test_flat_ground_fills_every_pixel_and_its_facets_agree(build_scene, radar, look_side):
    scene = build_scene(lambda east, north: 0 * east, cells=(30, 40))
    geometry = make_geometry(scene, radar.model_copy(update={"look_side": look_side}))
    assert geometry.visible.all()
    assert (geometry.material == 1).all()
    assert geometry.shape[1] == int(30 * 5.0 / radar.azimuth_spacing_m)
    near, far = (np.hypot(ALTITUDE, ALTITUDE + x) for x in (-SIDE / 2, SIDE / 2))
    assert geometry.shape[0] == int((far - near) / radar.range_spacing_m)
    np.testing.assert_allclose(weights(geometry), 1.0, rtol=1e-5)
    # one angle per slant range: cos(incidence) = altitude / slant range
    slant = near + (np.arange(geometry.shape[0]) + 0.5) * radar.range_spacing_m
    expected = np.degrees(np.arccos(ALTITUDE / slant))[:, None] * np.ones(geometry.shape[1])
    np.testing.assert_allclose(geometry.incidence_deg, expected, atol=0.02)
    # the places of the pixels; facets are a third of a cell, and a pixel is half a cell
    away = (np.sqrt(slant**2 - ALTITUDE**2) - ALTITUDE) / 5.0  # cells from the scene's middle
    column = 20.0 + (away if look_side == "right" else -away) - 0.5
    row = (np.arange(geometry.shape[1]) + 0.5) * radar.azimuth_spacing_m / 5.0 - 0.5
    np.testing.assert_allclose(geometry.ground[1], np.tile(column[:, None], geometry.shape[1]), atol=0.15)
    np.testing.assert_allclose(geometry.ground[0], np.tile(row, (geometry.shape[0], 1)), atol=0.15)


@pytest.mark.parametrize("radiometry", ["beta0", "sigma0_ref", "gamma0", "gamma0_rtc"])
@pytest.mark.parametrize(("across", "along"), [(0.0, 0.0), (0.25, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.2, -0.2)])
def test_area_of_a_tilted_plane_is_ulanders(build_scene, radiometry, across, along):
    """Weights against delta_r delta_a / cos(psi), psi between the plane's normal and that of the slant plane."""
    altitude = 20_000.0
    # a column is no whole number of facets wide: those at its edges belong to it in part
    radar = Radar(
        altitude_m=altitude, depression_deg=35.0, range_spacing_m=1.0, azimuth_spacing_m=3.1, radiometry=radiometry
    )  # fmt: skip
    geometry = make_geometry(build_scene(lambda east, north: across * east + along * north), radar)
    rows = geometry.shape[0]
    inside = np.s_[rows // 4 : -rows // 4, 10:-10]
    found = weights(geometry)[inside]
    # the radar's direction at the scene's middle, to a thousandth
    look = np.radians(55.0)
    normal = np.array([-across, -along, 1.0]) / np.sqrt(1 + across**2 + along**2)
    slant_normal = np.array([np.cos(look), 0.0, np.sin(look)])
    if radiometry == "gamma0_rtc":  # the area is the plane's own times the cosine, whatever its slope (Small 2011)
        expected = 1.0 / (normal @ np.array([-np.sin(look), 0.0, np.cos(look)]))
    else:
        factor = {"beta0": 1.0, "sigma0_ref": np.sin(look), "gamma0": np.tan(look)}[radiometry]
        expected = factor / (normal @ slant_normal)
    # evenly, not on the average only: facets leave no texture
    np.testing.assert_allclose(10 * np.log10(found / expected), 0.0, atol=0.05)


# pixels as large as the cells of these scenes: facets are the cells, and ground is straight between their middles
STEEP = Radar(altitude_m=3000.0, radiometry="sigma0_local", **METRE)


def slant_m(radar, z, east, up):
    """Slant range of a place of a scene of 1 m cells with the profile z [m]."""
    ground = radar.altitude_m / np.tan(np.radians(radar.depression_deg)) + east
    return float(np.hypot(ground, radar.altitude_m + z.mean() - up))


@pytest.mark.parametrize("depression", [20.0, 45.0, 70.0])
def test_every_pixel_of_broken_ground_is_that_of_many_rays(build_scene, depression):
    """sigma0_local against 500 rays a cell: gently up and steeply down, hidden ground is missing from the pixels."""
    radar = STEEP.model_copy(update={"depression_deg": depression})
    rng = np.random.default_rng(4)
    z = np.cumsum(np.where(rng.random(240) < 0.06, -rng.uniform(0.5, 5.0, 240), rng.uniform(0.05, 0.3, 240)))
    scene = build_scene(lambda east, north: z + 0 * east, cells=(16, 240), cell_m=1.0)
    geometry = make_geometry(scene, radar)
    found = weights(geometry)
    edges = radar.altitude_m / np.tan(np.radians(depression)) + np.arange(241) - 120.0
    at = edges[0] + np.arange(0, 240 * 500 + 1) / 500
    # straight on beyond the middles of the first and the last cell
    places = np.concatenate([edges[:1], edges[:-1] + 0.5, edges[-1:]])
    heights = np.concatenate([[1.5 * z[0] - 0.5 * z[1]], z, [1.5 * z[-1] - 0.5 * z[-2]]])
    down = radar.altitude_m + z.mean() - np.interp(at, places, heights)
    tangent, slant = at / down, np.hypot(at, down)
    seen = tangent[1:] > np.maximum.accumulate(tangent)[:-1]
    rows = 0.5 * (slant[1:] + slant[:-1]) - slant[0]
    expected = np.histogram(rows, np.arange(geometry.shape[0] + 1), weights=np.abs(np.diff(slant)) * seen)[0]
    np.testing.assert_allclose(found, expected[:, None] * np.ones(found.shape[1]), atol=0.02)
    assert np.count_nonzero((expected > 0.1) & (expected < 0.9)) >= 2  # edges of shadows within pixels
    hidden = np.histogram(rows, np.arange(geometry.shape[0] + 1), weights=np.abs(np.diff(slant)) * ~seen)[0]
    np.testing.assert_array_equal(geometry.shadow[:, 3], hidden > 0)


@pytest.mark.parametrize("radiometry", ["sigma0_local", "beta0", "gamma0", "gamma0_rtc"])
def test_powers_add_in_layover(build_scene, radiometry):
    """A ramp that rises twice as fast as it goes away: three places in each row of its fold, and their echoes' sum."""
    slope, length = 2.0, 24.0

    def surface(east, north):
        return np.interp(east, [0.0, length, 120.0], [0.0, slope * length, 0.0])  # the back is in view

    radar = STEEP.model_copy(update={"radiometry": radiometry})
    scene = build_scene(surface, cells=(16, 320), cell_m=1.0)
    geometry = make_geometry(scene, radar)
    near = slant_m(radar, scene.elevation_m, -160.0, 0.0)
    top = slant_m(radar, scene.elevation_m, length, slope * length) - near
    foot = slant_m(radar, scene.elevation_m, 0.0, 0.0) - near
    folded = weights(geometry)[int(top) + 3 : int(foot) - 2, 5]
    assert folded.size > 5
    # area over slant range of level ground, of the ramp and of the back; 1 each where areas do not count
    look = np.arctan2(3000.0 + length / 2, 3000.0 + scene.elevation_m.mean() - slope * length / 2)
    per_m, illuminated = [], []
    for rise in (0.0, slope, -slope * length / (120.0 - length)):
        per_m.append(np.hypot(1.0, rise) / abs(np.sin(look) - rise * np.cos(look)))
        illuminated.append(per_m[-1] * (np.cos(look) + rise * np.sin(look)) / np.hypot(1.0, rise))
    beta0 = sum(per_m)
    expected = {
        "sigma0_local": 3.0, "beta0": beta0, "gamma0": beta0 * np.tan(look), "gamma0_rtc": beta0 / sum(illuminated)
    }[radiometry]  # fmt: skip
    # the ray turns by half a degree on the way
    np.testing.assert_allclose(folded, expected, rtol=1e-4 if radiometry == "sigma0_local" else 0.02)


@pytest.mark.parametrize("look_side", ["right", "left"])
def test_each_azimuth_line_has_the_shadow_of_its_own_wedge(build_scene, look_side):
    """Wedges of three heights beside one another, and level ground: no line is dark behind the wedge of another."""
    radar = STEEP.model_copy(update={"look_side": look_side})
    heights = np.repeat([7.3, 0.0, 11.9, 4.0], [3, 5, 4, 4])
    crest = 0.5

    def surface(east, north):
        away = east if look_side == "right" else -east
        return heights[:, None] * np.interp(away, [crest - 80.0, crest, crest + 1.0], [0.0, 1.0, 0.0])

    scene = build_scene(surface, cells=(16, 240), cell_m=1.0)
    z = scene.elevation_m
    geometry = make_geometry(scene, radar)
    track = radar.altitude_m + z.mean()
    end = (radar.altitude_m + crest) * track / (track - heights) - radar.altitude_m  # similar triangles
    near = slant_m(radar, z, -120.0, 0.0)
    first, last = (
        np.array([slant_m(radar, z, east, up) for east, up in zip(*place, strict=True)]) - near
        for place in ((np.full(16, crest), heights), (end, np.zeros(16)))
    )
    np.testing.assert_allclose(geometry.shape[0] - weights(geometry).sum(axis=0), last - first, atol=0.01)
    row = np.arange(geometry.shape[0])[:, None]
    np.testing.assert_array_equal(geometry.shadow, (row + 1 > first) & (row < last) & (heights > 0.0))


@pytest.mark.parametrize("height", [7.3, 9.1])
def test_area_of_a_facet_seen_in_part_is_that_of_its_visible_part(build_scene, height):
    """Level ground, on which the shadow of a wedge ends within a facet: beta0 is sigma0 over the sine, there too."""

    def surface(east, north):
        return np.interp(east, [-80.0, 0.5, 1.5], [0.0, height, 0.0])

    scene = build_scene(surface, cells=(16, 240), cell_m=1.0)
    local, beta = (
        make_geometry(scene, STEEP.model_copy(update={"radiometry": name})) for name in ("sigma0_local", "beta0")
    )
    share = weights(local)
    end = int(np.flatnonzero(local.shadow[:, 5])[-1])
    assert (share[end] < 0.9).all()
    rows = slice(end, end + 4)
    sine = np.sin(np.radians(beta.flat_incidence_deg[rows]))[:, None]
    np.testing.assert_allclose(weights(beta)[rows] * sine, share[rows], atol=0.01)


def test_incidence_of_a_facet_seen_in_part_is_that_of_its_visible_half(build_scene):
    """The crest of a wedge: central differences would mix the slope that is seen with the one that is not."""
    rise, fall = 0.2, -5.0

    def surface(east, north):
        return np.where(east <= 0.5, rise * (east - 0.5), np.maximum(fall * (east - 0.5), -10.0))

    scene = build_scene(surface, cells=(16, 100), cell_m=1.0)
    geometry = make_geometry(scene, STEEP)
    near = slant_m(STEEP, scene.elevation_m, -50.0, rise * -50.5)
    crest = int(slant_m(STEEP, scene.elevation_m, 0.5, 0.0) - near)
    normal = np.array([-rise, 1.0]) / np.hypot(rise, 1.0)
    look = np.arctan2(3000.5, 3000.0 + scene.elevation_m.mean())
    expected = np.degrees(np.arccos(normal @ [-np.sin(look), np.cos(look)]))
    np.testing.assert_allclose(geometry.incidence_deg[crest - 3 : crest + 1, 5], expected, atol=0.1)
    assert np.isnan(geometry.incidence_deg[crest + 1 : crest + 4, 5]).all()


def test_cells_are_in_order_and_add_up(geometry, scene):
    assert geometry.cell_start[0] == geometry.facet_start[0] == 0
    assert geometry.cell_start[-1] == geometry.cell_material.size
    assert geometry.facet_start[-1] == geometry.facet_weight.size == geometry.facet_incidence.size
    assert (np.diff(geometry.facet_start) > 0).all()
    pure = np.zeros(geometry.shape[0] * geometry.shape[1], dtype=int)
    for pixel in range(pure.size):
        found = geometry.cell_material[geometry.cell_start[pixel] : geometry.cell_start[pixel + 1]]
        assert (np.diff(found.astype(int)) > 0).all()
        pure[pixel] = found[0] if found.size == 1 else 0
    np.testing.assert_array_equal(geometry.material.ravel(), pure)
    assert (geometry.material == 0).any()  # some are mixed
    some = geometry.cell_start[geometry.pixels("grass")[7]]
    part = slice(geometry.facet_start[some], geometry.facet_start[some + 1])
    mean = np.average(geometry.facet_incidence[part] * (90 / 65535), weights=geometry.facet_weight[part])
    assert geometry.incidence_deg.ravel()[geometry.pixels("grass")[7]] == pytest.approx(mean, abs=1e-3)
    np.testing.assert_allclose(weights(geometry)[geometry.visible], 1.0, rtol=1e-5)


@pytest.mark.parametrize("margin", [0, 1, 2, 4])
@pytest.mark.parametrize("name", ["dyke", "grass"])
def test_margin_leaves_out_pixels_near_another_material(geometry, name, margin):
    own = geometry.material == geometry.names.index(name) + 1
    expected = []
    for row, column in np.argwhere(own):
        window = np.s_[max(0, row - margin) : row + margin + 1, max(0, column - margin) : column + margin + 1]
        inside = min(row, column, own.shape[0] - 1 - row, own.shape[1] - 1 - column) >= margin
        if inside and own[window].all():  # beyond the image's border nothing is known
            expected.append(row * own.shape[1] + column)
    assert len(expected) > 50
    np.testing.assert_array_equal(geometry.pixels(name, margin), expected)


def test_what_changes_no_run_makes_no_other_file(geometry, radar, tmp_path):
    path = tmp_path / "geometry.h5"
    write_geometry(path, geometry, radar)
    assert same(read_geometry(path), geometry)
    first, quiet = path.read_bytes(), radar.model_copy(update={"nesz_db": -60.0})
    write_geometry(path, geometry, radar)
    write_geometry(path, geometry, quiet, ["nesz_db"])
    assert path.read_bytes() == first
    write_geometry(path, geometry, quiet)
    assert path.read_bytes() != first


@pytest.mark.parametrize(
    ("peak_m", "keys", "says"),
    [
        (300.0, {"altitude_m": 150.0}, r"radar.altitude_m is 150 m .* 2\d\d m: fly higher \(is 150 in km.*150000\)"),
        (0.0, {"altitude_m": 500.0, "depression_deg": 80.0}, r"depression_deg 80 at .* 500 .* lower the depression"),
        (0.0, {"azimuth_spacing_m": 40.0, "azimuth_resolution_m": 50.0}, r"\d+ x 5 pixels: use a finer pixel spacing"),
    ],
)
def test_passes_that_give_no_image(build_scene, peak_m, keys, says):
    peak = build_scene(lambda east, north: peak_m * np.exp(-(east**2 + north**2) / 400.0))
    with pytest.raises(SceneError, match=says):
        make_geometry(peak, Radar(**{"altitude_m": ALTITUDE} | keys))


def test_slant_range_scene_has_one_facet_per_labelled_pixel():
    labels = np.array([[1, 1, 0], [2, 2, 1]], dtype=np.uint8)
    geometry = make_geometry(Scene("x", ("a", "b"), labels, None, 1.0, np.array([20.0, 50.0])), Radar())
    assert geometry.shape == (2, 3)
    np.testing.assert_array_equal(geometry.material, labels)
    np.testing.assert_array_equal(geometry.visible, labels > 0)
    np.testing.assert_allclose(geometry.incidence_deg, [[20, 20, np.nan], [50, 50, 50]], atol=1e-3)
    assert geometry.pixels("a").tolist() == [0, 1, 5]
    with pytest.raises(SceneError, match="no part of the scene is visible"):
        make_geometry(Scene("x", ("a", "b"), 0 * labels, None, 1.0, np.array([20.0, 50.0])), Radar())


def test_slivers_without_an_area_have_their_mean_incidence():
    """Two pixels of two facets each: by their areas, and of areas that vanish."""
    start, material = np.array([0, 2, 4], dtype=np.int32), np.array([1, 1, 1, 2], dtype=np.uint8)
    angle = np.array([10_000, 40_000, 10_000, 20_000], dtype=np.uint16)
    weight = np.array([3.0, 1.0, 0.0, 0.0], dtype=np.float32)
    place = np.array([[0.0, 4.0, 2.0, 3.0], [8.0, 4.0, 6.0, 1.0]], dtype=np.float32)
    one = np.ones(1, dtype=np.float32)
    cells, pure = np.empty(2, dtype=np.uint16), np.zeros(2, dtype=np.uint8)
    mean_deg, ground = np.full(2, np.nan, dtype=np.float32), np.full((2, 2), np.nan, dtype=np.float32)
    order_facets(1, start, 2, material, angle, weight, place, one, one, cells, pure, mean_deg, ground)
    np.testing.assert_allclose(mean_deg, np.array([17_500, 15_000]) * 90.0 / 65535.0, rtol=1e-5)
    np.testing.assert_allclose(ground, [[1.0, 2.5], [7.0, 3.5]])
    assert (cells.tolist(), pure.tolist()) == ([1, 2], [1, 0])
