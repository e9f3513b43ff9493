"""Bounded least squares and the starts of a search."""

import numpy as np
import pytest

from radcal.inference.bounded import distant, least_squares, sobol

ZERO, ONE = np.zeros(2), np.ones(2)


def line(points):
    """A linear problem whose free minimum is (0.5, 1.3); the two parameters trade for each other."""
    a, b = points.T
    return np.stack([a - 0.5, 2.0 * (b - 1.3), 3.0 * (a - 0.5 + 0.5 * (b - 1.3))], axis=-1)


def test_a_minimum_inside_is_found_with_its_jacobian():
    centre = np.array([0.3, 0.6])
    found = least_squares(lambda u: (u - centre) * [1.0, 5.0], np.array([0.9, 0.1]), ZERO, ONE, 1e-12)
    np.testing.assert_allclose(found.x, centre, atol=1e-9)
    np.testing.assert_allclose(found.jac, np.diag([1.0, 5.0]), atol=1e-6)


def test_a_minimum_beyond_a_bound_is_that_on_the_bound():
    found = least_squares(line, np.array([0.1, 0.2]), ZERO, ONE, 1e-12)
    # at b = 1: (a - 1/2)^2 + 9 (a - 1/2 - 0.15)^2 is least where a - 1/2 = 0.9 * 0.15
    np.testing.assert_allclose(found.x, [0.635, 1.0], atol=1e-6)
    # at the bound steps go to one side: the derivatives are the same
    np.testing.assert_allclose(found.jac, [[1.0, 0.0], [0.0, 2.0], [3.0, 1.5]], atol=1e-4)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201)), axis=-1).reshape(-1, 2)
    least = 0.5 * (line(grid) ** 2).sum(axis=1).min()
    assert found.cost == pytest.approx(least, rel=1e-6)


def test_a_curved_valley_is_followed_onto_the_bounds():
    """Rosenbrock's valley b = a^2, whose free minimum (2, 4) is out of reach: its end is the corner itself."""
    valley = least_squares(
        lambda u: np.stack([10.0 * (u[:, 1] - u[:, 0] ** 2), 2.0 - u[:, 0]], axis=-1), ZERO + 0.1, ZERO, ONE, 1e-14
    )
    np.testing.assert_array_equal(valley.x, ONE)
    assert valley.nfev < 20  # a method that keeps inside of the bounds takes 31, and ends beside the corner


def test_residuals_without_bounds_end_in_no_error():
    found = least_squares(lambda u: np.where(u > 0.5, np.inf, 1.0 / (0.5 - u)), np.array([0.4, 0.9]), ZERO, ONE, 1e-6)
    assert np.isfinite(found.cost)


def test_sobol_points_are_balanced_and_repeat():
    points = sobol(3, 64, 5)
    np.testing.assert_array_equal(points, sobol(3, 64, 5))
    assert not np.array_equal(points, sobol(3, 64, 6))
    for column in points.T:
        np.testing.assert_array_equal(np.sort(np.floor(64 * column)), np.arange(64))


def test_starts_are_a_fifth_of_the_box_apart():
    ranked = np.array([[0.5, 0.5], [0.6, 0.6], [0.69, 0.31], [0.5, 0.71], [0.1, 0.1], [0.9, 0.9]])
    np.testing.assert_array_equal(list(distant(ranked, 3)), ranked[[0, 3, 4]])
    np.testing.assert_array_equal(list(distant(ranked, 9)), ranked[[0, 3, 4, 5]])
