"""Phase history: the echo of all scatterers at each pulse and frequency, with noise, as a converter writes it.

It is made in blocks of pulses, which are kept as files until a product is finished.

The sum over scatterers of a exp(-4 pi i f (R - R_0) / c) at all frequencies f of a pulse is a Fourier transform of
impulses at uneven ranges R. Each impulse is spread by a short kernel over the cells of an even grid of twice the number
of frequencies; one FFT gives all frequencies, and the transform of the kernel is divided out.

References
----------
Barnett, Magland and af Klinteberg, "A parallel nonuniform fast Fourier transform library based on an 'exponential of
semicircle' kernel", SIAM J. Sci. Comput. 41 (2019).
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.compiled import njit, threaded
from radcal.errors import DamagedError
from radcal.seeds import derived_seed
from radcal.signals.platform import BEAM, LIGHT_MPS, Collection, collection
from radcal.signals.scatterers import Scatterers, circular, scatterers
from radcal.simulators.forward import Forward
from radcal.speckle.gaussian import cosine_sine
from radcal.storage.files import digest
from radcal.storage.records import read_hdf5, write_hdf5

TAPS = 6
"""Cells of the grid over which an impulse is spread; the error of the sum is then below 1e-5 of its rms."""
_PARTS = 512  # of a cell, between which the kernel is interpolated
_SHAPE = 2.30 * TAPS  # of the kernel, for a grid of twice the number of frequencies
BLOCK = 64
"""Pulses at once: the same for any number of threads, so that all sums have the same bits."""
_LOAD = 5.0  # full scale of the converter, in rms of I or Q: 6e-7 of the values of a Gaussian signal are clipped

_F = np.float32
_QUARTER = _F(np.pi / 2.0)


@njit(inline="always")
def turned(turns: Any) -> Any:
    """Cosine and sine of an angle in turns (float64), in single precision."""
    quarters = 4.0 * (turns - np.floor(turns))
    nearest = np.floor(quarters + 0.5)
    cosine, sine = cosine_sine(_F(quarters - nearest) * _QUARTER)
    quadrant = int(nearest) & 3
    if quadrant & 1:
        sine, cosine = cosine, -sine
    return (-cosine, -sine) if quadrant & 2 else (cosine, sine)


@cache
def grid_kernel(samples: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Kernel of the grid of a number of frequencies, as a table.

    Parameters
    ----------
    samples : int
        Number of frequencies.

    Returns
    -------
    table : ndarray of float32, shape (parts + 1, TAPS)
        Values of the kernel at the cells around a place, by the place's distance from the cell before it.
    transform : ndarray, shape (cells,)
        Fourier transform of the kernel at the frequencies of an FFT of the grid.
    """
    cells = scipy.fft.next_fast_len(2 * samples)
    place = np.arange(_PARTS + 1)[:, None] / _PARTS
    away = (np.arange(TAPS) - TAPS / 2 + 1.0 - place) * 2.0 / TAPS
    table = np.exp(_SHAPE * (np.sqrt(np.maximum(1.0 - away**2, 0.0)) - 1.0)).astype(np.float32)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    kernel = np.exp(_SHAPE * (np.sqrt(1.0 - nodes**2) - 1.0)) * weights * TAPS / 2.0
    turns = np.multiply.outer(np.fft.fftfreq(cells), 0.5 * TAPS * nodes)
    return table, np.cos(2.0 * np.pi * turns) @ kernel


