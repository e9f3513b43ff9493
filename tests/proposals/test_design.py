import numpy as np
import pytest
from config_samples import COMMAND, measured
from hypothesis import given, settings
from hypothesis import strategies as st

from radcal.proposals.design import design_points, sample_unit

SAMPLERS = ["monte_carlo", "latin_hypercube", "sobol"]
BOX = [[-50.0, -10.0], [0.0, 20.0], [1.0, 1.5], [0.0, 50.0]]


def two_materials(build_case, sampler, size, seed=1):
    free = {"calibrate": True, "bounds": BOX}
    materials = {"dyke": free, "grass": {"parameters": [10.0, 14.0, 6.0, 4.0]}, "soil": free}
    return build_case(seed=seed, materials=materials, design={"sampler": sampler, "size": size})


@settings(max_examples=30, deadline=None)
@given(sampler=st.sampled_from(SAMPLERS), small=st.integers(1, 70), more=st.integers(0, 70), d=st.integers(1, 6))
def test_a_larger_design_keeps_the_points_of_a_smaller(sampler, small, more, d):
    a = sample_unit(sampler, small, d, np.random.default_rng(3))
    b = sample_unit(sampler, small + more, d, np.random.default_rng(3))
    assert a.shape == (small, d)
    assert b.shape == (small + more, d)
    np.testing.assert_array_equal(a, b[:small])
    assert b.min() >= 0
    assert b.max() < 1
    assert len(np.unique(b, axis=0)) == len(b)


@pytest.mark.parametrize("size", [16, 32, 64, 128])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_latin_hypercube_has_one_point_in_every_stratum(size, seed):
    points = sample_unit("latin_hypercube", size, 4, np.random.default_rng(seed))
    for column in points.T:
        np.testing.assert_array_equal(np.sort((column * size).astype(int)), np.arange(size))
    assert np.abs(np.corrcoef(points.T) - np.eye(4)).max() < 0.75  # no two columns the same


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_design_is_inside_the_bounds_and_fixed_materials_stay(build_case, sampler):
    points = design_points(two_materials(build_case, sampler, 32), 32)
    low, high = np.array(BOX).T
    assert len(points) == 32
    for name in ("dyke", "soil"):
        x = np.array([point[name] for point in points])
        assert (x >= low).all()
        assert (x <= high).all()
        assert (np.ptp(x, axis=0) > 0.7 * (high - low)).all()
    assert all(point["grass"] == [10.0, 14.0, 6.0, 4.0] for point in points)
    assert all(list(point) == ["dyke", "grass", "soil"] for point in points)
    assert all(type(value) is float for point in points for x in point.values() for value in x)


@pytest.mark.parametrize("sampler", ["monte_carlo", "latin_hypercube", "sobol"])
def test_materials_do_not_move_together(build_case, sampler):
    points = design_points(two_materials(build_case, sampler, 64), 64)
    dyke, soil = (np.array([point[name] for point in points]) for name in ("dyke", "soil"))
    assert np.abs(np.corrcoef(dyke.T, soil.T)[:4, 4:]).max() < 4 / np.sqrt(64)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_same_seed_same_points(build_case, sampler):
    points = design_points(two_materials(build_case, sampler, 8), 8)
    assert design_points(two_materials(build_case, sampler, 8), 8) == points
    assert design_points(two_materials(build_case, sampler, 24), 24)[:8] == points
    assert design_points(two_materials(build_case, sampler, 8, seed=2), 8) != points


def test_points_do_not_share_memory(build_case):
    points = design_points(two_materials(build_case, "sobol", 2), 2)
    points[0]["grass"][0] = -99.0
    assert points[1]["grass"][0] == 10.0


def whole(build_case, size, bounds, **keys):
    dyke = {"calibrate": True, "law": "external", "names": ["n", "m"], "bounds": bounds, **keys}
    materials = {"dyke": dyke, "grass": {"law": "external"}}
    image = measured(radiometry="sigma0_local")
    return build_case(simulator=COMMAND, materials=materials, design={"size": size}, **image)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_whole_parameters_are_whole_and_come_once(build_case, sampler):
    def points(size):
        case = whole(build_case, size, [[2, 6], [-1, 2]], integer=True, start=[3, 0])
        case = case.model_copy(update={"design": case.design.model_copy(update={"sampler": sampler})})
        return [tuple(x["dyke"]) for x in design_points(case, size)]

    # 5 x 4 combinations, of which the reference run has one
    every = points(19)
    assert len(set(every)) == 19
    assert set(every) == {(float(n), float(m)) for n in range(2, 7) for m in range(-1, 3)} - {(3.0, 0.0)}
    assert points(7) == every[:7]


def test_whole_numbers_have_equal_shares_ends_included(build_case):
    case = whole(build_case, 64, [[1, 4], [0, 1]], integer=["n"])
    n, x = np.array([run["dyke"] for run in design_points(case, 64)]).T
    # rounding would give the ends half of what the others have
    assert [np.count_nonzero(n == k) for k in (1, 2, 3, 4)] == [16, 16, 16, 16]
    assert len(np.unique(x)) == 64


def test_no_design_and_runs_of_an_earlier_case(build_case):
    """Reused runs stand for runs of the design, those that it would repeat before all others."""
    case = two_materials(build_case, "sobol", 4)
    every = design_points(case, 4)
    assert design_points(case, 0) == []
    assert design_points(case, 4, [every[1]]) == [every[0], *every[2:]]
    other = {**every[1], "dyke": [-20.0, 3.0, 1.2, 7.0]}
    assert design_points(case, 4, [every[1], other]) == [every[0], every[2]]
    assert design_points(case, 2, [other] * 3) == []
