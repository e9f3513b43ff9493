"""Layover along a line of facets."""

import numpy as np
import pytest

from radcal.radar import visibility


@pytest.mark.parametrize(("fold_m", "laid"), [(2.1, True), (2.9, True), (1.9, False)])
def test_layover_begins_a_pixel_of_slant_range_apart(fold_m, laid):
    slant, share, found = np.array([10.0, 20.0, 20.0 - fold_m, 40.0, 50.0]), np.ones(5), np.empty(5, dtype=bool)
    visibility.laid_over(slant, share, 2.0, found)
    assert found.tolist() == [False, laid, laid, False, False]
    share[1] = 0.0  # what is hidden lies over nothing
    visibility.laid_over(slant, share, 2.0, found)
    assert not found.any()
