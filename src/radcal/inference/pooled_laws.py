"""Laws fitted to the measured pixels of several materials, with the variance of fields pooled over materials.

The fit of one material's law and effective looks is by least squares, with their uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.ground.bins import Classes, class_of, incidence_edges, make_classes, winsorised
from radcal.ground.ground import Ground
from radcal.ground.patches import Residuals as CellResiduals
from radcal.ground.patches import Spread, spreads
from radcal.inference.bounded import distant, least_squares, sobol
from radcal.inference.misfit import LawForward, Method, true_angles
from radcal.inference.priors import LOOKS_MOST, CurvePrior, looks_residuals
from radcal.speckle.texture import log_speckle_cumulants

_ROUNDS = 3  # alternations between fits of the laws and estimates of the spread
_START_SPREAD = Spread(0.8, 0.4)  # [dB], in the first round; 0.8 is the mean of a half-normal law of 1 dB
_STEP = 1e-4
Residuals = Callable[[NDArray[np.float64], float], NDArray[np.float64]]
"""Function from X, shape (d,), and effective looks to residuals in standard deviations, shape (k,)."""

LOOKS = (0.3, LOOKS_MOST)
"""Bounds of the effective looks: smallest number of looks, and largest one in multiples of the sensor's looks."""
_SCREENED = 256
_STARTS = 5
_TOLERANCE = 1e-6  # residuals are in standard deviations
_CALLS = 100
_SAME_COST = 1e-3
_KNOWN = 1e9  # inverse variance of a parameter that is not fitted


@dataclass(frozen=True)
class LawFit:
    """Fitted law of one material.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        Fitted parameters X.
    looks : float
        Effective number of looks.
    cost : float
        Half the sum of squared residuals, priors included.
    covariance : ndarray, shape (d + 1, d + 1)
        Covariance of X and the logarithm of the looks: inverse of the Gauss-Newton matrix, to which the bounds add the
        information of a uniform distribution.
    prior_information : ndarray, shape (d + 1, d + 1)
        Inverse covariance of X and the logarithm of the looks from priors and bounds alone.
    """

    parameters: NDArray[np.float64]
    looks: float
    cost: float
    covariance: NDArray[np.float64]
    prior_information: NDArray[np.float64]


def fit_law(
    residuals: Residuals,
    bounds: ArrayLike,
    sensor: float,
    free_looks: bool = True,
    start: tuple[ArrayLike, float] | None = None,
    prior: Residuals = lambda *_: np.empty(0),
) -> LawFit:
    """Minimise the sum of squared residuals over X and the effective looks.

    Bounded least squares start from the best points of a Sobol sample inside the bounds.

    Parameters
    ----------
    residuals : callable
        Function from X and looks to residuals in standard deviations.
    bounds : array_like, shape (d, 2)
        Bounds of X.
    sensor : float
        Number of looks of the sensor; effective looks are searched from 0.3 looks to 1.1 times the sensor's looks.
    free_looks : bool
        Whether the effective looks are searched.
    start : (X, looks), optional
        Start of the search, in place of the points of the sample. Looks that are not searched are those of the start
        or, without a start, those of the sensor.
    prior : callable, optional
        Function from X and looks to residuals of the priors, which are minimised with ``residuals``.

    Returns
    -------
    LawFit
    """
    box = np.asarray(bounds, dtype=np.float64)
    assumed = sensor if start is None else start[1]
    looks_box = np.log([[LOOKS[0], LOOKS[1] * sensor]]) if free_looks else np.empty((0, 2))
    low, high = np.concatenate([box, looks_box]).T
    width = high - low
    d = len(box)

    def at(unit: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        q = np.clip(low + unit * width, low, high)
        return q[:d], float(np.exp(q[d])) if free_looks else assumed

    def each(units: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.concatenate([residuals(*point), prior(*point)]) for point in map(at, units)])

    if start is not None:
        x, looks = start
        first = np.append(np.asarray(x, dtype=np.float64), [np.log(looks)] if free_looks else [])
        starts = [(first - low) / width]
    else:
        sample = sobol(len(low), _SCREENED, 0)
        ranked = sample[np.argsort((each(sample) ** 2).sum(axis=1), kind="stable")]
        starts = list(distant(ranked, _STARTS))
    best: Any = None
    for unit in starts:
        found = least_squares(each, unit, np.zeros_like(low), np.ones_like(low), _TOLERANCE, _CALLS)
        agree = best is not None and abs(found.cost - best.cost) < _SAME_COST
        if best is None or found.cost < best.cost:
            best = found
        if agree:  # two starts that end at the same cost have found the minimum
            break
    # a uniform law on the unit interval has the variance 1/12
    known = 12.0 * np.eye(len(low))
    data, weak = np.split(best.jac, [len(best.jac) - prior(*at(best.x)).size])
    known += weak.T @ weak
    # looks that are not searched are known
    covariance, information = np.zeros((d + 1, d + 1)), np.diag([0.0] * d + [_KNOWN])
    inside = slice(len(low))
    covariance[inside, inside] = np.linalg.inv(known + data.T @ data) * np.multiply.outer(width, width)
    information[inside, inside] = known / np.multiply.outer(width, width)
    return LawFit(*at(best.x), float(best.cost), covariance, information)


