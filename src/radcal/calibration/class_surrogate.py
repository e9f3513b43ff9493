"""The cumulants of a run's classes of incidence as functions of X: kriged, or law and speckle corrected by a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.calibration.expected import Forward
from radcal.calibration.surrogate import Surrogate

__all__ = ["ClassSurrogate", "Corrected"]

_SKEWNESS = 0.99  # a skew normal has less; that of the log of single-look speckle, -1.14, is learnt as this
_SMOOTH = 0.1  # inverse squared length scale, in standardised coordinates


def _learnt(cumulants: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulants to mean [dB], log sd and skewness, shape (..., 3)."""
    mean, variance, third = np.moveaxis(cumulants, -1, 0)
    return np.stack([mean, 0.5 * np.log(variance), third / variance**1.5], axis=-1)


def _cumulants(learnt: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean [dB], log sd and skewness to cumulants, shape (..., 3)."""
    mean, log_sd, skewness = np.moveaxis(learnt, -1, 0)
    sd = np.exp(log_sd)
    return np.stack([mean, sd**2, skewness * sd**3], axis=-1)


class ClassSurrogate:
    """Mean, log sd and skewness of each class, 3 n outputs of X alone.

    The looks of a material are no input: they move the cumulants by a formula
    (:func:`radcal.calibration.expected.expected_cumulants`).

    Parameters
    ----------
    bounds : array_like, shape (d, 2)
        Box of X.
    parameters : array_like, shape (k, d)
        Training points; of equal ones the first counts.
    cumulants : array_like, shape (k, n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] of each class in each run.
    baseline : callable, optional
        Cumulants expected of law and speckle alone: their difference from the runs is then what is learnt,
        which varies far less than the runs do.

    References
    ----------
    Kennedy and O'Hagan, "Predicting the output from a complex computer code when fast approximations are
    available", Biometrika 87 (2000).

    Raises
    ------
    SurrogateError
        Numbers that are not finite, too few points, or no training succeeded.
    """

    def __init__(
        self, bounds: ArrayLike, parameters: ArrayLike, cumulants: ArrayLike, baseline: Forward | None = None
    ) -> None:
        points = np.asarray(parameters, dtype=np.float64)
        order = np.sort(np.unique(points, axis=0, return_index=True)[1])
        x = points[order]
        learnt = _learnt(np.asarray(cumulants, dtype=np.float64)[order])
        self._baseline = baseline
        if baseline is not None:
            learnt = learnt - _learnt(np.stack([baseline(point) for point in x]))
        # the surrogate of a density takes direct parameters, and learns these three of them again
        mean, log_sd, skewness = np.moveaxis(learnt, -1, 0)
        clipped = np.clip(skewness, -_SKEWNESS, _SKEWNESS)
        dp = skewnormal.direct(np.stack([mean, np.exp(log_sd), clipped], axis=-1))
        self.parts = [Surrogate(bounds, x, dp[:, k]) for k in range(dp.shape[1])]

    def train(self, start: Sequence[NDArray[np.float64]] | None = None) -> ClassSurrogate:
        """Optimise the length scales.

        Parameters
        ----------
        start : sequence of ndarray, optional
            Another's ``theta`` to start from. Without it the first class is searched from many starts (a
            difference from a baseline is smooth: from one), and each other class from where the one before
            ended: the same law behind another range of angles.

        Returns
        -------
        ClassSurrogate
            Itself.
        """
        last = None if self._baseline is None else np.full((3, self.parts[0].parameters.shape[1]), _SMOOTH)
        for k, part in enumerate(self.parts):
            part.train(start[k] if start is not None else last)
            last = part.theta
        return self

    @property
    def theta(self) -> list[NDArray[np.float64]]:
        """Inverse squared length scales of each class's outputs, shape (3, d) each."""
        return [part.theta for part in self.parts]

    @property
    def q2(self) -> NDArray[np.float64]:
        """Leave-one-out Q2, shape (n, 3)."""
        return np.stack([part.q2 for part in self.parts])

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulants of each class at X, shape (d,) to (n, 3)."""
        found = np.stack([p.predict(p.unit(parameters)[None])[0] for p in self.parts])
        if self._baseline is not None:
            found = found + _learnt(self._baseline(parameters))
        return _cumulants(found)


class Corrected:
    """Law and speckle, corrected by what one run shows besides.

    What a simulator adds to law and speckle (area of facets, neighbours, noise, one sample of speckle) hardly
    changes with X, so that proposing, running and correcting again converges in a few runs, without a design.

    Parameters
    ----------
    baseline : callable
        Cumulants expected of law and speckle alone.
    parameters : array_like, shape (d,), optional
        X of the run; without a run nothing is corrected.
    cumulants : array_like, shape (n, 3), optional
        Mean [dB], variance [dB^2] and third central moment [dB^3] of each class in it.

    References
    ----------
    Bandler et al., "Space mapping: the state of the art", IEEE Trans. Microwave Theory Tech. 52 (2004).
    """

    def __init__(
        self, baseline: Forward, parameters: ArrayLike | None = None, cumulants: ArrayLike | None = None
    ) -> None:
        self._baseline = baseline
        self._difference: NDArray[np.float64] | float = 0.0
        if parameters is not None and cumulants is not None:
            there = baseline(np.asarray(parameters, dtype=np.float64))
            self._difference = _learnt(np.asarray(cumulants, dtype=np.float64)) - _learnt(there)

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulants of each class at X, shape (d,) to (n, 3)."""
        return _cumulants(_learnt(self._baseline(parameters)) + self._difference)
