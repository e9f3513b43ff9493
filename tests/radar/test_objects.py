"""Objects in geometry and image against rays, closed forms and conserved energy."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_samples import METRE, objects_of
from scipy import signal

from radcal.bands import WIDTH_FACTOR
from radcal.config import Radar
from radcal.errors import SceneError
from radcal.laws import LAWS
from radcal.radar.geometry import PointScatterers
from radcal.radar.image import ImageFormation
from radcal.radar.points import phased
from radcal.radar.projection import make_geometry
from radcal.radar.reflectivity import law_tables, reflectivity, uniform
from radcal.simulators.builtin import BuiltinSimulator

ALTITUDE, DEPRESSION = 500.0, 30.0
QUIET = -200.0  # [dB] no noise at all
FINE = Radar(altitude_m=ALTITUDE, depression_deg=DEPRESSION, nesz_db=QUIET, radiometry="sigma0_local", **METRE)
CENTRE = ALTITUDE / np.tan(np.radians(DEPRESSION))
NX, NY = 160, 60  # cells of 1 m


def objects(**columns):
    """Objects from some columns, the others as in the smallest table."""
    return objects_of(**{"x_m": NX / 2, "y_m": NY / 2, "height_m": 0.0, "rcs_dbsm": 20.0} | columns)


@pytest.fixture(scope="module")
def flat(build_scene):
    return build_scene(lambda east, north: 0 * east, cells=(NY, NX), cell_m=1.0)


def with_objects(scene, **columns):
    return replace(scene, objects=objects(**columns))


def slant(x, z):
    """Slant range of a place x metres east of the scene's western border [m]."""
    return float(np.hypot(CENTRE - NX / 2 + x, ALTITUDE - z))


NEAR = slant(0.0, 0.0)


def of_objects(geometry):
    """What the pixels hold of objects [linear]."""
    tables = law_tables(geometry.names, {}, {})  # materials without a law are dark
    return reflectivity(geometry, tables).image.astype(float)


@pytest.mark.parametrize("radiometry", ["sigma0_local", "sigma0_ref", "beta0", "gamma0"])
@pytest.mark.parametrize("heading", [0.0, 30.0, 90.0])
def test_cross_section_of_a_box_arrives_whole(flat, radiometry, heading):
    radar = FINE.model_copy(update={"radiometry": radiometry})
    scene = with_objects(flat, length_m=12.0, width_m=8.0, height_m=6.0, heading_deg=heading, rcs_dbsm=23.0)
    found = of_objects(make_geometry(scene, radar))
    theta = np.arccos(ALTITUDE / (NEAR + 0.5 + np.arange(len(found))))[:, None]
    area = {"beta0": 1.0 + 0 * theta, "gamma0": 1 / np.tan(theta)}.get(radiometry, 1 / np.sin(theta))
    # single precision of slant ranges: a thousandth of a facet's
    assert np.sum(found * area) == pytest.approx(10**2.3, rel=2e-3)


def test_hidden_part_of_a_box_scatters_not(flat):
    near_wall = {"x_m": 40.0, "length_m": NY, "width_m": 2.0, "height_m": 20.0, "rcs_dbsm": -100.0}
    behind = {"x_m": 44.0, "length_m": 4.0, "width_m": 4.0, "rcs_dbsm": 20.0}
    columns = {name: np.array([near_wall[name], behind.get(name, 0.0)]) for name in near_wall}
    totals = []
    for height in (3.0, 18.7, 30.0):
        columns["height_m"] = np.array([20.0, height])
        geometry = make_geometry(with_objects(flat, **columns), FINE.model_copy(update={"radiometry": "beta0"}))
        totals.append(of_objects(geometry).sum())
    assert totals[0] == pytest.approx(0.0, abs=1e-6)
    # the ray over the wall's far edge (41 m) passes the box's front (42 m) a metre further out
    height = 20.0 - (ALTITUDE - 20.0) / (CENTRE - NX / 2 + 41.0)
    roof = slant(46.0, 30.0) - slant(42.0, 30.0)
    wall = slant(42.0, 0.0) - slant(42.0, 30.0)
    seen = slant(42.0, height) - slant(42.0, 30.0)
    assert wall > roof
    # facets: the first holds the wall, the others the roof, which overlaps it in slant range
    facets = sum(slant(43.0 + i, 30.0) - slant(42.0 + i, 30.0) for i in range(1, 4))
    assert totals[2] == pytest.approx(100.0 * (seen + facets) / (wall + facets), rel=5e-3)
    assert 0.0 < totals[1] < 100.0


