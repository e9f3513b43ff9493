"""Test of the fit: against chi-squared laws, and on made-up grounds."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import make_material, make_score, make_target
from scipy import stats
from scipy.special import polygamma

from radcal.assessment import fit_test
from radcal.assessment.fit_test import LEVEL, _all_passes, _critical, _p, _worst, check_fit
from radcal.assessment.linear_fit import Linearised, linearised
from radcal.calibration.expected import LawForward
from radcal.calibration.grounds import fit_grounds
from radcal.calibration.history import PassScore
from radcal.calibration.law_fit import fit_law
from radcal.calibration.misfit import BinMisfit, LikelihoodMisfit, Method
from radcal.calibration.moments import from_cumulants, sampled_statistics, sampling_covariance
from radcal.calibration.objectives import OBJECTIVES
from radcal.calibration.objectives.joint import Joint
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.ground import Ground
from radcal.radar.laws import LAWS, external_law

LAW = LAWS["mangia"]
BOX = np.array([[-60.0, 0.0], [0.0, 40.0], [0.0, 25.0], [0.5, 20.0]])
TRUTH = np.array([-28.0, 20.0, 6.0, 4.0])
LOOKS = 4.0


def ground_of(seed, *, bump_db=0.0, looks=LOOKS, fields=10, pixels=1000, between=0.8):
    rng = np.random.default_rng(seed)
    incidence = rng.uniform(22.0, 50.0, pixels)
    patch = rng.integers(fields, size=pixels)
    level = LAW(np.radians(incidence), TRUTH) + bump_db * np.exp(-0.5 * ((incidence - 36.0) / 4.0) ** 2)
    level = level + (between * rng.normal(size=fields))[patch]
    values = level + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, pixels))
    return Ground(values, incidence, patch, rng.integers(2, size=pixels))


def comparison_of(ground, kind="classes", box=BOX, **changes):
    """Objective, and score of a run that is the law found and its speckle."""
    misfit = LikelihoodMisfit if kind == "likelihood" else BinMisfit
    method = Method(LAW, box, LOOKS, misfit=misfit)
    law = fit_grounds({"area": ground}, {"area": method})["area"]
    bins = ClassTarget(law.classes, law.spread, 1, True, True, 0.0, law.fit.parameters, law.fit.looks)
    target = make_target(
        ground.values_db, ground.incidence_deg, patch=ground.patch, block=ground.block, classes=bins,
        dp=np.array([0.0, 1.0, 0.0]),
    )  # fmt: skip
    objective = OBJECTIVES[kind](make_material(target, box, LAW, **changes))
    statistics = from_cumulants(LawForward(LAW, law.classes.nodes_deg, LOOKS)(law.fit.parameters))
    score = make_score(1.0, law.fit.parameters, statistics=statistics.tolist(), looks=law.fit.looks)
    return objective, score


def result_of(comparison, score, seed=1, pixels=None):
    pixels = pixels or (np.array([-9.0, -5.0]), np.array([-10.0, -7.0]))
    return check_fit(comparison, score, pixels, 1.5, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def right():
    return comparison_of(ground_of(3))


def linear(seed, rows=24, columns=4, information=1e-9):
    """A linear model with white noise of unit variance, and almost nothing known of its parameters."""
    rng = np.random.default_rng(seed)
    slope, truth = rng.normal(size=(rows, columns)) * [1.0, 3.0, 0.2, 10.0], rng.normal(size=columns)
    noise = rng.normal(size=rows)

    def residuals(x, _):
        return slope @ (x - truth) + noise

    x = truth - np.linalg.lstsq(slope, noise, rcond=None)[0]
    box = np.stack([truth - 50.0, truth + 80.0], axis=1)
    return linearised(residuals, x, 1.0, box, None, information * np.eye(columns + 1)), slope


def test_residual_sums_of_a_linear_model_are_chi_squared():
    found, slope = linear(1)
    assert found.expected == pytest.approx(20.0, abs=1e-4)
    np.testing.assert_allclose(found.hat, slope @ np.linalg.pinv(slope), atol=1e-6)
    rng = np.random.default_rng(2)
    sums = (found.refitted(rng.normal(size=(3000, 24)), rng) ** 2).sum(axis=1)
    assert stats.kstest(sums, stats.chi2(20).cdf).pvalue > 0.01
    assert stats.kstest(sums, stats.chi2(24).cdf).pvalue < 1e-6


def test_right_models_are_called_wrong_as_often_as_they_should():
    """Real refits of 400 linear models, against their replicates."""
    wrong = 0
    for seed in range(400):
        found, _ = linear(seed)
        rng = np.random.default_rng(seed)
        sums = (found.refitted(rng.normal(size=(999, 24)), rng) ** 2).sum(axis=1)
        wrong += np.mean(sums >= found.residuals @ found.residuals) < LEVEL
    assert stats.binom(400, LEVEL).ppf(0.001) <= wrong <= stats.binom(400, LEVEL).ppf(0.999)


def test_priors_make_degrees_of_freedom_and_the_mean_of_the_sum_is_theirs():
    found, _ = linear(1, information=0.5)
    assert 20.2 < found.expected < 24.0
    rng = np.random.default_rng(3)
    sums = (found.refitted(rng.normal(size=(6000, 24)), rng) ** 2).sum(axis=1)
    assert sums.mean() == pytest.approx(found.expected, rel=0.02)


@pytest.mark.slow
def test_samples_have_the_covariance_of_the_residuals():
    drawn = sampled_statistics(5.3, 300.0, 20_000, np.random.default_rng(1))
    wanted = sampling_covariance(5.3, 300.0)
    sd = np.sqrt(np.diag(wanted))
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=0.1)
    many = sampled_statistics(5.3, 3000.0, 20_000, np.random.default_rng(1))
    np.testing.assert_allclose(np.cov(many.T) / np.outer(sd, sd), 0.1 * wanted / np.outer(sd, sd), atol=0.005)


def test_replicates_of_bins_are_white(right):
    objective, _ = right
    replicates = objective.moments.replicates(4000, np.random.default_rng(1))
    assert np.mean(replicates**2) == pytest.approx(1.0, rel=0.06)
    assert np.abs(np.corrcoef(replicates.T) - np.eye(replicates.shape[1])).max() < 0.15


def test_a_right_law_fits(right):
    found = result_of(*right)
    objective, score = right
    assert found.fits is True
    assert found.p > 0.1
    m = 3 * objective.moments.classes.size
    assert m - 5.0 < found.expected < m - 2.0
    assert (found.looks_limit, found.bounds) == ("", ())
    assert (found.mean_db, found.sd_db, found.measured_sd_db) == (1.5, 2.0, 1.5)
    assert 1.0 < found.missed_db < 3.5
    residuals = objective.evidence(score)(np.array(score.parameters), score.looks)
    assert found.residual_sum == pytest.approx(residuals @ residuals)
    assert result_of(*right) == found


def test_linearised_refits_leave_what_real_ones_leave(right):
    objective, score = right
    x, information = np.array(score.parameters), objective.law_in(0, score).fit.prior_information
    evidence = objective.evidence(score)
    middle, sums = evidence(x, score.looks), []
    for away in objective.moments.replicates(6, np.random.default_rng(4)):

        def residuals(at, looks, away=away):
            return evidence(at, looks) - middle + away

        real = fit_law(residuals, BOX, LOOKS, start=(x, score.looks), prior=objective._prior)
        line = linearised(residuals, x, score.looks, BOX, LOOKS, information)
        left = residuals(real.parameters, real.looks)
        sums.append([((np.eye(away.size) - line.hat) @ away) @ away, left @ left])
    by_line, by_fit = np.array(sums).T
    np.testing.assert_allclose(by_line, by_fit, rtol=0.3)  # some bend away from the line
    assert np.median(by_line / by_fit) == pytest.approx(1.0, abs=0.03)
    assert by_line.mean() == pytest.approx(by_fit.mean(), rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["classes", "likelihood"])
def test_a_bump_is_found_where_it_is(kind):
    found = result_of(*comparison_of(ground_of(5, bump_db=3.5), kind))
    assert found.fits is False
    assert found.p < 0.005
    assert np.isnan(found.missed_db)
    assert found.residual_sum > 1.5 * found.expected
    assert 31.0 < found.worst_deg < 41.0
    # half of the bump lies inside of the bin, and the law has gone a part of the way
    assert found.worst_mean_db == pytest.approx(-1.75, abs=0.4)


@pytest.mark.slow
def test_what_does_not_matter_fits_all_the_same():
    """30,000 pixels show a bump of half a decibel, which no bin's mean is off by."""
    comparison, score = comparison_of(ground_of(5, bump_db=0.8, pixels=60_000, between=0.0))
    found = result_of(comparison, score)
    assert found.p < LEVEL
    assert abs(found.worst_mean_db) < 0.5
    assert found.fits is True


