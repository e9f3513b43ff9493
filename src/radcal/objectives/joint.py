"""Objective of one material in several passes, made up of the objectives of the single passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from radcal.inference.misfit import together
from radcal.objectives.base import Comparison, Doubles, Objective, PredictedPoints
from radcal.objectives.history import Score
from radcal.speckle.texture import equal_texture


class Joint(Comparison):
    """Comparison of one material's runs with its targets in several passes.

    Law and texture are shared: all passes have the same X, and looks that follow from the same texture
    (:func:`radcal.speckle.texture.equal_texture`). A field that lies in several passes has the same effect in all of
    them (:mod:`radcal.inference.misfit`). The statistics of the bins are stacked in the order of the passes. The
    priors enter only once, with the first pass.

    Parameters
    ----------
    passes : sequence of Objective or None
        Objective of each pass, None for a pass in which the material has too few pixels. The first pass always has an
        objective, and only this objective includes the priors.
    """

    def __init__(self, passes: Sequence[Objective | None]) -> None:
        first = passes[0]
        assert first is not None  # noqa: S101
        self.passes = passes
        self.first, self.material = first, first.material
        self._parts = [part for part in passes if part is not None]
        self.part_names = [f"pass {k}" for k, part in enumerate(passes, start=1) if part is not None]
        self.free_looks, self.refines = first.free_looks, first.refines
        self.explores = any(part.explores for part in self._parts)
        self.looks_ahead, self.tolerance, self.improvement = first.looks_ahead, first.tolerance, first.improvement
        # effective looks in the first pass of a material that has the start's looks in the pass of the part
        self.starts = [
            (x, equal_texture(part.material.looks, looks, self.material.looks))
            for part in self._parts
            for x, looks in part.starts
        ]
        bases = [part.baseline for part in self._parts]
        known = [base for base in bases if base is not None]
        if len(known) == len(bases):
            self.baseline = lambda x: np.concatenate([base(x) for base in known], axis=-2)
        self._ends = np.cumsum([len(part.scale) for part in self._parts])[:-1]
        fields = [part.of_fields for part in self._parts]
        self._fields = [one for one in fields if one is not None]
        shared = len(self._fields) == len(fields) > 1
        self._joined = together(self._fields) if shared else None

    def _there(self, part: Objective, looks: float) -> float:
        """Effective looks in the pass of ``part`` of a material that has ``looks`` in the first pass."""
        return equal_texture(self.material.looks, looks, part.material.looks)

    def _split(self, points: PredictedPoints) -> list[tuple[Objective, PredictedPoints]]:
        """Objective of each pass, with the points restricted to the statistics of this pass."""
        slack = np.broadcast_to(points.slack, points.statistics.shape)
        split = (np.split(values, self._ends, axis=1) for values in (points.statistics, slack))
        found = []
        for part, statistics, shift in zip(self._parts, *split, strict=True):
            looks = np.array([self._there(part, n) for n in points.looks])
            found.append((part, PredictedPoints(statistics, points.parameters, looks, shift)))
        return found

    @property
    def scale(self) -> Doubles:
        """Standard deviations of the statistics of all passes, shape (n, 3)."""
        return np.concatenate([part.scale for part in self._parts])

    def residuals(self, points: PredictedPoints) -> Doubles:
        """Residuals of the statistics of all passes, followed by the residuals of the priors, shape (m, k)."""
        found = [part.residuals(at) for part, at in self._split(points)]
        if self._joined is None:
            return np.concatenate(found, axis=1)
        sizes = [3 * len(part.scale) for part in self._parts]
        data, rest = zip(*(np.split(one, [size], axis=1) for one, size in zip(found, sizes, strict=True)), strict=True)
        away = [misfit.differences(own) for misfit, own in zip(self._fields, data, strict=True)]
        return np.concatenate([self._joined.whitened(np.concatenate(away, axis=-2)), *rest], axis=1)

    def parts(self, points: PredictedPoints) -> Doubles:
        """Sum of squared residuals of each pass, computed from this pass alone, shape (m, passes)."""
        return np.stack([(part.residuals(at) ** 2).sum(axis=1) for part, at in self._split(points)], axis=-1)

    def refined(self, points: PredictedPoints) -> Doubles:
        """Residuals of all passes that a second search minimises, shape (m, k)."""
        return np.concatenate([part.refined(at) for part, at in self._split(points)], axis=1)

    def cost(self, points: PredictedPoints) -> Doubles:
        """Cost of all passes together, shape (m,)."""
        if self._joined is not None:
            return super().cost(points)
        return self.first.together(np.stack([part.cost(at) for part, at in self._split(points)]))

    def worth(self, parameters: Sequence[float], statistics: Doubles) -> tuple[float, float | None]:
        """Looks that minimise the cost of a run in all passes, and this cost; None if the cost is the density rms."""
        looks, cost = self.first.worth(parameters, statistics[: len(self.first.scale)])
        return (looks, None) if cost is None else super().worth(parameters, statistics)

    def in_pass(self, number: int, score: Score) -> Score:
        """Score of one pass alone: statistics, density, and effective number of looks in this pass."""
        part = self.passes[number]
        assert part is not None  # noqa: S101
        return replace(
            score,
            densities=[score.densities[number]],
            statistics=np.split(np.asarray(score.statistics), self._ends)[self._parts.index(part)].tolist(),
            looks=self._there(part, score.looks),
        )

    def moved_db(self, first: ArrayLike, second: ArrayLike) -> float | None:
        """Largest difference of two laws over the incidence of all passes [dB]; None for a law without a curve."""
        moved = [part.moved_db(first, second) for part in self._parts]
        return max((value for value in moved if value is not None), default=None)
