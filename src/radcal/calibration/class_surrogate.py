"""Kriging of the cumulants of a run's classes of incidence as functions of X."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.calibration.surrogate import Surrogate

__all__ = ["ClassSurrogate"]

_SKEWNESS = 0.99  # a skew normal has less; that of the log of single-look speckle, -1.14, is learnt as this


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

    Raises
    ------
    SurrogateError
        Numbers that are not finite, too few points, or no training succeeded.
    """

    def __init__(self, bounds: ArrayLike, parameters: ArrayLike, cumulants: ArrayLike) -> None:
        points = np.asarray(parameters, dtype=np.float64)
        order = np.sort(np.unique(points, axis=0, return_index=True)[1])
        x = points[order]
        mean, variance, third = np.moveaxis(np.asarray(cumulants, dtype=np.float64)[order], -1, 0)
        sd = np.sqrt(variance)
        dp = skewnormal.direct(np.stack([mean, sd, np.clip(third / sd**3, -_SKEWNESS, _SKEWNESS)], axis=-1))
        self.parts = [Surrogate(bounds, x, dp[:, k]) for k in range(dp.shape[1])]

    def train(self, start: Sequence[NDArray[np.float64]] | None = None) -> ClassSurrogate:
        """Optimise the length scales.

        Parameters
        ----------
        start : sequence of ndarray, optional
            Another's ``theta`` to start from. Without it the first class is searched from many starts, and
            each other class from where the one before ended: the same law behind another range of angles.

        Returns
        -------
        ClassSurrogate
            Itself.
        """
        last = None
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
        mean, log_sd, skewness = np.stack([p.predict(p.unit(parameters)[None])[0] for p in self.parts]).T
        sd = np.exp(log_sd)
        return np.stack([mean, sd**2, skewness * sd**3], axis=-1)
