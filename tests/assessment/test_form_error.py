"""Errors of form that the test of the fit misses: against a non-central chi-squared law, and a real refit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, stats

from radcal.assessment import form_error
from radcal.assessment.form_error import _bumps, _found_size, missed_error_db
from radcal.assessment.linear_fit import linearised
from radcal.calibration.expected import LawForward
from radcal.calibration.grounds import curve_prior, fit_grounds
from radcal.calibration.law_fit import fit_law
from radcal.calibration.misfit import BinMisfit, Method
from radcal.measurement.ground import Ground
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
BOX = np.array([[-60.0, 0.0], [0.0, 40.0], [0.0, 25.0], [0.5, 20.0]])
TRUTH = np.array([-28.0, 20.0, 6.0, 4.0])
LOOKS = 4.0
SEEN = (24.0, 48.5)


def fitted(pixels=1000, fields=10, between=0.8):
    """Bins of a ground with a right law, residuals of its law, and the linearised fit."""
    rng = np.random.default_rng(3)
    incidence = rng.uniform(22.0, 50.0, pixels)
    patch = rng.integers(fields, size=pixels)
    level = LAW(np.radians(incidence), TRUTH) + (between * rng.normal(size=fields))[patch]
    values = level + 10.0 * np.log10(rng.gamma(LOOKS, 1.0 / LOOKS, pixels))
    ground = Ground(values, incidence, patch, rng.integers(2, size=pixels))
    found = fit_grounds({"area": ground}, {"area": Method(LAW, BOX, LOOKS)})["area"]
    moments = BinMisfit.of(ground, found.classes, found.method, found.spread)
    forward = LawForward(LAW, found.classes.nodes_deg, LOOKS)

    def residuals(x, looks):
        return moments(x, looks, forward(x))

    x, looks = found.fit.parameters, found.fit.looks
    line = linearised(residuals, x, looks, BOX, LOOKS, found.fit.prior_information)
    return moments, residuals, found.fit, line, curve_prior(ground, found.method)


@pytest.fixture(scope="module")
def ground():
    return fitted()


def sum_rejects(left):
    return (left**2).sum(axis=-1) > stats.chi2(20).ppf(0.99)


def test_a_shift_is_enlarged_until_nine_of_ten_white_residuals_are_rejected():
    rng = np.random.default_rng(1)
    left, shift = rng.normal(size=(20_000, 20)), rng.normal(size=20) * 0.3
    wanted = optimize.brentq(lambda nc: stats.ncx2.sf(stats.chi2(20).ppf(0.99), 20, nc) - 0.9, 1.0, 200.0)
    assert _found_size(shift, left, sum_rejects) == pytest.approx(np.sqrt(wanted) / np.linalg.norm(shift), rel=0.03)
    assert _found_size(0.0 * shift, left, sum_rejects) == form_error._LARGEST_DB


def test_bumps_lie_over_the_whole_incidence_seen():
    angle = np.linspace(20.0, 52.0, 3201)
    sizes = np.array([bump(angle) for bump in _bumps(20.0, 52.0)])
    np.testing.assert_allclose(angle[sizes.argmax(axis=1)], [20.0, 28.0, 36.0, 44.0, 52.0] * 2, atol=0.02)
    half = [np.ptp(angle[one > 0.5]) for one in (sizes[2], sizes[7])]
    np.testing.assert_allclose(half, 2.0 * np.sqrt(2.0 * np.log(2.0)) * np.array([4.0, 8.0]), rtol=0.01)


def test_the_error_of_a_law_is_what_a_real_refit_leaves_of_a_bump(ground, monkeypatch):
    moments, residuals, fit, line, prior = ground
    x, looks = fit.parameters, fit.looks

    def bump(deg):
        return np.exp(-0.5 * ((deg - 33.0) / 3.0) ** 2)

    monkeypatch.setattr(form_error, "_bumps", lambda *_: [bump])
    monkeypatch.setattr(form_error, "_found_size", lambda *_: 0.4)
    found = missed_error_db(line, moments, np.zeros((1, 24)), sum_rejects, LAW, x, BOX, SEEN)
    measured = np.zeros((moments.classes.size, 3))
    measured[:, 0] = 0.4 * bump(moments.classes.nodes_deg).mean(axis=1)
    away = moments.whitened(measured)
    # the bump raises the measured means; both fits start at the law without it
    before, after = (
        fit_law(lambda p, n, d=d: residuals(p, n) - d, BOX, LOOKS, start=(x, looks), prior=prior).parameters
        for d in (0.0, away)
    )
    angle = np.linspace(*SEEN, 41)
    change = LAW(np.radians(angle), after) - LAW(np.radians(angle), before)
    assert found == pytest.approx(np.abs(0.4 * bump(angle) - change).max(), rel=0.15)
    assert 0.1 < found < 0.35


def test_more_pixels_show_smaller_errors_of_form(ground):
    def missed(found):
        moments, _, fit, line, _ = found
        left = line.refitted(moments.replicates(300, np.random.default_rng(1)), np.random.default_rng(2))
        limit = np.quantile((left**2).sum(axis=1), 0.99)
        return missed_error_db(
            line, moments, left, lambda one: (one**2).sum(axis=-1) > limit, LAW, fit.parameters, BOX, SEEN
        )

    few, many = missed(ground), missed(fitted(pixels=9000))
    assert 0.8 < few < 3.0
    assert many == pytest.approx(few / 3.0, rel=0.4)
