"""Levels against inverse-variance weights and numpy's quantiles; their wrong variants stand in ``test_variants.py``."""

import numpy as np
import pytest

from radcal.ground.levels import image_levels, median_and_range, offset_levels


@pytest.mark.parametrize(
    ("normalisation", "code", "left"),
    [("offset", "level_subtracted", [-2.0, 2.0]), ("none", "level_found", [1.0, 5.0])],
)
def test_an_offset_is_taken_from_the_measured_image_only(normalisation, code, left):
    levels = offset_levels(normalisation, {"grass": (3.0, 0.1), "crops": (3.0, 0.2)})
    np.testing.assert_allclose(levels.apply([1.0, 5.0], levels.measured), left)
    assert levels.simulated({}) == (0.0, 1.0)
    assert (levels.unit, levels.finding.code, levels.finding.about) == ("dB", code, "grass, crops")
    error = (0.1**-2 + 0.2**-2) ** -0.5
    assert levels.finding.numbers == pytest.approx({"offset_db": 3.0, "error_db": error})
    assert offset_levels(normalisation, {}).finding.code == "level_of_image"


def test_a_run_is_mapped_by_its_own_whole_image():
    rng = np.random.default_rng(1)
    material = rng.integers(0, 4, size=(30, 40)).astype(np.uint8)
    reference = rng.normal(-10, 4, size=material.shape).astype(np.float32)
    measured = (2.0 * reference + 5.0).astype(np.float32)
    measured[:3] = np.nan
    levels = image_levels(measured, reference, material, {"a": 1, "b": 3})
    run = reference.copy()
    run[material == 1] += 7.0
    run[material == 3] -= 2.0
    record = {name: run[material == k] for name, k in {"a": 1, "b": 3}.items()}
    valid = (material > 0) & np.isfinite(measured)
    assert levels.simulated(record) == pytest.approx(median_and_range(run[valid]), rel=1e-6)
    assert levels.finding.code == "images_mapped"
    assert image_levels(measured, reference, material, {"a": 1, "b": 2, "c": 3}).finding.code == "all_images_mapped"
