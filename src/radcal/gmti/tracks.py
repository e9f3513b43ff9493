"""Tracks of moving targets over several scans, by Kalman filters of Stone Soup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

_START = datetime(2000, 1, 1, tzinfo=UTC)  # of the first scan: only differences of times count
_ACCELERATION = 0.1  # power density of the movers' acceleration along each axis [m2/s3]
_GATE = 4.0  # largest distance of a detection from the place expected of a track, in standard deviations
_MISSED = 3  # scans in a row without a detection, after which a track ends
_FEWEST = 4  # detections of a new track, in scans in a row
_FASTEST_MPS = 20.0  # standard deviation of a new track's velocity


@dataclass(frozen=True)
class Track:
    """Track of one mover.

    Attributes
    ----------
    seconds : ndarray, shape (n,)
        Times of the scans from the first to the last with a detection of the track [s].
    place_m, velocity_mps : ndarray, shape (n, 2)
        Places and velocities to the east and to the north [m, m/s].
    detected : ndarray of bool, shape (n,)
        Whether the scan has a detection of the track, which is otherwise predicted.
    """

    seconds: Array
    place_m: Array
    velocity_mps: Array
    detected: NDArray[np.bool_]


def tracked(scans: Sequence[tuple[float, Array]], error: Sequence[float]) -> list[Track]:
    """Tracks through the detections of several scans.

    A mover drives straight on, but for small random accelerations. Each scan's detections are assigned to tracks so
    that the sum of their Mahalanobis distances is smallest; the others may begin tracks, which count from the fourth
    detection in a row on and end after three scans without one.

    Parameters
    ----------
    scans : sequence of (float, ndarray)
        Time [s] and detections of each scan, shape (n, 2): places to the east and to the north [m]; or (n, 3): place to
        the east, velocity to the east [m/s], place to the north.
    error : sequence of float
        Standard error of each of these numbers.

    Returns
    -------
    list of Track
        Tracks by time and place of their first detection.

    References
    ----------
    Blackman and Popoli, "Design and Analysis of Modern Tracking Systems" (1999), chapter 6: global nearest neighbour.
    """
    from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
    from stonesoup.deleter.time import UpdateTimeStepsDeleter
    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.initiator.simple import MultiMeasurementInitiator
    from stonesoup.measures import Mahalanobis
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.tracker.simple import MultiTargetTracker
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    mapping = (0, 2) if len(error) == 2 else (0, 1, 2)
    measured = LinearGaussian(4, mapping, np.diag(np.square(error)))
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(_ACCELERATION)] * 2)
    updater = KalmanUpdater(measured)
    nearest = GNNWith2DAssignment(DistanceHypothesiser(KalmanPredictor(motion), updater, Mahalanobis(), _GATE))
    beginning = MultiMeasurementInitiator(
        GaussianState(np.zeros(4), np.diag([0.0, _FASTEST_MPS**2] * 2)), UpdateTimeStepsDeleter(1), nearest, updater,
        measured, _FEWEST,
    )  # fmt: skip
    times = ((_START + timedelta(seconds=float(seconds)), rows) for seconds, rows in scans)
    detected = (
        (time, {Detection(row[:, None], time, measurement_model=measured) for row in rows}) for time, rows in times
    )
    every = set[Any]()
    for _, running in MultiTargetTracker(beginning, UpdateTimeStepsDeleter(_MISSED), detected, nearest, updater):
        every |= running
    return sorted((_track(one.states) for one in every), key=lambda one: (one.seconds[0], *one.place_m[0]))


def _track(states: Sequence[Any]) -> Track:
    """Track of Stone Soup's states, without the predictions after the last detection."""
    from stonesoup.types.update import Update

    detected = np.array([isinstance(one, Update) for one in states])
    last = int(np.flatnonzero(detected)[-1]) + 1
    mean = np.array([np.ravel(one.mean) for one in states[:last]], dtype=np.float64)
    seconds = np.array([(one.timestamp - _START).total_seconds() for one in states[:last]])
    return Track(seconds, mean[:, ::2], mean[:, 1::2], detected[:last])
