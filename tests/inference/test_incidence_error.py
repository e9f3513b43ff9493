"""Errors of the incidence, against simulated maps."""

import numpy as np
import pytest

from radcal.inference.incidence_error import attenuation, registration_error_deg, true_nodes


def test_an_error_beyond_the_spread_leaves_something():
    assert attenuation([44.0, 46.0], 10.0) == pytest.approx(0.1)


def test_angles_stay_possible():
    nodes = true_nodes([[1.0, 89.0]], 5.0, 45.0, 1.0)
    assert nodes.min() == 0.0
    assert nodes.max() == 90.0


def test_edges_have_most_of_the_error_of_a_registration():
    """A ridge: slopes of 0.5 degrees a row and 1.2 degrees a column, and a jump of 8 degrees between rows 9 and 10."""
    rows = 30.0 + 0.5 * np.arange(20.0) + 8.0 * (np.arange(20) >= 10)
    incidence = np.add.outer(rows, 1.2 * np.arange(6.0)).astype(np.float32)
    incidence[0, 0] = np.nan
    found = registration_error_deg(incidence, np.full((20, 6), 0.4, dtype=np.float32), np.arange(120)).reshape(20, 6)
    np.testing.assert_allclose(found[[4, 15], 3], 1.3 * 0.4 / np.sqrt(2.0), rtol=1e-5)
    wanted = np.hypot(4.5, 1.2) * 0.4 / np.sqrt(2.0)  # central difference
    np.testing.assert_allclose(found[[9, 10], 3], wanted, rtol=1e-5)
    # beside a place without incidence: root mean square of the rest
    rest = np.ones((20, 6), dtype=bool)
    rest[[0, 1, 0], [0, 0, 1]] = False
    assert found[1, 0] == pytest.approx(np.sqrt((found[rest] ** 2).mean()))


def test_each_place_is_attenuated_by_its_own_error():
    """Two halves of a map, with errors of 2 and of 5 degrees."""
    rng = np.random.default_rng(3)
    true = rng.normal(45.0, 6.0, 400_000)
    error = np.where(np.arange(true.size) % 2, 2.0, 5.0)
    mapped = true + error * rng.normal(size=true.size)
    share = attenuation(mapped, [2.0, 5.0], float(np.sqrt(np.mean(error**2))))
    np.testing.assert_allclose(share, [36.0 / 40.0, 36.0 / 61.0], rtol=0.01)
    nodes = true_nodes([[52.0], [52.0]], [2.0, 5.0], float(mapped.mean()), share)
    for row, size in zip(nodes, (2.0, 5.0), strict=True):
        near = (np.abs(mapped - 52.0) < 0.5) & (error == size)
        assert row.mean() == pytest.approx(true[near].mean(), abs=0.1)
        assert row.std() == pytest.approx(true[near].std(), rel=0.03)
