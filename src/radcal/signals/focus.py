"""Focusing by back-projection onto the elevation model, for any track."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.compiled import threaded
from radcal.radar.earth import line_of_sight
from radcal.radar.radiometry import of_sigma0
from radcal.signals.history import TAPS, converted, grid_kernel, raw_signal, tap_values, turned
from radcal.signals.platform import LIGHT_MPS, Collection, azimuth_weights, collection
from radcal.signals.scatterers import scatterers
from radcal.simulators.forward import Forward, write_complex
from radcal.speckle.response import taylor_weights
from radcal.storage.files import atomic

_STRIP = 256  # columns of the image that are focused at once, which bounds the memory of the range-compressed pulses


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
    ndarray of complex64, shape (pulses, cells)
        Profiles: a point has at its range its amplitude in the signal.
    """
    _, transform = grid_kernel(one.samples)
    frequency = np.arange(one.samples) - one.samples // 2
    weights = taylor_weights((frequency + 0.5 * (one.samples % 2 == 0)) / one.samples)
    grid = np.zeros((len(signal), transform.size), np.complex64)
    grid[:, frequency] = signal * (weights / weights.sum() / transform[frequency]).astype(np.float32)
    return np.asarray(scipy.fft.ifft(grid, axis=1, norm="forward", overwrite_x=True), np.complex64)


