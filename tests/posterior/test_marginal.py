"""Marginal likelihood of cells, against dense normal distributions."""

import numpy as np

from radcal.posterior import marginal
from radcal.posterior.marginal import Marginal, normal_draws

GRID = np.log(np.geomspace(0.01, 3.0, 32)), np.log(np.geomspace(0.01, 8.0, 32))


def made(n=70):
    """Columns (the last is the values), variances and fields of cells, whose numbers have gaps."""
    rng = np.random.default_rng(3)
    columns = np.column_stack([np.ones(n), rng.normal(1.0, 2.0, n), rng.normal(0.0, 1.0, (n, 2))])
    return columns, 10.0 ** rng.uniform(-2.5, -0.8, n), 7 * rng.integers(1, 7, n) + 2


def test_the_grid_reaches_as_far_as_the_priors():
    np.testing.assert_allclose([marginal._CELL[[0, -1]], marginal._FIELD[[0, -1]]], [one[[0, -1]] for one in GRID])
    columns, variance, patch = made()
    table = Marginal(columns, variance, patch)
    inside, outside = (table.at(np.log([cell]), np.log([field])) for cell, field in ((3.0, 0.01), (40.0, 1e-4)))
    for one, other in zip(inside, outside, strict=True):
        np.testing.assert_allclose(one, other)


def test_draws_with_other_columns_before_the_values_ignore_them():
    columns, variance, patch = made()
    table = Marginal(columns, variance, patch)
    gram, _ = table.at(np.log([0.3]), np.log([0.6]))
    prior = np.array([[4.0, 0.09]])
    rng = [np.random.default_rng(5) for _ in range(2)]
    some = normal_draws(gram, prior, 2, rng[0])
    other = normal_draws(gram[:, [0, 1, 3]][:, :, [0, 1, 3]], prior, 2, rng[1])
    np.testing.assert_allclose(some, other)
