"""One model of what is known: the laws of all calibrated materials, and what the fixed ones say of the images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from radcal.assessment.calibrated import FORMS, Draws, LawModel, Parameters
from radcal.assessment.cells import CellMeans, with_noise_db
from radcal.assessment.curves import GRID_DEG, NORMAL_90, Curves
from radcal.assessment.fixed_laws import Common, Observed, common_of, form_basis
from radcal.assessment.form_error import form_error, noticed_db
from radcal.assessment.posterior import WHOLE_DEG, Curve, FormError, Image, KeptDraws, Posterior, known_between
from radcal.assessment.radiometry import Radiometry, radiometry_of
from radcal.calibration.history import History
from radcal.calibration.objectives import Comparison, make_objectives
from radcal.calibration.steps import train_all
from radcal.calibration.surrogate import Surrogate
from radcal.config import stages
from radcal.measurement.target import Targets
from radcal.radar.laws import Law
from radcal.seeds import derived_seed

__all__ = ["image_of", "posterior_of"]

Doubles = NDArray[np.float64]
Cells = Sequence[Mapping[str, CellMeans]]
"""Cells of each material, one mapping for each pass."""

_KNOT_DEG = 1.0
_FORM_KNOT_DEG = 2.0
_KEPT = 400
_QUANTILES = [0.05, 0.5, 0.95]
_LEAST_SHARE = 0.2
_ANGLES = 41
_TRIED = 3  # draws from which the nearest law is searched


def _observed(name: str, cells: Cells, laws: Sequence[Law], x: Sequence[float], areas: Sequence[int]) -> Observed:
    """Cells of one material in all passes, with the area terms of wrong radiometries taken out."""
    law_db, slope_db, each = [], [], []
    for one, law, area in zip(cells, laws, areas, strict=True):
        own = one.get(name)
        own = CellMeans.none() if own is None else own.moved(area)
        deg = own.incidence_deg
        if law.has_curve and own.size:
            law_db.append(np.asarray(law(np.radians(deg), x)))
            above, below = (np.asarray(law(np.radians(np.clip(deg + step, 0.0, 90.0)), x)) for step in (0.5, -0.5))
            slope_db.append(above - below)
        else:
            law_db.append(np.zeros(own.size))
            slope_db.append(np.zeros(own.size))
        each.append(own)
    return Observed(each, law_db, slope_db)


def _mean_areas(cells: Cells) -> list[float]:
    """Mean area of the ground in the cells of each pass [dB]."""
    each = [[np.concatenate([getattr(c, key) for c in one.values()]) for key in ("area_db", "pixels")] for one in cells]
    return [float(np.average(area, weights=pixels)) for area, pixels in each]


def image_of(case: stages.Posterior, cells: Cells) -> tuple[Image, Common]:
    """What the fixed materials say of the images of all passes.

    Parameters
    ----------
    case : stages.Posterior
        Configuration.
    cells : sequence of mapping
        Cells of each material in each pass.
    """
    fixed = [name for name in case.reference_materials if any(name in one for one in cells)]
    decibels = case.target.normalisation != "image"
    fixed = fixed if decibels else []
    found: dict[str, Radiometry] = {}
    areas = []
    for number, (one, own) in enumerate(zip(case.passes, cells, strict=True), start=1):
        laws = one.laws
        each = {
            name: (own[name], np.asarray(laws[name](np.radians(own[name].incidence_deg), _fixed_x(case, name))))
            for name in fixed
            if name in own
        }
        found[str(number)] = radiometry_of(each, one.radar.radiometry, case.uncertainty)
        areas.append(found[str(number)].found)
    passes = [one.laws for one in case.passes]
    observed = {
        name: _observed(name, cells, [laws[name] for laws in passes], _fixed_x(case, name), areas) for name in fixed
    }
    offset = case.target.normalisation != "none"
    seed = derived_seed(case.seed, "posterior", "fixed laws")
    with threadpool_limits(1):  # one thread: sums then have a fixed order
        common = common_of(observed, _mean_areas(cells), case.uncertainty, offset, seed)
    return Image(common.levels_db, common.laws_db, common.apart_db, found, common.sampled), common


def _fixed_x(case: stages.Posterior, name: str) -> Sequence[float]:
    return case.materials[name].start_parameters


def posterior_of(
    case: stages.Posterior,
    targets: Targets,
    history: History,
    name: str,
    cells: Cells,
    image: Image,
    common: Common,
) -> Posterior:
    """Posterior of one material's law, given what the fixed materials say.

    Parameters
    ----------
    case : stages.Posterior
        Configuration.
    targets : Targets
        Target of each calibrated material in all passes.
    history : History
        All scored runs; the cells are relative to the best X.
    name : str
        Material.
    cells : sequence of mapping
        Cells of each material in each pass.
    image, common : Image, Common
        Result of :func:`image_of`.
    """
    objective = make_objectives(case, targets)[name]
    best = np.asarray(history.best(name).scores[name].parameters, dtype=np.float64)
    laws = [one.laws[name] for one in case.passes]
    areas = [one.found for one in image.radiometry.values()]
    observed = _observed(name, cells, laws, best.tolist(), areas)
    curved = laws[0].has_curve
    decibels = case.target.normalisation != "image"
    if curved:
        parameters, weights, knots = _with_curve(observed, objective, laws, best, targets, name)
    else:
        parameters, weights, knots = _without_curve(case, observed, objective, history, best, targets, name)
    angle = observed.together("incidence_deg")
    form_knots = np.arange(np.floor(angle.min()), np.ceil(angle.max()) + 2.0 * _FORM_KNOT_DEG, _FORM_KNOT_DEG)
    of_form = curved and decibels and not targets.level_only(name)
    forms = form_basis(angle, form_knots, FORMS) if of_form else np.zeros((angle.size, FORMS))
    flattening = _flattening(observed, targets, name, case.uncertainty.incidence_error)
    with threadpool_limits(1):
        model = LawModel(
            observed, weights, parameters, _wide(forms), flattening, common, _mean_areas(cells), case.uncertainty
        )
        draws = model.drawn(derived_seed(case.seed, "posterior", name), best)
        form = None
        seen = [
            tuple(float(q) for q in np.quantile(one[name].incidence_deg.astype(np.float64), [0.05, 0.95]))
            for one in targets.passes
            if name in one
        ]
        basis = lambda deg: _wide(form_basis(np.clip(deg, form_knots[0], form_knots[-1]), form_knots, FORMS))  # noqa: E731
        if of_form:
            form = _form_error(model, draws, basis, knots, seen)
    return _summary(
        case,
        observed,
        laws[0],
        draws,
        seen,
        basis if of_form else None,
        form,
        targets.level_only(name),
        decibels,
        parameters,
    )


def _wide(columns: Doubles) -> Doubles:
    """Columns padded with zeros to the number of components of a form error."""
    return np.pad(columns, ((0, 0), (0, FORMS - columns.shape[1])))


def _with_curve(
    observed: Observed, objective: Comparison, laws: Sequence[Law], best: Doubles, targets: Targets, name: str
) -> tuple[Parameters, Doubles, Doubles]:
    """Parameters of a law with a curve, weights of its knots in the cells, and the knots [deg]."""
    box = np.asarray(objective.material.box)
    knots, evaluate, blocks = [], [], []
    for own, law, (middle, share) in zip(observed.cells, laws, _attenuation(targets, name), strict=True):
        if not own.size:
            blocks.append(np.zeros((0, 0)))
            continue
        at = np.arange(np.floor(own.incidence_deg.min()), np.ceil(own.incidence_deg.max()) + _KNOT_DEG, _KNOT_DEG)
        order = np.argsort(own.incidence_deg)
        noise = (
            np.interp(at, own.incidence_deg[order], own.noise_db[order]) if np.isfinite(own.noise_db).all() else -np.inf
        )
        curves = Curves(law, np.stack([best, box.mean(axis=1)]))
        rad = np.radians(np.clip(middle + share * (at - middle), 0.0, 90.0))
        evaluate.append(lambda x, curves=curves, rad=rad, noise=noise: with_noise_db(curves(x, rad), noise))
        blocks.append(np.maximum(0.0, 1.0 - np.abs(own.incidence_deg[:, None] - at) / _KNOT_DEG))
        knots.append(at)
    weights = _diagonal(blocks)
    first = next(part for part in objective.passes if part is not None)
    prior = first.compared().prior
    prior_curves = Curves(laws[0], np.stack([best, box.mean(axis=1)]))

    def log_prior(x: Doubles) -> Doubles:
        if prior is None:
            return np.zeros(len(x))
        return np.asarray(-0.5 * (prior.of_curves(prior_curves(x, np.radians(prior.angles_deg)), x) ** 2).sum(axis=1))

    def levels(x: Doubles) -> Doubles:
        return np.concatenate([one(x) for one in evaluate], axis=1)

    return Parameters(box, objective.material.integer, levels, log_prior), weights, np.concatenate(knots)


def _diagonal(blocks: Sequence[Doubles]) -> Doubles:
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*[block for block in blocks if block.size]))


def _without_curve(
    case: stages.Posterior, observed: Observed, objective: Comparison, history: History, best: Doubles,
    targets: Targets, name: str,
) -> tuple[Parameters, Doubles, Doubles]:  # fmt: skip
    """Parameters of a law without a curve, by the surrogate's means of the incidence-angle bins."""
    surrogate = Surrogate(train_all(history, case, {name: objective})[name], objective, history.surprise(name))
    middles, blocks = [], []
    for own, part in zip(observed.cells, objective.passes, strict=True):
        if part is None or not own.size:
            blocks.append(np.zeros((0, 0)))
            continue
        classes = part.compared().classes
        middle = classes.nodes_deg.mean(axis=1)
        nearest = np.abs(own.incidence_deg[:, None] - middle).argmin(axis=1)
        blocks.append(np.eye(middle.size)[nearest])
        middles.append(middle)
    box = np.asarray(objective.material.box)

    def means(x: Doubles) -> Doubles:
        return np.asarray(surrogate.predict(surrogate.snapped(surrogate.unit(x)))[..., 0])

    start = means(best[None])

    def levels(x: Doubles) -> Doubles:
        return np.asarray(means(x) - start)

    def error(x: Doubles) -> Doubles:
        return np.asarray(surrogate.error(surrogate.snapped(surrogate.unit(x)))[:, 0])

    return (
        Parameters(box, objective.material.integer, levels, lambda x: np.zeros(len(x)), error),
        _diagonal(blocks),
        np.concatenate(middles),
    )


