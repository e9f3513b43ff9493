"""Collection: where the radar is at each pulse, where its beam points, its frequencies and its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.bands import WIDTH_FACTOR, limits_ghz
from radcal.config import Radar
from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.radar.earth import line_of_sight
from radcal.radar.radiometry import nesz_db
from radcal.scene.model import Scene
from radcal.sections.ppi import Ppi
from radcal.sections.radar import Signals
from radcal.seeds import derived_rng
from radcal.speckle.response import taylor_weights

LIGHT_MPS = 299_792_458.0
BEAM = 4096
"""Intervals of the table of the beam, from null to null."""
_NOISE_W_PER_HZ = 1.380649e-23 * 290.0  # thermal noise at the temperature of noise figures (IEEE Std 686-2017)
_GUARD = 1.1  # ratio of the pulse rate to the least one, and of the window of slant range to the swath
_LONGEST = 0.8  # largest place in the beam, from its middle to its null, of what is focused; it is 25 dB down there
_PARTS = 4096  # of the processed band of azimuth frequencies
_WIDEST = 0.9  # largest sine of an angle from zero Doppler

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Collection:
    """Pulses, frequencies, beam and noise of a collection.

    Attributes
    ----------
    track_m : ndarray, shape (pulses, 3)
        Position of the antenna at each pulse [m].
    reference_m : ndarray, shape (pulses, 3)
        Ground point at each pulse whose echo has the phase 0: in the middle of the swath, where the beam points [m].
    prf_hz, speed_mps : float
        Pulse rate and speed of the platform.
    carrier_hz, step_hz : float
        Middle frequency, and distance between two frequencies.
    samples : int
        Number of frequencies.
    antenna_m : float
        Length of the antenna along the track.
    band : float
        Processed band of azimuth frequencies of all looks together [cycles/m].
    looks : int
        Number of looks, which are equal parts of the processed band.
    range_m : float
        Distance to the middle of the swath, at which amplitudes are the square root of the cross-section [m].
    noise_m2 : float
        Mean power of the noise in a sample, as the cross-section with this power at ``range_m`` [m2].
    bits : int or None
        Bits of the analogue-to-digital conversion of each real number; None for none.
    middle_sine : float
        Sine of the angle from zero Doppler in the middle of the processed band, positive ahead.
    spot_m : ndarray, shape (3,), or None
        Place to which the beam points at all pulses (spotlight); None for a beam of constant direction (stripmap).
    side : float
        1 if ground range grows to the east of the scene's grid, -1 if it grows to the west.
    nadir_m : float
        Place of the nominal track, to the east of the corner of the scene's grid [m].
    """

    track_m: Doubles
    reference_m: Doubles
    prf_hz: float
    speed_mps: float
    carrier_hz: float
    step_hz: float
    samples: int
    antenna_m: float
    band: float
    looks: int
    range_m: float
    noise_m2: float
    bits: int | None = None
    middle_sine: float = 0.0
    spot_m: Doubles | None = None
    side: float = 1.0
    nadir_m: float = 0.0

    @property
    def wavelength_m(self) -> float:
        """Wavelength of the carrier [m]."""
        return LIGHT_MPS / self.carrier_hz

    @property
    def frequency_hz(self) -> Doubles:
        """Frequencies of the samples, shape (samples,)."""
        return np.asarray(self.carrier_hz + (np.arange(self.samples) - self.samples // 2) * self.step_hz)

    @property
    def middle_hz(self) -> float:
        """Middle of the band; for an even number of frequencies it is half a step below the carrier."""
        return 0.5 * float(self.frequency_hz[0] + self.frequency_hz[-1])

    @cached_property
    def distance_m(self) -> Doubles:
        """Distance from the antenna to the reference point of each pulse, shape (pulses,)."""
        return np.asarray(np.linalg.norm(self.track_m - self.reference_m, axis=1))

    @cached_property
    def aim(self) -> Doubles:
        """Sine of the angle from zero Doppler at which the beam points, shape (pulses,)."""
        if self.spot_m is None:
            return np.full(len(self.track_m), self.middle_sine)
        line = self.spot_m - self.track_m
        return np.asarray(line[:, 0] / np.linalg.norm(line, axis=1))

    @property
    def sines(self) -> float:
        """Width of the processed band, in sines of the angle from zero Doppler."""
        return 0.5 * self.band * self.wavelength_m

    @property
    def gate_m(self) -> float:
        """Slant range from gate to gate, of which there are as many as frequencies [m]."""
        return LIGHT_MPS / (2.0 * self.samples * self.step_hz)

    @cached_property
    def weights(self) -> Doubles:
        """Taylor's weights of the frequencies, of mean 1, shape (samples,)."""
        return taylor_weights((np.arange(self.samples) + 0.5) / self.samples - 0.5)

    @property
    def null(self) -> float:
        """Sine of the angle from the middle of the beam to its null."""
        return self.wavelength_m / self.antenna_m

    def pattern(self, sine: Doubles) -> Doubles:
        """Two-way amplitude of a uniformly lit antenna by the sine from its middle; 0 from the null on.

        References
        ----------
        Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data" (2005), section 4.3.
        """
        return np.where(np.abs(sine) < self.null, np.sinc(sine / self.null) ** 2, 0.0)

    @property
    def beam(self) -> NDArray[np.float32]:
        """The pattern at ``BEAM`` + 1 even sines, from null to null."""
        return self.pattern(np.linspace(-1.0, 1.0, BEAM + 1) * self.null).astype(np.float32)

    @property
    def facet_m(self) -> float:
        """Largest length of a facet along the track: looks are independent only if they resolve no facet."""
        return min(0.5 * WIDTH_FACTOR * self.looks / self.band, 1.0 / self.band)

    def of_grid(self, place_m: NDArray[np.floating[Any]]) -> Doubles:
        """Azimuth, ground range and elevation of places to the east and north of the grid's corner, shape (n, 3)."""
        east, north, up = place_m.T
        return np.stack([north, self.side * (east - self.nadir_m), up], axis=1)

    def pulses(self, first: int, last: int) -> Collection:
        """Collection of the pulses from ``first`` to ``last - 1`` alone."""
        return replace(self, track_m=self.track_m[first:last], reference_m=self.reference_m[first:last])

    def places_m(self, near_m: float, far_m: float, sines: float) -> tuple[float, float]:
        """Places along the track, relative to the antenna, that are seen in a band of sines around the beam's middle.

        Parameters
        ----------
        near_m, far_m : float
            Least and largest slant range at zero Doppler [m].
        sines : float
            Width of the band.

        Returns
        -------
        first, last : float
            Place farthest behind, and farthest ahead [m]; without bounds if the beam follows a place.
        """
        if self.spot_m is not None:
            return -math.inf, math.inf
        low, high = (tangent(self.middle_sine + side * sines) for side in (-0.5, 0.5))
        return min(low * near_m, low * far_m), max(high * near_m, high * far_m)


