"""Classes of local incidence."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radcal.errors import MeasurementError
from radcal.ground.bins import class_of, incidence_edges, make_classes, winsorised


@settings(max_examples=60, deadline=None)
@given(
    angles=st.lists(st.integers(0, 40), min_size=1, max_size=400),
    wanted=st.one_of(st.integers(1, 20), st.just("auto")),
)
def test_edges_increase_and_no_class_is_small(angles, wanted):
    edges = incidence_edges(angles, wanted)
    member = class_of(angles, edges)
    count = np.bincount(member, minlength=edges.size - 1)
    assert edges[0] == min(angles)
    assert edges[-1] == max(angles)
    assert count.sum() == len(angles)
    assert count.size == 1 or (np.all(np.diff(edges) > 0) and count.min() >= 30)


@pytest.mark.parametrize(("span", "classes"), [(1.0, 4), (12.0, 6), (40.0, 8)])
def test_auto_goes_by_span(span, classes):
    assert incidence_edges(np.linspace(30.0, 30.0 + span / 0.9, 1000), "auto").size - 1 == classes


@pytest.mark.parametrize("angles", [[], [20.0, np.nan]])
def test_no_angle_is_a_sentence(angles):
    with pytest.raises(MeasurementError, match=r"target\.incidence_classes: 3 classes"):
        incidence_edges(angles, 3)


def test_shares_of_labels():
    angles = np.repeat([20.0, 40.0], 60)
    classes = make_classes(np.zeros(120), angles, 2)
    label = np.concatenate([np.zeros(60, dtype=int), np.repeat([0, 1], [15, 45])])
    assert classes.size == 2
    np.testing.assert_allclose(classes.shares(label, 2), [[1.0, 0.0], [0.25, 0.75]])
    np.testing.assert_allclose(classes.effective, [60.0, 60.0])
    np.testing.assert_allclose(classes.compared(4).effective, [48.0, 48.0])


def test_an_angle_on_an_edge_is_of_the_bin_above():
    assert class_of([20.0, 29.9, 30.0, 35.0, 41.0, 50.0], [20.0, 30.0, 41.0, 50.0]).tolist() == [0, 0, 1, 1, 2, 2]


def test_bins_of_the_smallest_size_are_made():
    angles = np.repeat([20.0, 40.0, 70.0], 30)
    assert incidence_edges(angles, 3).size - 1 == 3
    assert incidence_edges(angles[1:], 3).size - 1 == 1  # 29 pixels of 20 degrees are too few


def test_nodes_are_the_middles_of_equal_parts_of_a_bin():
    nodes = make_classes(np.zeros(1001), np.linspace(20.0, 30.0, 1001), 1).nodes_deg
    np.testing.assert_allclose(nodes, [20.0 + 10.0 * (np.arange(24) + 0.5) / 24])


def test_values_are_limited_to_six_robust_standard_deviations():
    values, member = np.array([0.0, 1.0, 2.0, 4.0, 100.0, -50.0, -60.0, -70.0]), np.array([0] * 5 + [1] * 3)
    # median 2 and median distance 2; the other bin on its own: -60 and 10
    expected = [0.0, 1.0, 2.0, 4.0, 2.0 + 6 * 1.4826 * 2.0, -50.0, -60.0, -70.0]
    np.testing.assert_allclose(winsorised(values, member), expected)


def test_speckle_is_the_variance_at_equal_incidence_inside_of_a_cell():
    """A slope of the law and the levels of cells spread a bin, and would be the same in another image."""
    rng = np.random.default_rng(8)
    angles, cells = rng.uniform(20.0, 40.0, 6000), rng.integers(0, 12, 6000)
    sd = np.where(angles < 30.0, 1.5, 2.5)
    values = -0.5 * angles + rng.normal(0.0, 2.0, 12)[cells] + sd * rng.normal(size=6000)
    classes = make_classes(values, angles, 2, cells=cells)
    np.testing.assert_allclose(classes.speckle_db2, [1.5**2, 2.5**2], rtol=0.06)
    assert (classes.cumulants[:, 1] > classes.speckle_db2 + 4.0).all()
    # one degree of freedom for each of the few pixels' cells, and two for the line
    few = [make_classes(rng.normal(size=120), angles[:120], 1, cells=np.arange(120) // 3) for _ in range(200)]
    assert np.mean([one.speckle_db2[0] for one in few]) == pytest.approx(0.99, abs=0.04)


def test_cells_of_one_pixel_leave_the_whole_variance():
    values = np.random.default_rng(7).normal(size=60)
    classes = make_classes(values, np.linspace(20.0, 40.0, 60), 1, cells=np.arange(60))
    np.testing.assert_allclose(classes.speckle_db2, classes.cumulants[:, 1])


def test_speckle_is_no_more_than_the_variance_of_a_bin():
    """Values of +-3 dB in turn, two at each angle: 40 over 38 degrees of freedom would be too much."""
    classes = make_classes(np.tile([3.0, -3.0], 20), np.repeat(np.linspace(20.0, 40.0, 20), 2), 1)
    assert classes.speckle_db2.tolist() == [9.0]