def _attenuation(targets: Targets, name: str) -> list[tuple[float, float]]:
    """Mean incidence [deg] in each pass, and factor on the distance from it at which the true incidence is expected.

    References
    ----------
    Carroll et al., "Measurement Error in Nonlinear Models", 2nd edition (2006), chapter 4: regression calibration.
    """
    found = []
    for one in targets.passes:
        if name not in one or (classes := one[name].classes) is None or classes.incidence_error_deg <= 0.0:
            found.append((0.0, 1.0))
            continue
        angle = one[name].incidence_deg.astype(np.float64)
        share = 1.0 - classes.incidence_error_deg**2 / max(float(np.var(angle)), 1e-12)
        found.append((float(angle.mean()), max(share, _LEAST_SHARE)))
    return found


def _flattening(observed: Observed, targets: Targets, name: str, log_sd: float) -> Doubles:
    """Change of each cell if the standard error of the incidence is one standard deviation larger, shape (n,) [dB]."""
    found = []
    for own, slope, (middle, share) in zip(observed.cells, observed.slope_db, _attenuation(targets, name), strict=True):
        found.append(-2.0 * (1.0 - share) * log_sd * slope * (own.incidence_deg - middle))
    return np.concatenate(found)


def _form_error(model: LawModel, draws: Draws, basis, knots: Doubles, seen: Sequence[tuple[float, float]]) -> FormError:
    """Error of the form over the incidence seen, and the smallest that would be noticed."""
    span = min(low for low, _ in seen), max(high for _, high in seen)
    columns = basis(np.linspace(*span, _ANGLES))
    forms = draws.form @ columns.T
    return form_error(forms - forms.mean(axis=1, keepdims=True), noticed_db(model, draws.middle, columns, knots, span))


