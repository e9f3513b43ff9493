import math

import numpy as np
import pytest

from radcal.config import Radar
from radcal.laws import law_for
from radcal.radar.projection import make_geometry
from radcal.simulators.builtin import BuiltinSimulator

LAWS = dict.fromkeys(("dyke", "grass"), law_for("mangia"))
X = {"dyke": [6.1, 14.2, 21.5, 3.3], "grass": [10.0, 14.0, 6.0, 4.0]}


def test_looks_that_are_not_whole_keep_common_random_numbers(geometry, radar):
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


@pytest.mark.parametrize("looks", [1, 3, 2.6])
def test_the_mean_power_of_the_complex_looks_is_the_intensity(geometry, radar, looks):
    simulator = BuiltinSimulator(geometry, radar.model_copy(update={"looks": looks}), LAWS)
    found = np.array(list(simulator.looks(X, 5)))
    assert (found.dtype, found.shape) == (np.complex64, (math.ceil(looks), *geometry.shape))
    power = np.mean(np.abs(found.astype(np.complex128)) ** 2, axis=0)
    np.testing.assert_allclose(power, 10.0 ** (simulator.run(X, 5).astype(np.float64) / 10.0), rtol=3e-6, atol=1e-12)
    phases = found[:, ::5, ::5] / np.abs(found[:, ::5, ::5])  # of resolution cells of their own
    assert np.abs(phases.mean()) < 4.0 / np.sqrt(phases.size)


def test_the_expected_image_is_the_mean_of_many_looks(scene):
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
