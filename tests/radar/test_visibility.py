"""Rays over a line of facets, against the definition of the tangent of the look angle."""

import numpy as np
import pytest
from hypothesis import strategies as st

from radcal.radar import visibility

seen_from, slant_extent = visibility.seen_from.py_func, visibility.slant_extent.py_func
METRES = st.floats(1.0, 9.0)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (0.2, 0.9), (0.6, 0.9), (0.1, 0.4)])
@pytest.mark.parametrize("middle_down", [40.0, 52.0, 64.0])
def test_slant_extent_is_that_of_many_places(start, end, middle_down):
    place = ((100.0, 50.0), (101.0, middle_down), (102.0, 53.0))
    at = np.linspace(start, end, 2001)
    if start < 0.5 < end:
        at = np.append(at, 0.5)
    away, down = (np.interp(at, [0.0, 0.5, 1.0], part) for part in zip(*place, strict=True))
    slant = np.hypot(away, down)
    found = slant_extent(start, end, *(number for pair in place for number in pair))
    np.testing.assert_allclose(found, (slant.min(), slant.max()), atol=1e-6)


@pytest.mark.parametrize(("fold_m", "laid"), [(2.1, True), (2.9, True), (1.9, False)])
def test_layover_begins_a_pixel_of_slant_range_apart(fold_m, laid):
    slant, share, found = np.array([10.0, 20.0, 20.0 - fold_m, 40.0, 50.0]), np.ones(5), np.empty(5, dtype=bool)
    visibility.laid_over(slant, share, 2.0, found)
    assert found.tolist() == [False, laid, laid, False, False]
    share[1] = 0.0  # what is hidden lies over nothing
    visibility.laid_over(slant, share, 2.0, found)
    assert not found.any()
