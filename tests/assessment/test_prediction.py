"""Predictions of cells of other fields and of cells left out, against closed forms and made ground."""

from __future__ import annotations

import numpy as np
import pytest

from radcal.assessment import prediction
from radcal.assessment.calibrated import FORMS, LawModel, Parameters
from radcal.assessment.cells import CellMeans
from radcal.assessment.curves import NORMAL_90
from radcal.assessment.fixed_laws import Observed, common_of, form_basis
from radcal.assessment.posterior import WHOLE_DEG, FieldCheck, HeldOut, KeptDraws
from radcal.assessment.prediction import constant_of, field_check, left_out, predict
from radcal.config import Uncertainty
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
X = np.array([-30.0, 12.0, 6.0, 4.0])
KNOTS = np.arange(20.0, 46.0)
FIELD_DB, CELL_DB, SPECKLE = 0.6, 0.3, 0.04


def made(fields: int, seed: int, slope: float = 1.0) -> LawModel:
    """Model of fields of six cells, whose levels follow the law or, for a slope of 0, do not change."""
    rng = np.random.default_rng(seed)
    patch = np.repeat(3 * np.arange(fields) + 1, 6)
    angle = rng.uniform(21.0, 41.0, fields).repeat(6) + 0.6 * np.tile(np.arange(6), fields)
    values = slope * (LAW(np.radians(angle), X) + 15.0) - 15.0 + rng.normal(0.0, FIELD_DB, fields).repeat(6)
    values += rng.normal(0.0, np.sqrt(CELL_DB**2 + SPECKLE), angle.size)
    zero, n = np.zeros(angle.size), angle.size
    cells = CellMeans(
        patch, angle, values, zero, zero, zero - np.inf, zero, np.full(n, SPECKLE), np.full(n, 100), patch * 0, 4.0
    )
    box = np.array([[-60.0, 10.0], [0.0, 40.0], [0.0, 40.0], [0.0, 20.0]])
    parameters = Parameters(
        box,
        np.zeros(4, dtype=np.bool_),
        lambda x: LAW(np.radians(KNOTS)[:, None], x.T).T,
        lambda x: np.zeros(len(x)),
    )
    weights = np.maximum(0.0, 1.0 - np.abs(angle[:, None] - KNOTS))
    config = Uncertainty(walkers=64, steps=1000)
    common = common_of({}, [0.0], config, False, 1)
    forms = form_basis(angle, np.arange(20.0, 48.0, 2.0), FORMS)
    return LawModel(Observed([cells], [values], [zero]), weights, parameters, forms, zero, common, [0.0], config)


def test_the_quantiles_of_the_band_are_averages_of_those_of_law_and_constant():
    m = 20000
    x = np.tile([-10.0, 0.0, 0.0, 0.0], (m, 1))
    draws = KeptDraws(x, np.full(m, 0.6), np.full(m, 0.3), np.zeros((m, 91)), np.zeros(m))
    rng, patch, variance = np.random.default_rng(2), np.repeat(np.arange(30), 4), np.array([0.04, 1.0])
    constant = constant_of(-20.0 + rng.normal(0.0, 0.8, 30).repeat(4), np.full(120, 0.04), patch)
    found = predict(draws, LAW, constant, np.array([25.0, 40.0]), variance, 1)
    level, error = constant.of_cells(np.array([-1, -1]), variance)
    assert found.mean_db == pytest.approx(0.5 * (-10.0 + constant.mean_db), abs=1e-9)
    half = 0.5 * NORMAL_90 * (np.sqrt(0.6**2 + 0.3**2 + variance) + error)
    assert found.p05_db == pytest.approx(0.5 * (-10.0 + level) - half, abs=0.04)
    assert found.p95_db == pytest.approx(0.5 * (-10.0 + level) + half, abs=0.04)


def test_the_form_error_of_the_draws_is_predicted():
    m = 50
    form = np.tile(0.1 * (WHOLE_DEG - 30.0), (m, 1))
    draws = KeptDraws(np.tile(X, (m, 1)), np.full(m, 0.6), np.full(m, 0.3), form, np.zeros(m))
    constant = constant_of(np.full(6, -20.0), np.full(6, 0.04), np.arange(6))
    angle = np.array([24.0, 36.0])
    found = predict(draws, LAW, constant, angle, np.full(2, 0.04), 1)
    expected = LAW(np.radians(angle), X) + 0.1 * (angle - 30.0)
    assert found.mean_db == pytest.approx(0.5 * (expected + constant.mean_db), abs=2e-3)


def test_a_constant_predicts_known_fields_with_their_effects():
    values = np.repeat([-20.0, -23.0, -21.0], 40)
    constant = constant_of(values, np.full(120, 0.04), np.repeat([2, 5, 9], 40))
    level, sd = constant.of_cells(np.array([2, 5, 7]), np.full(3, 0.04))
    assert level == pytest.approx([-20.0, -23.0, constant.mean_db], abs=0.1)
    assert sd[2] > 2.0 * sd[0]


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
    found = field_check(made(1, 1), 1)
    assert found.n_fields == found.n_cells == 0
    assert np.isnan([found.rmse_db, found.rmse_constant_db, found.coverage_90]).all()


def test_cells_of_a_negative_fold_are_never_left_out():
    model = made(4, 1)
    found = left_out(model, np.full(model.patch.size, -1), 1)
    assert isinstance(found, HeldOut)
    assert found.patch.size == 0
    assert np.isnan(found.rmse_db())
    assert np.isnan(found.coverage_90)


@pytest.mark.slow
def test_cells_of_known_fields_are_predicted_with_the_effects_of_these():
    model = made(5, 4)
    fold = np.where(np.arange(model.patch.size) % 6 == 2, 0, -1)
    found = left_out(model, fold, 1)
    assert (found.patch == model.patch[fold == 0]).all()
    assert found.rmse_db("law_db") < 0.6
    whole = left_out(model, np.where(model.patch == 4, 0, -1), 1)
    assert (whole.p95_db - whole.p05_db).mean() > 1.3 * (found.p95_db - found.p05_db).mean()


@pytest.mark.slow
@pytest.mark.parametrize("slope", [1.0, 0.0])
def test_fields_left_out_are_predicted_by_the_law_or_the_constant_and_lie_in_the_band(slope, monkeypatch):
    """Errors are those of fields, cells and speckle, 0.7 dB, where the law holds; else the average loses little."""
    monkeypatch.setattr(prediction, "_FOLDS", 4)
    found = field_check(made(16, 2, slope), 2)
    assert isinstance(found, FieldCheck)
    assert (found.n_fields, found.n_cells) == (16, 96)
    if slope:
        assert found.rmse_law_db < 1.0 < 1.3 < found.rmse_constant_db
        assert found.rmse_db < 0.75 * found.rmse_constant_db
    else:
        assert found.rmse_db < 1.1 * found.rmse_constant_db
    assert 0.82 <= found.coverage_90 <= 1.0


def test_fields_of_a_part_are_predicted_at_their_own_angles(monkeypatch) -> None:
    monkeypatch.setattr(prediction, "_REFIT", {"walkers": 32, "steps": 50})
    model = made(4, 3)
    kept = model.patch != model.patch.max()
    found = left_out(model.part(kept, model.config), model.patch[kept], 1)
    assert np.isin(found.incidence_deg, model.incidence_deg[kept]).all()
    assert found.patch.size == np.count_nonzero(kept)
