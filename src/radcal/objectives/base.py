"""Interface of an objective: statistics of a run, their residuals from the target, and the end of the search."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.config import Stop
from radcal.findings import Finding
from radcal.ground.bins import Classes
from radcal.inference.misfit import BinMisfit, LawForward, Misfit
from radcal.inference.pooled_laws import LOOKS
from radcal.inference.priors import CurvePrior
from radcal.laws import Law
from radcal.objectives.history import Proposal, Score
from radcal.targets.target import Target

Doubles = NDArray[np.float64]

Baseline = Callable[[Doubles], Doubles]
"""Function from X to the statistics that law, speckle and noise give: shape (d,) to (n, 3), or (k, d) to (k, n, 3)."""

Reason = Literal["rms", "settled", "unreachable", "stagnation", "max_runs", "max_hours"]
MET: tuple[Reason, ...] = ("rms", "settled")
"""Reasons of searches that met their criterion."""


@dataclass(frozen=True)
class CalibratedMaterial:
    """Material to calibrate: target, law, bounds and looks, which its objective needs.

    Attributes
    ----------
    name : str
        Name of the material.
    target : Target
        Target of the material, with its measured pixels.
    law : Law
        Backscatter law, with or without a curve.
    box : ndarray, shape (d, 2)
        Bounds of X.
    integer : ndarray of bool, shape (d,)
        Whether each parameter is a whole number.
    looks : float
        Number of looks of the simulated speckle.
    decibels : bool
        Whether the compared values are backscatter [dB], not values of normalised images.
    priors : bool
        Whether the priors enter the objective; of several passes, only the first includes them.
    """

    name: str
    target: Target
    law: Law
    box: Doubles
    integer: NDArray[np.bool_]
    looks: float
    decibels: bool = True
    priors: bool = True


@dataclass(frozen=True)
class PredictedPoints:
    """Predicted statistics at m points, each with its X and its number of looks.

    Attributes
    ----------
    statistics : ndarray, shape (m, n, 3)
        Mean [dB], log sd and skewness of n incidence-angle bins.
    parameters : ndarray, shape (m, d)
        Parameters X of the points.
    looks : ndarray, shape (m,)
        Effective number of looks.
    slack : ndarray, shape (m, n, 3), or 0
        Largest shift of each statistic towards the target.
    """

    statistics: Doubles
    parameters: Doubles
    looks: Doubles
    slack: Doubles | float = 0.0


@dataclass(frozen=True)
class Progress:
    """State of a material's search after an infill run.

    Attributes
    ----------
    name : str
        Name of the material.
    runs : int
        Number of design and infill runs so far.
    best : float
        Smallest verified cost so far.
    idle : int
        Number of infill runs since the last improvement of the cost.
    score : Score
        Score of the infill run.
    proposal : Proposal
        Proposal that the infill run verifies.
    sampling : float
        Sampling error of the target's density, as rms [1/dB].
    """

    name: str
    runs: int
    best: float
    idle: int
    score: Score
    proposal: Proposal
    sampling: float


@dataclass(frozen=True)
class SearchState:
    """State of a material's search.

    Attributes
    ----------
    reason : str or None
        Reason why the search ended; None while it goes on.
    finding : Finding
        Finding that describes the state of the search.
    """

    reason: Reason | None
    finding: Finding

    @classmethod
    def of(cls, reason: Reason | None, code: str, name: str, **numbers: float) -> SearchState:
        """State of the search of the material ``name``, with code and numbers of its finding."""
        return cls(reason, Finding(code, "note", name, numbers))


class Comparison(ABC):
    """Comparison of one material's runs with its target, in one pass or in several.

    Attributes
    ----------
    material : CalibratedMaterial
        Target, law and bounds, in the first pass.
    baseline : callable or None
        Function from X to the statistics that law, speckle and noise alone give; None without a baseline.
    starts : sequence of (X, looks)
        Points from which every search starts, besides the best run.
    free_looks : bool
        Whether the effective number of looks is searched with X.
    explores : bool
        Whether runs are proposed where the surrogate is uncertain, if no better point is predicted.
    refines : bool
        Whether a second search minimises the residuals :meth:`refined`.
    looks_ahead : bool
        Whether the end of the search depends on the improvement that the surrogate of all runs still predicts.
    tolerance : float
        Relative tolerance of the least-squares search.
    improvement : float
        Decrease of the cost that a run must exceed to be better than earlier runs.
    first : Objective
        Objective of the first pass, whose rules hold for all passes.
    passes : sequence of Objective or None
        Objective of each pass, None for a pass in which the material has too few pixels.
    part_names : sequence of str
        Names of the sums of squared residuals that are NSGA-II's objectives.
    """

    material: CalibratedMaterial
    starts: Sequence[tuple[ArrayLike, float]] = ()
    baseline: Baseline | None = None
    free_looks: bool = False
    explores: bool = True
    refines: bool = False
    looks_ahead: bool = False
    tolerance: float = 1e-14
    improvement: float = 0.0
    first: Objective
    passes: Sequence[Objective | None]
    part_names: Sequence[str] = ("all residuals",)

    @property
    @abstractmethod
    def scale(self) -> Doubles:
        """Standard deviations by which differences of the statistics are divided, shape (n, 3)."""

    @abstractmethod
    def residuals(self, points: PredictedPoints) -> Doubles:
        """Residuals at m points, shape (m, k); the search minimises the sum of their squares."""

    def parts(self, points: PredictedPoints) -> Doubles:
        """Sums of squared residuals that are NSGA-II's objectives, shape (m, p), one for each of ``part_names``."""
        return np.asarray((self.residuals(points) ** 2).sum(axis=1, keepdims=True))

    def parts_of(self, score: Score) -> Doubles:
        """Sums of squared residuals of a run, shape (p,), one for each of ``part_names``."""
        statistics, x = np.asarray(score.statistics)[None], np.asarray(score.parameters)[None]
        return np.asarray(self.parts(PredictedPoints(statistics, x, np.array([score.looks])))[0])

    def refined(self, points: PredictedPoints) -> Doubles:
        """Residuals that a second search minimises if ``refines`` and :meth:`residuals` are not all 0, shape (m, k)."""
        return self.residuals(points)

    def cost(self, points: PredictedPoints) -> Doubles:
        """Cost of predicted statistics, shape (m,): half the sum of squared residuals."""
        return np.asarray(0.5 * (self.residuals(points) ** 2).sum(axis=1))

    def worth(self, parameters: Sequence[float], statistics: Doubles) -> tuple[float, float | None]:
        """Number of looks that minimises the cost of a run, and this cost; None if the cost is the density rms."""
        x = np.asarray(parameters, dtype=np.float64)[None]

        def at(looks: float) -> float:
            return float(self.cost(PredictedPoints(statistics[None], x, np.array([looks])))[0])

        sensor = self.material.looks
        if not self.free_looks:
            return sensor, at(sensor)
        bounds = np.log([LOOKS[0], LOOKS[1] * sensor])
        found = scipy.optimize.minimize_scalar(
            lambda log: at(float(np.exp(log))), bounds=bounds, method="bounded", options={"xatol": 1e-6}
        )
        return float(np.exp(found.x)), float(found.fun)

    @abstractmethod
    def moved_db(self, first: ArrayLike, second: ArrayLike) -> float | None:
        """Largest difference of the laws of two X over the incidence seen [dB]; None for a law without a curve."""

    @abstractmethod
    def in_pass(self, number: int, score: Score) -> Score:
        """Score of the pass ``number`` (from 0) alone: statistics, density and looks."""