@dataclass(frozen=True)
class FittedLaw:
    """Fitted law of one material, with the data and the settings of the fit.

    Attributes
    ----------
    ground : Ground
        Measured pixels.
    method : Method
        Settings of the fit.
    classes : Classes
        Incidence-angle bins of the measured pixels.
    spread : Spread
        Between-field and within-field standard deviation [dB].
    fit : LawFit
        Fitted X and looks, with their uncertainty.
    """

    ground: Ground
    method: Method
    classes: Classes
    spread: Spread
    fit: LawFit

    def levels_db(self, incidence_deg: ArrayLike, parameters: ArrayLike | None = None) -> NDArray[np.float64]:
        """Expected mean of pixels [dB] at mapped angles [deg], shape (k,): law and mean log speckle."""
        x = self.fit.parameters if parameters is None else parameters
        angle = np.asarray(incidence_deg, dtype=np.float64)
        nodes = true_angles(self.ground, self.classes, self.method, angle[:, None])
        return np.asarray(self.method.law(np.radians(nodes), x).mean(axis=1) + log_speckle_cumulants(self.fit.looks)[0])

    def slopes(self, incidence_deg: ArrayLike) -> NDArray[np.float64]:
        """Derivatives of :meth:`levels_db` with respect to X and the logarithm of the looks, shape (k, d + 1)."""
        low, high = np.asarray(self.method.bounds, dtype=np.float64).T
        columns = []
        for j, width in enumerate(high - low):
            step = np.zeros(low.size)
            step[j] = _STEP * width
            pair = [self.levels_db(incidence_deg, self.fit.parameters + sign * step) for sign in (1.0, -1.0)]
            columns.append((pair[0] - pair[1]) / (2.0 * step[j]))
        more, less = (log_speckle_cumulants(self.fit.looks * np.exp(s))[0] for s in (_STEP, -_STEP))
        columns.append(np.full_like(columns[0], (more - less) / (2.0 * _STEP)))
        return np.stack(columns, axis=-1)

    def cell_residuals(self) -> CellResiduals:
        """Cell means minus law, with the information on X and looks that comes from priors and bounds alone."""
        ground, cells = self.ground, self.ground.cells
        return CellResiduals(
            cells.mean(ground.values_db - self.levels_db(ground.incidence_deg)),
            ground.sampling,
            cells.patch,
            cells.mean(self.slopes(ground.incidence_deg)),
            self.fit.prior_information,
        )


def limited(ground: Ground, member: NDArray[np.int64]) -> Ground:
    """Ground with far outliers limited (winsorised) in each bin; ``member``, shape (pixels,), is each pixel's bin."""
    return replace(ground, values_db=winsorised(ground.values_db, member))


def bins_of(ground: Ground, classes: int | Literal["auto"]) -> Classes:
    """Incidence-angle bins of measured pixels, by :func:`radcal.ground.ground.incidence_edges`."""
    return make_classes(ground.values_db, ground.incidence_deg, classes, ground.pairs, ground.cells.of_pixel)


def curve_prior(ground: Ground, method: Method) -> Residuals:
    """Function from X and looks to the residuals of the priors on a material's curve and looks; none without priors."""
    prior = law_prior(ground, method)

    def residuals(parameters: NDArray[np.float64], looks: float) -> NDArray[np.float64]:
        curve = np.empty(0) if prior is None else prior.residuals(parameters)
        with_looks = method.priors and method.free_looks
        return np.concatenate([curve, looks_residuals(looks, method.looks)]) if with_looks else curve

    return residuals


def law_prior(ground: Ground, method: Method) -> CurvePrior | None:
    """Prior on a material's curve; None if priors are switched off, or for a law without a curve."""
    level = float(ground.values_db.mean()), float(ground.incidence_deg.mean())
    return CurvePrior(method.law, *level) if method.priors and method.law.has_curve else None


def ground_residuals(ground: Ground, classes: Classes, method: Method, spread: Spread) -> Residuals:
    """Function from X and looks to the residuals of one material, without those of the priors."""
    simulate = LawForward(method.law, classes.nodes_deg, method.looks)
    misfit = method.misfit.of(ground, classes, method, spread)
    return lambda x, looks: misfit(x, looks, simulate(x))


def fit_laws(measured: Mapping[str, Ground], methods: Mapping[str, Method]) -> dict[str, FittedLaw]:
    """Fit the laws of several materials and, alternately, estimate the variance between and within their fields.

    Parameters
    ----------
    measured : mapping
        Pixels by material.
    methods : mapping
        Settings of the fit by material.

    Returns
    -------
    dict
        Fitted law by material.
    """
    edges = {name: incidence_edges(ground.incidence_deg, methods[name].classes) for name, ground in measured.items()}
    measured = {name: limited(one, class_of(one.incidence_deg, edges[name])) for name, one in measured.items()}
    classes = {name: bins_of(g, methods[name].classes) for name, g in measured.items()}
    spread = dict.fromkeys(measured, _START_SPREAD)
    found: dict[str, FittedLaw] = {}
    for turn in range(_ROUNDS):
        for name, ground in measured.items():
            method = methods[name]
            if turn and not method.misfit.of_fields:  # only misfits with variance between fields depend on the spread
                found[name] = replace(found[name], spread=spread[name])
                continue
            last = found.get(name)
            start = (last.fit.parameters, last.fit.looks) if last else None
            residuals = ground_residuals(ground, classes[name], method, spread[name])
            prior = curve_prior(ground, method)
            fit = fit_law(residuals, method.bounds, method.looks, method.free_looks, start, prior)
            found[name] = FittedLaw(ground, method, classes[name], spread[name], fit)
        if turn < _ROUNDS - 1:
            spread = dict(zip(found, spreads([item.cell_residuals() for item in found.values()]), strict=True))
    return found
