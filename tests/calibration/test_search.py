from __future__ import annotations

import random

import numpy as np
import pytest
from radcal.calibration.infill import UNREACHABLE_SHARE, Search, propose

from radcal import skewnormal
from radcal.calibration.nsga2 import nsga2
from radcal.config import Optimiser

QUICK = Optimiser(population=20, evaluations=400)


class ExactSurrogate:
    """A surrogate that knows the truth: mean in [0, 10], log sd in [0, 1], skewness 0.5 x."""

    outputs = "centred"
    bounds = np.array([[0.0, 1.0]] * 3)
    integer = np.zeros(3, dtype=bool)

    def snapped(self, unit):
        return np.asarray(unit)

    def __init__(self, error=1e-9, known=((0.5, 0.5, 0.5),)):
        self.error = error
        self.parameters = np.array(known)

    def unit(self, x):
        return np.asarray(x, dtype=float)

    def scaled(self, unit):
        return np.asarray(unit, dtype=float)

    def predict(self, unit):
        u = np.atleast_2d(unit)
        return np.stack([10 * u[:, 0], u[:, 1], 0.9 * u[:, 2]], axis=-1)

    def standard_error(self, unit):
        return np.full_like(self.predict(unit), self.error)

    def centred(self, values):
        return np.asarray(values)


def dp_of(mean, log_sd, skewness):
    return skewnormal.direct([mean, np.exp(log_sd), skewness])


def test_nsga2_finds_the_minimum_of_a_bowl():
    centre = np.array([0.2, 0.7, 0.4])
    found = nsga2(lambda u: ((u - centre) ** 2).sum(axis=1), 3, Optimiser(population=40, evaluations=4000), seed=1)
    np.testing.assert_allclose(found[0], centre, atol=0.02)
    assert found.shape == (40, 3)


def test_nsga2_evaluates_in_batches_and_leaves_the_global_generator_alone():
    sizes = []

    def objective(u):
        sizes.append(len(u))
        return u.sum(axis=1)

    random.seed(7)
    expected = [random.random() for _ in range(3)]
    random.seed(7)
    first = nsga2(objective, 2, QUICK, seed=5)
    assert [random.random() for _ in range(3)] == expected
    # a generation in one call each; offspring equal to a parent are not evaluated again
    assert len(sizes) <= 2 * 400 / 20
    assert min(sizes) > 1
    np.testing.assert_array_equal(first, nsga2(objective, 2, QUICK, seed=5))
    assert not np.array_equal(first, nsga2(objective, 2, QUICK, seed=6))


def test_a_reachable_target_is_met():
    target = dp_of(3.0, 0.4, 0.3)
    proposal = propose(ExactSurrogate(), target, QUICK, 1, [0.5, 0.5, 0.5], 0.1)
    assert proposal.mode == "exploit"
    assert proposal.predicted_rms < 1e-9
    np.testing.assert_allclose(proposal.parameters, [0.3, 0.4, 0.3 / 0.9], atol=1e-6)
    assert proposal.nsga2_rms > proposal.predicted_rms


def test_a_target_outside_the_box_has_a_floor():
    """Mean 10.5 is out of reach: the nearest density is at the box's edge."""
    target = dp_of(10.5, 0.4, 0.3)
    search = Search(ExactSurrogate(), target)
    edge = np.stack(np.meshgrid([1.0], np.linspace(0, 1, 201), np.linspace(0, 1, 201)), axis=-1).reshape(-1, 3)
    nearest = min(search.rms(part).min() for part in np.array_split(edge, 50))
    unit, rms = search.minimum(np.array([[0.5, 0.5, 0.5]]), seed=1)
    assert unit[0] == pytest.approx(1.0, abs=1e-6)
    assert rms == pytest.approx(nearest, rel=5e-3)
    assert rms <= nearest

    proposal = propose(ExactSurrogate(known=(unit,)), target, QUICK, 1, unit, rms)
    assert proposal.floor_rms is not None
    assert UNREACHABLE_SHARE * rms <= proposal.floor_rms <= rms * (1 + 1e-9)


def test_where_the_surrogate_is_unsure_it_is_asked_again():
    """The same target, with standard errors that would admit it: explored, no floor claimed."""
    target = dp_of(10.5, 0.4, 0.3)
    search = Search(ExactSurrogate(error=0.5), target)
    unit, rms = search.minimum(np.array([[0.5, 0.5, 0.5]]), seed=1)
    proposal = propose(ExactSurrogate(error=0.5, known=(unit,)), target, QUICK, 1, unit, rms)
    assert proposal.mode == "explore"
    assert proposal.floor_rms < UNREACHABLE_SHARE * rms


