"""Point targets and noise of focused signals against closed forms."""

import numpy as np
import pytest
from signals import FINE, ideal, lobes
from signals_samples import at, collection, nominal

from radcal.signals.focus import backprojected, cell_area_m2
from radcal.signals.history import RawSignal
from radcal.signals.platform import nesz
from radcal.signals.scatterers import Scatterers
from radcal.signals.wavenumber import omega_k
from radcal.speckle.response import speckle_correlation, taylor_weights

OMEGA_K = [(name, "omega_k") for name in ("X band, 0.5 m", "X band, 0.5 m, squint of 20 degrees", "default, 3.5 m")]
CASES = {
    "X band, 0.5 m": {"range_m": 0.5, "azimuth_m": 0.5, "swath_m": 120.0},
    # 50 cells of range migration, and a bent track
    "L band, 0.75 m": {
        "carrier_hz": 1.3e9, "slant_m": 9000.0, "range_m": 0.75, "azimuth_m": 0.75, "swath_m": 60.0, "bend_m": 2.0,
    },
    "X band, 0.5 m, squint of 20 degrees": {
        "range_m": 0.5, "azimuth_m": 0.5, "swath_m": 120.0, "squint_deg": 20.0,
    },
    "X band, spotlight of 0.3 m": {
        "range_m": 0.3, "azimuth_m": 0.3, "swath_m": 80.0, "spot": True, "antenna_m": 1.5, "bend_m": 0.3,
    },
    "default, 3.5 m": {"slant_m": 5657.0, "range_m": 2.0, "azimuth_m": 3.5, "swath_m": 200.0},  # a product of 10
}  # fmt: skip


@pytest.mark.parametrize(("name", "focusing"), [*((name, "backprojection") for name in CASES), *OMEGA_K])
def test_point_targets_have_place_width_sidelobes_phase_and_amplitude_of_the_closed_form(name, focusing):
    """Six targets at other heights, near to far and start to end; cuts along and across the middle line of sight."""
    one = collection(**CASES[name])
    squint, plain = one.middle_sine, not CASES[name].keys() & {"spot", "squint_deg"}
    cosine = np.sqrt(1.0 - squint**2)
    resolution = np.array([CASES[name]["azimuth_m"], CASES[name]["range_m"]])
    swath, height = CASES[name]["swath_m"], [0.0, 8.0, -5.0, 15.0, 3.0, -9.0]
    azimuth = np.array([5.3, 95.1, 50.2, 20.7, 71.9, 88.4])
    slant = nominal(one) + np.array([-0.49, 0.48, 0.0, 0.31, -0.22, 0.13]) * swath
    place = np.array([at(one, x, r, z) for x, r, z in zip(azimuth, slant, height, strict=True)])
    amplitude = (np.array([1.0, 2.0, 0.5, 1.5, 1.0, 3.0]) * np.exp(1j * np.arange(6.0))).astype(np.complex64)
    away = np.arange(-8 * FINE, 8 * FINE + 1) / FINE
    shape = lobes(ideal(away))
    product = one.band**2 * one.wavelength_m * nominal(one) / 2.0
    signal = RawSignal(one, Scatterers.sorted(place, amplitude), 1)[:]
    for k in range(6):

        def image(azimuth_m, slant_m, height_m=height[k]):
            if focusing == "omega_k":
                return omega_k(one, signal, azimuth_m, slant_m)[0].ravel()
            cut = np.broadcast_arrays(azimuth_m, slant_m)
            return backprojected(one, signal, np.array([at(one, x, r, height_m) for x, r in zip(*cut, strict=True)]))[0]

        (peak,) = image(azimuth[k : k + 1], slant[k : k + 1])
        assert abs(np.degrees(np.angle(peak / amplitude[k]))) < 0.5
        assert 20.0 * np.log10(abs(peak / amplitude[k])) == pytest.approx(0.0, abs=0.01)
        for axis in (0, 1):
            line = np.array([cosine**2, -squint * cosine] if axis == 0 else [squint, cosine]) * resolution[axis]
            x, r = azimuth[k] + away * line[0], slant[k] + away * line[1]
            if focusing == "omega_k":  # on a grid: along the track and in slant range
                x, r = azimuth[k] + away * resolution[0], slant[k] + away * resolution[1]
                x, r = (x, slant[k : k + 1]) if axis == 0 else (azimuth[k : k + 1], r)
            offset, width, highest, rest = lobes(image(x, r))
            long = axis == 1 or product >= 200.0
            assert abs(offset) < 0.01 * FINE
            if not plain:
                continue
            assert width == pytest.approx(shape[1], rel=0.005 if long else 0.02)
            if long:
                assert highest == pytest.approx(shape[2], abs=0.5)
            if axis == 1 or (product >= 200.0 and one.wavelength_m * one.band < 0.17):  # a beam below 5 degrees
                assert rest == pytest.approx(shape[3], abs=0.5)


def grid(one, swath_m, step_m):
    """Places of an even grid of azimuth and slant range in the middle of the swath, and their shape."""
    azimuth, slant = (
        np.arange(20.0, 80.0, step_m[0]),
        nominal(one) + np.arange(-0.3 * swath_m, 0.3 * swath_m, step_m[1]),
    )
    return np.array([at(one, x, r) for r in slant for x in azimuth])


