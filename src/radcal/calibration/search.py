"""Where to simulate next: NSGA-II on the surrogate, least squares from its best points, and a search for a floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.bounded import least_squares, sobol
from radcal.calibration.history import Front, Proposal, Score
from radcal.calibration.lattice import SAME, corners, elsewhere, lattice
from radcal.calibration.law_fit import LOOKS
from radcal.calibration.nsga2 import Population, nsga2
from radcal.calibration.objectives import Comparison
from radcal.calibration.objectives.objective import Points
from radcal.calibration.surrogate import Surrogate
from radcal.config import Optimiser

__all__ = ["Search"]

_FAVOUR = 2.0  # standard errors of the surrogate taken in favour of a better point
_STARTS = 12
_SCREENED = 1024
_BRANCHES = 4  # roundings of whole parameters that are followed
_CERTAIN = 1e-14  # sum of squares that counts as zero
_NO_COST = 1e-9
_CLEARLY = 0.9  # of the best verified cost: a floor above it is none to look for


class Search:
    """Cost on a surrogate, at points of the unit box of X and, where they are free, of the logarithm of the looks.

    Parameters
    ----------
    objective : Comparison
        Residuals and cost.
    surrogate : Surrogate
        Statistics at any X.
    """

    def __init__(self, objective: Comparison, surrogate: Surrogate) -> None:
        self.objective, self.surrogate = objective, surrogate
        self._looks = np.log([LOOKS[0], LOOKS[1] * objective.material.looks])
        self._d = len(objective.material.box)
        self.dimension = self._d + objective.free_looks

    def point(self, parameters: ArrayLike, looks: float) -> NDArray[np.float64]:
        """Point of the unit box of X and looks, shape (dimension,)."""
        unit = self.surrogate.unit(parameters)
        if not self.objective.free_looks:
            return unit
        low, high = self._looks
        return np.append(unit, np.clip((np.log(looks) - low) / (high - low), 0.0, 1.0))

    def split(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """X, shape (m, d), and looks, shape (m,), of points."""
        x = self.surrogate.scaled(points[:, : self._d]) if self.surrogate.integer.any() else None
        low, high = self.surrogate.bounds.T
        x = low + points[:, : self._d] * (high - low) if x is None else x
        if not self.objective.free_looks:
            return x, np.full(len(points), self.objective.material.looks)
        return x, np.exp(self._looks[0] + points[:, self._d] * (self._looks[1] - self._looks[0]))

    def _at(self, points: NDArray[np.float64], favour: float) -> Points:
        unit = points[:, : self._d]
        slack = favour * self.surrogate.standard_error(unit) if favour > 0.0 else 0.0
        return Points(self.surrogate.predict(unit), *self.split(points), slack)

    def cost(self, points: ArrayLike, favour: float = 0.0) -> NDArray[np.float64]:
        """Predicted cost at points, shape (m, dimension) to (m,)."""
        return self.objective.cost(self._at(np.atleast_2d(np.asarray(points, dtype=np.float64)), favour))

    def distance(self, points: NDArray[np.float64], favour: float = 0.0) -> NDArray[np.float64]:
        """Sum of squared residuals at points, shape (m, dimension) to (m,)."""
        return np.asarray((self.objective.residuals(self._at(points, favour)) ** 2).sum(axis=1))

    def uncertainty(self, point: NDArray[np.float64]) -> float:
        """Sum of squared standard errors of the surrogate at one point, in the scale of the objective."""
        error = self.surrogate.standard_error(point[None, : self._d])[0]
        return float(((error / self.objective.scale) ** 2).sum())

    def snapped(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same with whole parameters rounded."""
        if not self.surrogate.integer.any():
            return points
        return np.concatenate([self.surrogate.snapped(points[:, : self._d]), points[:, self._d :]], axis=1)

    def polish(self, start: NDArray[np.float64], favour: float = 0.0, radius: float = np.inf) -> NDArray[np.float64]:
        """Least squares from a point; where the residuals cannot be met, the smallest cost.

        Whole parameters are first searched like others, then rounded both ways and the others searched again: branch
        and bound with one branching (Land and Doig 1960).

        Parameters
        ----------
        start : ndarray, shape (dimension,)
            Point of the unit box.
        favour : float
            Standard errors of the surrogate in favour of the target.
        radius : float
            Largest step in any parameter.

        Returns
        -------
        ndarray, shape (dimension,)
        """
        low, high = np.maximum(start - radius, 0.0), np.minimum(start + radius, 1.0)
        point = self._polished(start, favour, low, high, np.ones(self.dimension, dtype=np.bool_))
        integer = self.surrogate.integer
        if not integer.any():
            return point
        free = np.append(~integer, [True] * (self.dimension - self._d)).astype(np.bool_)
        around = corners(self.surrogate, point[: self._d])
        around = np.concatenate([around, np.repeat(point[None, self._d :], len(around), axis=0)], axis=1)
        around = around[np.argsort(self.distance(around, favour), kind="stable")][:_BRANCHES]
        found = [self._polished(corner, favour, low, high, free) for corner in around]
        return min(found, key=lambda u: (self.cost(u, favour)[0], self.distance(u[None], favour)[0]))

    def _polished(
        self,
        start: NDArray[np.float64],
        favour: float,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        free: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """The same in some of the parameters, the others kept."""
        best = start
        if not free.any():
            return best

        def of(what: Callable[[Points], NDArray[np.float64]], part: NDArray[np.float64]) -> NDArray[np.float64]:
            full = np.repeat(start[None], len(part), axis=0)
            full[:, free] = part
            return what(self._at(full, favour))

        for number, what in enumerate((self.objective.residuals, *self.objective.refinements())):
            part = least_squares(partial(of, what), best[free], low[free], high[free], self.objective.tolerance).x
            point = start.copy()
            point[free] = part
            if number == 0 or self.cost(point, favour)[0] < self.cost(best, favour)[0]:
                best = point
            if self.distance(best[None], favour)[0] < _CERTAIN:
                break
        return best

    def minimum(
        self, starts: Sequence[NDArray[np.float64]], seed: int, favour: float = 0.0, count: int = _STARTS
    ) -> tuple[NDArray[np.float64], float]:
        """Multi-start search for the smallest cost.

        Parameters
        ----------
        starts : sequence of ndarray, shape (dimension,)
            Points to start from besides the best of a Sobol sample.
        seed : int
            Seed of the sample.
        favour : float
            Standard errors of the surrogate in favour of the target.
        count : int
            Number of starts.

        Returns
        -------
        point : ndarray, shape (dimension,)
        cost : float
            Predicted cost there.
        """
        listed = None if self.objective.free_looks else lattice(self.surrogate)
        if listed is not None:  # no search where all points can be looked at
            each = self.cost(listed, favour)
            return listed[np.argmin(each)], float(each.min())
        more = count - len(starts)
        if more > 0:
            sample = self.snapped(sobol(self.dimension, _SCREENED, seed))
            starts = [*starts, *sample[np.argsort(self.distance(sample, favour), kind="stable")][:more]]
        best, least = starts[0], float(self.cost(starts[0], favour)[0])
        for start in starts:
            point = self.polish(start, favour)
            cost = float(self.cost(point, favour)[0])
            if cost < least:
                best, least = point, cost
            if least < _NO_COST:
                break
        return best, least

    def _starts(self, best: Score) -> list[NDArray[np.float64]]:
        return [self.point(*start) for start in ((best.parameters, best.looks), *self.objective.starts)]

    def outlook(self, best: Score, seed: int) -> tuple[float, float | None, float | None]:
        """What the surrogate of all runs still promises over the best verified run.

        Parameters
        ----------
        best : Score
            The best verified run's.
        seed : int
            Seed of the search.

        Returns
        -------
        gain : float
            Largest decrease of the cost that is predicted.
        floor : float or None
            Smallest cost with the statistics two standard errors in favour, of an objective that explores.
        moved_db : float or None
            Largest difference of the laws over the incidence seen [dB]; None without a curve.
        """
        starts = self._starts(best)
        point, cost = self.minimum(starts, seed, count=len(starts) + 2)
        x = self.surrogate.scaled(point[: self._d])
        floor = None
        if self.objective.explores:
            floor = min(cost, self.minimum([*starts, point], seed, _FAVOUR)[1])
        return max(best.cost - cost, 0.0), floor, self.objective.moved_db(best.parameters, x)

    def propose(self, config: Optimiser, seed: int, best: Score, failures: int = 0) -> Proposal:
        """Choose the next X of a material.

        NSGA-II's best point, the best run and the objective's own starts are fitted by least squares. Where the
        surrogate then promises a clearly better cost, that point is proposed; among several that are as good, the one
        that it knows best. After a promise that was not kept, every other proposal keeps near the best verified point,
        within a radius that shrinks with each failure: there the surrogate learns what it needs (a trust region, Conn,
        Gould and Toint 2000).

        Where nothing better is promised, a multi-start search looks for a better point, first on the surrogate as it
        is, then two standard errors in favour of the target: that minimum is the floor. A floor clearly below the best
        verified cost is explored; one that is not says that nothing nearer exists. An objective that does not explore
        takes the smallest predicted cost.

        Parameters
        ----------
        config : Optimiser
            NSGA-II settings; without ``polish`` its best point is the proposal.
        seed : int
            Seed of all random numbers.
        best : Score
            Score of the best verified run.
        failures : int
            Verified proposals since that best one.

        Returns
        -------
        Proposal
        """
        direct = config.objective == "rms"
        goals = 1 if direct else len(self.objective.part_names)
        population = nsga2(
            lambda points: self._goals(self.snapped(points), direct), self.dimension, config, seed, goals
        )
        first = self.snapped(population.points[:1])[0]
        front = self._front(population) if goals > 1 else Front()
        told = partial(self._proposal, seed=seed, best=best, nsga2_cost=float(self.cost(first)[0]), front=front)
        if not config.polish:
            return told(first, "exploit")
        there, *others = self._starts(best)
        if failures % 2 == 1:
            point = self.polish(there, radius=0.5 ** ((failures + 1) // 2 + 1))
            if self._promising([point], best).any() and self._fresh(point):
                return told(point, "exploit")
        near = [self.polish(start) for start in (first, there, *others)]
        promising = self._promising(near, best)
        fresh = [point for point, good in zip(near, promising, strict=True) if good and self._fresh(point)]
        if fresh:
            return told(min(fresh, key=self.uncertainty), "exploit")
        if not self.objective.explores:
            return told(min(near, key=lambda point: self.cost(point)[0]), "exploit")
        point, cost = self.minimum([first, there, *others], seed)
        if self._promising([point], best).any() and self._fresh(point):
            return told(point, "exploit")
        if self.surrogate.training.direct:
            return told(point, "exploit")  # standard errors of (xi, omega, alpha) say little: no floor is claimed
        hopeful, floor = self.minimum([first, there, point], seed, _FAVOUR)
        floor = min(floor, cost)
        better = _CLEARLY * best.cost
        if floor < better and not (cost < better and self._fresh(point)):
            return told(hopeful, "explore", floor=floor)
        return told(point, "exploit", floor=floor)

    def _goals(self, points: NDArray[np.float64], direct: bool) -> NDArray[np.float64]:
        """What NSGA-II minimises, shape (m, p): the cost itself or the parts of the sum of squares."""
        if direct:
            return self.cost(points)[:, None]
        return self.objective.parts(self._at(points, 0.0))

    def _front(self, population: Population) -> Front:
        """Front of several objectives that NSGA-II has found."""
        x, looks = self.split(self.snapped(population.points[population.front]))
        return Front(x.tolist(), looks.tolist(), population.objectives[population.front].tolist())

    def _promising(self, points: Sequence[NDArray[np.float64]], best: Score) -> NDArray[np.bool_]:
        return self.objective.promising(np.array([float(self.cost(point)[0]) for point in points]), best.cost)

    def _fresh(self, point: NDArray[np.float64]) -> bool:
        """Whether no run was made at the X of a point."""
        known = self.surrogate.unit(self.surrogate.parameters)
        return bool(np.abs(known - point[: self._d]).max(axis=1).min() > SAME)

    def _proposal(
        self,
        point: NDArray[np.float64],
        mode: str,
        seed: int,
        best: Score,
        nsga2_cost: float,
        front: Front,
        floor: float | None = None,
    ) -> Proposal:
        """Proposal of a point, or of another one where whole parameters have brought it to a run that was made."""
        if self.surrogate.integer.any() and not self._fresh(point):
            if floor is not None and floor >= _CLEARLY * best.cost:
                # nothing nearer exists, and the best is known: no run is spent on saying so
                return Proposal(list(best.parameters), "exploit", best.looks, best.cost, floor, nsga2_cost)
            others = elsewhere(self.surrogate, seed)
            if not len(others):
                return Proposal(list(best.parameters), "exhausted", best.looks, best.cost, best.cost, nsga2_cost)
            others = np.concatenate([others, np.repeat(point[None, self._d :], len(others), axis=0)], axis=1)
            point, mode = others[np.argmin(self.cost(others, _FAVOUR))], "explore"
        unit = point[None, : self._d]
        _, looks = self.split(point[None])
        return Proposal(
            parameters=[float(v) for v in self.surrogate.scaled(point[: self._d])],
            mode=mode,  # type: ignore[arg-type]
            looks=float(looks[0]),
            cost=float(self.cost(point)[0]),
            floor=floor,
            nsga2_cost=nsga2_cost,
            statistics=self.surrogate.predict(unit)[0].tolist(),
            errors=self.surrogate.standard_error(unit)[0].tolist(),
            q2=[float(v) if np.isfinite(v) else None for v in self.surrogate.training.q2],
            front=front,
        )
