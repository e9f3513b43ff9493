"""Stripmap collection: where the radar is at each pulse, its frequencies, its beam and its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.bands import LETTER_BANDS_GHZ, WIDTH_FACTOR, same_label
from radcal.config import Radar
from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.radar.earth import line_of_sight
from radcal.radar.radiometry import noise_floor_db
from radcal.scene.model import Scene
from radcal.seeds import derived_rng
from radcal.speckle.response import taylor_weights

LIGHT_MPS = 299_792_458.0
_NOISE_W_PER_HZ = 1.380649e-23 * 290.0  # thermal noise at the standard temperature of noise figures
_GUARD = 1.1  # ratio of the pulse rate to the least one, and of the window of slant range to the swath
_LONGEST = 3.2  # largest product of antenna and processed band, at whose edges the beam is 25 dB down; 4 at its nulls

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Collection:
    """Pulses, frequencies, beam and noise of a stripmap collection.

    Attributes
    ----------
    track_m : ndarray, shape (pulses, 3)
        Position of the antenna at each pulse [m].
    reference_m : ndarray, shape (pulses, 3)
        Ground point at each pulse whose echo has the phase 0: in the middle of the swath, at zero Doppler [m].
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
        Slant range in the middle of the swath at which amplitudes are the square root of the cross-section [m].
    noise_m2 : float
        Mean power of the noise in a sample, as the cross-section with this power at ``range_m`` [m2].
    bits : int or None
        Bits of the analogue-to-digital conversion of each real number; None for none.
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

    @property
    def facet_m(self) -> float:
        """Largest length of a facet along the track: looks are independent only if they resolve no facet."""
        return min(0.5 * WIDTH_FACTOR * self.looks / self.band, 1.0 / self.band)

    def pulses(self, first: int, last: int) -> Collection:
        """Collection of the pulses from ``first`` to ``last - 1`` alone."""
        return replace(self, track_m=self.track_m[first:last], reference_m=self.reference_m[first:last])

    def reach_m(self, slant_m: float, sine: float) -> float:
        """Distance along the track over which a place is seen at angles from zero Doppler up to a sine [m]."""
        return slant_m * sine / math.sqrt(1.0 - sine**2)


def pattern(sine: Doubles, antenna_m: float, wavelength_m: float) -> Doubles:
    """Two-way amplitude of a uniformly lit antenna, by the sine of the angle from zero Doppler; 0 beyond the main lobe.

    References
    ----------
    Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data" (2005), section 4.3.
    """
    places = np.asarray(sine) * antenna_m / wavelength_m
    return np.where(np.abs(places) < 1.0, np.sinc(places) ** 2, 0.0)


def carrier_hz(radar: Radar) -> float:
    """Carrier frequency of a pass: ``radar.frequency_ghz``, by default the middle of its band."""
    if radar.frequency_ghz is not None:
        return radar.frequency_ghz * 1e9
    for label, (low, high) in LETTER_BANDS_GHZ.items():
        if same_label(radar.band, label):
            return 0.5e9 * (low + high)
    raise ConfigError(f"radar.band is {radar.band!r}, which names no known band, expected radar.frequency_ghz with it.")


def azimuth_weights(one: Collection, size: int = 4096) -> tuple[Doubles, Doubles]:
    """Weights of pulses over the processed band of azimuth frequencies: Taylor's for each look, and beam.

    Parameters
    ----------
    one : Collection
        Collection.
    size : int
        Number of equal parts of the processed band.

    Returns
    -------
    weights, beam : ndarray, shape (size,)
        Weights of mean 1, and two-way amplitude of the beam.
    """
    place = (np.arange(size) + 0.5) / size
    beam = pattern((place - 0.5) * one.band * one.wavelength_m / 2.0, one.antenna_m, one.wavelength_m)
    return taylor_weights(place * one.looks % 1.0 - 0.5), beam


