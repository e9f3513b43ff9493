"""Whole numbers among the parameters: the points of the unit box that can be simulated."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.surrogate import Surrogate

__all__ = ["SAME", "corners", "elsewhere", "lattice"]

SAME = 1e-7  # in the unit box: nearer than this is the same point

_MOST_BRANCHED = 4  # whole parameters rounded both ways in every combination
_MOST_LISTED = 4096  # points of a lattice that are looked at one by one
_SAMPLE = 1024


def corners(surrogate: Surrogate, unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points around one whose whole parameters are rounded down and up.

    Parameters
    ----------
    surrogate : Surrogate
        Its bounds and which parameters are whole.
    unit : ndarray, shape (d,)
        Point of the unit box.

    Returns
    -------
    ndarray, shape (n, d)
        Every combination of up to four whole parameters; of more, the nearest point and those that differ from
        it in one of them.
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
    """All points of a box of whole parameters alone, shape (n, d); None of any other, or one of too many points."""
    low, high = surrogate.bounds.T
    if not surrogate.integer.all() or np.prod(high - low + 1.0) > _MOST_LISTED:
        return None
    axes = [np.arange(a, b + 1.0) for a, b in surrogate.bounds]
    return surrogate.unit(np.array(list(product(*axes))))


def elsewhere(surrogate: Surrogate, seed: int) -> NDArray[np.float64]:
    """Points to choose from where the best one has been simulated already.

    Parameters
    ----------
    surrogate : Surrogate
        Trained; of its own training points none is returned.
    seed : int
        Seed of the sample.

    Returns
    -------
    ndarray, shape (n, d)
        All points left of a small lattice of whole parameters alone, none when all have been simulated; else a
        Sobol sample.
    """
    from scipy.stats import qmc  # a second to import, which most jobs need not spend

    points = lattice(surrogate)
    if points is None:
        sobol = qmc.Sobol(len(surrogate.bounds), scramble=True, rng=np.random.default_rng(seed)).random(_SAMPLE)
        points = np.unique(surrogate.snapped(sobol), axis=0)
    known = surrogate.unit(surrogate.parameters)
    return np.asarray(points[np.abs(known[None] - points[:, None]).max(axis=2).min(axis=1) > SAME])
