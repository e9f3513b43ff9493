"""Sampler against densities in closed form."""

import numpy as np
import pytest
from scipy import stats
from variants import agrees

from radcal.posterior.sampling import _judged, _mixture_move, mixed, sample, split_r_hat

MEAN = np.array([0.3, -2.0, 5.0])
COVARIANCE = np.array([[0.04, 0.03, 0.0], [0.03, 0.25, -0.2], [0.0, -0.2, 4.0]])
PRIOR_SD = np.array([3.0, 4.0, 6.0])


def log_prior(points):
    return -0.5 * ((points / PRIOR_SD) ** 2).sum(axis=1)


def log_likelihood(points):
    left = points - MEAN
    return -0.5 * np.einsum("kd,de,ke->k", left, np.linalg.inv(COVARIANCE), left)


def start(seed=3):
    return np.random.default_rng(seed).standard_normal((64, 3)) * PRIOR_SD


@pytest.mark.slow
def test_a_normal_posterior_is_the_one_in_closed_form():
    found = sample(log_prior, log_likelihood, start(), 4000, 5)
    precision = np.linalg.inv(COVARIANCE) + np.diag(PRIOR_SD**-2.0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ np.linalg.inv(COVARIANCE) @ MEAN
    sd = np.sqrt(np.diag(covariance))
    assert found.converged
    assert found.steps >= 250
    assert found.ess >= 400.0
    # five standard errors at the effective sample size
    assert np.abs(found.draws.mean(axis=0) - mean).max() < (5.0 * sd / np.sqrt(found.ess)).max()
    assert found.draws.std(axis=0) / sd == pytest.approx(1.0, abs=5.0 / np.sqrt(2.0 * found.ess))
    there = np.corrcoef(found.draws, rowvar=False)[0, 1]
    assert there == pytest.approx(covariance[0, 1] / (sd[0] * sd[1]), abs=0.12)


@pytest.mark.slow
def test_two_modes_keep_their_shares():
    def log_two(points):
        return np.logaddexp(
            np.log(0.7) - 2.0 * ((points - 2.0) ** 2).sum(axis=1), np.log(0.3) - 2.0 * ((points + 2.0) ** 2).sum(axis=1)
        )

    found = sample(log_prior, log_two, start(), 6000, 5)
    assert (found.draws[:, 0] > 0.0).mean() == pytest.approx(0.7, abs=0.12)


def autoregressive(steps, walkers, rho, seed=1):
    """Stationary chains of unit variance, whose autocorrelation time is (1 + rho) / (1 - rho)."""
    rng = np.random.default_rng(seed)
    chain = rng.standard_normal((steps, walkers, 2))
    for k in range(1, steps):
        chain[k] = rho * chain[k - 1] + np.sqrt(1.0 - rho**2) * chain[k]
    return chain


def test_a_chain_is_judged_by_its_autocorrelation_time():
    chain = autoregressive(4000, 16, 0.8)
    found = _judged(chain)
    # of all steps without the first eighth
    assert found.ess == pytest.approx(3500 * 16 / 9.0, rel=0.15)
    assert found.converged
    # about six times 99 steps, 15 times are asked for, of walkers enough
    slow = _judged(autoregressive(600, 128, 0.98))
    assert slow.ess > 800.0
    assert slow.r_hat < 1.05
    assert not slow.converged
    # groups of walkers that differ
    apart = autoregressive(4000, 16, 0.5)
    apart[:, ::8] += 1.0
    assert not _judged(apart).converged


def test_the_mixture_tells_its_own_density():
    """Importance weights p / q of two normal densities p have the same mean over draws from q."""
    move = _mixture_move(np.random.default_rng(2).standard_normal((3000, 2)), 5)
    drawn, log_ratio = move.get_proposal(np.zeros((20_000, 2)), None, np.random.RandomState(3))
    weights = [np.mean(stats.norm(0.0, sd).pdf(drawn).prod(axis=1) * np.exp(log_ratio)) for sd in (0.4, 0.8, 1.1)]
    np.testing.assert_allclose(weights, weights[1], rtol=0.06)
    assert drawn.std() > 1.05


def test_samples_are_mixed_with_given_probabilities():
    """As many draws as possible, spread evenly over each sample; of one sample, all."""
    (every,) = mixed([1.0], [7])
    np.testing.assert_array_equal(every, np.arange(7))
    first, second = mixed([0.8, 0.2], [400, 1000])
    assert (first.size, second.size) == (400, 100)
    assert (second[0], second[-1]) == (0, 999)
    assert np.diff(second).max() == 11
    first, second = mixed([0.25, 0.75], [400, 300])
    assert (first.size, second.size) == (100, 300)


def test_convergence_by_the_variance_between_halves_of_chains():
    """Eight groups of one walker, which drift; the square root of the ratio of variances."""
    rng = np.random.default_rng(6)
    chains = rng.normal(size=(60, 8, 1)) + np.linspace(0.0, 1.5, 60)[:, None, None] + 0.4 * np.arange(8)[:, None]

    def ratio(parts):
        n = parts.shape[1]
        within, between = parts.var(axis=1, ddof=1).mean(), parts.mean(axis=1).var(ddof=1)
        return float((n - 1) / n + between / within)

    whole = chains[:, :, 0].T
    halves = np.concatenate([whole[:, :30], whole[:, 30:]])
    right = np.sqrt(ratio(halves))
    agrees(split_r_hat(chains), [right], squared=[right**2], not_split=[np.sqrt(ratio(whole))], inverse=[1.0 / right])
