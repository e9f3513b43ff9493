"""Clutter filters and detectors for the echoes of several channels and pulses in one range gate.

A vector in space and time has the channels of the first pulse first, then those of the next.

References
----------
Ward, "Space-time adaptive processing for airborne radar", MIT Lincoln Laboratory TR-1015 (1994); Kelly, "An adaptive
detection algorithm", IEEE Trans. Aerosp. Electron. Syst. 22 (1986) 115-127.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Complex = NDArray[np.complex128]
Array = NDArray[np.floating[Any]]

_LIMIT_DB = 5.0  # loss of signal to interference and noise, below which a mover is not detected


@dataclass(frozen=True)
class Interval:
    """Coherent processing interval: pulses of several receivers in line, on a straight and level track.

    Attributes
    ----------
    channels, pulses : int
        Number of receivers and of pulses.
    spacing_m : float
        Distance between neighbouring receivers along the track [m]; there is one transmitter.
    speed_mps, prf_hz, wavelength_m : float
        Speed of the platform, pulse rate and wavelength.
    """

    channels: int
    pulses: int
    spacing_m: float
    speed_mps: float
    prf_hz: float
    wavelength_m: float

    @property
    def size(self) -> int:
        """Number of echoes in a range gate: channels times pulses."""
        return self.channels * self.pulses

    def steering(self, sine: ArrayLike, velocity_mps: ArrayLike = 0.0) -> Complex:
        """Echoes of unit amplitude of scatterers.

        Parameters
        ----------
        sine : array_like
            Sine of the angle from zero Doppler, positive ahead.
        velocity_mps : array_like
            Radial velocity of the scatterers, positive towards the radar [m/s].

        Returns
        -------
        ndarray of complex128, shape (size, n)
            Vectors in space and time.
        """
        u, v = (np.ravel(each) for each in np.broadcast_arrays(sine, velocity_mps))
        pulse, channel = (np.ravel(each) for each in np.indices((self.pulses, self.channels)))
        turns = np.multiply.outer(pulse, 2.0 * (self.speed_mps * u + v) / (self.wavelength_m * self.prf_hz))
        turns = turns + np.multiply.outer(channel, self.spacing_m * u / self.wavelength_m)
        return np.asarray(np.exp(2j * np.pi * turns))


def dpca(echoes: Complex, interval: Interval) -> Complex:
    """Displaced phase centre antenna: each channel minus the next one a pulse earlier.

    Standing ground vanishes if the platform moves by half of the receivers' spacing from pulse to pulse.

    Parameters
    ----------
    echoes : ndarray of complex128, shape (size, n)
        Vectors in space and time.
    interval : Interval
        Pulses and channels.

    Returns
    -------
    ndarray of complex128, shape ((pulses - 1) (channels - 1), n)
        Differences.
    """
    each = echoes.reshape(interval.pulses, interval.channels, -1)
    return np.asarray((each[1:, :-1] - each[:-1, 1:]).reshape(-1, each.shape[2]))


def covariance(interval: Interval, sine: Array, power: Array) -> Complex:
    """Covariance of standing clutter from directions of given power, with noise of power 1 in each echo."""
    vectors = interval.steering(sine) * np.sqrt(power)
    return np.asarray(vectors @ vectors.conj().T + np.eye(interval.size))


def sinr_loss_db(known: Complex, vectors: Complex) -> Array:
    """Ratio of signal to clutter and noise of the best filter for a known covariance, over that without clutter [dB].

    Parameters
    ----------
    known : ndarray of complex128, shape (size, size)
        Covariance, in which the noise has power 1.
    vectors : ndarray of complex128, shape (size, n)
        Expected echoes.

    Returns
    -------
    ndarray, shape (n,)
        At most 0.
    """
    best = np.einsum("dn,dn->n", vectors.conj(), np.linalg.solve(known, vectors)).real
    return np.asarray(10.0 * np.log10(best / len(known)))


def least_velocity_mps(interval: Interval, known: Complex) -> float:
    """Least detectable radial velocity at zero Doppler [m/s]: beyond it the loss stays below 5 dB.

    It is searched up to half of the first blind velocity; NaN if the loss exceeds 5 dB there.
    """
    velocity = np.linspace(0.0, 0.25 * interval.wavelength_m * interval.prf_hz, 2001)
    lost = np.flatnonzero(sinr_loss_db(known, interval.steering(0.0, velocity)) < -_LIMIT_DB)
    if not lost.size:
        return 0.0
    return float(velocity[lost[-1] + 1]) if lost[-1] + 1 < velocity.size else float("nan")


def kelly_threshold(false_alarms: float, size: int, training: int) -> float:
    """Value that :func:`kelly` exceeds in uniform clutter with a given probability.

    With tau = eta / (1 - eta), the probability is (1 + tau)^-(training - size + 1).
    """
    return float(1.0 - false_alarms ** (1.0 / (training - size + 1)))


def kelly(cells: Complex, training: Complex, vectors: Complex) -> Array:
    """Kelly's likelihood ratio, whose adaptive filter has the covariance of the training gates.

    Parameters
    ----------
    cells : ndarray of complex128, shape (..., size, n)
        Echoes of the gates under test.
    training : ndarray of complex128, shape (..., size, size)
        Sum over the training gates of the products of their echoes with their conjugate transposes; at least as many
        gates as the size, and better twice as many.
    vectors : ndarray of complex128, shape (size, m)
        Expected echoes of a target.

    Returns
    -------
    ndarray, shape (..., n, m)
        Statistic eta, 0 to 1.
    """
    root = np.linalg.cholesky(training)
    white = np.linalg.solve(root, cells)
    expected = np.linalg.solve(root, np.broadcast_to(vectors, (*root.shape[:-2], *vectors.shape)))
    matched = np.abs(white.conj().swapaxes(-1, -2) @ expected) ** 2
    energy = (np.abs(expected) ** 2).sum(axis=-2)[..., None, :]
    return np.asarray(matched / (energy * (1.0 + (np.abs(white) ** 2).sum(axis=-2)[..., :, None])))
