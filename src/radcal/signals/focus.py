"""Focusing by back-projection onto the elevation model, for any track, and the product of focused images."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.compiled import threaded
from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.radar.radiometry import of_sigma0
from radcal.scene.model import Scene
from radcal.signals.history import BLOCK, TAPS, Pulses, cell_before, converted, grid_kernel, kept, signal_of, turned
from radcal.signals.places import image_places
from radcal.signals.platform import BEAM, LIGHT_MPS, Collection, azimuth_weights, collection
from radcal.signals.sicd import write_sicd
from radcal.signals.wavenumber import check_omega_k, omega_k
from radcal.simulators.forward import Flown, Forward, write_complex
from radcal.storage.files import atomic

_ALONG_THE_GROUND = ("sigma0_local", "gamma0_rtc")
_STRIP = 256  # columns of the image that are focused at once
_PULSES, _SAMPLES = 512, 1 << 22  # pulses and, of 64 pulses or more, samples that are in memory at once


def range_profiles(one: Collection, signal: NDArray[np.complex64]) -> NDArray[np.complex64]:
    """Range-compressed pulses on the grid of :func:`grid_kernel`, prepared for interpolation by its kernel.

    Parameters
    ----------
    one : Collection
        Collection.
    signal : ndarray of complex64, shape (pulses, samples)
        Raw signal of some pulses.

    Returns
    -------
    ndarray of complex64, shape (pulses, cells + TAPS)
        Profiles: a point has at its range its amplitude in the signal. The last cells repeat the first ones.
    """
    _, transform = grid_kernel(one.samples)
    frequency = np.arange(one.samples) - one.samples // 2
    grid = np.zeros((len(signal), transform.size), np.complex64)
    grid[:, frequency] = signal * (one.weights / one.weights.sum() / transform[frequency]).astype(np.float32)
    profiles = scipy.fft.ifft(grid, axis=1, norm="forward", overwrite_x=True)
    return np.concatenate([profiles, profiles[:, :TAPS]], axis=1)


@threaded
def _backproject(
    part: Any, profiles: Any, table: Any, place: Any, first: Any, last: Any, track: Any, aim: Any, distance: Any,
    middle: Any, turns: Any, cells: Any, spot: Any, sines: Any, middle_sine: Any, weights: Any, beam: Any, widest: Any,
    sums: Any, total: Any,
) -> None:  # fmt: skip
    """Add the weighted echoes of places in the pulses that see them in the band of a look, and the weights.

    ``sines`` is the width of the processed band in sines of the angle from zero Doppler. With ``spot`` the angle is
    that of the beam, so that all places have the same pulses; otherwise it is that of the place.
    """
    looks, n, size, narrow = sums.shape[0], profiles.shape[1] - TAPS, weights.size, 0.5 * BEAM / widest
    for i in range(part[0], part[1]):
        for p in range(first[i], last[i]):
            x, y, z = place[i, 0] - track[p, 0], place[i, 1] - track[p, 1], place[i, 2] - track[p, 2]
            slant = np.sqrt(x * x + y * y + z * z)
            sine = x / slant
            at = (((aim[p] if spot else sine) - middle_sine) / sines + 0.5) * size
            lit = (sine - aim[p]) * narrow + 0.5 * BEAM
            if at < 0.0 or at >= size or lit <= 0.0 or lit >= BEAM:
                continue
            k, m = int(at), int(lit)
            look, loss = k * looks // size, slant / middle
            weight = weights[k] * loss * loss / (beam[m] + (lit - m) * (beam[m + 1] - beam[m]))
            away = slant - distance[p]
            below, row, share = cell_before(away * cells[p], n)
            a = b = np.float32(0.0)
            for j in range(TAPS):
                tap = table[row, j] + share * (table[row + 1, j] - table[row, j])
                value = profiles[p, below + j]
                a += tap * value.real
                b += tap * value.imag
            cosine, sine = turned(turns[p] * away)
            sums[look, i] += complex(weight * (a * cosine - b * sine), weight * (a * sine + b * cosine))
            total[look, i] += weights[k]


def backprojected(
    one: Collection, signal: Pulses, place_m: NDArray[np.float64], frequency_hz: NDArray[np.float64] | None = None
) -> NDArray[np.complex64]:
    """Complex looks of places.

    Parameters
    ----------
    one : Collection
        Collection with a track that advances in azimuth.
    signal : ndarray of complex64, shape (pulses, samples), or what gives one for a slice of pulses
        Raw signal, of which some hundred pulses are in memory at once.
    place_m : ndarray, shape (n, 3)
        Azimuth, ground range and elevation of the places [m].
    frequency_hz : ndarray, shape (2, pulses), optional
        Middle frequency and frequency step of each pulse [Hz]; by default those of the collection.

    Returns
    -------
    ndarray of complex64, shape (looks, n)
        Amplitude: a point scatterer has at its place its own amplitude, with its phase [m].
    """
    weights, _ = azimuth_weights(one)
    table, transform = grid_kernel(one.samples)
    place_m = np.ascontiguousarray(place_m)
    sums, total = np.zeros((one.looks, len(place_m)), np.complex128), np.zeros((one.looks, len(place_m)))
    a, b = pulses_of(one, place_m)
    if frequency_hz is None:
        frequency_hz = np.repeat([[one.carrier_hz], [one.step_hz]], len(one.track_m), axis=1)
    turns, cells = 2.0 * frequency_hz / LIGHT_MPS * np.array([[1.0], [transform.size]])
    pulses = min(_PULSES, max(_SAMPLES // one.samples, BLOCK))  # the order of sums does not depend on it
    for first in range(int(a.min()), int(b.max()), pulses):
        some = slice(first, min(first + pulses, int(b.max())))
        low, high = (np.clip(ends, some.start, some.stop) - some.start for ends in (a, b))
        profiles = range_profiles(one, converted(signal[some], one.bits))
        _backproject(
            len(place_m), profiles, table, place_m, low, high, one.track_m[some], one.aim[some], one.distance_m[some],
            one.range_m, turns[some], cells[some], one.spot_m is not None, one.sines, one.middle_sine, weights,
            one.beam, one.null, sums, total,
        )  # fmt: skip
    return np.asarray(np.divide(sums, total, out=np.zeros_like(sums), where=total > 0.0), np.complex64)


def pulses_of(one: Collection, place_m: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First pulse that sees each place in the processed band, and the pulse after the last, shape (n,)."""
    slant = np.hypot(place_m[:, 1] - one.track_m[0, 1], place_m[:, 2] - one.track_m[0, 2])
    ends = [one.places_m(0.98 * float(slant.min()), 1.02 * float(slant.max()), one.sines)[k] for k in (1, 0)]
    margin = (-1.0, 1.0)
    a, b = (np.searchsorted(one.track_m[:, 0], place_m[:, 0] - end + m) for end, m in zip(ends, margin, strict=True))
    return a, b


