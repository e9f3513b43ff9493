import numpy as np
import pytest
from registration_samples import smooth_field

from radcal.registration.displacement import compose, invert, warp

SHAPE = (90, 120)


def test_a_whole_shift_moves_pixels_unchanged():
    image = np.random.default_rng(0).normal(size=SHAPE).astype(np.float32)
    moved = warp(image, np.broadcast_to(np.array([3.0, -2.0])[:, None, None], (2, *SHAPE)))
    np.testing.assert_array_equal(moved[:-3, 2:], image[3:, :-2])
    assert np.isnan(moved[-3:]).all()
    assert np.isnan(moved[:, :2]).all()


def test_nearest_pixels_keep_the_variance_of_speckle():
    image = np.random.default_rng(1).normal(size=SHAPE).astype(np.float32)
    half = np.full((2, *SHAPE), 0.4)
    assert np.nanvar(warp(image, half)) == pytest.approx(image.var(), rel=0.02)


def test_gaps_stay_gaps():
    image = np.zeros(SHAPE, dtype=np.float32)
    image[40, 50] = np.nan
    moved = warp(image, np.zeros((2, *SHAPE)))
    assert np.isnan(moved[40, 50])
    assert np.count_nonzero(np.isnan(moved)) == 1


@pytest.mark.parametrize("length", [0.5, 3.0, 8.0])
def test_a_field_and_its_inverse_compose_to_nothing(length):
    field = smooth_field(SHAPE, 2, length, 15.0)
    inside = (slice(None), slice(12, -12), slice(12, -12))
    for both in (compose(field, invert(field)), compose(invert(field), field)):
        assert np.abs(both[inside]).max() < 0.02


def test_shifts_add():
    one, two = (np.broadcast_to(np.array(v)[:, None, None], (2, *SHAPE)) for v in ([1.0, 2.0], [-3.0, 0.5]))
    np.testing.assert_allclose(compose(one, two), one + two)


def test_a_folding_field_has_no_inverse():
    rows, _ = np.indices(SHAPE)
    field = np.stack([40.0 * np.sin(rows / 4.0), np.zeros(SHAPE)])
    with pytest.raises(ValueError, match="folds"):
        invert(field)
