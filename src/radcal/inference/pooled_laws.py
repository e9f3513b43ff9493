"""Laws fitted to the measured pixels of several materials, with the variance of fields pooled over materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.ground.bins import Classes, class_of, incidence_edges, make_classes, winsorised
from radcal.ground.ground import Ground
from radcal.ground.patches import Residuals as CellResiduals
from radcal.ground.patches import Spread, spreads
from radcal.inference.expected import LawForward
from radcal.inference.law_fit import LawFit, Residuals, fit_law
from radcal.inference.misfit import Method, true_angles
from radcal.inference.priors import CurvePrior, looks_residuals
from radcal.speckle.texture import log_speckle_cumulants

_ROUNDS = 3  # alternations between fits of the laws and estimates of the spread
_START_SPREAD = Spread(0.8, 0.4)  # [dB], in the first round; 0.8 is the mean of a half-normal law of 1 dB
_STEP = 1e-4


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
    """Incidence-angle bins of measured pixels, by :func:`radcal.ground.bins.incidence_edges`."""
    return make_classes(ground.values_db, ground.incidence_deg, classes, ground.pairs, ground.cells.of_pixel)


def curve_prior(ground: Ground, method: Method) -> Residuals:
    """Function from X and looks to the residuals of the priors on a material's curve and looks; none without priors."""
    prior = law_prior(ground, method)

    def residuals(parameters: NDArray[np.float64], looks: float) -> NDArray[np.float64]:
        if prior is None:
            return np.empty(0)
        curve = prior.residuals(parameters)
        return np.concatenate([curve, looks_residuals(looks, method.looks)]) if method.free_looks else curve

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
