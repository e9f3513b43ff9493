"""NSGA-II of the library Platypus on the unit box; one call of the objective evaluates a whole population."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Optimiser


@dataclass(frozen=True)
class Population:
    """Last population of a search, in ascending order of the sum of the objectives.

    Attributes
    ----------
    points : ndarray, shape (population, d)
        Points of the unit box.
    objectives : ndarray, shape (population, m)
        Objectives of each point.
    front : ndarray of int, shape (f,)
        Indices of the points on the front: no other point is better in one objective and as good in the others.
    """

    points: NDArray[np.float64]
    objectives: NDArray[np.float64]
    front: NDArray[np.intp]


def nsga2(objective: Any, dimension: int, config: Optimiser, seed: int, objectives: int = 1) -> Population:
    """Minimise a batched objective on the unit box with Platypus' NSGA-II.

    Parameters
    ----------
    objective : callable
        Function from points, shape (n, d), to values, shape (n,), or (n, m) for m objectives.
    dimension : int
        Dimension d of the unit box.
    config : Optimiser
        Size of the population and number of evaluations.
    seed : int
        Seed of Platypus' random numbers.
    objectives : int
        Number m of objectives.

    Returns
    -------
    Population

    References
    ----------
    Deb et al., "A fast and elitist multiobjective genetic algorithm: NSGA-II" (2002).
    """
    import platypus

    class Batched(platypus.Evaluator):  # type: ignore[misc]
        def evaluate_all(self, jobs: Any, **_: Any) -> Any:  # of a generation, in one call of the objective
            jobs = list(jobs)
            points = np.array([job.solution.variables[:] for job in jobs], dtype=np.float64)
            state = random.getstate()
            values = objective(points)
            random.setstate(state)  # libraries may draw numbers when imported, which must not change those of Platypus
            for job, value in zip(jobs, values, strict=True):
                job.solution.objectives[:] = [float(part) for part in np.atleast_1d(value)]
                job.solution.constraint_violation = 0.0
                job.solution.feasible = True
                job.solution.evaluated = True
            return jobs

    problem = platypus.Problem(dimension, objectives)
    problem.types[:] = [platypus.Real(0.0, 1.0) for _ in range(dimension)]
    earlier = random.getstate()  # Platypus draws from the module random, whose state is restored
    random.seed(seed)
    try:
        algorithm = platypus.NSGAII(problem, config.population, evaluator=Batched())
        algorithm.run(max(config.evaluations, config.population))
    finally:
        random.setstate(earlier)
    population = sorted(algorithm.population, key=lambda s: sum(s.objectives))
    best = {id(solution) for solution in platypus.nondominated(population)}
    values = np.array([solution.objectives[:] for solution in population], dtype=np.float64)
    front = np.flatnonzero([id(solution) in best for solution in population])
    _, first = np.unique(values[front], axis=0, return_index=True)  # a population may contain a point several times
    points = np.array([solution.variables[:] for solution in population], dtype=np.float64)
    return Population(points, values, front[np.sort(first)])
