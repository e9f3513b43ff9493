"""Wrong variants of the skew-normal density, its parameters and its distances, against scipy.stats."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq
from variants import agrees

from radcal import skewnormal
from radcal.skewnormal.likelihood import objective

X = np.linspace(-22.0, -2.0, 41)


@pytest.mark.parametrize("dp", [(-11.0, 3.2, -2.4), (-9.0, 4.1, 1.3)])
def test_density_and_moments(dp):
    xi, omega, alpha = dp
    right = stats.skewnorm(alpha, xi, omega)
    agrees(
        skewnormal.density(X, dp),
        right.pdf(X),
        mirrored=stats.skewnorm(-alpha, xi, omega).pdf(X),
        normal=stats.norm(right.mean(), right.std()).pdf(X),
        half=right.pdf(X) / 2.0,
        unscaled=right.pdf(X) * omega,
        variance=stats.skewnorm(alpha, xi, omega**2).pdf(X),
        mean_for_xi=stats.skewnorm(alpha, right.mean(), omega).pdf(X),
    )
    mean, variance, skewness = (float(x) for x in right.stats(moments="mvs"))
    cp = [mean, np.sqrt(variance), skewness]
    agrees(
        skewnormal.centred(dp),
        cp,
        mode=[xi, omega, alpha],
        variance=[mean, variance, skewness],
        sign=[mean, cp[1], -skewness],
        other_side=[2.0 * xi - mean, cp[1], skewness],
        normal=[xi + omega * np.sqrt(2.0 / np.pi), cp[1], skewness],
        half=[mean, cp[1], 0.5 * skewness],
    )
    agrees(
        skewnormal.direct(cp),
        dp,
        sign=[2 * mean - xi, omega, -alpha],
        centred=cp,
        delta=[xi, omega, alpha / np.hypot(1.0, alpha)],
        variance=[xi, omega**2, alpha],
    )
    agrees(
        skewnormal.cdf(X, dp),
        right.cdf(X),
        survival=right.sf(X),
        mirrored=stats.skewnorm(-alpha, xi, omega).cdf(X),
        normal=stats.norm.cdf((X - xi) / omega),
    )
    sample = right.ppf(np.linspace(0.01, 0.99, 50))
    agrees(
        skewnormal.log_likelihood(sample, dp),
        right.logpdf(sample).sum(),
        mean=right.logpdf(sample).mean(),
        likelihood=right.pdf(sample).sum(),
        sign=-right.logpdf(sample).sum(),
    )


def test_distances_of_normal_densities():
    """Closed forms of two normal densities of different width."""
    (a, s), (b, t) = (-10.0, 2.0), (-8.5, 3.1)
    one, other = (a, s, 0.0), (b, t, 0.0)
    grid = np.linspace(b - 5.0 * t, b + 5.0 * t, 1000)
    apart = stats.norm(a, s).pdf(grid) - stats.norm(b, t).pdf(grid)
    own = np.linspace(a - 5.0 * s, a + 5.0 * s, 1000)
    agrees(
        skewnormal.density_rms(one, other),
        np.sqrt(np.mean(apart**2)),
        squared=np.mean(apart**2),
        absolute=np.mean(np.abs(apart)),
        integral=np.sqrt(np.trapezoid(apart**2, grid)),
        largest=np.abs(apart).max(),
        own_grid=np.sqrt(np.mean((stats.norm(a, s).pdf(own) - stats.norm(b, t).pdf(own)) ** 2)),
    )
    overlap = np.sqrt(2.0 * s * t / (s**2 + t**2)) * np.exp(-0.25 * (a - b) ** 2 / (s**2 + t**2))
    agrees(
        skewnormal.hellinger(one, other),
        np.sqrt(1.0 - overlap),
        squared=1.0 - overlap,
        overlap=overlap,
        unhalved=np.sqrt(2.0 - 2.0 * overlap),
        bhattacharyya=-np.log(overlap),
    )
    fine = np.linspace(-30.0, 15.0, 200_001)
    step = np.abs(stats.norm(a, s).cdf(fine) - stats.norm(b, t).cdf(fine))
    agrees(
        skewnormal.kolmogorov_smirnov(one, other),
        step.max(),
        rtol=1e-4,
        mean=step.mean(),
        total=np.trapezoid(step, fine),
        density=np.abs(stats.norm(a, s).pdf(fine) - stats.norm(b, t).pdf(fine)).max(),
    )


def test_objective_is_the_mean_negative_log_likelihood():
    """Its parameters are mean, log sd and v; alpha is found by a search over scipy's moments, not by a formula."""
    x = np.array([-1.7, -0.4, 0.3, 0.5, 1.9])
    mean, log_sd, v = 0.2, 0.1, -0.6
    skewness = skewnormal.MAX_SKEWNESS * np.tanh(v)
    alpha = brentq(lambda a: float(stats.skewnorm.stats(a, moments="s")) - skewness, -60.0, 60.0, xtol=1e-13)
    omega = np.exp(log_sd) / stats.skewnorm.std(alpha)
    shift = omega * stats.skewnorm.mean(alpha)
    right = stats.skewnorm(alpha, mean - shift, omega).logpdf(x)
    agrees(
        objective(np.array([mean, log_sd, v]), x)[0],
        -right.mean(),
        total=-right.sum(),
        sign=right.mean(),
        mirrored=-stats.skewnorm(-alpha, mean + shift, omega).logpdf(x).mean(),
        normal=-stats.norm(mean, np.exp(log_sd)).logpdf(x).mean(),
        variance=-stats.skewnorm(alpha, mean - shift, omega * np.exp(-0.5 * log_sd)).logpdf(x).mean(),
    )


def test_errors_of_a_fit_shrink_with_the_number_of_independent_values():
    x = stats.skewnorm(-1.8, -10.0, 3.0).ppf((np.arange(4000) + 0.5) / 4000)
    fit = skewnormal.fit(x)
    sd = x.std()
    variance = skewnormal.covariance(x, fit, effective=500.0)[0, 0]
    agrees(
        variance,
        sd**2 / 500.0,
        rtol=0.02,
        pixels=sd**2 / 4000.0,
        error=sd / np.sqrt(500.0),
        omega=fit.dp[1] ** 2 / 500.0,
    )
    agrees(fit.cp[:2], [x.mean(), sd], rtol=3e-3, location=fit.dp[:2], variance=[x.mean(), sd**2])
