"""One turn of the antenna: echoes of all pulses, averaged in power over the pulses of a ray, and detections."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.laws.grazing import weibull_power
from radcal.ppi.ground import Array, Ground, Points
from radcal.sections.ppi import Ppi
from radcal.seeds import derived_rng

_GATES = 64  # gates at a time; each such block has a generator of its own


@dataclass(frozen=True)
class Sweep:
    """Picture of one turn.

    Attributes
    ----------
    azimuth_deg : ndarray, shape (rays,)
        Mean pointing of the pulses of each ray, clockwise from the grid's north [deg].
    range_m : ndarray, shape (gates,)
        Slant range of the middle of each gate [m].
    snr : ndarray, shape (rays, gates)
        Mean power of the pulses of a ray, divided by the mean power of the noise.
    without_objects : ndarray, shape (rays, gates)
        The same of the same ground and noise without objects.
    """

    azimuth_deg: Array
    range_m: Array
    snr: Array
    without_objects: Array


def _pattern(config: Ppi, azimuth_deg: float = 0.0) -> Array:
    """One-way power pattern of the antenna in an azimuth, at all pulses of a turn."""
    off = (np.arange(config.turn) * 360.0 / config.turn - azimuth_deg + 180.0) % 360.0 - 180.0
    return np.asarray(np.exp(-4.0 * math.log(2.0) * (off / config.azimuth_beam_deg) ** 2))


def _seen_by(pattern: Array, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Sum of values at all azimuths (axis 0), weighted by a pattern about each of them."""
    return np.asarray(np.fft.ifft(np.fft.fft(values, axis=0) * np.fft.fft(pattern)[:, None], axis=0))


def _drawn(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.complex128]:
    """Complex Gaussian numbers of mean power 1."""
    return np.asarray((rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / math.sqrt(2.0))


def _blocks(ground: Ground, points: Points, config: Ppi, seed: int) -> Iterator[tuple[Array, Array]]:
    """Mean power of the rays with and without objects, a block of gates after the other."""
    n, rays = config.turn, config.turn // config.pulses
    voltage = _pattern(config)  # both ways: the square of the one-way amplitude
    two_way = voltage**2
    phase = derived_rng(seed, "ppi", "objects").uniform(0.0, 2.0 * np.pi, points.snr.size)
    # a resolution cell of land clutter is as wide as the beam
    cells = math.ceil(360.0 / config.azimuth_beam_deg)
    cell = (np.arange(n) * cells) // n

    def of_rays(pulses: NDArray[np.complex128]) -> Array:
        power = np.abs(pulses[: rays * config.pulses]) ** 2
        return np.asarray(power.reshape(rays, config.pulses, -1).mean(axis=1))

    for first in range(0, config.gates, _GATES):
        gates = slice(first, min(first + _GATES, config.gates))
        rng = derived_rng(seed, "ppi", "gates", first)
        shape = (n, gates.stop - first)
        # the ground stands still, so that one amplitude of each patch holds for all pulses that see it
        pulses = _seen_by(voltage, np.sqrt(ground.speckled[:, gates]) * _drawn(rng, shape)) + _drawn(rng, shape)
        exponential, turned = rng.exponential(size=(cells, shape[1])), rng.uniform(0.0, 2.0 * np.pi, (cells, shape[1]))
        if ground.land[:, gates].any():
            both = _seen_by(two_way, ground.land[:, gates] + 1j * ground.spread[:, gates])
            mean = np.maximum(both.real, 0.0)
            # rounding of the transform leaves powers of 1e-16 of the largest where there is no land
            spread = np.where(mean > 1e-9 * mean.max(), both.imag / np.maximum(mean, 1e-300), 1.0)
            power = mean * weibull_power(exponential[cell], spread)
            pulses += np.sqrt(power) * np.exp(1j * turned[cell])
        without = of_rays(pulses)
        for k in np.nonzero((points.gate >= first) & (points.gate < gates.stop))[0]:
            echo = math.sqrt(points.snr[k]) * np.exp(1j * phase[k])
            pulses[:, points.gate[k] - first] += _pattern(config, points.azimuth_deg[k]) * echo
        yield of_rays(pulses), without


def one_turn(ground: Ground, points: Points, config: Ppi, seed: int) -> Sweep:
    """Picture of one turn over ground and objects, with speckle, land clutter and noise of a seed.

    Parameters
    ----------
    ground : Ground
        Mean power of the ground.
    points : Points
        Objects.
    config : Ppi
        Section ``ppi``.
    seed : int
        Seed of speckle, land clutter, noise, and of the phases of objects.
    """
    rays = config.turn // config.pulses
    azimuth = (np.arange(rays) * config.pulses + 0.5 * (config.pulses - 1)) * 360.0 / config.turn
    blocks = list(_blocks(ground, points, config, seed))
    snr, without = (np.concatenate(each, axis=1) for each in zip(*blocks, strict=True))
    return Sweep(azimuth, (np.arange(config.gates) + 0.5) * config.gate_m, snr, without)


def threshold(cells: NDArray[np.intp] | int, false_alarms: float, pulses: int) -> Array:
    """Factor on the mean of training cells, above which a cell-averaging detector with square law reports a target.

    In uniform clutter and noise that are independent from pulse to pulse, the mean power of N pulses is gamma
    distributed with shape N, and the ratio of a cell to the mean of M cells has an F distribution with 2 N and 2 N M
    degrees of freedom. With one pulse the factor is M (Pfa^(-1/M) - 1).

    Parameters
    ----------
    cells : int or ndarray of int
        Number of training cells M.
    false_alarms : float
        Probability of a false alarm.
    pulses : int
        Number of pulses N whose powers are averaged.

    References
    ----------
    Finn and Johnson, "Adaptive detection mode with threshold control as a function of spatially sampled clutter-level
    estimates", RCA Review 29 (1968) 414-464; Richards (2014), sections 6.5.3 and 6.5.4.
    """
    # 1 - x of a beta distribution, whose small quantile keeps its digits at a small probability
    n, m = float(pulses), np.asarray(cells, dtype=np.float64)
    rest = scipy.special.betaincinv(n * m, n, false_alarms)
    return np.asarray(m * (1.0 - rest) / rest)


def detected(power: Array, config: Ppi) -> NDArray[np.bool_]:
    """Cells that the cell-averaging detector reports; near the ends of the range there are fewer training gates.

    Parameters
    ----------
    power : ndarray, shape (rays, gates)
        Mean power of the pulses of a ray.
    config : Ppi
        Section ``ppi``.
    """
    sums = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    gate, half, count = np.arange(power.shape[1]), config.training_gates // 2, power.shape[1]
    total, cells = np.zeros_like(power), np.zeros(count, dtype=np.intp)
    for low, high in (
        (gate - config.guard_gates - half, gate - config.guard_gates),
        (gate + config.guard_gates + 1, gate + config.guard_gates + 1 + half),
    ):
        low, high = np.clip(low, 0, count), np.clip(high, 0, count)
        total += sums[:, high] - sums[:, low]
        cells += high - low
    return np.asarray(power * cells > threshold(cells, config.false_alarms, config.pulses) * total)
