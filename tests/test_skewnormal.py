"""The skew normal against scipy.stats.skewnorm, which shares no code with it."""

import numpy as np
import pytest
from scipy import integrate, stats

from radcal import skewnormal
from radcal.errors import FitError
from radcal.skewnormal import likelihood

DP = [(0.0, 1.0, 0.0), (-3.0, 2.5, 4.0), (12.0, 0.3, -1.5), (40.0, 8.0, -30.0), (1.0, 1.0, 1e-5)]


def test_density_far_in_the_thin_tail_is_positive_and_finite():
    assert skewnormal.density(-3.0, (0.0, 1.0, 8.0)) > 0.0
    assert np.isfinite(skewnormal.log_likelihood([-40.0], (0.0, 1.0, 8.0)))


def test_parametrisations_work_on_stacks():
    stack = np.array(DP[:4]).reshape(2, 2, 3)
    np.testing.assert_allclose(skewnormal.direct(skewnormal.centred(stack)), stack, rtol=1e-9, atol=1e-9)


def test_largest_skewness_is_that_of_the_half_normal():
    assert pytest.approx(float(stats.halfnorm.stats(moments="s")), rel=1e-12) == skewnormal.MAX_SKEWNESS
    assert round(skewnormal.MAX_SKEWNESS, 5) == 0.99527


@pytest.mark.parametrize("cp", [(0, 0, 0), (0, -1, 0), (0, 1, 0.9953), (0, 1, -1.2)])
def test_unreachable_centred_parameters_are_refused(cp):
    with pytest.raises(ValueError, match="0.99527"):
        skewnormal.direct(cp)


def test_omega_must_be_positive():
    with pytest.raises(ValueError, match="omega > 0"):
        skewnormal.centred((0.0, 0.0, 1.0))


def test_single_precision_samples_fit():
    x = stats.skewnorm.rvs(2.0, 20.0, 3.0, size=500, random_state=5)
    np.testing.assert_allclose(skewnormal.fit(x.astype(np.float32)).cp, skewnormal.fit(x).cp, atol=1e-4)


@pytest.mark.parametrize(
    ("sample", "words"),
    [
        ([], "at least 8 values, found 0"),
        (np.arange(7.0), "at least 8 values, found 7"),
        (np.full(100, -12.5), "all 100 are -12.5 dB"),
        (np.zeros(100), "all 100 are 0 dB"),
        (np.r_[np.arange(20.0), np.nan, np.nan], "found 2 that are not"),
        (np.r_[np.arange(20.0), -np.inf], "found 1 that are not"),
    ],
)
def test_unfit_samples_are_refused(sample, words):
    with pytest.raises(FitError, match=words):
        skewnormal.fit(sample)


@pytest.mark.parametrize("distance", [skewnormal.hellinger, skewnormal.kolmogorov_smirnov])
def test_unitless_distances_are_symmetric_invariant_and_at_most_one(distance):
    a, b = np.array([0.0, 2.0, 4.0]), np.array([1.0, 3.0, -2.0])
    assert distance(a, b) == pytest.approx(distance(b, a), abs=1e-12)
    scaled = distance(a * [10, 10, 1] + [7, 0, 0], b * [10, 10, 1] + [7, 0, 0])
    assert scaled == pytest.approx(distance(a, b), abs=1e-9)
    assert distance(a, (1000.0, 1.0, 0.0)) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_half_normal_limit_is_fitted_where_the_likelihood_grows_up_to_it(sign):
    x = sign * np.abs(np.random.default_rng(5).standard_normal(60)) * 3.0 + 7.0
    found = skewnormal.fit(x)
    assert found.at_boundary
    # closed form: the edge is the smallest value, omega the root mean square distance from it
    edge = sign * (sign * x).min()
    assert found.dp[0] == pytest.approx(edge, abs=1e-4)
    assert found.dp[1] == pytest.approx(np.sqrt(np.mean((x - edge) ** 2)), rel=1e-6)
    # no large alpha does better
    best = max(
        stats.skewnorm.logpdf(x, sign * alpha, edge - sign * 3.0 * shift / alpha, found.dp[1]).mean()
        for alpha in (1e2, 1e3, 1e4, 1e5)
        for shift in (0.5, 1.0, 2.0, 4.0)
    )
    assert skewnormal.log_likelihood(x, found.dp) / x.size > best - 1e-6
    np.testing.assert_allclose(skewnormal.centred(found.dp), found.cp)


def test_covariance_at_the_boundary_is_not_a_number():
    x = np.abs(np.random.default_rng(5).standard_normal(60))
    assert np.isnan(skewnormal.covariance(x, skewnormal.fit(x))).all()


# --- penalised likelihood


def slope_of_penalty(alpha):
    """Minus the expected modified score (alpha / 2) a4 / a2, a_k the mean of z^k (N/Phi)^2(alpha z), by quadrature."""

    def moment(k):
        def integrand(z):
            return float(z**k * 2 * np.exp(2 * stats.norm.logpdf(alpha * z) - stats.norm.logcdf(alpha * z) - z**2 / 2))

        return integrate.quad(integrand, -12 / max(1, alpha), 12 / max(1, alpha), limit=400, epsabs=0, epsrel=1e-8)[0]

    return alpha / 2 * moment(4) / moment(2)