def tangent(sine: float) -> float:
    """Tangent of an angle by its sine."""
    return sine / math.sqrt(1.0 - sine**2)


def carrier_hz(radar: Radar) -> float:
    """Carrier frequency of a pass: ``radar.frequency_ghz``, by default the middle of its band."""
    if radar.frequency_ghz is not None:
        return radar.frequency_ghz * 1e9
    if (limits := limits_ghz(radar.band)) is not None:
        return 0.5e9 * sum(limits)
    raise ConfigError(f"radar.band is {radar.band!r}, which names no known band, expected radar.frequency_ghz with it.")


def pulse_snr_m2(config: Signals | Ppi, wavelength_m: float) -> float:
    """Signal-to-noise ratio of the echo of 1 m2 at 1 m in one pulse [m2], in a receiver that is matched to the pulse.

    Parameters
    ----------
    config : Signals or Ppi
        Section with power, length of the pulse, gain of the antenna and noise figure. With a matched filter the energy
        of the pulse counts, not its bandwidth.
    wavelength_m : float
        Wavelength [m].

    References
    ----------
    Richards, "Fundamentals of Radar Signal Processing", 2nd edition, McGraw-Hill (2014), section 2.2.
    """
    assert config.power_w is not None  # noqa: S101 - asked for with a power
    gain, figure = (10.0 ** (db / 10.0) for db in (config.gain_db, config.noise_figure_db))
    energy_j = config.power_w * config.pulse_us * 1e-6 * (gain * wavelength_m) ** 2 / (4.0 * math.pi) ** 3
    return float(energy_j / (_NOISE_W_PER_HZ * figure))


def azimuth_weights(one: Collection) -> tuple[Doubles, Doubles]:
    """Weights of pulses over the processed band of azimuth frequencies: Taylor's for each look, and beam.

    Parameters
    ----------
    one : Collection
        Collection.

    Returns
    -------
    weights, beam : ndarray, shape (4096,)
        Weights of mean 1, and two-way amplitude of the beam on a place in the middle of the scene.
    """
    place = (np.arange(_PARTS) + 0.5) / _PARTS
    beam = one.pattern((place - 0.5) * one.sines) if one.spot_m is None else np.ones(_PARTS)
    return taylor_weights(place * one.looks % 1.0 - 0.5), beam


