"""One model of what is known: the laws of all calibrated materials, and what the fixed ones say of the images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.calibration.steps import train_all
from radcal.config.part import Part
from radcal.laws import Law
from radcal.objectives import Comparison
from radcal.objectives.history import History
from radcal.posterior.calibrated import FORMS, Draws, LawModel, Parameters
from radcal.posterior.cells import CellMeans
from radcal.posterior.curves import curves_of
from radcal.posterior.effects import Observed
from radcal.posterior.fixed_laws import image_from
from radcal.posterior.form_error import form_error, noticed_db
from radcal.posterior.prediction import constant_of, field_check, left_out
from radcal.posterior.quantiles import Form, points_of, summary, with_band, without_cells
from radcal.posterior.result import Image, Posterior
from radcal.processes import one_thread
from radcal.proposals.surrogate import Surrogate
from radcal.radar.radiometry import with_noise_db
from radcal.seeds import derived_seed
from radcal.targets.target import Targets, level_only

Doubles = NDArray[np.float64]
Cells = Sequence[Mapping[str, CellMeans]]
"""Cells of each material, one mapping for each pass."""

_KNOT_DEG = 1.0
_LEAST_SHARE = 0.2
_ANGLES = 41
_FOLDS = 5  # of fields
_FEWEST = 3  # cells


def _observed(name: str, cells: Cells, laws: Sequence[Law], x: Sequence[float]) -> Observed:
    """Cells of one material in all passes, with level and slope of its law."""
    each = [one.get(name, CellMeans.none()) for one in cells]

    def levels(step: float) -> list[Doubles]:
        at = [np.radians(np.clip(own.incidence_deg + step, 0.0, 90.0)) for own in each]
        return [np.asarray(law(phi, x)) if law.has_curve else 0.0 * phi for law, phi in zip(laws, at, strict=True)]

    slope = [above - below for above, below in zip(levels(0.5), levels(-0.5), strict=True)]
    return Observed(each, levels(0.0), slope)


def _mean_areas(cells: Cells) -> list[float]:
    """Mean area of the ground in the cells of each pass [dB]; 0 in a pass without cells."""

    def mean(one: Mapping[str, CellMeans]) -> float:
        area, pixels = (np.concatenate([getattr(c, key) for c in one.values()]) for key in ("area_db", "pixels"))
        return float(np.average(area, weights=pixels))

    return [mean(one) if one else 0.0 for one in cells]


def image_of(case: Part, cells: Cells) -> Image:
    """What the fixed materials say of the images of all passes.

    Parameters
    ----------
    case : Part
        Configuration.
    cells : sequence of mapping
        Cells of each material in each pass.
    """
    decibels = case.target.normalisation != "image"
    fixed = [name for name in case.reference_materials if decibels and any(name in one for one in cells)]
    observed = {
        name: _observed(name, cells, [one.laws[name] for one in case.passes], case.materials[name].start_parameters)
        for name in fixed
    }
    declared = [one.radar.radiometry for one in case.passes]
    offset = case.target.normalisation != "none"
    seed = derived_seed(case.seed, "posterior", "fixed laws")
    with one_thread():  # one thread: sums then have a fixed order
        return image_from(observed, _mean_areas(cells), declared, case.uncertainty, offset, seed)


def posterior_of(
    case: Part, targets: Sequence[Targets], history: History, objective: Comparison, cells: Cells, image: Image
) -> Posterior:
    """Posterior of one material's law, given what the fixed materials say.

    Without cells in the passes in which the material has a target, the posterior holds the bounds of X alone.

    Parameters
    ----------
    case : Part
        Configuration.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    history : History
        All scored runs; the cells are relative to the best X.
    objective : Comparison
        Objective of the material in all passes.
    cells : sequence of mapping
        Cells of each material in each pass.
    image : Image
        Result of :func:`image_of`.
    """
    name = objective.material.name
    best = np.asarray(history.best(name).parameters, dtype=np.float64)
    laws = [one.laws[name] for one in case.passes]
    seen = [
        (float(low), float(high))
        for one in targets
        if name in one
        for low, high in [np.quantile(one[name].incidence_deg.astype(np.float64), [0.05, 0.95])]
    ]
    own = [one if name in target else {} for one, target in zip(cells, targets, strict=True)]
    observed = _observed(name, own, laws, best.tolist())
    if not observed.size:
        return without_cells(objective.material.box, seen)
    if laws[0].has_curve:
        parameters, weights, knots = _with_curve(observed, objective, laws, _attenuation(targets, name))
    else:
        parameters, weights, knots = _without_curve(case, observed, objective, history, best, name)
    decibels = case.target.normalisation != "image"
    curved = laws[0].has_curve and decibels
    form = Form(observed.together("incidence_deg")) if curved and not level_only(targets, name) else None
    forms = np.zeros((observed.size, FORMS)) if form is None else form.columns(observed.together("incidence_deg"))
    flattening = _flattening(observed, _attenuation(targets, name), case.uncertainty.incidence_error)
    with one_thread():
        seed = derived_seed(case.seed, "posterior", name)
        areas, given = _mean_areas(cells), list(image.shared.values())
        each = [LawModel(observed, weights, parameters, forms, flattening, k, areas, case.uncertainty) for k in given]
        whole = each[0]  # of the most probable radiometry
        kept = observed.together("fold") == 0
        if case.validation is None or not case.validation.holds_out or np.count_nonzero(kept) < _FEWEST:
            kept = np.ones_like(kept)
        models = each if kept.all() else [one.part(kept, case.uncertainty) for one in each]
        model = models[0]
        drawn = [one.drawn(seed, best) for one in models]
        draws, middle = Draws.mixed(drawn, [one.chance for one in given]), np.median(drawn[0].sample.draws, axis=0)
        error = held = fields = None
        if form is not None:
            span = min(low for low, _ in seen), max(high for _, high in seen)
            columns = form.columns(np.linspace(*span, _ANGLES))
            errors = draws.form @ columns.T
            smallest = noticed_db(model, middle, columns, knots, span)
            error = form_error(errors - errors.mean(axis=1, keepdims=True), smallest)
        if curved and case.validation:
            fold = observed.together("fold")
            if case.validation.keep == "fields":
                fold = np.unique(whole.patch, return_inverse=True)[1] % _FOLDS
            elif case.validation.holds_out:
                fold = np.where(fold == 1, 1, -1)
            held, fields = left_out(whole, fold, seed), field_check(model, seed)
        simulated = [with_noise_db(law, one.noise_db) for law, one in zip(observed.law_db, observed.cells, strict=True)]
        signal = whole.measured_db + np.concatenate(observed.law_db) - np.concatenate(simulated)  # without noise
        constant = constant_of(signal[kept], model.variance, model.patch) if curved else None
    found = replace(summary(observed, draws, form, seen, error), held=held, left_out=fields, constant=constant)
    if not curved:
        return found
    known_db = None if level_only(targets, name) else case.uncertainty.known_db
    found = replace(found, points=points_of(whole, signal, draws, drawn[0]))
    return with_band(found, laws[0], draws, form, parameters, known_db)


def _with_curve(
    observed: Observed, objective: Comparison, laws: Sequence[Law], attenuation: Sequence[tuple[float, float]]
) -> tuple[Parameters, Doubles, Doubles]:
    """Parameters of a law with a curve, weights of its knots in the cells, and the knots [deg]."""
    seen: list[tuple[Law, Doubles, Doubles]] = []
    knots: list[Doubles] = []
    blocks: list[Doubles] = []
    for own, law, (middle, share) in zip(observed.cells, laws, attenuation, strict=True):
        if not own.size:
            continue
        at = np.arange(np.floor(own.incidence_deg.min()), np.ceil(own.incidence_deg.max()) + _KNOT_DEG, _KNOT_DEG)
        order = np.argsort(own.incidence_deg)
        known = bool(np.isfinite(own.noise_db).all())
        noise = np.interp(at, own.incidence_deg[order], own.noise_db[order]) if known else np.full(at.size, -np.inf)
        seen.append((law, np.radians(np.clip(middle + share * (at - middle), 0.0, 90.0)), noise))
        blocks.append(np.maximum(0.0, 1.0 - np.abs(own.incidence_deg[:, None] - at) / _KNOT_DEG))
        knots.append(at)
    prior = next(part for part in objective.passes if part is not None).prior

    def log_prior(x: Doubles) -> Doubles:
        if prior is None:
            return np.zeros(len(x))
        curves = curves_of(laws[0], x, np.radians(prior.angles_deg))
        return np.asarray(-0.5 * (prior.of_curves(curves, x) ** 2).sum(axis=1))

    def levels(x: Doubles) -> Doubles:
        return np.concatenate([with_noise_db(curves_of(law, x, phi), noise) for law, phi, noise in seen], axis=1)

    box = np.asarray(objective.material.box)
    parameters = Parameters(box, objective.material.integer, levels, log_prior)
    return parameters, np.asarray(scipy.linalg.block_diag(*blocks)), np.concatenate(knots)


def _without_curve(
    case: Part, observed: Observed, objective: Comparison, history: History, best: Doubles, name: str
) -> tuple[Parameters, Doubles, Doubles]:  # fmt: skip
    """Parameters of a law without a curve, by the surrogate's means of the incidence-angle bins."""
    surrogate = Surrogate(train_all(history, case, {name: objective})[name], objective, history.surprise(name))
    middles, blocks = [], []
    for own, part in zip(observed.cells, objective.passes, strict=True):
        if part is None:  # without a target, and so without cells
            continue
        classes = part.classes
        middle = classes.nodes_deg.mean(axis=1)
        nearest = np.abs(own.incidence_deg[:, None] - middle).argmin(axis=1)
        blocks.append(np.eye(middle.size)[nearest])
        middles.append(middle)

    def at(x: Doubles) -> Doubles:
        return surrogate.snapped(surrogate.unit(x))

    start = surrogate.predict(at(best[None]))[..., 0]
    parameters = Parameters(
        np.asarray(objective.material.box),
        objective.material.integer,
        levels=lambda x: np.asarray(surrogate.predict(at(x))[..., 0] - start),
        log_prior=lambda x: np.zeros(len(x)),
        error=lambda x: np.asarray(surrogate.error(at(x))[:, 0]),
    )
    return parameters, np.asarray(scipy.linalg.block_diag(*blocks)), np.concatenate(middles)


def _attenuation(targets: Sequence[Targets], name: str) -> list[tuple[float, float]]:
    """Mean incidence [deg] in each pass, and factor on the distance from it at which the true incidence is expected.

    References
    ----------
    Carroll et al., "Measurement Error in Nonlinear Models", 2nd edition (2006), chapter 4: regression calibration.
    """
    found = []
    for one in targets:
        if name not in one or (classes := one[name].classes) is None or classes.incidence_error_deg <= 0.0:
            found.append((0.0, 1.0))
            continue
        angle = one[name].incidence_deg.astype(np.float64)
        share = 1.0 - classes.incidence_error_deg**2 / max(float(np.var(angle)), 1e-12)
        found.append((float(angle.mean()), max(share, _LEAST_SHARE)))
    return found


def _flattening(observed: Observed, attenuation: Sequence[tuple[float, float]], log_sd: float) -> Doubles:
    """Change of each cell if the standard error of the incidence is one standard deviation larger, shape (n,) [dB]."""
    return np.concatenate([
        -2.0 * (1.0 - share) * log_sd * slope * (own.incidence_deg - middle)
        for own, slope, (middle, share) in zip(observed.cells, observed.slope_db, attenuation, strict=True)
    ])  # fmt: skip