@pytest.mark.parametrize(("alpha", "tolerance"), [(1e-3, 1e-3), (1.0, 0.03), (4.0, 0.03), (100.0, 1e-3)])
def test_penalty_stands_for_the_modified_score(alpha, tolerance):
    c1, c2 = likelihood._C1, likelihood._C2
    assert 2 * c1 * c2 * alpha / (1 + c2 * alpha**2) == pytest.approx(slope_of_penalty(alpha), rel=tolerance)


@pytest.mark.parametrize("kind", ["skewed", "half-normal"])
def test_penalised_fit_is_a_maximum_of_the_penalised_likelihood(kind):
    if kind == "skewed":
        x = stats.skewnorm.rvs(3.0, -5.0, 2.0, size=150, random_state=3)
    else:
        x = stats.halfnorm.rvs(-5.0, 2.0, size=150, random_state=3)

    def objective(dp):
        return float(stats.skewnorm.logpdf(x, dp[2], dp[0], dp[1]).sum() - 0.87591 * np.log1p(0.85625 * dp[2] ** 2))

    dp = skewnormal.fit(x, penalised=True).dp
    scale = np.array([1.0 / abs(dp[2]), 1.0, abs(dp[2])]) * 1e-3
    for step in np.diag(scale):
        up, down = objective(dp + step), objective(dp - step)
        assert abs(up - down) / 2 < 1e-3 * (2 * objective(dp) - up - down) + 1e-7
    rng = np.random.default_rng(1)
    assert all(objective(dp + 30 * scale * rng.standard_normal(3)) < objective(dp) for _ in range(200))


@pytest.mark.parametrize("n", [8, 50, 1000, 30_000])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_penalised_fit_of_a_half_normal_sample_is_inside(n, sign):
    x = sign * stats.halfnorm.rvs(size=n, random_state=n)
    found = skewnormal.fit(x, penalised=True)
    assert not found.at_boundary
    assert 0.0 <= sign * found.dp[2] < 1e5
    assert np.isfinite(found.cp).all()


def test_penalised_fit_of_a_nearly_symmetric_sample_is_normal():
    x = stats.norm.ppf((np.arange(500) + 0.5) / 500, 3.0, 2.0)
    found = skewnormal.fit(x, penalised=True)
    np.testing.assert_allclose(found.dp, [x.mean(), x.std(), 0.0], atol=1e-12)


# --- the search


@pytest.mark.parametrize("penalty", [0.0, 0.02])
@pytest.mark.parametrize("v", [-6.0, -0.6, 0.02, 0.3, 1.5, 4.0])
def test_gradient_and_hessian_of_the_search_anywhere(v, penalty):
    x = stats.skewnorm.rvs(3.0, -1.0, 1.5, size=60, random_state=3)
    u = np.array([0.2, 0.4, v])
    _, gradient, hessian = likelihood.objective(u, x, penalty)
    steps = 1e-6 * np.eye(3)
    pairs = [(likelihood.objective(u + s, x, penalty), likelihood.objective(u - s, x, penalty)) for s in steps]
    np.testing.assert_allclose([(a[0] - b[0]) / 2e-6 for a, b in pairs], gradient, rtol=1e-6, atol=1e-7)
    numeric = np.array([(a[1] - b[1]) / 2e-6 for a, b in pairs])
    np.testing.assert_allclose(hessian, numeric, rtol=1e-5, atol=1e-6 * np.abs(hessian).max())


def test_fit_finds_the_highest_of_several_maxima():
    rng = np.random.default_rng(5)
    several = 0
    for _ in range(60):
        x = skewnormal.sample(skewnormal.direct([0.0, 1.0, rng.choice([0.0, 0.8, 0.95])]), 50, rng)
        y = (x - x.mean()) / x.std()
        ends = [likelihood.search(np.array([0.0, 0.0, v]), y) for v in (-1.5, 0.2, 0.8, 1.4, 2.0, 3.0)]
        tops = [value for u, value in ends if np.abs(likelihood.objective(u, y)[1]).max() < 1e-6]
        several += len(tops) > 1 and np.ptp(tops) > 1e-4
        assert -skewnormal.log_likelihood(y, skewnormal.fit(y).dp) / y.size < min(value for _, value in ends) + 1e-8
    assert several


# --- standard errors


@pytest.mark.parametrize(("n", "skewness"), [(1000, 0.5), (600, -0.8)])
def test_standard_errors_are_the_scatter_of_fits(n, skewness):
    cp, rng = np.array([-12.0, 3.0, skewness]), np.random.default_rng(12)
    samples = [skewnormal.sample(skewnormal.direct(cp), n, rng) for _ in range(200)]
    fits = [skewnormal.fit(x) for x in samples]
    errors = [np.sqrt(np.diagonal(skewnormal.covariance(*each))) for each in zip(samples, fits, strict=True)]
    scatter = np.std([found.cp for found in fits], axis=0)
    np.testing.assert_allclose(np.median(errors, axis=0), scatter, rtol=0.2)
