"""Search for the X to simulate next: NSGA-II on the surrogate, least squares, and the floor of the cost.

Only some points of the unit box can be simulated if some parameters are whole numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.config import Optimiser
from radcal.inference.bounded import least_squares, sobol
from radcal.inference.pooled_laws import LOOKS
from radcal.objectives import Comparison
from radcal.objectives.base import PredictedPoints
from radcal.objectives.history import Front, Proposal, Score
from radcal.proposals.nsga2 import nsga2
from radcal.proposals.surrogate import Surrogate
from radcal.seeds import derived_seed

Doubles = NDArray[np.float64]

_FAVOUR = 2.0  # standard errors by which the surrogate's statistics may err towards the target
_STARTS = 12
_SMALLEST = 1e-9  # radius of a trust region; least squares need bounds that differ
_SCREENED = 1024
_BRANCHES = 4  # roundings of whole-number parameters from which the search continues
_CERTAIN = 1e-14  # sum of squares that counts as zero
_NO_COST = 1e-9
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


def elsewhere(surrogate: Surrogate, known: Doubles, seed: int) -> Doubles:
    """Points that have not been simulated, as candidates if the best point has been simulated already.

    Parameters
    ----------
    surrogate : Surrogate
        Surrogate, which holds the bounds, and which parameters are whole numbers.
    known : ndarray, shape (k, d)
        Points of the unit box that are not returned.
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
    return np.asarray(points[np.abs(known[None] - points[:, None]).max(axis=2).min(axis=1) > SAME])


