"""Prior of the variation of fields: against half-t laws, which half-normal laws with a common scale give."""

from __future__ import annotations

import numpy as np
import pytest
from posterior_samples import made_bins, made_model
from scipy import stats

from radcal.assessment.field_prior import FieldPrior
from radcal.measurement.patches import GRID_DB

SHARES = np.array([0.05, 0.3, 0.5, 0.9, 0.97])
BOTH = np.stack([SHARES, SHARES], axis=-1)


def table_of(between=None, within=None):
    """Log likelihood with narrow peaks at the nearest standard deviations of the grid; None: nothing is known."""
    found = np.zeros((GRID_DB.size, GRID_DB.size))
    for axis, tau in ((0, between), (1, within)):
        if tau is not None:
            away = np.where(np.arange(GRID_DB.size) == np.abs(GRID_DB - tau).argmin(), 0.0, -500.0)
            found += away[:, None] if axis == 0 else away
    return found


def half_t(share, freedom, scale=1.0, field_db=0.5):
    """Quantiles in units of the scale of the prior, of a half-t distribution that ends just below 6 dB."""
    law = stats.t(freedom, scale=scale)
    return law.ppf(0.5 + share * (law.cdf(0.99 * 6.0 / field_db) - 0.5))


@pytest.mark.parametrize("others", [[], [table_of()], [table_of()] * 4])
def test_other_fields_that_tell_nothing_leave_the_half_t_prior(others):
    found = FieldPrior(0.3, others).quantiles(BOTH)
    np.testing.assert_allclose(found, np.stack([half_t(SHARES, 2.0, field_db=0.3)] * 2, axis=-1), rtol=0.015)


def test_others_whose_fields_do_not_differ_add_their_number_to_the_degrees_of_freedom():
    """The variance of five zeros is 0 of 5 degrees: half-t with 7 degrees, and 2/7 of the squared scale."""
    found = FieldPrior(0.5, [table_of(0.0, 0.0)] * 5).quantiles(BOTH)
    wanted = half_t(SHARES, 7.0, np.sqrt(2.0 / 7.0))
    np.testing.assert_allclose(found, np.stack([wanted] * 2, axis=-1), rtol=0.015)


def test_fields_that_differ_much_widen_the_prior_between_and_not_within():
    tau = float(GRID_DB[np.abs(GRID_DB - 1.0).argmin()])
    between, within = FieldPrior(0.5, [table_of(between=tau)] * 3).quantiles(BOTH).T
    square = (2.0 + 3.0 * (tau / 0.5) ** 2) / 5.0
    np.testing.assert_allclose(between[:4], half_t(SHARES[:4], 5.0, np.sqrt(square)), rtol=0.03)
    np.testing.assert_allclose(within, half_t(SHARES, 2.0), rtol=0.015)


def test_no_standard_deviation_lies_beyond_its_table():
    almost = np.full((1, 2), 1.0 - 1e-9)
    for others in ([], [table_of(6.0, 6.0)] * 3):
        assert FieldPrior(0.5, others).quantiles(almost).max() < 6.0 / 0.5
    assert np.isfinite(FieldPrior(0.0, [table_of(0.0, 0.0)]).quantiles(BOTH)).all()


def test_a_model_draws_its_fields_from_the_prior_that_the_others_leave():
    bins, others = made_bins(), [table_of(0.0, 0.0)] * 5
    rng = np.random.default_rng(1)
    for given, wanted in (([], half_t(0.5, 2.0, 0.4)), (others, half_t(0.5, 7.0, 0.4 * np.sqrt(2.0 / 7.0)))):
        model = made_model(bins, others=given, field_db=0.4)
        drawn = model.unknowns(model.dispersed(20_000, rng))
        assert np.median(drawn.between_db) == pytest.approx(wanted, rel=0.04)
        assert np.median(drawn.within_db) == pytest.approx(wanted, rel=0.04)