@njit(inline="always")
def cell_before(cells: Any, n: Any) -> Any:
    """First cell of the kernel around a place in a grid of ``n`` cells, and row and share of its place in the table."""
    below = np.floor(cells)
    at = (cells - below) * _PARTS
    row = int(at)
    return (int(below) - TAPS // 2 + 1) % n, row, _F(at - row)


@threaded
def _spread(
    part: Any, place: Any, amplitude: Any, first: Any, last: Any, track: Any, aim: Any, distance: Any, middle: Any,
    turns: Any, cells: Any, beam: Any, widest: Any, table: Any, grid: Any,
) -> None:  # fmt: skip
    """Add the echoes of the scatterers that each pulse sees to the pulse's cells of range; real and imaginary parts.

    ``turns`` and ``cells`` are the turns of the carrier's phase and the cells of the grid per metre of slant range. The
    last cells of the grid, as many as the kernel has, stand for its first ones.
    """
    n, narrow = grid.shape[1] - TAPS, 0.5 * BEAM / widest
    for p in range(part[0], part[1]):
        line = grid[p]
        for i in range(first[p], last[p]):
            x, y, z = place[i, 0] - track[p, 0], place[i, 1] - track[p, 1], place[i, 2] - track[p, 2]
            slant = np.sqrt(x * x + y * y + z * z)
            inverse = 1.0 / slant
            at = (x * inverse - aim[p]) * narrow + 0.5 * BEAM
            k = int(at)
            if at <= 0.0 or k >= BEAM:
                continue
            loss = middle * inverse
            gain = _F(loss * loss) * (beam[k] + _F(at - k) * (beam[k + 1] - beam[k]))
            away = slant - distance[p]
            cosine, sine = turned(-turns * away)
            real, imaginary = gain * amplitude[i].real, gain * amplitude[i].imag
            real, imaginary = real * cosine - imaginary * sine, real * sine + imaginary * cosine
            below, row, share = cell_before(away * cells, n)
            for j in range(TAPS):
                tap = table[row, j] + share * (table[row + 1, j] - table[row, j])
                line[below + j, 0] += tap * real
                line[below + j, 1] += tap * imaginary


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
    table, transform = grid_kernel(one.samples)
    pulses, n = slice(first, last), transform.size
    track = one.track_m[pulses]
    across = np.abs(found.place_m[:, 1:] - one.track_m[0, 1:]) if len(found.place_m) else np.zeros((1, 2))
    away = (0.99 * float(np.hypot(*across.min(axis=0))), 1.01 * float(np.hypot(*across.max(axis=0))))
    behind, ahead = one.places_m(*away, 2.0 * one.null)
    grid = np.zeros((last - first, n + TAPS, 2), np.float32)
    _spread(
        last - first, found.place_m, found.amplitude,
        np.searchsorted(found.place_m[:, 0], track[:, 0] + behind - 1.0),
        np.searchsorted(found.place_m[:, 0], track[:, 0] + ahead + 1.0), track, one.aim[pulses],
        one.distance_m[pulses], one.range_m, 2.0 * one.carrier_hz / LIGHT_MPS, 2.0 * one.step_hz / LIGHT_MPS * n,
        one.beam, one.null, table, grid,
    )  # fmt: skip
    grid[:, :TAPS] += grid[:, n:]
    below = one.samples // 2  # frequencies below the middle, which an FFT has at its end
    spectrum = scipy.fft.fft(grid.view(np.complex64)[:, :n, 0], axis=1) / transform.astype(np.float32)
    return np.concatenate([spectrum[:, n - below :], spectrum[:, : one.samples - below]], axis=1)


def receiver_noise(one: Collection, seed: int, first: int, last: int) -> NDArray[np.complex64]:
    """Thermal noise of some pulses, shape (last - first, samples), by the number of the pulse."""
    pulse, sample = np.meshgrid(np.arange(first, last), np.arange(one.samples), indexing="ij")
    noise = circular(sample.ravel(), pulse.ravel(), derived_seed(seed, "receiver")).reshape(sample.shape)
    return np.asarray(np.float32(np.sqrt(one.noise_m2)) * noise)


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


@dataclass(frozen=True)
class RawSignal:
    """Raw signal of a collection, of which a slice of pulses is simulated when it is asked for.

    Attributes
    ----------
    one : Collection
        Collection.
    found : Scatterers
        Scatterers.
    seed : int
        Noise seed.
    folder : path, optional
        Folder in which blocks of pulses are kept as files, so that none is simulated twice, also after a kill.
    """

    one: Collection
    found: Scatterers
    seed: int
    folder: Path | None = None

    def __len__(self) -> int:
        return len(self.one.track_m)

    def __getitem__(self, pulses: slice) -> NDArray[np.complex64]:
        first, last, _ = pulses.indices(len(self))
        numbers, start = range(first // BLOCK, -(-last // BLOCK)), first % BLOCK
        blocks = [kept(self.folder, f"pulses-{k}", partial(self.block, k)) for k in numbers]
        return np.concatenate(blocks)[start : start + last - first]

    def block(self, number: int) -> NDArray[np.complex64]:
        """Pulses of one block, with noise, before the converter; the bits do not depend on the number of threads."""
        first, last = number * BLOCK, min((number + 1) * BLOCK, len(self))
        pulses = echoes(self.one, self.found, first, last)
        if self.one.noise_m2 > 0.0:
            pulses += receiver_noise(self.one, self.seed, first, last)
        return pulses


class Pulses(Protocol):
    """Raw signal, in memory or made when a slice of pulses is asked for."""

    def __getitem__(self, pulses: slice, /) -> NDArray[np.complex64]: ...


def kept(folder: Path | None, name: str, make: Callable[[], NDArray[np.complex64]]) -> NDArray[np.complex64]:
    """Array of a file in a folder, which is made and written first if it is missing or damaged; made without one."""
    if folder is None:
        return make()
    if (path := folder / f"{name}.h5").exists():
        with contextlib.suppress(DamagedError), read_hdf5(path, "signal_part") as file:
            return np.asarray(file["values"][()])
    made = make()
    with write_hdf5(path, "signal_part") as file:
        file["values"] = made
    return made


@contextlib.contextmanager
def signal_of(stem: Path, made: Forward) -> Iterator[RawSignal]:
    """Raw signal of a pass, whose files lie beside a product until the product is finished.

    Parameters
    ----------
    stem : path
        Path of the product's files without suffix.
    made : Forward
        Forward run of the pass, whose laws and seed are used.

    Yields
    ------
    RawSignal
        Signal, whose folder is named after all that the signal depends on: a later command with the same settings
        continues a killed one, and a command with others removes its files.
    """
    one, start = collection(made.case, made.scene), f".{stem.name}-"
    described = [made.key, made.seed, made.case.seed, made.case.signals.model_dump(mode="json")]
    folder = stem.parent / f"{start}{digest(described)}"
    for former in stem.parent.glob(f"{start}*"):
        if former != folder:
            shutil.rmtree(former, ignore_errors=True)
    yield RawSignal(one, scatterers(made.case, made.scene, made.seed, one.facet_m), made.seed, folder)
    shutil.rmtree(folder, ignore_errors=True)
