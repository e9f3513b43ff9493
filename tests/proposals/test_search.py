"""Search on surrogates that know the truth, of the density's objective."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import make_material, make_score, make_target

from radcal import skewnormal
from radcal.config import Optimiser
from radcal.objectives.density import UNREACHABLE_SHARE, Density
from radcal.proposals.search import Search, corners, lattice
from radcal.proposals.surrogate import Surrogate
from radcal.seeds import derived_seed

QUICK = Optimiser(population=20, evaluations=100)
PIXELS = np.random.default_rng(0).normal(3.0, 1.5, 300)


class Exact(Surrogate):
    """A surrogate that knows the truth: mean in [0, 10], log sd in [0, 1], skewness 0.9 x; its draws are off."""

    _shift = np.zeros(3)

    def __init__(self, known=((0.5, 0.5, 0.5),), error=1e-9, box=((0, 1), (0, 1), (0, 1)), whole=(0, 0, 0)):
        self.bounds, self.integer = np.array(box, dtype=float), np.array(whole, dtype=bool)
        self.parameters, self.standard = np.array(known, dtype=float), error
        self.training = SimpleNamespace(
            direct=False, q2=np.array([0.5, 0.75, np.nan]), baseline=np.zeros(3, dtype=bool)
        )

    def predict(self, unit):
        u = np.atleast_2d(unit)
        return np.stack([10 * u[:, 0], u[:, 1], 0.9 * u[:, 2]], axis=-1)[:, None] + self._shift * self.standard

    def standard_error(self, unit):
        return np.full_like(self.predict(unit), self.standard)


def dp_of(mean, log_sd, skewness):
    return skewnormal.direct([mean, np.exp(log_sd), skewness])


def search(dp, surrogate=None):
    surrogate = surrogate or Exact()
    target = make_target(PIXELS, np.full(300, 45.0), dp=np.asarray(dp))
    return Search(Density(make_material(target, surrogate.bounds, integer=surrogate.integer)), surrogate)


REACHABLE, BEYOND = dp_of(3.0, 0.4, 0.3), dp_of(10.5, 0.4, 0.3)
MIDDLE = make_score(0.1, [0.5, 0.5, 0.5])


def scored(x, cost):
    return make_score(float(cost), list(np.asarray(x, dtype=float)))


def test_a_reachable_target_is_met():
    proposal = search(REACHABLE).propose(QUICK, 1, MIDDLE)
    assert proposal.mode == "exploit"
    assert proposal.cost < 1e-9
    np.testing.assert_allclose(proposal.parameters, [0.3, 0.4, 0.3 / 0.9], atol=1e-6)
    assert proposal.nsga2_cost > proposal.cost
    # what is predicted there, with its standard deviations, and looks of the speckle
    np.testing.assert_allclose(proposal.statistics, [[3.0, 0.4, 0.3]], atol=1e-6)
    np.testing.assert_allclose(proposal.errors, 1e-9)
    assert proposal.looks == 4.0


@pytest.fixture(scope="module")
def edge():
    """Nearest point to a mean of 10.5, which is out of reach, and its rms."""
    return search(BEYOND).minimum([np.array([0.5, 0.5, 0.5])], seed=1)


def test_where_the_surrogate_is_unsure_it_is_asked_again(edge):
    """The same target, with standard errors that would admit it: explored, no floor claimed."""
    unit, rms = edge
    proposal = search(BEYOND, Exact((unit,), error=0.5)).propose(QUICK, 1, scored(unit, rms))
    assert proposal.mode == "explore"
    assert proposal.floor < UNREACHABLE_SHARE * rms


def test_a_floor_less_than_a_tenth_below_the_best_is_not_explored(edge):
    unit, rms = edge
    proposal = search(BEYOND, Exact((unit,), error=0.012)).propose(QUICK, 1, scored(unit, rms))
    assert 0.9 * rms < proposal.floor < 0.99 * rms
    assert proposal.mode == "exploit"


def test_a_floor_that_keeps_the_stop_criterion_from_being_met_is_explored(edge):
    """The same floor, where the objective's stop asks for less: another run at the best X would tell nothing."""
    unit, rms = edge
    found = search(BEYOND, Exact((unit,), error=0.012))
    found.objective.first.leaves_open = lambda floor, best: floor < 0.995 * best
    assert found.propose(QUICK, 1, scored(unit, rms)).mode == "explore"


def test_standard_errors_count_in_the_scale_of_the_objective():
    """Of mean, log sd and skewness: sd, 1 / sqrt(2) and sqrt(6)."""
    found = search(REACHABLE, Exact(error=0.2)).uncertainty(np.array([0.3, 0.4, 0.3]))
    assert found == pytest.approx(0.2**2 * (np.exp(-2.0 * 0.4) + 2.0 + 1.0 / 6.0), rel=1e-6)


