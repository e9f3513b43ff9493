from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.ndimage import uniform_filter

from radcal import skewnormal
from radcal.measurement.goodness import _distances as distances
from radcal.measurement.goodness import effective_sample_size, goodness_of_fit

SHAPE = (150, 170)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_distances_are_those_of_scipy(sign):
    """Mirrored, the largest difference lies on the other side of a step."""
    values = np.sort(sign * np.random.default_rng(1).normal(-10.0, 3.0, 400))
    fitted = stats.norm(-10.2 * sign, 2.9)
    ks, ad = distances(values, (-10.2 * sign, 2.9, 0.0))
    assert ks == pytest.approx(stats.kstest(values, fitted.cdf).statistic, rel=1e-9)
    # the definition as an integral, weighted by 1 / (F (1 - F)), step by step between the values
    f = np.concatenate([[1e-15], fitted.cdf(values), [1 - 1e-15]])
    share = np.arange(values.size + 1) / values.size
    integral = share**2 * np.diff(np.log(f / (1 - f))) + 2 * share * np.diff(np.log(1 - f)) - np.diff(f + np.log(1 - f))
    assert ad == pytest.approx(values.size * integral.sum(), rel=1e-6)


def test_p_values_of_fitted_samples_are_uniform():
    rng = np.random.default_rng(2)
    p = []
    for _ in range(60):
        x = skewnormal.sample((-12.0, 4.0, -2.0), 200, rng)
        p.append(goodness_of_fit(x, skewnormal.fit(x).dp, rng, draws=39).ad_p)
    assert stats.kstest(p, "uniform").pvalue > 0.01


@pytest.mark.parametrize(
    "values",
    [
        np.concatenate([np.random.default_rng(3).normal(-20, 2, 500), np.random.default_rng(4).normal(-8, 2, 500)]),
        np.random.default_rng(5).standard_t(2.5, 1000),
        np.random.default_rng(6).uniform(0, 1, 1000),
    ],
    ids=["two grounds", "heavy tails", "uniform"],
)
def test_what_is_no_skew_normal_is_told(values):
    found = goodness_of_fit(values, skewnormal.fit(values).dp, np.random.default_rng(0))
    assert found.ad_p == 0.01  # the sample itself is one of a hundred
    assert found.ks > 0.02


def test_fewer_independent_values_are_less_evidence():
    x = np.random.default_rng(8).standard_t(5, 1500)
    dp = skewnormal.fit(x).dp
    many, few = (goodness_of_fit(x, dp, np.random.default_rng(0), effective=n) for n in (1500, 60))
    assert many.ks == few.ks
    assert many.ad_p < few.ad_p


def test_white_pixels_are_all_independent():
    image = np.random.default_rng(0).normal(size=SHAPE).astype(np.float32)
    inside = np.arange(image.size)
    drawn = np.sort(np.random.default_rng(1).choice(inside, 1000, replace=False))
    assert effective_sample_size(image, inside, drawn) == pytest.approx(1000, rel=0.1)


def test_effective_size_is_that_of_the_variance_of_the_mean():
    """Moving averages over 3 x 5 pixels: the mean of all has the variance of that many independent ones."""
    images = [uniform_filter(np.random.default_rng(k).normal(size=SHAPE), (3, 5), mode="wrap") for k in range(300)]
    inside = np.arange(images[0].size)
    ratio = np.mean([image.var() for image in images]) / np.var([image.mean() for image in images])
    found = effective_sample_size(images[0].astype(np.float32), inside, inside)
    assert found == pytest.approx(images[0].size / 15, rel=0.15)
    assert found == pytest.approx(ratio, rel=0.2)  # of 300 means: 8 %
    # few pixels drawn far apart share little
    drawn = np.sort(np.random.default_rng(1).choice(inside, 200, replace=False))
    assert 150 < effective_sample_size(images[0].astype(np.float32), inside, drawn) < 200


def test_a_slope_of_level_is_not_taken_for_correlation():
    image = np.random.default_rng(0).normal(size=SHAPE) + np.linspace(0.0, 4.0, SHAPE[0])[:, None]
    inside = np.arange(image.size)
    drawn = np.sort(np.random.default_rng(1).choice(inside, 1000, replace=False))
    assert effective_sample_size(image.astype(np.float32), inside, drawn) > 800


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
    # correlated pixels stay correlated
    smooth = uniform_filter(rng.normal(size=SHAPE), (3, 5), mode="wrap") - 0.3 * incidence
    found = effective_sample_size(smooth.astype(np.float32), inside, inside, incidence.astype(np.float32))
    assert found == pytest.approx(image.size / 15, rel=0.3)


def test_one_level_everywhere_is_one_pixel():
    assert effective_sample_size(np.ones(SHAPE, dtype=np.float32), np.arange(500), np.arange(400)) == 1.0
