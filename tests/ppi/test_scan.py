"""The turn of the antenna and its detector, against closed forms."""

import numpy as np
import pytest
from variants import agrees

from radcal.config import case_from
from radcal.laws.grazing import weibull_power
from radcal.ppi.ground import Ground, Points
from radcal.ppi.scan import detected, one_turn, threshold

NONE = Points(np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros(0))


def section(**keys):
    return case_from({"ppi": keys}).ppi


def level(config, speckled=0.0, land=0.0, spread=1.0):
    shape = (config.turn, config.gates)
    return Ground(np.full(shape, speckled), np.full(shape, land), np.full(shape, land * spread))


def three_errors(found, p, count):
    assert found == pytest.approx(p, abs=3.0 * np.sqrt(p * (1.0 - p) / count))


def test_noise_alone_has_power_one_and_the_shape_of_its_pulses():
    config = section(pulses=7)
    sweep = one_turn(level(config), NONE, config, 3)
    assert sweep.snr.shape == (5000 // 7, 100) == (sweep.azimuth_deg.size, sweep.range_m.size)
    n = sweep.snr.size
    assert sweep.snr.mean() == pytest.approx(1.0, abs=3.0 / np.sqrt(7 * n))
    assert sweep.snr.var() == pytest.approx(1.0 / 7.0, rel=3.0 * np.sqrt((2.0 + 6.0 / 7.0) / n))
    assert sweep.azimuth_deg[0] == pytest.approx(3.0 * 0.072)
    assert sweep.range_m[1] == 22.5
    again = one_turn(level(config), NONE, config, 3)
    np.testing.assert_array_equal(again.snr, sweep.snr)
    assert (one_turn(level(config), NONE, config, 4).snr != sweep.snr).all()


def test_uniform_ground_has_the_power_of_the_two_way_beam_integral():
    """Richards (2014): the beam of -3 dB width w, both ways, is as wide as w sqrt(pi / (8 ln 2)) of a level one."""
    config = section(pulses=1, range_m=3000)
    width = 1.2 / (360.0 / config.turn)
    mean = one_turn(level(config, speckled=50.0), NONE, config, 1).snr.mean() - 1.0
    agrees(
        10.0 * np.log10(mean),
        10.0 * np.log10(50.0 * width * np.sqrt(np.pi / (8.0 * np.log(2.0)))),
        atol=0.1,
        beam_width=10.0 * np.log10(50.0 * width),
        one_way=10.0 * np.log10(50.0 * width * np.sqrt(np.pi / (4.0 * np.log(2.0)))),
    )


def test_an_object_has_the_pattern_of_the_antenna():
    config = section(pulses=1, azimuth_beam_deg=3.0)
    half = 1.5 * config.turn / 360.0
    at = Points(np.array([90.0]), np.array([40]), np.array([1e8]))
    sweep = one_turn(level(config), at, config, 1)
    peak = round(90.0 * config.turn / 360.0)
    found = 10.0 * np.log10(sweep.snr[[peak, peak + round(half), peak - round(half)], 40])
    agrees(found, [80.0, 74.0, 74.0], atol=0.15, one_way=[80.0, 77.0, 77.0])
    np.testing.assert_array_equal(np.delete(sweep.snr, 40, axis=1), np.delete(sweep.without_objects, 40, axis=1))
    assert sweep.without_objects[:, 40].mean() == pytest.approx(1.0, abs=3.0 / np.sqrt(config.turn))


def test_land_clutter_is_weibull():
    """Power of a resolution cell: mean 1, median (ln 2)^a / Gamma(1 + a)."""
    config = section(pulses=1, range_m=12_000, azimuth_beam_deg=1.2)
    width = 1.2 / (360.0 / config.turn) * np.sqrt(np.pi / (8.0 * np.log(2.0)))
    sweep = one_turn(level(config, land=1e6 / width, spread=2.6), NONE, config, 5)
    one_a_cell = sweep.snr[8 :: config.turn // 300][:300].ravel() / 1e6
    quartiles = weibull_power(-np.log([0.75, 0.5, 0.25]), 2.6)
    # standard error of a quantile: sqrt(p (1 - p) / n) over the density
    np.testing.assert_allclose(np.quantile(one_a_cell, [0.25, 0.5, 0.75]), quartiles, rtol=0.06)
    assert not np.allclose(np.quantile(one_a_cell, 0.5), np.log(2.0), rtol=0.5)  # of speckle


@pytest.mark.parametrize(("cells", "pfa"), [(24, 1e-3), (12, 1e-6)])
def test_threshold_of_one_pulse(cells, pfa):
    closed = cells * (pfa ** (-1.0 / cells) - 1.0)
    agrees(
        threshold(cells, pfa, 1),
        closed,
        rtol=1e-9,
        known_level=-np.log(pfa),
        cells_and_guard=(cells + 4) * (pfa ** (-1.0 / (cells + 4)) - 1.0),
        without_cells=closed / cells,
    )


def test_threshold_of_several_pulses_is_that_of_gamma_powers():
    """Monte Carlo: the mean of 10 pulses against the mean of 240."""
    rng, n = np.random.default_rng(1), 2_000_000
    cell, training = rng.gamma(10, 0.1, n), rng.gamma(240, 1.0 / 240.0, n)
    three_errors((cell > threshold(24, 1e-3, 10) * training).mean(), 1e-3, n)


def test_false_alarms_and_detections_on_uniform_clutter():
    """Swerling 1 target of one pulse: Pfa (1 + alpha / M)^-M, Pd (1 + alpha / (M (1 + snr)))^-M, with M cells."""
    config = section(pulses=1, range_m=3000)
    rng = np.random.default_rng(2)
    power = rng.exponential(size=(40_000, 200))
    found = detected(power, config)
    three_errors(found[:, 14:-14].mean(), 1e-3, found[:, 14:-14].size)
    three_errors(found[:, :14].mean(), 1e-3, found[:, :14].size)  # with fewer training gates
    power[:, ::40] *= 1.0 + 20.0
    alpha = 24 * (1e-3 ** (-1 / 24) - 1.0)
    three_errors(detected(power, config)[:, 40:-14:40].mean(), (1.0 + alpha / (24 * 21.0)) ** -24, 4 * 40_000)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"range_m": 80_000}, "ppi: range_m is 80000, expected at most 74948"),
        ({"prf_hz": 300}, "ppi: prf_hz is 300, expected at least 480"),
        ({"pulses": 900, "prf_hz": 500, "rotation_rpm": 60}, "prf_hz is 500, expected at least 1200"),
        ({"range_m": 300}, "ppi: range_m is 300, expected at least 435"),
        ({"land": {"grass": [[1, -25, 2], [2, -25, 2]]}}, "grass has the depressions [1.0, 2.0], expected falling"),
        ({"land": {"grass": "urban"}}, "ppi.land.grass"),
        ({"gian_db": 30}, "unknown key ppi.gian_db (did you mean 'gain_db'?)"),
    ],
)
def test_wrong_configurations(keys, says):
    from radcal.errors import ConfigError

    with pytest.raises(ConfigError) as caught:
        section(**keys)
    assert says in str(caught.value)
