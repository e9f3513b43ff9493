"""Posterior of a law: its likelihood and priors, each term of the budget, and what is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import make_material, make_target
from posterior_samples import BRIEF, LINE, LINE_X, made_bins, made_model
from scipy import stats

from radcal.assessment.budget import FLATTENING, Budget
from radcal.assessment.curves import Curves
from radcal.assessment.evidence import Evidence, Unknowns
from radcal.assessment.posterior import (
    Draws,
    posterior_on,
    read_posterior,
    sigma0_db,
    summarised,
    write_posterior,
)
from radcal.assessment.sampling import Sample, sample
from radcal.assessment.unknowns import Model
from radcal.calibration.misfit import BinMisfit
from radcal.calibration.moments import to_cumulants
from radcal.calibration.objectives.density import Density
from radcal.calibration.objectives.joint import Joint
from radcal.calibration.surrogate import Surrogate, train_surrogate
from radcal.config import SurrogateConfig, Uncertainty, case_from
from radcal.errors import ConfigError
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.field_spread import spread_table
from radcal.measurement.ground import Ground
from radcal.measurement.levels import Levels
from radcal.measurement.patches import GRID_DB, Spread
from radcal.radar.laws import LAWS
from radcal.radar.texture import equal_texture, log_speckle_cumulants
from radcal.storage.inspection import kind_of

MANGIA_BOX = [[-60, 0], [0, 50], [0, 50], [0, 20]]
MANGIA_X = [-24.0, 12.0, 9.0, 4.0]


def unknowns(count: int = 1, **values: float) -> Unknowns:
    found = {"looks": 4.0, "between_db": 0.0, "within_db": 0.0, "incidence": 0.0, "point_spread": 0.0, **values}
    return Unknowns(**{name: np.full(count, value) for name, value in found.items()})


def linear_sd_db(model: Model, x: np.ndarray, angle_deg: float) -> float:
    """Standard deviation of sigma0 by the linear covariance at X."""
    centre = np.zeros(model.dimension)
    centre[: model.d] = model.surrogate.unit(x)
    draws = model.linear(centre, np.random.default_rng(7))
    return float(Curves.at(sigma0_db(model, draws), np.array([[angle_deg]])).std())


def test_error_of_the_noise_floor():
    level_db, noise_db = np.array([-22.0, -12.0]), -27.0
    budget = Budget.of(Uncertainty(noise_db=2.0), Levels())
    signal = 10.0 ** (level_db / 10.0) - 10.0 ** (noise_db / 10.0)
    moved = [10.0 * np.log10(signal + 10.0 ** ((noise_db + step) / 10.0)) for step in (0.001, -0.001)]
    found = budget.noise_errors_db(level_db, noise_db)
    assert found == pytest.approx(2.0 * (moved[0] - moved[1]) / 0.002, rel=1e-3)
    assert not budget.noise_errors_db(level_db, -np.inf).any()
    assert budget.noise_errors_db(np.array([-30.0]), noise_db) == pytest.approx(2.0)


def test_error_of_the_noise_floor_widens_the_band_of_dark_ground():
    def sd_db(noise_db: float, standard_error_db: float) -> float:
        bins = made_bins(noise_db=noise_db)
        return linear_sd_db(made_model(bins, noise_db=standard_error_db), LINE_X, 40.0)

    assert sd_db(-17.0, 2.0) > 1.4 * sd_db(-17.0, 0.0)
    assert sd_db(-47.0, 2.0) == pytest.approx(sd_db(-47.0, 0.0), rel=0.05)


def test_residuals_are_those_of_the_objective():
    bins = made_bins(LAWS["mangia"], MANGIA_BOX, MANGIA_X, error_deg=3.0)
    model = made_model(bins)
    evidence = model.evidence
    x = np.array([[-20.0, 10.0, 5.0, 6.0]])
    levels = model.curves(x)
    simulated = evidence.baseline(levels)
    assert simulated[0] == pytest.approx(bins.baseline(x[0]), abs=2e-3)
    at = unknowns(looks=2.9, between_db=0.7, within_db=0.4)
    found, _ = evidence.whitened(evidence.difference(simulated, levels, at), np.zeros((1, 3)), at)
    misfit = BinMisfit.of(bins.ground, bins.bins.classes, bins.method, Spread(0.7, 0.4))
    wanted = misfit(x[0], 2.9, to_cumulants(simulated[0]))
    assert found[0] == pytest.approx(wanted, abs=0.06)
    assert np.abs(wanted).max() > 1.0


def test_an_error_of_the_incidence_spreads_a_straight_law_by_the_share_that_is_true():
    """True angles are drawn towards the mean of the mapped ones, and scatter by the root of this share of the error."""
    bins = made_bins(error_deg=4.0)
    model = made_model(bins)
    shift = model.evidence.passes[0]._shift(model.curves(LINE_X[None]), unknowns())[0]
    variance, mean = np.var(bins.ground.incidence_deg), np.mean(bins.ground.incidence_deg)
    share = (variance - 16.0) / variance
    assert 0.5 < share < 0.8
    nodes = model.evidence.passes[0]._few
    wanted = 0.25**2 * ((share**2 - 1.0) * nodes.var(axis=1) + 16.0 * share)
    np.testing.assert_allclose(shift[:, 1], wanted, rtol=0.03)
    np.testing.assert_allclose(shift[:, 0], -0.25 * (share - 1.0) * (nodes.mean(axis=1) - mean), atol=0.01)


def test_the_log_determinant_counts():
    evidence = made_model(made_bins(), field_db=1.0).evidence
    zero = np.zeros((1, evidence.size, 3))
    simulated = zero + evidence.compared.statistics
    found = [evidence.log_likelihood(simulated, np.full((1, 3), error), None, unknowns()) for error in (0.0, 5.0)]
    # no residual, but a covariance so much wider is worth less by the logarithm of its volume
    assert found[1] - found[0] < -10.0


def test_the_table_of_fields_is_interpolated_in_both_directions():
    """A plane is met everywhere, with other slopes in both directions."""
    evidence = made_model(made_bins()).evidence
    evidence._spread = 3.0 * GRID_DB[:, None] - 5.0 * GRID_DB[None, :]
    at = replace(unknowns(3), between_db=np.array([0.0, 1.23, 5.9]), within_db=np.array([0.7, 0.31, 0.0]))
    np.testing.assert_allclose(evidence._of_fields(at), [-3.5, 3.69 - 1.55, 17.7], atol=0.02)


def test_fields_at_other_angles_are_told_apart_by_what_they_share_of_each_bin():
    """Against the restricted likelihood of all pixels, with a free level of each bin, by dense algebra."""
    rng = np.random.default_rng(4)
    patch = np.repeat([1, 2, 3], [90, 60, 50])
    incidence = np.clip(rng.normal(30.0 + 3.0 * patch, 5.0), 15.0, 60.0)
    block = rng.integers(4, size=patch.size)
    values = -0.4 * incidence + np.array([0.0, -6.0, -2.5, 1.0])[patch] + rng.normal(size=patch.size)
    ground = Ground(values, incidence, patch, block)
    table, of_pixel = spread_table([ground]), ground.cells.of_pixel
    edges = incidence_edges(incidence, "auto")
    bins = (class_of(incidence, edges)[:, None] == np.arange(len(edges) - 1)).astype(np.float64)
    noise = np.diag((ground.sampling * ground.cells.count)[of_pixel])
    in_field, in_cell = (np.equal.outer(one, one) for one in (patch, of_pixel))

    def dense(between, within):
        covariance = noise + between**2 * in_field + within**2 * in_cell
        inverse = np.linalg.inv(covariance)
        known = bins.T @ inverse @ bins
        left = values - bins @ np.linalg.solve(known, bins.T @ inverse @ values)
        return -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(known)[1] + left @ inverse @ left)

    places = [(0, 0), (0, 30), (12, 20), (25, 28), (33, 8), (38, 22)]
    wanted = np.array([dense(GRID_DB[k], GRID_DB[j]) for k, j in places])
    found = np.array([table[place] for place in places])
    np.testing.assert_allclose(found - found[-1], wanted - wanted[-1], atol=0.01)
    # sum over cells alone, whose shares of the bins go with their fields, would leave it open
    assert table[0].max() < -10.0


def test_a_second_sensor_has_other_looks_at_the_same_texture():
    """As texture leaves 2 of 4 looks in the first pass, it leaves fewer than half of 16."""
    bins = made_bins()
    first, second = (Evidence([bins], [Budget(0.0, 0.5, 0.0, 0.0, 0.0)], sensor) for sensor in (4.0, 16.0))
    same, other = (
        one.difference(np.asarray(bins.baseline(LINE_X))[None], None, unknowns(looks=2.0)) for one in (first, second)
    )
    n = first.size
    moved = to_cumulants(bins.baseline(LINE_X))[:, 0]
    for sensor, found in ((4.0, same), (16.0, other)):
        here = equal_texture(sensor, 2.0, 4.0)
        speckle = log_speckle_cumulants(here)[0] - log_speckle_cumulants(4.0)[0]
        wanted = moved + speckle - first.compared.statistics[:, 0]
        np.testing.assert_allclose(found[0, :n], wanted, atol=2e-3)
    assert equal_texture(16.0, 2.0, 4.0) < 1.9


def test_an_effect_of_a_field_counts_once_in_two_passes():
    """A level that is off by 1 dB in both passes is one effect of the field, of 1.5 dB; opposed levels are none."""
    bins, budget, at = made_bins(fields=1), Budget(0.0, 0.5, 0.0, 0.0, 0.0), unknowns(between_db=1.5)
    measured = bins.compared().statistics

    def squares(*levels_db: float) -> float:
        evidence = Evidence([bins] * len(levels_db), [budget] * len(levels_db), 4.0)
        simulated = np.concatenate([measured + [level, 0.0, 0.0] for level in levels_db])[None]
        found, _ = evidence.whitened(evidence.difference(simulated, None, at), np.zeros((1, 3)), at)
        return float((found**2).sum())

    single = squares(1.0) - squares(0.0)
    assert single == pytest.approx(1.0 / 1.5**2, rel=0.15)
    assert squares(1.0, 1.0) - squares(0.0, 0.0) == pytest.approx(single, rel=0.05)
    assert squares(1.0, -1.0) - squares(0.0, 0.0) > 20.0 * single


def test_points_of_the_prior_have_its_laws():
    """Uniform X and log looks; half-t fields, in units of their scale; the curve's prior apart."""
    model = made_model(made_bins(free_looks=True), field_db=0.5)
    deviates = np.array([[-1.0, 0.5, 1.2, 0.3, -0.7, 0.2, -0.4]])
    assert model.dimension == 7
    found, share = model.points(deviates)[0], stats.norm.cdf(deviates[0])
    np.testing.assert_allclose(found[:2], share[:2])
    assert found[2] == pytest.approx(np.log(0.3) + share[2] * np.log(4.4 / 0.3))
    half_t = stats.t(2.0)  # cut at 99 % of 6 dB
    wanted = half_t.ppf(0.5 + share[3:5] * (half_t.cdf(0.99 * 6.0 / 0.5) - 0.5))
    np.testing.assert_allclose(found[3:5], wanted, rtol=1e-3)
    np.testing.assert_array_equal(found[5:], [0.2, -0.4])
    at = model.unknowns(found[None])
    np.testing.assert_allclose([at.between_db[0], at.within_db[0]], 0.5 * found[3:5])
    assert found[3] > 1.5 * found[4]
    # log-normal looks about 0.9 of the sensor's, log sd 0.6
    model._looks_prior = True
    each = np.tile(found, (2, 1))
    each[:, 2] = np.log([3.6, 3.6 * np.exp(-1.2)])
    assert np.diff(model._log_weight(each))[0] == pytest.approx(-2.0, rel=1e-6)


