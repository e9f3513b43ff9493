"""Parts of Platypus' NSGA-II in equal but faster forms: evaluation of whole generations, copies, and fronts."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import platypus
from numpy.typing import NDArray

__all__ = ["Batched", "Generations", "StartingPopulation"]


class Batched(platypus.Evaluator):  # type: ignore[misc]
    """Evaluator that evaluates all solutions of a generation in one call of the objective.

    Parameters
    ----------
    objective : callable
        Function from points, shape (n, d), to values, shape (n,), or (n, m) for m objectives.
    """

    def __init__(self, objective: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> None:
        super().__init__()
        self._objective = objective

    def evaluate_all(self, jobs: Any, **_: Any) -> Any:
        """Jobs with the objectives of their solutions."""
        jobs = list(jobs)
        points = np.array([job.solution.variables[:] for job in jobs], dtype=np.float64)
        state = random.getstate()
        values = self._objective(points)
        random.setstate(state)  # libraries may draw numbers when imported, which must not change those of Platypus
        for job, value in zip(jobs, values, strict=True):
            job.solution.objectives[:] = [float(part) for part in np.atleast_1d(value)]
            job.solution.constraint_violation = 0.0
            job.solution.feasible = True
            job.solution.evaluated = True
        return jobs


class _Solution(platypus.Solution):  # type: ignore[misc]
    """Solution whose copy does not go through the module ``copy``, which takes most of the time of a generation."""

    def __deepcopy__(self, memo: Any) -> _Solution:
        found = _Solution.__new__(_Solution)
        found.__dict__.update(self.__dict__)
        for name in ("variables", "objectives", "constraints"):
            mine = getattr(self, name)
            found.__dict__[name] = platypus.FixedLengthArray(len(mine))
            found.__dict__[name][:] = mine[:]
        return found


class StartingPopulation(platypus.Generator):  # type: ignore[misc]
    """Generator of the random solutions of the first generation."""

    def generate(self, problem: Any) -> _Solution:
        """Random solution."""
        found = _Solution(problem)
        found.variables[:] = [kind.rand() for kind in problem.types]
        return found


class Generations(platypus.NSGAII):  # type: ignore[misc]
    """NSGA-II whose fronts come from one comparison of all pairs of solutions."""

    population: list[Any]

    def iterate(self) -> None:
        """Make the next generation."""
        offspring: list[Any] = []
        while len(offspring) < self.population_size:
            offspring.extend(self.variator.evolve(self.selector.select(self.variator.arity, self.population)))
        self.evaluate_all(offspring)
        offspring.extend(self.population)
        values = np.array([solution.objectives[:] for solution in offspring], dtype=np.float64)
        # worse[i, j]: solution j is better than i in one objective and as good in the others
        above = values[:, None] > values
        worse = np.asarray(above.any(axis=-1) & ~above.swapaxes(0, 1).any(axis=-1))
        left, rank = np.arange(len(offspring)), 0
        while left.size:
            beaten = worse[np.ix_(left, left)].any(axis=1)
            front = [offspring[k] for k in left[~beaten]]
            for solution in front:
                solution.rank = rank
            platypus.crowding_distance(front)
            left, rank = left[beaten], rank + 1
        self.population = platypus.nondominated_truncate(offspring, self.population_size)
