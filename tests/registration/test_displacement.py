import numpy as np
import pytest

from radcal.registration.displacement import invert, warp

SHAPE = (90, 120)


def test_gaps_stay_gaps():
    image = np.zeros(SHAPE, dtype=np.float32)
    image[40, 50] = np.nan
    moved = warp(image, np.zeros((2, *SHAPE)))
    assert np.isnan(moved[40, 50])
    assert np.count_nonzero(np.isnan(moved)) == 1


def test_a_folding_field_has_no_inverse():
    rows, _ = np.indices(SHAPE)
    field = np.stack([40.0 * np.sin(rows / 4.0), np.zeros(SHAPE)])
    with pytest.raises(ValueError, match="folds"):
        invert(field)
