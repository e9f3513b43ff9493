"""Wrong variants of kriging, from its matrices without radcal's factorisation."""

import numpy as np
from variants import agrees

from radcal.proposals.kriging import Kriging

RNG = np.random.default_rng(2)
X = RNG.random((9, 2))
Y = np.stack([np.sin(3.0 * X[:, 0]) + X[:, 1], 4.0 + X[:, 0] * X[:, 1] ** 2], axis=1)
AT = RNG.random((5, 2))
SCALES, NUGGET = np.array([0.4, 0.9]), 0.03
ONE = np.ones(9)


def correlation(a, b, half=0.5, scales=SCALES):
    return np.exp(-half * (((a[:, None] - b) / scales) ** 2).sum(axis=-1))


def predicted(k, near, known_mean=None):
    inverse = np.linalg.inv(k)
    constant = ONE @ inverse @ Y / inverse.sum() if known_mean is None else known_mean
    return constant + near @ inverse @ (Y - constant)


def test_prediction_is_the_best_linear_unbiased_one():
    found = Kriging(X, Y, SCALES, NUGGET)
    k = correlation(X, X) + NUGGET * np.eye(9)
    near, inverse = correlation(AT, X), np.linalg.inv(k)
    agrees(
        found.mean(AT),
        predicted(k, near),
        rtol=1e-8,
        mean_of_outputs=predicted(k, near, Y.mean(axis=0)),
        zero_mean=predicted(k, near, np.zeros(2)),
        no_nugget=predicted(k - NUGGET * np.eye(9), near),
        unhalved=predicted(correlation(X, X, 1.0) + NUGGET * np.eye(9), correlation(AT, X, 1.0)),
        exchanged_scales=predicted(
            correlation(X, X, scales=SCALES[::-1]) + NUGGET * np.eye(9), correlation(AT, X, scales=SCALES[::-1])
        ),
        inverse_scales=predicted(
            correlation(X, X, scales=1.0 / SCALES) + NUGGET * np.eye(9), correlation(AT, X, scales=1.0 / SCALES)
        ),
    )
    left = Y - ONE @ inverse @ Y / inverse.sum()
    each = np.einsum("kn,kl,ln->n", left, inverse, left)
    process = each.sum() / (2 * 8)
    agrees(
        found.process,
        process,
        rtol=1e-8,
        biased=each.sum() / 18,
        one_output=each[0] / 8,
        total=each.sum() / 8,
        sd=process**0.5,
    )
    plain = 1.0 - np.einsum("mk,kl,ml->m", near, inverse, near)
    trend = (1.0 - near @ inverse @ ONE) ** 2 / inverse.sum()
    agrees(
        found.variance(AT),
        process * (plain + trend),
        rtol=1e-7,
        known_constant=process * plain,
        less=process * (plain - trend),
        unscaled=plain + trend,
        sd=np.sqrt(process * (plain + trend)),
        with_noise=process * (plain + trend + NUGGET),
    )


def test_leave_one_out_by_leaving_one_out():
    """With unchanged length scales, and a constant fitted to the others; the sign is that of value less prediction."""
    k = correlation(X, X) + NUGGET * np.eye(9)
    right, kept_constant = np.empty_like(Y), np.empty_like(Y)
    inverse = np.linalg.inv(k)
    whole = ONE @ inverse @ Y / inverse.sum()
    for i in range(9):
        rest = np.arange(9) != i
        part = np.linalg.inv(k[np.ix_(rest, rest)])
        constant = part.sum(axis=0) @ Y[rest] / part.sum()
        right[i] = Y[i] - (constant + k[i, rest] @ part @ (Y[rest] - constant))
        kept_constant[i] = Y[i] - (whole + k[i, rest] @ part @ (Y[rest] - whole))
    found = Kriging(X, Y, SCALES, NUGGET)
    agrees(
        found.leave_one_out(),
        right,
        rtol=1e-7,
        sign=-right,
        constant_of_all=kept_constant,
        residual=Y - predicted(k, correlation(X, X)),
        from_mean=Y - Y.mean(axis=0),
    )
