"""The calibration of laws in classes of incidence, in one process: train, propose, verify, until the law settles.

The runs are those of any other objective (at the sensor's looks, found by X alone), so that a run store
serves all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.class_surrogate import ClassSurrogate, Corrected
from radcal.calibration.design import design_points
from radcal.calibration.expected import LawForward
from radcal.calibration.grounds import Ground, GroundLaw, Method, curve_prior, fit_grounds, ground_residuals
from radcal.calibration.infill import nsga2
from radcal.calibration.law_fit import LOOKS, LawFit, Residuals, fit_law
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.config import Case
from radcal.errors import ConfigError
from radcal.measurement.classes import class_cumulants
from radcal.measurement.patches import label_patches
from radcal.measurement.target import Target, Targets
from radcal.radar.geometry import Geometry
from radcal.seeds import derived_seed
from radcal.store import Record, Runner

__all__ = ["LawCalibration", "Step", "calibrate_laws", "target_ground"]

_BLOCK_ROWS = 10
_NO_BETTER = 0.1  # of half the sum of squared residuals: a change of the law by a third of its error is 0.05
_KEPT = 0.5  # of it: promise and run agree
Reason = Literal["settled", "max_runs"]
Model = Literal["correction", "kriging"]


@dataclass(frozen=True)
class Step:
    """A proposal for one material, and what its run said.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        X.
    looks : float
        Effective looks.
    predicted, verified : float
        Half the sum of squared residuals, priors included: by the surrogate, and by the run.
    moved_db : float
        Largest change of the law over the incidence seen (5-95 %) since the last proposal [dB].
    """

    parameters: NDArray[np.float64]
    looks: float
    predicted: float
    verified: float
    moved_db: float


@dataclass(frozen=True)
class LawCalibration:
    """What a calibration of laws found.

    Attributes
    ----------
    laws : mapping
        By material; X is that of the best verified run.
    steps : mapping
        Proposals by material, in order.
    runs : int
        Of design and infill.
    reason : {'settled', 'max_runs'}
        Why it ended.
    """

    laws: Mapping[str, GroundLaw]
    steps: Mapping[str, list[Step]]
    runs: int
    reason: Reason


def target_ground(name: str, target: Target, geometry: Geometry) -> Ground:
    """A target's pixels with the connected areas of its material, and blocks of 10 rows."""
    patches = label_patches(geometry.material == geometry.names.index(name) + 1)
    return Ground(
        values_db=np.asarray(target.values_db, dtype=np.float64),
        incidence_deg=np.asarray(target.incidence_deg, dtype=np.float64),
        patch=patches.ravel()[target.pixels],
        block=target.pixels // geometry.material.shape[1] // _BLOCK_ROWS,
        independent=target.effective / target.pixels.size,
    )


