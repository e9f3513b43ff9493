"""Predictions of cells of other fields and of cells left out, against closed forms and made ground."""

from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import held_cells, image_of_fixed, line_db, line_model, made_cells

from radcal.config import Uncertainty
from radcal.posterior import prediction
from radcal.posterior.curves import NORMAL_90
from radcal.posterior.prediction import constant_of, field_check, left_out

FIELD_DB, CELL_DB, SPECKLE = 0.6, 0.3, 0.04


def made(fields, seed, ends_db=(0.0, -24.0)):
    """Model of fields of six cells, whose levels lie on a line between 20 and 60 degrees."""
    rng = np.random.default_rng(seed)
    patch = np.repeat(3 * np.arange(fields) + 1, 6)
    angle = rng.uniform(26.0, 45.0, fields).repeat(6) + 0.6 * np.tile(np.arange(6), fields)
    values = line_db(np.array([ends_db]), angle)[0] + rng.normal(0.0, FIELD_DB, fields).repeat(6)
    values += rng.normal(0.0, np.sqrt(CELL_DB**2 + SPECKLE), angle.size)
    cells = made_cells(values, angle, patch=patch, variance=np.full(angle.size, SPECKLE))
    config = Uncertainty(walkers=64, steps=1000)
    return line_model(cells, image_of_fixed({}, [0.0], config).shared["0"], config)


def test_held_out_cells_know_their_errors_by_each_prediction():
    held = held_cells()
    law, constant = held.law, held.constant
    assert held.predicted.mean_db == pytest.approx([-11.0, -11.5, -12.0])
    assert held.predicted.p05_db == pytest.approx([-12.05, -12.8, -13.3])
    assert held.predicted.p95_db == pytest.approx([-8.75, -9.0, -9.5])
    assert held.rmse_db(law) == pytest.approx(np.sqrt((0.6**2 + 0.5**2 + 3.5**2) / 3.0))
    assert held.rmse_db(constant) == pytest.approx(np.sqrt((3.4**2 + 2.5**2 + 1.5**2) / 3.0))
    assert [held.coverage_90(by) for by in (law, constant, held.predicted)] == pytest.approx([1 / 3, 1.0, 2 / 3])


def test_a_constant_is_the_mean_of_fields_with_their_spread():
    rng = np.random.default_rng(3)
    patch = np.repeat(np.arange(400), 4)
    values = -21.0 + rng.normal(0.0, 0.8, 400).repeat(4) + rng.normal(0.0, 0.5, 1600) + rng.normal(0.0, 0.2, 1600)
    constant = constant_of(values, np.full(1600, 0.04), patch)
    assert constant.mean_db == pytest.approx(-21.0, abs=0.15)
    assert constant.between_db == pytest.approx(0.8, rel=0.1)
    assert constant.within_db == pytest.approx(0.5, rel=0.05)
    assert constant.variance == pytest.approx((0.8**2 + (0.5**2 + 0.04) / 4.0) / 400.0, rel=0.15)


def test_a_constant_predicts_known_fields_with_their_effects():
    """In the closed form of one random effect; another field has the whole variation between fields."""
    values, patch = np.repeat([-20.0, -23.0, -21.0], 40), np.repeat([2, 5, 9], 40)
    variance = np.linspace(0.02, 0.06, 120)
    rest = SimpleNamespace(measured_db=values, variance=variance, patch=patch)
    found = prediction._of_constant(rest, np.array([2, 5, 7]), np.array([0.04, 0.09, 0.01]))
    constant = constant_of(values, variance, patch)
    assert found.mean_db == pytest.approx([-20.0, -23.0, constant.mean_db], abs=0.1)
    half = 0.5 * (found.p95_db - found.p05_db) / NORMAL_90
    weight = (1.0 / (variance[:40] + constant.within_db**2)).sum()
    left = 1.0 / (1.0 + constant.between_db**2 * weight)
    own = [left * constant.between_db**2 + left**2 * constant.variance, constant.between_db**2 + constant.variance]
    assert half[[0, 2]] ** 2 == pytest.approx(np.array(own) + constant.within_db**2 + [0.04, 0.01], rel=1e-6)


def test_a_part_of_a_model_is_the_model_of_its_cells():
    model = made(6, 3)
    mask = model.patch < 12
    part = model.part(mask, model.config)
    assert part.measured_db == pytest.approx(model.measured_db[mask])
    at = part.start(8, np.random.default_rng(1))
    direct = made(6, 3)
    direct.values, direct.linear, direct.weights = model.values[mask], model.linear[mask], model.weights[mask]
    direct.patch, direct.variance = model.patch[mask], model.variance[mask]
    direct._tabulate()
    assert part.log_likelihood(at) == pytest.approx(direct.log_likelihood(at))
    assert model.table is not part.table


def test_a_single_field_is_not_left_out():
    assert field_check(made(1, 1), 1) is None


def test_cells_of_a_negative_fold_are_never_left_out():
    model = made(4, 1)
    assert left_out(model, np.full(model.patch.size, -1), 1) is None


@pytest.mark.slow
def test_cells_of_known_fields_are_predicted_with_the_effects_of_these():
    model = made(5, 4)
    fold = np.where(np.arange(model.patch.size) % 6 == 2, 0, -1)
    found = left_out(model, fold, 1)
    assert (found.patch == model.patch[fold == 0]).all()
    assert found.rmse_db(found.law) < 0.6
    whole = left_out(model, np.where(model.patch == 4, 0, -1), 1)
    for wide, narrow in ((whole.law, found.law), (whole.constant, found.constant)):
        assert (wide.p95_db - wide.p05_db).mean() > 1.3 * (narrow.p95_db - narrow.p05_db).mean()


@pytest.mark.slow
@pytest.mark.parametrize("ends_db", [(0.0, -24.0), (-12.0, -12.0)])
def test_fields_left_out_are_predicted_by_the_law_or_the_constant_and_lie_in_the_band(ends_db, monkeypatch):
    """Errors are those of fields, cells and speckle, 0.7 dB, where the law holds; else the average loses little."""
    monkeypatch.setattr(prediction, "_FOLDS", 4)
    found = field_check(made(16, 2, ends_db), 2)
    assert (np.unique(found.patch).size, found.patch.size) == (16, 96)
    by_law, by_constant, both = (found.rmse_db(by) for by in (found.law, found.constant, found.predicted))
    if ends_db[0] > ends_db[1]:
        assert by_law < 1.0 < 1.3 < by_constant
        assert both < 0.75 * by_constant
    else:
        assert both < 1.1 * by_constant
    assert 0.82 <= found.coverage_90(found.predicted) <= 1.0


def test_fields_of_a_part_are_predicted_at_their_own_angles(monkeypatch):
    monkeypatch.setattr(prediction, "_REFIT", {"walkers": 32, "steps": 50})
    model = made(4, 3)
    kept = model.patch != model.patch.max()
    found = left_out(model.part(kept, model.config), model.patch[kept], 1)
    assert np.isin(found.incidence_deg, model.incidence_deg[kept]).all()
    assert found.patch.size == np.count_nonzero(kept)
