"""Focusing in the domain of wavenumbers (omega-k), for straight tracks."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.signals.platform import LIGHT_MPS, Collection, azimuth_weights

_ERROR = 1e-6  # relative error of the Fourier transform at uneven wavenumbers


def check_omega_k(case: Part) -> None:
    """Raise an error if a pass cannot be focused by :func:`omega_k`, or if its package is missing."""
    signals = case.signals
    if signals.mode != "stripmap" or signals.motion_m > 0.0:
        key = "mode is spotlight" if signals.mode != "stripmap" else f"motion_m is {signals.motion_m:g}"
        raise ConfigError(
            f"signals.focusing is omega_k and signals.{key}: omega-k is for a straight track with a beam of constant "
            "direction, expected backprojection."
        )
    if find_spec("finufft") is None:
        raise ConfigError(
            "signals.focusing is omega_k, which needs the package finufft: install radcal[signals], or choose "
            "backprojection."
        )


def omega_k(
    one: Collection, signal: NDArray[np.complex64], azimuth_m: NDArray[np.float64], slant_m: NDArray[np.float64]
) -> NDArray[np.complex64]:
    """Complex looks on an even grid of azimuth and slant range.

    Parameters
    ----------
    one : Collection
        Collection with a straight track and a beam of constant direction.
    signal : ndarray of complex64, shape (pulses, samples)
        Raw signal.
    azimuth_m, slant_m : ndarray, shape (columns,) and (rows,)
        Azimuth, and slant range at zero Doppler, both evenly spaced [m].

    Returns
    -------
    ndarray of complex64, shape (looks, rows, columns)
        Amplitude: a point scatterer has at its place its own amplitude, with its phase [m]. Weights and beam belong
        to frequencies, not to pulses as in back-projection, so that they are right for any time-bandwidth product.

    Notes
    -----
    A point of range r has the spectrum exp(-i (k_x x + k_r r)) along the track with k_r^2 = k^2 - k_x^2, times the
    spectrum of :func:`_reference`, which is calculated for the middle of the swath and varies as the square root of
    r / k. The image is the sum over all k_x and k at uneven k_r: the adjoint of a nonuniform Fourier transform.

    References
    ----------
    Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data" (2005), chapter 8.
    """
    import finufft

    spacing = float(one.track_m[1, 0] - one.track_m[0, 0])
    wave = 4.0 * np.pi / LIGHT_MPS * one.frequency_hz
    along = 2.0 * np.pi * np.fft.fftfreq(len(signal), spacing)[:, None]
    period = 2.0 * np.pi / spacing
    along = along + period * np.round((wave * one.middle_sine - along) / period)
    away = along / wave - one.middle_sine
    azimuth, _ = azimuth_weights(one)
    part = np.floor((away / one.sines + 0.5) * azimuth.size).astype(np.int64)
    spectrum = scipy.fft.fft(signal, axis=0)
    middle_m, sines, reference = _reference(one)
    rows, columns = slant_m.size, azimuth_m.size
    steps = [(places[-1] - places[0]) / max(places.size - 1, 1) for places in (azimuth_m, slant_m)]
    looks = np.empty((one.looks, rows, columns), np.complex64)
    for look in range(one.looks):
        chosen = (part >= 0) & (part < azimuth.size) & (part * one.looks // azimuth.size == look)
        pulse, sample = np.nonzero(chosen)
        k, k_x = wave[sample], along[pulse, sample]
        weights = azimuth[part[pulse, sample]] * one.weights[sample]
        k_r = np.sqrt(k**2 - k_x**2)
        gain = weights / weights.sum() * np.sqrt(k * LIGHT_MPS / (4.0 * np.pi * one.carrier_hz)) * spacing
        gain = gain / np.interp(k_x / k, sines, reference)
        phase = k_x * (azimuth_m[columns // 2] - one.track_m[0, 0]) + k_r * slant_m[rows // 2] - k * one.distance_m[0]
        strengths = spectrum[pulse, sample] * gain * np.exp(1j * phase)
        turns = [np.remainder(k_r * steps[1], 2.0 * np.pi), np.remainder(k_x * steps[0], 2.0 * np.pi)]
        # one thread, so that sums have a fixed order
        image = finufft.nufft2d1(*turns, strengths, (rows, columns), eps=_ERROR, isign=1, nthreads=1)
        looks[look] = image * ((slant_m / middle_m) ** 1.5)[:, None]
    return looks


def _reference(one: Collection) -> tuple[float, NDArray[np.float64], NDArray[np.complex128]]:
    """Spectrum along the track of a point in the middle of the swath, at the carrier, without exp(-i k_r r).

    The method of stationary phase would give the beam times the square root of 2 pi r / (k cos^3) and -45 degrees,
    which is wrong by degrees where the time-bandwidth product is small.

    Parameters
    ----------
    one : Collection
        Collection.

    Returns
    -------
    middle_m : float
        Slant range of the point at zero Doppler [m].
    sines, spectrum : ndarray
        Sines of the angle from zero Doppler, rising, and spectrum there [m].
    """
    middle_m, wave = one.range_m * np.sqrt(1.0 - one.middle_sine**2), 4.0 * np.pi / one.wavelength_m
    step = 0.25 * float(one.track_m[1, 0] - one.track_m[0, 0])  # nothing folds
    first, last = one.places_m(middle_m, middle_m, 2.0 * one.null)
    place = np.arange(-last, -first, step)  # of the antenna
    slant = np.hypot(place, middle_m)
    beam = one.pattern(-place / slant - one.middle_sine)
    echo = beam * (one.range_m / slant) ** 2 * np.exp(-1j * wave * slant)
    size, period = scipy.fft.next_fast_len(8 * place.size), 2.0 * np.pi / step  # fine enough for interpolation
    along = 2.0 * np.pi * np.fft.fftfreq(size, step)
    along = along + period * np.round((wave * one.middle_sine - along) / period)
    spectrum = step * scipy.fft.fft(echo, size)
    spectrum *= np.exp(1j * (np.sqrt(np.maximum(wave**2 - along**2, 0.0)) * middle_m - along * place[0]))
    order = np.argsort(along)
    return middle_m, along[order] / wave, spectrum[order]
