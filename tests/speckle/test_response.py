import numpy as np
import pytest
from scipy.signal import windows

from radcal.bands import WIDTH_FACTOR
from radcal.speckle.response import impulse_response, taylor_weights


@pytest.mark.parametrize("n", [8, 1024])
def test_taylor_weights_are_those_of_scipy(n):
    expected = windows.taylor(n, nbar=4, sll=35, norm=False)
    np.testing.assert_allclose(taylor_weights((np.arange(n) + 0.5) / n - 0.5), expected, rtol=1e-12)


def test_width_factor_is_twice_the_half_power_point_of_taylor_weighting():
    frequency = (np.arange(1024) + 0.5) / 1024 - 0.5
    weights = windows.taylor(1024, nbar=4, sll=35, norm=False)
    x = np.linspace(0.0, 1.0, 20_001)[11_800:11_900]  # the others are far from half power
    power = (np.cos(2 * np.pi * np.outer(x, frequency)) @ weights / weights.sum()) ** 2
    assert power[0] > 0.5 > power[-1]
    assert pytest.approx(2 * np.interp(-0.5, -power, x), rel=1e-13) == WIDTH_FACTOR


def test_impulse_response_sidelobes_are_below_35_db():
    power = impulse_response(1.0, 0.02) ** 2
    level_db = 10 * np.log10(power[power.size // 2 :] / power.max())
    first_null = np.flatnonzero(np.diff(level_db) > 0)[0]
    assert -37.0 < level_db[first_null:].max() < -34.0