def nesz(one: Collection, slant_m: ArrayLike, incidence_deg: ArrayLike) -> Doubles:
    """Noise-equivalent sigma0 of a look of the focused image [linear].

    Parameters
    ----------
    one : Collection
        Collection.
    slant_m : array_like
        Slant range at zero Doppler [m].
    incidence_deg : array_like
        Incidence on level ground there [deg].

    Returns
    -------
    ndarray
        Mean power of the noise divided by that of ground with a sigma0 of 1. Both go through the same weights; the
        division by the beam raises the noise alone.
    """
    weights, beam = azimuth_weights(one)
    loss, cosine = np.mean((weights / beam) ** 2) / np.mean(weights**2), math.sqrt(1.0 - one.middle_sine**2)
    slant = np.asarray(slant_m) / cosine
    pulses = one.sines * slant / cosine**2 * one.prf_hz / one.speed_mps
    cells = one.band / one.gate_m / cosine * np.sin(np.radians(incidence_deg))
    return np.asarray(one.noise_m2 * (slant / one.range_m) ** 4 * loss * cells / (pulses * one.samples))


def collection(case: Part, scene: Scene) -> Collection:
    """Collection of a pass over a scene, from the sections ``radar`` and ``signals``.

    Parameters
    ----------
    case : Part
        Configuration of the pass.
    scene : Scene
        Scene, which gives the length of the track and the swath.

    Raises
    ------
    ConfigError
        The scene has no relief, the earth is curved, or the pulse rate or the antenna does not suit beam and swath.
    """
    radar, signals = case.radar, case.signals
    if scene.elevation_m is None:
        raise ConfigError("scene.source: the scene has no elevation, expected one with elevation for raw signals.")
    if radar.earth != "flat":
        raise ConfigError(f"radar.earth is {radar.earth}, expected flat for raw signals.")
    looks, carrier, seen = math.ceil(radar.looks), carrier_hz(radar), line_of_sight(radar)
    near, middle, far = slant = _slant_m(radar, scene)
    wavelength, band = LIGHT_MPS / carrier, looks * WIDTH_FACTOR / radar.azimuth_resolution_m
    squint, spotlight = math.sin(math.radians(signals.squint_deg)), signals.mode == "spotlight"
    cosine, mean = math.sqrt(1.0 - squint**2), float(scene.elevation_m.mean())
    length, width = (cells * scene.cell_m for cells in scene.material.shape)
    antenna, prf = _antenna_and_prf(case, slant, length, wavelength, 0.25 * band * wavelength)
    spacing, ends = signals.speed_mps / prf, [tangent(squint + side * 0.25 * band * wavelength) for side in (-1, 1)]
    ranges = (middle,) if spotlight else (near, far)
    first, last = (0.5 * length, 0.5 * length) if spotlight else (0.0, length)
    along = np.arange(
        first - max(r * ends[1] for r in ranges), last - min(r * ends[0] for r in ranges) + spacing, spacing
    )
    track = np.stack([along, np.zeros_like(along), np.full_like(along, mean + seen.height_m)], axis=1)
    aimed = np.full_like(along, 0.5 * length) if spotlight else along + middle * tangent(squint)
    reference = np.stack([aimed, np.full_like(along, seen.ground_m), np.full_like(along, mean)], axis=1)
    distance = np.linalg.norm(track - reference, axis=1)
    if spotlight:
        places = np.linspace(0.0, length, 9)[:, None] - along
        away = np.array([np.hypot(places, r) - distance for r in (near, far)])
    else:
        wide = wavelength / antenna
        least, most = max(abs(squint) - wide, 0.0), abs(squint) + wide
        away = np.array([near / math.sqrt(1.0 - least**2), far / math.sqrt(1.0 - most**2)])
        away -= distance[0]
    track[:, 1:] += _motion(along.size, signals.motion_m, signals.motion_length_m / spacing, case.seed)
    around = _GUARD * (np.abs(away).max() + 5.0 * signals.motion_m) + 8.0 * radar.range_resolution_m
    bandwidth = 0.5 * LIGHT_MPS * WIDTH_FACTOR / radar.range_resolution_m
    samples = math.ceil(4.0 * around * bandwidth / LIGHT_MPS)
    side = 1.0 if radar.look_side == "right" else -1.0
    nadir = 0.5 * width - side * seen.ground_m
    one = Collection(
        track, reference, prf, signals.speed_mps, carrier, bandwidth / samples, samples, antenna, band, looks,
        middle / cosine, 1.0, signals.bits, squint, reference[0] if spotlight else None, side, nadir,
    )  # fmt: skip
    if signals.power_w is None:
        incidence = 90.0 - radar.depression_deg
        floor = 10.0 ** (nesz_db(radar, incidence) / 10.0)
        return replace(one, noise_m2=float(floor / nesz(one, middle, incidence)))
    return replace(one, noise_m2=samples * one.range_m**4 / pulse_snr_m2(signals, wavelength))


