"""Image formation: computation of complex looks and of a multilooked intensity image from a reflectivity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.compiled import njit, threaded
from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.radar.geometry import PointScatterers, Strip
from radcal.radar.points import add_points, fine_taps, phased
from radcal.radar.reflectivity import Reflectivity, uniform
from radcal.speckle.gaussian import gaussian_row, seed_words
from radcal.speckle.response import beta_share, border_gain, impulse_response

THERMAL = 256  # stream of random numbers for thermal noise; streams 1 to 255 are materials
_TILE = 256  # side of a tile [pixels]; the overlap of neighbouring tiles, a fifth of the work, is computed twice
_PATCH = 64  # side of the smaller tiles [pixels] that are computed again after a change of a law


@threaded
def _touched(
    part: Any, tiles: Any, rows: Any, columns: Any, reach: Any, start: Any, material: Any, changed: Any, found: Any
) -> None:  # fmt: skip
    """Mask of the tiles whose image depends on a material with a changed law or changed parameters."""
    for t in range(part[0], part[1]):
        top, left = max(0, tiles[t, 0] - reach[0]), max(0, tiles[t, 1] - reach[1])
        bottom, right = min(rows, tiles[t, 2] + reach[0]), min(columns, tiles[t, 3] + reach[1])
        hit = False
        for row in range(top, bottom):
            for i in range(start[row * columns + left], start[row * columns + right]):
                hit = hit or changed[material[i]]
            if hit:
                break
        found[t] = hit


@njit()
def _amplitude_row(
    row: Any, left: Any, right: Any, columns: Any, start: Any, material: Any, power: Any, noise: Any, look: Any,
    seed: Any, work: Any, words: Any, parts: Any, first_of_all: Any, out: Any,
) -> None:  # fmt: skip
    """Complex amplitudes of a section of an image row before the filters; real and imaginary parts alternate.

    ``first_of_all`` is the flat index in the whole image of the row's first pixel, which counts the random numbers.
    """
    place, stream = work[0], work[1]
    base = row * columns
    n = right - left
    n_cells = start[base + right] - start[base + left]
    first = start[base + left]
    for column in range(left, right):
        for i in range(start[base + column], start[base + column + 1]):
            place[i - first] = np.uint32(first_of_all + column)
            stream[i - first] = np.uint32(material[i])
    gaussian_row(n_cells, place, stream, look, seed, words, parts[0], parts[1])
    for i in range(2 * n):
        out[i] = np.float32(0.0)
    for i in range(n_cells):
        size = np.sqrt(power[first + i])
        column = 2 * (np.int64(place[i]) - first_of_all - left)
        out[column] += size * parts[0, i]
        out[column + 1] += size * parts[1, i]
    if noise > np.float32(0.0):
        for column in range(n):
            place[column] = np.uint32(first_of_all + left + column)
            stream[column] = np.uint32(THERMAL)
        gaussian_row(n, place, stream, look, seed, words, parts[0], parts[1])
        for column in range(n):
            out[2 * column] += noise * parts[0, column]
            out[2 * column + 1] += noise * parts[1, column]


@njit()
def _filter(source: Any, first: Any, step: Any, taps: Any, out: Any) -> None:
    """Filter an image with symmetric taps: sum of the numbers at ``first`` and each ``step`` after it, by weights.

    ``source`` is flat. A step of one row filters in slant range; a step of 2 filters along a row of complex numbers,
    whose real and imaginary parts alternate.
    """
    reach = taps.size // 2
    n = out.size
    middle, tap = source[first + reach * step : first + reach * step + n], taps[reach]
    for i in range(n):
        out[i] = tap * middle[i]
    # two pairs of taps are applied at a time, so that the line is loaded and stored once for four taps
    pairs = reach - reach % 2
    for k in range(0, pairs, 2):
        low, high = first + k * step, first + (2 * reach - k) * step
        a, d = source[low : low + n], source[high : high + n]
        b, c = source[low + step : low + step + n], source[high - step : high - step + n]
        outer, inner = taps[k], taps[k + 1]
        for i in range(n):
            out[i] = out[i] + (outer * (a[i] + d[i]) + inner * (b[i] + c[i]))
    if reach % 2:
        low, high = first + (reach - 1) * step, first + (reach + 1) * step
        a, d = source[low : low + n], source[high : high + n]
        tap = taps[reach - 1]
        for i in range(n):
            out[i] = out[i] + tap * (a[i] + d[i])


@njit()
def _detect(field: Any, first: Any, power: Any) -> None:
    """Power of a line of complex numbers, written to ``power`` for the first look, and added to it for later looks."""
    for i in range(power.size):
        value = field[2 * i] * field[2 * i] + field[2 * i + 1] * field[2 * i + 1]
        power[i] = value if first else power[i] + value


@threaded
def _form(
    part: Any, tiles: Any, rows: Any, columns: Any, start: Any, material: Any, power: Any, noise: Any, seed: Any,
    first_look: Any, looks: Any, down: Any, across: Any, gain_down: Any, gain_across: Any, most: Any,
    point_rows: Any, point_columns: Any, point_values: Any, fine_down: Any, fine_across: Any, strip: Any,
    intensity: Any, field: Any,
) -> None:  # fmt: skip
    """Image of the given tiles: one complex look in ``field``, or the mean power of the looks in ``intensity``.

    For each tile, random amplitudes are computed and then filtered in slant range and in azimuth (the band limit).
    Amplitudes outside of a tile that are needed by the tile's filters are computed again for this tile, and every sum
    has a fixed order. The value of a pixel therefore depends neither on the choice of tiles nor on the number of
    threads. ``strip`` is the image's first column in the whole image, and the number of columns of the whole image.
    """
    reach_down, reach_across = down.size // 2, across.size // 2
    for t in range(part[0], part[1]):
        top, left, bottom, right = tiles[t]
        outer_left, outer_right = max(0, left - reach_across), min(columns, right + reach_across)
        work = np.empty((2, most), np.uint32)
        words = np.empty((2, most), np.uint32)
        parts = np.empty((2, most), np.float32)
        at_border = left < reach_across or right > columns - reach_across
        # the amplitudes are zero beyond the image's border; the gains compensate the loss of mean power near the border
        amplitude = np.zeros((bottom - top + 2 * reach_down, 2 * (right - left + 2 * reach_across)), np.float32)
        flat = amplitude.reshape(-1)
        line = np.empty(amplitude.shape[1], np.float32)
        result = np.empty(2 * (right - left), np.float32)
        spots = np.zeros((bottom - top if point_rows.size else 0, 2 * (right - left)), np.float32)
        if point_rows.size:  # the points' contribution is the same in every look
            add_points(point_rows, point_columns, point_values, fine_down, fine_across, top, left, spots)
        pad = 2 * (outer_left - (left - reach_across))
        for look in range(first_look, first_look + looks):
            for row in range(max(0, top - reach_down), min(rows, bottom + reach_down)):
                _amplitude_row(
                    row, outer_left, outer_right, columns, start, material, power, noise[row], np.uint32(look), seed,
                    work, words, parts, row * strip[1] + strip[0],
                    amplitude[row - top + reach_down, pad : pad + 2 * (outer_right - outer_left)],
                )  # fmt: skip
            for row in range(top, bottom):
                _filter(flat, (row - top) * line.size, line.size, down, line)
                if gain_down[row] != np.float32(1.0):
                    line *= gain_down[row]
                made = field[row, 2 * left : 2 * right] if field.size else result
                _filter(line, 0, 2, across, made)
                if at_border:
                    made *= gain_across[2 * left : 2 * right]
                if spots.size:
                    made += spots[row - top]
                if not field.size:
                    _detect(made, look == first_look, intensity[row, left:right])


def _tiles(shape: tuple[int, int], side: int) -> NDArray[np.int64]:
    """First row and column of each tile of an image, and the row and column after its last; shape (tiles, 4)."""
    tops, lefts = (np.arange(0, n, side) for n in shape)
    corners = np.stack(np.meshgrid(tops, lefts, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.hstack([corners, np.minimum(corners + side, shape)])


def _runs(tiles: NDArray[np.int64], longest: int) -> NDArray[np.int64]:
    """Wider tiles, at most ``longest`` columns wide, made by joining tiles that are neighbours in azimuth."""
    runs: list[list[int]] = []
    for top, left, bottom, right in tiles.tolist():
        if runs and runs[-1][0] == top and runs[-1][3] == left and right - runs[-1][1] <= longest:
            runs[-1][3] = right
        else:
            runs.append([top, left, bottom, right])
    return np.array(runs, dtype=np.int64).reshape(-1, 4)


class ImageFormation:
    """Computation of complex looks and multilooked intensity from a reflectivity, with common random numbers.

    Each look is h * (sum over materials of sqrt(P_m) u_m + sqrt(nesz) v + sum over points of a_p d_p), where * is the
    convolution. P_m is the expected power of material m, and nesz is the noise power. u_m and v are white circular
    Gaussian noise: u_m has one number for each pixel and material, and v (thermal noise) has one number for each pixel.
    h is the impulse response, of unit energy. Beyond the image's border nothing is simulated; near the border, speckle
    and noise are scaled so that their mean power is the same as elsewhere. Thermal noise is added before detection and
    passes through the same band limit as the echo. d_p is an impulse at the position of point scatterer p, and a_p is
    the complex amplitude of p, which is the same in every look. The intensity is the mean power of the looks.

    Parameters
    ----------
    radar : Radar
        Pass with its resolutions, pixel spacings and number of looks.
    shape : (int, int)
        Number of slant-range rows and of azimuth columns.
    noise_db : float or ndarray, shape (rows,)
        Noise floor of each row [dB].
    points : PointScatterers, optional
        Point scatterers of the scene.
    strip : Strip, optional
        Position in the whole image, if the image is a strip of it with its halo. The columns of the strip are bit for
        bit those of the whole image; those of the halo are not.

    Attributes
    ----------
    looks : int
        Number of looks, rounded up to a whole number.

    Raises
    ------
    ConfigError
        A resolution is too fine for the pixel spacing.
    """

    def __init__(
        self,
        radar: Radar,
        shape: tuple[int, int],
        noise_db: ArrayLike,
        points: PointScatterers | None = None,
        strip: Strip | None = None,
    ) -> None:
        for axis in ("range", "azimuth"):
            resolution = getattr(radar, f"{axis}_resolution_m")
            finest = WIDTH_FACTOR * getattr(radar, f"{axis}_spacing_m")
            if resolution < finest * (1 - 1e-9):
                raise ConfigError(
                    f"radar.{axis}_resolution_m is {resolution:g}, expected at least {finest:.2f} at a spacing of "
                    f"{getattr(radar, f'{axis}_spacing_m'):g} m (the image must be sampled above its bandwidth)."
                )
        self.looks = math.ceil(radar.looks)
        self._radar = radar
        self._shape = shape
        self._down = impulse_response(radar.range_resolution_m, radar.range_spacing_m).astype(np.float32)
        self._across = impulse_response(radar.azimuth_resolution_m, radar.azimuth_spacing_m).astype(np.float32)
        self._strip = strip or Strip.whole(shape[1])
        across = border_gain(self._across, self._strip.columns)[self._strip.left : self._strip.right]
        self._gain_down, self._gain_across = border_gain(self._down, shape[0]), across
        self._points = PointScatterers.none() if points is None else points
        self._fine_down = self._fine_across = np.empty(0, dtype=np.float32)
        if self._points.row.size:  # fine taps take longer than a small image
            self._fine_down = fine_taps(radar.range_resolution_m, radar.range_spacing_m)
            self._fine_across = fine_taps(radar.azimuth_resolution_m, radar.azimuth_spacing_m)
        self._noise = np.broadcast_to(10.0 ** (np.asarray(noise_db) / 20.0), shape[0]).astype(np.float32)
        self._tiles = _tiles(shape, _TILE)

    def intensity(
        self, reflectivity: Reflectivity, noise_seed: int, before: NDArray[np.float32] | None = None,
        tiles: NDArray[np.int64] | None = None,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Multilooked intensity: mean power of the looks. A number of looks that is not whole is rounded up.

        Parameters
        ----------
        reflectivity : Reflectivity
            Expected power of every pixel and material.
        noise_seed : int
            Seed of speckle and thermal noise.
        before, tiles : ndarray, optional
            Earlier image of the same seed, and the tiles of this image, from :meth:`touched`, that are computed again
            in place.

        Returns
        -------
        ndarray of float32, shape (rows, columns)
            Intensity [linear power].
        """
        image = np.empty(self._shape, dtype=np.float32) if before is None else before
        self._run(reflectivity, noise_seed, 0, self.looks, self._tiles if tiles is None else tiles, image, None)
        return image

    def expected(self, reflectivity: Reflectivity) -> NDArray[np.float64]:
        """Expected intensity: mean of :meth:`intensity` over speckle and thermal noise, without point scatterers.

        Parameters
        ----------
        reflectivity : Reflectivity
            Expected power of every pixel and material.

        Returns
        -------
        ndarray, shape (rows, columns)
            Expected intensity with noise [linear power].
        """
        power = reflectivity.image + np.square(self._noise, dtype=np.float64)[:, None]
        power = scipy.ndimage.convolve1d(power, np.square(self._down, dtype=np.float64), axis=0, mode="constant")
        power = scipy.ndimage.convolve1d(power, np.square(self._across, dtype=np.float64), axis=1, mode="constant")
        return np.asarray(power * np.square(self._gain_down)[:, None] * np.square(self._gain_across))

    def look(self, reflectivity: Reflectivity, noise_seed: int, look: int = 0) -> NDArray[np.complex64]:
        """One complex look, shape (rows, columns) [linear amplitude]."""
        field = np.empty((self._shape[0], 2 * self._shape[1]), dtype=np.float32)
        self._run(reflectivity, noise_seed, look, 1, self._tiles, np.empty((0, 0), dtype=np.float32), field)
        return field.view(np.complex64)

    def thinning(self, noise_seed: int) -> NDArray[np.float32] | None:
        """Factors that reduce the rounded-up number of looks of :meth:`intensity` to the configured number of looks.

        A gamma variate of shape n, times an independent beta variate of the shapes L and n - L, is a gamma variate of
        shape L. L is the configured number of looks, and n is L rounded up. The beta variates are computed from the
        power of one further look at uniform ground without noise. The beta variates therefore have the spatial
        correlation of speckle.

        Parameters
        ----------
        noise_seed : int
            Seed of speckle and thermal noise.

        Returns
        -------
        ndarray of float32, shape (rows, columns), or None
            Factors of mean 1; None for a whole number of looks.

        References
        ----------
        Johnson, Kotz and Balakrishnan, "Continuous Univariate Distributions" (2nd edition, 1994), section 17.8.
        """
        whole, looks = self.looks, float(self._radar.looks)
        if looks == whole:
            return None
        even = ImageFormation(self._radar, self._shape, -np.inf, strip=self._strip)
        field = even.look(uniform(np.ones(self._shape, dtype=np.float32)), noise_seed, whole)
        return beta_share(np.abs(field) ** 2, looks, whole)

    def touched(self, reflectivity: Reflectivity, changed: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Tiles affected by materials with a changed law, shape (tiles, 4); ``changed`` is a mask of material ids."""
        patches = _tiles(self._shape, _PATCH)
        found = np.empty(len(patches), dtype=np.bool_)
        reach = np.array([len(self._down) // 2, len(self._across) // 2])
        _touched(len(patches), patches, *self._shape, reach, reflectivity.start, reflectivity.material, changed, found)
        return _runs(patches[found], _TILE)

    def _run(
        self, reflectivity: Reflectivity, noise_seed: int, first: int, looks: int, tiles: NDArray[np.int64],
        intensity: NDArray[np.float32], field: NDArray[np.float32] | None,
    ) -> None:  # fmt: skip
        rows, columns = self._shape
        across, points = self._across, phased(self._points, noise_seed)
        if field is None:  # the mean is the sum over looks with amplitudes divided by sqrt(looks)
            share = np.float32(np.sqrt(looks))
            field, across, points = np.empty((0, 0), dtype=np.float32), across / share, points / share
        stretch, gain_across = _TILE + len(self._across), np.repeat(self._gain_across, 2)  # of real and imaginary parts
        # space for the random numbers of the longest part of a row
        most = int(np.diff(reflectivity.start).max(initial=1))
        _form(
            len(tiles), tiles, rows, columns, reflectivity.start, reflectivity.material, reflectivity.power,
            self._noise, seed_words(noise_seed), first, looks, self._down, across, self._gain_down, gain_across,
            stretch * max(1, most), self._points.row, self._points.column, points,
            self._fine_down, self._fine_across, (self._strip.left, self._strip.columns), intensity, field,
        )  # fmt: skip


def decibels(power: NDArray[np.float32]) -> NDArray[np.float32]:
    """Power in dB; zero power is replaced by the smallest normal number of single precision."""
    return np.asarray(10.0 * np.log10(np.maximum(power, np.finfo(np.float32).tiny)), dtype=np.float32)
