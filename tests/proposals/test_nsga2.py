import random

import numpy as np
import platypus
import pytest

from radcal.config import Optimiser
from radcal.proposals.nsga2 import nsga2

QUICK = Optimiser(population=20, evaluations=200)


def distances(u):
    """Squares of the distances to two places."""
    return ((u[:, None] - [[0.2, 0.3], [0.7, 0.6]]) ** 2).sum(axis=-1)


def test_several_objectives_give_a_front():
    """Distance to two places: best are the points between them, and the first of all has the least sum."""
    found = nsga2(distances, 2, Optimiser(population=20, evaluations=1000), seed=1, objectives=2)
    sums = distances(found.points).sum(axis=1)
    assert sums[0] == sums.min()
    # by definition: no point is better in one objective and as good in the other
    both = found.objectives
    beaten = ((both[:, None] >= both).all(axis=-1) & (both[:, None] > both).any(axis=-1)).any(axis=1)
    assert len(found.front) > 10
    assert set(found.front) <= set(np.flatnonzero(~beaten))


@pytest.mark.parametrize("step", [0.0, 0.1])
@pytest.mark.parametrize("objectives", [1, 2])
def test_the_faster_parts_give_what_platypus_alone_gives(objectives, step):
    """Bit for bit, also if many solutions have equal objectives."""

    def some(u):
        found = distances(u)[:, :objectives]
        return np.round(found / step) * step if step else found

    problem = platypus.Problem(2, objectives, function=lambda x: some(np.array([x]))[0].tolist())
    problem.types[:] = [platypus.Real(0.0, 1.0)] * 2
    random.seed(3)
    alone = platypus.NSGAII(problem, population_size=20)
    alone.run(400)
    expected = sorted(alone.population, key=lambda s: sum(s.objectives))
    found = nsga2(some, 2, Optimiser(population=20, evaluations=400), seed=3, objectives=objectives)
    np.testing.assert_array_equal(found.points, [s.variables[:] for s in expected])
    np.testing.assert_array_equal(found.objectives, [s.objectives[:] for s in expected])


def test_it_evaluates_in_batches_and_leaves_the_global_generator_alone():
    sizes = []

    def objective(u):
        sizes.append(len(u))
        return u.sum(axis=1)

    random.seed(7)
    expected = [random.random() for _ in range(3)]
    random.seed(7)
    first = nsga2(objective, 2, QUICK, seed=5).points
    assert [random.random() for _ in range(3)] == expected
    # a generation in one call each; offspring equal to a parent are not evaluated again
    assert len(sizes) <= 2 * 200 / 20
    assert min(sizes) > 1
    np.testing.assert_array_equal(first, nsga2(objective, 2, QUICK, seed=5).points)
    assert not np.array_equal(first, nsga2(objective, 2, QUICK, seed=6).points)


def test_an_objective_that_draws_random_numbers_does_not_move_platypus():
    def drawing(u):
        random.random()  # as some libraries do when they are imported
        return distances(u)

    first, second = (nsga2(of, 2, QUICK, seed=5, objectives=2).points for of in (drawing, distances))
    np.testing.assert_array_equal(first, second)