def test_linear_draws_of_a_parameter_that_nothing_tells_fill_its_bounds():
    """The covariance of a uniform law, 1/12, for one that the pixels are silent of; steps go to the inside."""
    bins = made_bins()
    model = made_model(bins)
    for centre in (0.5, 1e-5, 1.0 - 1e-5):
        asked = []
        model._whitened = lambda points, _, asked=asked: asked.append(points) or 50.0 * points[:, :1]
        at = np.array([0.5, centre, 0.0, 0.0, 0.0, 0.0])
        draws = model.linear(at, np.random.default_rng(1))
        inside = np.concatenate(asked)
        assert inside[:, :2].min() >= 0.0
        assert inside[:, :2].max() <= 1.0
        assert draws[:, 0].std() == pytest.approx(1.0 / 50.0, rel=0.05)
        if centre == 0.5:
            # a normal law of this variance, of which those inside of the bounds are kept
            cut = stats.truncnorm(-0.5 * np.sqrt(12.0), 0.5 * np.sqrt(12.0), scale=1.0 / np.sqrt(12.0))
            assert draws[:, 1].std() == pytest.approx(cut.std(), rel=0.05)


def test_the_level_adds_in_quadrature():
    bins = made_bins()
    alone, level = (linear_sd_db(made_model(bins, level_db=sd), LINE_X, 40.0) for sd in (0.0, 0.6))
    assert alone == pytest.approx(0.06, rel=0.25)
    assert np.sqrt(level**2 - alone**2) == pytest.approx(0.6, rel=0.1)


