"""Correlation of the pixels of a material, against sums over all pairs and the scatter of images."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from radcal.ground.correlation import Correlation, estimate_correlation, independent_pairs

SHAPE = (150, 170)


def effective_sample_size(image, inside, drawn, incidence=None):
    return estimate_correlation(image, inside, incidence).effective(drawn)


def test_correlated_pixels_on_a_slope_of_level_stay_correlated():
    smooth = uniform_filter(np.random.default_rng(0).normal(size=SHAPE), (3, 5), mode="wrap")
    slope = 1.5 * smooth.std() * np.linspace(-1.0, 1.0, SHAPE[0])[:, None]
    inside = np.arange(smooth.size)
    found = effective_sample_size((smooth + slope).astype(np.float32), inside, inside)
    assert found == pytest.approx(smooth.size / 15, rel=0.25)


def test_opposite_edges_are_no_neighbours():
    """Three rows at the top, and the same values again in three rows at the bottom, or others."""
    image = np.random.default_rng(0).normal(size=SHAPE).astype(np.float32)
    same = image.copy()
    same[-3:] = same[:3]
    inside = np.flatnonzero(np.isin(np.indices(SHAPE)[0], [0, 1, 2, 147, 148, 149]))
    found, other = (effective_sample_size(one, inside, inside) for one in (same, image))
    assert found == pytest.approx(other, rel=0.15)


def test_what_the_incidence_explains_is_no_correlation():
    """Hills of a few pixels, and a law on their slopes."""
    rng = np.random.default_rng(0)
    incidence = 35.0 + 30.0 * uniform_filter(rng.normal(size=SHAPE), 5, mode="wrap")
    noise = rng.normal(size=SHAPE)
    image = (noise - 0.3 * incidence).astype(np.float32)
    inside = np.arange(image.size)
    alone = effective_sample_size(noise.astype(np.float32), inside, inside)
    without = effective_sample_size(image, inside, inside)
    residual = effective_sample_size(image, inside, inside, incidence.astype(np.float32))
    assert without < 0.3 * alone
    assert residual == pytest.approx(alone, rel=0.05)
    # nor what a bent law explains
    bent = (noise - 0.05 * (incidence - 35.0) ** 2).astype(np.float32)
    assert effective_sample_size(bent, inside, inside) < 0.3 * alone
    assert effective_sample_size(bent, inside, inside, incidence.astype(np.float32)) > 0.85 * alone
    # correlated pixels stay correlated
    smooth = uniform_filter(rng.normal(size=SHAPE), (3, 5), mode="wrap") - 0.3 * incidence
    found = effective_sample_size(smooth.astype(np.float32), inside, inside, incidence.astype(np.float32))
    assert found == pytest.approx(image.size / 15, rel=0.3)


def test_lags_are_those_of_a_moving_average():
    """Triangles of the filter's width in both directions, and nothing beyond."""
    image = uniform_filter(np.random.default_rng(3).normal(size=(400, 500)), (2, 3), mode="wrap").astype(np.float32)
    found = estimate_correlation(image, np.arange(image.size)).lags
    down, across = (np.maximum(1.0 - np.abs(np.arange(-6, 7)) / width, 0.0) for width in (2, 3))
    np.testing.assert_allclose(found, np.outer(down, across), atol=0.02)
    assert np.count_nonzero(found) == 3 * 5


def test_noise_of_the_lags_does_not_add_up():
    """Of 168 lags without correlation half are positive: the number of independent pixels is that of all."""
    rng, every = np.random.default_rng(4), np.arange(3000)
    images = [rng.normal(size=(60, 50)).astype(np.float32) for _ in range(9)]
    assert np.median([effective_sample_size(image, every, every) for image in images]) == 3000.0


def test_pairs_are_those_of_all_pixels_two_by_two():
    rng = np.random.default_rng(5)
    width, lags = 9, np.zeros((13, 13))
    lags[5:8, 4:9] = [[0.0, 0.3, 0.4, 0.1, 0.0], [0.2, 0.5, 1.0, 0.5, 0.2], [0.0, 0.1, 0.4, 0.3, 0.0]]
    pixels = np.sort(rng.choice(8 * width, 40, replace=False))
    group = rng.integers(0, 3, 40)
    row, column = np.divmod(pixels, width)
    each = lags[
        np.clip(row[:, None] - row + 6, 0, 12), np.clip(column[:, None] - column + 6, 0, 12)
    ]  # lags beyond are 0 at the edge of the table
    found = Correlation(lags, width).pairs(pixels, group, 3)
    for power in (1, 2, 3):
        wanted = [[np.mean(each[np.ix_(group == i, group == j)] ** power) for j in range(3)] for i in range(3)]
        np.testing.assert_allclose(found[power - 1], wanted, rtol=1e-12)
    np.testing.assert_allclose(
        Correlation(np.eye(13)[6][:, None] * np.eye(13)[6], width).pairs(pixels, group, 3), independent_pairs(group, 3)
    )


def exact_moving_average(shape, seed):
    """Values whose circular autocorrelation is that of means over 3 x 5 pixels to the last digit, without noise."""
    white = np.fft.fft2(np.random.default_rng(seed).normal(size=shape))
    box = np.zeros(shape)
    box[:3, :5] = 1.0
    return np.fft.ifft2(white / np.abs(white) * np.fft.fft2(box)).real.astype(np.float32)


@pytest.mark.parametrize(("side", "corner"), [(101, True), (59, False)])
def test_lags_count_from_two_of_bartletts_standard_errors_on(side, corner):
    """The outermost lag of the triangles is 1/3 times 1/5; the squares of all add up to 19/9 times 17/5."""
    error = np.sqrt(19.0 / 9.0 * 3.4) / side
    assert (2.0 * error < 1.0 / 15.0) == corner
    lags = estimate_correlation(exact_moving_average((side, side), 6), np.arange(side**2)).lags
    assert (lags[[4, 4, 8, 8], [2, 10, 2, 10]] > 0.0).tolist() == [corner] * 4
    assert (lags[4:9, 3:10] > 0.0).all()


def test_matrices_are_positive_definite_where_lags_are_not():
    """Noisy lags may be no correlation function: pixels of two groups in turn, each like its neighbours alone."""
    lags = np.zeros((13, 13))
    lags[6, 5:8] = [0.9, 1.0, 0.9]
    found = Correlation(lags, 200).pairs(np.arange(200), np.arange(200) % 2, 2)
    assert np.linalg.eigvalsh(found).min() > 0.0


def test_pixels_of_one_level_are_equal_within_six_rows_and_columns():
    """Every pair of them that is no farther apart is correlated by 1; farther away nothing is known."""
    drawn = np.union1d(np.arange(400), np.arange(40, 1700, 170))
    row, column = np.divmod(drawn, SHAPE[1])
    near = (np.abs(row[:, None] - row) <= 6) & (np.abs(column[:, None] - column) <= 6)
    found = effective_sample_size(np.ones(SHAPE, dtype=np.float32), np.arange(1700), drawn)
    assert found == pytest.approx(1.0 / near.mean(), rel=1e-9)
    # all of a small area are one pixel
    assert effective_sample_size(np.ones(SHAPE, dtype=np.float32), np.arange(500), np.arange(7)) == 1.0
