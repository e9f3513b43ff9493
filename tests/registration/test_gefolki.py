from functools import partial

import numpy as np
import pytest
import registration_samples
from registration_samples import displaced, speckled
from scipy.stats import rankdata
from threadpoolctl import threadpool_limits

from radcal.registration.gefolki import (
    Level,
    _step,
    _whole_ranks,
    find_flow,
    local_correlation,
    pyramid,
    rank_transform,
)
from radcal.registration.spline_field import Prior

SHAPE = (240, 260)
ground, smooth_field = partial(registration_samples.ground, SHAPE), partial(registration_samples.smooth_field, SHAPE)


def pair(field, seed=1):
    """Two images with speckle of their own, the second displaced."""
    mean = ground(seed)
    return speckled(mean, 10), speckled(displaced(mean, field), 11)


def gefolki(fixed, moving, keep=None):
    return find_flow(pyramid(fixed, moving), keep).displacement_px


def error(found, field, margin=20):
    return np.hypot(*(found - field))[margin:-margin, margin:-margin].mean()


@pytest.mark.parametrize("length", [2.0, 6.0])
def test_a_smooth_field_is_found_under_independent_speckle(length):
    field = smooth_field(3, length, 50.0)
    fixed, moving = pair(field)
    assert error(gefolki(fixed, moving), field) < 0.35 < 0.5 * error(np.zeros_like(field), field)


@pytest.mark.slow
def test_the_field_is_as_smooth_as_the_images_say():
    priors = {}
    for sigma, most in ((25.0, 0.75), (90.0, 0.3)):
        field = smooth_field(6, 5.0, sigma)
        fixed, moving = pair(field)
        flow = find_flow(pyramid(fixed, moving))
        priors[sigma] = flow.posterior.prior
        assert error(flow.displacement_px, field) < most
        # neither does as well with a field 4 times as stiff or as soft
        for times in (0.25, 4.0):
            other = Prior(priors[sigma].spread_px, times * priors[sigma].length_px)
            assert error(find_flow(pyramid(fixed, moving), prior=other).displacement_px, field) > 1.1 * error(
                flow.displacement_px, field
            )
    assert priors[90.0].length_px > 2.0 * priors[25.0].length_px


def test_threads_change_nothing():
    fixed, moving = pair(smooth_field(3, 4.0, 50.0))
    with threadpool_limits(1):
        alone = gefolki(fixed, moving)
    with threadpool_limits(2):
        np.testing.assert_array_equal(gefolki(fixed, moving), alone)


def test_contrast_turned_over_is_registered_alike():
    field = smooth_field(4, 4.0, 50.0)
    fixed, moving = pair(field)
    assert error(gefolki(fixed, -moving), field) < 0.4
    # half of the image turned over
    mixed = moving.copy()
    mixed[:, SHAPE[1] // 2 :] *= -1.0
    assert error(gefolki(fixed, mixed), field) < 0.45


def test_pixels_that_do_not_count_pull_nothing():
    field = smooth_field(7, 3.0, 50.0)
    fixed, moving = pair(field)
    keep = np.ones(SHAPE, dtype=bool)
    keep[:, 170:] = False
    spoilt = moving.copy()
    spoilt[:, 190:] = speckled(ground(99), 12)[:, 190:]
    found = gefolki(fixed, spoilt, keep=keep)
    assert np.hypot(*(found - field))[20:-20, 20:150].mean() < 0.5


def test_rank_transform_is_the_rank_in_the_window():
    image = np.random.default_rng(0).permutation(np.arange(33 * 33)).reshape(33, 33).astype(np.float32)
    image[2, 3] = np.nan
    found = rank_transform(image)[16, 16]
    there = image[np.isfinite(image)]
    expected = rankdata(there, method="max")[there == image[16, 16]][0] / there.size * 2.0 - 1.0
    assert found == pytest.approx(expected, abs=0.03)
    assert rank_transform(image)[2, 3] == 0.0
    np.testing.assert_array_equal(rank_transform(np.full((9, 9), np.nan, dtype=np.float32)), 0.0)


def test_equal_values_share_their_rank_in_the_whole_image_and_gaps_have_that_of_a_neighbour():
    image = np.random.default_rng(0).integers(0, 50, (20, 30)).astype(np.float32)
    image[4, 5] = np.nan
    there = np.isfinite(image)
    found = _whole_ranks(image)
    np.testing.assert_allclose(found[there], (2.0 * rankdata(image[there]) - 1.0) / there.sum() - 1.0, atol=1e-6)
    assert found[4, 5] in (found[3, 5], found[5, 5], found[4, 4], found[4, 6])
    np.testing.assert_array_equal(_whole_ranks(np.full((9, 9), np.nan, dtype=np.float32)), 0.0)


def test_local_correlation_is_that_of_numpy_in_a_window():
    one, two = np.random.default_rng(0).normal(size=(2, 33, 33)).astype(np.float32)
    two += 0.5 * one
    expected = (one * two).sum() / np.sqrt((one**2).sum() * (two**2).sum())
    assert local_correlation(one, two)[16, 16] == pytest.approx(expected, abs=1e-5)


def waves(row, column):
    return (np.sin(row / 5.0) + np.cos(column / 4.0 + 0.3) + np.sin((row + column) / 7.0)).astype(np.float32)


@pytest.mark.parametrize(("scale", "contrast"), [(1, 1.0), (4, 1.0), (2, -1.0)])
def test_one_step_finds_a_small_shift_in_pixels_of_the_full_image(scale, contrast):
    shift = np.array([0.21, -0.34])  # in pixels of the level
    rows, columns = np.indices((96, 120), dtype=float)
    noise = 0.05 * np.random.default_rng(3).normal(size=(2, 96, 120)).astype(np.float32)
    fixed = waves(rows, columns) + noise[0]
    moving = contrast * waves(rows - shift[0], columns - shift[1]) + noise[1]
    ones = np.ones_like(fixed)
    parts = _step(Level(scale, fixed, moving, ones, ones), np.zeros((2, 96, 120)))
    a00, a01, a11, b0, b1 = (float(part[2:-2, 2:-2].sum()) for part in parts)
    found = np.linalg.solve([[a00, a01], [a01, a11]], [b0, b1])
    # central differences are too flat by 1 %; correlations count up to 0.8, in the curvature once more than in the pull
    np.testing.assert_allclose(found, scale * shift / 0.8, rtol=0.08)


def test_pixels_count_as_their_surroundings_correlate():
    """Curvature of a cell: squared gradient over the variance, times r^2 / (1 - r^2)."""
    rows, columns = np.indices((96, 120), dtype=float)
    noise = np.random.default_rng(3).normal(size=(2, 96, 120)).astype(np.float32)
    one, two = waves(rows, columns) + noise
    ones = np.ones_like(one)
    found = _step(Level(3, one, two, ones, ones), np.zeros((2, 96, 120)))[0]
    r = np.corrcoef(one.ravel(), two.ravel())[0, 1]
    assert 0.4 < r < 0.7
    gradient = np.gradient(0.5 * (one + two))[0]
    expected = (gradient**2).mean() / (0.5 * (one.var() + two.var())) / 3**2 * r**2 / (1.0 - r**2)
    # correlations in windows of 33 pixels scatter about that of the image
    assert found[2:-2, 2:-2].mean() / 64 == pytest.approx(expected, rel=0.15)
