"""Levels against numpy's quantiles, known offsets and a published example."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radcal.measurement.levels import Levels, image_levels, median_and_range, offset_levels, pooled_offset


def test_equal_materials_are_averaged_by_their_errors() -> None:
    # no more scatter than sampling explains: inverse-variance weights
    offset, error = pooled_offset([1.0, 1.0, 1.0], [0.1, 0.2, 0.4])
    assert offset == pytest.approx(1.0)
    assert error == pytest.approx((1 / 0.01 + 1 / 0.04 + 1 / 0.16) ** -0.5)


def test_scatter_beyond_sampling_evens_the_weights() -> None:
    found = np.array([-3.0, 1.0, 5.0])
    offset, error = pooled_offset(found, [0.02, 0.02, 0.02])
    assert offset == pytest.approx(found.mean(), abs=0.01)
    assert error == pytest.approx(found.std(ddof=1) / np.sqrt(3), rel=0.01)


def test_dersimonian_and_laird_by_hand() -> None:
    # w = 4, 1: mean 1.6, Q = 4 x 0.16 + 1 x 2.56 = 3.2... by the formula tau2 = (Q - 1) / (5 - 17/5)
    offset, error = pooled_offset([2.0, 0.0], [0.5, 1.0])
    between = (4 * 0.4**2 + 1 * 1.6**2 - 1) / (5 - 17 / 5)
    weights = np.array([1 / (0.25 + between), 1 / (1.0 + between)])
    assert offset == pytest.approx(2.0 * weights[0] / weights.sum())
    assert error == pytest.approx(weights.sum() ** -0.5)


@given(shift=st.floats(-30, 30), values=st.lists(st.floats(-5, 5), min_size=1, max_size=6))
def test_an_offset_moves_with_the_measurement(shift: float, values: list[float]) -> None:
    errors = 0.1 + 0.1 * np.arange(len(values))
    one, other = (pooled_offset(np.array(values) + s, errors) for s in (0.0, shift))
    assert other[0] - one[0] == pytest.approx(shift, abs=1e-9)
    assert other[1] == pytest.approx(one[1], rel=1e-6)


def test_offset_is_taken_from_the_measured_image_only() -> None:
    levels = offset_levels("offset", {"grass": (3.0, 0.1)})
    np.testing.assert_allclose(levels.apply([1.0, 5.0], levels.measured), [-2.0, 2.0])
    assert levels.simulated({}) == (0.0, 1.0)
    assert levels.unit == "dB"
    assert "+3.00 +- 0.10 dB" in levels.sentence
    assert levels.sentence.endswith(
        "; this offset is subtracted, and is right only if the laws of these materials are."
    )


def test_none_takes_nothing_but_says_what_it_sees() -> None:
    levels = offset_levels("none", {"grass": (3.0, 0.1)})
    assert levels.measured == (0.0, 1.0)
    assert levels.doubtful
    assert levels.sentence == (
        "the measured image is taken at its own level, but the measured image lies +3.00 +- 0.10 dB from the reference "
        "run on grass: are its calibration (if this alone is wrong, target.normalisation: offset), the incidence in "
        "section radar, or the laws of these materials wrong?"
    )
    assert not offset_levels("none", {"grass": (0.2, 0.01)}).doubtful
    assert not offset_levels("none", {}).doubtful
    assert "no material" in offset_levels("none", {}).sentence


@pytest.mark.parametrize(
    ("offset_db", "error_db", "doubtful"),
    [(0.6, 0.3, False), (0.6, 0.19, True), (-0.6, 0.19, True), (0.45, 0.01, False), (0.5, 0.01, False)],
)
def test_an_offset_is_doubtful_beyond_half_a_db_and_three_errors(offset_db, error_db, doubtful) -> None:
    assert offset_levels("none", {"grass": (offset_db, error_db)}).doubtful is doubtful
    assert not offset_levels("offset", {"grass": (offset_db, error_db)}).doubtful


@pytest.mark.parametrize(
    ("differences", "at_odds", "doubtful"),
    [
        ({"wood": (-8.4, 0.1), "water": (-17.2, 0.2)}, True, True),  # mean -12.8 +- 4.4 dB, which is not significant
        ({"wood": (2.0, 0.1), "water": (-2.0, 0.1)}, True, True),
        ({"wood": (0.2, 0.1), "water": (-2.7, 0.1), "grass": (0.3, 0.1)}, False, False),  # 3.0 dB
        ({"wood": (2.5, 1.0), "water": (-1.5, 1.0)}, False, False),  # 4 dB, but less than three errors
        ({"wood": (-6.2, 2.5)}, False, True),  # far, though uncertain
        ({"wood": (-5.8, 2.5)}, False, False),
    ],
)
def test_materials_at_odds_and_a_far_offset_are_doubtful(differences, at_odds, doubtful) -> None:
    """A mean that is not significant, because the materials disagree, is said with the offset on each of them."""
    levels = offset_levels("none", differences)
    assert (levels.at_odds, levels.doubtful) == (at_odds, doubtful)
    named = ", ".join(f"{name} {db:+.2f} +- {error:.2f}" for name, (db, error) in differences.items())
    assert (f"({named} dB), which contradict each other: are the names or" in levels.sentence) is at_odds
    removed = offset_levels("offset", differences)
    assert (removed.at_odds, removed.doubtful) == (at_odds, at_odds)
    assert (f"({named} dB), which contradict each other: are the names or" in removed.sentence) is at_odds


def test_a_far_offset_on_materials_that_agree_names_each() -> None:
    levels = offset_levels("none", {"wood": (-8.4, 0.1), "water": (-9.2, 0.2)})
    assert not levels.at_odds
    assert "on wood, water (wood -8.40 +- 0.10, water -9.20 +- 0.20 dB): are its calibration" in levels.sentence
    near = offset_levels("none", {"wood": (-2.4, 0.1), "water": (-3.2, 0.2)})
    assert "on wood, water: are its calibration" in near.sentence


@pytest.fixture
def images() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    material = rng.integers(0, 4, size=(30, 40)).astype(np.uint8)
    reference = rng.normal(-10, 4, size=material.shape).astype(np.float32)
    measured = (2.0 * reference + 5.0).astype(np.float32)
    measured[:3] = np.nan
    return measured, reference, material


def test_image_levels_are_median_and_quartiles(images: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    measured, reference, material = images
    levels = image_levels(measured, reference, material, {"a": 1, "b": 3})
    valid = (material > 0) & np.isfinite(measured)
    mapped = levels.apply(measured[valid], levels.measured)
    assert np.median(mapped) == pytest.approx(0.0, abs=1e-6)
    assert np.subtract(*np.percentile(mapped, [75, 25])) == pytest.approx(1.0, rel=1e-6)
    assert levels.scale == pytest.approx(2.0, rel=1e-5)
    assert levels.offset_db == pytest.approx(np.median(measured[valid]) - np.median(reference[valid]), abs=1e-5)
    assert "not identified" not in levels.sentence
    said = image_levels(measured, reference, material, {"a": 1, "b": 2, "c": 3}).sentence
    assert "all materials are calibrated, so that a level common to all laws is not identified" in said


def test_a_run_is_mapped_by_its_own_whole_image(images: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    measured, reference, material = images
    levels = image_levels(measured, reference, material, {"a": 1, "b": 3})
    run = reference.copy()
    run[material == 1] += 7.0
    run[material == 3] -= 2.0
    record = {name: run[material == k] for name, k in {"a": 1, "b": 3}.items()}
    valid = (material > 0) & np.isfinite(measured)
    assert levels.simulated(record) == pytest.approx(median_and_range(run[valid]), rel=1e-6)


def test_no_levels_change_nothing() -> None:
    levels = Levels()
    np.testing.assert_array_equal(levels.apply([1.0, 2.0], levels.measured), [1.0, 2.0])
    assert levels.simulated({}) == (0.0, 1.0)
