"""Echoes of a scene and its movers in several channels: one dwell of the beam after the other along the track."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.gmti.adaptive import Array, Complex, Interval
from radcal.scene.model import Scene
from radcal.seeds import derived_rng, derived_seed
from radcal.signals.history import echoes
from radcal.signals.platform import Collection, check_prf
from radcal.signals.scatterers import Scatterers, scatterers


@dataclass(frozen=True)
class Movers:
    """Moving objects, in metres to the east and to the north of the corner of the scene's grid, and in elevation.

    Attributes
    ----------
    place_m : ndarray, shape (n, 3)
        Place at the middle of each dwell of the first scan [m].
    velocity_mps : ndarray, shape (n, 3)
        Velocity [m/s].
    amplitude : ndarray of complex64, shape (n,)
        Square root of the cross-section, with a random phase [m].
    """

    place_m: Array
    velocity_mps: Array
    amplitude: NDArray[np.complex64]

    def after(self, seconds: float) -> Array:
        """Places some seconds later, shape (n, 3) [m]."""
        return np.asarray(self.place_m + seconds * self.velocity_mps)


@dataclass(frozen=True)
class Dwell:
    """Range-compressed echoes of one dwell.

    Attributes
    ----------
    number, scan : int
        Numbers of the dwell and of the scan, from 1.
    antenna_m : ndarray, shape (3,)
        Mean place of the phase centres of all pulses and receivers [m].
    range_m : ndarray, shape (gates,)
        Slant range of the gates [m].
    noise_m2 : float
        Mean power of the noise in a gate, as a cross-section at the middle of the swath [m2].
    ground, movers : ndarray of complex128, shape (channels x pulses, gates)
        Echoes of standing ground and objects with noise, and of movers.
    """

    number: int
    scan: int
    antenna_m: Array
    range_m: Array
    noise_m2: float
    ground: Complex
    movers: Complex


def interval_of(case: Part, one: Collection) -> Interval:
    """Coherent processing interval of a case, from its sections ``gmti`` and ``signals``.

    Raises
    ------
    ConfigError
        The pulse rate is below the band of the beam, or the swath is longer than the unambiguous range or has too few
        gates for the detector.
    """
    config = case.gmti
    if one.spot_m is not None or one.middle_sine != 0.0:
        raise ConfigError(
            "signals: moving targets are found in stripmap at zero Doppler, expected no squint_deg or mode."
        )
    least, swath = 4.0 * one.speed_mps / one.antenna_m, one.samples * one.gate_m
    check_prf("gmti", config.prf_hz, least, "from null to null", one.speed_mps, swath)
    if one.samples < (needed := 2 * (config.training + 3)):
        raise ConfigError(
            f"gmti: the swath has {one.samples} gates, expected at least {needed} for {config.training} training "
            "gates: choose fewer gmti.channels or gmti.pulses."
        )
    spacing = config.spacing_m or one.antenna_m
    return Interval(config.channels, config.pulses, spacing, one.speed_mps, config.prf_hz, one.wavelength_m)


def movers_of(case: Part, scene: Scene) -> Movers:
    """Moving objects of a scene, as points at their height above the ground, hidden by nothing."""
    if scene.objects is None or not scene.objects.moving.any():
        return Movers(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.complex64))
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    moving, radar = scene.objects.some(scene.objects.moving), case.radar
    places = zip((moving.y_m, moving.x_m), scene.material.shape, strict=True)
    row, column = (np.minimum((at / scene.cell_m).astype(int), n - 1) for at, n in places)
    height = scene.elevation_m[row, column] + moving.height_m
    bearing = np.radians(moving.heading_deg)
    assert moving.speed_mps is not None  # noqa: S101 - they move
    velocity = moving.speed_mps[:, None] * np.stack([np.sin(bearing), np.cos(bearing), 0.0 * bearing], axis=1)
    phase = derived_rng(case.seed, "gmti", "movers").uniform(0.0, 2.0 * np.pi, len(moving))
    towards, steep = 270.0 if radar.look_side == "right" else 90.0, np.full(len(moving), radar.depression_deg)
    sigma = moving.cross_section_m2(towards, steep, radar.band, radar.polarisation)
    amplitude = np.sqrt(np.nan_to_num(sigma)) * np.exp(1j * phase)
    return Movers(np.stack([moving.x_m, moving.y_m, height], axis=1), velocity, amplitude.astype(np.complex64))


def _compressed(one: Collection, signal: NDArray[np.complexfloating[Any, Any]]) -> Complex:
    """Range profiles, in which a point has the amplitude of its echo; shape (pulses, gates)."""
    spectrum = np.fft.ifftshift(signal * one.weights / one.weights.sum(), axes=1)
    return np.asarray(np.fft.fftshift(np.fft.ifft(spectrum, axis=1, norm="forward"), axes=1))


def dwells(case: Part, scene: Scene, one: Collection, movers: Movers, seed: int) -> Iterator[Dwell]:
    """Echoes of all dwells, whose beams touch where their two-way power is 4 dB down, in all scans.

    The dwells of a scan are simulated at one time. A later scan looks from the same places with other noise, after the
    movers have moved on. The amplitudes of the ground are new, too: the echoes of a resolution cell as wide as the beam
    have nothing in common any more as soon as the platform has moved by the length of its antenna.

    Parameters
    ----------
    case : Part
        Configuration of the pass, with the laws and parameters of its materials.
    scene : Scene
        Scene with elevation.
    one : Collection
        Beam, frequencies and noise of each receiver.
    movers : Movers
        Moving objects of the scene.
    seed : int
        Noise seed.
    """
    interval = interval_of(case, one)
    standing = scene if scene.objects is None else replace(scene, objects=scene.objects.some(~scene.objects.moving))
    length, width = scene.material.shape[0] * scene.cell_m, 0.5 * one.range_m * one.null
    count = max(1, round(length / width))
    pulse, channel = (np.ravel(each) for each in np.indices((interval.pulses, interval.channels)))
    # phase centres of both ways
    along = pulse / interval.prf_hz * interval.speed_mps + 0.5 * interval.spacing_m * channel
    noise = one.noise_m2 * float(np.sum((one.weights / one.weights.sum()) ** 2))
    gate = np.arange(one.samples) - one.samples // 2
    for scan in range(case.gmti.scans):
        found = scatterers(case, standing, derived_seed(seed, "gmti", scan) if scan else seed, scene.cell_m)
        for number in range(count):
            first = (number + 0.5) * length / count - along.mean()
            antenna, reference = np.tile(one.track_m[0], (along.size, 1)), np.tile(one.reference_m[0], (along.size, 1))
            antenna[:, 0] = reference[:, 0] = first + along
            each = replace(one, track_m=antenna, reference_m=reference, prf_hz=interval.prf_hz)
            distance = each.distance_m[0] + gate * one.gate_m
            rng = derived_rng(seed, "gmti", "noise", number, *[scan] * (scan > 0))
            drawn = rng.standard_normal((2, along.size, one.samples)) * np.sqrt(0.5 * one.noise_m2)
            ground, moved = echoes(each, found, 0, along.size) + (drawn[0] + 1j * drawn[1]), []
            for k in range(interval.pulses):
                t = scan * case.gmti.revisit_s + (k - 0.5 * (interval.pulses - 1)) / interval.prf_hz
                now = Scatterers.sorted(one.of_grid(movers.after(t)), movers.amplitude)
                moved.append(echoes(each, now, k * interval.channels, (k + 1) * interval.channels))
            ground, moving = (_compressed(one, signal) for signal in (ground, np.concatenate(moved)))
            yield Dwell(number + 1, scan + 1, antenna.mean(axis=0), distance, noise, ground, moving)