def test_two_standard_errors_are_taken_in_favour():
    """Of a mean 0.5 dB off, an error of 0.2 leaves 0.1 dB, one of 0.25 nothing, in any direction."""
    u, target = np.array([[0.35, 0.4, 0.3 / 0.9]]), REACHABLE
    for error, left in ((0.2, 0.1), (0.25, 0.0)):
        found = search(target, Exact(error=error))
        assert found.cost(u, 2.0)[0] == pytest.approx(found.cost([[0.3 + left / 10, 0.4, 0.3 / 0.9]])[0], abs=1e-12)
        mirrored = u * [0.25 / 0.35, 1.0, 1.0]
        assert found.distance(mirrored, 2.0)[0] == pytest.approx(found.distance(u, 2.0)[0], abs=1e-12)


def test_a_batch_is_spread_by_the_error_of_the_surrogate():
    """The first is the proposal alone; the others reach the target if the prediction errs, and say what it predicts."""
    best = make_score(0.5, [0.5, 0.5, 0.5])

    def of(error):
        wide = Exact(error=error)
        found = search(REACHABLE, wide).batch(3, QUICK, 1, best)
        assert found[0] == search(REACHABLE, wide).propose(QUICK, 1, best)
        assert [one.floor for one in found[1:]] == [None, None]
        for one in found:
            np.testing.assert_array_equal(one.statistics, wide.predict(wide.unit(one.parameters))[0])
        return np.array([one.statistics for one in found])[:, 0]

    off = of(0.02) - np.array([3.0, 0.4, 0.3])
    draws = [np.random.default_rng(derived_seed(1, "batch", k)).standard_normal(3) for k in (1, 2)]
    np.testing.assert_allclose(off, [np.zeros(3), *(-0.02 * draw for draw in draws)], atol=1e-6)
    np.testing.assert_allclose(of(0.01) - np.array([3.0, 0.4, 0.3]), 0.5 * off, atol=1e-6)


def test_no_x_is_in_a_batch_twice():
    """Three of whole numbers, two where the lattice has two left, and one where all draws are the surrogate itself."""
    best = make_score(0.1, [2.0, 5.0, 5.0])
    every = [[a, n, m] for a in range(3) for n in range(1, 10) for m in range(1, 10)]

    def batch(known, error, **box):
        found = search(REACHABLE, Exact(known, error, **box)).batch(3, QUICK, 1, best)
        assert not {tuple(one.parameters) for one in found} & {tuple(x) for x in known}
        return {tuple(one.parameters) for one in found}

    assert len(batch([[2, 5, 5]], 0.02, **ALL_WHOLE)) == 3
    assert batch(every[:-2], 0.02, **ALL_WHOLE) == {tuple(x) for x in every[-2:]}
    assert len(batch([[0.5, 0.5, 0.5]], 0.0)) == 1


def test_runs_that_would_tell_the_same_are_not_in_a_batch():
    """Errors of a tenth of a standard deviation hardly change a cost for which improvements below 0.03 do not count."""
    best = make_score(0.5, [0.5, 0.5, 0.5])

    def count(error, improvement):
        found = search(REACHABLE, Exact(error=error))
        found.objective.improvement = improvement
        return len(found.batch(3, QUICK, 1, best))

    # with an error of 1, the second draw finds its target at the bound of the skewness, near the first X
    assert [count(0.02, 0.0), count(0.02, 0.03), count(1.0, 0.03)] == [3, 1, 2]


def test_failures_keep_every_other_proposal_near_the_best():
    """A trust region around the best verified point, half as wide after each second failure."""
    best = scored([0.9, 0.9, 0.1], 0.12)
    found = search(REACHABLE, Exact(known=[best.parameters]))
    found.objective.first.promising = lambda costs, _: np.ones(len(costs), dtype=bool)
    away = [
        np.abs(np.array(found.propose(QUICK, 1, best, failures).parameters) - best.parameters).max()
        for failures in range(6)
    ]
    np.testing.assert_allclose(away[1::2], [0.25, 0.125, 0.0625], rtol=1e-6)
    np.testing.assert_allclose(away[::2], 0.6, atol=1e-5)
    # where nothing better is promised inside of it, the whole box is searched
    found.objective.first.promising = lambda costs, _: costs < 1e-6
    assert np.abs(np.array(found.propose(QUICK, 1, best, 1).parameters) - best.parameters).max() > 0.5


def test_a_trust_region_never_vanishes():
    """After hundreds of iterations without improvement, which a large stop.stagnation_runs admits."""
    best = make_score(0.5, [0.5, 0.5, 0.5])
    found = search(REACHABLE).propose(QUICK, 1, best, failures=301)
    assert search(REACHABLE).objective.promising(np.array([found.cost]), best.cost).all()


