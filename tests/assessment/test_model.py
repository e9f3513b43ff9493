"""Assembly of the model: cells of several passes, what is known of images, and summaries of draws."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import (
    LINE,
    LINE_BOX,
    LINE_X,
    NOTHING_SHOWN,
    image_of_fixed,
    known_common,
    line_db,
    made_cells,
    seen_cells,
)

from radcal.assessment import model
from radcal.assessment.model import image_of, posterior_of
from radcal.config import Uncertainty, Validation
from radcal.laws import law_for
from radcal.posterior import prediction
from radcal.posterior.cells import CellMeans
from radcal.posterior.prediction import constant_of
from radcal.posterior.result import Image
from radcal.radar.radiometry import with_noise_db
from radcal.targets.target import Targets

BRIEF = Uncertainty(walkers=32, steps=100)


def test_cells_of_several_passes():
    """The first pass lacks the material."""
    cells = made_cells([-7.0, -9.0], [30.0, 40.0], area_db=np.array([1.0, -0.5]))
    passes = [{}, {"dyke": cells}, {"dyke": cells.part(np.array([True, False])), "rest": cells}]
    found = model._observed("dyke", passes, [LINE] * 3, LINE_X)
    assert [one.size for one in found.cells] == [0, 2, 1]
    np.testing.assert_allclose(found.cells[1].measured_db, [-7.0, -9.0])
    np.testing.assert_allclose(found.cells[2].measured_db, [-7.0])
    np.testing.assert_allclose(found.law_db[1], [-8.5, -11.0])
    np.testing.assert_allclose(np.concatenate(found.slope_db), -0.25)
    program = model._observed("dyke", passes, [law_for("external", names=["mv"])] * 3, [3.0])
    np.testing.assert_array_equal(np.concatenate(program.law_db + program.slope_db), np.zeros(6))


def case_of(normalisation="none", declared=("sigma0_local",), **changes):
    laws = {"water": LINE, "wood": LINE, "program": law_for("external", names=["mv"]), "dyke": LINE}
    return SimpleNamespace(
        reference_materials=["water", "wood"],
        materials={name: SimpleNamespace(start_parameters=LINE_X.tolist()) for name in laws},
        passes=[SimpleNamespace(laws=laws, radar=SimpleNamespace(radiometry=one)) for one in declared],
        target=SimpleNamespace(normalisation=normalisation),
        uncertainty=BRIEF,
        seed=4,
        **changes,
    )


def images(area, level_db=0.0, passes=1, mean_db=0.0, relief_db=1.5):
    """Cells in some passes; the area of the ground has a mean, whose effect is in the image."""
    rng = np.random.default_rng(3)
    names = ("water", "wood", "dyke")
    found = []
    for k in range(passes):
        keys = {"area": area[k], "added_db": level_db + area[k] * mean_db, "relief_db": relief_db}
        of_pass = {name: seen_cells(rng, 100, **keys) for name in names}
        found.append({name: replace(one, area_db=one.area_db + mean_db) for name, one in of_pass.items()})
    return found


def test_images_of_two_passes_with_another_radiometry_in_one():
    """Its area is expected in the shared effects, and its mean is no level of the image."""
    image = image_of(case_of(declared=("sigma0_ref", "sigma0_ref")), images((-1.0, 0.0), 1.2, 2, mean_db=0.8))
    assert [image.radiometry[k].found for k in ("1", "2")] == [-1, 0]
    assert list(image.laws_db) == list(image.apart_db) == ["water", "wood"]
    assert image.levels_db.shape == (2, 3)
    for apart in image.apart_db.values():
        assert apart[1] == pytest.approx(1.2, abs=0.6)
    (shared,) = image.shared.items()
    assert (shared[0], shared[1].chance) == ("-1 0", 1.0)
    np.testing.assert_allclose(shared[1].mean[[1, 5]], [-1.0, 0.0], atol=0.1)
    assert shared[1].mean[0] == pytest.approx(image.levels_db[0, 1] - 0.8, abs=0.2)
    assert shared[1].mean.shape == (9,)


def test_a_radiometry_in_doubt_leaves_both():
    """Without relief, levels and errors of the laws are mixed from both with their probabilities."""
    image = image_of(case_of(declared=("sigma0_ref",)), images((0.0,), relief_db=0.002))
    assert list(image.shared) == ["0", "-1"]
    assert image.shared["-1"].chance == pytest.approx(0.1, abs=0.03)
    assert sum(one.chance for one in image.shared.values()) == pytest.approx(1.0)
    assert [one.mean[1] for one in image.shared.values()] == pytest.approx([0.0, -1.0], abs=0.1)


def test_normalised_images_and_absent_fixed_materials_tell_nothing():
    rescaled = image_of(case_of("image"), images((0.0,)))
    assert rescaled.laws_db == {}
    assert not rescaled.radiometry["1"].checked
    assert rescaled.shared["0"].covariance[0, 0] == pytest.approx(20.0**2)
    alone = {"dyke": images((0.0,))[0]["dyke"]}
    image = image_of(case_of(), [alone])
    assert image.laws_db == {}
    assert image.shared["0"].covariance[0, 0] == pytest.approx(2.0 * BRIEF.level_db**2)


def test_levels_at_the_knots_are_weighed_in_the_cells():
    """Straight lines between whole degrees, noise in power, and the incidence that is expected for the mapped one."""
    cells = made_cells(np.zeros(3), [30.25, 34.5, 38.0], noise_db=np.array([-14.0, -16.0, -18.0]))
    of = SimpleNamespace(cells=[cells], size=3)
    compared = SimpleNamespace(prior=None)
    objective = SimpleNamespace(
        material=SimpleNamespace(box=[[-30.0, 10.0], [-40.0, 0.0]], integer=np.zeros(2, bool)),
        passes=[None, compared],
    )
    parameters, weights, knots = model._with_curve(of, objective, [LINE], [(35.0, 0.8)])
    assert (knots[0], knots[-1]) == (30.0, 38.0)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights @ knots, cells.incidence_deg)
    x = np.array([[-6.0, -16.0], [-3.0, -25.0]])
    noise = np.interp(knots, cells.incidence_deg, cells.noise_db)
    there = 35.0 + 0.8 * (knots - 35.0)
    np.testing.assert_allclose(parameters.levels(x), with_noise_db(line_db(x, there), noise))
    np.testing.assert_array_equal(parameters.log_prior(x), [0.0, 0.0])
    # a prior on the curve counts by its residuals
    compared.prior = SimpleNamespace(
        angles_deg=np.array([20.0, 60.0]), of_curves=lambda curves, x: (curves - [-6.0, -16.0]) / [1.5, 3.0]
    )
    parameters, _, _ = model._with_curve(of, objective, [LINE], [(0.0, 1.0)])
    np.testing.assert_allclose(parameters.log_prior(x), [0.0, -0.5 * ((3.0 / 1.5) ** 2 + (9.0 / 3.0) ** 2)], atol=1e-9)


def test_a_wrong_incidence_bends_the_law_by_its_share_of_the_variance():
    angle = np.array([28.0, 33.0, 45.0, 38.0])
    target = SimpleNamespace(incidence_deg=angle.astype(np.float32), classes=SimpleNamespace(incidence_error_deg=3.0))
    exact = replace_classes(target, 0.0)
    wide = replace_classes(target, 30.0)
    targets = [Targets(one) for one in ({"dyke": target}, {}, {"dyke": exact}, {"dyke": wide})]
    found = model._attenuation(targets, "dyke")
    share = 1.0 - 9.0 / angle.var()
    assert found == [pytest.approx((36.0, share)), (0.0, 1.0), (0.0, 1.0), pytest.approx((36.0, 0.2))]
    of = SimpleNamespace(cells=[made_cells([-7.0, -9.0], [30.0, 40.0])], slope_db=[np.array([-0.2, -0.3])])
    # a law at middle + share (angle - middle): d / d ln(sd) of the share is -2 (1 - share)
    wanted = -2.0 * (1.0 - share) * 0.4 * np.array([-0.2 * -6.0, -0.3 * 4.0])
    np.testing.assert_allclose(model._flattening(of, found[:1], 0.4), wanted)


def replace_classes(target, error_deg):
    return SimpleNamespace(**{**vars(target), "classes": SimpleNamespace(incidence_error_deg=error_deg)})


def test_the_mean_area_counts_pixels_and_is_zero_in_a_pass_without_cells():
    cells = made_cells([-7.0, -9.0], [30.0, 40.0], area_db=np.array([1.0, -0.5]), pixels=np.array([30, 10]))
    other = made_cells([-7.0], [30.0], area_db=np.array([2.0]), pixels=np.array([60]))
    assert model._mean_areas([{"a": cells, "b": other}, {"b": other}, {}]) == pytest.approx([1.45, 2.0, 0.0])
    image = image_of(case_of(declared=("sigma0_ref", "sigma0_local")), [*images((0.0,)), {}])
    assert image.levels_db.shape == (2, 3)
    assert np.isfinite(image.shared["0 0"].mean).all()
    assert image.radiometry["2"].materials == ()


def known_case(passes=1):
    """Case, targets and history of a material with the law :data:`LINE`, seen at 28 to 46 degrees in all passes."""
    best = LINE_X + [0.7, -1.5]
    objective = SimpleNamespace(
        material=SimpleNamespace(name="dyke", box=LINE_BOX, integer=np.zeros(2, bool)),
        passes=[SimpleNamespace(prior=None)] * passes,
    )
    score = SimpleNamespace(parameters=best)
    angles = np.linspace(28.0, 46.0, 60).astype(np.float32)
    one = SimpleNamespace(incidence_deg=angles, classes=None, level_only=False)
    targets = [Targets({"dyke": one})] * passes
    case = case_of(declared=("sigma0_ref",) * passes, validation=None)
    history = SimpleNamespace(best=lambda name: score)
    return SimpleNamespace(case=case, targets=targets, objective=objective, history=history, best=best)


def posterior(known, cells):
    """Posterior of the dyke without fixed materials."""
    radiometry = {str(k): NOTHING_SHOWN for k in range(1, len(cells) + 1)}
    image = replace(image_of_fixed({}, [0.0] * len(cells), known.case.uncertainty), radiometry=radiometry)
    return posterior_of(known.case, known.targets, known.history, known.objective, cells, image)


def test_a_material_without_cells_has_its_bounds_and_a_finding(monkeypatch):
    """The calibrated material has a target in both passes, and no cell in either."""
    known = known_case(passes=2)
    found = posterior(known, [{}, {}])
    assert (found.cells, found.curve, found.draws, found.known_between_deg) == (0, None, None, None)
    np.testing.assert_allclose(found.parameters_p05, [-28.0, -38.0])
    np.testing.assert_allclose(found.parameters_p95, [8.0, -2.0])
    np.testing.assert_allclose(found.seen_deg, [[28.9, 45.1]] * 2, atol=0.05)


def test_cells_of_a_pass_without_a_target_are_left_out(monkeypatch):
    known = known_case(passes=2)
    known.targets[1] = Targets({})
    cells = seen_cells(np.random.default_rng(5), 40)
    assert posterior(known, [{}, {"dyke": cells}]).cells == 0
    assert posterior(known, [{}, {"dyke": cells}]).seen_deg.shape == (1, 2)


def test_a_law_without_a_curve_takes_the_bins_of_its_passes(monkeypatch):
    """The first pass has bins and no cells, the second cells and no target: means and weights stay in line."""
    bins = [np.array([[29.0, 31.0], [39.0, 41.0]]), None, np.array([[33.0, 35.0], [43.0, 45.0], [47.0, 49.0]])]
    passes = [
        None if one is None else SimpleNamespace(classes=one)
        for one in (None if nodes is None else SimpleNamespace(nodes_deg=nodes) for nodes in bins)
    ]
    objective = SimpleNamespace(
        material=SimpleNamespace(box=[[0.0, 2.0]], integer=np.zeros(1, bool)), passes=passes
    )  # fmt: skip
    surrogate = SimpleNamespace(
        unit=lambda x: x / 2.0,
        snapped=lambda unit: unit,
        predict=lambda unit: (2.0 * unit[..., None, :] * np.arange(1.0, 6.0)[:, None]) * [1.0, 9.0, 9.0],
        error=lambda unit: np.tile([0.3, 9.0], (len(unit), 1)),
    )
    monkeypatch.setattr(model, "train_all", lambda *_: {"dyke": None})
    monkeypatch.setattr(model, "Surrogate", lambda *_: surrogate)
    cells = made_cells(np.zeros(3), [34.2, 48.5, 43.0])
    of = SimpleNamespace(cells=[CellMeans.none(), CellMeans.none(), cells], size=3)
    history = SimpleNamespace(surprise=lambda name: 0.0)
    parameters, weights, knots = model._without_curve(None, of, objective, history, np.array([0.5]), "dyke")
    np.testing.assert_allclose(knots, [30.0, 40.0, 34.0, 44.0, 48.0])
    np.testing.assert_allclose(weights @ knots, [34.0, 48.0, 44.0])
    # the mean of bin k is k X
    np.testing.assert_allclose(parameters.levels(np.array([[0.5], [1.5]])) @ weights.T, [[0.0] * 3, [3.0, 5.0, 4.0]])
    np.testing.assert_allclose(parameters.error(np.array([[0.5], [1.5]])), [0.3, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize("normalisation", ["none", "image"])
def test_the_posterior_of_known_ground_holds_its_truth(normalisation, monkeypatch):
    """Cells of a known law with noise, simulated at another X; a level of 1.2 dB is told by two fixed materials."""
    rng = np.random.default_rng(11)
    cells = seen_cells(rng, 240, added_db=1.2, field_db=0.4, cell_db=0.2)
    noise = np.full(240, -24.0)
    known = known_case()
    # the simulated image has other ground, too
    beside = rng.normal(0.3, 0.2, 240)
    measured = with_noise_db(cells.measured_db, noise) + beside
    simulated = with_noise_db(np.asarray(LINE(np.radians(cells.incidence_deg), known.best)), noise) + beside
    share = 10.0 ** ((noise - simulated) / 10.0)
    fold = (np.arange(240) % 3 == 0).astype(np.int64)
    seen = replace(cells, measured_db=measured, beside_db=beside, noise_db=noise, share=share, fold=fold)
    common = replace(known_common(level_db=1.2, sd_db=0.1), mean=np.array([1.2, 0.0, 0.0, 0.0, 0.0]))
    known.case.uncertainty = Uncertainty(walkers=48, steps=800, known_db=1.5)
    known.case.target.normalisation = normalisation
    image = Image({"0": common}, {}, {}, np.zeros((1, 3)), True, {"1": NOTHING_SHOWN})
    found = posterior_of(known.case, known.targets, known.history, known.objective, [{"dyke": seen}], image)
    assert (found.cells, found.fields) == (240, 10)
    assert np.all((found.parameters_p05 < LINE_X) & (found.parameters_p95 > LINE_X))
    if normalisation == "image":
        assert (found.curve, found.form, found.constant) == (None, None, None)
        return
    angle = found.curve.incidence_deg
    at = (angle >= 28.0) & (angle <= 46.0)
    truth = np.asarray(LINE(np.radians(angle[at]), LINE_X)) + 0.115 * (0.4**2 + 0.2**2)
    assert np.mean((found.curve.p05_db[at] < truth) & (found.curve.p95_db[at] > truth)) == 1.0
    assert np.abs(found.curve.median_db[at] - truth).max() < 0.5
    # over 16 seeds, the mean half-width is 0.276 with a standard deviation of 0.004, the least one 0.257 with 0.005
    assert found.curve.half_width_db[at].mean() == pytest.approx(0.276, rel=0.05)
    assert 0.24 < found.curve.half_width_db[at].min() < found.curve.half_width_db[at].max() < 1.0
    assert found.known_between_deg == pytest.approx((29.0, 45.0), abs=0.3)
    assert found.parameters_model == pytest.approx(LINE_X, abs=1.5)
    assert not found.form.refuted
    away = cells.measured_db - np.asarray(LINE(np.radians(cells.incidence_deg), LINE_X))
    drawn = np.std([away[cells.patch == k].mean() for k in np.unique(cells.patch)], ddof=1)
    assert found.between_db[0] < drawn < found.between_db[2] < 2.2 * drawn
    assert found.within_db[0] < 0.2 < found.within_db[2]
    # without level and noise; its cells scatter by the slope of the law
    constant = constant_of(cells.measured_db - 1.2, cells.variance, cells.patch)
    assert found.constant.mean_db == pytest.approx(constant.mean_db, abs=0.1)
    assert found.constant.within_db == pytest.approx(constant.within_db, rel=0.05)
    assert found.constant.within_db > 1.2
    # with blocks held out, the other cells alone are used, and predict those of the blocks
    monkeypatch.setattr(prediction, "_REFIT", {"walkers": 32, "steps": 200})
    monkeypatch.setattr(prediction, "_FOLDS", 2)
    known.case.uncertainty = known.case.uncertainty.model_copy(update={"steps": 200})
    known.case.validation = Validation(rows=20, means=10, keep="even")
    part = posterior_of(known.case, known.targets, known.history, known.objective, [{"dyke": seen}], image)
    assert part.constant.variance > found.constant.variance
    assert part.held.patch.size == 80
    assert part.left_out.patch.size == 160
    np.testing.assert_allclose(np.sort(part.held.incidence_deg), np.sort(cells.incidence_deg[fold == 1]))
    assert part.held.rmse_db(part.held.law) < 0.6 < 1.2 < part.held.rmse_db(part.held.constant)
