"""Objectives in incidence-angle bins: ``classes`` (statistics of each bin), ``likelihood`` (pixels of each bin)."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from radcal.config import Stop
from radcal.errors import MeasurementError
from radcal.inference.misfit import BinMisfit, LawForward, LikelihoodMisfit, Method, Misfit
from radcal.inference.moments import from_cumulants, to_cumulants
from radcal.inference.pooled_laws import curve_prior, law_prior, limited
from radcal.objectives.base import CalibratedMaterial, Doubles, Objective, PredictedPoints, Progress, SearchState

_SETTLED = 0.03  # difference in cost for a law that is a quarter of its standard error from the minimum
_REFUTED = 3.0  # ratio of a verified to the predicted cost, above which the surrogate does not predict the simulator
_EXPLORED = 0.05  # the same for a law without a curve, whose search also asks what the surrogate's errors may hide


class Bins(Objective):
    """Objective ``classes``: mean, log sd and skewness of each incidence-angle bin, with weak priors."""

    looks_ahead = True
    tolerance = 1e-6
    improvement = _SETTLED
    misfit: ClassVar[type[Misfit]] = BinMisfit
    part_names = ("means and priors", "log sds and skewnesses")

    def __init__(self, material: CalibratedMaterial) -> None:
        super().__init__(material)
        bins, target = material.target.classes, material.target
        if bins is None:
            raise MeasurementError(f"the target of {material.name} has no incidence-angle bins; make it again.")
        self.bins, self.classes, self.free_looks = bins, bins.classes, bins.free_looks
        self.ground = limited(target.ground, bins.classes.member)
        self.method = Method(
            material.law,
            material.box,
            material.looks,
            free_looks=bins.free_looks,
            priors=bins.priors and material.priors,
            incidence_error_deg=bins.incidence_error_deg,
        )
        self._misfit = self.misfit.of(self.ground, bins.classes, self.method, bins.spread)
        self.prior, self._priors = law_prior(self.ground, self.method), curve_prior(self.ground, self.method)
        self.explores = not material.law.has_curve
        if material.law.has_curve:
            expected = self.expected = LawForward(material.law, bins.classes.nodes_deg, material.looks, target.noise_db)
            self.baseline = lambda x: from_cumulants(expected(x))
            self.starts = [(bins.first, bins.first_looks)]

    @cached_property
    def moments(self) -> BinMisfit:
        """Misfit of mean, log sd and skewness in each bin, also if the objective minimises another misfit."""
        return BinMisfit.of(self.ground, self.classes, self.method, self.bins.spread)

    @property
    def of_fields(self) -> BinMisfit | None:
        """Attribute :attr:`moments`, if the minimised misfit includes effects of fields; otherwise None."""
        return self.moments if self.misfit.of_fields else None

    @property
    def scale(self) -> Doubles:
        """Standard deviations of mean [dB], log sd and skewness of the measured bins, shape (n, 3)."""
        return np.asarray(np.sqrt(np.diag(self.moments.covariance)).reshape(3, -1).T)

    def statistics(self, values_db: Doubles, pixels: NDArray[np.int64] | None = None) -> Doubles:
        """Mean [dB], log sd and skewness of the pixels in each bin, shape (n, 3)."""
        return from_cumulants(self.bins.cumulants(values_db, pixels))

    def residuals(self, points: PredictedPoints) -> Doubles:
        """Residuals of the misfit, followed by the residuals of the priors, shape (m, k)."""
        slack = np.broadcast_to(points.slack, points.statistics.shape)
        each = zip(to_cumulants(points.statistics), points.parameters, points.looks, slack, strict=True)
        return np.stack(
            [
                np.concatenate([self._misfit(x, float(n), simulated, part), self._priors(x, float(n))])
                for simulated, x, n, part in each
            ]
        )

    def parts(self, points: PredictedPoints) -> Doubles:
        """Sums of squared residuals: first part with the priors, and second part, shape (m, 2)."""
        squares = self.residuals(points) ** 2
        first, second, weak = np.split(squares, self._ends(squares.shape[1]), axis=1)
        return np.stack([first.sum(axis=1) + weak.sum(axis=1), second.sum(axis=1)], axis=-1)

    def _ends(self, count: int) -> tuple[int, int]:
        """Ends of the residuals of the two parts, which those of the priors follow."""
        return self.classes.size, 3 * self.classes.size

    def promising(self, costs: Doubles, best: float) -> NDArray[np.bool_]:
        """Mask of the costs that are clearly below the best verified cost, and about as good as the smallest one."""
        near = _EXPLORED if self.explores else _SETTLED
        return costs <= min(best - near, float(costs.min()) + near)

    @staticmethod
    def leaves_open(floor: float, best: float) -> bool:
        """Whether the floor is more than 0.05 below the best verified cost."""
        return best - floor > _EXPLORED

    @classmethod
    def ending(cls, progress: Progress, stop: Stop) -> SearchState | None:
        """End of a search if the surrogate of all runs predicts no better law, or one that hardly differs."""
        score, name = progress.score, progress.name
        if progress.proposal.mode == "exhausted":
            return SearchState.of("settled", "criterion_met_exhausted", name, runs=progress.runs)
        if score.gain is None:
            return None
        predicted, fewest = progress.proposal.cost, len(score.parameters) + 2
        if predicted is not None and score.cost > _REFUTED * predicted and progress.runs < fewest:
            return None  # what such a surrogate promises, few runs cannot tell
        if score.floor is not None and cls.leaves_open(score.floor, progress.best):
            return None
        if score.gain <= (_SETTLED if score.floor is None else _EXPLORED):
            code = "no_better_x" if score.moved_db is None else "no_better_law"
            return SearchState.of("settled", code, name, runs=progress.runs)
        if score.moved_db is not None and score.moved_db <= stop.law_db:
            return SearchState.of("settled", "law_settled", name, runs=progress.runs, moved_db=score.moved_db)
        return None


class Likelihood(Bins):
    """Objective ``likelihood``: gamma likelihood of the pixels in each incidence-angle bin."""

    misfit: ClassVar[type[Misfit]] = LikelihoodMisfit
    part_names = ("pixels of small incidence, priors", "pixels of large incidence")

    def _ends(self, count: int) -> tuple[int, int]:
        n = self.classes.size
        data = count - self._priors(self.material.box.mean(axis=1), self.material.looks).size
        return n // 2 * (data // n), data