class _Material:
    """One material's part of the loop."""

    def __init__(self, name: str, case: Case, target: Target, measured: GroundLaw, model: Model) -> None:
        self.name, self.case, self.target, self.measured, self.model = name, case, target, measured, model
        self.prior = curve_prior(measured.ground, measured.method)
        self.points: list[list[float]] = []
        self.cumulants: list[NDArray[np.float64]] = []
        self.surrogate: ClassSurrogate | Corrected | None = None
        self.steps: list[Step] = []
        self.fits: list[LawFit] = []

    def add(self, x: list[float], pixels_db: NDArray[np.float64]) -> None:
        """Take the classes of a run."""
        self.points.append([float(v) for v in x])
        classes = self.measured.classes
        self.cumulants.append(class_cumulants(pixels_db, classes.member, classes.size))

    def residuals(self, cumulants: NDArray[np.float64] | None = None) -> Residuals:
        """Residuals by surrogate, or of the run that has these cumulants."""
        forward = self.surrogate if cumulants is None else (lambda _: cumulants)
        m = self.measured
        return ground_residuals(m.ground, m.classes, m.method, m.spread, forward)

    def cost(self, residuals: Residuals, x: NDArray[np.float64], looks: float) -> float:
        """Half the sum of squares, with the priors."""
        return 0.5 * float((residuals(x, looks) ** 2).sum() + (self.prior(x, looks) ** 2).sum())

    def train(self, iteration: int) -> None:
        """Make what stands for the simulator."""
        method, settings = self.measured.method, self.case.surrogate
        baseline = LawForward(method.law, self.measured.classes.nodes_deg, method.looks)
        if self.model == "correction":
            best = int(np.argmin([step.verified for step in self.steps])) if self.steps else None
            run = () if best is None else (self.points[best], self.cumulants[best])
            self.surrogate = Corrected(baseline, *run)
            return
        last = self.surrogate if settings.training == "warm" and iteration % settings.retrain_every else None
        theta = last.theta if isinstance(last, ClassSurrogate) else None
        self.surrogate = ClassSurrogate(method.bounds, self.points, self.cumulants, baseline).train(theta)

    def propose(self, iteration: int) -> LawFit:
        """NSGA-II over X and looks, of level and of spread residuals; then least squares."""
        method = self.measured.method
        self.train(iteration)
        residuals = self.residuals()
        box = np.asarray(method.bounds, dtype=np.float64)
        looks_box = np.log(np.array(LOOKS) * [1.0, method.looks])
        low, high = np.vstack([box, looks_box] if method.free_looks else [box]).T
        n, d = self.measured.classes.size, len(box)

        def split(unit: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
            q = low + unit * (high - low)
            return q[:d], float(np.exp(q[d])) if method.free_looks else method.looks

        def objectives(units: NDArray[np.float64]) -> NDArray[np.float64]:
            found = []
            for unit in units:
                x, looks = split(unit)
                squares, weak = residuals(x, looks) ** 2, (self.prior(x, looks) ** 2).sum()
                found.append([squares[:n].sum() + weak, squares[n:].sum()])
            return np.array(found)

        seed = derived_seed(self.case.seed, "propose", self.name, iteration)
        first = split(nsga2(objectives, len(low), self.case.optimiser, seed, objectives=2)[0])
        candidates = [first, *([(self.fits[-1].parameters, self.fits[-1].looks)] if self.fits else [])]
        fits = [
            fit_law(residuals, box, method.looks, method.free_looks, start, prior=self.prior) for start in candidates
        ]
        return min(fits, key=lambda fit: fit.cost)

    def verify(self, fit: LawFit) -> None:
        """Judge a proposal by its run, the last one added."""
        law = self.measured.method.law
        low, high = np.quantile(self.measured.ground.incidence_deg, [0.05, 0.95])
        phi = np.radians(np.linspace(float(low), float(high), 91))
        last = law(phi, self.fits[-1].parameters) if self.fits else np.inf
        moved = float(np.abs(law(phi, fit.parameters) - last).max())
        verified = self.cost(self.residuals(self.cumulants[-1]), fit.parameters, fit.looks)
        self.fits.append(fit)
        self.steps.append(Step(fit.parameters, fit.looks, fit.cost, verified, moved))

    @property
    def settled(self) -> bool:
        """Whether verified proposals, promised right, are no better and the law stands still.

        The law stands still where the last proposal moved it by less than ``stop.law_db``, or where two in
        turn were no better than the one before: along a flat valley proposals go on moving, and what is known
        of the law does not change.
        """
        idle, best = 0, float("inf")
        for step in self.steps:
            better = best - step.verified > _NO_BETTER
            idle, best = (0, step.verified) if better else (idle + 1, best)
        if not idle:
            return False
        last = self.steps[-1]
        kept = abs(last.verified - last.predicted) < _KEPT
        return kept and (last.moved_db < self.case.stop.law_db or idle > 1)

    @property
    def law(self) -> GroundLaw:
        """The best verified law."""
        best = int(np.argmin([step.verified for step in self.steps]))
        return replace(self.measured, fit=self.fits[best])


def calibrate_laws(
    case: Case,
    runner: Runner,
    targets: Targets,
    geometry: Geometry,
    method: Mapping[str, Method],
    model: Model = "correction",
) -> LawCalibration:
    """Calibrate the laws of all materials in classes of incidence.

    How patches spread is taken from the measured image alone, by the laws without a simulator
    (:func:`radcal.calibration.grounds.fit_grounds`); X and looks from the simulator's runs.

    Parameters
    ----------
    case : Case
        The configuration; ``design``, ``surrogate``, ``optimiser`` and ``stop`` are read.
    runner : Runner
        The simulator behind a run store.
    targets : Targets
        By calibrated material.
    geometry : Geometry
        Of the pass.
    method : mapping
        By calibrated material; the objective is ``classes``.
    model : {'correction', 'kriging'}
        What stands for the simulator: law and speckle corrected by the best run, with no design; or
        kriging of the difference of all runs from them, after the design.

    Returns
    -------
    LawCalibration

    Raises
    ------
    ConfigError
        Another objective, or a law without a curve.
    """
    for name, how in method.items():
        if how.objective != "classes" or not how.law.has_curve:
            raise ConfigError(
                f"materials.{name}: objective {how.objective} of a law {'with' if how.law.has_curve else 'without'} "
                "a curve, expected the objective classes and a law with a curve."
            )
    grounds = {name: target_ground(name, target, geometry) for name, target in targets.items()}
    measured = fit_grounds(grounds, method)
    materials = {name: _Material(name, case, targets[name], measured[name], model) for name in targets}

    def take(record: Record, parameters: Mapping[str, list[float]]) -> None:
        mapping = targets.levels.simulated(record.pixels_db)
        for name, item in materials.items():
            pixels = record.pixels_db[name][item.target.order]
            item.add(parameters[name], targets.levels.apply(pixels, mapping))

    seed, runs = noise_seed(case), 0
    for parameters in design_points(case) if model == "kriging" else ():
        take(runner.run(parameters, seed), parameters)
        runs += 1
    reason: Reason = "max_runs"
    iteration = 0
    while runs < case.stop.max_runs:
        # a settled material repeats its last proposal while others go on
        fits = {name: item.fits[-1] if item.settled else item.propose(iteration) for name, item in materials.items()}
        parameters = all_parameters(case, {name: [float(v) for v in fit.parameters] for name, fit in fits.items()})
        take(runner.run(parameters, seed), parameters)
        runs, iteration = runs + 1, iteration + 1
        for name, item in materials.items():
            item.verify(fits[name])
        if all(item.settled for item in materials.values()):
            reason = "settled"
            break
    return LawCalibration(
        {name: item.law for name, item in materials.items()},
        {name: item.steps for name, item in materials.items()},
        runs,
        reason,
    )