@pytest.mark.parametrize("first", [0, 1])
def test_each_pass_has_the_error_of_its_own_offset(first: int):
    """Weights by the inverse variances of both offsets, whichever pass comes first."""
    errors_db = [0.2, 0.8]
    order = [first, 1 - first]
    levels = [Levels("offset", 1.0, errors_db[k]) for k in order]
    model = made_model(Joint([made_bins(seed=1 + k) for k in order]), levels)
    alone = 0.06**2 / 2.0  # of the sampling, as in a single pass without any error of the level
    wanted = np.sqrt(1.0 / (0.2**-2 + 0.8**-2) + alone)
    assert linear_sd_db(model, LINE_X, 40.0) == pytest.approx(wanted, rel=0.1)


def test_the_resolutions_flatten_and_steepen():
    bins = made_bins()
    angles = np.array([[30.0, 50.0]])

    def slope_sd(share: float) -> float:
        model = made_model(bins, point_spread=share)
        centre = np.zeros(model.dimension)
        centre[:2] = model.surrogate.unit(LINE_X)
        curves = sigma0_db(model, model.linear(centre, np.random.default_rng(7)))
        return float(np.diff(Curves.at(curves, angles), axis=1).std())

    # the line falls by 5 dB between these angles
    assert np.sqrt(slope_sd(0.4) ** 2 - slope_sd(0.0) ** 2) == pytest.approx(5.0 * FLATTENING * 0.4, rel=0.2)


