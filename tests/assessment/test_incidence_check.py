"""Signs of an error of the incidence in a fitted law, against laws and maps of known error."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import polygamma

from radcal.assessment.incidence_check import error_behind, incidence_warnings
from radcal.calibration.law_fit import LawFit
from radcal.measurement.looks import looks_of_log_variance
from radcal.radar.laws import LAWS, law_for

MANGIA = LAWS["mangia"]
LINE = law_for("tabulated", angles_deg=[0.0, 90.0])  # straight: two knots


def fit(x, looks=3.0):
    return LawFit(np.array(x, dtype=float), looks, 0.0, np.eye(len(x) + 1), np.eye(len(x) + 1))


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
    assert incidence_warnings("field", MANGIA, fit(flat, 4.0), incidence, 4.0) == []
    exact = 1e-4 * np.eye(5)
    # no map is off by what would make so few looks on so flat a law
    (line,) = incidence_warnings("field", MANGIA, fit(flat, 1.6), incidence, 4.0)
    assert "1.6 looks, the sensor has 4: texture" in line
    # may be 4 looks: log looks are known to 1, and to 0.3, and ln(4 / 3.2) is 0.22
    hardly = replace(fit(steep, 3.2), covariance=np.diag([1e-4] * 4 + [0.09]))
    for few in (fit(steep, 3.2), hardly):
        assert incidence_warnings("field", MANGIA, few, incidence, 4.0) == []
    few = replace(fit(steep, 3.2), covariance=exact)
    (line,) = incidence_warnings("field", MANGIA, few, incidence, 4.0)
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
    (line,) = incidence_warnings("field", LINE, law, wide, 4.0)
    assert "so does an error of the local incidence" in line
    assert incidence_warnings("field", LINE, law, narrow, 4.0) == []
