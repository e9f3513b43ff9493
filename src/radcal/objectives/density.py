"""Objective ``density``: the skew-normal density of all pixels of a material (the histogram)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.config import Stop
from radcal.ground.bins import Classes
from radcal.inference.misfit import LawForward, drawn
from radcal.inference.moments import from_cumulants, from_dp, to_dp
from radcal.inference.pooled_laws import bins_of
from radcal.objectives.base import CalibratedMaterial, Doubles, Objective, PredictedPoints, Progress, SearchState

UNREACHABLE_SHARE = 0.9  # share of the best verified rms; with a floor above it, no X is clearly better
_PROMISING_SHARE = 0.5
_GRID = 200  # points on which the search compares densities; the score uses 1,000
_NODES = 64  # incidence angles that represent the pixels
_OF_SAMPLING = 1.0 / 3.0  # share of the sampling error; an rms below it adds at most a ninth to the variance
_PATIENCE = 5  # runs without improvement after which a search below that rms ends
_KEPT = 0.2  # relative difference of predicted and verified rms, up to which the prediction was right


class Density(Objective):
    """Objective ``density``: rms difference between a material's density and the target's density.

    The search first minimises scaled differences of mean, log sd and skewness, because the rms hardly changes with X
    far from its minimum. The rms is 0 if the differences of the statistics are 0.
    """

    refines = True

    def __init__(self, material: CalibratedMaterial) -> None:
        super().__init__(material)
        target = material.target
        self._target_dp = np.asarray(target.dp, dtype=np.float64)
        self._target = from_dp(self._target_dp)
        self._grid = skewnormal.target_grid(self._target_dp, _GRID)
        self._density = skewnormal.density(self._grid, self._target_dp)
        if material.law.has_curve and material.decibels:
            shares = (np.arange(_NODES) + 0.5) / _NODES
            nodes = np.quantile(np.asarray(target.incidence_deg, dtype=np.float64), shares)[None]
            expected = self.expected = LawForward(material.law, nodes, material.looks, target.noise_db)
            self.baseline = lambda x: from_cumulants(expected(x))

    @cached_property
    def classes(self) -> Classes:  # type: ignore[override]  # made when it is first asked for
        """Bin of all pixels of the target."""
        # the simulated pixels have their own speckle, which adds to the variance of the difference
        return bins_of(self.material.target.ground, 1).compared(1)

    @property
    def scale(self) -> Doubles:
        """Standard errors of mean, log sd and skewness of n normal values, times sqrt(n), shape (1, 3)."""
        return np.array([[np.exp(self._target[1]), np.sqrt(0.5), np.sqrt(6.0)]])

    def statistics(self, values_db: Doubles, pixels: NDArray[np.int64] | None = None) -> Doubles:
        """Mean [dB], log sd and skewness of the density fitted to the pixels, shape (1, 3)."""
        values = values_db if pixels is None else values_db[pixels]
        return from_dp(skewnormal.fit(values, self.material.target.penalised).dp)[None]

    def residuals(self, points: PredictedPoints) -> Doubles:
        """Differences of mean, log sd and skewness from the target's, divided by ``scale``, shape (m, 3)."""
        return (drawn(points.statistics, self._target, points.slack) / self.scale)[:, 0]

    def refined(self, points: PredictedPoints) -> Doubles:
        """Differences of predicted densities from the target's, divided by the target's maximum, shape (m, 200)."""
        dp = to_dp(self._target + drawn(points.statistics, self._target, points.slack)[:, 0])
        found = np.stack([skewnormal.density(self._grid, row) for row in dp])
        return np.asarray((found - self._density) / self._density.max())

    def cost(self, points: PredictedPoints) -> Doubles:
        """Density rms [1/dB], shape (m,)."""
        differences = self.refined(points) * self._density.max()
        return np.asarray(np.sqrt(np.mean(differences**2, axis=1)))

    def worth(self, parameters: Sequence[float], statistics: Doubles) -> tuple[float, float | None]:
        """Number of looks of the simulated speckle, and None, because the cost is the density rms."""
        return self.material.looks, None

    def promising(self, costs: Doubles, best: float) -> NDArray[np.bool_]:
        """Mask of the costs that are below half of the best verified cost."""
        return costs < _PROMISING_SHARE * best

    @staticmethod
    def leaves_open(floor: float, best: float) -> bool:
        """Whether the floor is below nine tenths of the best verified rms."""
        return floor < UNREACHABLE_SHARE * best

    def together(self, costs: Doubles) -> Doubles:
        """Root mean square of the costs of several passes."""
        return np.asarray(np.sqrt(np.mean(costs**2, axis=0)))

    @classmethod
    def ending_before_infill(cls, name: str, best: float, stop: Stop) -> SearchState | None:
        """End of a search if the rms of the best run is within the tolerance."""
        reached = best <= stop.rms
        return SearchState.of("rms", "rms_before_infill", name, **cls.standing(best, stop)) if reached else None

    @classmethod
    def ending(cls, progress: Progress, stop: Stop) -> SearchState | None:
        """End of a search: rms within the tolerance, target unreachable, or rms well below the sampling error."""
        name, best, proposal = progress.name, progress.best, progress.proposal
        numbers = {**cls.standing(best, stop), "runs": progress.runs}
        if best <= stop.rms:
            return SearchState.of("rms", "rms_reached", name, **numbers)
        # the floor of a surrogate is believed where its last prediction agrees with the verified rms
        rms, predicted = progress.score.cost, proposal.cost if proposal.mode == "exploit" else None
        agrees = predicted is not None and abs(rms - predicted) <= _KEPT * predicted
        known = len(progress.score.parameters) + 2 <= progress.runs and agrees
        if proposal.floor is not None and not cls.leaves_open(proposal.floor, best) and known:
            return SearchState.of("unreachable", "rms_unreachable", name, **numbers, floor=proposal.floor)
        if proposal.mode == "exhausted":
            return SearchState.of("unreachable", "rms_exhausted", name, **numbers)
        if stop.at_sampling_error and progress.idle >= _PATIENCE and best < _OF_SAMPLING * progress.sampling:
            noise = {"idle": progress.idle, "sampling": progress.sampling}
            return SearchState.of("stagnation", "rms_below_sampling_error", name, **numbers, **noise)
        return None

    @classmethod
    def standing(cls, best: float, stop: Stop) -> dict[str, float]:
        """Best rms of the material, and tolerance [1/dB]."""
        return {"rms": best, "tolerance": stop.rms}
