"""Wrong variants of means of cells, of predictions, and of the convergence of a sample."""

import numpy as np
from scipy import stats
from scipy.special import digamma
from variants import agrees

from radcal.posterior.cells import _level
from radcal.posterior.fixed_laws import half_normal
from radcal.posterior.marginal import Marginal, integrated
from radcal.posterior.prediction import predict
from radcal.posterior.sampling import split_r_hat

K = 10.0 / np.log(10.0)


def test_mean_of_power_of_a_cell_without_the_bias_of_its_logarithm():
    power = stats.gamma.ppf((np.arange(12) + 0.5) / 12, 2.0, scale=0.04)
    member, count = np.repeat([0, 1], [4, 8]), np.array([4, 8])
    means = np.array([power[:4].mean(), power[4:].mean()])
    away = power / means[member] - 1.0
    looks = (12 - 4 / 2.0 - 8 / 4.0) / (away @ away)  # of 4 and 8 pixels, which count as 2 and 4 independent ones
    total = np.array([2.0, 4.0]) * looks
    right = np.array([10.0 * np.log10(means) - K * (digamma(total) - np.log(total)), K**2 * stats.loggamma.var(total)])
    mean, variance, found = _level(power, member, count, np.array([2.0, 4.0]))
    agrees(
        [mean, variance],
        right,
        biased=[10.0 * np.log10(means), right[1]],
        twice=[10.0 * np.log10(means) + K * (digamma(total) - np.log(total)), right[1]],
        mean_of_decibels=[[(10.0 * np.log10(power[:4])).mean(), (10.0 * np.log10(power[4:])).mean()], right[1]],
        pixels=[right[0], K**2 * stats.loggamma.var(count * looks)],
        one_over_looks=[right[0], K**2 / total],
        sd=[right[0], np.sqrt(right[1])],
    )
    agrees(
        found,
        looks,
        biased=12 / (away @ away),
        independent=10 / (away @ away),
        of_decibels=(K / (10.0 * np.log10(power)).std()) ** 2,
    )


def test_scale_of_an_effect_is_half_normal_in_its_logarithm():
    log = np.log([0.05, 0.4, 1.9])
    right = stats.halfnorm(scale=0.7).logpdf(np.exp(log)) + log  # with the derivative of the exponential
    exponent = np.exp(log)
    agrees(
        np.diff(half_normal(log, 0.7)),
        np.diff(right),
        no_derivative=np.diff(right - log),
        log_normal=np.diff(stats.norm(0.0, 0.7).logpdf(log)),
        exponential=np.diff(stats.expon(scale=0.7).logpdf(exponent) + log),
        of_variance=np.diff(stats.halfnorm(scale=0.49).logpdf(exponent) + log),
    )


def test_bands_of_a_prediction_average_law_and_constant():
    draws = stats.norm(-11.0, 0.8).ppf((np.arange(4001) + 0.5) / 4001)[:, None]
    found = predict(draws, np.array([-14.0]), np.array([1.7]))
    z = stats.norm.ppf(0.95)
    right = [-12.5, -12.5 - z * 1.25, -12.5 + z * 1.25]
    agrees(
        [found.mean_db[0], found.p05_db[0], found.p95_db[0]],
        right,
        rtol=2e-3,
        law=[-11.0, -11.0 - z * 0.8, -11.0 + z * 0.8],
        constant=[-14.0, -14.0 - z * 1.7, -14.0 + z * 1.7],
        standard_errors=[-12.5, -13.75, -11.25],
        two_sided_95=[-12.5, -12.5 - 1.96 * 1.25, -12.5 + 1.96 * 1.25],
        quadrature=[-12.5, *(-12.5 + np.array([-1.0, 1.0]) * z * np.hypot(0.8, 1.7) / 2.0)],
        exchanged=[right[0], right[2], right[1]],
    )


def test_effects_of_fields_and_cells_are_integrated_out():
    """Normal equations by the dense covariance, at a point of the grid."""
    rng, cell, field = np.random.default_rng(4), 0.01, 8.0  # at a corner of the grid
    patch, variance = np.array([1, 1, 2, 2, 2, 5]), np.array([0.03, 0.2, 0.05, 0.1, 0.4, 0.06])
    columns = np.column_stack([np.ones(6), rng.normal(size=6), rng.normal(-9.0, 2.0, 6)])

    def dense(own, shared):
        return np.diag(variance + own) + shared * (patch[:, None] == patch)

    def gram(covariance):
        return columns.T @ np.linalg.solve(covariance, columns)

    found, log_det = Marginal(columns, variance, patch).at(np.log([cell]), np.log([field]))
    right = dense(cell**2, field**2)
    agrees(
        found[0],
        gram(right),
        rtol=1e-6,
        standard_deviations=gram(dense(cell, field)),
        exchanged=gram(dense(field**2, cell**2)),
        independent=gram(np.diag(np.diag(right))),
        cells_alone=gram(dense(cell**2, 0.0)),
    )
    agrees(
        log_det[0],
        np.linalg.slogdet(right)[1],
        inverse=-np.linalg.slogdet(right)[1],
        half=0.5 * np.linalg.slogdet(right)[1],
    )
    prior = np.array([4.0, 0.3])
    inner = found[0][:2, :2] + np.diag(1.0 / prior)
    rest = found[0][2, 2] - found[0][2, :2] @ np.linalg.solve(inner, found[0][:2, 2])
    half = 0.5 * (np.linalg.slogdet(inner)[1] + np.log(prior).sum())
    got = integrated(found, prior[None], 2)
    flat = found[0][2, 2] - found[0][2, :2] @ np.linalg.solve(found[0][:2, :2], found[0][:2, 2])
    agrees(
        [got[0].item(), got[1].item()],
        [rest, half],
        flat_prior=[flat, half],
        whole=[rest, 2.0 * half],
        no_prior=[rest, half - 0.5 * np.log(prior).sum()],
        precision=[rest, half - np.log(prior).sum()],
        explained=[found[0][2, 2], half],
    )


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