class Objective(Comparison):
    """Objective of one material in one pass.

    Parameters
    ----------
    material : CalibratedMaterial
        Target, law and bounds.

    Attributes
    ----------
    expected : LawForward or None
        Model of law, noise and speckle that gives the baseline; None without a baseline.
    misfit : type of Misfit, or None
        Misfit of the pixels in incidence-angle bins; None for an objective without bins.
    prior : CurvePrior or None
        Prior on the curve of the law.
    classes : Classes
        Bins of the measured pixels, with the effective sample size for differences between target and run.
    """

    misfit: ClassVar[type[Misfit] | None] = None
    prior: CurvePrior | None = None
    classes: Classes
    expected: LawForward | None = None

    def __init__(self, material: CalibratedMaterial) -> None:
        self.material, self.first, self.passes = material, self, (self,)

    def together(self, costs: Doubles) -> Doubles:
        """Cost of several passes together: sum of the costs of the passes, shape (passes, m) to (m,)."""
        return np.asarray(costs.sum(axis=0))

    @abstractmethod
    def promising(self, costs: Doubles, best: float) -> NDArray[np.bool_]:
        """Mask of the predicted costs that are worth a run and about equally good, shape (m,)."""

    @abstractmethod
    def leaves_open(self, floor: float, best: float) -> bool:
        """Whether the search goes on because its floor is clearly below the best verified cost."""

    @abstractmethod
    def statistics(self, values_db: Doubles, pixels: NDArray[np.int64] | None = None) -> Doubles:
        """Statistics of a run's values [dB] at all pixels of the target, or at those in ``pixels``, shape (n, 3)."""

    @property
    def moments(self) -> BinMisfit | None:
        """Misfit of mean, log sd and skewness of the measured bins; None without bins."""
        return None

    @property
    def of_fields(self) -> BinMisfit | None:
        """Misfit that is minimised, if it includes effects of fields; otherwise None."""
        return None

    def in_pass(self, number: int, score: Score) -> Score:
        """Score without change, because the objective has a single pass."""
        return score

    @classmethod
    @abstractmethod
    def ending(cls, progress: Progress, stop: Stop) -> SearchState | None:
        """End of a material's search after an infill run, or None while the search goes on."""

    @classmethod
    def ending_before_infill(cls, name: str, best: float, stop: Stop) -> SearchState | None:
        """End of a material's search before any infill run, or None if the search goes on."""
        return None

    @classmethod
    def standing(cls, best: float, stop: Stop) -> dict[str, float]:
        """Numbers that describe a search which goes on or ends without success; empty without a tolerance."""
        return {}

    def moved_db(self, first: ArrayLike, second: ArrayLike) -> float | None:
        """Largest difference of the laws of two X over the incidence seen [dB]; None for a law without a curve."""
        law = self.material.law
        incidence_deg = self.material.target.incidence_deg
        return law.largest_difference_db(first, second, incidence_deg) if law.has_curve else None
