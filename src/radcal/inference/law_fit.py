"""Least-squares fit of a material's law and effective looks, with their uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.inference.bounded import distant, least_squares, sobol
from radcal.inference.priors import LOOKS_MOST

Residuals = Callable[[NDArray[np.float64], float], NDArray[np.float64]]
"""Function from X, shape (d,), and effective looks to residuals in standard deviations, shape (k,)."""

LOOKS = (0.3, LOOKS_MOST)
"""Bounds of the effective looks: smallest number of looks, and largest one in multiples of the sensor's looks."""
_SCREENED = 256
_STARTS = 5
_TOLERANCE = 1e-6  # residuals are in standard deviations
_CALLS = 100
_SAME_COST = 1e-3
_KNOWN = 1e9  # inverse variance of a parameter that is not fitted


@dataclass(frozen=True)
class LawFit:
    """Fitted law of one material.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        Fitted parameters X.
    looks : float
        Effective number of looks.
    cost : float
        Half the sum of squared residuals, priors included.
    covariance : ndarray, shape (d + 1, d + 1)
        Covariance of X and the logarithm of the looks: inverse of the Gauss-Newton matrix, to which the bounds add the
        information of a uniform distribution.
    prior_information : ndarray, shape (d + 1, d + 1)
        Inverse covariance of X and the logarithm of the looks from priors and bounds alone.
    """

    parameters: NDArray[np.float64]
    looks: float
    cost: float
    covariance: NDArray[np.float64]
    prior_information: NDArray[np.float64]


def fit_law(
    residuals: Residuals,
    bounds: ArrayLike,
    sensor: float,
    free_looks: bool = True,
    start: tuple[ArrayLike, float] | None = None,
    prior: Residuals = lambda *_: np.empty(0),
) -> LawFit:
    """Minimise the sum of squared residuals over X and the effective looks.

    Bounded least squares start from the best points of a Sobol sample inside the bounds.

    Parameters
    ----------
    residuals : callable
        Function from X and looks to residuals in standard deviations.
    bounds : array_like, shape (d, 2)
        Bounds of X.
    sensor : float
        Number of looks of the sensor; effective looks are searched from 0.3 looks to 1.1 times the sensor's looks.
    free_looks : bool
        Whether the effective looks are searched.
    start : (X, looks), optional
        Start of the search, in place of the points of the sample. Looks that are not searched are those of the start
        or, without a start, those of the sensor.
    prior : callable, optional
        Function from X and looks to residuals of the priors, which are minimised with ``residuals``.

    Returns
    -------
    LawFit
    """
    box = np.asarray(bounds, dtype=np.float64)
    assumed = sensor if start is None else start[1]
    looks_box = np.log([[LOOKS[0], LOOKS[1] * sensor]]) if free_looks else np.empty((0, 2))
    low, high = np.concatenate([box, looks_box]).T
    width = high - low
    d = len(box)

    def at(unit: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        q = np.clip(low + unit * width, low, high)
        return q[:d], float(np.exp(q[d])) if free_looks else assumed

    def each(units: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.concatenate([residuals(*point), prior(*point)]) for point in map(at, units)])

    if start is not None:
        x, looks = start
        first = np.append(np.asarray(x, dtype=np.float64), [np.log(looks)] if free_looks else [])
        starts = [(first - low) / width]
    else:
        sample = sobol(len(low), _SCREENED, 0)
        ranked = sample[np.argsort((each(sample) ** 2).sum(axis=1), kind="stable")]
        starts = list(distant(ranked, _STARTS))
    best: Any = None
    for unit in starts:
        found = least_squares(each, unit, np.zeros_like(low), np.ones_like(low), _TOLERANCE, _CALLS)
        agree = best is not None and abs(found.cost - best.cost) < _SAME_COST
        if best is None or found.cost < best.cost:
            best = found
        if agree:  # two starts that end at the same cost have found the minimum
            break
    # a uniform law on the unit interval has the variance 1/12
    known = 12.0 * np.eye(len(low))
    data, weak = np.split(best.jac, [len(best.jac) - prior(*at(best.x)).size])
    known += weak.T @ weak
    # looks that are not searched are known
    covariance, information = np.zeros((d + 1, d + 1)), np.diag([0.0] * d + [_KNOWN])
    inside = slice(len(low))
    covariance[inside, inside] = np.linalg.inv(known + data.T @ data) * np.multiply.outer(width, width)
    information[inside, inside] = known / np.multiply.outer(width, width)
    return LawFit(*at(best.x), float(best.cost), covariance, information)