def test_coarser_resolutions_flatten():
    """An image that is a tenth coarser has slopes flatter by a fourth of that."""
    found = Budget(0.3, 0.4, 0.1, 0.5, 0.3).steepening(np.array([1.0, 0.0, -2.0, 1000.0]))
    assert found == pytest.approx([0.975, 1.0, 1.05, 0.1])


def test_an_error_of_the_incidence_is_uncertain_by_its_factor():
    budget = Budget(0.3, 0.4, 0.1, 0.5, 0.3)
    found = budget.incidence_error_deg(np.array([0.4, 1.2]), np.array([-1.0, 0.0, 2.0]))
    assert found[1] == pytest.approx([0.5, np.hypot(1.2, 0.3)])
    assert found[2] / found[1] == pytest.approx(np.exp(1.0))
    assert found[0] / found[1] == pytest.approx(np.exp(-0.5))


def test_a_removed_offset_has_its_own_error():
    config = Uncertainty(level_db=0.7)
    assert Budget.of(config, Levels()).level_db == 0.7
    assert Budget.of(config, Levels("offset", 1.2, 0.25)).level_db == 0.25


@pytest.mark.slow
def test_the_linear_band_covers_hidden_laws():
    """Fifty lines with speckle of their own and a level that is off."""
    rng = np.random.default_rng(11)
    held = []
    for seed in range(50):
        bins = made_bins(seed=seed, shift_db=rng.normal(0.0, 0.3))
        model = made_model(bins, level_db=0.3)
        centre = np.zeros(model.dimension)
        centre[:2] = model.surrogate.unit(LINE_X)
        draws = model.linear(centre, np.random.default_rng(seed))[:400]
        best = draws[np.argmax(model.log_likelihood(draws))]
        curves = sigma0_db(model, model.linear(best, np.random.default_rng(seed)))
        low, high = np.quantile(Curves.at(curves, np.array([[33.0, 47.0]])), [0.05, 0.95], axis=0)
        truth = LINE(np.radians([33.0, 47.0]), LINE_X)
        held.append((truth >= low) & (truth <= high))
    assert 0.80 <= np.mean(held) <= 0.98


