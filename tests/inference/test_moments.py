"""Statistics of dB values, against scipy's sample moments and its skew normal."""

import numpy as np
import pytest
from scipy import stats

from radcal.inference.moments import (
    from_cumulants,
    from_dp,
    sampling_covariance,
    to_cumulants,
    to_dp,
)
from radcal.speckle.texture import log_speckle_cumulants

VALUES = np.random.default_rng(3).gamma(2.0, 1.5, (2, 400)) * [[1.0], [-2.0]] - 7.0


def moments(values):
    """Mean, log sd and skewness of rows, by scipy, biased like cumulants of all values."""
    return np.stack([values.mean(axis=1), np.log(values.std(axis=1)), stats.skew(values, axis=1)], axis=-1)


def cumulants(values):
    return np.stack([values.mean(axis=1), stats.moment(values, 2, axis=1), stats.moment(values, 3, axis=1)], axis=-1)


def test_cumulants_and_statistics_are_those_of_a_sample():
    np.testing.assert_allclose(from_cumulants(cumulants(VALUES)), moments(VALUES), rtol=1e-12)
    np.testing.assert_allclose(to_cumulants(moments(VALUES)), cumulants(VALUES), rtol=1e-12)


@pytest.mark.parametrize("dp", [(-12.0, 3.0, -2.0), (4.0, 0.5, 1.3)])
def test_densities_have_the_moments_of_scipys_skew_normal(dp):
    xi, omega, alpha = dp
    mean, variance, skewness = stats.skewnorm(alpha, loc=xi, scale=omega).stats(moments="mvs")
    wanted = [mean, 0.5 * np.log(variance), skewness]
    np.testing.assert_allclose(from_dp(dp), wanted, rtol=1e-9)
    np.testing.assert_allclose(to_dp([wanted, wanted]), [dp, dp], rtol=1e-6)


def test_skewness_out_of_reach_is_drawn_to_the_limit():
    dp = to_dp([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]])
    assert np.isfinite(dp).all()
    assert dp[0, 2] == -dp[1, 2] > 30
    np.testing.assert_allclose(from_dp(dp)[:, 2], [0.995, -0.995], atol=1e-9)


def test_spreads_out_of_all_bounds_stay_finite():
    assert np.isfinite(to_cumulants([0.0, 1e4, 0.5])).all()
    assert np.isfinite(to_dp([0.0, -1e4, 0.5])).all()


def test_sampling_covariance_is_that_of_log_gamma_samples():
    rng = np.random.default_rng(1)
    n, draws = 1000, 2000
    values = 10.0 * np.log10(rng.gamma(3.0, 1.0 / 3.0, (draws, n)))
    variance = float(log_speckle_cumulants(3.0)[1])
    # about levels that are the same in all samples, those of no spread and those that spread as much as the speckle
    for levels in (0.0, variance):
        at = np.sqrt(levels) * stats.norm.ppf((np.arange(n) + 0.5) / n)
        found = sampling_covariance(variance, n, levels)
        wanted = np.cov(moments(values + at).T)
        np.testing.assert_allclose(np.diagonal(found), np.diagonal(wanted), rtol=0.1)
        sd = np.sqrt(np.diagonal(wanted))
        np.testing.assert_allclose(found / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=0.08)
