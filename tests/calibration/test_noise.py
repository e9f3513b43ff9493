"""The scatter of equal runs, against many runs and against what is known in closed form."""

import numpy as np
import pytest

from radcal import skewnormal
from radcal.calibration.scoring import noise_variance, scatter
from radcal.ground.bins import class_cumulants
from radcal.inference.moments import from_cumulants, from_dp

DP = np.array([-12.0, 3.0, -2.0])
N = 800


def sample(seed):
    return skewnormal.sample(DP, N, np.random.default_rng(seed))


def density(values_db, pixels):
    """Of one density, fitted to the pixels."""
    return from_dp(skewnormal.fit(values_db[pixels]).dp)[None]


def moments(values_db, pixels):
    """Of one sample, without a fit."""
    return from_cumulants(class_cumulants(values_db[pixels], np.zeros(pixels.size, dtype=np.int64), 1))


def test_two_runs_tell_the_scatter_of_many():
    """Of normal pixels: sd^2 / n, 1 / 2n and 6 / n (Stuart and Ord, section 10.9).

    Sixty bootstrap samples tell a variance to 18 %, so that the median of 40 pairs of runs has an error of 4 %.
    """
    rng = np.random.default_rng(3)
    pairs = rng.normal(-9.0, 2.5, (40, 2, N))
    found = np.array([noise_variance(*pair, moments, np.random.default_rng(k))[0] for k, pair in enumerate(pairs)])
    ratio = found / np.array([2.5**2, 0.5, 6.0]) * N
    np.testing.assert_allclose(np.median(ratio, axis=0), 1.0, atol=0.15)
    # once in a hundred the two runs happen to lie farther apart than their pixels tell
    assert np.count_nonzero(ratio > 3.0) <= 3
    assert ratio.min() > 0.4


def test_a_gain_common_to_all_pixels_is_seen():
    found = noise_variance(sample(0), sample(0) + 0.7, density, np.random.default_rng(1))
    assert found[0, 0] == pytest.approx(0.5 * 0.7**2, rel=1e-6)
    np.testing.assert_allclose(found[0, 1:], 0.0, atol=1e-9)


def test_correlated_pixels_count_for_fewer():
    alone, together = (
        noise_variance(sample(0), sample(1), density, np.random.default_rng(1), n) for n in (None, N / 4)
    )
    np.testing.assert_allclose(together, 4.0 * alone)


def test_each_bin_has_a_noise_of_its_own():
    """Pixels drawn again keep their bins: few pixels scatter more than many."""
    member = (np.arange(N) % 5 == 0).astype(np.int64)  # a fifth of them in the second bin

    def bins(values_db, pixels):
        return from_cumulants(class_cumulants(values_db[pixels], member[pixels], 2))

    each = [noise_variance(sample(0), sample(1), bins, np.random.default_rng(seed)) for seed in range(10)]
    found = np.mean(each, axis=0)
    assert found.shape == (2, 3)
    variance = skewnormal.centred(DP)[1] ** 2
    np.testing.assert_allclose(found[:, 0], [variance / (0.8 * N), variance / (0.2 * N)], rtol=0.25)
    assert (found[1] > 1.5 * found[0]).all()


def test_the_scatter_is_given_by_standard_deviations():
    found = scatter("soil", [[0.0044, 1.5e-4, 0.08], [0.0244, 0.5e-4, 0.1]])
    assert (found.code, found.about) == ("scatter", "soil")
    assert found.numbers == pytest.approx({"mean_db": 0.12, "sd_percent": 1.0, "skewness": 0.3})
