"""Wrong variants of predictions, and of the convergence of a sample."""

import numpy as np
from scipy import stats
from variants import agrees

from radcal.posterior.prediction import predict
from radcal.posterior.sampling import split_r_hat


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
