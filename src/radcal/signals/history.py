"""Phase history: the echo of all scatterers at each pulse and frequency, with noise, as a converter writes it.

The sum over scatterers of a exp(-4 pi i f (R - R_0) / c) at all frequencies f of a pulse is a Fourier transform of
impulses at uneven ranges R. Each impulse is spread by a short kernel over the cells of an even grid of twice the number
of frequencies; one FFT gives all frequencies, and the transform of the kernel is divided out.

References
----------
Barnett, Magland and af Klinteberg, "A parallel nonuniform fast Fourier transform library based on an 'exponential of
semicircle' kernel", SIAM J. Sci. Comput. 41 (2019).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.compiled import njit, threaded
from radcal.seeds import derived_seed
from radcal.signals.platform import LIGHT_MPS, Collection, pattern
from radcal.signals.scatterers import Scatterers
from radcal.speckle.gaussian import gaussian_row, seed_words

TAPS = 6
"""Cells of the grid over which an impulse is spread; the error of the sum is then below 1e-5 of its rms."""
_DEGREE = 7  # of the polynomials that stand for the kernel between cells
_SHAPE = 2.30 * TAPS  # of the kernel, for a grid of twice the number of frequencies
_BLOCK = 64  # pulses at once: the same for any number of threads, so that all sums have the same bits
_LOAD = 5.0  # full scale of the converter, in rms of I or Q: 6e-7 of the values of a Gaussian signal are clipped
_BEAM = 4096  # intervals of the table of the beam

_F = np.float32
# sin and cos of up to an eighth of a turn (Moshier, Cephes library, single precision, 1992)
_S1, _S2, _S3 = _F(-1.6666654611e-1), _F(8.3321608736e-3), _F(-1.9515295891e-4)
_C1, _C2, _C3 = _F(4.166664568298827e-2), _F(-1.388731625493765e-3), _F(2.443315711809948e-5)
_HALF, _ONE, _QUARTER = _F(0.5), _F(1.0), _F(np.pi / 2.0)


@njit(inline="always")
def turned(turns: Any) -> Any:
    """Cosine and sine of an angle in turns (float64), in single precision."""
    quarters = 4.0 * (turns - np.floor(turns))
    nearest = np.floor(quarters + 0.5)
    y = _F(quarters - nearest) * _QUARTER
    z = y * y
    sine = y + y * z * (_S1 + z * (_S2 + z * _S3))
    cosine = _ONE - _HALF * z + z * z * (_C1 + z * (_C2 + z * _C3))
    quadrant = int(nearest) & 3
    if quadrant & 1:
        sine, cosine = cosine, -sine
    return (-cosine, -sine) if quadrant & 2 else (cosine, sine)


@njit(inline="always")
def tap_values(offset: Any, coefficients: Any, taps: Any) -> None:
    """Values of the kernel at the cells around a place at ``offset`` (0 to 1) behind a cell, written to ``taps``."""
    s = _F(2.0 * offset - 1.0)
    for j in range(TAPS):
        taps[j] = coefficients[_DEGREE, j]
    for d in range(_DEGREE - 1, -1, -1):
        for j in range(TAPS):
            taps[j] = taps[j] * s + coefficients[d, j]


@cache
def grid_kernel(samples: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Kernel of the grid of a number of frequencies.

    Parameters
    ----------
    samples : int
        Number of frequencies.

    Returns
    -------
    coefficients : ndarray of float32, shape (degree + 1, TAPS)
        Polynomial of each tap in the place between two cells, -1 to 1.
    transform : ndarray, shape (cells,)
        Fourier transform of the kernel at the frequencies of an FFT of the grid.
    """
    cells = scipy.fft.next_fast_len(2 * samples)
    place = 0.5 + 0.5 * np.cos(np.pi * (np.arange(40) + 0.5) / 40)
    away = (np.arange(TAPS)[:, None] - TAPS / 2 + 1.0 - place) * 2.0 / TAPS
    values = np.exp(_SHAPE * (np.sqrt(np.maximum(1.0 - away**2, 0.0)) - 1.0))
    coefficients = np.polynomial.polynomial.polyfit(2.0 * place - 1.0, values.T, _DEGREE)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    kernel = np.exp(_SHAPE * (np.sqrt(1.0 - nodes**2) - 1.0)) * weights * TAPS / 2.0
    turns = np.multiply.outer(np.fft.fftfreq(cells), 0.5 * TAPS * nodes)
    return np.ascontiguousarray(coefficients, np.float32), np.cos(2.0 * np.pi * turns) @ kernel


@threaded
def _spread(
    part: Any, place: Any, amplitude: Any, first: Any, last: Any, track: Any, distance: Any, middle: Any, turns: Any,
    cells: Any, beam: Any, widest: Any, coefficients: Any, grid: Any,
) -> None:  # fmt: skip
    """Add the echoes of the scatterers that each pulse sees to the pulse's cells of range; real and imaginary parts.

    ``turns`` and ``cells`` are the turns of the carrier's phase and the cells of the grid per metre of slant range.
    """
    n, narrow = grid.shape[1], 0.5 * _BEAM / widest
    taps = np.empty(TAPS, np.float32)
    for p in range(part[0], part[1]):
        for i in range(first[p], last[p]):
            x, y, z = place[i, 0] - track[p, 0], place[i, 1] - track[p, 1], place[i, 2] - track[p, 2]
            slant = np.sqrt(x * x + y * y + z * z)
            inverse = 1.0 / slant
            at = x * inverse * narrow + 0.5 * _BEAM
            k = int(at)
            if at <= 0.0 or k >= _BEAM:
                continue
            loss = middle * inverse
            gain = _F(loss * loss) * (beam[k] + _F(at - k) * (beam[k + 1] - beam[k]))
            away = slant - distance[p]
            cosine, sine = turned(-turns * away)
            real, imaginary = gain * amplitude[i].real, gain * amplitude[i].imag
            real, imaginary = real * cosine - imaginary * sine, real * sine + imaginary * cosine
            q = away * cells
            below = int(np.floor(q))
            tap_values(q - below, coefficients, taps)
            below -= TAPS // 2 - 1
            while below < 0:
                below += n
            while below >= n:
                below -= n
            for j in range(TAPS):
                cell = below + j if below + j < n else below + j - n
                grid[p, cell, 0] += taps[j] * real
                grid[p, cell, 1] += taps[j] * imaginary