def test_of_several_as_good_the_best_known_is_proposed():
    """Two X have the target's statistics: the one whose standard errors are smaller."""

    class Folded(Exact):
        def predict(self, unit):
            u = np.atleast_2d(unit).copy()
            u[:, 0] = np.abs(2.0 * u[:, 0] - 1.0)
            return super().predict(u)

        def standard_error(self, unit):
            return np.atleast_2d(unit)[:, None, :1] * np.ones(3) * self.standard

    for error, wanted in ((1e-3, 0.35), (-1e-3, 0.35)):
        surrogate = Folded(known=[[0.2, 0.5, 0.5]], error=abs(error))
        if error < 0.0:
            surrogate.standard_error = lambda u: (1.0 - np.atleast_2d(u)[:, None, :1]) * np.ones(3) * 1e-3
            wanted = 0.65
        found = search(REACHABLE, surrogate)
        found.objective.starts = [([0.3, 0.4, 0.3], 4.0), ([0.7, 0.4, 0.3], 4.0)]
        assert found.propose(QUICK, 1, scored([0.2, 0.5, 0.5], 0.1)).parameters[0] == pytest.approx(wanted, abs=1e-6)


def test_without_polish_nsga2_has_the_last_word():
    config = QUICK.model_copy(update={"polish": False, "objective": "rms"})
    proposal = search(REACHABLE).propose(config, 1, MIDDLE)
    assert proposal.cost == proposal.nsga2_cost > 1e-9
    assert proposal.floor is None


def test_the_same_seed_gives_the_same_proposal():
    one, two, other = (search(BEYOND).propose(QUICK, seed, MIDDLE) for seed in (4, 4, 5))
    assert one == two
    assert one.nsga2_cost != other.nsga2_cost


def test_of_xi_omega_and_alpha_no_floor_is_claimed(edge):
    surrogate = Exact(known=(edge[0],))
    surrogate.training = SimpleNamespace(direct=True, q2=np.full(3, np.nan))
    proposal = search(BEYOND, surrogate).propose(QUICK, 1, scored(*edge))
    assert (proposal.mode, proposal.floor) == ("exploit", None)


@pytest.mark.slow
def test_outlook_promises_what_there_is_to_gain():
    found = search(BEYOND, Exact(known=((0.5, 0.5, 0.5),)))
    point, least = found.minimum([np.array([0.5, 0.5, 0.5])], seed=1)
    at, away = scored(point, least), np.array([0.8, 0.4, 0.3])
    gain, floor, moved = found.outlook(at, seed=2)
    assert gain == pytest.approx(0.0, abs=1e-9)
    assert floor == pytest.approx(least, rel=1e-3)
    assert moved is None, "no curve"
    cost = float(found.cost(away)[0])
    gain, floor, _ = found.outlook(scored(away, cost), seed=2)
    assert gain == pytest.approx(cost - least, rel=1e-3)
    assert cost > 1.2 * least
    # a verified cost is what counts, not the predicted one
    assert found.outlook(scored(away, cost + 0.5), seed=2)[0] == pytest.approx(gain + 0.5, rel=1e-6)
    assert found.outlook(scored(away, least / 2.0), seed=2)[0] == 0.0
    # an unsure surrogate leaves room below
    unsure = search(BEYOND, Exact(known=((0.5, 0.5, 0.5),), error=0.25))
    assert unsure.outlook(at, seed=2)[1] < 1e-9
    found.objective.explores = False
    assert found.outlook(at, seed=2)[1] is None


WHOLE = {"box": ((0, 1), (1, 9), (1, 9)), "whole": (0, 1, 1)}
ALL_WHOLE = {"box": ((0, 2), (1, 9), (1, 9)), "whole": (1, 1, 1)}


def test_whole_parameters_are_proposed_whole_and_the_others_make_up_for_it():
    surrogate = Exact(known=((0.5, 5.0, 5.0),), **WHOLE)
    # log sd 0.40 lies between the eighths 0.375 and 0.5, skewness 0.3 between 0.225 and 0.3375;
    # of the four combinations this one has the nearest density
    found = search(REACHABLE, surrogate)
    proposal = found.propose(QUICK, 1, scored([0.5, 5, 5], 0.2))
    x, n, m = proposal.parameters
    assert (n, m) == (4.0, 3.0)
    # predicted for what is simulated, not for what was rounded
    assert proposal.cost == pytest.approx(found.cost(surrogate.unit([x, n, m]))[0])
    assert all(found.cost(surrogate.unit([x + step, n, m]))[0] > proposal.cost for step in (-2e-3, 2e-3))
    every = [found.cost(surrogate.unit([x, a, b]))[0] for a in range(1, 10) for b in range(1, 10)]
    assert min(every) == pytest.approx(proposal.cost)


