"""Objective of one density, against the definition of its rms."""

import numpy as np
import pytest
from calibration_samples import BOUNDS, TRUTH, make_material, make_target

from radcal import skewnormal
from radcal.inference.moments import from_dp, to_dp
from radcal.laws import LAWS
from radcal.objectives.base import PredictedPoints
from radcal.objectives.density import Density

LAW = LAWS["mangia"]
X = np.array(TRUTH["field"])
N = 20_000


def made(law=LAW, noise_db=-np.inf, **changes):
    rng = np.random.default_rng(1)
    incidence = np.clip(rng.normal(40.0, 6.0, N), 15.0, 70.0)
    level = 10.0 ** (LAW(np.radians(incidence), X) / 10.0) + 10.0 ** (noise_db / 10.0)
    values = 10.0 * np.log10(level * rng.gamma(4.0, 0.25, N))
    target = make_target(values, incidence, noise_db=noise_db)
    return Density(make_material(target, BOUNDS, law, **changes))


@pytest.fixture(scope="module")
def density():
    return made()


def points(statistics):
    rows = np.atleast_2d(statistics)[:, None]
    return PredictedPoints(rows, np.tile(X, (len(rows), 1)), np.full(len(rows), 4.0))


def test_residuals_vanish_where_mean_spread_and_skewness_agree(density):
    at = from_dp(density.material.target.dp)
    assert np.abs(density.residuals(points(at))).max() < 1e-12
    assert density.cost(points(at))[0] < 1e-12
    # standard errors of a normal sample but for 1/sqrt(n): sd, 1/sqrt(2), sqrt(6)
    moved = density.residuals(points(at + [1.0, 0.1, -0.2]))[0]
    np.testing.assert_allclose(moved, [np.exp(-at[1]), 0.1 * np.sqrt(2.0), -0.2 / np.sqrt(6.0)], rtol=1e-9)


def test_cost_is_the_rms_of_the_densities_and_refined_residuals_have_it_as_their_square(density):
    at = from_dp(density.material.target.dp) + [0.7, 0.1, 0.3]
    rms = skewnormal.density_rms(to_dp(at), density.material.target.dp)
    assert density.cost(points(at))[0] == pytest.approx(rms, rel=5e-3)  # 200 points in place of 1,000
    differences = density.refined(points(at))[0]
    largest = skewnormal.density(np.linspace(-60.0, 10.0, 5000), density.material.target.dp).max()
    assert np.sqrt(np.mean(differences**2)) * largest == pytest.approx(density.cost(points(at))[0], rel=1e-3)


@pytest.mark.parametrize("noise_db", [-np.inf, -22.0])
def test_the_baseline_is_what_pixels_of_law_noise_and_speckle_show(noise_db):
    """Noise is added to the backscatter, and both have speckle."""
    objective = made(noise_db=noise_db)
    shown = objective.statistics(objective.material.target.values_db)
    expected = objective.baseline(X)
    np.testing.assert_allclose(expected[0, 0], shown[0, 0], atol=0.08)
    np.testing.assert_allclose(expected[0, 1], shown[0, 1], atol=0.02)
    np.testing.assert_allclose(expected[0, 2], shown[0, 2], atol=0.1)
    assert np.abs(made().baseline(X)[0, 0] - expected[0, 0]) > 0.3 or noise_db < -30.0


def test_statistics_are_those_of_the_fitted_density_of_any_pixels(density):
    values = density.material.target.values_db
    some = np.arange(0, N, 3)
    np.testing.assert_allclose(density.statistics(values, some), density.statistics(values[some]))
    np.testing.assert_allclose(density.statistics(values)[0], from_dp(density.material.target.dp), atol=1e-9)


def test_a_law_of_the_simulator_alone_and_normalised_images_have_no_baseline():
    assert made(law=None).baseline is None
    assert made(decibels=False).baseline is None


def test_half_the_best_rms_is_promising(density):
    assert density.promising(np.array([0.049, 0.051]), 0.1).tolist() == [True, False]