def _slant_m(radar: Radar, scene: Scene) -> tuple[float, float, float]:
    """Slant ranges at zero Doppler of the nearest place of a scene, of its middle and of its farthest place [m]."""
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    seen, half = line_of_sight(radar), 0.5 * scene.elevation_m.shape[1] * scene.cell_m
    height = 0.0 if scene.objects is None else float(scene.objects.height_m.max(initial=0.0))
    track = seen.height_m + float(scene.elevation_m.mean())
    near = math.hypot(track - float(scene.elevation_m.max()) - height, seen.ground_m - half)
    far = math.hypot(track - float(scene.elevation_m.min()), seen.ground_m + half)
    return near, math.hypot(seen.height_m, seen.ground_m), far


def _antenna_and_prf(
    case: Part, slant_m: tuple[float, float, float], length_m: float, wavelength: float, half: float
) -> tuple[float, float]:
    """Length of the antenna [m] and pulse rate [Hz] for a band of ``half`` in sines to either side of its middle."""
    signals, squint, (near, middle, far) = case.signals, math.sin(math.radians(case.signals.squint_deg)), slant_m
    edge, what = half, "radar.looks and radar.azimuth_resolution_m"
    if signals.mode == "spotlight":  # the beam holds the scene, whose corners are the farthest from its middle
        along = middle * tangent(squint) + np.array([[-0.5], [0.5]]) * length_m
        edge = float(np.abs(along / np.hypot(along, [near, far]) - squint).max())
        what = "the scene"
    antenna = signals.antenna_m or 0.5 * wavelength / edge
    if antenna * edge > _LONGEST * wavelength:
        raise ConfigError(
            f"signals.antenna_m is {antenna:g}, whose beam is too narrow for {what}, expected at most "
            f"{_LONGEST * wavelength / edge:.3g}."
        )
    widest = abs(squint) + max(half, wavelength / antenna)
    if widest > _WIDEST:
        raise ConfigError(
            f"signals.squint_deg is {signals.squint_deg:g}: the sine of the largest angle from zero Doppler in band "
            f"and beam is {widest:.2f}, expected at most {_WIDEST:g}."
        )
    least_hz = 2.0 * signals.speed_mps * (edge / wavelength + 1.0 / antenna)
    prf = signals.prf_hz or _GUARD * least_hz
    swath = (far - near) / math.sqrt(1.0 - squint**2)
    check_prf("signals", prf, least_hz, "that folds into the image", signals.speed_mps, swath)
    return antenna, prf


def check_prf(section: str, prf_hz: float, least_hz: float, part: str, speed_mps: float, swath_m: float) -> None:
    """Raise an error if the pulse rate of a section does not suit beam and swath.

    Parameters
    ----------
    section : str
        Section with the key ``prf_hz``.
    prf_hz, least_hz : float
        Pulse rate, and the band of the beam that it must hold.
    part : str
        Which part of the beam that is.
    speed_mps, swath_m : float
        Speed of the platform, and length of the swath in slant range.
    """
    if prf_hz < least_hz:
        raise ConfigError(
            f"{section}.prf_hz is {prf_hz:g}, below the band of the beam {part}, expected at least "
            f"{math.ceil(least_hz)} at signals.speed_mps {speed_mps:g}."
        )
    if swath_m > (unambiguous := LIGHT_MPS / (2.0 * prf_hz)):
        raise ConfigError(
            f"{section}.prf_hz is {prf_hz:g}: the swath of {swath_m:.0f} m in slant range is beyond the unambiguous "
            f"range of {unambiguous:.0f} m, expected at most {LIGHT_MPS / (2.0 * swath_m):.0f}."
        )


def _motion(pulses: int, rms_m: float, length: float, seed: int) -> Doubles:
    """Smooth random displacement of the track across its direction, in ground range and height, shape (pulses, 2)."""
    if rms_m == 0.0:
        return np.zeros((pulses, 2))
    white = derived_rng(seed, "motion").standard_normal((pulses, 2))
    smooth = scipy.ndimage.gaussian_filter1d(white, length, axis=0, mode="reflect")
    # the variance that the kernel leaves of white noise, whose squared taps sum to 1 / (2 sqrt(pi) length)
    return np.asarray(rms_m * math.sqrt(2.0 * math.sqrt(math.pi) * length) * smooth)
