"""Where to simulate next: NSGA-II on the surrogate, polish, and a search for a floor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.calibration.history import Proposal
from radcal.calibration.lattice import SAME, corners, elsewhere, lattice
from radcal.calibration.nsga2 import nsga2
from radcal.calibration.surrogate import Surrogate, to_direct
from radcal.config import Optimiser

__all__ = ["FAVOUR", "UNREACHABLE_SHARE", "Search", "propose"]

FAVOUR = 2.0  # standard errors of the surrogate taken in favour of a better point
UNREACHABLE_SHARE = 0.9  # a floor above this share of the best verified rms: nothing nearer exists
_STARTS = 12
_SCREENED = 1024
_GRID = 200  # points on which the search compares densities; the score uses 1,000
_STEP = 1e-5
_BRANCHES = 4  # roundings of whole parameters that are followed


class Search:
    """The mismatch between a surrogate's density and a target, on the unit box.

    Parameters
    ----------
    surrogate : Surrogate
        Trained.
    target_dp : array_like, shape (3,)
        xi [dB], omega [dB], alpha of the target.
    """

    def __init__(self, surrogate: Surrogate, target_dp: ArrayLike) -> None:
        self._surrogate = surrogate
        self.target_dp = np.asarray(target_dp, dtype=np.float64)
        mean, sd, skewness = skewnormal.centred(self.target_dp)
        self._target = np.array([mean, np.log(sd), skewness])
        # asymptotic standard errors of a normal sample's moments, common factor 1/sqrt(n) left out
        self._scale = np.array([sd, np.sqrt(0.5), np.sqrt(6.0)])
        self._grid = skewnormal.target_grid(self.target_dp, _GRID)
        self._density = skewnormal.density(self._grid, self.target_dp)

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self._surrogate.bounds)

    def learnt(self, unit: NDArray[np.float64], favour: float = 0.0) -> NDArray[np.float64]:
        """(mean, log sd, skewness) at points, drawn to the target by up to ``favour`` standard errors."""
        values = self._surrogate.predict(unit)
        if favour > 0.0 and self._surrogate.outputs == "centred":
            reach = favour * self._surrogate.standard_error(unit)
            values = values + np.clip(self._target - values, -reach, reach)
        return self._surrogate.centred(values)

    def theta_residuals(self, unit: NDArray[np.float64], favour: float = 0.0) -> NDArray[np.float64]:
        """Scaled differences in centred parameters, shape (n, 3)."""
        return np.asarray((self.learnt(unit, favour) - self._target) / self._scale)

    def density_residuals(self, unit: NDArray[np.float64], favour: float = 0.0) -> NDArray[np.float64]:
        """Differences of the densities on the grid [1/dB], shape (n, 200)."""
        dp = to_direct(self.learnt(unit, favour))
        return np.stack([skewnormal.density(self._grid, row) for row in dp]) - self._density

    def rms(self, unit: ArrayLike, favour: float = 0.0) -> NDArray[np.float64]:
        """Density rms [1/dB] at points, shape (n, d) to (n,)."""
        residuals = self.density_residuals(np.atleast_2d(np.asarray(unit, dtype=np.float64)), favour)
        return np.asarray(np.sqrt(np.mean(residuals**2, axis=1)))

    def distance(self, unit: ArrayLike, favour: float = 0.0) -> NDArray[np.float64]:
        """Sum of squared scaled differences in theta at points, shape (n, d) to (n,)."""
        residuals = self.theta_residuals(np.atleast_2d(np.asarray(unit, dtype=np.float64)), favour)
        return np.asarray((residuals**2).sum(axis=1))

    def uncertainty(self, unit: NDArray[np.float64]) -> float:
        """Sum of squared scaled standard errors of the surrogate at one point."""
        return float(((self._surrogate.standard_error(unit)[0] / self._scale) ** 2).sum())

    def _least_squares(
        self, residuals: Any, start: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Bounded least squares from a point, the Jacobian from one batched call."""
        from scipy.optimize import least_squares

        d = len(start)

        def fun(unit: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(residuals(unit[None])[0])

        def jac(unit: NDArray[np.float64]) -> NDArray[np.float64]:
            forward = np.minimum(unit + _STEP * np.eye(d), 1.0)
            backward = np.maximum(unit - _STEP * np.eye(d), 0.0)
            values = residuals(np.concatenate([forward, backward]))
            width = np.diagonal(forward) - np.diagonal(backward)
            return np.asarray(((values[:d] - values[d:]) / width[:, None]).T)

        inside = np.clip(start, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
        found = least_squares(
            fun, inside, jac=jac, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=60, x_scale=1.0
        )
        return np.asarray(found.x)

    def polish(self, start: NDArray[np.float64], favour: float = 0.0, radius: float = np.inf) -> NDArray[np.float64]:
        """Nearest point in theta from ``start``; where theta cannot be met, the smallest density rms.

        Whole parameters are first searched like others, then rounded both ways and the others searched again:
        branch and bound with one branching (Land and Doig 1960).

        Parameters
        ----------
        start : ndarray, shape (d,)
            Point of the unit box.
        favour : float
            Standard errors of the surrogate in favour of the target.
        radius : float
            Largest step in any parameter.

        Returns
        -------
        ndarray, shape (d,)
        """
        low, high = np.maximum(start - radius, 0.0), np.minimum(start + radius, 1.0)
        integer = self._surrogate.integer
        unit = self._polished(start, favour, low, high, np.ones_like(integer))
        if not integer.any():
            return unit
        around = corners(self._surrogate, unit)
        around = around[np.argsort(self.distance(around, favour), kind="stable")][:_BRANCHES]
        found = [self._polished(corner, favour, low, high, ~integer) for corner in around]
        return min(found, key=lambda u: (self.rms(u, favour)[0], self.distance(u, favour)[0]))

    def _polished(
        self,
        start: NDArray[np.float64],
        favour: float,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        free: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """The same in some of the parameters, the others kept."""
        if not free.any():
            return start

        def whole(part: NDArray[np.float64]) -> NDArray[np.float64]:
            full = np.repeat(start[None], len(part), axis=0)
            full[:, free] = part
            return np.asarray(full)

        def theta(part: NDArray[np.float64]) -> NDArray[np.float64]:
            return self.theta_residuals(whole(part), favour)

        def density(part: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(self.density_residuals(whole(part), favour) / self._density.max())

        part = self._least_squares(theta, start[free], low[free], high[free])
        unit = np.asarray(whole(part[None])[0])
        if self.distance(unit, favour)[0] < 1e-14:
            return unit
        # the two costs weigh the parameters differently, which only matters where neither vanishes
        other = np.asarray(whole(self._least_squares(density, part, low[free], high[free])[None])[0])
        return other if self.rms(other, favour)[0] < self.rms(unit, favour)[0] else unit

    def minimum(self, starts: NDArray[np.float64], seed: int, favour: float = 0.0) -> tuple[NDArray[np.float64], float]:
        """Multi-start search for the smallest density rms.

        Parameters
        ----------
        starts : ndarray, shape (n, d)
            Points to start from besides the best of a Sobol sample.
        seed : int
            Seed of the sample.
        favour : float
            Standard errors of the surrogate in favour of the target.

        Returns
        -------
        unit : ndarray, shape (d,)
        rms : float
            Predicted rms there [1/dB].
        """
        from scipy.stats import qmc  # a second to import, which most jobs need not spend

        listed = lattice(self._surrogate)
        if listed is not None:  # no search where all points can be looked at
            each = self.rms(listed, favour)
            return listed[np.argmin(each)], float(each.min())
        sobol = qmc.Sobol(self.dimension, scramble=True, rng=np.random.default_rng(seed)).random(_SCREENED)
        sobol = self._surrogate.snapped(sobol)
        ranked = sobol[np.argsort(self.distance(sobol, favour), kind="stable")]
        best, best_rms = starts[0], float(self.rms(starts[:1], favour)[0])
        for start in np.concatenate([starts, ranked[: max(0, _STARTS - len(starts))]]):
            unit = self.polish(start, favour)
            rms = float(self.rms(unit, favour)[0])
            if rms < best_rms:
                best, best_rms = unit, rms
            if best_rms < 1e-9:
                break
        return best, best_rms


def propose(
    surrogate: Surrogate,
    target_dp: ArrayLike,
    config: Optimiser,
    seed: int,
    best_unit: ArrayLike,
    best_rms: float,
    failures: int = 0,
) -> Proposal:
    """Choose the next X of a material.

    NSGA-II's best point is polished by least squares. Where the surrogate then promises
    less than half of the best verified rms, that point is it. After a promise that was
    not kept, every other proposal keeps near the best verified point, within a radius
    that shrinks with each failure: there the surrogate learns what it needs (a trust
    region, Conn, Gould and Toint 2000).

    Where nothing better is promised, a multi-start search looks for a nearer point, first
    on the surrogate as it is, then two standard errors in favour of the target: that
    minimum is the floor. A floor clearly below the best verified rms is explored; one that
    is not says that nothing nearer exists.

    Parameters that are whole are whole in what is proposed, and a point that was simulated
    is not proposed again while there are others.

    Parameters
    ----------
    surrogate : Surrogate
        Trained.
    target_dp : array_like, shape (3,)
        xi [dB], omega [dB], alpha.
    config : Optimiser
        NSGA-II settings; without ``polish`` its best point is the proposal.
    seed : int
        Seed of all random numbers.
    best_unit : array_like, shape (d,)
        Best verified point, in the unit box.
    best_rms : float
        Its verified density rms [1/dB].
    failures : int
        Verified proposals since that best one.

    Returns
    -------
    Proposal
    """
    search = Search(surrogate, target_dp)
    cost = search.rms if config.objective == "rms" else search.distance
    population = nsga2(lambda unit: cost(surrogate.snapped(unit)), search.dimension, config, seed)
    first = surrogate.snapped(population[0])
    nsga2_rms = float(search.rms(first)[0])

    best = np.asarray(best_unit, dtype=np.float64)
    known = surrogate.unit(surrogate.parameters)

    def fresh(unit: NDArray[np.float64]) -> bool:
        return bool(np.abs(known - unit).max(axis=1).min() > SAME)

    def proposal(unit: NDArray[np.float64], mode: Any, floor_rms: float | None = None) -> Proposal:
        if surrogate.integer.any() and not fresh(unit):
            there = [float(v) for v in surrogate.scaled(best)]
            if floor_rms is not None and floor_rms >= UNREACHABLE_SHARE * best_rms:
                # nothing nearer exists, and the best is known: no run is spent on saying so
                return Proposal(there, "exploit", best_rms, floor_rms, nsga2_rms)
            others = elsewhere(surrogate, seed)
            if not len(others):
                return Proposal(there, "exhausted", best_rms, best_rms, nsga2_rms)
            unit, mode = others[np.argmin(search.rms(others, FAVOUR))], "explore"
        return Proposal(
            parameters=[float(v) for v in surrogate.scaled(unit)],
            mode=mode,
            predicted_rms=float(search.rms(unit)[0]),
            floor_rms=floor_rms,
            nsga2_rms=nsga2_rms,
        )

    if not config.polish:
        return proposal(first, "exploit")
    if failures % 2 == 1:
        unit = search.polish(best, radius=0.5 ** ((failures + 1) // 2 + 1))
        if search.rms(unit)[0] < 0.5 * best_rms and fresh(unit):
            return proposal(unit, "exploit")
    # the target's theta is met along curves in the box: of the points found on them, the one
    # that the surrogate knows best
    near = [search.polish(first), search.polish(best)]
    promising = [unit for unit in near if search.rms(unit)[0] < 0.5 * best_rms and fresh(unit)]
    if promising:
        return proposal(min(promising, key=search.uncertainty), "exploit")
    starts = np.stack([first, best])
    unit, rms = search.minimum(starts, seed)
    if rms < 0.5 * best_rms and fresh(unit):
        return proposal(unit, "exploit")
    if surrogate.outputs != "centred":
        return proposal(unit, "exploit")  # standard errors of (xi, omega, alpha) say little: no floor is claimed
    hopeful, floor_rms = search.minimum(np.concatenate([starts, unit[None]]), seed, FAVOUR)
    floor_rms = min(floor_rms, rms)
    if floor_rms < UNREACHABLE_SHARE * best_rms and not (rms < UNREACHABLE_SHARE * best_rms and fresh(unit)):
        return proposal(hopeful, "explore", floor_rms)
    return proposal(unit, "exploit", floor_rms)