def test_a_small_lattice_is_looked_at_point_by_point():
    surrogate = Exact(known=((1.0, 5.0, 5.0),), **ALL_WHOLE)
    found = search(dp_of(5.1, 0.40, 0.3), surrogate)
    every = np.array([[a, n, m] for a in (0, 1, 2) for n in range(1, 10) for m in range(1, 10)], dtype=float)
    costs = found.cost(surrogate.unit(every))
    point, least = found.minimum([np.array([0.0, 0.0, 0.0])], seed=1)
    np.testing.assert_allclose(surrogate.scaled(point), every[np.argmin(costs)])
    assert least == pytest.approx(costs.min())


def test_around_a_point_whole_parameters_are_rounded_both_ways():
    """Every combination of up to four; of five the nearest point, and those that differ from it in one."""
    box = ((0, 1), (0, 10), (2, 6), (-5, 5), (0, 4), (1, 3))
    for whole, count in (((0, 1, 1, 0, 1, 0), 8), ((0, 1, 1, 1, 1, 1), 6)):
        surrogate, which = Exact(box=box, whole=whole), np.array(whole, dtype=bool)
        x = np.array([0.3, 4.4, 3.7, -1.2, 2.6, 1.9])
        found = surrogate.bounds[:, 0] + corners(surrogate, surrogate.unit(x)) * np.ptp(surrogate.bounds, axis=1)
        assert len(found) == count
        np.testing.assert_allclose(found[:, ~which], np.tile(x[~which], (count, 1)))
        np.testing.assert_allclose(found[:, which], np.round(found[:, which]), atol=1e-9)
        assert (np.abs(found - x) < 1.0).all()
        away = np.count_nonzero(np.abs(found - np.where(which, np.round(x), x)) > 0.5, axis=1)
        assert sorted(away) == ([0, 1, 1, 1, 2, 2, 2, 3] if count == 8 else [0, 1, 1, 1, 1, 1])


@pytest.mark.parametrize(("box", "points"), [(((0, 63), (2, 65)), 4096), (((0, 64), (2, 65)), None)])
def test_a_lattice_of_up_to_4096_points_is_listed(box, points):
    """64 x 64 combinations, and 65 x 64."""
    surrogate = Exact(box=box, whole=(1, 1))
    found = lattice(surrogate)
    assert (None if found is None else len(np.unique(found, axis=0))) == points
    if found is not None:
        assert {tuple(x) for x in surrogate.scaled(found[[0, 1, -1]])} == {(0.0, 2.0), (0.0, 3.0), (63.0, 65.0)}
    assert lattice(Exact(box=box, whole=(1, 0))) is None


def test_a_known_point_gives_way_to_another_or_to_an_end():
    every = [[float(a), float(n), float(m)] for a in (0, 1, 2) for n in range(1, 10) for m in range(1, 10)]
    target = dp_of(5.1, 0.40, 0.3)
    exact = Exact(known=every, **ALL_WHOLE)
    rms = search(target, exact).cost(exact.unit(every))
    best, best_rms = every[np.argmin(rms)], rms.min()
    left = [[0.0, 7.0, 1.0], [2.0, 9.0, 9.0]]

    def proposal(known, error):
        return search(target, Exact(known, error, **ALL_WHOLE)).propose(QUICK, 1, scored(best, best_rms))

    # all others may be better as far as the surrogate knows: one of those left
    found = proposal([x for x in every if x not in left], 0.3)
    assert found.mode == "explore"
    unsure = Exact(every, 0.3, **ALL_WHOLE)
    costs = search(target, unsure).cost(unsure.unit(left), 2.0)
    assert found.parameters == left[np.argmin(costs)]
    found = proposal(every, 0.3)
    assert (found.mode, found.parameters) == ("exhausted", best)
    # the surrogate is sure that none is better: the best itself says so, which costs no run
    found = proposal([x for x in every if x not in left], 1e-9)
    assert (found.mode, found.parameters, found.cost) == ("exploit", best, best_rms)
    assert found.floor == pytest.approx(best_rms)


def test_free_looks_are_one_more_dimension():
    """On a logarithmic scale from 0.3 to 1.1 times the sensor's."""
    found = search(REACHABLE)
    found.objective.free_looks = True
    found = Search(found.objective, found.surrogate)
    assert found.dimension == 4
    point = found.point([0.2, 0.4, 0.6], 2.0)
    assert point[3] == pytest.approx(np.log(2.0 / 0.3) / np.log(4.4 / 0.3))
    x, looks = found.split(np.stack([point, np.append(point[:3], 0.0), np.append(point[:3], 1.0)]))
    np.testing.assert_allclose(x, [[0.2, 0.4, 0.6]] * 3)
    np.testing.assert_allclose(looks, [2.0, 0.3, 4.4])
    assert replace(MIDDLE, looks=9.0).looks == 9.0
    assert found.point([0.2, 0.4, 0.6], 9.0)[3] == 1.0, "as many as are possible"
