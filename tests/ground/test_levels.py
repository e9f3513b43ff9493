"""Levels against numpy's quantiles, known offsets and a published example."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radcal.ground.levels import Levels, image_levels, median_and_range, offset_levels, pooled_offset
from radcal.words import sentence


def test_equal_materials_are_averaged_by_their_errors():
    # no more scatter than sampling explains: inverse-variance weights
    offset, error = pooled_offset([1.0, 1.0, 1.0], [0.1, 0.2, 0.4])
    assert offset == pytest.approx(1.0)
    assert error == pytest.approx((1 / 0.01 + 1 / 0.04 + 1 / 0.16) ** -0.5)


@given(shift=st.floats(-30, 30), values=st.lists(st.floats(-5, 5), min_size=1, max_size=6))
def test_an_offset_moves_with_the_measurement(shift, values):
    errors = 0.1 + 0.1 * np.arange(len(values))
    one, other = (pooled_offset(np.array(values) + s, errors) for s in (0.0, shift))
    assert other[0] - one[0] == pytest.approx(shift, abs=1e-9)
    assert other[1] == pytest.approx(one[1], rel=1e-6)


def test_offset_is_taken_from_the_measured_image_only():
    levels = offset_levels("offset", {"grass": (3.0, 0.1)})
    np.testing.assert_allclose(levels.apply([1.0, 5.0], levels.measured), [-2.0, 2.0])
    assert levels.simulated({}) == (0.0, 1.0)
    assert levels.unit == "dB"
    assert sentence(levels.finding) == (
        "the measured image lies +3.00 dB (standard error 0.10) from the reference run on grass; this offset is "
        "subtracted."
    )


def test_none_takes_nothing_but_says_what_it_sees():
    levels = offset_levels("none", {"grass": (-7.0, 0.13), "crops": (-7.0, 0.26)})
    assert levels.measured == (0.0, 1.0)
    error = (0.13**-2 + 0.26**-2) ** -0.5
    assert levels.finding.severity == "note"
    assert levels.finding.numbers == {"offset_db": pytest.approx(-7.0), "error_db": pytest.approx(error)}
    assert (
        sentence(levels.finding)
        == f"the measured image lies -7.00 dB (standard error {error:.2f}) from the reference run on grass, crops."
    )
    assert "no material" in sentence(offset_levels("none", {}).finding)


@pytest.fixture
def images():
    rng = np.random.default_rng(1)
    material = rng.integers(0, 4, size=(30, 40)).astype(np.uint8)
    reference = rng.normal(-10, 4, size=material.shape).astype(np.float32)
    measured = (2.0 * reference + 5.0).astype(np.float32)
    measured[:3] = np.nan
    return measured, reference, material


def test_image_levels_are_median_and_quartiles(images):
    measured, reference, material = images
    levels = image_levels(measured, reference, material, {"a": 1, "b": 3})
    valid = (material > 0) & np.isfinite(measured)
    mapped = levels.apply(measured[valid], levels.measured)
    assert np.median(mapped) == pytest.approx(0.0, abs=1e-6)
    assert np.subtract(*np.percentile(mapped, [75, 25])) == pytest.approx(1.0, rel=1e-6)
    assert levels.scale == pytest.approx(2.0, rel=1e-5)
    assert levels.offset_db == pytest.approx(np.median(measured[valid]) - np.median(reference[valid]), abs=1e-5)
    assert "not identified" not in sentence(levels.finding)
    said = sentence(image_levels(measured, reference, material, {"a": 1, "b": 2, "c": 3}).finding)
    assert "all materials are calibrated, so that a level common to all laws is not identified" in said


def test_a_run_is_mapped_by_its_own_whole_image(images):
    measured, reference, material = images
    levels = image_levels(measured, reference, material, {"a": 1, "b": 3})
    run = reference.copy()
    run[material == 1] += 7.0
    run[material == 3] -= 2.0
    record = {name: run[material == k] for name, k in {"a": 1, "b": 3}.items()}
    valid = (material > 0) & np.isfinite(measured)
    assert levels.simulated(record) == pytest.approx(median_and_range(run[valid]), rel=1e-6)


def test_no_levels_change_nothing():
    levels = Levels()
    np.testing.assert_array_equal(levels.apply([1.0, 2.0], levels.measured), [1.0, 2.0])
    assert levels.simulated({}) == (0.0, 1.0)
