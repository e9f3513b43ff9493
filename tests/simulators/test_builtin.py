from __future__ import annotations

import numpy as np
import pytest

from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.laws import external_law, law_for
from radcal.radar.geometry import Geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.protocol import Simulator

LAWS = {"dyke": "mangia", "grass": "mangia"}
X = {"dyke": [6.1, 14.2, 21.5, 3.3], "grass": [10.0, 14.0, 6.0, 4.0]}


@pytest.fixture
def simulator(geometry: Geometry, radar: Radar) -> Simulator:
    return BuiltinSimulator(geometry, radar, LAWS)


def test_image_is_on_the_geometrys_grid(simulator: Simulator, geometry: Geometry) -> None:
    image = simulator.run(X, 1)
    assert image.shape == geometry.shape
    assert image.dtype == np.float32
    assert np.isfinite(image).all()


def test_level_of_a_material_is_that_of_its_law(simulator: Simulator, geometry: Geometry) -> None:
    image = simulator.run(X, 1).ravel()
    for name, (x1, x2, x3, x4) in X.items():
        pixels = geometry.pixels(name, 2)
        phi = np.radians(geometry.incidence_deg.ravel()[pixels].astype(float))
        law = 10 ** ((x1 + x2 * np.cos(phi) + x3 * np.exp(-x4 * phi**2)) / 10)
        # pixels overlap: about one in three is independent
        ratio = 10 ** (image[pixels].astype(float) / 10) / law
        assert ratio.mean() == pytest.approx(1.0, abs=3 / np.sqrt(4 * pixels.size / 3))


def test_laws_by_name_know_the_pass(geometry: Geometry) -> None:
    soil = {"dyke": [8.0, 1.5, 1.0], "grass": X["grass"]}
    levels = []
    for frequency_ghz in (1.5, 9.5):
        pass_ = Radar(altitude_m=1000.0, band="-", frequency_ghz=frequency_ghz, polarisation="VV")
        image = BuiltinSimulator(geometry, pass_, {"dyke": "oh1992", "grass": "mangia"}).run(soil, 1)
        levels.append(image.ravel()[geometry.pixels("dyke", 2)].mean())
        bound = law_for("oh1992", frequency_ghz=frequency_ghz, polarisation="VV")
        again = BuiltinSimulator(geometry, pass_, {"dyke": bound, "grass": "mangia"}).run(soil, 1)
        np.testing.assert_array_equal(again, image)
    assert levels[1] > levels[0] + 3.0  # the same soil is rough at X band and smooth at L band


def test_looks_that_are_not_whole_keep_common_random_numbers(geometry: Geometry, radar: Radar) -> None:
    """A changed law changes the image as if it were made anew, and only by the law where one material is alone."""
    broken = radar.model_copy(update={"looks": 2.6, "nesz_db": -200.0})
    simulator = BuiltinSimulator(geometry, broken, LAWS)
    first = simulator.run(X, 1)
    brighter = {**X, "dyke": [8.1, *X["dyke"][1:]]}
    again = simulator.run(brighter, 1)
    np.testing.assert_array_equal(again, BuiltinSimulator(geometry, broken, LAWS).run(brighter, 1))
    dyke, grass = (geometry.pixels(name, 13) for name in ("dyke", "grass"))
    np.testing.assert_allclose((again - first).ravel()[dyke], 2.0, atol=1e-3)
    np.testing.assert_array_equal(again.ravel()[grass], first.ravel()[grass])
    whole = [BuiltinSimulator(geometry, radar.model_copy(update={"looks": n}), LAWS).run(X, 1) for n in (3, 3.0)]
    np.testing.assert_array_equal(*whole)
    assert np.abs(whole[0] - first).mean() > 0.2


def test_runs_are_deterministic_and_depend_on_the_seed(simulator: Simulator, geometry: Geometry, radar: Radar) -> None:
    first = simulator.run(X, 1)
    simulator.run({**X, "dyke": [1, 2, 3, 4]}, 2)
    np.testing.assert_array_equal(simulator.run(X, 1), first)
    np.testing.assert_array_equal(BuiltinSimulator(geometry, radar, LAWS).run(X, 1), first)
    assert np.abs(simulator.run(X, 2) - first).mean() > 1.0