@pytest.mark.slow
def test_slopes_up_and_down_that_one_density_hardly_tells_apart_have_their_exact_shares():
    """Two separate modes, against the integral over a grid of X and looks; skewed incidence makes them unequal."""
    rng = np.random.default_rng(5)
    angle = np.clip(40.0 + 24.0 * (rng.gamma(16.0, 1.0 / 16.0, 900) - 1.0), 21.0, 59.0)
    values = LINE(np.radians(angle), [2.0, -34.0]) + 10.0 * np.log10(np.random.default_rng(1).gamma(4.0, 0.25, 900))
    model = made_model(Density(make_material(make_target(values, angle), [[-40.0, 10.0]] * 2, LINE)))
    start = np.random.default_rng(2).standard_normal((128, model.dimension))
    found = sample(model.log_prior, lambda z: model.log_likelihood(model.points(z)), start, 2000, 2)
    drawn = model.points(found.draws)
    middle, half, share = np.meshgrid(
        np.linspace(-3.0, 4.0, 71) + values.mean(), np.linspace(-24.0, 24.0, 97), np.linspace(0.02, 0.98, 13)
    )
    grid = np.repeat(model.points(np.zeros((1, model.dimension))), middle.size, axis=0)
    grid[:, :2] = model.surrogate.unit(np.stack([(middle + half).ravel(), (middle - half).ravel()], axis=-1))
    grid[:, 2] = model._log_looks[0] + np.ptp(model._log_looks) * share.ravel()
    grid = grid[((grid[:, :2] > 0.0) & (grid[:, :2] < 1.0)).all(axis=1)]
    log = model.log_likelihood(grid) + model._log_weight(grid)
    weight, falls = np.exp(log - log.max()), grid[:, 0] > grid[:, 1]
    exact = weight[falls].sum() / weight.sum()
    assert exact == pytest.approx(0.72, abs=0.03)
    assert found.converged
    assert (drawn[:, 0] > drawn[:, 1]).mean() == pytest.approx(exact, abs=0.04)
    # modes that touch would be no test of separate ones
    assert np.mean(np.abs(drawn[:, 0] - drawn[:, 1]) < 0.1) < 0.01


@pytest.mark.slow
def test_rejection_draws_the_prior_that_the_sampler_sees():
    bins = made_bins(LAWS["mangia"], MANGIA_BOX, MANGIA_X, free_looks=True)
    bins.bins = replace(bins.bins, priors=True)
    bins.method = replace(bins.method, priors=True)
    model = made_model(bins, field_db=0.4)
    drawn = model.from_prior(2000, np.random.default_rng(5))
    start = np.random.default_rng(6).standard_normal((64, model.dimension))
    walked = model.points(sample(model.log_prior, None, start, 2000, 8).draws)
    assert 600 < len(drawn) <= 2000
    # X4 and the looks have priors of their own, the level that of the curve
    for values in ((one[:, 3], one[:, 4]) for one in (drawn, walked)):
        assert np.median(values[0]) < 0.45  # of the box up to 20: log-normal about 5
        assert np.exp(np.median(values[1])) == pytest.approx(3.0, rel=0.12)
    for quantile in (0.25, 0.5, 0.75):
        gap = np.quantile(drawn, quantile, axis=0) - np.quantile(walked, quantile, axis=0)
        assert np.abs(gap / drawn.std(axis=0)).max() < 0.2


@pytest.fixture(scope="module")
def of_density():
    """Posterior of one density at a few steps, with the model's own fall-back."""
    rng = np.random.default_rng(3)
    angle = np.clip(rng.normal(40.0, 8.0, 600), 10.0, 80.0)
    values = LAWS["mangia"](np.radians(angle), MANGIA_X) + 10.0 * np.log10(rng.gamma(4.0, 0.25, 600))
    objective = Density(make_material(make_target(values, angle), MANGIA_BOX, LAWS["mangia"]))
    x = np.array([[-30.0, 20.0, 10.0, 5.0], [-20.0, 5.0, 20.0, 9.0]])
    statistics = np.stack([objective.baseline(one) + 0.02 for one in x])
    surrogate = Surrogate(train_surrogate(objective, x, statistics, SurrogateConfig()), objective)
    return lambda seed: posterior_on(objective, surrogate, [Levels()], BRIEF, seed, x[0])


