from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import windows

from radcal.radar.speckle import circular_gaussian, impulse_response, log_speckle_sd_db, taylor_weights, width_factor

SHAPE = (300, 200)
N = SHAPE[0] * SHAPE[1]


def test_circular_gaussian_has_unit_mean_power_and_circular_statistics() -> None:
    u = circular_gaussian(1, 0, 0, SHAPE)
    assert u.shape == SHAPE
    assert u.dtype == np.complex64
    power = np.abs(u.astype(complex)) ** 2
    # exponential power: its sd is its mean
    assert power.mean() == pytest.approx(1.0, abs=3 / np.sqrt(N))
    assert power.std() == pytest.approx(1.0, abs=3 * np.sqrt(8 / N))
    for part in (u.real, u.imag):
        assert part.mean(dtype=float) == pytest.approx(0.0, abs=3 * np.sqrt(0.5 / N))
        assert part.var(dtype=float) == pytest.approx(0.5, abs=3 * 0.5 * np.sqrt(2 / N))
    assert abs(np.mean(u.astype(complex) ** 2)) < 3 * np.sqrt(2 / N)  # circular


def test_circular_gaussian_is_white() -> None:
    u = circular_gaussian(1, 0, 0, SHAPE).astype(complex)
    for a, b in [(u[1:], u[:-1]), (u[:, 1:], u[:, :-1])]:
        assert abs(np.mean(a * b.conj())) < 4 / np.sqrt(N)


def test_circular_gaussian_streams_are_reproducible_and_independent() -> None:
    streams = [(1, 0, 0), (1, 1, 0), (1, 0, 1), (2, 0, 0), (2**63 - 1, 0, 0), (1, 63, 1)]
    drawn = [circular_gaussian(*stream, SHAPE).astype(complex) for stream in streams]
    for k, (stream, u) in enumerate(zip(streams, drawn, strict=True)):
        np.testing.assert_array_equal(circular_gaussian(*stream, SHAPE), u.astype(np.complex64))
        for v in drawn[k + 1 :]:
            assert abs(np.mean(u * v.conj())) < 4 / np.sqrt(N)


@pytest.mark.parametrize("n", [8, 1024])
def test_taylor_weights_are_those_of_scipy(n: int) -> None:
    expected = windows.taylor(n, nbar=4, sll=35, norm=False)
    np.testing.assert_allclose(taylor_weights((np.arange(n) + 0.5) / n - 0.5), expected, rtol=1e-12)


def test_width_factor_is_that_of_taylor_weighting() -> None:
    # 0.886 for the unweighted band; Taylor of 35 dB widens it by about a third
    assert width_factor() == pytest.approx(1.18, abs=0.02)


@pytest.mark.parametrize(("resolution", "spacing"), [(2.0, 1.5), (3.5, 2.5), (1.2, 1.0), (5.0, 1.0)])
def test_impulse_response_has_unit_energy_and_is_symmetric(resolution: float, spacing: float) -> None:
    taps = impulse_response(resolution, spacing)
    assert taps.size % 2 == 1
    assert (taps**2).sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-12)
    assert taps.argmax() == taps.size // 2


@pytest.mark.parametrize("resolution", [1.0, 3.5])
def test_impulse_response_width_is_the_resolution(resolution: float) -> None:
    spacing = resolution / 100
    power = impulse_response(resolution, spacing) ** 2
    middle = power.size // 2
    width = 2 * np.interp(-0.5, -power[middle : middle + 200] / power[middle], np.arange(200) * spacing)
    assert width == pytest.approx(resolution, rel=0.02)


def test_impulse_response_sidelobes_are_below_35_db() -> None:
    power = impulse_response(1.0, 0.02) ** 2
    level_db = 10 * np.log10(power[power.size // 2 :] / power.max())
    first_null = np.flatnonzero(np.diff(level_db) > 0)[0]
    assert -37.0 < level_db[first_null:].max() < -34.0


def test_log_speckle_sd_of_four_looks() -> None:
    assert log_speckle_sd_db(4) == pytest.approx(2.31, abs=0.005)
    assert log_speckle_sd_db(1) == pytest.approx(10 / np.log(10) * np.pi / np.sqrt(6), rel=1e-12)


@pytest.mark.parametrize("looks", [1, 2.5, 4, 16])
def test_log_speckle_sd_is_that_of_gamma_numbers(looks: float) -> None:
    n = 200_000
    db = 10 * np.log10(np.random.default_rng(8).gamma(looks, 1 / looks, n))
    # 4 sigma of a sample sd at a kurtosis of at most 5.4 (log of an exponential)
    assert db.std() == pytest.approx(log_speckle_sd_db(looks), rel=4 * np.sqrt(4.4 / 4 / n))
