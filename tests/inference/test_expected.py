"""What bins are expected to show, against simulated pixels."""

import numpy as np
import pytest

from radcal.inference.misfit import LawForward, expected_cumulants
from radcal.laws import LAWS

LAW = LAWS["mangia"]
X = np.array([-30.0, 18.0, 5.0, 5.0])


def test_several_laws_at_once_are_the_single_laws_bit_for_bit():
    nodes = np.linspace(20.0, 50.0, 24).reshape(2, 12)
    several = np.array([X, X + [3.0, -2.0, 1.0, 0.5], X - 1.0])
    forward = LawForward(LAW, nodes, 4.0, -25.0)
    np.testing.assert_array_equal(forward(several), [forward(x) for x in several])


def test_fields_widen_and_an_error_of_the_incidence_moves():
    nodes = np.linspace(20.0, 50.0, 24).reshape(2, 12)
    run = LawForward(LAW, nodes, 4.0)(X)
    shift = np.array([[0.5, 1.0, -2.0], [0.1, 0.2, 0.3]])
    found = expected_cumulants(run, 4.0, 4.0, np.array([2.0, 3.0]), shift)
    np.testing.assert_allclose(found - run, shift + [[0.0, 2.0, 0.0], [0.0, 3.0, 0.0]], atol=1e-12)
    least = expected_cumulants(run, 4.0, 4.0, -100.0)
    assert least[:, 1] == pytest.approx(1e-3 * run[:, 1])
