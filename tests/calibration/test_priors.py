"""Priors on the curve, against scipy's densities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from radcal.calibration.priors import CurvePrior, looks_residuals
from radcal.radar.laws import LAWS, law_for

MANGIA = LAWS["mangia"]


def log_density(residual):
    return -0.5 * residual**2


def line(slope):
    """Knots of a straight curve through -15 dB at 37.5 degrees [dB/deg]."""
    angles = [15.0, 30.0, 45.0, 75.0]
    return law_for("tabulated", angles_deg=angles), [-15.0 - slope * (angle - 37.5) for angle in angles]


def test_the_slope_has_the_log_normal_density():
    values = np.array([0.05, 0.1, 0.2, 0.5, 1.0])
    found = []
    for slope in values:
        law, x = line(slope)
        found.append(log_density(CurvePrior(law, -15.0, 37.5).residuals(x)[0]))
    wanted = stats.lognorm(0.95, scale=0.2).logpdf(values)
    np.testing.assert_allclose(np.diff(found), np.diff(wanted), atol=1e-6)


def test_x4_has_the_log_normal_density_and_is_mangias_alone():
    values = np.array([0.5, 5.0, 20.0])
    prior = CurvePrior(MANGIA, 0.0, 40.0)
    found = [log_density(prior.residuals([0.0, 5.0, 5.0, x4])[-1]) for x4 in values]
    np.testing.assert_allclose(np.diff(found), np.diff(stats.lognorm(1.0, scale=5.0).logpdf(values)), atol=1e-9)
    law, x = line(0.2)
    assert CurvePrior(law, 0.0, 40.0).residuals(x).size == prior.residuals([0.0, 5.0, 5.0, 5.0]).size - 1


def test_a_rising_curve_has_a_finite_and_growing_price():
    prices = []
    for slope in (0.05, 0.0, -0.05, -0.1):
        law, x = line(slope)
        prices.append(CurvePrior(law, -15.0, 37.5).residuals(x)[0] ** 2)
    assert np.isfinite(prices).all()
    assert prices[1] < prices[2] < prices[3]
    assert prices[0] < prices[1]


@pytest.mark.parametrize("slope", [0.015, 0.0, -0.1])
def test_below_a_fiftieth_of_a_db_a_degree_the_logarithm_goes_on_as_its_tangent(slope):
    law, x = line(slope)
    log = np.log(0.02) + (slope - 0.02) / 0.02
    found = CurvePrior(law, -15.0, 37.5).residuals(x)[0]
    assert found == pytest.approx((log - np.log(0.2)) / 0.95 + 0.95, rel=1e-9)


@pytest.mark.parametrize("x4", [0.07, 0.0])
def test_below_a_fiftieth_of_its_median_x4_has_the_same_tangent(x4):
    found = CurvePrior(MANGIA, 0.0, 40.0).residuals([0.0, 5.0, 5.0, x4])[-1]
    assert found == pytest.approx(np.log(0.1) + (x4 - 0.1) / 0.1 - np.log(5.0) + 1.0, rel=1e-9)


def test_level_is_normal_about_the_measured_mean():
    law, x = line(0.2)
    assert CurvePrior(law, -25.0, 37.5).residuals(x)[1] == pytest.approx(1.0)


def test_a_curve_of_impossible_range_is_priced():
    usual = CurvePrior(MANGIA, -15.0, 40.0).residuals([-30.0, 15.0, 5.0, 5.0])
    steep = CurvePrior(MANGIA, -15.0, 40.0).residuals([-120.0, 130.0, 5.0, 5.0])
    assert not usual[2:-1].any()
    # 35 dB below the measured mean everywhere, of which 32.5 are free; above it the same
    law, x = line(0.0)
    for level in (20.0, -50.0):
        np.testing.assert_allclose(CurvePrior(law, level, 37.5).residuals(x)[2:], 2.5)
    assert (steep[2:-1] ** 2).sum() > 100.0


def test_looks_are_log_normal_about_nearly_the_sensors():
    assert looks_residuals(3.6, 4.0)[0] == pytest.approx(0.0)
    assert looks_residuals(3.6 * np.exp(-0.6), 4.0)[0] == pytest.approx(-1.0)
