"""Design of experiments: the parameter sets simulated before any surrogate exists.

Every sampler makes a sequence of points, so that a larger design contains the points of a smaller one.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.seeds import derived_rng

_LATIN_BLOCK = 16


def sample_unit(sampler: str, size: int, dimension: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """First points of a sampling sequence in the unit box.

    Parameters
    ----------
    sampler : {'monte_carlo', 'latin_hypercube', 'sobol'}
        ``monte_carlo``: independent uniform numbers. ``latin_hypercube``: a Latin hypercube of 16 points, which is
        doubled (32, 64, ...) by points in its empty strata (Sallaberry, Helton and Hora 2008). ``sobol``: scrambled
        Sobol points (Owen 1998).
    size, dimension : int
        Number of points and of parameters.
    rng : Generator
        Source of the random numbers.

    Returns
    -------
    ndarray, shape (size, dimension)
        Points in [0, 1).
    """
    if sampler == "monte_carlo":
        return rng.random((size, dimension))
    if sampler == "sobol":
        with warnings.catch_warnings():
            # scipy warns if the number of points is not a power of 2, which a design need not be
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(scipy.stats.qmc.Sobol(dimension, scramble=True, rng=rng).random(size))
    points = np.asarray(scipy.stats.qmc.LatinHypercube(dimension, rng=rng).random(_LATIN_BLOCK))
    while len(points) < size:
        n = len(points)  # the added points fill the empty strata of twice as many
        added = np.empty_like(points)
        for j in range(dimension):
            empty = np.setdiff1d(np.arange(2 * n), np.floor(points[:, j] * 2 * n).astype(int))
            added[:, j] = (rng.permutation(empty) + rng.random(n)) / (2 * n)
        points = np.concatenate([points, added])
    return points[:size]


def _points(case: Part, size: int, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """First points of the sampling sequence, inside the bounds of all calibrated materials, shape (size, d)."""
    integer = np.concatenate([np.array(case.materials[name].integers, dtype=np.bool_) for name in case.calibrated])
    low, high = box.T
    drawn = size
    while True:
        rng = derived_rng(case.seed, "design", case.design.sampler)
        unit = sample_unit(case.design.sampler, drawn, len(low), rng)
        # each whole number, the bounds included, has an equally wide part of the unit interval
        whole = np.minimum(low + np.floor(unit * (high - low + 1.0)), high)
        points = np.where(integer, whole, low + unit * (high - low))
        if not integer.any():
            return np.asarray(points)
        start = np.concatenate([case.materials[name].start_parameters for name in case.calibrated])
        _, first = np.unique(np.concatenate([start[None], points]), axis=0, return_index=True)
        first = np.sort(first)[1:] - 1  # without the starting parameters, which the reference run simulates
        if len(first) >= size:
            return np.asarray(points[first[:size]])
        drawn *= 2


def design_points(
    case: Part, size: int, reused: Sequence[Mapping[str, Sequence[float]]] = ()
) -> list[dict[str, list[float]]]:
    """Parameters of every material for each run of the design.

    The parameters of all calibrated materials change in every run. The design fills the joint bounds of all
    materials, so that the parameters of different materials vary independently of each other.

    Parameters
    ----------
    case : Part
        Sampler of the design, and bounds of the parameters.
    size : int
        Number of runs of the design.
    reused : sequence of mapping, optional
        Parameters of reused runs of an earlier case; each reused run replaces one run of the design.

    Returns
    -------
    list of dict
        Parameters by material, for each run that is still to be made: ``size`` minus the number of reused runs, taken
        from the first points of the sequence without those of reused runs. If parameters are whole numbers, repeated
        points and the starting parameters are left out of the sequence.
    """
    boxes = {name: np.array(case.materials[name].box, dtype=np.float64) for name in case.calibrated}
    if size == 0:
        return []
    points = _points(case, size, np.concatenate(list(boxes.values())))
    ends = np.cumsum([len(box) for box in boxes.values()])
    columns = dict(zip(boxes, np.split(points, ends[:-1], axis=1), strict=True))
    fixed = {name: material.start_parameters for name, material in case.materials.items()}
    design = [
        {name: columns[name][k].tolist() if name in columns else list(x) for name, x in fixed.items()}
        for k in range(size)
    ]
    there = {tuple(tuple(x[name]) for name in columns) for x in reused}
    missing = [x for x in design if tuple(tuple(x[name]) for name in columns) not in there]
    return missing[: max(size - len(reused), 0)]