@pytest.mark.parametrize(("looks", "slant_m"), [(1, 5000.0), (4, 5000.0), (2, 8000.0)])
def test_noise_of_the_image_is_that_of_the_radar_equation(looks, slant_m):
    """The radar equation as in textbooks, for a receiver with thermal noise and a pulse of a power and a length."""
    power_w, gain, figure, pulse_s = 800.0, 1500.0, 2.5, 12e-6
    one = collection(slant_m=slant_m, swath_m=300.0, looks=looks)
    bandwidth, incidence = one.samples * one.step_hz, np.radians(45.0)
    thermal = 1.380649e-23 * 290.0 * figure
    lit = power_w * pulse_s * (gain * one.wavelength_m) ** 2 / ((4.0 * np.pi) ** 3 * slant_m**4)
    one = collection(slant_m=slant_m, swath_m=300.0, looks=looks, noise_m2=thermal * one.samples / lit)
    # Curlander and McDonough, "Synthetic Aperture Radar" (1991), eq. 2.8.9 with the pulse rate in the mean power
    mean_w = power_w * pulse_s * one.prf_hz
    textbook = 4.0 * (4.0 * np.pi * slant_m) ** 3 * one.speed_mps * thermal * bandwidth * np.sin(incidence)
    textbook /= 299_792_458.0 * mean_w * gain**2 * one.wavelength_m**3
    # the beam is taken out of the processed band: noise rises by the mean of its inverse square under the weights
    place = (np.arange(20_000) + 0.5) / 20_000
    weights = taylor_weights(place * looks % 1.0 - 0.5) ** 2
    beam = np.sinc((place - 0.5) * 0.5 * one.band * one.antenna_m) ** 4
    expected = 10.0 * np.log10(textbook * np.sum(weights / beam) / np.sum(weights))
    assert 10.0 * np.log10(nesz(one, slant_m, 45.0)) == pytest.approx(expected, abs=0.01)
    nothing, levels = Scatterers(np.empty((0, 3)), np.empty(0, np.complex64)), []
    for seed in range(8):
        signal = RawSignal(one, nothing, seed)[:]
        image = backprojected(one, signal, grid(one, 300.0, (3.5, 2.0)))
        levels.append(np.mean(np.abs(image) ** 2) / cell_area_m2(one, np.array(45.0)))
    assert 10.0 * np.log10(np.mean(levels)) == pytest.approx(expected, abs=0.1)


def even_ground(draws, azimuth_m, **keys):
    """Images by both ways of level ground, whose facets are as long as the collection allows, or of noise alone."""
    images = {"backprojection": [], "omega_k": []}
    one = collection(slant_m=5657.0, length_m=400.0, swath_m=60.0, azimuth_m=3.5, range_m=2.0, **keys)
    along, slant = np.arange(-60.0, 460.0, one.facet_m), nominal(one) + np.arange(-29.0, 29.0, 1.0)
    facets = np.array([at(one, x, r) for x in along for r in slant])
    image = azimuth_m, nominal(one) + np.arange(-24.0, 24.0, 2.0)
    pixels = np.array([at(one, x, r) for r in image[1] for x in image[0]])
    for seed in range(draws):
        drawn = np.random.default_rng(seed).standard_normal((2, len(facets))) * (one.noise_m2 == 0.0)
        signal = RawSignal(one, Scatterers(facets, (drawn[0] + 1j * drawn[1]).astype(np.complex64)), seed)[:]
        found = backprojected(one, signal, pixels)
        images["backprojection"].append(found.reshape(one.looks, -1, azimuth_m.size))
        images["omega_k"].append(omega_k(one, signal, *image))
    return {name: np.array(each) for name, each in images.items()}


def test_four_looks_are_independent():
    """Amplitudes correlate by 0.03 at most, and the mean of the looks has four equivalent looks."""
    for image in even_ground(12, np.arange(15.0, 385.0, 2.5), looks=4).values():
        looks = np.moveaxis(image, 1, 0).reshape(4, -1)
        power = np.abs(looks) ** 2
        correlation = np.abs(looks @ looks.conj().T) / power.mean() / looks.shape[1]
        assert (correlation - np.diag(np.diag(correlation))).max() < 0.03
        mean = power.mean(axis=0)
        assert mean.mean() ** 2 / mean.var() == pytest.approx(4.0, abs=0.1)


def correlation_of_backprojection(of_noise, distances, step=0.05):
    """Autocorrelation along the track that follows from weights, beam and chirp over the finite aperture of a pixel."""
    one = collection(slant_m=5657.0, azimuth_m=3.5)
    along = np.arange(-80.0, 80.0, step)
    sine, chirp = (
        along / np.hypot(one.range_m, along),
        np.exp(4j * np.pi / one.wavelength_m * np.hypot(one.range_m, along)),
    )
    beam = np.sinc(sine * one.antenna_m / one.wavelength_m) ** 2
    place = 2.0 * sine / one.band / one.wavelength_m
    weights = np.where(np.abs(place) < 0.5, taylor_weights(place), 0.0) / beam * chirp
    response = weights if of_noise else np.correlate(weights, (beam * chirp.conj()).conj(), "full")
    pairs = [np.sum(response[round(d / step) :] * response[: -round(d / step)].conj()) for d in distances]
    return np.real(pairs) / np.sum(np.abs(response) ** 2)


@pytest.mark.parametrize("of_noise", [False, True], ids=["ground", "noise"])
def test_autocorrelation_along_the_track_is_that_of_the_response(of_noise):
    """At a product of 10; back-projection weights angles, and the beam, which is divided out, weights noise."""
    distances = np.array([2.5, 5.0, 7.5])
    expected = {
        "backprojection": correlation_of_backprojection(of_noise, distances),
        "omega_k": np.sqrt(speckle_correlation(distances / 3.5)),
    }
    for name, image in even_ground(40, np.arange(15.0, 385.0, 2.5), noise_m2=float(of_noise)).items():
        pairs = [np.mean(image[..., lag:] * image[..., :-lag].conj()).real for lag in (1, 2, 3)]
        if not of_noise or name == "backprojection":
            np.testing.assert_allclose(pairs / np.mean(np.abs(image) ** 2), expected[name], atol=0.006)
