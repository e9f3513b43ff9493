"""Bounded least squares on the unit box, from one start or from the best points of a Sobol sample."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

Batched = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Function from points of the unit box, shape (m, d), to residuals, shape (m, k)."""

_STEP = 1e-5
_LIMIT = 1e6  # largest size of a residual, because the solver refuses infinite residuals
_APART = 0.2  # smallest difference of two starts in at least one coordinate of the unit box


def least_squares(
    residuals: Batched,
    start: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    tolerance: float,
    calls: int = 60,
) -> Any:
    """Minimise a sum of squares inside bounds; one call of ``residuals`` gives the Jacobian by central differences.

    Parameters
    ----------
    residuals : callable
        Function from points, shape (m, d), to residuals, shape (m, k).
    start, low, high : ndarray, shape (d,)
        Start and bounds.
    tolerance : float
        Tolerance for relative changes of the cost and of the point, and for the gradient.
    calls : int
        Largest number of evaluations, without those of the Jacobian.

    Returns
    -------
    scipy.optimize.OptimizeResult
        ``x``, ``cost`` (half the sum of squares) and ``jac``, shape (k, d).

    References
    ----------
    Voglis and Lagaris, "A rectangular trust region dogleg approach for unconstrained and bound constrained nonlinear
    optimization", WSEAS Int. Conf. Applied Math. (2004): its steps end on bounds, which the minimum often touches.
    """

    def limited(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.clip(residuals(points), -_LIMIT, _LIMIT)

    def jacobian(point: NDArray[np.float64]) -> NDArray[np.float64]:
        forward = np.minimum(point + _STEP * np.eye(len(point)), high)
        backward = np.maximum(point - _STEP * np.eye(len(point)), low)
        values = limited(np.concatenate([forward, backward]))
        width = np.diagonal(forward) - np.diagonal(backward)
        return np.asarray(((values[: len(point)] - values[len(point) :]) / width[:, None]).T)

    inside = np.clip(start, low, high)
    ends = {"method": "dogbox", "xtol": tolerance, "ftol": tolerance, "gtol": tolerance, "max_nfev": calls}
    return scipy.optimize.least_squares(
        lambda point: limited(point[None])[0], inside, jac=jacobian, bounds=(low, high), x_scale=1.0, **ends
    )


def sobol(dimension: int, size: int, seed: int) -> NDArray[np.float64]:
    """Scrambled Sobol sample of the unit box, shape (size, dimension); ``size`` is a power of two."""
    return np.asarray(scipy.stats.qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random(size))


def distant(points: NDArray[np.float64], count: int) -> Iterator[NDArray[np.float64]]:
    """First points of a ranking that differ from each other by more than 0.2 in at least one coordinate."""
    chosen: list[NDArray[np.float64]] = []
    for point in points:
        if len(chosen) == count:
            return
        if all(np.abs(point - other).max() > _APART for other in chosen):
            chosen.append(point)
            yield point
