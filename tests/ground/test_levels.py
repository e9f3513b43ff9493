"""Levels against inverse-variance weights and numpy's quantiles; their wrong variants stand in ``test_variants.py``."""

import numpy as np
import pytest

from radcal.ground.levels import offset_levels


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