def test_ground_beside_a_box_keeps_its_level_where_areas_do_not_count(flat):
    geometry = make_geometry(with_objects(flat, length_m=8.0, width_m=8.0, height_m=10.0, rcs_dbsm=-90.0), FINE)
    tables = law_tables(geometry.names, {"dyke": LAWS["mangia"]}, {"dyke": [0.0, 0.0, 0.0, 0.0]})
    ground = reflectivity(geometry, tables).image
    clear = (geometry.material == 1) & ~geometry.shadow
    assert clear.any()
    np.testing.assert_allclose(ground[clear], 1.0, rtol=1e-5)
    assert (ground <= 1.0 + 1e-5).all()
    # the pixel in which the shadow ends has the rest of a whole one
    end = slant((CENTRE + 4.0) * ALTITUDE / (ALTITUDE - 10.0) - CENTRE + NX / 2, 0.0) - NEAR
    assert ground[int(end), NY // 2] == pytest.approx(1.0 - end % 1.0, abs=1e-3)
    assert geometry.shadow[int(end), NY // 2]
    # laid over, the ground before the box counts in full; at the shadow's end as far as it is seen
    assert ground[geometry.layover & geometry.visible].max() == pytest.approx(1.0, rel=1e-5)


def test_point_behind_a_wall_is_dark_and_above_it_is_not(flat):
    columns = {
        "x_m": [40.0, 48.0, 48.0],
        "length_m": [40.0, 0, 0],
        "width_m": [2.0, 0, 0],
        "height_m": [10.0, 2.0, 9.0],
    }
    geometry = make_geometry(with_objects(flat, **columns), FINE)
    # the ray over the wall's far edge falls by 500 / 793 metres a metre: at 48 m to 5.6 m
    assert geometry.point_number.tolist() == [2]


def test_points_do_not_fluctuate_and_their_phases_are_even():
    n = 4000
    some = PointScatterers(np.zeros(n), np.zeros(n), np.full(n, 2.0, np.float32), np.arange(n, dtype=np.uint32))
    a, b = phased(some, 1).astype(float), phased(some, 2).astype(float)
    np.testing.assert_allclose(np.hypot(*a.T), 2.0, rtol=1e-6)
    first, second = a @ [1, 1j] / 2, b @ [1, 1j] / 2
    # the mean of 4,000 unit phasors is 1 / sqrt(4000) in rms
    for z in (first, first**2, first * np.conj(second), first[1:] * np.conj(first[:-1])):
        assert abs(z.mean()) < 4 / np.sqrt(n)
    np.testing.assert_array_equal(phased(some, 1), phased(some, 1))


def test_point_over_clutter_adds_in_amplitude(flat):
    geometry = make_geometry(with_objects(flat, x_m=[40.0, 90.5], height_m=[0.0, 3.0], rcs_dbsm=[15.0, 25.0]), FINE)
    clutter = uniform(np.ones(geometry.shape, dtype=np.float32))
    with_points = ImageFormation(FINE, geometry.shape, QUIET, geometry.points)
    alone = with_points.look(uniform(np.zeros(geometry.shape, dtype=np.float32)), 4, 1)
    expected = ImageFormation(FINE, geometry.shape, QUIET).look(clutter, 4, 1) + alone
    np.testing.assert_allclose(with_points.look(clutter, 4, 1), expected, atol=1e-5)
    other = with_points.look(uniform(np.zeros(geometry.shape, dtype=np.float32)), 4, 0)
    assert np.abs(alone).max() > 1.0
    np.testing.assert_allclose(alone, other, atol=1e-8)  # no more than the noise at -200 dB


@pytest.mark.slow
def test_points_do_not_depend_on_tiles():
    """Each point against the transform of its band, over the borders of tiles and of the image."""
    shape, n = (300, 290), 120
    rng = np.random.default_rng(2)
    order = np.sort(rng.uniform(-5, 305, n))
    points = PointScatterers(
        order, rng.uniform(-5, 295, n), rng.random(n).astype(np.float32), np.arange(n, dtype=np.uint32)
    )
    found = ImageFormation(FINE, shape, QUIET, points).look(uniform(np.zeros(shape, dtype=np.float32)), 8)
    weights = signal.windows.taylor(1000, nbar=4, sll=35, norm=False)
    frequency = ((np.arange(1000) + 0.5) / 1000 - 0.5) * WIDTH_FACTOR / 2.0

    def at(length, place):
        offset = np.arange(-20.0, length + 20) - place
        taps = np.cos(2 * np.pi * np.multiply.outer(offset, frequency)) @ weights * (np.abs(offset) < 16)
        return (taps / np.linalg.norm(taps))[20:-20]  # cut at eight resolutions

    expected = np.zeros(shape, dtype=complex)
    for row, column, value in zip(points.row, points.column, phased(points, 8) @ [1, 1j], strict=True):
        expected += value * np.outer(at(shape[0], row), at(shape[1], column))
    assert np.abs(found - expected).max() < 3e-3 * np.abs(expected).max()


def test_a_run_with_one_new_law_is_a_run_from_nothing(scene, radar, monkeypatch):
    """Objects have an id after those of the materials, which the mask of changed laws contains, too."""
    made = []
    touched = ImageFormation.touched

    def seen(self, cells, changed):
        made.append((changed.size - int(cells.material.max()), len(touched(self, cells, changed))))
        return touched(self, cells, changed)

    monkeypatch.setattr(ImageFormation, "touched", seen)
    some = objects(x_m=[50.0, 120.0, 111.0], y_m=[60.0, 100.0, 30.0], length_m=[0, 20.0, 0], width_m=[0, 15.0, 0],
                   height_m=[3.0, 8.0, 0.0], rcs_dbsm=30.0)  # fmt: skip
    geometry, laws = make_geometry(replace(scene, objects=some), radar), dict.fromkeys(scene.names, LAWS["mangia"])
    sims = [BuiltinSimulator(geometry, radar, laws) for _ in range(2)]
    x = [{"dyke": [6.1, 14.2, 21.5, 3.3], "grass": [level, 14.0, 6.0, 4.0]} for level in (10.0, 1.0)]
    for parameters in (x[0], x[0], x[1]):
        after = sims[0].run(parameters, 5)
    assert made[0] == (1, 0)
    assert made[1][1] > 0
    np.testing.assert_array_equal(after, sims[1].run(x[1], 5))


def test_objects_without_an_echo_leave_the_ground_as_it_is(scene, radar):
    """A point far below the clutter: the way of scenes with objects is that of scenes without."""
    geometry = make_geometry(replace(scene, objects=objects(x_m=100.0, y_m=100.0, rcs_dbsm=-100.0)), radar)
    bare = make_geometry(scene, radar)
    for name in ("cell_start", "cell_material", "facet_start", "facet_incidence", "facet_weight", "layover", "shadow"):
        np.testing.assert_array_equal(getattr(geometry, name), getattr(bare, name))


def test_box_smaller_than_a_facet_is_a_point(flat):
    geometry = make_geometry(with_objects(flat, x_m=80.0, y_m=30.0, length_m=0.4, width_m=0.3, height_m=2.0), FINE)
    assert geometry.point_number.tolist() == [0]
    assert not of_objects(geometry).any()


def test_track_below_an_object(flat):
    with pytest.raises(SceneError, match=r"radar.altitude_m is 500 m .* an object rises 600 m: fly higher"):
        make_geometry(with_objects(flat, length_m=5.0, width_m=5.0, height_m=600.0), FINE)
