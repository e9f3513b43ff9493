"""Bands and laws from the draws of a posterior."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, known_common, line_db, line_model, line_parameters, made_cells
from scipy import stats

from radcal.posterior import quantiles
from radcal.posterior.calibrated import FORMS, Draws
from radcal.posterior.cells import with_noise_db
from radcal.posterior.curves import GRID_DEG, curves_of
from radcal.posterior.effects import Observed
from radcal.posterior.sampling import Sample


def test_the_nearest_law_is_that_of_least_squares_in_the_bounds():
    """To a bent median over 25 to 45 degrees; with whole numbers, the best of the draws."""
    x = LINE_X + np.random.default_rng(1).normal(0.0, 1.0, (200, 2))
    curves = curves_of(LINE, x)
    median = LINE(np.radians(GRID_DEG), LINE_X) + 0.002 * (GRID_DEG - 35.0) ** 2
    inside = (GRID_DEG >= 25.0) & (GRID_DEG <= 45.0)
    slope, level = np.polyfit(GRID_DEG[inside], median[inside], 1)
    found = quantiles._nearest(LINE, line_parameters(), x, curves, median, [(25.0, 45.0)])
    np.testing.assert_allclose(found, [level + 20.0 * slope, level + 60.0 * slope], atol=1e-3)
    narrow = replace(line_parameters(), box=np.array([[-30.0, -6.5], [-40.0, 0.0]]))
    assert quantiles._nearest(LINE, narrow, x, curves, median, [(25.0, 45.0)])[0] == pytest.approx(-6.5, abs=1e-3)
    whole = quantiles._nearest(LINE, line_parameters(integer=(True, True)), x, curves, median, [(25.0, 45.0)])
    np.testing.assert_array_equal(whole, x[((curves - median)[:, inside] ** 2).sum(axis=1).argmin()])


def made_draws(n=4000):
    """Levels that scatter by 0.6 dB, of which the first common effect is 0.4 dB; fields of 0.5 and cells of 0.2 dB."""
    rng = np.random.default_rng(6)
    level = rng.normal(0.0, 0.4, n)
    x = LINE_X + (level + rng.normal(0.0, np.sqrt(0.6**2 - 0.4**2), n))[:, None]
    common = np.column_stack([level, rng.normal(size=(n, 4))])
    sample = Sample(np.zeros((n, 5)), 500.0, 1.02, 900, True)
    return Draws(
        x, np.full(n, 0.5), np.full(n, 0.2), np.zeros((n, FORMS)), np.zeros((n, 14)), common,
        rng.normal(0.1, 0.3, n), sample,
    )  # fmt: skip


def test_the_band_of_draws():
    """The material's band, that of its fields, and the part by the level; sigma0 is mean power."""
    draws, angle = made_draws(), np.linspace(26.0, 48.0, 30)
    of = Observed([made_cells(np.zeros(30), angle, looks=3.0), made_cells(np.zeros(10), angle[:10], looks=5.0)], [], [])
    found = quantiles.summary(of, draws, None, [(27.0, 44.0), (30.0, 41.0)], None)
    assert (found.cells, found.fields, found.looks) == (40, 1, pytest.approx(3.5))
    assert (found.sampled, found.ess, found.r_hat, found.steps) == (True, 500.0, 1.02, 900)
    assert (found.curve, found.form, found.known_between_deg, len(found.draws.parameters)) == (None, None, None, 400)
    np.testing.assert_allclose(found.parameters_p95 - found.parameters_p05, 2.0 * 1.645 * 0.6, rtol=0.06)
    whole = quantiles.with_band(found, LINE, draws, None, line_parameters(), 1.1)
    curve, law = whole.curve, LINE(np.radians(np.arange(86.0)), LINE_X)
    raised = np.log(10.0) / 20.0 * (0.5**2 + 0.2**2)
    np.testing.assert_allclose(curve.incidence_deg, np.arange(86.0))
    np.testing.assert_allclose(curve.median_db, law + raised, atol=0.03)
    np.testing.assert_allclose(curve.half_width_db, 1.645 * 0.6, rtol=0.06)
    levels = line_db(draws.parameters, np.arange(20.0, 61.0)) + raised
    np.testing.assert_allclose(curve.p05_db[20:61], np.quantile(levels, 0.05, axis=0), atol=1e-6)
    np.testing.assert_allclose(curve.p95_db[20:61], np.quantile(levels, 0.95, axis=0), atol=1e-6)
    np.testing.assert_allclose(curve.systematic_db, 1.645 * 0.4, rtol=0.06)
    np.testing.assert_allclose(curve.field_median_db, law + 0.1 + np.log(10.0) / 20.0 * 0.2**2, atol=0.03)
    np.testing.assert_allclose(curve.field_p95_db - curve.field_p05_db, 2.0 * 1.645 * np.hypot(0.6, 0.3), rtol=0.06)
    assert whole.known_between_deg == (27.0, 44.0)
    assert whole.known_half_width_db == pytest.approx(1.645 * 0.6, rel=0.06)
    np.testing.assert_allclose(whole.parameters_model, LINE_X + raised, atol=0.05)
    for known_db in (0.8, None):
        narrow = quantiles.with_band(found, LINE, draws, None, line_parameters(), known_db)
        assert (narrow.known_between_deg, narrow.known_half_width_db) == (None, None)
    # an uncertain slope: the half-width is the largest of the interval, and not that at larger angles
    slopes = np.random.default_rng(8).normal(0.0, 2.0, (len(draws.parameters), 1)) * [0.0, 1.0]
    uncertain = replace(draws, parameters=draws.parameters + slopes)
    bent = quantiles.with_band(found, LINE, uncertain, None, line_parameters(), 4.0)
    assert bent.known_half_width_db == pytest.approx(bent.curve.half_width_db[44])
    assert bent.curve.half_width_db[60] > 1.3 * bent.curve.half_width_db[44]