def _summary(case, observed, law, draws, seen, basis, form, level_only, decibels, parameters) -> Posterior:
    x, sampler = draws.parameters, draws.sample
    low, middle, high = np.quantile(x, _QUANTILES, axis=0)
    some = np.unique(np.linspace(0, len(x) - 1, _KEPT).round().astype(np.intp))
    of_form = np.zeros((len(x), WHOLE_DEG.size)) if basis is None else draws.form @ basis(WHOLE_DEG).T
    every = KeptDraws(x, draws.field_db, draws.cell_db, of_form, draws.fields_db)
    curve = known = half = nearest = None
    if law.has_curve and decibels:
        curves = every.curves_db(law)
        fine = np.quantile(curves, _QUANTILES, axis=0)
        width = 0.5 * (fine[2] - fine[0])
        if not level_only:
            known = known_between(GRID_DEG, width, seen, case.uncertainty.known_db)
        if known is not None:
            half = float(width[(known[0] <= GRID_DEG) & (known[1] >= GRID_DEG)].max())
        of_field = np.quantile(every.field_curves_db(law), _QUANTILES, axis=0)
        every_deg = slice(None, 86 * 4, 4)
        curve = Curve(
            incidence_deg=GRID_DEG[every_deg],
            median_db=fine[1][every_deg],
            p05_db=fine[0][every_deg],
            p95_db=fine[2][every_deg],
            systematic_db=NORMAL_90 * _explained(curves[:, every_deg], draws.common),
            field_median_db=of_field[1][every_deg],
            field_p05_db=of_field[0][every_deg],
            field_p95_db=of_field[2][every_deg],
        )
        nearest = _nearest(law, parameters, x, curves, fine[1], seen)
    return Posterior(
        sampled=sampler.converged,
        ess=sampler.ess,
        r_hat=sampler.r_hat,
        steps=sampler.steps,
        cells=observed.size,
        fields=int(np.unique(observed.together("patch")).size),
        parameters_p05=low,
        parameters_p50=middle,
        parameters_p95=high,
        looks=float(
            np.average(
                [one.looks for one in observed.cells if one.size],
                weights=[one.size for one in observed.cells if one.size],
            )
        ),
        between_db=np.quantile(draws.field_db, _QUANTILES),
        within_db=np.quantile(draws.cell_db, _QUANTILES),
        seen_deg=np.array(seen),
        parameters_model=nearest,
        curve=curve,
        known_between_deg=known,
        known_half_width_db=half,
        form=form,
        draws=KeptDraws(**{key: value[some] for key, value in vars(every).items()}),
    )