@threaded
def _backproject(
    part: Any, profiles: Any, coefficients: Any, place: Any, track: Any, distance: Any, middle: Any, turns: Any,
    cells: Any, sines: Any, weights: Any, beam: Any, out: Any,
) -> None:  # fmt: skip
    """Amplitudes of places: for each look the weighted mean over the pulses that see the place in the look's band.

    ``sines`` is the width of the processed band in sines of the angle from zero Doppler.
    """
    looks, n, size = out.shape[0], profiles.shape[1], weights.size
    taps, total = np.empty(TAPS, np.float32), np.empty(looks, np.float64)
    real, imaginary = np.empty(looks, np.float64), np.empty(looks, np.float64)
    half = 0.5 * sines
    for i in range(part[0], part[1]):
        total[:], real[:], imaginary[:] = 0.0, 0.0, 0.0
        slant = np.hypot(place[i, 1], place[i, 2] - track[0, 2])
        reach = 1.02 * slant * half / np.sqrt(1.0 - half * half) + 1.0
        for p in range(
            np.searchsorted(track[:, 0], place[i, 0] - reach), np.searchsorted(track[:, 0], place[i, 0] + reach)
        ):
            x, y, z = place[i, 0] - track[p, 0], place[i, 1] - track[p, 1], place[i, 2] - track[p, 2]
            slant = np.sqrt(x * x + y * y + z * z)
            at = (x / slant / sines + 0.5) * size
            if at < 0.0 or at >= size:
                continue
            k = int(at)
            look = k * looks // size
            loss = slant / middle
            weight = weights[k] / beam[k] * loss * loss
            away = slant - distance[p]
            q = away * cells
            below = int(np.floor(q))
            tap_values(q - below, coefficients, taps)
            below = (below - TAPS // 2 + 1) % n
            a = b = np.float32(0.0)
            for j in range(TAPS):
                value = profiles[p, below + j if below + j < n else below + j - n]
                a += taps[j] * value.real
                b += taps[j] * value.imag
            cosine, sine = turned(turns * away)
            real[look] += weight * (a * cosine - b * sine)
            imaginary[look] += weight * (a * sine + b * cosine)
            total[look] += weights[k]
        for look in range(looks):
            if total[look] > 0.0:
                out[look, i] = complex(real[look], imaginary[look]) / total[look]


def backprojected(
    one: Collection, profiles: NDArray[np.complex64], place_m: NDArray[np.float64]
) -> NDArray[np.complex64]:
    """Complex looks of places.

    Parameters
    ----------
    one : Collection
        Collection with a track that advances in azimuth.
    profiles : ndarray of complex64, shape (pulses, cells)
        Range-compressed pulses of :func:`range_profiles`.
    place_m : ndarray, shape (n, 3)
        Azimuth, ground range and elevation of the places [m].

    Returns
    -------
    ndarray of complex64, shape (looks, n)
        Amplitude: a point scatterer has at its place its own amplitude, with its phase [m].
    """
    weights, beam = azimuth_weights(one)
    coefficients, transform = grid_kernel(one.samples)
    out = np.zeros((one.looks, len(place_m)), np.complex64)
    _backproject(
        len(place_m), profiles, coefficients, np.ascontiguousarray(place_m), one.track_m, one.distance_m, one.range_m,
        2.0 * one.carrier_hz / LIGHT_MPS, 2.0 * one.step_hz / LIGHT_MPS * transform.size,
        0.5 * one.band * one.wavelength_m, weights, beam, out,
    )  # fmt: skip
    return out


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
    bandwidth = one.samples * one.step_hz
    down = np.mean(taylor_weights((np.arange(one.samples) + 0.5) / one.samples - 0.5) ** 2)
    energy = down * LIGHT_MPS / (2.0 * bandwidth) * np.mean(weights**2) * one.looks / one.band
    return np.asarray(energy / np.sin(np.radians(flat_incidence_deg)))


def image_places(made: Forward) -> NDArray[np.float64]:
    """Azimuth, ground range and elevation of the pixels of a pass, shape (rows, columns, 3) [m].

    A pixel lies on the ground that the fast image has there. Where it has none, the elevation is that of the nearest
    pixel with ground.
    """
    radar, geometry, scene = made.case.radar, made.geometry, made.scene
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    bare = np.isnan(geometry.ground[0])
    nearest = scipy.ndimage.distance_transform_edt(bare, return_distances=False, return_indices=True)
    height = scipy.ndimage.map_coordinates(scene.elevation_m, geometry.ground[:, *nearest], order=1, mode="nearest")
    rows, columns = geometry.shape
    first = line_of_sight(radar).slant_range_m(geometry.flat_incidence_deg[0])
    slant = first + np.arange(rows)[:, None] * radar.range_spacing_m
    below = scene.elevation_m.mean() + line_of_sight(radar).height_m - height
    azimuth = np.broadcast_to((np.arange(columns) + 0.5) * radar.azimuth_spacing_m, (rows, columns))
    return np.stack([azimuth, np.sqrt(slant**2 - below**2), height], axis=2)


def focused(one: Collection, signal: NDArray[np.complex64], made: Forward) -> NDArray[np.complex64]:
    """Complex looks of a pass, focused from a raw signal on the pixels of the fast image.

    Parameters
    ----------
    one : Collection
        Collection.
    signal : ndarray of complex64, shape (pulses, samples)
        Raw signal.
    made : Forward
        Forward run of the pass.

    Returns
    -------
    ndarray of complex64, shape (looks, rows, columns)
        Amplitude, whose squared magnitude is linear power in the configured radiometry.
    """
    place, radar = image_places(made), made.case.radar
    rows, columns = made.geometry.shape
    looks = np.empty((one.looks, rows, columns), np.complex64)
    sine = 0.25 * one.band * one.wavelength_m
    for first in range(0, columns, _STRIP):
        part = place[:, first : first + _STRIP]
        reach = 1.02 * one.reach_m(float(np.hypot(part[..., 1], one.track_m[0, 2] - part[..., 2]).max()), sine) + 2.0
        a, b = np.searchsorted(one.track_m[:, 0], [part[0, 0, 0] - reach, part[0, -1, 0] + reach])
        some = one.pulses(a, b)
        found = backprojected(some, range_profiles(some, signal[a:b]), part.reshape(-1, 3))
        looks[:, :, first : first + _STRIP] = found.reshape(one.looks, rows, -1)
    level = of_sigma0(radar.radiometry, made.geometry.flat_incidence_deg)
    level /= cell_area_m2(one, made.geometry.flat_incidence_deg)
    return looks * np.sqrt(level).astype(np.float32)[:, None]


def write_focused(stem: Path, made: Forward) -> list[Path]:
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
    from PIL import Image

    one = collection(made.case, made.scene)
    found = scatterers(made.case, made.scene, made.seed, one.facet_m)
    blocks = [converted(block, one.bits) for block in raw_signal(one, found, made.seed)]
    looks = focused(one, np.concatenate(blocks), made)
    paths = [stem.with_suffix(suffix) for suffix in (".h5", ".png")]
    phases = "of the range to the scatterers, -4 pi R / wavelength, relative to the back-projected pixel; speckle alike"
    write_complex(paths[0], made, "focused", looks, one.looks, phases)
    level = np.log10(np.maximum(np.mean(np.abs(looks) ** 2, axis=0), np.finfo(np.float32).tiny))
    black, white = np.quantile(level, [0.01, 0.99])
    gray = np.clip((level - black) / max(white - black, 1e-6) * 255.0, 0.0, 255.0).astype(np.uint8)
    with atomic(paths[1]) as partial:
        Image.fromarray(gray).save(partial, format="PNG")
    return paths