def test_points_are_levels_of_the_law_in_intervals_of_incidence():
    """Three cells in the interval from 27 to 30 degrees and one in the next, with area, noise and a level of 1.5 dB."""
    law = LINE(np.radians([27.5, 29.0, 28.0, 31.0]), LINE_X)
    away, noise, beside = np.array([0.3, -0.7, 0.2, 0.9]), law - np.array([8.0, 5.0, 11.0, 6.0]), np.arange(4.0)
    common = known_common(1.5)
    common.mean[1:] = 0.0
    cells = made_cells(
        with_noise_db(law, noise) + away + beside + 1.5, [27.5, 29.0, 28.0, 31.0], noise_db=noise, beside_db=beside,
        patch=np.array([3, 3, 8, 8]), pixels=np.array([20, 30, 50, 70]), variance=np.array([0.05, 0.1, 0.2, 0.4]),
    )  # fmt: skip
    model = line_model(cells, common)
    found = quantiles.points_of(
        model, model.measured_db + law - with_noise_db(law, noise), made_draws(9), made_draws(9)
    )
    np.testing.assert_allclose(found.incidence_deg, [28.2, 31.0])
    share = np.array([0.2, 0.3, 0.5])
    np.testing.assert_allclose(found.level_db, [share @ (law + away)[:3], (law + away)[3]])
    inside = share**2 @ (cells.variance[:3] + 0.2**2) + 0.5**2 * (0.5**2 + 0.5**2)
    np.testing.assert_allclose(found.error_db, np.sqrt([inside, 0.4 + 0.2**2 + 0.5**2]))


def test_the_predictive_check_is_that_of_normal_distributions():
    """Points of two intervals: given a draw, squares of a further image are chi-squared with 2 degrees."""
    angle, patch = np.array([27.5, 29.0, 28.0, 31.0, 32.5]), np.array([3, 3, 8, 8, 8])
    pixels, variance = np.array([20, 30, 50, 70, 35]), np.array([0.05, 0.1, 0.2, 0.4, 0.15])
    law, away = LINE(np.radians(angle), LINE_X), np.array([0.9, 0.4, 1.1, -0.8, 0.2])
    common = known_common(0.0)
    common.mean[:] = 0.0
    model = line_model(made_cells(law + away, angle, patch=patch, pixels=pixels, variance=variance), common)
    draws = made_draws(400)
    found = quantiles.points_of(model, model.measured_db + 1.7, draws, draws)
    weights = np.array([[0.2, 0.3, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0 / 3.0, 1.0 / 3.0]])
    of_cells = np.diag(variance + 0.2**2) + 0.5**2 * np.equal.outer(patch, patch)
    covariance = weights @ of_cells @ weights.T
    expected = line_db(draws.parameters, angle) @ weights.T
    left = weights @ model.measured_db - expected
    squares = np.einsum("mi,ij,mj->m", left, np.linalg.inv(covariance), left)
    assert found.p == pytest.approx(stats.chi2(2).sf(squares).mean(), abs=0.01)
    assert 0.03 < found.p < 0.3
    # on the level of the points, of which nothing that the simulator adds is left
    middle, half = expected.mean(axis=0) + 1.7, 1.6449 * np.sqrt(expected.var(axis=0) + np.diag(covariance))
    np.testing.assert_allclose(found.predicted_db, np.stack([middle - half, middle, middle + half], axis=1), atol=0.05)


def test_the_error_of_the_form_is_constant_beyond_the_cells():
    form = quantiles.Form(np.array([26.3, 40.0, 47.6]))
    columns = form.columns(np.array([0.0, 26.0, 52.0, 90.0]))
    assert columns.shape == (4, FORMS)
    np.testing.assert_array_equal(columns[0], columns[1])
    np.testing.assert_array_equal(columns[2], columns[3])
    # a prior of variance 1 at each angle
    np.testing.assert_allclose((form.columns(np.linspace(26.0, 48.0, 12)) ** 2).sum(axis=1), 1.0, atol=0.02)
    draws = replace(made_draws(400), form=np.random.default_rng(1).normal(size=(400, FORMS)))
    kept = quantiles._kept(draws, form)
    np.testing.assert_allclose(kept.form_db[:, 30], draws.form @ form.columns(np.array([30.0]))[0])