def _explained(curves: Doubles, common: Doubles) -> Doubles:
    """Standard deviation of curves, (m, k), that their regression on the common effects, (m, q), explains, (k,)."""
    away = common - common.mean(axis=0)
    fitted = away @ np.linalg.lstsq(away, curves - curves.mean(axis=0), rcond=1e-10)[0]
    return np.asarray(fitted.std(axis=0))


def _nearest(law: Law, parameters: Parameters, x: Doubles, curves: Doubles, median: Doubles, seen) -> Doubles:
    """X in the bounds whose law is nearest to the median of sigma0 over the incidence seen (least squares)."""
    from scipy.optimize import least_squares

    inside = np.any([(low <= GRID_DEG) & (high >= GRID_DEG) for low, high in seen], axis=0)
    inside = inside if inside.any() else np.abs(GRID_DEG - np.mean(seen)).argmin() == np.arange(GRID_DEG.size)
    rad, wanted = np.radians(GRID_DEG[inside]), median[inside]
    low, high = parameters.box.T
    starts = x[np.argsort(((curves[:, inside] - wanted) ** 2).mean(axis=1))[:_TRIED]]

    def found(start: Doubles) -> Doubles:
        if parameters.integer.any():
            return start
        scale = np.maximum(high - low, 1e-12)
        fit = least_squares(
            lambda u: np.asarray(law(rad, low + u * scale)) - wanted,
            np.clip((start - low) / scale, 1e-6, 1 - 1e-6),
            bounds=(0.0, 1.0),
        )
        return np.asarray(low + fit.x * scale)

    each = [found(start) for start in starts]
    return min(each, key=lambda one: float(((np.asarray(law(rad, one)) - wanted) ** 2).mean()))