def test_an_objective_that_draws_random_numbers_does_not_move_platypus():
    def bowl(u):
        return ((u - 0.3) ** 2).sum(axis=1)

    def drawing(u):
        random.random()  # as some libraries do when they are imported
        return bowl(u)

    np.testing.assert_array_equal(nsga2(drawing, 2, QUICK, seed=5), nsga2(bowl, 2, QUICK, seed=5))


def test_without_polish_nsga2_has_the_last_word():
    config = Optimiser(population=20, evaluations=400, polish=False, objective="rms")
    proposal = propose(ExactSurrogate(), dp_of(3.0, 0.4, 0.3), config, 1, [0.5, 0.5, 0.5], 0.1)
    assert proposal.predicted_rms == proposal.nsga2_rms > 1e-9
    assert proposal.floor_rms is None


def test_the_same_seed_gives_the_same_proposal():
    target = dp_of(3.0, 0.4, 0.3)
    one, two = (propose(ExactSurrogate(), target, QUICK, 4, [0.5] * 3, 0.1) for _ in range(2))
    assert one == two


def test_rms_agrees_with_the_definition():
    target = dp_of(3.0, 0.4, 0.3)
    unit = np.array([[0.31, 0.5, 0.2]])
    found = Search(ExactSurrogate(), target).rms(unit)[0]
    assert found == pytest.approx(skewnormal.density_rms(dp_of(3.1, 0.5, 0.18), target), rel=0.01)


class WholeSurrogate(ExactSurrogate):
    """The same with X of 1 to 9 in the last two parameters, whole numbers."""

    bounds = np.array([[0.0, 1.0], [1.0, 9.0], [1.0, 9.0]])

    def __init__(self, known=((0.5, 5.0, 5.0),), first=(0.0, 1.0), **changes):
        super().__init__(known=known, **changes)
        self.bounds = np.array([first, *self.bounds[1:]], dtype=float)
        self.integer = np.array([first != (0.0, 1.0), True, True])

    def unit(self, x):
        low, high = self.bounds.T
        return (np.asarray(x, dtype=float) - low) / (high - low)

    def scaled(self, unit):
        low, high = self.bounds.T
        x = low + np.asarray(unit) * (high - low)
        return np.where(self.integer, np.round(x), x)

    def snapped(self, unit):
        return self.unit(self.scaled(unit))


def test_whole_parameters_are_proposed_whole_and_the_others_make_up_for_it():
    surrogate = WholeSurrogate()
    # log sd 0.40 lies between the eighths 0.375 and 0.5, skewness 0.3 between 0.225 and 0.3375;
    # of the four combinations this one has the nearest density
    search = Search(surrogate, dp_of(3.0, 0.40, 0.3))
    proposal = propose(surrogate, search.target_dp, QUICK, 1, surrogate.unit([0.5, 5, 5]), 0.2)
    x, n, m = proposal.parameters
    assert (n, m) == (4.0, 3.0)
    # predicted for what is simulated, not for what was rounded
    assert proposal.predicted_rms == pytest.approx(search.rms(surrogate.unit([x, n, m]))[0])
    assert all(search.rms(surrogate.unit([x + step, n, m]))[0] > proposal.predicted_rms for step in (-2e-3, 2e-3))
    every = [search.rms(surrogate.unit([x, a, b]))[0] for a in range(1, 10) for b in range(1, 10)]
    assert min(every) == pytest.approx(proposal.predicted_rms)


def test_a_known_point_gives_way_to_another_or_to_an_end():
    every = [[float(a), float(n), float(m)] for a in (0, 1, 2) for n in range(1, 10) for m in range(1, 10)]
    target = dp_of(5.1, 0.40, 0.3)
    exact = WholeSurrogate(first=(0.0, 2.0))
    rms = Search(exact, target).rms(exact.unit(every))
    best, best_rms = every[np.argmin(rms)], rms.min()
    left = [[0.0, 7.0, 1.0], [2.0, 9.0, 9.0]]

    def proposal(known, error):
        surrogate = WholeSurrogate(known, (0.0, 2.0), error=error)
        return propose(surrogate, target, QUICK, 1, surrogate.unit(best), best_rms)

    # all others may be better as far as the surrogate knows: one of those left
    found = proposal([x for x in every if x not in left], 0.3)
    assert found.mode == "explore"
    assert found.parameters in left
    found = proposal(every, 0.3)
    assert (found.mode, found.parameters) == ("exhausted", best)
    # the surrogate is sure that none is better: the best itself says so, which costs no run
    found = proposal([x for x in every if x not in left], 1e-9)
    assert (found.mode, found.parameters, found.predicted_rms) == ("exploit", best, best_rms)
    assert found.floor_rms == pytest.approx(best_rms)
