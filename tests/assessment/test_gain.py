"""Comparison of two predictors over fields."""

from __future__ import annotations

import numpy as np
import pytest

from radcal.assessment.gain import Gain, field_gains, power


def test_gains_are_by_field():
    patch = np.array([4, 4, 9])
    field, gain = field_gains(patch, np.array([1.0, -1.0, 3.0]), np.array([2.0, -2.0, 1.5]))
    assert field.tolist() == [4, 9]
    np.testing.assert_allclose(gain, [np.log(2.0), -np.log(2.0)])


def test_the_standard_error_is_the_jackknifes():
    gains = np.array([0.4, -0.1, 0.7, 0.2, 0.05])
    found = Gain.of(np.arange(5), gains)
    without = np.array([np.delete(gains, k).mean() for k in range(5)])
    assert found.error == pytest.approx(np.sqrt(4.0 / 5.0 * np.sum((without - without.mean()) ** 2)))
    assert found.better
    assert not found.worse
    assert found.ratio == pytest.approx(np.exp(-0.25))
    # and, nearly, the bootstrap's
    rng = np.random.default_rng(1)
    drawn = gains[rng.integers(0, 5, (20_000, 5))].mean(axis=1)
    assert drawn.std() == pytest.approx(found.error * np.sqrt(4.0 / 5.0), rel=0.02)


def test_several_gains_of_a_field_count_once():
    """Fields of 0.2 (twice), 0.5 and -0.1: their means scatter by 0.3."""
    found = Gain.of(np.array([3, 8, 3, 5]), np.array([0.1, 0.5, 0.3, -0.1]))
    assert (found.mean, found.fields) == (pytest.approx(0.2), 3)
    assert found.error == pytest.approx(0.3 / np.sqrt(3.0))


def test_a_gain_within_its_error_is_none():
    for sign in (1.0, -1.0):
        found = Gain.of(np.arange(4), sign * np.array([0.9, -0.5, 0.3, -0.4]))
        assert not found.better
        assert not found.worse
    assert Gain.of(np.arange(4), np.array([-0.9, -0.5, -0.3, -0.4])).worse


def test_one_field_has_no_error_and_no_verdict():
    assert not Gain.of(np.array([7, 7]), np.array([2.0, 3.0])).better
    assert Gain.of(np.array([7, 7]), np.array([2.0, 3.0])).mean == 2.5
    nothing = Gain.of(np.empty(0, dtype=int), np.empty(0))
    assert nothing.fields == 0
    assert not nothing.better
    assert not nothing.worse


def test_power_is_the_gain_expected_in_standard_errors():
    """Against draws: two fields of three cells each, whose errors are partly shared."""
    rng = np.random.default_rng(2)
    patch = np.repeat([1, 2], 3)
    difference = np.array([0.5, 0.8, 1.0, -0.4, -0.9, -0.2])
    common, own = np.full(6, 0.3), np.array([0.1, 0.2, 0.1, 0.3, 0.1, 0.2])
    shared = np.sqrt(0.3) * rng.normal(size=(200_000, 2))[:, [0, 0, 0, 1, 1, 1]]
    errors = shared + np.sqrt(own) * rng.normal(size=(200_000, 6))
    gains = ((difference + errors) ** 2 - errors**2).sum(axis=1)
    assert power(patch, difference, common, own) == pytest.approx(gains.mean() / gains.std(), rel=0.02)
    # folds that hold all angles alike are predicted alike: no power
    assert power(patch, 0.01 * difference, common, own) < 0.05
