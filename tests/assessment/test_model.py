"""Assembly of the model: cells of several passes, what is known of images, and summaries of draws."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, line_db, made_cells, seen_cells

from radcal.assessment import model
from radcal.assessment.cells import with_noise_db
from radcal.assessment.model import image_of
from radcal.config import Uncertainty
from radcal.radar.laws import external_law

BRIEF = Uncertainty(walkers=32, steps=100)


def test_cells_of_several_passes():
    """The first pass lacks the material; the second has an area term too much."""
    cells = made_cells([-7.0, -9.0], [30.0, 40.0], area_db=np.array([1.0, -0.5]))
    passes = [{}, {"dyke": cells}, {"dyke": cells.part(np.array([True, False])), "rest": cells}]
    found = model._observed("dyke", passes, [LINE] * 3, LINE_X).moved([1, -1, 0])
    assert [one.size for one in found.cells] == [0, 2, 1]
    np.testing.assert_allclose(found.cells[1].measured_db, [-6.0, -9.5])
    np.testing.assert_allclose(found.cells[2].measured_db, [-7.0])
    np.testing.assert_allclose(found.law_db[1], [-8.5, -11.0])
    np.testing.assert_allclose(np.concatenate(found.slope_db), -0.25)
    program = model._observed("dyke", passes, [external_law(["mv"])] * 3, [3.0])
    np.testing.assert_array_equal(np.concatenate(program.law_db + program.slope_db), np.zeros(6))


def test_the_mean_area_counts_pixels():
    cells = made_cells([-7.0, -9.0], [30.0, 40.0], area_db=np.array([1.0, -0.5]), pixels=np.array([30, 10]))
    other = made_cells([-7.0], [30.0], area_db=np.array([2.0]), pixels=np.array([60]))
    assert model._mean_areas([{"a": cells, "b": other}, {"b": other}]) == pytest.approx([1.45, 2.0])


def case_of(normalisation="none", declared=("sigma0_local",), **changes):
    laws = {"water": LINE, "wood": LINE, "program": external_law(["mv"])}
    return SimpleNamespace(
        reference_materials=["water", "wood"],
        materials={name: SimpleNamespace(start_parameters=LINE_X.tolist()) for name in laws},
        passes=[SimpleNamespace(laws=laws, radar=SimpleNamespace(radiometry=one)) for one in declared],
        target=SimpleNamespace(normalisation=normalisation),
        uncertainty=BRIEF,
        seed=4,
        **changes,
    )


def images(area, level_db=0.0, passes=1):
    rng = np.random.default_rng(3)
    names = ("water", "wood", "dyke")
    return [{name: seen_cells(rng, 100, area=area[k], added_db=level_db) for name in names} for k in range(passes)]


def test_images_of_two_passes_with_another_radiometry_in_one():
    """Its area is taken out before the shared effects are told."""
    image = image_of(case_of(declared=("sigma0_ref", "sigma0_ref")), images((0.0, -1.0), 1.2, 2))
    assert [image.radiometry[k].found for k in ("1", "2")] == [0, -1]
    assert list(image.laws_db) == list(image.apart_db) == ["water", "wood"]
    assert image.levels_db.shape == (2, 3)
    for apart in image.apart_db.values():
        assert apart[1] == pytest.approx(1.2, abs=0.6)
    np.testing.assert_allclose(image.mean[[1, 5]], 0.0, atol=0.1)
    assert image.mean.shape == (9,)


def test_normalised_images_and_absent_fixed_materials_tell_nothing():
    rescaled = image_of(case_of("image"), images((0.0,)))
    assert rescaled.laws_db == {}
    assert not rescaled.radiometry["1"].checked
    assert rescaled.covariance[0, 0] == pytest.approx(20.0**2)
    alone = {"dyke": images((0.0,))[0]["dyke"]}
    image = image_of(case_of(), [alone])
    assert image.laws_db == {}
    assert image.covariance[0, 0] == pytest.approx(2.0 * BRIEF.level_db**2)


def test_levels_at_the_knots_are_weighed_in_the_cells():
    """Straight lines between whole degrees, noise in power, and the incidence that is expected for the mapped one."""
    cells = made_cells(np.zeros(3), [30.25, 34.5, 38.0], noise_db=np.array([-14.0, -16.0, -18.0]))
    of = SimpleNamespace(cells=[cells], size=3)
    compared = SimpleNamespace(prior=None)
    objective = SimpleNamespace(
        material=SimpleNamespace(box=[[-30.0, 10.0], [-40.0, 0.0]], integer=np.zeros(2, bool)),
        passes=[None, SimpleNamespace(compared=lambda: compared)],
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
    targets = SimpleNamespace(passes=[{"dyke": target}, {}, {"dyke": exact}, {"dyke": wide}])
    found = model._attenuation(targets, "dyke")
    share = 1.0 - 9.0 / angle.var()
    assert found == [pytest.approx((36.0, share)), (0.0, 1.0), (0.0, 1.0), pytest.approx((36.0, 0.2))]
    of = SimpleNamespace(cells=[made_cells([-7.0, -9.0], [30.0, 40.0])], slope_db=[np.array([-0.2, -0.3])])
    # a law at middle + share (angle - middle): d / d ln(sd) of the share is -2 (1 - share)
    wanted = -2.0 * (1.0 - share) * 0.4 * np.array([-0.2 * -6.0, -0.3 * 4.0])
    np.testing.assert_allclose(model._flattening(of, found[:1], 0.4), wanted)


def replace_classes(target, error_deg):
    return SimpleNamespace(**{**vars(target), "classes": SimpleNamespace(incidence_error_deg=error_deg)})
