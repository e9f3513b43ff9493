import numpy as np
import pytest
from scipy import stats

from radcal import skewnormal
from radcal.ground.goodness import anderson_darling, goodness_of_fit, kolmogorov_smirnov


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_distances_are_those_of_scipy(sign):
    """Mirrored, the largest difference lies on the other side of a step."""
    values = np.sort(sign * np.random.default_rng(1).normal(-10.0, 3.0, 400))
    fitted = stats.norm(-10.2 * sign, 2.9)
    dp = (-10.2 * sign, 2.9, 0.0)
    ks, ad = kolmogorov_smirnov(values, dp), anderson_darling(values, dp)
    assert ks == pytest.approx(stats.kstest(values, fitted.cdf).statistic, rel=1e-9)
    # the definition as an integral, weighted by 1 / (F (1 - F)), step by step between the values
    f = np.concatenate([[1e-15], fitted.cdf(values), [1 - 1e-15]])
    share = np.arange(values.size + 1) / values.size
    integral = share**2 * np.diff(np.log(f / (1 - f))) + 2 * share * np.diff(np.log(1 - f)) - np.diff(f + np.log(1 - f))
    assert ad == pytest.approx(values.size * integral.sum(), rel=1e-6)


@pytest.mark.slow
def test_p_values_of_fitted_samples_are_uniform():
    rng = np.random.default_rng(2)
    p = []
    for _ in range(60):
        x = skewnormal.sample((-12.0, 4.0, -2.0), 200, rng)
        p.append(goodness_of_fit(x, skewnormal.fit(x).dp, rng, draws=39).ad_p)
    assert stats.kstest(p, "uniform").pvalue > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        np.concatenate([np.random.default_rng(3).normal(-20, 2, 500), np.random.default_rng(4).normal(-8, 2, 500)]),
        np.random.default_rng(5).standard_t(2.5, 1000),
        np.random.default_rng(6).uniform(0, 1, 1000),
    ],
    ids=["two grounds", "heavy tails", "uniform"],
)
def test_what_is_no_skew_normal_is_told(values):
    found = goodness_of_fit(values, skewnormal.fit(values).dp, np.random.default_rng(0))
    assert found.ad_p == 0.01  # the sample itself is one of a hundred
    assert found.ks > 0.02


def test_fewer_independent_values_are_less_evidence():
    x = np.random.default_rng(8).standard_t(5, 1500)
    dp = skewnormal.fit(x).dp
    many, few = (goodness_of_fit(x, dp, np.random.default_rng(0), effective=n) for n in (1500, 60))
    assert many.ks == few.ks
    assert many.ad_p < few.ad_p
