"""Rays over a line of facets, against the definition of the tangent of the look angle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radcal.radar import visibility

seen_from, slant_extent = visibility.seen_from.py_func, visibility.slant_extent.py_func
METRES = st.floats(1.0, 9.0)


@given(near=st.floats(50.0, 90.0), step=METRES, near_down=st.floats(60.0, 90.0), rise=st.floats(-20.0, 20.0),
       share=st.floats(0.05, 0.95))  # fmt: skip
def test_the_ray_of_the_horizon_passes_where_the_facet_begins_to_be_seen(near, step, near_down, rise, share):
    far, far_down = near + step, near_down - rise
    horizon = (near + share * step) / (near_down - share * rise)
    first, last = near / near_down, far / far_down
    if last <= first * (1.0 + 1e-6):  # turned away from the radar
        assert seen_from(near, near_down, far, far_down, first + abs(first)) == 1.0
        return
    assert seen_from(near, near_down, far, far_down, horizon) == pytest.approx(share, abs=1e-6)
    assert seen_from(near, near_down, far, far_down, first) == 0.0  # a ray along its near edge hides nothing
    assert seen_from(near, near_down, far, far_down, last) == 1.0


@pytest.mark.parametrize(
    ("middle_down", "far_down", "horizon", "expected"),
    [
        (50.0, 51.0, 0.0, (0.0, 1.0)),  # level, all in view
        (47.0, 80.0, 0.0, (0.0, 0.5)),  # the far half falls away behind the middle
        (55.0, 46.0, 2.0, (0.5 + 0.5 * 7.5 / 20.5, 1.0)),  # a hollow: the ray over its near edge meets the far half
        (50.0, 51.0, 2.05, (0.5, 1.0)),  # the ray of the horizon meets the middle
        (50.0, 51.0, 3.0, (1.0, 0.5)),
    ],
)  # fmt: skip
def test_halves_of_a_facet_hide_one_another(monkeypatch, middle_down, far_down, horizon, expected):
    monkeypatch.setattr(visibility, "seen_from", seen_from)  # nothing is compiled
    place = (100.0, 50.0, 102.5, middle_down, 105.0, far_down)
    found = visibility.part_seen.py_func(*place, horizon if horizon else -np.inf)
    np.testing.assert_allclose(found, expected, atol=1e-12)


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
