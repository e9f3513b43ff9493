"""Laws in incidence-angle bins, end to end on the built-in simulator."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import BOUNDS, TRUTH, make_material, make_score

from radcal.calibration.loop import calibrate
from radcal.calibration.steps import noise_seed
from radcal.config import Optimiser, SurrogateConfig
from radcal.errors import MeasurementError
from radcal.inference.misfit import LawForward, LikelihoodMisfit
from radcal.inference.moments import from_cumulants
from radcal.laws import LAWS
from radcal.objectives import make_objectives
from radcal.objectives.base import PredictedPoints
from radcal.objectives.bins import Bins, Likelihood
from radcal.proposals.search import Search
from radcal.proposals.surrogate import Surrogate, train_surrogate
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

MANGIA = LAWS["mangia"]
ANGLES = np.radians([25.0, 32.0, 40.0])


@pytest.fixture(scope="module")
def objectives(parts):
    case, _, _, _, targets = parts
    return make_objectives(case, [targets])


@pytest.fixture(scope="module")
def objective(objectives):
    """That of the field."""
    return objectives["field"]


def laws_are_right(history):
    """Shape and mean level within 1 dB."""
    angle = np.linspace(21.5, 43.5, 40)
    for name, truth in TRUTH.items():
        score = history.best(name)
        error = MANGIA(np.radians(angle), score.parameters) - MANGIA(np.radians(angle), truth)
        # a single patch says nothing of how its level differs from that of others, the shape is its own
        assert np.abs(error - error.mean()).max() < 1.0, name
        assert abs(error.mean()) < 1.0, name


def test_a_run_is_worth_its_smallest_cost_over_the_looks(objectives, calibrated):
    history, _ = calibrated
    for name, objective in objectives.items():
        score = history.infill[0].scores[name]
        looks = np.geomspace(0.3, 4.4, 400)
        points = PredictedPoints(
            np.repeat([score.statistics], looks.size, axis=0),
            np.repeat([score.parameters], looks.size, axis=0),
            looks,
        )
        costs = objective.cost(points)
        found = objective.worth(score.parameters, np.array(score.statistics))
        assert found[1] == score.cost <= costs.min() + 1e-6
        assert found[1] == pytest.approx(costs.min(), rel=1e-3)
        assert found[0] == pytest.approx(looks[np.argmin(costs)], rel=0.01)
        assert costs.max() > 1.5 * costs.min()


def test_known_looks_are_not_searched(parts):
    *_, targets = parts
    target = targets["lake"]
    known = replace(target, classes=replace(target.classes, free_looks=False))
    objective = Bins(make_material(known, BOUNDS, MANGIA))
    statistics = objective.baseline(np.array(TRUTH["lake"]))
    points = PredictedPoints(statistics[None], np.array([TRUTH["lake"]]), np.array([4.0]))
    assert objective.worth(TRUTH["lake"], statistics) == (4.0, objective.cost(points)[0])
    assert not objective.free_looks


def test_the_baseline_is_law_noise_and_speckle(parts, runner, objective):
    """Of a law far below the noise, as a run shows it, within what speckle leaves."""
    case, _, _, _, targets = parts
    deep = {"field": [-70.0, 5.0, 5.0, 5.0], "lake": TRUTH["lake"]}
    record = runner.run(deep, noise_seed(case))
    shown = objective.statistics(record.pixels_db["field"][targets["field"].order])
    expected = objective.baseline(np.array(deep["field"]))
    assert targets["field"].noise_db == pytest.approx(-40.0)
    np.testing.assert_allclose(shown[:, 0], expected[:, 0], atol=0.6)
    np.testing.assert_allclose(shown[:, 1], expected[:, 1], atol=0.12)
    alone = LawForward(MANGIA, objective.bins.classes.nodes_deg, 4.0)(np.array(deep["field"]))
    assert alone[:, 0].max() < -60.0


def test_some_of_the_pixels_keep_their_bins(objectives, parts):
    *_, targets = parts
    values, member = targets["field"].values_db, targets["field"].classes.classes.member
    some = np.flatnonzero(np.arange(values.size) % 3 > 0)
    found = objectives["field"].statistics(np.asarray(values), some)
    wanted = [values[some][member[some] == k].mean() for k in range(3)]
    np.testing.assert_allclose(found[:, 0], wanted, atol=0.02)


def outlook(objective, x, statistics):
    """What one run promises besides itself."""
    x, statistics = np.asarray(x, dtype=np.float64), np.asarray(statistics)
    looks, cost = objective.worth(x, statistics)
    training = train_surrogate(objective, x[None], statistics[None], SurrogateConfig())
    found = Search(objective, Surrogate(training, objective))
    return cost, found.outlook(make_score(cost, list(x), looks=looks, statistics=statistics.tolist()), seed=1)


def test_nothing_is_left_at_the_minimum_and_much_away_from_it(objective):
    """Where the simulator is law and speckle alone, the law found without it is the minimum."""
    x = objective.bins.first
    least, (left, floor, moved) = outlook(objective, x, objective.baseline(x))
    assert left < 0.05  # the stop criterion: the law is found without the simulated speckle's share of the errors
    assert moved < 0.2
    assert floor is None
    away = x + [3.0, 0.0, 0.0, 0.0]
    cost, (gain, _, moved) = outlook(objective, away, objective.baseline(away))
    assert cost > least + 1.0
    assert gain == pytest.approx(cost - least + left, abs=5e-3)  # the same minimum from both
    seen = np.radians(np.linspace(*np.quantile(objective.ground.incidence_deg, [0.05, 0.95]), 91))
    assert moved == pytest.approx(np.abs(MANGIA(seen, away) - MANGIA(seen, x)).max(), abs=0.2)


def test_a_simulator_brighter_than_law_and_speckle_is_followed(objective):
    """Runs show 0.7 dB more than is expected: the law found is 0.7 dB lower."""
    x = objective.bins.first
    _, (_, _, moved) = outlook(objective, x, objective.baseline(x) + [0.7, 0.0, 0.0])
    # but for the prior on the level, 0.7 dB against its 10
    assert moved == pytest.approx(0.7, rel=0.1)


@pytest.mark.slow
def test_a_trend_that_few_runs_leave_open_is_no_end(monkeypatch, objective):
    """Two runs: one as the baseline predicts, the other with another skewness, which kriging continues between them."""
    x, quick = np.array(objective.bins.first), Optimiser(population=20, evaluations=100)
    away, other = x + [3.0, 0.0, 0.0, 0.0], x + [-0.5, 0.0, 0.0, 0.0]
    runs = np.array([away, other])
    shown = np.array([objective.baseline(away), objective.baseline(other) + [0.0, 0.0, -1.5]])

    def searched(runs, shown):
        return Search(objective, Surrogate(train_surrogate(objective, runs, shown, SurrogateConfig()), objective))

    found = searched(runs, shown)
    cost, (gain, _, moved) = outlook(objective, away, shown[0])
    best = make_score(cost, away.tolist(), looks=objective.worth(away, shown[0])[0], statistics=shown[0].tolist())
    point, least = found.without_trend(best, seed=1)
    assert cost - least == pytest.approx(gain, abs=5e-3)
    # kriging that promises nothing does not end the search, and its next run is that of the other promise
    at_best = found.point(away, best.looks)
    monkeypatch.setattr(found, "minimum", lambda *_, **__: (at_best, cost - 0.01))
    monkeypatch.setattr(found, "polish", lambda *_, **__: at_best)
    told = found.outlook(best, seed=1)
    assert told[0] == pytest.approx(gain, abs=5e-3)
    assert told[2] == pytest.approx(moved, abs=0.05)
    proposal = found.propose(quick, 1, replace(best, cost=float(found.cost(at_best)[0])))
    assert proposal.mode == "explore"
    there = found.split(point[None])[0][0]
    difference = MANGIA(ANGLES, proposal.parameters) - MANGIA(ANGLES, there)
    assert np.abs(difference).max() < 0.05
    # no more than the stop criterion asks for
    assert found.without_trend(replace(best, cost=least + 0.025), seed=1) is None
    assert found.without_trend(replace(best, cost=least + 0.035), seed=1) is not None
    # the run of that X, or one beside it, shows the discrepancy there
    tried = np.array([*runs, there + [0.1, 0.0, 0.0, 0.0]])
    assert searched(tried, np.array([*shown, shown[0]])).without_trend(best, seed=1) is None
    # as many runs as a linear trend has coefficients: 4 leave it open, 5 do not
    far = np.array([*runs, *(x + [20.0, shift, -shift, 0.0] for shift in (0.0, 5.0, 9.0))])
    all_shown = np.array([objective.baseline(one) for one in far])
    assert searched(far[:4], all_shown[:4]).without_trend(best, seed=1) is not None
    assert searched(far, all_shown).without_trend(best, seed=1) is None
    # without a baseline there is no model that one run could correct
    black_box = train_surrogate(objective, runs, shown, SurrogateConfig(baseline=False))
    assert Search(objective, Surrogate(black_box, objective)).without_trend(best, seed=1) is None


def test_parts_are_levels_and_spreads_and_sum_to_all(objective):
    x = np.array(TRUTH["field"])
    statistics = objective.baseline(x)
    higher = statistics + [1.0, 0.0, 0.0]
    points = PredictedPoints(np.array([statistics, higher]), np.array([x, x]), np.array([3.0, 3.0]))
    residuals = objective.residuals(points)
    found = objective.parts(points)
    np.testing.assert_allclose(found.sum(axis=1), (residuals**2).sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(objective.cost(points), 0.5 * (residuals**2).sum(axis=1), rtol=1e-12)
    likelihood = Likelihood(objective.material)
    residuals = likelihood.residuals(points)
    np.testing.assert_allclose(likelihood.parts(points).sum(axis=1), (residuals**2).sum(axis=1), rtol=1e-9)


def test_costs_as_good_as_the_smallest_are_promising(objectives):
    found = objectives["field"].promising(np.array([4.0, 4.025, 4.035, 4.99]), 5.0)
    assert found.tolist() == [True, True, False, False]
    assert objectives["field"].promising(np.array([4.96, 4.98]), 5.0).tolist() == [True, False]
    assert not objectives["field"].promising(np.array([4.98]), 5.0).any()


def test_a_law_of_the_simulator_alone_has_bins_too(parts):
    *_, targets = parts
    material = make_material(targets["field"], BOUNDS)
    objective = Bins(material)
    assert objective.baseline is None
    assert objective.explores
    assert not len(objective.starts)
    assert objective.promising(np.array([4.0, 4.04, 4.06]), 5.0).tolist() == [True, True, False]
    statistics = from_cumulants(targets["field"].classes.classes.cumulants)
    tilt = np.zeros((3, 3))
    tilt[:, 0] = [1.0, 0.0, -1.0]
    at, higher, tilted = (
        objective.worth(TRUTH["field"], statistics + shift)[1] for shift in (0.0, [1.0, 0.0, 0.0], tilt)
    )
    # a single field says little of the level, its own slope it has
    assert at < 0.1 < 0.5 < higher
    assert tilted > 5.0 * higher
    assert objective.moved_db(TRUTH["field"], TRUTH["lake"]) is None


def test_a_target_without_bins_ends_in_a_sentence(parts):
    *_, targets = parts
    with pytest.raises(MeasurementError, match="the target of dyke has no incidence-angle bins"):
        Bins(make_material(replace(targets["field"], classes=None), BOUNDS, MANGIA))


@pytest.mark.slow
def test_the_likelihood_of_the_pixels_finds_the_laws_too(parts, tmp_path):
    """The objective that knows nothing of patches, through the same loop and the same targets."""
    case, simulator, geometry, scene, targets = parts
    few = case.optimiser.model_copy(update={"population": 8, "evaluations": 8})
    case = case.model_copy(update={"objective": "likelihood", "optimiser": few})
    runner = Runner(RunStore(tmp_path / "runs"), simulator, geometry, scene.identity, case)
    history, decision = calibrate(case, [runner], [targets])
    objectives = make_objectives(case, [targets])
    assert all(objective.misfit is LikelihoodMisfit for objective in objectives.values())
    assert decision.reason == "settled"
    laws_are_right(history)
    # texture of the one, none of the other
    assert history.best("lake").looks == pytest.approx(2.5, rel=0.2)
    assert history.best("field").looks > 3.0
