"""The cumulants of a run's classes of incidence as functions of X: law and speckle, corrected by runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.expected import Forward

__all__ = ["ClassRuns", "Corrected"]

_NEAR = 0.1  # squared distance, in the same
_LEVEL_DB = 0.1  # runs whose levels differ by less say little of how a difference goes with it
_SAME = 1e-9  # squared distance in standard deviations: far below what any class can tell


def _learnt(cumulants: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulants to mean [dB], log sd and skewness, shape (..., 3)."""
    mean, variance, third = np.moveaxis(cumulants, -1, 0)
    return np.stack([mean, 0.5 * np.log(variance), third / variance**1.5], axis=-1)


def _cumulants(learnt: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean [dB], log sd and skewness to cumulants, shape (..., 3)."""
    mean, log_sd, skewness = np.moveaxis(learnt, -1, 0)
    sd = np.exp(log_sd)
    return np.stack([mean, sd**2, skewness * sd**3], axis=-1)


@dataclass(frozen=True)
class ClassRuns:
    """What the runs so far showed of one material.

    Attributes
    ----------
    parameters : ndarray, shape (k, d)
        Distinct X.
    cumulants : ndarray, shape (k, n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] of each class in them.
    """

    parameters: NDArray[np.float64]
    cumulants: NDArray[np.float64]


class Corrected:
    """Law and speckle, corrected by what the runs show besides.

    What a simulator adds to law and speckle (area of facets, neighbours, noise, one sample of speckle) changes
    little with X, and hardly at all between two X of nearly the same curve: a correction is taken from the runs by
    inverse distance weighting, distances being those of the statistics that law and speckle alone expect. At a
    run's own X it is what that run showed. Proposing, running and correcting again then converges in a few runs.

    Parameters
    ----------
    baseline : callable
        Cumulants expected of law and speckle alone.
    parameters : array_like, shape (k, d), optional
        X of the runs; without runs nothing is corrected.
    cumulants : array_like, shape (k, n, 3), optional
        Mean [dB], variance [dB^2] and third central moment [dB^3] of each class in them.

    References
    ----------
    Bandler et al., "Space mapping: the state of the art", IEEE Trans. Microwave Theory Tech. 52 (2004);
    Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd ACM National
    Conference (1968).
    """

    def __init__(self, baseline: Forward, parameters: ArrayLike = (), cumulants: ArrayLike = ()) -> None:
        self._baseline = baseline
        points = np.asarray(parameters, dtype=np.float64)
        if points.size:
            self._expected = np.stack([_learnt(baseline(point)) for point in points])
            self._difference = _learnt(np.asarray(cumulants, dtype=np.float64)) - self._expected
        else:
            self._expected = self._difference = np.empty((0, 0, 3))

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulants of each class at X, shape (d,) to (n, 3)."""
        expected = _learnt(self._baseline(parameters))
        if not len(self._expected):
            return _cumulants(expected)
        away = self._expected[..., :2] - expected[:, :2]
        # means in standard deviations of the pixels; the two errors of a normal sample's mean and log sd
        away = away / np.stack([np.exp(expected[:, 1]), np.full(len(expected), np.sqrt(0.5))], axis=-1)
        squares = (away**2).sum(axis=(1, 2))
        weight = 1.0 / (squares + _SAME) ** 2
        weight /= weight.sum()
        # noise, for one, hides a weak law: how the difference goes with a class's level is taken from more runs
        level = self._expected[..., 0] - expected[:, 0]
        near = 1.0 / (squares + _NEAR)
        near /= near.sum()
        middle, difference = near @ level, np.einsum("k,knj->nj", near, self._difference)
        left = level - middle
        slope = np.einsum("k,kn,knj->nj", near, left, self._difference - difference)
        slope /= (np.einsum("k,kn->n", near, left**2) + _LEVEL_DB**2)[:, None]
        correction = np.einsum("k,knj->nj", weight, self._difference - level[..., None] * slope)
        return _cumulants(expected + correction)