def test_p_is_uniform_whichever_of_two_sums_is_less_likely():
    rng = np.random.default_rng(1)
    means = rng.chisquare(5.0, (400, 300))
    sums = np.stack([means + rng.chisquare(15.0, (400, 300)), means], axis=-1)
    found = np.array([_p(one[1:], one[0]) for one in sums])
    assert stats.kstest(found, "uniform").pvalue > 0.01
    # the third largest of one sum, and one of which ten are larger
    replicates = np.stack([np.arange(99.0), np.arange(99.0)[::-1]], axis=-1)
    assert _p(replicates, np.array([96.5, 89.5])) == pytest.approx(0.06)


def test_laws_beyond_a_critical_sum_have_a_p_below_the_level():
    rng = np.random.default_rng(2)
    means = rng.chisquare(5.0, 999)
    sums = np.stack([means + rng.chisquare(15.0, 999), means], axis=-1)
    laws = np.stack([rng.uniform(30.0, 50.0, 400), rng.uniform(11.0, 20.0, 400)], axis=-1)
    unlikely = np.array([_p(sums, law) < LEVEL for law in laws])
    beyond = (laws > _critical(sums)).any(axis=-1)
    assert 100 < unlikely.sum() < 300
    assert np.sum(beyond != unlikely) <= 4  # laws that lie beyond both sums count differently


