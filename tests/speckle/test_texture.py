"""Speckle and texture in dB, against scipy's log-gamma law and sampling."""

import numpy as np
import pytest

from radcal.speckle.texture import equal_texture, log_speckle_cumulants, order_of_texture, texture_db, texture_order


def test_cumulants_take_arrays():
    assert log_speckle_cumulants([[1.0, 2.0]]).shape == (1, 2, 3)


@pytest.mark.parametrize("effective", [4.0, 4.3])
def test_no_texture_where_looks_are_the_sensors(effective):
    order = texture_order(4.0, effective)
    assert order == np.inf
    assert not texture_db([0.1, 0.9], order).any()
    assert equal_texture(4.0, effective, 8.0) == pytest.approx(2.0 * effective)
    assert order_of_texture(0.0) == np.inf


def test_texture_is_a_smooth_function_of_its_order():
    u = np.random.default_rng(2).random(100)
    assert np.abs(texture_db(u, 5.0) - texture_db(u, 5.001)).max() < 0.01