def test_one_material_changes_its_own_pixels_only(simulator: Simulator, geometry: Geometry) -> None:
    before = simulator.run(X, 1).ravel()
    after = simulator.run({**X, "dyke": [9.1, 14.2, 21.5, 3.3]}, 1).ravel()
    change = after - before
    # common random numbers: X1 + 3 dB is + 3 dB on the dyke, and nothing far from it
    # (but for sidelobes below -35 dB in the darkest speckles)
    for name, expected in [("dyke", 3.0), ("grass", 0.0)]:
        off = np.abs(change[geometry.pixels(name, 12)] - expected)
        assert np.percentile(off, 99) < 0.05
        assert off.max() < 0.5


def test_pixels_follow_the_parameters_smoothly(simulator: Simulator, geometry: Geometry) -> None:
    pixels = geometry.pixels("dyke", 1)
    means = [simulator.run({**X, "dyke": [6.1, x, 21.5, 3.3]}, 1).ravel()[pixels].mean() for x in (14, 14.01, 14.02)]
    assert means[2] - means[1] == pytest.approx(means[1] - means[0], rel=0.02)
    assert means[1] > means[0]


def test_a_law_that_another_simulator_knows_is_refused(geometry: Geometry, radar: Radar) -> None:
    with pytest.raises(ConfigError, match=r"materials\.grass\.law is external, which only simulator\.kind: command"):
        BuiltinSimulator(geometry, radar, {"dyke": "mangia", "grass": external_law(["mv"])})


def test_identity_is_plain_data(simulator: Simulator) -> None:
    assert simulator.identity["kind"] == "builtin"
    assert isinstance(simulator.identity["version"], int)


def test_radar_that_cannot_be_sampled_is_refused(geometry: Geometry) -> None:
    with pytest.raises(ConfigError, match=r"radar\.range_resolution_m is 1, expected at least 1\.78"):
        BuiltinSimulator(geometry, Radar(range_resolution_m=1.0), LAWS)


def test_the_expected_image_is_the_mean_of_many_looks(scene: Scene) -> None:
    """Slopes, two materials 9 dB apart and noise between them; also where they meet and at the image's border."""
    radar = Radar(altitude_m=1000.0, nesz_db=-14.0, radiometry="sigma0_ref", looks=64.0)
    geometry = make_geometry(scene, radar)
    simulator = BuiltinSimulator(geometry, radar, LAWS)
    x = {"dyke": [-24.0, 10.0, 14.0, 5.0], "grass": [-15.0, 9.0, 4.0, 3.0]}
    power = np.mean([10.0 ** (simulator.run(x, seed).astype(np.float64) / 10.0) for seed in range(9)], axis=0)
    expected = 10.0 ** (simulator.expected(x).astype(np.float64) / 10.0)
    first, second = (np.flatnonzero((geometry.material == k).mean(axis=1) > 0.9) for k in (1, 2))
    near, far = sorted([first, second], key=lambda rows: rows[0])
    areas = {
        "near": (slice(near[0] + 3, near[-1] - 4), slice(None)),
        "far": (slice(far[0] + 5, far[-1] - 2), slice(None)),
        "between": (slice(near[-1] - 1, far[0] + 2), slice(None)),
        "first rows": (slice(0, 2), slice(None)),
        "last columns": (slice(None), slice(-2, None)),
    }
    for name, area in areas.items():
        assert 10.0 * np.log10(power[area].mean() / expected[area].mean()) == pytest.approx(0.0, abs=0.05), name
    # pixel by pixel, too: neighbours whose area and angle differ are not mixed up
    assert np.std(10.0 * np.log10(power / expected)) == pytest.approx(10.0 / np.log(10.0) / np.sqrt(9 * 64.0), rel=0.1)
