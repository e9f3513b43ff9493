"""Posterior of a calibrated law, against dense normal distributions and hidden laws."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import (
    ANGLES,
    FORM_KNOTS,
    KNOTS,
    LINE,
    LINE_BOX,
    LINE_X,
    known_common,
    line_db,
    line_model,
    line_parameters,
    observed,
    seen_cells,
)
from scipy.stats import multivariate_normal, norm

from radcal.config import Uncertainty
from radcal.posterior.calibrated import FORMS, Draws
from radcal.posterior.effects import common_columns, form_basis
from radcal.posterior.sampling import Sample

CONFIG = Uncertainty(walkers=64, steps=1500)
BRIEF = Uncertainty(walkers=32, steps=100)
GRID = np.log(np.geomspace(0.01, 3.0, 32)), np.log(np.geomspace(0.01, 8.0, 32))


@pytest.mark.parametrize("error", [None, 0.4])
def test_the_likelihood_is_that_of_a_dense_normal_distribution(error):
    """With shared effects, error of the form, incidence and surrogate, at scales on the grid of the tables."""
    rng = np.random.default_rng(4)
    cells, common = seen_cells(rng, 60, fields=5), known_common(0.3, rng=rng)
    cells = replace(cells, share=rng.uniform(0.0, 0.3, 60), beside_db=rng.normal(0.0, 0.2, 60))
    of_error = None if error is None else (lambda x: error * (1.0 + 0.01 * x[:, 0]))
    model = line_model(cells, common, parameters=line_parameters(of_error), flattening=0.03)
    rng_at = np.random.default_rng(1)
    at = np.column_stack([
        rng_at.normal(0.0, 0.8, (4, 2)), GRID[1][[18, 20, 15, 25]], GRID[0][[16, 20, 12, 18]],
        np.log([0.5, 0.2, 1.0, 0.05]),
    ])  # fmt: skip
    assert model.dimension == 5
    shared = common_columns(observed(cells), [0.0], CONFIG)
    forms = form_basis(cells.incidence_deg, FORM_KNOTS, FORMS)
    flat = 0.03 * (cells.incidence_deg - 37.0)
    weights = np.maximum(0.0, 1.0 - np.abs(cells.incidence_deg[:, None] - KNOTS))
    for point, found in zip(at, model.log_likelihood(at), strict=True):
        x = LINE_BOX[:, 0] + norm.cdf(point[:2]) * (LINE_BOX[:, 1] - LINE_BOX[:, 0])
        field, cell, form = np.exp(point[2:])
        mean = cells.beside_db + weights @ LINE(np.radians(KNOTS), x) + shared @ common.mean
        covariance = np.diag(cells.variance + cell**2) + field**2 * (cells.patch[:, None] == cells.patch)
        covariance += form**2 * forms @ forms.T + np.outer(flat, flat) + shared @ common.covariance @ shared.T
        if error is not None:
            covariance += (error * (1.0 + 0.01 * x[0])) ** 2
        wanted = multivariate_normal.logpdf(cells.measured_db, mean, covariance) + 30.0 * np.log(2.0 * np.pi)
        assert found == pytest.approx(wanted, abs=1e-4)


def test_the_prior_of_x_is_uniform_inside_of_the_bounds():
    parameters = line_parameters()
    deviates = np.random.default_rng(2).normal(size=(20_000, 2))
    x = parameters.scaled(deviates)
    for k, (low, high) in enumerate(LINE_BOX):
        share = (np.sort(x[:, k]) - low) / (high - low)
        np.testing.assert_allclose(share, np.linspace(0.0, 1.0, 20_000), atol=0.015)
    np.testing.assert_allclose(parameters.scaled(parameters.deviates(LINE_X)[None])[0], LINE_X)
    whole = line_parameters(integer=(True, False)).scaled(deviates)
    np.testing.assert_array_equal(whole[:, 0], np.round(x[:, 0]))
    np.testing.assert_array_equal(whole[:, 1], x[:, 1])
    assert np.isfinite(parameters.deviates(LINE_BOX[:, 0])).all()


def test_the_priors_of_the_scales():
    model = line_model(seen_cells(np.random.default_rng(1), 30), known_common())
    at = np.random.default_rng(2).normal(0.0, 0.5, (30, 5))
    wanted = -0.5 * (at[:, :2] ** 2).sum(axis=1)
    wanted += norm.logpdf(at[:, 2], np.log(0.5), np.sqrt(0.3**2 + 1.0))
    for k, scale in ((3, 0.4), (4, CONFIG.form_db)):
        wanted += at[:, k] - 0.5 * (np.exp(at[:, k]) / scale) ** 2
    found = model.log_prior(at)
    np.testing.assert_allclose(found - found[0], wanted - wanted[0])
    at[4, 0] = -9.5
    assert np.isneginf(model.log_prior(at)[4])
    start = model.start(200, np.random.default_rng(3), LINE_X)
    np.testing.assert_allclose(model.law.scaled(start[:1, :2])[0], LINE_X)
    assert np.isfinite(model.log_prior(start)).all()


def curves(draws, angle):
    return line_db(draws.parameters, angle) + draws.form @ form_basis(angle, FORM_KNOTS, FORMS).T


def test_in_a_few_steps_a_hidden_law_is_found():
    """In an image that is 0.8 dB too bright, as the fixed materials know; the fields are those of one image."""
    cells = seen_cells(np.random.default_rng(7), 240, added_db=0.8)
    common = known_common(0.8)
    common = replace(common, mean=np.array([0.8, 0.0, 0.0, 0.0, 0.0]))
    draws = line_model(cells, common, BRIEF).drawn(3, LINE_X)
    found = curves(draws, ANGLES)
    assert np.abs(np.median(found, axis=0) - LINE(np.radians(ANGLES), LINE_X)).max() < 0.6
    assert (np.median(draws.field_db), np.median(draws.cell_db)) == pytest.approx((0.5, 0.2), rel=0.4)
    assert draws.common.shape == (len(draws.parameters), 5)
    assert draws.common[:, 0].mean() == pytest.approx(0.8, abs=0.2)
    assert draws.form.shape[1] == FORMS
    away = cells.measured_db - 0.8 - LINE(np.radians(cells.incidence_deg), LINE_X)  # of fields that are seen
    assert draws.fields_db.mean() == pytest.approx(np.average(away, weights=cells.pixels), abs=0.3)


def test_the_same_seed_gives_the_same_draws():
    cells = seen_cells(np.random.default_rng(5), 60)
    short = BRIEF.model_copy(update={"steps": 20})
    one, two, other = (line_model(cells, known_common(), short).drawn(seed, LINE_X) for seed in (3, 3, 4))
    for key in ("parameters", "form", "common", "fields_db"):
        np.testing.assert_array_equal(getattr(one, key), getattr(two, key))
    assert not np.array_equal(one.parameters, other.parameters)


def test_draws_of_two_posteriors_are_mixed_by_their_probabilities():
    """Convergence is that of the sample that has converged least, whatever its effective size."""

    def draws(value, ess, converged):
        one = np.full(200, value)
        every = np.column_stack([one, one])
        return Draws(every, one, one, every, every, every, one, Sample(every, ess, 1.0, 250, converged))

    found = Draws.mixed([draws(1.0, 500.0, True), draws(2.0, 900.0, False)], [0.75, 0.25])
    assert np.mean(found.field_db == 1.0) == pytest.approx(0.75, abs=0.005)
    assert {len(value) for name, value in vars(found).items() if name != "sample"} == {found.field_db.size}
    np.testing.assert_array_equal(found.parameters[:, 0], found.common[:, 1])
    assert (found.sample.converged, found.sample.ess) == (False, 900.0)
