"""The three objectives, against simulation and direct likelihoods."""

from __future__ import annotations

import numpy as np
import pytest
from radcal.calibration.objective import (
    ClassesObjective,
    DensityObjective,
    LikelihoodObjective,
    sampling_covariance,
)
from scipy import stats

from radcal.calibration.expected import LawForward, expected_cumulants, law_cumulants
from radcal.measurement.classes import class_cumulants, make_classes
from radcal.radar.laws import LAWS
from radcal.radar.texture import log_speckle_cumulants

LAW = LAWS["mangia"]
X = np.array([-30.0, 18.0, 5.0, 5.0])


def speckled(rng, incidence_deg, looks, x=X):
    n = incidence_deg.size
    return LAW(np.radians(incidence_deg), x) + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, n))


def test_sampling_covariance_is_that_of_log_gamma_samples():
    rng = np.random.default_rng(1)
    n, draws = 1500, 4000
    values = 10.0 * np.log10(rng.gamma(3.0, 1.0 / 3.0, (draws, n)))
    statistics = np.stack([values.mean(axis=1), np.log(values.std(axis=1)), stats.skew(values, axis=1)])
    found = sampling_covariance(float(log_speckle_cumulants(3.0)[1]), n)
    wanted = np.cov(statistics)
    np.testing.assert_allclose(np.diagonal(found), np.diagonal(wanted), rtol=0.08)
    sd = np.sqrt(np.diagonal(wanted))
    np.testing.assert_allclose(found / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=0.08)


def test_the_law_forward_is_what_pixels_show():
    rng = np.random.default_rng(2)
    incidence = rng.uniform(25.0, 50.0, 200_000)
    classes = make_classes(speckled(rng, incidence, 4.0), incidence, 5)
    found = LawForward(LAW, classes.nodes_deg, 4.0)(X)
    np.testing.assert_allclose(found[:, 0], classes.cumulants[:, 0], atol=0.05)
    np.testing.assert_allclose(found[:, 1], classes.cumulants[:, 1], rtol=0.04)
    np.testing.assert_allclose(found[:, 2], classes.cumulants[:, 2], rtol=0.15)


def test_cumulants_at_other_looks_are_those_of_a_run_at_other_looks():
    nodes = np.linspace(20.0, 50.0, 24).reshape(2, 12)
    moved = expected_cumulants(LawForward(LAW, nodes, 4.0)(X), 4.0, 2.5)
    np.testing.assert_allclose(moved, LawForward(LAW, nodes, 2.5)(X), rtol=1e-12)


def one_patch(classes):
    return ClassesObjective(classes, np.ones((classes.size, 1)), np.eye(classes.size), 0.0, 0.0)


def test_residuals_at_the_truth_have_unit_variance():
    squares = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        incidence = rng.normal(40.0, 6.0, 1000)
        classes = make_classes(speckled(rng, incidence, 4.0), incidence, 5)
        residuals = one_patch(classes).residuals(LawForward(LAW, classes.nodes_deg, 4.0)(X))
        squares.append(residuals[:10] ** 2)  # of means and spreads: skewnesses are weighted down
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)


def test_a_patch_in_all_classes_hides_the_level_and_not_the_slope():
    rng = np.random.default_rng(3)
    incidence = rng.normal(40.0, 6.0, 3000)
    classes = make_classes(speckled(rng, incidence, 4.0), incidence, 5)
    expected = LawForward(LAW, classes.nodes_deg, 4.0)(X)
    level, slope = expected.copy(), expected.copy()
    level[:, 0] += 1.0
    slope[:, 0] += np.linspace(-1.0, 1.0, 5)
    alone = one_patch(classes)
    shared = ClassesObjective(classes, np.ones((5, 1)), np.eye(5), 1.0, 0.0)

    def excess(objective, moved):
        return (objective.residuals(moved) ** 2).sum() - (objective.residuals(expected) ** 2).sum()

    assert excess(shared, level) < 0.05 * excess(alone, level)
    assert excess(shared, slope) == pytest.approx(excess(alone, slope), rel=0.15)


def test_patches_inside_of_a_class_widen_it():
    classes = make_classes(np.random.default_rng(4).normal(size=300), np.linspace(20, 40, 300), 1)
    objective = ClassesObjective(classes, np.full((1, 4), 0.25), np.full((1, 10), 0.1), 2.0, 1.0)
    assert objective.patch_variance[0] == pytest.approx(4.0 * 0.75 + 0.9)


def test_the_likelihood_is_the_pixels_own():
    rng = np.random.default_rng(5)
    incidence = np.full(4000, 40.0)
    values = speckled(rng, incidence, 3.0)
    classes = make_classes(values, incidence, 1, independent=0.5)
    objective = LikelihoodObjective(classes, values)

    def direct(level_db, looks):
        power = 10.0 ** (values / 10.0)
        return 0.5 * stats.gamma(looks, scale=10.0 ** (level_db / 10.0) / looks).logpdf(power).sum()

    level = float(LAW(np.radians(40.0), X))
    places = [(level, 3.0), (level + 0.3, 3.0), (level, 2.6), (level - 0.2, 3.4)]
    cost = [-0.5 * (objective.residuals(np.array([[at]]), looks) ** 2).sum() for at, looks in places]
    wanted = [direct(at, looks) for at, looks in places]
    np.testing.assert_allclose(np.array(cost) - cost[0], np.array(wanted) - wanted[0], rtol=0.05)


def test_the_density_objective_vanishes_where_mean_spread_and_skewness_agree():
    expected = np.array([[-20.0, 9.0, -8.1]])
    assert np.abs(DensityObjective([-20.0, 3.0, -0.3], 100.0).residuals(expected)).max() < 1e-12
    assert DensityObjective([-20.3, 3.0, -0.3], 100.0).residuals(expected)[0] == pytest.approx(1.0)


def test_law_cumulants_are_moments_over_the_angles():
    nodes = np.linspace(20.0, 50.0, 30)[None]
    level = LAW(np.radians(nodes[0]), X)
    np.testing.assert_allclose(
        law_cumulants(LAW, X, nodes), class_cumulants(level, np.zeros(30, dtype=int), 1), rtol=1e-12
    )