def cell_area_m2(one: Collection, flat_incidence_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of level ground with the energy of the response to a point of unit amplitude [m2].

    Parameters
    ----------
    one : Collection
        Collection.
    flat_incidence_deg : ndarray
        Incidence on level ground [deg].

    Returns
    -------
    ndarray of the same shape
        Mean power of a look of ground with a sigma0 of 1.
    """
    weights, _ = azimuth_weights(one)
    energy = np.mean(one.weights**2) * one.gate_m * np.mean(weights**2) * one.looks / one.band
    energy *= math.sqrt(1.0 - one.middle_sine**2)  # range and azimuth are not at right angles
    return np.asarray(energy / np.sin(np.radians(flat_incidence_deg)))


def focused(one: Collection, signal: Pulses, made: Flown, folder: Path | None = None) -> NDArray[np.complex64]:
    """Complex looks of a pass, focused from a raw signal on the pixels of the fast image.

    Parameters
    ----------
    one : Collection
        Collection.
    signal : ndarray of complex64, shape (pulses, samples), or RawSignal
        Raw signal before the converter.
    made : Flown
        The pass.
    folder : path, optional
        Folder in which finished strips of the image are kept.

    Returns
    -------
    ndarray of complex64, shape (looks, rows, columns)
        Amplitude, whose squared magnitude is linear power in the configured radiometry.
    """
    place, radar = image_places(made), made.case.radar
    rows, columns = made.geometry.shape
    looks = np.empty((one.looks, rows, columns), np.complex64)
    for first in range(0, columns, _STRIP):
        part = place[:, first : first + _STRIP]

        def strip(part: NDArray[np.float64] = part) -> NDArray[np.complex64]:
            if made.case.signals.focusing == "backprojection":
                return backprojected(one, signal, part.reshape(-1, 3)).reshape(one.looks, *part.shape[:2])
            slant = np.hypot(part[:, 0, 1], one.track_m[0, 2] - part[:, 0, 2])
            ends = pulses_of(one, part.reshape(-1, 3))
            some = slice(int(ends[0].min()), int(ends[1].max()))
            raw = converted(signal[some], one.bits)
            return omega_k(one.pulses(some.start, some.stop), raw, part[0, :, 0], slant)

        looks[:, :, first : first + _STRIP] = kept(folder, f"columns-{first}", strip)
    level = of_sigma0(radar.radiometry, made.geometry.flat_incidence_deg)
    level /= cell_area_m2(one, made.geometry.flat_incidence_deg)
    return looks * np.sqrt(level).astype(np.float32)[:, None]


def check(case: Part, scene: Scene) -> None:
    """Raise the errors of :func:`collection` and of the way of focusing, before anything is simulated."""
    if case.radar.radiometry in _ALONG_THE_GROUND:
        raise ConfigError(
            f"radar.radiometry is {case.radar.radiometry}, expected sigma0_ref, beta0 or gamma0 for a focused image, "
            "whose pixels are not divided by the area of the ground."
        )
    collection(case, scene)
    if case.signals.focusing == "omega_k":
        check_omega_k(case)


def write_focused(stem: Path, made: Forward) -> list[Path | Finding]:
    """Simulate the raw signal of a pass and focus it; write the complex looks and a picture.

    Parameters
    ----------
    stem : path
        Path of the files without suffix.
    made : Forward
        Forward run of the pass, whose laws, seed and pixels are used.

    Returns
    -------
    list of path
        HDF5 file and PNG.
    """
    with signal_of(stem, made) as signal:
        looks = focused(signal.one, signal, made, signal.folder)
    paths = [stem.with_suffix(suffix) for suffix in (".h5", ".png")]
    phases = "of the range to the scatterers, -4 pi R / wavelength, relative to the back-projected pixel; speckle alike"
    write_complex(paths[0], made, "focused", looks, len(looks), phases)
    write_power(paths[1], np.mean(np.abs(looks) ** 2, axis=0))
    return [*paths, *write_sicd(stem, made, looks, apart=True)]


def write_power(path: Path, power: NDArray[np.floating[Any]]) -> None:
    """Write a picture of a power in dB, in shades of gray between its quantiles of 1 and 99 %."""
    from PIL import Image

    level = np.log10(np.maximum(power, np.finfo(np.float32).tiny))
    black, white = np.quantile(level, [0.01, 0.99])
    gray = np.clip((level - black) / max(white - black, 1e-6) * 255.0, 0.0, 255.0).astype(np.uint8)
    with atomic(path) as partial:
        Image.fromarray(gray).save(partial, format="PNG")
