"""Marginal likelihood of cells, against dense normal distributions."""

import numpy as np
import pytest

from radcal.posterior import marginal
from radcal.posterior.marginal import Marginal, normal_draws

N, FIELDS = 70, 6
GRID = np.log(np.geomspace(0.01, 3.0, 32)), np.log(np.geomspace(0.01, 8.0, 32))


def made(n=N, fields=FIELDS, seed=3):
    """Columns (the last is the values), variances and fields of cells, whose numbers have gaps."""
    rng = np.random.default_rng(seed)
    columns = np.column_stack([np.ones(n), rng.normal(1.0, 2.0, n), rng.normal(0.0, 1.0, (n, 2))])
    return columns, 10.0 ** rng.uniform(-2.5, -0.8, n), 7 * rng.integers(1, fields + 1, n) + 2


def dense(variance, patch, cell, field):
    """Covariance of cells: speckle and effect of each cell, and effects that the cells of a field share."""
    return np.diag(variance + cell**2) + field**2 * (patch[:, None] == patch)


def test_the_grid_reaches_as_far_as_the_priors():
    np.testing.assert_allclose([marginal._CELL[[0, -1]], marginal._FIELD[[0, -1]]], [one[[0, -1]] for one in GRID])
    columns, variance, patch = made()
    table = Marginal(columns, variance, patch)
    inside, outside = (table.at(np.log([cell]), np.log([field])) for cell, field in ((3.0, 0.01), (40.0, 1e-4)))
    for one, other in zip(inside, outside, strict=True):
        np.testing.assert_allclose(one, other)


def test_every_point_has_its_own_place():
    columns, variance, patch = made()
    table = Marginal(columns, variance, patch)
    cell, field = np.log([0.05, 0.4, 1.7]), np.log([2.0, 0.3, 0.02])
    gram, log_det = table.at(cell, field)
    assert (gram.shape, log_det.shape) == ((3, 4, 4), (3,))
    for k in range(3):
        one, own = table.at(cell[[k]], field[[k]])
        np.testing.assert_allclose(gram[k], one[0], rtol=1e-12)
        assert log_det[k] == pytest.approx(own[0])
    # interpolated, to some per cent of what they are
    for k in range(3):
        covariance = dense(variance, patch, np.exp(cell[k]), np.exp(field[k]))
        wanted = columns.T @ np.linalg.solve(covariance, columns)
        size = np.sqrt(np.diag(wanted))
        np.testing.assert_allclose(gram[k] / np.outer(size, size), wanted / np.outer(size, size), atol=0.03)


def test_draws_of_coefficients_have_their_mean_and_covariance():
    columns, variance, patch = made()
    i, j, prior = 18, 20, np.array([4.0, 0.09, 1.3])
    gram, _ = Marginal(columns, variance, patch).at(GRID[0][[i]], GRID[1][[j]])
    many = 40_000
    draws = normal_draws(np.repeat(gram, many, axis=0), np.tile(prior, (many, 1)), 3, np.random.default_rng(5))
    inverse = np.linalg.inv(dense(variance, patch, np.exp(GRID[0][i]), np.exp(GRID[1][j])))
    z, y = columns[:, :3], columns[:, 3]
    covariance = np.linalg.inv(z.T @ inverse @ z + np.diag(1.0 / prior))
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((draws.mean(axis=0) - covariance @ z.T @ inverse @ y) / sd, 0.0, atol=0.025)
    np.testing.assert_allclose(np.cov(draws.T) / np.outer(sd, sd), covariance / np.outer(sd, sd), atol=0.03)
    assert np.abs(covariance / np.outer(sd, sd))[0, 1] > 0.04


def test_draws_with_other_columns_before_the_values_ignore_them():
    columns, variance, patch = made()
    table = Marginal(columns, variance, patch)
    gram, _ = table.at(np.log([0.3]), np.log([0.6]))
    prior = np.array([[4.0, 0.09]])
    rng = [np.random.default_rng(5) for _ in range(2)]
    some = normal_draws(gram, prior, 2, rng[0])
    other = normal_draws(gram[:, [0, 1, 3]][:, :, [0, 1, 3]], prior, 2, rng[1])
    np.testing.assert_allclose(some, other)