def echoes(one: Collection, found: Scatterers, first: int, last: int) -> NDArray[np.complex64]:
    """Echoes of the scatterers at some pulses, without noise.

    Parameters
    ----------
    one : Collection
        Collection.
    found : Scatterers
        Scatterers.
    first, last : int
        First pulse, and the pulse after the last.

    Returns
    -------
    ndarray of complex64, shape (last - first, samples)
        Sum over the scatterers of the amplitude, times the two-way beam, times (``range_m`` / R)^2, with the phase
        -4 pi f (R - R_0) / c, where R_0 is the distance to the pulse's reference point [m].
    """
    coefficients, transform = grid_kernel(one.samples)
    pulses, n = slice(first, last), transform.size
    widest = one.wavelength_m / one.antenna_m
    track = one.track_m[pulses]
    farthest = np.abs(found.place_m - one.track_m[0]).max(axis=0)[1:] if len(found.place_m) else np.zeros(2)
    reach = 1.01 * one.reach_m(float(np.hypot(*farthest)), widest) + 1.0
    beam = pattern(np.linspace(-1.0, 1.0, _BEAM + 1) * widest, one.antenna_m, one.wavelength_m).astype(np.float32)
    grid = np.zeros((last - first, n, 2), np.float32)
    _spread(
        last - first, found.place_m, found.amplitude, np.searchsorted(found.place_m[:, 0], track[:, 0] - reach),
        np.searchsorted(found.place_m[:, 0], track[:, 0] + reach), track, one.distance_m[pulses], one.range_m,
        2.0 * one.carrier_hz / LIGHT_MPS, 2.0 * one.step_hz / LIGHT_MPS * n, beam, widest, coefficients, grid,
    )  # fmt: skip
    below = one.samples // 2  # frequencies below the middle, which an FFT has at its end
    spectrum = scipy.fft.fft(grid.view(np.complex64)[..., 0], axis=1, overwrite_x=True) / transform.astype(np.float32)
    return np.concatenate([spectrum[:, n - below :], spectrum[:, : one.samples - below]], axis=1)


def _noise(one: Collection, seed: int, first: int, last: int) -> NDArray[np.complex64]:
    """Thermal noise of some pulses, shape (last - first, samples), by the number of the pulse."""
    n = one.samples
    key, place, out = seed_words(derived_seed(seed, "receiver")), np.arange(n, dtype=np.uint32), []
    words, halves = np.empty((2, n), np.uint32), np.empty((2, n), np.float32)
    for pulse in range(first, last):
        gaussian_row(n, place, np.full(n, pulse, np.uint32), np.uint32(0), key, words, halves[0], halves[1])
        out.append(halves[0] + 1j * halves[1])
    return np.asarray(np.float32(np.sqrt(one.noise_m2)) * np.array(out), np.complex64)


def quantised(signal: NDArray[np.complex64], bits: int) -> tuple[NDArray[np.int16], NDArray[np.float64]]:
    """Signal as whole numbers of a converter whose full scale is five times the rms of each pulse.

    Parameters
    ----------
    signal : ndarray of complex64, shape (pulses, samples)
        Signal.
    bits : int
        Number of bits of I and of Q.

    Returns
    -------
    numbers : ndarray of int16, shape (pulses, samples, 2)
        I and Q, from -2^(bits - 1) to 2^(bits - 1) - 1.
    scale : ndarray, shape (pulses,)
        Signal of the number 1. The noise of rounding has the power scale^2 / 6.
    """
    half = 2 ** (bits - 1)
    rms = np.sqrt(0.5 * np.mean(np.abs(signal.astype(np.complex128)) ** 2, axis=1))
    scale = np.where(rms > 0.0, _LOAD * rms / half, 1.0)
    parts = np.stack([signal.real, signal.imag], axis=2) / scale[:, None, None]
    return np.clip(np.rint(parts), -half, half - 1).astype(np.int16), scale


def converted(signal: NDArray[np.complex64], bits: int | None) -> NDArray[np.complex64]:
    """Signal rounded to the steps of a converter (:func:`quantised`); the signal itself without one."""
    if bits is None:
        return signal
    numbers, scale = quantised(signal, bits)
    return np.asarray((numbers * scale[:, None, None]).astype(np.float32).view(np.complex64)[..., 0])


def raw_signal(one: Collection, found: Scatterers, seed: int) -> Iterator[NDArray[np.complex64]]:
    """Raw signal of a collection in blocks of pulses, with noise, before the converter.

    Parameters
    ----------
    one : Collection
        Collection.
    found : Scatterers
        Scatterers.
    seed : int
        Noise seed.

    Yields
    ------
    ndarray of complex64, shape (pulses, samples)
        Signal [m]; its bits do not depend on the number of threads.
    """
    for first in range(0, len(one.track_m), _BLOCK):
        last = min(first + _BLOCK, len(one.track_m))
        signal = echoes(one, found, first, last)
        if one.noise_m2 > 0.0:
            signal += _noise(one, seed, first, last)
        yield signal
