"""Priors on the curve, against scipy's densities."""

import numpy as np
import pytest
from scipy import stats

from radcal.inference.priors import CurvePrior, looks_residuals
from radcal.laws import LAWS, law_for

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


@pytest.mark.parametrize("level", [-15.0, 40.0])  # the level of the image does not matter
def test_the_density_of_a_curve_is_proportional_to_the_room_that_its_span_leaves_of_65_db(level):
    angles = [20.0, 45.0, 70.0]
    law = law_for("tabulated", angles_deg=angles)
    found = [
        CurvePrior(law, level, 20.0).residuals([level, level - 0.7 * span, level - span])[2]
        for span in (8.0, 25.0, 55.0)
    ]
    np.testing.assert_allclose(np.diff([log_density(r) for r in found]), np.diff(np.log([57.0, 40.0, 10.0])), atol=1e-9)


def test_the_span_of_a_curve_that_rises_and_falls_lies_between_its_extremes():
    law = law_for("tabulated", angles_deg=[20.0, 45.0, 70.0])
    wide, flat = (log_density(CurvePrior(law, -10.0, 20.0).residuals(x)[2]) for x in ([-10.0, 5.0, -25.0], [-9.0] * 3))
    assert wide - flat == pytest.approx(np.log(35.0 / 65.0), abs=1e-9)


def test_beyond_a_span_of_60_db_the_log_density_decreases_linearly():
    law = law_for("tabulated", angles_deg=[20.0, 70.0])
    found = [log_density(CurvePrior(law, 0.0, 20.0).residuals([0.0, -span])[2]) for span in (60.0, 75.0, 100.0)]
    np.testing.assert_allclose(np.diff(found), [-15.0 / 5.0, -25.0 / 5.0], rtol=1e-9)


def test_looks_are_log_normal_about_nearly_the_sensors():
    assert looks_residuals(3.6, 4.0)[0] == pytest.approx(0.0)
    assert looks_residuals(3.6 * np.exp(-0.6), 4.0)[0] == pytest.approx(-1.0)
