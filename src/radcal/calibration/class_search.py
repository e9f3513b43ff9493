"""One material's law in classes of incidence: what a run is worth, where to go next, and when to stop.

The simulator's runs are found by X alone and always made at the sensor's looks: what other looks do to the
statistics of a class is known exactly (:func:`radcal.radar.texture.log_speckle_cumulants`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.class_surrogate import Corrected
from radcal.calibration.expected import Forward, LawForward
from radcal.calibration.grounds import GroundLaw, Method, curve_prior, fit_grounds, ground_residuals, limited
from radcal.calibration.incidence_error import registration_error_deg
from radcal.calibration.law_fit import LOOKS, LawFit, fit_law
from radcal.calibration.nsga2 import nsga2
from radcal.config import BuiltinSimulation, Optimiser, stages
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.ground import Ground
from radcal.measurement.target import Target, Targets
from radcal.radar.radiometry import noise_floor_db
from radcal.radar.texture import texture_db, texture_order
from radcal.seeds import derived_seed

if TYPE_CHECKING:
    from radcal.measurement.registration import Registered
    from radcal.radar.geometry import Geometry

__all__ = ["ClassSearch", "class_searches", "class_targets"]


def class_targets(
    case: stages.Target,
    targets: Targets,
    geometry: Geometry,
    registered: Registered,
    slope_error_deg: float = 0.0,
) -> Targets:
    """Divide the targets' pixels by incidence, and find how patches spread.

    The spread is taken from the measured image alone, with laws that no simulator has seen
    (:func:`radcal.calibration.grounds.fit_grounds`): it is pooled over the materials.

    Parameters
    ----------
    case : stages.Target
        Laws, objective and settings of the target.
    targets : Targets
        By calibrated material.
    geometry : Geometry
        Of the pass.
    registered : Registered
        The measured image; the uncertainty of its registration gives the error of the local incidence where
        ``target.incidence_error_deg`` does not say it.
    slope_error_deg : float
        Standard error of the scene's slopes [deg], the other part of that error.

    Returns
    -------
    Targets
        The same with ``classes``; as they are where the objective is the density.
    """
    if case.objective == "density":
        return targets
    grounds, methods = {}, {}
    laws = case.laws
    for name, target in targets.items():
        error = case.target.incidence_error_deg
        if error is None:
            moved = registration_error_deg(geometry.incidence_deg, registered.uncertainty_px, target.pixels)
            error = float(np.hypot(moved, slope_error_deg))
        grounds[name] = target.ground
        methods[name] = Method(
            laws[name],
            case.materials[name].box,
            float(case.radar.looks),
            objective=case.objective,
            classes=case.target.incidence_classes,
            free_looks=case.target.looks == "free",
            priors=case.target.priors,
            incidence_error_deg=error,
        )
    found = fit_grounds(grounds, methods)
    return Targets(
        {
            name: replace(
                target,
                classes=ClassTarget(
                    # a run shows the same pixels with one draw of speckle: the difference varies twice as much
                    classes=replace(found[name].classes, effective=0.5 * found[name].classes.effective),
                    spread=found[name].spread,
                    objective=case.objective,
                    looks=methods[name].looks,
                    free_looks=methods[name].free_looks,
                    priors=methods[name].priors,
                    incidence_error_deg=methods[name].incidence_error_deg,
                    noise_db=_noise_db(case, geometry, target),
                    first=found[name].fit.parameters,
                    first_looks=found[name].fit.looks,
                ),
            )
            for name, target in targets.items()
        },
        targets.levels,
        targets.looks,
    )


def _noise_db(case: stages.Target, geometry: Geometry, target: Target) -> float:
    """Mean power of the noise that radcal's own simulator adds to a target's pixels [dB]."""
    if not isinstance(case.simulator, BuiltinSimulation):
        return float("-inf")
    floor_db = noise_floor_db(case.radar, geometry.flat_incidence_deg)[target.pixels // geometry.shape[1]]
    return float(10.0 * np.log10(np.mean(10.0 ** (floor_db / 10.0))))


def class_searches(case: stages.Scores | stages.Archive, targets: Targets) -> dict[str, ClassSearch]:
    """What judges the runs of each material in classes of incidence; empty where the objective is the density.

    Parameters
    ----------
    case : stages.Scores or stages.Archive
        Laws, bounds and seed.
    targets : Targets
        By calibrated material.
    """
    laws = case.laws
    return {
        name: ClassSearch(
            target,
            target.classes,
            Method(laws[name], case.materials[name].box, target.classes.looks),
            derived_seed(case.seed, "texture", name),
        )
        for name, target in targets.items()
        if target.classes is not None
    }


class ClassSearch:
    """A material's law in classes of incidence against what runs show.

    Parameters
    ----------
    target : Target
        The pixels.
    classes : ClassTarget
        Their classes, and what was settled with them.
    method : Method
        Law, bounds and the sensor's looks; the rest is taken from ``classes``.
    seed : int
        Of the texture.
    """

    def __init__(self, target: Target, classes: ClassTarget, method: Method, seed: int) -> None:
        self._made_from = (target, classes, method, seed)
        self.classes, self._seed = classes, seed
        self.method = replace(
            method,
            objective=classes.objective,
            classes=classes.classes.size,
            free_looks=classes.free_looks,
            priors=classes.priors,
            incidence_error_deg=classes.incidence_error_deg,
        )
        self.ground: Ground = limited(target.ground, classes.classes.member)
        self._prior = curve_prior(self.ground, self.method)
        self._law = LawForward(method.law, classes.classes.nodes_deg, method.looks)
        self._baseline = replace(self._law, noise_db=classes.noise_db)
        low, high = np.quantile(self.ground.incidence_deg, [0.05, 0.95])
        self._seen = np.radians(np.linspace(float(low), float(high), 91))
        self._simulated: NDArray[np.float64] = classes.classes.cumulants
        # one objective for all runs: what it is asked about is put in place
        self._of_run = ground_residuals(
            self.ground, classes.classes, self.method, classes.spread, lambda _: self._simulated
        )

    def __reduce__(self) -> tuple[Any, ...]:
        # another process makes its own: what is called while searching cannot be sent
        return ClassSearch, self._made_from

    def cost(self, parameters: NDArray[np.float64], looks: float, cumulants: NDArray[np.float64]) -> float:
        """Half the sum of squared residuals of a run, priors included."""
        self._simulated = cumulants
        squares = (self._of_run(parameters, looks) ** 2).sum() + (self._prior(parameters, looks) ** 2).sum()
        return 0.5 * float(squares)

    def score(self, parameters: ArrayLike, cumulants: ArrayLike) -> tuple[float, float]:
        """What a run is worth at the looks that suit it best.

        Parameters
        ----------
        parameters : array_like, shape (d,)
            X of the run.
        cumulants : array_like, shape (n, 3)
            Its classes, at the sensor's looks.

        Returns
        -------
        looks : float
            Effective looks with the smallest cost.
        cost : float
            Half the sum of squared residuals there, priors included.
        """
        from scipy.optimize import minimize_scalar

        x, run = np.asarray(parameters, dtype=np.float64), np.asarray(cumulants, dtype=np.float64)
        if not self.method.free_looks:
            return self.method.looks, self.cost(x, self.method.looks, run)
        bounds = np.log([LOOKS[0], LOOKS[1] * self.method.looks])
        found = minimize_scalar(
            lambda log: self.cost(x, float(np.exp(log)), run), bounds=bounds, method="bounded", options={"xatol": 1e-6}
        )
        return float(np.exp(found.x)), float(found.fun)

    def textured(self, values_db: NDArray[np.float32], looks: float, fresh: bool = False) -> NDArray[np.float32]:
        """Pixels of the material with the texture that makes the sensor's looks the material's.

        Parameters
        ----------
        values_db : ndarray
            All visible pixels of the material in a run [dB].
        looks : float
            Effective looks of the material; texture only lowers those of the speckle.
        fresh : bool
            Other random numbers, for the final check.

        Returns
        -------
        ndarray of float32
            The same random numbers for every run: the texture is a smooth function of the looks.
        """
        order = texture_order(self.method.looks, looks)
        if not np.isfinite(order):
            return values_db
        uniform = np.random.default_rng([self._seed, int(fresh)]).random(values_db.shape)
        return (values_db + texture_db(uniform, order)).astype(np.float32)

    def surrogate(self, parameters: ArrayLike, cumulants: ArrayLike) -> Corrected:
        """Law and speckle, corrected by runs: X, shape (k, d), and their classes, shape (k, n, 3)."""
        return Corrected(self._baseline, parameters, cumulants)

    def fit(self, forward: Forward, start: tuple[ArrayLike, float], moves: bool = True) -> LawFit:
        """Least squares over X and looks with something in the simulator's place, from a start."""
        m = self.method
        residuals = ground_residuals(self.ground, self.classes.classes, m, self.classes.spread, forward)
        return fit_law(residuals, m.bounds, m.looks, m.free_looks, start, start[1], self._prior, moves)

    def propose(
        self, forward: Forward, config: Optimiser, seed: int, starts: Sequence[tuple[ArrayLike, float]]
    ) -> LawFit:
        """The law with the smallest cost on a surrogate.

        NSGA-II over X and looks minimises the squares of levels and of spreads side by side (of the likelihood,
        which has no such parts, those of the classes of small and of large incidence); its best sum, the law found
        without a simulator and the starts given are polished by least squares.

        Parameters
        ----------
        forward : callable
            What :meth:`surrogate` gave.
        config : Optimiser
            NSGA-II settings.
        seed : int
            Of its random numbers.
        starts : sequence of (X, looks)
            Further points to start from.

        Returns
        -------
        LawFit
        """
        method = self.method
        box = np.asarray(method.bounds, dtype=np.float64)
        looks_box = np.log([[LOOKS[0], LOOKS[1] * method.looks]])
        low, high = np.vstack([box, looks_box] if method.free_looks else [box]).T
        d = len(box)
        classes = self.classes.classes
        residuals = ground_residuals(self.ground, classes, method, self.classes.spread, forward)

        def split(unit: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
            q = low + unit * (high - low)
            return q[:d], float(np.exp(q[d])) if method.free_looks else method.looks

        # residuals of classes: all means, then all others; of the likelihood: class by class
        bins = residuals(*split(np.full(len(low), 0.5))).size // classes.size
        part = classes.size if method.objective == "classes" else classes.size // 2 * bins

        def objectives(units: NDArray[np.float64]) -> NDArray[np.float64]:
            found = []
            for unit in units:
                x, looks = split(unit)
                squares, weak = residuals(x, looks) ** 2, (self._prior(x, looks) ** 2).sum()
                found.append([squares[:part].sum() + weak, squares[part:].sum()])
            return np.array(found)

        first = split(nsga2(objectives, len(low), config, seed, objectives=2)[0])
        known = [*starts, (self.classes.first, self.classes.first_looks)]
        fits = [
            fit_law(residuals, box, method.looks, method.free_looks, start, prior=self._prior)
            for start in (first, *known)
        ]
        return min(fits, key=lambda fit: fit.cost)

    def left(self, parameters: ArrayLike, looks: float, cumulants: ArrayLike) -> tuple[float, float]:
        """How far a run lies from the minimum, as its own correction of law and speckle sees it.

        Parameters
        ----------
        parameters : array_like, shape (d,)
            X of the run.
        looks : float
            Its effective looks.
        cumulants : array_like, shape (n, 3)
            Its classes.

        Returns
        -------
        cost : float
            What least squares from there would still take from the cost. In terms of the law's own
            uncertainty: a law one standard error off costs 0.5.
        moved_db : float
            Largest change of the law on the way, over the incidence seen (5-95 %) [dB].
        """
        x, run = np.asarray(parameters, dtype=np.float64), np.asarray(cumulants, dtype=np.float64)
        fit = self.fit(self.surrogate(x[None], run[None]), (x, looks))
        moved = self.method.law(self._seen, fit.parameters) - self.method.law(self._seen, x)
        return max(self.cost(x, looks, run) - fit.cost, 0.0), float(np.abs(moved).max())

    def law(self, parameters: ArrayLike, looks: float, cumulants: ArrayLike) -> GroundLaw:
        """The law of a run with its uncertainty, for the prediction of other ground.

        Parameters
        ----------
        parameters : array_like, shape (d,)
            X of the run.
        looks : float
            Its effective looks.
        cumulants : array_like, shape (n, 3)
            Its classes.

        Returns
        -------
        GroundLaw
            X and looks are the run's; what its classes hold besides law and speckle is its correction.
        """
        x, run = np.asarray(parameters, dtype=np.float64), np.asarray(cumulants, dtype=np.float64)
        fit = self.fit(self.surrogate(x[None], run[None]), (x, looks), moves=False)
        fit = replace(fit, parameters=x, looks=looks)
        correction = run[:, 0] - self._law(x)[:, 0]
        # part of how it differs from class to class is the run's own speckle
        common = correction.mean()
        noise = float(np.mean(run[:, 1] / (2.0 * self.classes.classes.effective)))
        correction = common + max(0.0, 1.0 - noise / max(float(np.var(correction)), 1e-12)) * (correction - common)
        return GroundLaw(self.ground, self.method, self.classes.classes, self.classes.spread, fit, correction)