class Search:
    """Search for the point with the smallest cost on a surrogate.

    A point has a coordinate from 0 to 1 for each parameter X and, if the looks are searched, for the log of the looks.

    Parameters
    ----------
    objective : Comparison
        Objective, which gives residuals and cost of predicted statistics.
    surrogate : Surrogate
        Surrogate, which predicts the statistics at any X.
    chosen : sequence of list of float
        Further X that count as simulated.
    """

    def __init__(self, objective: Comparison, surrogate: Surrogate, chosen: Sequence[Sequence[float]] = ()) -> None:
        self.objective, self.surrogate = objective, surrogate
        self._known = surrogate.unit([*surrogate.parameters, *chosen])
        self._looks = np.log([LOOKS[0], LOOKS[1] * objective.material.looks])
        self._d = len(objective.material.box)
        self.dimension = self._d + objective.free_looks

    def point(self, parameters: ArrayLike, looks: float) -> Doubles:
        """Point of the unit box at given X and looks, shape (dimension,)."""
        unit = self.surrogate.unit(parameters)
        if not self.objective.free_looks:
            return unit
        low, high = self._looks
        return np.append(unit, np.clip((np.log(looks) - low) / (high - low), 0.0, 1.0))

    def split(self, points: Doubles) -> tuple[Doubles, Doubles]:
        """Parameters X, shape (m, d), and looks, shape (m,), at points of the unit box."""
        x = self.surrogate.scaled(points[:, : self._d])
        if not self.objective.free_looks:
            return x, np.full(len(points), self.objective.material.looks)
        return x, np.exp(self._looks[0] + points[:, self._d] * (self._looks[1] - self._looks[0]))

    def _at(self, points: Doubles, favour: float) -> PredictedPoints:
        unit = points[:, : self._d]
        slack = favour * self.surrogate.standard_error(unit) if favour > 0.0 else 0.0
        return PredictedPoints(self.surrogate.predict(unit), *self.split(points), slack)

    def cost(self, points: ArrayLike, favour: float = 0.0) -> Doubles:
        """Predicted cost at points of the unit box, shape (m, dimension) to (m,)."""
        return self.objective.cost(self._at(np.atleast_2d(np.asarray(points, dtype=np.float64)), favour))

    def distance(self, points: Doubles, favour: float = 0.0) -> Doubles:
        """Sum of squared residuals at points of the unit box, shape (m, dimension) to (m,)."""
        return np.asarray((self.objective.residuals(self._at(points, favour)) ** 2).sum(axis=1))

    def uncertainty(self, point: Doubles) -> float:
        """Sum of squares of the surrogate's standard errors at one point, each divided by the objective's ``scale``."""
        error = self.surrogate.standard_error(point[None, : self._d])[0]
        return float(((error / self.objective.scale) ** 2).sum())

    def snapped(self, points: Doubles) -> Doubles:
        """Points with their whole-number parameters rounded, shape (m, dimension)."""
        return np.concatenate([self.surrogate.snapped(points[:, : self._d]), points[:, self._d :]], axis=1)

    def polish(self, start: Doubles, favour: float = 0.0, radius: float = np.inf) -> Doubles:
        """Point that least squares find from a start; if residuals remain, further searches reduce the cost.

        Whole-number parameters are first treated as continuous, and then rounded down and up. For each rounding, the
        other parameters are searched again: branch and bound with one branching (Land and Doig 1960).

        Parameters
        ----------
        start : ndarray, shape (dimension,)
            Point of the unit box at which the search starts.
        favour : float
            Number of standard errors by which the surrogate's statistics may err towards the target.
        radius : float
            Largest distance from the start along any coordinate of the unit box.

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

    def _polished(self, start: Doubles, favour: float, low: Doubles, high: Doubles, free: NDArray[np.bool_]) -> Doubles:
        """Point that least squares find in the ``free`` coordinates; the other coordinates keep their values."""
        best = start
        if not free.any():
            return best

        def of(what: Callable[[PredictedPoints], Doubles], part: Doubles) -> Doubles:
            full = np.repeat(start[None], len(part), axis=0)
            full[:, free] = part
            return what(self._at(full, favour))

        for number, what in enumerate((self.objective.residuals, self.objective.refined)):
            part = least_squares(partial(of, what), best[free], low[free], high[free], self.objective.tolerance).x
            point = start.copy()
            point[free] = part
            if number == 0 or self.cost(point, favour)[0] < self.cost(best, favour)[0]:
                best = point
            if not self.objective.refines or self.distance(best[None], favour)[0] < _CERTAIN:
                break
        return best

    def minimum(
        self, starts: Sequence[Doubles], seed: int, favour: float = 0.0, count: int = _STARTS
    ) -> tuple[Doubles, float]:
        """Point with the smallest predicted cost, from a multi-start search.

        Parameters
        ----------
        starts : sequence of ndarray, shape (dimension,)
            Points to start from, besides the best points of a Sobol sample.
        seed : int
            Seed of the Sobol sample.
        favour : float
            Number of standard errors by which the surrogate's statistics may err towards the target.
        count : int
            Number of starts, including those from the Sobol sample.

        Returns
        -------
        point : ndarray, shape (dimension,)
        cost : float
            Predicted cost at the point.
        """
        listed = None if self.objective.free_looks else lattice(self.surrogate)
        if listed is not None:  # the costs of all points replace a search
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

    def _starts(self, best: Score) -> list[Doubles]:
        return [self.point(*start) for start in ((best.parameters, best.looks), *self.objective.starts)]

    def without_trend(self, best: Score, seed: int) -> tuple[Doubles, float] | None:
        """Better X that follows if the discrepancy of the best run holds everywhere, while the runs leave this open.

        Kriging continues changes of the discrepancy from run to run. Along the directions in which no two runs differ,
        the runs do not show these changes: a linear change along d parameters is determined by d + 1 runs, not by
        fewer. With fewer runs, kriging and the constant discrepancy of the best run are two extrapolations between
        which the runs do not decide.

        Parameters
        ----------
        best : Score
            Score of the best verified run.
        seed : int
            Seed of the search.

        Returns
        -------
        point : ndarray, shape (dimension,)
            Point with the smallest predicted cost.
        cost : float
            Its predicted cost.
            None in place of both if d + 1 runs have been made, if no baseline is used, if the objective explores, if
            another run is nearer to the X than the best run and thus shows the discrepancy there, or if the X improves
            the best verified cost by ``improvement`` of the objective or less.
        """
        training, known = self.surrogate.training, self.surrogate.parameters
        if self.objective.explores or len(known) > self._d or not training.baseline.any():
            return None
        alone = Search(self.objective, Surrogate(training.of_run(best.parameters), self.objective))
        starts = self._starts(best)
        point, cost = alone.minimum(starts, seed, count=len(starts) + 2)
        apart = ((self.surrogate.unit(known) - point[: self._d]) ** 2).sum(axis=1)
        near = (known[np.argmin(apart)] == np.asarray(best.parameters)).all()
        return (point, cost) if near and best.cost - cost > self.objective.improvement else None

    def outlook(self, best: Score, seed: int) -> tuple[float, float | None, float | None]:
        """Improvement on the best verified run that the surrogate of all runs, or :meth:`without_trend`, predicts.

        Parameters
        ----------
        best : Score
            Score of the best verified run.
        seed : int
            Seed of the search.

        Returns
        -------
        gain : float
            Decrease from the best verified cost to the smallest predicted cost.
        floor : float or None
            Smallest cost if the surrogate's statistics may err by two standard errors towards the target; None for an
            objective that does not explore.
        moved_db : float or None
            Largest difference over the incidence seen between the laws of the best run and of the best predicted X
            [dB]; None for a law without a curve. If both predictions promise more than ``improvement`` of the
            objective, the larger difference.
        """
        starts = self._starts(best)
        point, cost = self.minimum(starts, seed, count=len(starts) + 2)
        x = self.surrogate.scaled(point[: self._d])
        floor = None
        if self.objective.explores:
            floor = min(cost, self.minimum([*starts, point], seed, _FAVOUR)[1])
        gain, moved_db = max(best.cost - cost, 0.0), self.objective.moved_db(best.parameters, x)
        if other := self.without_trend(best, seed):
            there = self.objective.moved_db(best.parameters, self.surrogate.scaled(other[0][: self._d]))
            both = (moved_db, there) if gain > self.objective.improvement else (there,)
            gain = max(gain, best.cost - other[1])
            moved_db = max((value for value in both if value is not None), default=None)
        return gain, floor, moved_db

    def batch(self, count: int, config: Optimiser, seed: int, best: Score, failures: int = 0) -> list[Proposal]:
        """Choose the next ``count`` X of a material to simulate side by side, the first as :meth:`propose` does.

        Each further X is chosen likewise on a draw of the surrogate (:meth:`.Surrogate.drawn`). It is thus as far from
        the first as the surrogate is uncertain, and the runs together show how its error changes in between. Taking the
        prediction at the first X as a run (kriging believer) would not move the best predicted X. A further X that has
        been simulated, or chosen before, is left out, and so is one whose predicted statistics differ from those of a
        chosen X by less than an improvement of the cost.

        References
        ----------
        Kandasamy et al., "Parallelised Bayesian optimisation via Thompson sampling", AISTATS (2018); Ginsbourger, Le
        Riche and Carraro, "Kriging is well-suited to parallelize optimization" (2010), for the kriging believer.
        """
        found = [self.propose(config, seed, best, failures)]
        for number in range(1, count):
            draw = derived_seed(seed, "batch", number)
            search = Search(self.objective, self.surrogate.drawn(draw), [one.parameters for one in found])
            one = search.propose(config, draw, best, failures)
            point = self.point(one.parameters, one.looks or self.objective.material.looks)
            # the draw's own predictions give way to those of the surrogate
            statistics = self.surrogate.predict(point[None, : self._d])[0]
            known = [chosen.statistics for chosen in found if chosen.statistics]
            if search._fresh(point) and not any(self._alike(statistics, other) for other in known):
                cost = float(self.cost(point)[0])
                found.append(replace(one, cost=cost, floor=None, statistics=statistics.tolist(), front=Front()))
        return found

    def _alike(self, first: ArrayLike, second: ArrayLike) -> bool:
        """Whether two runs with these statistics tell the same: with one as target, the other has hardly any cost."""
        apart = (np.asarray(first) - np.asarray(second)) / self.objective.scale
        return bool(0.5 * (apart**2).sum() < self.objective.improvement)

    def propose(self, config: Optimiser, seed: int, best: Score, failures: int = 0) -> Proposal:
        """Choose the next X of a material to simulate.

        Least squares start at the best point of NSGA-II, at the best run and at the objective's own starts. If the
        surrogate predicts a clearly smaller cost at one of the resulting points, the point is proposed. Of several
        equally good points, the one with the smallest standard errors is proposed. After proposals without improvement,
        every other proposal is searched near the best verified point, within a radius that shrinks with the number of
        failures (a trust region; Conn, Gould and Toint 2000). Runs near the best point improve the surrogate nearby.

        If no clearly smaller cost is predicted, two multi-start searches follow. The first multi-start search
        minimises the predicted cost. The second multi-start search minimises the cost of statistics that may err by two
        standard errors towards the target; its minimum is the floor. If the floor is clearly below the best verified
        cost, the point of the floor is proposed. A higher floor means that no point inside the bounds is clearly better
        than the best run. An objective that does not explore omits the multi-start searches. It proposes the point of
        :meth:`without_trend`, if there is one, otherwise the point with the smallest predicted cost.

        Parameters
        ----------
        config : Optimiser
            Settings of NSGA-II; if ``polish`` is false, the best point of NSGA-II is proposed.
        seed : int
            Seed of all random numbers.
        best : Score
            Score of the best verified run.
        failures : int
            Number of iterations since that of the best run.

        Returns
        -------
        Proposal
        """
        direct = config.objective == "rms"
        goals = 1 if direct else len(self.objective.part_names)

        def minimised(points: Doubles) -> Doubles:
            at = self._at(self.snapped(points), 0.0)
            return self.objective.cost(at)[:, None] if direct else self.objective.parts(at)

        population = nsga2(minimised, self.dimension, config, seed, goals)
        first = self.snapped(population.points[:1])[0]
        front = Front()
        if goals > 1:
            x, looks = self.split(self.snapped(population.points[population.front]))
            front = Front(x.tolist(), looks.tolist(), population.objectives[population.front].tolist())
        nsga2_cost = float(self.cost(first)[0])

        def proposal(point: Doubles, mode: str, floor: float | None = None) -> Proposal:
            """Proposal of a point, or of another point if rounding leads to an X that has been simulated already."""
            if self.surrogate.integer.any() and not self._fresh(point):
                if floor is not None and not self.objective.first.leaves_open(floor, best.cost):
                    # no X is clearly better than that of the best run, which is proposed again and needs no new run
                    return Proposal(list(best.parameters), "exploit", best.looks, best.cost, floor, nsga2_cost)
                others = elsewhere(self.surrogate, self._known, seed)
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

        if not config.polish:
            return proposal(first, "exploit")
        there, *others = self._starts(best)
        if failures % 2 == 1:
            point = self.polish(there, radius=max(0.5 ** ((failures + 1) // 2 + 1), _SMALLEST))
            if self._promising([point], best).any() and self._fresh(point):
                return proposal(point, "exploit")
        near = [self.polish(start) for start in (first, there, *others)]
        promising = self._promising(near, best)
        fresh = [point for point, good in zip(near, promising, strict=True) if good and self._fresh(point)]
        if fresh:
            return proposal(min(fresh, key=self.uncertainty), "exploit")
        if not self.objective.explores:
            if other := self.without_trend(best, seed):
                return proposal(other[0], "explore")
            return proposal(min(near, key=lambda point: self.cost(point)[0]), "exploit")
        point, cost = self.minimum([first, there, *others], seed)
        if self._promising([point], best).any() and self._fresh(point):
            return proposal(point, "exploit")
        if self.surrogate.training.direct:
            return proposal(point, "exploit")  # no floor: a surrogate of (xi, omega, alpha) has no standard errors
        hopeful, floor = self.minimum([first, there, point], seed, _FAVOUR)
        floor = min(floor, cost)
        leaves_open = partial(self.objective.first.leaves_open, best=best.cost)
        if leaves_open(floor) and not (leaves_open(cost) and self._fresh(point)):
            return proposal(hopeful, "explore", floor=floor)
        return proposal(point, "exploit", floor=floor)

    def _promising(self, points: Sequence[Doubles], best: Score) -> NDArray[np.bool_]:
        return self.objective.first.promising(np.array([float(self.cost(point)[0]) for point in points]), best.cost)

    def _fresh(self, point: Doubles) -> bool:
        """Whether the X of a point has not been simulated yet."""
        return bool(np.abs(self._known - point[: self._d]).max(axis=1).min() > SAME)
