"""Unknowns of a law's posterior, their priors, and their likelihood in all passes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from radcal.assessment.budget import Budget
from radcal.assessment.curves import Curves
from radcal.assessment.evidence import Evidence, Unknowns
from radcal.assessment.field_prior import MOST_FIELD_DB, FieldPrior
from radcal.calibration.law_fit import LOOKS
from radcal.calibration.objectives import Comparison
from radcal.calibration.priors import looks_residuals
from radcal.calibration.surrogate import Surrogate
from radcal.config import Uncertainty
from radcal.measurement.levels import Levels

__all__ = ["Model"]

Doubles = NDArray[np.float64]

_CHUNK = 256  # number of points evaluated at a time
_STEP = 1e-4
_BATCH, _ROUNDS = 2000, 60
_LINEAR, _TRIED, _FEWEST = 4000, 20_000, 400  # most draws kept, draws made, fewest draws inside the bounds


class Model:
    """Posterior of one material's law and of the other unknowns, as a log density.

    A point of the posterior is a row of numbers:

    - X, scaled to the unit box;
    - the logarithm of the effective looks, if they are free;
    - the standard deviations between and within fields, divided by the scale of their priors;
    - for a law with a curve, standard normal deviates of the errors of incidence and resolutions.

    The errors of level, sampling and surrogate are normal and enter as variances, which has the same effect as sampling
    them.

    Parameters
    ----------
    objective : Comparison
        Objective of the material, which holds target, law and bounds.
    surrogate : Surrogate
        Surrogate that predicts the statistics of the bins at any X.
    levels : sequence of Levels
        Level normalisation of the measured image in each pass; the errors of level of the passes are independent.
    config : Uncertainty
        Configuration of the uncertainty budget.
    others : sequence of ndarray
        Log likelihood of the standard deviations between and within the fields of each other material
        (:func:`radcal.measurement.field_spread.spread_table`).
    """

    def __init__(
        self,
        objective: Comparison,
        surrogate: Surrogate,
        levels: Sequence[Levels],
        config: Uncertainty,
        others: Sequence[Doubles] = (),
    ) -> None:
        material = objective.material
        self.surrogate, self.sensor = surrogate, material.looks
        self.names, self.d = material.law.names, len(material.box)
        pairs = [(part, one) for part, one in zip(objective.passes, levels, strict=True) if part is not None]
        parts = [part for part, _ in pairs]
        self.evidence = Evidence(parts, [Budget.of(config, one) for _, one in pairs], material.looks)
        first = self.evidence.compared
        self.prior, self._looks_prior = first.prior, first.method.priors and material.decibels
        self._prior_rad = np.radians(self.prior.angles_deg if self.prior is not None else [])
        self.free_looks = first.method.free_looks and material.decibels
        self._log_looks = np.log([LOOKS[0], LOOKS[1] * material.looks])
        self.level_only = all(part.material.target.level_only for part in parts)
        angles = [np.asarray(part.material.target.incidence_deg, dtype=np.float64) for part in parts]
        self.seen_deg = [(float(a), float(b)) for a, b in (np.quantile(one, [0.05, 0.95]) for one in angles)]
        self.curves = None
        if material.law.has_curve and material.decibels:
            self.curves = Curves(material.law, surrogate.scaled(np.array([[0.3], [0.6]]) * np.ones(self.d)))
        self._scale = config.field_db if material.decibels else 0.0
        self._fields = FieldPrior(self._scale, others)
        # one column for each unknown after X
        self.dimension = self.d + self.free_looks + 2 + 2 * (self.curves is not None)

    def _columns(self, points: Doubles) -> tuple[Doubles | None, Doubles, Doubles]:
        """Columns of points after X: log looks or None, scaled standard deviations of fields, deviates of errors."""
        rest = points[:, self.d :]
        looks = rest[:, 0] if self.free_looks else None
        rest = rest[:, int(self.free_looks) :]
        return looks, rest[:, :2], rest[:, 2:]

    def parameters(self, points: Doubles) -> Doubles:
        """X of each point in its own units, shape (m, d)."""
        return self.surrogate.scaled(points[:, : self.d])

    def unknowns(self, points: Doubles) -> Unknowns:
        """Unknowns besides X at each point: looks, standard deviations of fields, deviates of errors."""
        looks, fields, deviates = self._columns(points)
        zero = np.zeros(len(points))
        return Unknowns(
            looks=np.full(len(points), self.sensor) if looks is None else np.exp(looks),
            between_db=self._scale * fields[:, 0],
            within_db=self._scale * fields[:, 1],
            incidence=deviates[:, 0] if deviates.size else zero,
            point_spread=deviates[:, 1] if deviates.size else zero,
        )

    def points(self, deviates: Doubles) -> Doubles:
        """Points of the posterior at standard normal deviates; points and deviates have the shape (m, dimension).

        Standard normal random deviates give points drawn from the prior without the priors on looks and curve. The
        sampler walks over the deviates, because they have neither bounds nor heavy tails.
        """
        share = ndtr(deviates)
        looks, fields = self.d, self.d + int(self.free_looks)
        found = deviates.copy()
        found[:, :looks] = share[:, :looks]
        if self.free_looks:
            found[:, looks] = self._log_looks[0] + np.ptp(self._log_looks) * share[:, looks]
        found[:, fields : fields + 2] = self._fields.quantiles(share[:, fields : fields + 2])
        return found

    def dispersed(self, count: int, rng: np.random.Generator) -> Doubles:
        """Points drawn from the prior without the priors on looks and curve, shape (count, dimension)."""
        return self.points(rng.standard_normal((count, self.dimension)))

    def _inside(self, points: Doubles) -> NDArray[np.bool_]:
        """Whether each point is inside the bounds of all unknowns, shape (m,)."""
        unit = points[:, : self.d]
        looks, fields, _ = self._columns(points)
        inside = ((unit >= 0.0) & (unit <= 1.0)).all(axis=1) & (fields >= 0.0).all(axis=1)
        if looks is not None:
            inside &= (looks >= self._log_looks[0]) & (looks <= self._log_looks[1])
        return np.asarray(inside & (self._scale * fields < MOST_FIELD_DB).all(axis=1))

    def _log_weight(self, points: Doubles) -> Doubles:
        """Log density of the priors on looks and curve, at points inside the bounds, shape (m,)."""
        looks, _, _ = self._columns(points)
        found = np.zeros(len(points))
        if looks is not None and self._looks_prior:
            found -= 0.5 * looks_residuals(np.exp(looks), self.sensor) ** 2
        if self.prior is not None and self.curves is not None:
            x = self.parameters(points)
            levels = self.curves(x, self._prior_rad)
            found -= 0.5 * (self.prior.of_curves(levels, x) ** 2).sum(axis=1)
        return found

    def log_prior(self, deviates: Doubles) -> Doubles:
        """Log prior density of points that are given by their deviates, shape (m, dimension) to (m,)."""
        return np.asarray(-0.5 * (deviates**2).sum(axis=1) + self._log_weight(self.points(deviates)))

    def from_prior(self, count: int, rng: np.random.Generator) -> Doubles:
        """Independent draws from the prior: ``count``, or fewer if the priors on looks and curve reject most draws.

        Rejection sampling: a draw made without the priors on looks and curve is kept with a probability proportional to
        the density of these two priors.
        """
        kept: list[Doubles] = []
        for _ in range(_ROUNDS):
            drawn = self.dispersed(_BATCH, rng)
            kept.append(drawn[np.log(rng.random(_BATCH)) < self._log_weight(drawn)])
            if sum(map(len, kept)) >= count:
                break
        return np.concatenate(kept)[:count]

    def _simulated(self, points: Doubles) -> tuple[Doubles, Doubles, Doubles | None]:
        """Predicted statistics of n bins, (m, n, 3), their standard errors, (m, 3), and curves of sigma0, (m, 361)."""
        unit = self.surrogate.snapped(points[:, : self.d])
        levels = self.curves(self.parameters(points)) if self.curves is not None else None
        baseline = self.evidence.baseline(levels) if levels is not None and self.evidence.has_baseline else None
        return self.surrogate.predict(unit, baseline), self.surrogate.error(unit), levels

    def log_likelihood(self, points: Doubles) -> Doubles:
        """Log likelihood of points by the bins of all passes, shape (m, dimension) to (m,)."""
        parts = np.split(points, range(_CHUNK, len(points), _CHUNK))
        return np.concatenate([self._log_likelihood(part) for part in parts])

    def _log_likelihood(self, points: Doubles) -> Doubles:
        simulated, error, levels = self._simulated(points)
        return self.evidence.log_likelihood(simulated, error, levels, self.unknowns(points))

    def _whitened(self, points: Doubles, centre: Doubles) -> Doubles:
        """Residuals of data and curve prior, whitened by the covariance at the point ``centre``, shape (m, k)."""
        simulated, _, levels = self._simulated(points)
        same = np.repeat(centre[None], len(points), axis=0)
        _, error, _ = self._simulated(same)
        at, there = self.unknowns(points), self.unknowns(same)
        columns = [self.evidence.whitened(self.evidence.difference(simulated, levels, at), error, there)[0]]
        if self.prior is not None and self.curves is not None:
            x = self.parameters(points)
            columns.append(self.prior.of_curves(self.curves(x, self._prior_rad), x))
        return np.concatenate(columns, axis=1)

    def linear(self, centre: Doubles, rng: np.random.Generator) -> Doubles:
        """Draws from a normal law with the Gauss-Newton covariance at a point, shape (k, dimension), inside the bounds.

        The standard deviations between and within fields keep their values at the point ``centre``.
        """
        free = np.ones(self.dimension, dtype=np.bool_)
        fields = self.d + int(self.free_looks)
        free[fields : fields + 2] = False
        step = _STEP * np.eye(self.dimension)[free]
        # finite differences towards the side that lies inside the bounds
        step *= np.where(centre < 0.5, 1.0, -1.0)
        slopes = (self._whitened(centre + step, centre) - self._whitened(centre[None], centre)) / step.sum(axis=1)[
            :, None
        ]
        known = np.ones(self.dimension)
        known[: self.d] = 12.0  # a uniform law on the unit interval has the variance 1/12
        if self.free_looks:
            known[self.d] = 12.0 / np.ptp(self._log_looks) ** 2
        covariance = np.linalg.inv(slopes @ slopes.T + np.diag(known[free]))
        draws = np.repeat(centre[None], _TRIED, axis=0)
        draws[:, free] += rng.multivariate_normal(np.zeros(int(free.sum())), covariance, _TRIED)
        inside = self._inside(draws)
        return draws[inside][:_LINEAR] if inside.sum() >= _FEWEST else self._limited(draws[:_LINEAR])

    def _limited(self, points: Doubles) -> Doubles:
        """Points with the values of X and looks that lie outside the bounds moved to the bounds."""
        points[:, : self.d] = np.clip(points[:, : self.d], 0.0, 1.0)
        if self.free_looks:
            points[:, self.d] = np.clip(points[:, self.d], *self._log_looks)
        return points