@pytest.mark.slow
def test_fewer_pixels_miss_larger_errors_of_form(right):
    """A mean that is off by less than 0.5 dB does not matter, however many pixels show it."""
    few, many = (result_of(*comparison_of(ground_of(3, pixels=n))) for n in (250, 20_000))
    assert few.fits is many.fits is True
    assert few.missed_db > 1.5 * result_of(*right).missed_db
    assert many.missed_db > 0.5


@pytest.mark.slow
def test_looks_at_a_limit_do_not_fit():
    """Pixels with the spread of 30 looks, where the sensor has 4."""
    found = result_of(*comparison_of(ground_of(6, looks=30.0, between=0.0)))
    assert found.looks_limit == "upper"
    assert found.fits is False


def test_looks_at_a_limit_by_chance_fit(right):
    """4.2 looks seen, where 4.4 are possible: the limit holds nothing back."""
    comparison, score = right
    at_limit = replace(score, looks=1.1 * LOOKS)
    assert result_of(comparison, at_limit).looks_limit == ""


@pytest.mark.slow
def test_a_bound_is_told_where_it_holds_a_parameter_back(right):
    assert result_of(*right).bounds == ()
    box = BOX.copy()
    box[1:3, 1] = 8.0, 1.0
    found = result_of(*comparison_of(ground_of(3), box=box))
    assert "X2" in found.bounds
    assert "X1" not in found.bounds


def test_lower_bounds_hold_back_downwards():
    box = BOX.copy()
    box[1, 0] = 32.0
    objective, score = comparison_of(ground_of(3, pixels=4000, between=0.2), box=box)
    assert score.parameters[1] == pytest.approx(32.0, abs=1e-3)
    assert "X2" in result_of(objective, score).bounds


def test_the_worst_bin_is_worst_in_units_of_what_matters(right):
    """A spread that is 30 % off matters more than a mean that is 0.6 dB off."""
    objective, _ = right
    n = objective.moments.classes.size
    for mean, spread, worst in ((0.6, 1.3, 1), (1.3, 1.3, 0)):
        away = np.zeros((n, 3))
        away[0, 0], away[1, 1] = mean, np.log(spread)
        residuals = np.linalg.solve(np.linalg.cholesky(objective.moments.covariance), away.T.ravel())
        (angle, difference, ratio), matters = _worst(objective.moments, residuals)
        assert angle == pytest.approx(objective.moments.classes.nodes_deg[worst].mean())
        assert (difference, ratio) == pytest.approx((mean, 1.0) if worst == 0 else (0.0, spread), abs=1e-9)
        assert matters
    away[0, 0], away[1, 1] = 0.49, np.log(1.14)
    residuals = np.linalg.solve(np.linalg.cholesky(objective.moments.covariance), away.T.ravel())
    assert not _worst(objective.moments, residuals)[1]


def test_data_ask_in_standard_errors():
    found, _ = linear(1)
    away = found.residuals - found.jacobian[:, 2] * 0.02
    moved = Linearised(away, found.jacobian, found.covariance, found.information)
    wanted = found.jacobian.T @ found.jacobian[:, 2] * 0.02 * np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(moved.asked(), wanted, atol=1e-6)


def test_one_density_cannot_be_tested():
    target = make_target(np.random.default_rng(1).normal(size=200), np.linspace(20.0, 40.0, 200))
    objective = OBJECTIVES["density"](make_material(target, BOX, LAW))
    found = result_of(objective, make_score(1.0, TRUTH))
    assert found.fits is None
    assert found.distance == 1.5
    assert np.isnan([found.residual_sum, found.expected, found.p]).all()


def test_a_law_without_a_curve_is_tested_by_what_its_best_run_shows(right):
    objective, score = right
    target = objective.material.target
    outside = OBJECTIVES["classes"](make_material(target, BOX, external_law(["a", "b", "c", "d"])))
    found = result_of(outside, score)
    m = 3 * objective.moments.classes.size
    assert found.expected == m - 5
    assert found.fits is True
    assert np.isnan(found.missed_db)
    away = replace(score, statistics=(np.array(score.statistics) + [1.5, 0.3, 0.0]).tolist())
    assert result_of(outside, away).fits is False


