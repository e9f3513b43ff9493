"""Errors of the incidence, against simulated maps."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import polygamma

from radcal.calibration.incidence_error import (
    attenuation,
    error_behind,
    incidence_warnings,
    law_gap_db,
    registration_error_deg,
    true_nodes,
)
from radcal.calibration.law_fit import LawFit
from radcal.measurement.looks import looks_of_log_variance
from radcal.radar.laws import LAWS, law_for

MANGIA = LAWS["mangia"]


def fit(x, looks=3.0):
    return LawFit(np.array(x, dtype=float), looks, 0.0, np.eye(len(x) + 1), np.eye(len(x) + 1))


LINE = law_for("tabulated", angles_deg=[0.0, 90.0])  # straight: two knots


def test_classical_error_draws_the_true_angle_to_the_mean():
    rng = np.random.default_rng(1)
    true = rng.normal(45.0, 6.0, 400_000)
    mapped = true + rng.normal(0.0, 4.0, true.size)
    share = attenuation(mapped, 4.0)
    assert share == pytest.approx(36.0 / 52.0, rel=0.01)
    near = np.abs(mapped - 52.0) < 0.5
    nodes = true_nodes([[52.0]], 4.0, "classical", float(mapped.mean()), share)
    assert nodes.mean() == pytest.approx(true[near].mean(), abs=0.1)
    assert nodes.std() == pytest.approx(true[near].std(), rel=0.03)


def test_berksons_error_only_spreads():
    nodes = true_nodes([[40.0, 50.0]], 3.0, "berkson", 45.0, 1.0).reshape(2, 5)
    np.testing.assert_allclose(nodes.mean(axis=1), [40.0, 50.0])
    np.testing.assert_allclose(nodes.std(axis=1), 3.0)
    slope = -0.3
    level = LINE(np.radians(nodes[0]), [0.0, 90.0 * slope])
    assert level.var() == pytest.approx((slope * 3.0) ** 2)


def test_no_error_changes_nothing():
    np.testing.assert_array_equal(true_nodes([[40.0, 50.0]], 0.0, "classical", 45.0, 1.0), [[40.0, 50.0]])
    assert attenuation([40.0, 50.0], 0.0) == 1.0


def test_an_error_beyond_the_spread_leaves_something():
    assert attenuation([44.0, 46.0], 10.0) == pytest.approx(0.1)


def test_angles_stay_possible():
    nodes = true_nodes([[1.0, 89.0]], 5.0, "berkson", 45.0, 1.0)
    assert nodes.min() == 0.0
    assert nodes.max() == 90.0


def test_the_gap_is_of_shape():
    incidence = np.linspace(30.0, 50.0, 1000)
    first, higher, steeper = fit([0.0, -27.0]), fit([3.0, -24.0]), fit([0.0, -36.0])
    assert law_gap_db(LINE, first, higher, incidence) == pytest.approx((0.0, 0.0), abs=1e-9)
    gap, errors = law_gap_db(LINE, first, steeper, incidence)
    assert gap == pytest.approx(0.1 * 18.0 / 2.0, rel=1e-6)
    # both ends of both lines are known to 1 dB: the slope to sqrt(2)/90 dB a degree
    assert errors == pytest.approx(0.1 * 90.0 / 2.0, rel=1e-6)
    # of two laws known to 0.5 and to 2 dB the variances add, whichever is the first
    sharp, vague = (replace(law, covariance=sd**2 * np.eye(3)) for law, sd in ((first, 0.5), (steeper, 2.0)))
    for pair in ((sharp, vague), (vague, sharp)):
        apart = law_gap_db(LINE, *pair, incidence)[1]
        assert apart == pytest.approx(0.1 * 90.0 / np.sqrt(2.0 * (0.25 + 4.0)), rel=1e-6)


def test_looks_that_an_error_of_the_incidence_takes():
    """Simulated: slope -0.4 dB/deg, true incidence of sd 6, mapped with an error of 4 degrees, 4 looks."""
    rng = np.random.default_rng(1)
    true = rng.normal(45.0, 6.0, 200_000)
    mapped = true + rng.normal(0.0, 4.0, true.size)
    values = -0.4 * true + 10.0 * np.log10(rng.gamma(4.0, 0.25, true.size))
    slope, level = np.polyfit(mapped, values, 1)
    looks = looks_of_log_variance(float(np.var(values - slope * mapped - level)))
    found = fit([level, level + 90.0 * slope], looks)
    error, bent = error_behind(LINE, found, mapped, 4.0)
    assert error == pytest.approx(4.0, rel=0.03)
    low, high = np.quantile(mapped, [0.05, 0.95])
    assert bent == pytest.approx((0.4 - abs(slope)) * (high - low) / 2.0, rel=0.05)
    assert error_behind(LINE, fit([level, level + 90.0 * slope], 4.2), mapped, 4.0) == (0.0, 0.0)


def test_warnings_name_the_material_and_what_to_look_at():
    incidence = np.linspace(25.0, 50.0, 500)
    flat, steep = [-20.0, 5.0, 0.0, 5.0], [-40.0, 30.0, 0.0, 5.0]
    assert incidence_warnings("field", MANGIA, fit(flat, 4.0), fit(flat), incidence, 4.0) == []
    exact = 1e-4 * np.eye(5)
    known = [replace(fit(x, 4.0), covariance=exact) for x in (flat, steep)]
    (line,) = incidence_warnings("field", MANGIA, *known, incidence, 4.0)
    assert line.startswith("field: the law in incidence-angle bins")
    assert "incidence_error_deg" in line
    # the same difference, badly known
    unknown = [replace(fit(x, 4.0), covariance=900.0 * np.eye(5)) for x in (flat, steep)]
    assert incidence_warnings("field", MANGIA, *unknown, incidence, 4.0) == []
    # no map is off by what would make so few looks on so flat a law
    (line,) = incidence_warnings("field", MANGIA, fit(flat, 1.6), fit(flat), incidence, 4.0)
    assert "1.6 looks, the sensor has 4: texture" in line
    # may be 4 looks: log looks are known to 1, and to 0.3, and ln(4 / 3.2) is 0.22
    hardly = replace(fit(steep, 3.2), covariance=np.diag([1e-4] * 4 + [0.09]))
    for few in (fit(steep, 3.2), hardly):
        assert incidence_warnings("field", MANGIA, few, few, incidence, 4.0) == []
    few = replace(fit(steep, 3.2), covariance=exact)
    (line,) = incidence_warnings("field", MANGIA, few, few, incidence, 4.0)
    assert re.search(r"3\.2 looks, the sensor has 4\. .* error of the local incidence of \d\.\d deg, .* by up to", line)


def test_an_error_as_large_as_the_spread_of_the_map_is_no_explanation():
    """A line of -0.4 dB a degree, and 3 looks of 4: 2.1 dB^2 are missing.

    They ask for an error of 2.8 degrees over 15 degrees of incidence, and of 1.4 degrees, nine tenths of the standard
    deviation of the map, over 5 degrees.
    """
    law = replace(fit([0.0, -36.0], 3.0), covariance=1e-6 * np.eye(3))
    wide, narrow = (np.linspace(40.0 - reach, 40.0 + reach, 2001) for reach in (7.5, 2.6))
    missing = (10.0 / np.log(10.0)) ** 2 * (polygamma(1, 3.0) - polygamma(1, 4.0))
    for incidence in (wide, narrow):
        ratio = missing / 0.4**2 / np.var(incidence)
        error, bent = error_behind(LINE, law, incidence, 4.0)
        assert error == pytest.approx(np.sqrt(np.var(incidence) * ratio / (1.0 + ratio)), rel=1e-3)
        assert bent == pytest.approx(ratio * 0.4 * 0.45 * np.ptp(incidence), rel=1e-3)
    (line,) = incidence_warnings("field", LINE, law, law, wide, 4.0)
    assert "so does an error of the local incidence" in line
    assert incidence_warnings("field", LINE, law, law, narrow, 4.0) == []


def test_the_error_that_a_registration_leaves():
    """On an even slope of 2 degrees a row, half a pixel of displacement in any direction is 0.71 degrees."""
    incidence = np.broadcast_to(20.0 + 2.0 * np.arange(30.0)[:, None], (30, 20)).astype(np.float32)
    pixels = np.arange(600)
    uncertainty = np.full((30, 20), 0.5, dtype=np.float32)
    np.testing.assert_allclose(registration_error_deg(incidence, uncertainty, pixels), 2.0 * 0.5 / np.sqrt(2.0))
    assert not registration_error_deg(incidence, np.zeros_like(uncertainty), pixels).any()
    # displacements drawn at random say the same
    rng = np.random.default_rng(1)
    length = 0.5 * rng.standard_normal(100_000)
    direction = rng.uniform(0.0, 2.0 * np.pi, length.size)
    assert np.std(2.0 * length * np.cos(direction)) == pytest.approx(0.7071, rel=0.02)


def test_edges_have_most_of_the_error_of_a_registration():
    """A ridge: slopes of 0.5 degrees a row, and a jump of 8 degrees between rows 9 and 10."""
    rows = 30.0 + 0.5 * np.arange(20.0) + 8.0 * (np.arange(20) >= 10)
    incidence = np.broadcast_to(rows[:, None], (20, 6)).astype(np.float32).copy()
    incidence[0, 0] = np.nan
    found = registration_error_deg(incidence, np.full((20, 6), 0.4, dtype=np.float32), np.arange(120)).reshape(20, 6)
    np.testing.assert_allclose(found[[4, 15], 3], 0.5 * 0.4 / np.sqrt(2.0), rtol=1e-6)
    np.testing.assert_allclose(found[[9, 10], 3], 4.5 * 0.4 / np.sqrt(2.0), rtol=1e-6)  # central difference
    # beside a place without incidence: root mean square of the rest
    rest = np.ones((20, 6), dtype=bool)
    rest[[0, 1, 0], [0, 0, 1]] = False
    assert found[1, 0] == pytest.approx(np.sqrt((found[rest] ** 2).mean()))


def test_each_place_is_attenuated_by_its_own_error():
    """Two halves of a map, with errors of 2 and of 5 degrees."""
    rng = np.random.default_rng(3)
    true = rng.normal(45.0, 6.0, 400_000)
    error = np.where(np.arange(true.size) % 2, 2.0, 5.0)
    mapped = true + error * rng.normal(size=true.size)
    share = attenuation(mapped, [2.0, 5.0], float(np.sqrt(np.mean(error**2))))
    np.testing.assert_allclose(share, [36.0 / 40.0, 36.0 / 61.0], rtol=0.01)
    nodes = true_nodes([[52.0], [52.0]], [2.0, 5.0], "classical", float(mapped.mean()), share)
    for row, size in zip(nodes, (2.0, 5.0), strict=True):
        near = (np.abs(mapped - 52.0) < 0.5) & (error == size)
        assert row.mean() == pytest.approx(true[near].mean(), abs=0.1)
        assert row.std() == pytest.approx(true[near].std(), rel=0.03)
