"""Coherent point scatterers at sub-pixel positions in the image."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.compiled import njit
from radcal.config import Radar
from radcal.radar.geometry import PointScatterers
from radcal.speckle.gaussian import philox, seed_words
from radcal.speckle.response import impulse_response

FINENESS = 64  # taps of the impulse response per pixel; linear interpolation between them errs by 2e-4 of the peak
_LOBE = 1.5  # distance from the peak of the impulse response to its first null, in -3 dB widths
_PHASE = 257  # stream of random numbers for the points' phases; streams 1 to 255 are materials, 256 is thermal noise


@lru_cache(maxsize=8)
def fine_taps(resolution_m: float, spacing_m: float) -> NDArray[np.float32]:
    """Impulse response, sampled at ``FINENESS`` positions in each pixel.

    Parameters
    ----------
    resolution_m : float
        -3 dB width of the impulse response after weighting [m].
    spacing_m : float
        Pixel spacing [m].

    Returns
    -------
    ndarray of float32, shape (2 m + 1,)
        Taps in steps of 1 / ``FINENESS`` pixels; the middle tap is the peak. For a point at any position, the squares
        of its taps at the pixel centres sum to 1, so that a point has the power of clutter with the same cross-section.
    """
    return np.asarray(impulse_response(resolution_m, spacing_m / FINENESS) * np.sqrt(FINENESS), dtype=np.float32)


@njit()
def _phases(number: Any, k0: Any, k1: Any, amplitude: Any, out: Any) -> None:
    for i in range(number.size):
        word, _, _, _ = philox(number[i], np.uint32(_PHASE), np.uint32(0), np.uint32(0), k0, k1)
        turn = 2.0 * np.pi * (np.float64(word) + 0.5) / 2.0**32
        out[i, 0] = amplitude[i] * np.cos(turn)
        out[i, 1] = amplitude[i] * np.sin(turn)


def phased(points: PointScatterers, noise_seed: int) -> NDArray[np.float32]:
    """Real and imaginary parts of the points' amplitudes, with random phases; shape (n, 2).

    The phase of a point is a uniformly distributed random number, computed from the noise seed and the object's number.
    The phase is the same in every look, so that the echo of a point does not fluctuate between looks.
    """
    out = np.empty((points.row.size, 2), dtype=np.float32)
    _phases(points.number, *seed_words(noise_seed), points.amplitude, out)
    return out


@njit(inline="always")
def _tap(taps: Any, offset: Any) -> Any:
    """Impulse response at an offset from its peak [pixels], interpolated between taps; 0 beyond the last tap."""
    place = offset * FINENESS + taps.size // 2
    k = int(np.floor(place))
    if k < 0 or k + 1 >= taps.size:
        return np.float32(0.0)
    part = np.float32(place - k)
    return (np.float32(1.0) - part) * taps[k] + part * taps[k + 1]


@njit()
def add_points(rows: Any, columns: Any, values: Any, down: Any, across: Any, top: Any, left: Any, out: Any) -> None:
    """Add the echoes of point scatterers to a part of a look.

    Parameters
    ----------
    rows, columns : ndarray of float64, shape (n,)
        Positions of the points in the whole image [pixels], sorted by row.
    values : ndarray of float32, shape (n, 2)
        Real and imaginary parts of the points' amplitudes.
    down, across : ndarray of float32
        Impulse response in slant range and in azimuth, from :func:`fine_taps`.
    top, left : int
        First row and column of the part.
    out : ndarray of float32, shape (height, 2 width)
        Part of the look, real and imaginary parts interleaved, to which the points are added.
    """
    height, width = out.shape[0], out.shape[1] // 2
    reach_down, reach_across = down.size // 2 // FINENESS + 1, across.size // 2 // FINENESS + 1
    for i in range(np.searchsorted(rows, top - reach_down), np.searchsorted(rows, top + height + reach_down)):
        row, column = int(np.floor(rows[i])) - top, int(np.floor(columns[i])) - left
        first, last = max(0, column - reach_across), min(width, column + reach_across + 2)
        for r in range(max(0, row - reach_down), min(height, row + reach_down + 2)):
            # offsets are computed in pixels of the whole image, not of the part, so that rounding does not depend on
            # the part's first pixel
            tap = _tap(down, top + r - rows[i])
            for c in range(first, last):
                size = tap * _tap(across, left + c - columns[i])
                out[r, 2 * c] += size * values[i, 0]
                out[r, 2 * c + 1] += size * values[i, 1]


def not_pure(points: PointScatterers, radar: Radar, material: NDArray[np.uint8]) -> None:
    """Set the material id of all pixels in the main lobe of a point scatterer to 0 (mixed), in place.

    Beyond the main lobe, the response of a point is below the sidelobe level of -35 dB.
    """
    resolution_m = np.array([radar.range_resolution_m, radar.azimuth_resolution_m])
    lobe = _LOBE * resolution_m / (radar.range_spacing_m, radar.azimuth_spacing_m)
    places = np.stack([points.row, points.column], axis=1)
    first = np.maximum(np.ceil(places - lobe), 0.0).astype(np.int64)
    end = np.maximum(np.floor(places + lobe) + 1.0, 0.0).astype(np.int64)
    for (top, left), (bottom, right) in zip(first.tolist(), end.tolist(), strict=True):
        material[top:bottom, left:right] = 0
