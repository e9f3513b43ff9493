"""Phase history against a plain sum in double precision, noise and quantisation against their closed forms."""

import numba
import numpy as np
import pytest
from signals_samples import collection, ground

from radcal.signals.focus import backprojected
from radcal.signals.history import RawSignal, converted, echoes, quantised, turned
from radcal.signals.platform import LIGHT_MPS
from radcal.signals.scatterers import Scatterers


def plain_sum(one, found, pulses):
    """Sum over scatterers at each frequency, with the beam from its formula."""
    out = []
    for p in pulses:
        away = found.place_m - one.track_m[p]
        slant = np.linalg.norm(away, axis=1)
        place = away[:, 0] / slant * one.antenna_m / one.wavelength_m
        beam = np.where(np.abs(place) < 1.0, np.sin(np.pi * place) / (np.pi * place), 0.0) ** 2
        phase = -4.0 * np.pi / LIGHT_MPS * np.multiply.outer(one.frequency_hz, slant - one.distance_m[p])
        out.append(np.exp(1j * phase) @ (found.amplitude * beam * (one.range_m / slant) ** 2))
    return np.array(out)


@pytest.mark.parametrize("keys", [{}, {"bend_m": 3.0, "carrier_hz": 1.3e9, "azimuth_m": 0.75, "range_m": 1.5}])
def test_echoes_are_the_sum_over_scatterers_at_every_frequency(keys):
    one = collection(**keys)
    found = ground(one, 300, (-40.0, 140.0), 190.0, 1)
    pulses = [0, 17, len(one.track_m) // 2, len(one.track_m) - 1]
    expected = plain_sum(one, found, pulses)
    for p, line in zip(pulses, expected, strict=True):
        error = np.abs(echoes(one, found, p, p + 1)[0] - line)
        assert np.sqrt(np.mean(error**2) / np.mean(np.abs(line) ** 2)) < 1e-4


def test_cosine_and_sine_of_turns_are_those_of_single_precision():
    each = numba.njit(lambda turns: [turned(t) for t in turns])
    turns = np.concatenate([np.linspace(-3.0, 3.0, 4001), [1e6 + 0.3, -0.125, 0.625]])
    found = np.array(each(turns))
    exact = np.stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)], axis=1)
    np.testing.assert_allclose(found, exact, atol=2e-7)


def test_bits_do_not_depend_on_the_number_of_threads(monkeypatch):
    one = collection(noise_m2=0.5)
    found = ground(one, 500, (-40.0, 140.0), 190.0, 2)
    signals, images = [], []
    for threads in (1, 3):
        monkeypatch.setattr("radcal.compiled._config.NUMBA_NUM_THREADS", threads)
        signals.append(RawSignal(one, found, 7)[:])
        images.append(backprojected(one, signals[-1], found.place_m[:50]))
    np.testing.assert_array_equal(*signals)
    np.testing.assert_array_equal(*images)
    assert len(signals[0]) == len(one.track_m)


def test_receiver_noise_has_its_power_and_is_white():
    one = collection(noise_m2=0.3, length_m=300.0)
    nothing = Scatterers(np.empty((0, 3)), np.empty(0, np.complex64))
    noise = RawSignal(one, nothing, 3)[:]
    n = noise.size
    assert np.mean(np.abs(noise) ** 2) == pytest.approx(0.3, rel=5.0 / np.sqrt(n))
    for shifted in (noise[1:] * noise[:-1].conj(), noise[:, 1:] * noise[:, :-1].conj(), noise**2):
        assert abs(shifted.mean()) < 5.0 * 0.3 / np.sqrt(n)


@pytest.mark.parametrize("bits", [4, 8])
def test_noise_of_quantisation_is_a_twelfth_of_the_squared_step_in_i_and_q(bits):
    rng = np.random.default_rng(4)
    signal = (rng.standard_normal((4, 20_000, 2)) @ [1.0, 1j] * np.array([[1.0], [3.0], [10.0], [0.1]])).astype("c8")
    numbers, scale = quantised(signal, bits)
    assert numbers.min() >= -(2 ** (bits - 1))
    assert numbers.max() < 2 ** (bits - 1)
    error = numbers @ [1.0, 1j] * scale[:, None] - signal
    np.testing.assert_allclose(converted(signal, bits) - signal, error, atol=1e-6 * np.abs(signal).max())
    assert converted(signal, None) is signal
    step = 10.0 * np.array([1.0, 3.0, 10.0, 0.1]) / 2**bits  # five times the rms to either side
    level_db = 10.0 * np.log10(np.mean(np.abs(error) ** 2, axis=1) / (step**2 / 6.0))
    np.testing.assert_allclose(level_db, 0.0, atol=0.5)