def nesz(one: Collection, slant_m: float, incidence_deg: float) -> float:
    """Noise-equivalent sigma0 of a look of the focused image [linear].

    Parameters
    ----------
    one : Collection
        Collection.
    slant_m : float
        Slant range [m].
    incidence_deg : float
        Incidence on level ground there [deg].

    Returns
    -------
    float
        Mean power of the noise divided by that of ground with a sigma0 of 1. Both go through the same weights; the
        division by the beam raises the noise alone.
    """
    weights, beam = azimuth_weights(one)
    loss = np.mean((weights / beam) ** 2) / np.mean(weights**2)
    pulses = 0.5 * one.band * one.wavelength_m * slant_m * one.prf_hz / one.speed_mps
    cells = 2.0 * one.samples * one.step_hz / LIGHT_MPS * one.band * np.sin(np.radians(incidence_deg))
    return float(one.noise_m2 * (slant_m / one.range_m) ** 4 * loss * cells / (pulses * one.samples))


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
    looks, carrier = math.ceil(radar.looks), carrier_hz(radar)
    wavelength, band = LIGHT_MPS / carrier, math.ceil(radar.looks) * WIDTH_FACTOR / radar.azimuth_resolution_m
    antenna = signals.antenna_m or 2.0 / band
    if antenna * band > _LONGEST:
        raise ConfigError(
            f"signals.antenna_m is {antenna:g}, whose beam is too narrow for radar.looks {radar.looks:g} of "
            f"radar.azimuth_resolution_m {radar.azimuth_resolution_m:g}, expected at most {_LONGEST / band:.3g}."
        )
    least_hz = signals.speed_mps * (0.5 * band + 2.0 / antenna)
    prf = signals.prf_hz or _GUARD * least_hz
    if prf < least_hz:
        raise ConfigError(
            f"signals.prf_hz is {prf:g}, below the band of the beam that folds into the image, expected at least "
            f"{math.ceil(least_hz)} at signals.speed_mps {signals.speed_mps:g}."
        )
    seen, (lines, cells) = line_of_sight(radar), scene.elevation_m.shape
    mean, half = float(scene.elevation_m.mean()), 0.5 * cells * scene.cell_m
    height = 0.0 if scene.objects is None else float(scene.objects.height_m.max(initial=0.0))
    top, bottom = float(scene.elevation_m.max()) + height, float(scene.elevation_m.min())
    near = math.hypot(seen.height_m + mean - top, seen.ground_m - half)
    far = math.hypot(seen.height_m + mean - bottom, seen.ground_m + half)
    if far - near > LIGHT_MPS / (2.0 * prf):
        raise ConfigError(
            f"signals.prf_hz is {prf:g}: the swath of {far - near:.0f} m in slant range is beyond the unambiguous "
            f"range of {LIGHT_MPS / (2.0 * prf):.0f} m, expected at most {LIGHT_MPS / (2.0 * (far - near)):.0f}."
        )
    middle = math.hypot(seen.height_m, seen.ground_m)
    outermost = wavelength / antenna
    around = max(middle - near, far / math.sqrt(1.0 - outermost**2) - middle) + 5.0 * signals.motion_m
    around = _GUARD * around + 8.0 * radar.range_resolution_m
    bandwidth = 0.5 * LIGHT_MPS * WIDTH_FACTOR / radar.range_resolution_m
    samples = math.ceil(4.0 * around * bandwidth / LIGHT_MPS)
    reach = far * 0.25 * band * wavelength / math.sqrt(1.0 - (0.25 * band * wavelength) ** 2)
    spacing = signals.speed_mps / prf
    along = np.arange(-reach, lines * scene.cell_m + reach + spacing, spacing)
    track = np.stack([along, np.zeros_like(along), np.full_like(along, mean + seen.height_m)], axis=1)
    reference = np.stack([along, np.full_like(along, seen.ground_m), np.full_like(along, mean)], axis=1)
    track[:, 1:] += _motion(along.size, signals.motion_m, signals.motion_length_m / spacing, case.seed)
    one = Collection(
        track, reference, prf, signals.speed_mps, carrier, bandwidth / samples, samples, antenna, band, looks, middle,
        1.0, signals.bits,
    )  # fmt: skip
    if signals.power_w is None:
        incidence = 90.0 - radar.depression_deg
        floor = noise_floor_db(radar.model_copy(update={"radiometry": "sigma0_ref"}), incidence)
        return replace(one, noise_m2=10.0 ** (float(floor) / 10.0) / nesz(one, middle, incidence))
    density = _NOISE_W_PER_HZ * 10.0 ** (signals.noise_figure_db / 10.0)
    # power of the echo of 1 m2 at the middle of the swath, times the length of the pulse: its energy
    gain = 10.0 ** (signals.gain_db / 10.0)
    energy = signals.power_w * signals.pulse_us * 1e-6 * (gain * wavelength) ** 2 / ((4.0 * np.pi) ** 3 * middle**4)
    return replace(one, noise_m2=density * samples / energy)


def check(case: Part, scene: Scene) -> None:
    """Raise the errors of :func:`collection`, before anything is simulated."""
    collection(case, scene)


def _motion(pulses: int, rms_m: float, length: float, seed: int) -> Doubles:
    """Smooth random displacement of the track across its direction, in ground range and height, shape (pulses, 2)."""
    if rms_m == 0.0:
        return np.zeros((pulses, 2))
    white = derived_rng(seed, "motion").standard_normal((pulses, 2))
    smooth = scipy.ndimage.gaussian_filter1d(white, length, axis=0, mode="reflect")
    # the variance that the kernel leaves of white noise, whose squared taps sum to 1 / (2 sqrt(pi) length)
    return np.asarray(rms_m * math.sqrt(2.0 * math.sqrt(math.pi) * length) * smooth)