@pytest.fixture(scope="module")
def found_of_density(of_density):
    return of_density(4)


@pytest.mark.slow
def test_without_convergence_the_linear_covariance_is_taken_and_said(found_of_density):
    found = found_of_density
    assert not found.sampled
    assert "the sampler has not converged" in found.sentences[0]
    assert "after 20 steps" in found.sentences[0]
    assert (found.parameters_p05 < found.parameters_p95).all()
    assert found.curve is not None
    assert (found.curve.p05_db < found.curve.median_db).all()
    assert found.curve.incidence_deg == pytest.approx(np.arange(86.0))


@pytest.mark.slow
def test_the_same_seed_gives_the_same_posterior(of_density, found_of_density, tmp_path: Path):
    first, again, other = found_of_density, of_density(4), of_density(5)
    assert (first.parameters_p50 == again.parameters_p50).all()
    assert not (first.parameters_p50 == other.parameters_p50).any()
    path = tmp_path / "posterior/dyke.h5"
    path.parent.mkdir()
    write_posterior(path, replace(first, known_between_deg=(20.25, 41.5)))
    assert kind_of(path) == "posterior"
    read = read_posterior(path)
    assert read.known_between_deg == (20.25, 41.5)
    assert (read.curve.p95_db == first.curve.p95_db).all()
    assert read.sentences == first.sentences


def test_a_law_is_known_where_its_band_is_narrow_as_widely_as_it_is_at_worst():
    """A line through levels with errors of 0.2 dB at 20 degrees and 1.2 dB at 60."""
    model, rng = made_model(made_bins()), np.random.default_rng(6)
    points, prior = np.zeros((20_000, model.dimension)), np.zeros((2000, model.dimension))
    points[:, :2] = model.surrogate.unit(LINE_X + [0.2, 1.2] * rng.standard_normal((20_000, 2)))
    prior[:, :2] = rng.random((2000, 2))
    drawn = Draws(points, prior, Sample(points, 1000.0, 1.0, 100, True, points[0]))
    found = summarised(model, drawn, 0.6)
    angle = np.linspace(20.0, 60.0, 4001)
    half = 1.6449 * np.hypot(0.2 * (60.0 - angle), 1.2 * (angle - 20.0)) / 40.0
    first, last = model.seen_deg[0][0], angle[half <= 0.6].max()
    assert found.known_between_deg == pytest.approx((first, last), abs=0.4)
    assert found.known_half_width_db == pytest.approx(np.interp(found.known_between_deg[1], angle, half), rel=0.03)
    assert np.interp(first, angle, half) < 0.55


@pytest.mark.slow
def test_without_a_curve_only_parameters_have_intervals():
    rng = np.random.default_rng(3)
    values = rng.normal(-8.0, 2.0, 400)
    objective = Density(make_material(make_target(values, np.full(400, 35.0)), [[0.0, 1.0], [-2.0, 2.0]]))
    x = np.array([[0.1, -1.0], [0.8, 1.0], [0.4, 0.3], [0.9, -1.5]])
    statistics = np.stack([[[-14.0 + 9.0 * a, 0.6 + 0.1 * b, -0.3]] for a, b in x])
    surrogate = Surrogate(train_surrogate(objective, x, statistics, SurrogateConfig()), objective)
    found = posterior_on(objective, surrogate, [Levels()], Uncertainty(walkers=40, steps=200), 2)
    assert found.sampled
    assert found.curve is None
    assert found.known_between_deg is None
    # the level fixes the first parameter at 0.67
    assert found.parameters_p05[0] < 0.67 < found.parameters_p95[0]
    assert found.parameters_p95[0] - found.parameters_p05[0] < 0.4
    assert "no curve" in found.sentence(1.5)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"known_db": 0}, "uncertainty.known_db"),
        ({"level_db": -0.1}, "uncertainty.level_db"),
        ({"walkers": 8}, "uncertainty.walkers"),
        ({"levels_db": 0.3}, "uncertainty.levels_db"),
    ],
)
def test_wrong_settings_are_refused_in_a_sentence(wrong, sentence):
    with pytest.raises(ConfigError, match=sentence):
        case_from({"uncertainty": wrong}, "mine.yaml")
