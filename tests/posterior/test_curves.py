"""Curves of many parameters at once, and their interpolation."""

import numpy as np
import pytest

from radcal.laws import LAWS, law_for
from radcal.posterior.curves import GRID_DEG, curves_of, levels_at


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        (LAWS["mangia"], [[-20.0, 14.0, 6.0, 3.0], [-25.0, 10.0, 12.0, 8.0]]),
        (law_for("tabulated", angles_deg=(10.0, 25.0, 60.0)), [[3.0, -4.0, -11.0], [1.0, -9.0, -10.0]]),
        (law_for("oh1992").bound(frequency_ghz=5.4, polarisation="VV"), [[8.0, 1.0, 0.6], [15.0, 3.0, 1.8]]),
    ],
)
def test_curves_of_many_parameters_are_those_of_each(law, parameters):
    x = np.array(parameters)
    curves = curves_of(law, x)
    np.testing.assert_array_equal(curves, [law(np.radians(GRID_DEG), one) for one in x])
    angles = np.array([13.3, 41.17, 58.0])
    exact = np.stack([law(np.radians(angles), one) for one in x])
    assert levels_at(curves, angles) == pytest.approx(exact, abs=0.01)
    assert curves_of(law, x, np.radians(angles)) == pytest.approx(exact)
    # between two angles of the grid a curve is straight
    straight = levels_at(np.stack([GRID_DEG, -2.0 * GRID_DEG]), np.array([0.0, 13.3, 41.17, 90.0]))
    assert straight == pytest.approx(np.outer([1.0, -2.0], [0.0, 13.3, 41.17, 90.0]))
