"""The scatter of equal runs, against many runs and against what is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from radcal import skewnormal
from radcal.calibration.noise import noise_sentence, noise_variance

DP = np.array([-12.0, 3.0, -2.0])
N = 800


def sample(seed: int) -> np.ndarray:
    return skewnormal.sample(DP, N, np.random.default_rng(seed))


def test_two_runs_tell_the_scatter_of_many() -> None:
    mean, sd, skewness = np.array([skewnormal.centred(skewnormal.fit(sample(k)).dp) for k in range(10, 210)]).T
    scatter = np.array([mean.var(), np.log(sd).var(), skewness.var()])
    assert mean.var() == pytest.approx(skewnormal.centred(DP)[1] ** 2 / N, rel=0.3)
    found = [noise_variance(sample(2 * k), sample(2 * k + 1), np.random.default_rng(k)) for k in range(5)]
    ratio = np.array(found) / scatter
    # never far too small; too large once in a hundred, where the two runs happen to lie far apart
    assert (ratio > 0.4).all()
    assert np.count_nonzero(ratio > 2.5) <= 1
    np.testing.assert_allclose(np.median(ratio, axis=0), 1.0, atol=0.4)


def test_equal_runs_have_none() -> None:
    np.testing.assert_array_equal(noise_variance(sample(0), sample(0), np.random.default_rng(1)), 0.0)


def test_what_the_runs_share_is_no_noise() -> None:
    """Equal speckle with small differences, as from sums in another order: not the speckle's scatter."""
    each = 0.01 * np.random.default_rng(5).standard_normal((2, N))
    found = noise_variance(sample(0) + each[0], sample(0) + each[1], np.random.default_rng(1))
    assert found[0] == pytest.approx(0.01**2 / N, rel=0.6)


def test_a_gain_common_to_all_pixels_is_seen() -> None:
    found = noise_variance(sample(0), sample(0) + 0.7, np.random.default_rng(1))
    assert found[0] == pytest.approx(0.5 * 0.7**2, rel=1e-6)
    np.testing.assert_allclose(found[1:], 0.0, atol=1e-9)


def test_correlated_pixels_count_for_fewer() -> None:
    alone, together = (noise_variance(sample(0), sample(1), np.random.default_rng(1), n) for n in (None, N / 4))
    np.testing.assert_allclose(together, 4.0 * alone)


def test_the_sentence_has_standard_deviations() -> None:
    said = noise_sentence("soil", [0.0144, 1e-4, 0.09])
    assert "soil: " in said
    for words in ("mean scatters by 0.12 dB", "deviation by 1 %", "skewness by 0.3 "):
        assert words in said
