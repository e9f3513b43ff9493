"""Targets by incidence-angle bin: statistics of the pixels in each bin, with the variance between fields."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from radcal.config.part import Part
from radcal.ground.bins import incidence_edges
from radcal.ground.ground import Ground
from radcal.inference.incidence_error import registration_error_deg
from radcal.inference.misfit import BinMisfit, Method, Misfit
from radcal.inference.pooled_laws import fit_laws
from radcal.laws import law_for
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered
from radcal.targets.class_target import ClassTarget
from radcal.targets.target import Targets

_LEVEL_DB = 40.0  # half width of a bin level's bounds about the mean of the pixels, for laws without a curve


def bin_targets(
    case: Part,
    targets: Targets,
    geometry: Geometry,
    registered: Registered,
    misfit: type[Misfit],
    slope_error_deg: float = 0.0,
) -> Targets:
    """Divide the pixels of all targets into incidence-angle bins, and estimate the variance between fields.

    The variance is estimated from the measured image alone, without simulator runs
    (:func:`radcal.inference.pooled_laws.fit_laws`), and pooled over the materials.

    Parameters
    ----------
    case : Part
        Laws and settings of the target.
    targets : Targets
        Targets of the calibrated materials.
    geometry : Geometry
        Geometry of the pass, with the local incidence.
    registered : Registered
        Registered measured image; the uncertainty of its registration gives the error of the local incidence if
        ``target.incidence_error_deg`` is not configured.
    misfit : type of Misfit
        Misfit of the pixels in a bin, with which the laws are fitted.
    slope_error_deg : float
        Standard error of the scene's slopes [deg]; it is added in quadrature to the error from the registration.

    Returns
    -------
    Targets
        Targets with their ``classes``.
    """
    laws, measured, methods, binned = case.laws, {}, {}, {}
    for name, target in targets.items():
        law, error, each = laws[name], case.target.incidence_error_deg, None
        if error is None:
            each = np.hypot(
                registration_error_deg(geometry.incidence_deg, registered.uncertainty_px, target.pixels),
                slope_error_deg,
            )
            error = float(np.sqrt(np.mean(each**2)))
        measured[name] = replace(target.ground, error_deg=each if law.has_curve else None)
        method = Method(
            law,
            case.materials[name].box,
            float(case.radar.looks),
            misfit=misfit,
            classes=case.target.incidence_classes,
            free_looks=case.target.looks == "free",
            priors=case.target.priors,
            incidence_error_deg=error,
        )
        methods[name] = method if law.has_curve else _without_curve(method, target.ground)
    for name, found in fit_laws(measured, methods).items():
        classes = ClassTarget(
            classes=found.classes.compared(case.simulator.draws),
            spread=found.spread,
            free_looks=found.method.free_looks,
            priors=case.target.priors,
            incidence_error_deg=found.method.incidence_error_deg,
            first=found.fit.parameters if laws[name].has_curve else np.empty(0),
            first_looks=found.fit.looks,
            error_deg=measured[name].error_deg,
        )
        binned[name] = replace(targets[name], classes=classes)
    return Targets(binned, targets.levels, targets.looks)


def _without_curve(method: Method, ground: Ground) -> Method:
    """Method that fits a level [dB] in each incidence-angle bin, in place of a law that only the simulator knows."""
    edges = incidence_edges(ground.incidence_deg, method.classes)
    mean = float(ground.values_db.mean())
    knots = 0.5 * (edges[1:] + edges[:-1]) if len(edges) > 2 else [edges[0] - 1.0, edges[0] + 1.0]
    levels = law_for("tabulated", angles_deg=tuple(knots))
    bounds = [(mean - _LEVEL_DB, mean + _LEVEL_DB)] * len(knots)
    return replace(method, law=levels, bounds=bounds, misfit=BinMisfit, priors=False, incidence_error_deg=0.0)
