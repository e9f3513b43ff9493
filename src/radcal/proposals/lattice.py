"""Points of the unit box that can be simulated if some parameters are whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from radcal.inference.bounded import sobol
from radcal.proposals.surrogate import Surrogate

SAME = 1e-7  # distance in the unit box below which two points are the same

_MOST_BRANCHED = 4  # largest number of whole-number parameters for which all combinations of roundings are made
_MOST_LISTED = 4096  # largest number of lattice points that are listed one by one
_SAMPLE = 1024


def corners(surrogate: Surrogate, unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points around a given point, with its whole-number parameters rounded down and up.

    Parameters
    ----------
    surrogate : Surrogate
        Surrogate, which holds the bounds, and which parameters are whole numbers.
    unit : ndarray, shape (d,)
        Point of the unit box.

    Returns
    -------
    ndarray, shape (n, d)
        All combinations of roundings for up to four whole-number parameters. For more parameters, the nearest rounded
        point, and the points that differ from it in the rounding of one parameter.
    """
    whole = np.flatnonzero(surrogate.integer)
    low, high = surrogate.bounds.T
    x = (low + unit * (high - low))[whole]
    down, up = np.maximum(np.floor(x), low[whole]), np.minimum(np.ceil(x), high[whole])
    rounded: Sequence[NDArray[np.float64]]
    if len(whole) <= _MOST_BRANCHED:
        rounded = [np.array(values) for values in product(*zip(down, up, strict=True))]
    else:
        nearest = np.round(x)
        other = np.where(nearest == down, up, down)
        rounded = [nearest, *(np.where(np.arange(len(x)) == k, other, nearest) for k in range(len(x)))]
    points = np.repeat(unit[None], len(rounded), axis=0)
    points[:, whole] = (np.array(rounded) - low[whole]) / (high - low)[whole]
    return np.asarray(np.unique(points, axis=0))


def lattice(surrogate: Surrogate) -> NDArray[np.float64] | None:
    """All points of the unit box if every parameter is a whole number, shape (n, d).

    The result is None if a parameter is continuous, or if there are more than 4096 points.
    """
    low, high = surrogate.bounds.T
    if not surrogate.integer.all() or np.prod(high - low + 1.0) > _MOST_LISTED:
        return None
    axes = [np.arange(a, b + 1.0) for a, b in surrogate.bounds]
    return surrogate.unit(np.array(list(product(*axes))))


def elsewhere(surrogate: Surrogate, seed: int) -> NDArray[np.float64]:
    """Points that have not been simulated, as candidates if the best point has been simulated already.

    Parameters
    ----------
    surrogate : Surrogate
        Trained surrogate; its training points are not returned.
    seed : int
        Seed of the Sobol sample.

    Returns
    -------
    ndarray, shape (n, d)
        If every parameter is a whole number and :func:`lattice` lists the points, all points not yet simulated, which
        may be none. Otherwise a Sobol sample with rounded whole-number parameters.
    """
    points = lattice(surrogate)
    if points is None:
        points = np.unique(surrogate.snapped(sobol(len(surrogate.bounds), _SAMPLE, seed)), axis=0)
    known = surrogate.unit(surrogate.parameters)
    return np.asarray(points[np.abs(known[None] - points[:, None]).max(axis=2).min(axis=1) > SAME])
