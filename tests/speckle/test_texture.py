"""Speckle and texture in dB, against scipy's log-gamma law and sampling."""

import numpy as np
import pytest

from radcal.speckle.texture import equal_texture, order_of_texture, texture_db, texture_order


@pytest.mark.parametrize("effective", [4.0, 4.3])
def test_no_texture_where_looks_are_the_sensors(effective):
    order = texture_order(4.0, effective)
    assert order == np.inf
    assert not texture_db([0.1, 0.9], order).any()
    assert equal_texture(4.0, effective, 8.0) == pytest.approx(2.0 * effective)
    assert order_of_texture(0.0) == np.inf
