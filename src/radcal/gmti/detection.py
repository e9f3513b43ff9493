"""Detections of moving targets in the echoes of a dwell."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from radcal.config.part import Part
from radcal.gmti.adaptive import Array, Complex, Interval, covariance, kelly, kelly_threshold, least_velocity_mps
from radcal.gmti.channels import Dwell
from radcal.scene.model import Scene
from radcal.signals.platform import Collection

_COUNTED = 8  # one gate in so many counts the false alarms without movers
HALF_BEAM = 0.4
"""Half of the width of the beam that is searched, as a share of the sine of its null."""
GUARD = 2
"""Gates on either side of a detection that report nothing else."""
_DIRECTIONS, _FINER = 5, 9  # directions across the beam; points of the finer grid around a detection


@dataclass(frozen=True)
class Report:
    """Detection of a moving target.

    Attributes
    ----------
    east_m, north_m, height_m : float
        Place to the east and to the north of the corner of the scene's grid, and elevation of the ground there [m].
    range_m, velocity_mps : float
        Slant range, and radial velocity, positive towards the radar.
    eta : float
        Kelly's statistic, 0 to 1.
    dwell, scan : int
        Numbers of the dwell and of the scan.
    """

    east_m: float
    north_m: float
    height_m: float
    range_m: float
    velocity_mps: float
    eta: float
    dwell: int
    scan: int


def trained(echoes: Complex, training: int) -> Complex:
    """Sum of products of the echoes of the nearest gates around each gate, without its neighbours.

    Every second gate is used, because the echoes of neighbouring gates are correlated by the weights of the spectrum.

    Parameters
    ----------
    echoes : ndarray of complex128, shape (size, gates)
        Vectors in space and time.
    training : int
        Number of training gates; near the ends of the swath one more.

    Returns
    -------
    ndarray of complex128, shape (gates, size, size)
        Sums for :func:`.adaptive.kelly`.
    """
    out = np.empty((echoes.shape[1], len(echoes), len(echoes)), np.complex128)
    for half in (0, 1):
        part = echoes[:, half::2]
        gates, width = np.arange(part.shape[1]), training + 3
        sums = np.cumsum(np.einsum("ig,jg->gij", part, part.conj()), axis=0)
        sums = np.concatenate([np.zeros_like(sums[:1]), sums])
        low = np.clip(gates - width // 2, 0, gates.size - width)
        near, far = np.maximum(gates - 1, 0), np.minimum(gates + 2, gates.size)
        out[half::2] = sums[low + width] - sums[low] - sums[far] + sums[near]
    return out


def _statistic(echoes: Complex, sums: Complex, vectors: Complex) -> Array:
    """Kelly's statistic of each gate for each expected echo, shape (gates, m)."""
    return np.array([kelly(echoes[:, k : k + 1], sums[k], vectors)[0] for k in range(len(sums))])


def detections(
    dwell: Dwell, interval: Interval, case: Part, scene: Scene, one: Collection, least_mps: float = 0.0
) -> tuple[list[Report], float]:
    """Detections of one dwell, at most one in five neighbouring gates, and the share of false alarms.

    Parameters
    ----------
    dwell : Dwell
        Echoes.
    interval : Interval
        Pulses and channels.
    case, scene, one : Part, Scene, Collection
        Configuration, scene and collection.
    least_mps : float
        Radial velocity below which nothing is tested, because clutter hides it [m/s].

    Returns
    -------
    reports : list of Report
        Detections by range.
    alarms : float
        Share of the tests that exceed the threshold without movers.
    """
    half = HALF_BEAM * one.null
    fastest = 0.25 * one.wavelength_m * interval.prf_hz
    directions = np.linspace(-half, half, _DIRECTIONS)
    velocities = np.linspace(-fastest, fastest, 2 * interval.pulses, endpoint=False)
    tested = velocities[np.abs(velocities) >= least_mps]
    sine, speed = (np.ravel(each) for each in np.meshgrid(directions, tested))
    vectors, training = interval.steering(sine, speed), case.gmti.training
    least = kelly_threshold(case.gmti.false_alarms, interval.size, training)
    alone = _statistic(dwell.ground[:, ::_COUNTED], trained(dwell.ground, training)[::_COUNTED], vectors)
    echoes = dwell.ground + dwell.movers
    sums = trained(echoes, training)
    eta = _statistic(echoes, sums, vectors)
    best, reports = eta.max(axis=1), []
    away = np.linspace(-1.0, 1.0, _FINER)
    du, dv = (
        np.ravel(each) for each in np.meshgrid(away * half / (_DIRECTIONS // 2), away * 2 * fastest / velocities.size)
    )
    for gate in np.flatnonzero(best > least):
        if best[gate] < best[max(gate - GUARD, 0) : gate + GUARD + 1].max():
            continue
        coarse = int(eta[gate].argmax())
        u, v = sine[coarse] + du, speed[coarse] + dv
        finer = kelly(echoes[:, gate : gate + 1], sums[gate], interval.steering(u, v))[0]
        k = int(finer.argmax())
        slant = float(dwell.range_m[gate])
        place = _place(scene, one, dwell.antenna_m, slant, u[k])
        reports.append(Report(*place, slant, float(v[k]), float(finer[k]), dwell.number, dwell.scan))
    return reports, float((alone > least).mean())


def _place(scene: Scene, one: Collection, antenna_m: Array, range_m: float, sine: float) -> tuple[float, float, float]:
    """Place in the scene's grid of a slant range and direction, on the ground, and its elevation [m]."""
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    (ny, nx), cell = scene.material.shape, scene.cell_m
    height, north, east = float(scene.elevation_m.mean()), float(antenna_m[0] + range_m * sine), 0.0
    for _ in range(5):  # the height at the place changes the place
        square = range_m**2 * (1.0 - sine**2) - (antenna_m[2] - height) ** 2
        east = one.nadir_m + one.side * math.sqrt(max(square, 0.0))
        row, column = (int(np.clip(at / cell, 0, n - 1)) for at, n in ((north, ny), (east, nx)))
        height = float(scene.elevation_m[row, column])
    return east, north, height


def least_velocity(dwell: Dwell, interval: Interval, one: Collection) -> float:
    """Velocity of 5 dB of loss for the covariance of clutter of the mean power of a dwell's echoes [m/s]."""
    sine = np.linspace(-1.0, 1.0, 401) * one.null
    power = one.pattern(sine) ** 2
    ratio = max(float(np.mean(np.abs(dwell.ground) ** 2)) / dwell.noise_m2 - 1.0, 0.0)
    return least_velocity_mps(interval, covariance(interval, sine, ratio * power / power.sum()))