def test_passes_are_tested_together(right):
    objective, score = right
    statistics = np.concatenate([np.array(score.statistics)] * 2).tolist()
    material = replace(objective.material, priors=False)
    others = replace(material, target=replace(material.target, patch=material.target.patch + 1000))
    alone = result_of(objective, score)
    second = PassScore(score.dp, score.rms)
    both = replace(score, statistics=statistics, further=[second])
    same, twice = (result_of(Joint([objective, OBJECTIVES["classes"](one)]), both) for one in (material, others))
    # but for the shape of texture, which is one in both passes
    assert twice.residual_sum == pytest.approx(2.0 * alone.residual_sum, rel=0.005)
    assert twice.expected > 2.0 * alone.expected
    # equal differences of the same fields are explained by one effect
    assert same.residual_sum < 0.97 * twice.residual_sum
    assert same.expected == pytest.approx(twice.expected, rel=0.05)


def test_linearised_steps_are_taken_in_units_of_the_intervals():
    slope = np.array([[2.0, 0.0, 1.0], [0.0, 3.0, 1.0], [1.0, 1.0, 0.5], [0.0, 0.0, 2.0]])

    def residuals(x, looks):
        return slope @ np.append(x, np.log(looks))

    box = np.array([[0.0, 10.0], [-1.0, 1.0]])
    found = linearised(residuals, np.array([4.0, 0.5]), 2.0, box, 4.0, np.zeros((3, 3)))
    width = [10.0, 2.0, np.log(1.1 * 4.0 / 0.3)]
    np.testing.assert_allclose(found.jacobian, slope * width, rtol=1e-6)
    assert isinstance(found, Linearised)
    assert found.expected == pytest.approx(1.0)


def test_x_is_drawn_from_its_prior_with_its_correlations():
    rng = np.random.default_rng(5)
    jacobian, information = rng.normal(size=(5, 2)), np.array([[4.0, 3.0], [3.0, 9.0]])
    covariance = np.linalg.inv(jacobian.T @ jacobian + information)
    found = Linearised(np.zeros(5), jacobian, covariance, information)
    left = np.eye(5) - found.hat
    wanted = left @ jacobian @ np.linalg.inv(information) @ jacobian.T @ left
    drawn = found.refitted(np.zeros((40_000, 5)), rng)
    np.testing.assert_allclose(np.cov(drawn.T), wanted, atol=0.03 * np.abs(wanted).max())


def test_equal_sums_share_the_rank_of_the_last():
    """Three first sums are the largest, and rank third; the second sums of the others rank first to third."""
    replicates = np.array([[9.0, 1.0], [9.0, 2.0], [1.0, 8.0], [2.0, 7.0], [3.0, 6.0]])
    assert _p(replicates, np.array([9.0, 0.0])) == 1.0


def test_many_searched_values_without_a_curve_leave_little(right):
    """Of 24 residuals, 11 values take more than 3: the same sum is less likely."""
    objective, score = right
    away = replace(score, statistics=(np.array(score.statistics) + [0.12, 0.0, 0.0]).tolist())
    p = {}
    for count in (2, 10):
        law = external_law([f"a{k}" for k in range(count)])
        outside = OBJECTIVES["classes"](make_material(objective.material.target, np.tile([0.0, 1.0], (count, 1)), law))
        p[count] = result_of(outside, replace(away, parameters=[0.5] * count)).p
    assert 0.05 < p[2] < 0.95
    assert p[10] < 0.5 * p[2]


def test_the_looks_of_a_further_pass_are_those_of_the_same_texture(monkeypatch):
    """In dB the variances of speckle and texture add: trigamma functions of looks, and of the order of texture."""
    monkeypatch.setattr(fit_test, "SharedFields", lambda _: SimpleNamespace(joined=None, residuals=np.concatenate))
    passes = [
        SimpleNamespace(
            moments="bins", material=SimpleNamespace(looks=sensor), moment_residuals=lambda _: lambda _, looks: [looks]
        )
        for sensor in (4.0, 9.0)
    ]
    comparison = SimpleNamespace(passes=passes, material=passes[0].material, in_pass=lambda _, score: score)
    _, of_looks = _all_passes(comparison, None)
    first, second = of_looks(TRUTH, 2.5)
    assert first == pytest.approx(2.5)
    assert polygamma(1, second) == pytest.approx(polygamma(1, 9.0) + polygamma(1, 2.5) - polygamma(1, 4.0), rel=1e-3)
