"""Constant of a material, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from radcal.assessment.constant import Constant, constants
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread, gls_mean


def test_the_mean_of_a_balanced_one_way_layout_is_that_of_its_fields():
    """Three fields of four cells: the mean of all, with the variance tau^2 / 3 + (sigma^2 + s^2) / 12."""
    mean = np.array([1.0, 2.0, 4.0, 5.0, 8.0, 7.0, 6.0, 9.0, -3.0, -2.0, 0.0, 2.0])
    found = gls_mean(mean, np.full(12, 0.09), np.repeat([3, 5, 9], 4), Spread(1.5, 0.4))
    assert found[0] == pytest.approx(mean.mean())
    assert found[1] == pytest.approx(1.5**2 / 3 + (0.4**2 + 0.09) / 12)


def test_the_mean_of_an_unbalanced_layout_is_that_of_dense_algebra():
    rng = np.random.default_rng(1)
    patch = np.array([2, 2, 2, 2, 2, 2, 4, 7, 7])
    mean, sampling, spread = rng.normal(size=9), rng.uniform(0.02, 0.5, 9), Spread(0.7, 0.3)
    covariance = np.diag(sampling + spread.within**2) + spread.between**2 * (patch[:, None] == patch)
    inverse = np.linalg.inv(covariance)
    found = gls_mean(mean, sampling, patch, spread)
    assert found[0] == pytest.approx(inverse.sum(axis=0) @ mean / inverse.sum())
    assert found[1] == pytest.approx(1.0 / inverse.sum())
    assert abs(found[0] - mean.mean()) > 0.02


def test_the_effect_of_a_field_is_shrunk():
    """By tau^2 / (tau^2 + v / n): cells of four equal pairs of pixels, whose sampling variance is known by hand."""
    values = np.array([0.0, 2.0, 0.0, 2.0, 6.0, 8.0, 6.0, 8.0])
    patch, block = np.repeat([1, 2], 4), np.repeat([0, 1, 0, 1], 2)
    ground = Ground(values, np.full(8, 40.0), patch, block)
    constant = Constant(ground, Spread(2.0, 1.0))
    # residuals of +-1 about the mean of all, as cells of one pair leave too few degrees of freedom
    own = 1.0**2 + np.sum((values - 4.0) ** 2) / 7.0 / 2.0
    shrunk = 4.0 / (4.0 + own / 2.0)
    assert constant.level_db == pytest.approx(4.0)
    # two fields of two cells each
    assert constant.variance == pytest.approx(4.0 / 2.0 + own / 4.0)
    np.testing.assert_allclose(constant.effects.effect_db, [-3.0 * shrunk, 3.0 * shrunk])


def test_one_large_field_does_not_decide():
    """Nine fields at -20 dB, one of ten times their size at -14 dB."""
    rng = np.random.default_rng(2)
    patch = np.concatenate([np.repeat(np.arange(1, 10), 200), np.full(2000, 10)])
    block = np.concatenate([np.tile(np.repeat(np.arange(4), 50), 9), np.repeat(np.arange(40), 50)])
    values = np.where(patch == 10, -14.0, -20.0) + rng.normal(0.0, 2.0, patch.size)
    found = constants({"field": Ground(values, np.full(patch.size, 40.0), patch, block)})["field"]
    assert found.level_db == pytest.approx(-19.4, abs=0.15)
    assert values.mean() > -17.2
    means = [values[patch == label].mean() for label in range(1, 11)]
    assert found.spread.between == pytest.approx(np.std(means, ddof=1), rel=0.05)


def test_the_level_itself_is_unknown_to_the_spread_of_fields():
    """Variances about a mean that is estimated: the same whatever the level."""
    rng = np.random.default_rng(5)
    patch, block = np.repeat(np.arange(6), 200), np.tile(np.repeat(np.arange(4), 50), 6)
    values = (1.2 * rng.normal(size=6))[patch] + rng.normal(0.0, 2.0, patch.size)
    ground = Ground(values, np.full(patch.size, 40.0), patch, block)
    found, level, other = (
        constants(grounds)["a"].spread.between
        for grounds in ({"a": ground}, {"a": replace(ground, values_db=values - 25.0)}, {"a": ground, "b": ground})
    )
    assert found == pytest.approx(level, rel=1e-9)
    means = values.reshape(6, 200).mean(axis=1)
    assert found == pytest.approx(means.std(ddof=1), rel=0.2)
    assert other != found
