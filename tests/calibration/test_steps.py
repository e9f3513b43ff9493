"""Steps of the loop on two materials."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import TRUTH, make_run, make_score
from config_samples import COMMAND, measured

from radcal.calibration.loop import calibrate
from radcal.calibration.scoring import score, score_reference, with_texture
from radcal.calibration.steps import (
    _noisy,
    called,
    design_line,
    progress_line,
    propose_all,
    reference_runs,
    repeatability,
    train_all,
    verify,
)
from radcal.calibration.stopping import decide
from radcal.config import Stop
from radcal.config.stages import STAGES
from radcal.errors import MissingSign, SimulatorError
from radcal.objectives import make_objectives
from radcal.objectives.base import PredictedPoints
from radcal.objectives.density import Density
from radcal.objectives.history import History, Proposal, Run, read_proposals, read_runs, write_proposals, write_runs
from radcal.proposals.surrogate import Trainings
from radcal.seeds import draw_seeds, noise_seed
from radcal.speckle.texture import log_speckle_cumulants
from radcal.storage.dataclass_groups import same
from radcal.storage.runs import Record
from radcal.targets.target import Targets


@pytest.fixture(scope="module")
def made(parts, calibrated):
    """Objectives and history before any infill."""
    case, *_, targets = parts
    history, _ = calibrated
    return make_objectives(case, [targets]), History([run for run in history.runs if run.kind != "infill"])


@pytest.mark.slow
def test_steps_from_files_in_two_processes_are_those_from_memory_in_one(parts, calibrated, made, runner, tmp_path):
    case, *_, targets = parts
    history, _ = calibrated
    targets.write(tmp_path / "target.h5")
    again = Targets.read(tmp_path / "target.h5")
    assert all(target.classes is not None for target in targets.values())
    assert same(dict(again), dict(targets))
    objectives = make_objectives(case, [again])
    write_runs(tmp_path / "runs.json", made[1].runs)
    start = read_runs([tmp_path / "runs.json"])
    trained = [train_all(start, STAGES["train"].of(case), objectives, processes) for processes in (1, 2)]
    assert same(*trained)
    Trainings(trained[1]).write(tmp_path / "surrogate.h5")
    read = Trainings.read(tmp_path / "surrogate.h5").materials
    proposals = propose_all(read, objectives, start, STAGES["propose"].of(case), 0, case.stop, 2)
    assert proposals == [dict(history.infill[0].proposals)]
    write_proposals(tmp_path / "proposals.json", proposals)
    read = read_proposals(tmp_path / "proposals.json")
    (verified,), ahead = verify(read, [again], objectives, [runner], STAGES["verify"].of(case), start, 0, 2)
    assert replace(verified, seconds=0.0) == replace(history.infill[0], seconds=0.0)
    # the next iteration has the training of the verification, in the same bits, and trains what was left out
    after, train = History([*start.runs, verified]), STAGES["train"].of(case)
    Trainings(ahead).write(tmp_path / "trained.h5")
    ahead = Trainings.read(tmp_path / "trained.h5").materials
    assert same(dict(ahead), train_all(after, train, objectives))
    given = {"lake": ahead["lake"]}
    kept = train_all(after, train, objectives, 1, given)
    assert kept["lake"] is given["lake"]
    assert same(kept, dict(ahead))
    # what is promised is over the best of all runs, the verified one included
    for name, first in verified.scores.items():
        assert first.cost < 0.2 * min(run.scores[name].cost for run in made[1].runs)
        assert 0.0 <= first.gain <= first.cost


def test_an_ended_material_repeats_its_best(parts, calibrated, made):
    """Where the other goes on."""
    case, *_ = parts
    history, _ = calibrated
    runs = list(history.runs)
    scores = {**runs[-1].scores, "lake": replace(runs[-1].scores["lake"], gain=9.0, moved_db=9.0)}
    # the last run is not its best
    away = {**scores, "field": replace(scores["field"], parameters=[-20.0, 9.0, 11.0, 7.0], cost=1e3)}
    last = replace(runs[-1], index=len(history.infill), scores=away)
    going = History([*runs[:-1], replace(runs[-1], scores=scores), last])
    trained = train_all(going, STAGES["train"].of(case), made[0])
    (found,) = propose_all(trained, made[0], going, STAGES["propose"].of(case), len(going.infill), case.stop)
    assert found["field"].mode == "ended"
    assert found["field"].parameters == history.best("field").parameters
    assert found["lake"].mode != "ended"


def test_a_search_with_fewer_different_x_repeats_its_best_beside_the_others(parts, made, monkeypatch):
    case, *_ = parts
    (objectives, start), chosen = made, {"field": [1.0, 2.0], "lake": [3.0]}
    chosen = {name: [Proposal([x] * 4, "exploit") for x in each] for name, each in chosen.items()}
    trained = train_all(start, STAGES["train"].of(case), objectives)
    monkeypatch.setattr("radcal.calibration.steps.each", lambda work, processes: chosen)
    found = propose_all(trained, objectives, start, STAGES["propose"].of(case), 0, case.stop)
    best = Proposal(list(start.best("lake").parameters), "ended")
    assert found == [
        {"field": chosen["field"][0], "lake": chosen["lake"][0]},
        {"field": chosen["field"][1], "lake": best},
    ]


def test_texture_brings_the_spread_to_the_measured_one(parts, calibrated):
    """The density of a run has the material's looks: its spread is the target's, though the speckle's is less."""
    *_, targets = parts
    history, _ = calibrated
    best = history.best("lake")
    sd = np.exp(np.array(best.statistics)[:, 1])
    measured = np.sqrt(targets["lake"].classes.classes.cumulants[:, 1])
    assert (sd < 0.9 * measured).all()
    assert best.rms < 0.01


def test_texture_lowers_looks_and_a_fresh_run_has_its_own(made):
    values = np.zeros(20_000, dtype=np.float32)

    def lake(looks, fresh=False):
        found = with_texture({"lake": values, "road": values}, {"lake": made[0]["lake"]}, {"lake": looks}, 1, fresh)
        assert found["road"] is values
        return found["lake"]

    drawn = [lake(2.5, fresh) for fresh in (False, True)]
    assert abs(np.corrcoef(*drawn)[0, 1]) < 0.05
    assert drawn[0].std() == pytest.approx(drawn[1].std(), rel=0.05)
    np.testing.assert_array_equal(drawn[0], lake(2.5))
    # with speckle of 4 looks it has the variance in dB of that of 2.5
    wanted = log_speckle_cumulants(2.5)[1] - log_speckle_cumulants(4.0)[1]
    assert drawn[0].var() == pytest.approx(wanted, rel=0.05)
    assert lake(4.0) is values


def program(build_case, **keys):
    """Case of an external program."""
    return build_case(simulator=COMMAND | keys, **measured(radiometry="sigma0_local"))


class Recorded:
    """A runner that keeps what it is asked for."""

    def __init__(self):
        self.asked = []

    def run(self, parameters, seed, image=False, repeat=False):
        self.asked.append((seed, image, repeat))
        return Record(f"{seed}{repeat}", {}, None, 0.1)


@pytest.mark.parametrize(("deterministic", "runs"), [(None, 2), (True, 1), (False, 1)])
def test_only_a_program_that_declares_nothing_repeats_its_reference_run(build_case, deterministic, runs):
    case, runner = program(build_case, deterministic=deterministic), Recorded()
    assert len(reference_runs(STAGES["reference_run"].of(case), [runner])) == runs
    seed = noise_seed(case)
    assert runner.asked == [(seed, True, False), (seed, False, True)][:runs]


@pytest.mark.parametrize("heard", [[], [1], [2]])
def test_equal_speckle_draws_are_refused(build_case, heard):
    """Their average would be taken for that of independent ones."""
    case = STAGES["reference_run"].of(program(build_case, draws=3))
    others = [draw_seeds(case)[k] for k in heard]

    class Deaf:
        def run(self, parameters, seed, image=False, repeat=False):
            return Record(str(seed), {"dyke": np.float32([1.0, 2.0 + 0.5 * (seed in others)])}, None, 0.1)

    with pytest.raises(SimulatorError, match=r"^reference run: simulator\.draws is 3, but speckle draws with other "):
        reference_runs(case, [Deaf()])


@pytest.mark.parametrize(
    ("deterministic", "differences", "noisy", "codes"),
    [
        (None, [0.0, 0.3], True, ["does_not_repeat"]),
        (None, [0.0, 0.0], False, ["repeats"]),
        (None, [], False, []),
        (True, [0.3], False, ["does_not_repeat"]),
        (False, [], True, ["declared_random"]),
    ],
)
def test_runs_are_noisy_where_they_are_declared_so_or_differ(build_case, deterministic, differences, noisy, codes):
    simulator = program(build_case, deterministic=deterministic).simulator
    history = History([make_run("reference", k, {"dyke": 0.1}) for k in range(len(differences))])
    history = History([replace(run, repeat_db=db) for run, db in zip(history.runs, differences, strict=True)])
    assert _noisy(history, simulator) is noisy
    found = repeatability(simulator, differences)
    assert [one.code for one in found] == codes
    assert [one.numbers["largest_db"] for one in found if one.numbers] == [0.3] * (codes == ["does_not_repeat"])
    assert not _noisy(history, build_case().simulator)


def test_score_asks_every_target_and_no_other_law(parts, runner, made):
    case, *_, targets = parts
    record = runner.run(TRUTH, noise_seed(case))
    fixed = {"road": [3.0]}  # a material that is not calibrated
    found = score("design", 4, [record], TRUTH | fixed, [targets], made[0], case.seed, other_law=["lake"])
    assert (found.kind, found.index, found.keys) == ("design", 4, [record.key])
    assert {name: one.parameters for name, one in found.scores.items()} == TRUTH
    field, lake = found.scores["field"], found.scores["lake"]
    statistics = made[0]["field"].statistics(record.pixels_db["field"][targets["field"].order])
    np.testing.assert_allclose(field.statistics, statistics)
    assert (field.looks, field.cost) == made[0]["field"].worth(TRUTH["field"], statistics)
    assert (field.own_law, lake.own_law) == (True, False)
    # of another law there is no cost but the rms of the speckle as it is
    assert (lake.looks, lake.cost) == (4.0, lake.rms)
    assert lake.rms == pytest.approx(targets["lake"].score(record.pixels_db["lake"])[1])


def test_statistics_are_means_over_the_draws_of_speckle(parts, runner, made):
    case, *_, targets = parts
    each = [runner.run(TRUTH, seed) for seed in (noise_seed(case), 77, 78)]

    def statistics(record):
        return score("design", 0, [record], TRUTH, [targets], made[0], case.seed).scores["lake"].statistics

    alone = [statistics(record) for record in each]
    whole = statistics(replace(each[0], draws=tuple(each[1:])))
    np.testing.assert_allclose(whole, np.mean(alone, axis=0))
    assert np.ptp(alone, axis=0).max() > 0.05


def test_the_density_of_several_draws_is_that_of_their_averaged_statistics(parts, runner):
    """The surrogate predicts these averages: a search that got the rms of a single draw would never reach it."""
    case, *_, targets = parts
    objectives = {name: Density(objective.material) for name, objective in make_objectives(case, [targets]).items()}
    first, *others = (runner.run(TRUTH, seed) for seed in (noise_seed(case), 77, 78))
    found = score("infill", 0, [replace(first, draws=tuple(others))], TRUTH, [targets], objectives, case.seed)
    for name, one in found.scores.items():
        predicted = PredictedPoints(np.array(one.statistics)[None], np.array([TRUTH[name]]), np.array([one.looks]))
        assert one.cost == one.rms == pytest.approx(objectives[name].cost(predicted)[0], rel=0.01)
        alone = score("infill", 0, [first], TRUTH, [targets], objectives, case.seed).scores[name].rms
        assert one.rms != pytest.approx(alone, rel=0.05)


def test_a_repetition_of_one_draw_is_no_run_of_the_search(parts, runner, made):
    case, *_, targets = parts
    first, *others = (runner.run(case.start_parameters, seed) for seed in (noise_seed(case), 77, 78))
    whole, again = replace(first, draws=tuple(others)), Record("again", first.pixels_db, None, 0.1)
    runs = score_reference(STAGES["scores"].of(case), [[whole], [again]], [targets], made[0])
    history = History([runs[0], replace(runs[1], scores={k: replace(s, cost=0.0) for k, s in runs[1].scores.items()})])
    for name in made[0]:
        assert history.best_run(name) is runs[0]
        np.testing.assert_array_equal(history.training(name)[1], [runs[0].scores[name].statistics])
    assert decide(history, list(made[0]), case.stop, "classes").reason is None


def test_a_repeated_reference_run_tells_the_noise(parts, runner, made):
    case, *_, targets = parts
    first = runner.run(TRUTH, noise_seed(case))
    rng = np.random.default_rng(1)
    again = {name: (v + rng.normal(0.0, 0.5, v.shape)).astype(np.float32) for name, v in first.pixels_db.items()}
    second = Record("again", again, None, 0.1)
    runs = score_reference(STAGES["scores"].of(case), [[first], [second]], [targets], made[0])
    assert runs[0].rms_sampling == {name: target.rms_sampling for name, target in targets.items()}
    assert runs[1].repeat_db == pytest.approx(2.3, abs=0.7), "the largest of 8,000 normal differences of 0.5 dB"
    variance = History(runs).noise_variance("field")
    assert variance.shape == (3, 3)
    # half of the variance of the difference, of the mean of the pixels of a bin; three standard errors of the bootstrap
    wanted = 0.5 * 0.5**2 / (targets["field"].effective / 3.0)
    assert np.mean(variance[:, 0]) == pytest.approx(wanted, rel=0.32)
    # of the averages of four independent draws it is a quarter
    four = replace(first, draws=(first,) * 3)
    runs = score_reference(STAGES["scores"].of(case), [[four], [second]], [targets], made[0])
    np.testing.assert_allclose(History(runs).noise_variance("field"), variance / 4)
    equal = score_reference(STAGES["scores"].of(case), [[first], [first]], [targets], made[0])
    assert History(equal).noise_variance("field") is None
    assert equal[1].repeat_db == 0.0


def test_lines_of_the_log_name_the_nearest_and_the_worst_material(parts, runner, calibrated):
    case, *_, targets = parts
    run = calibrated[0].runs[2]
    record = runner.run({name: one.parameters for name, one in run.scores.items()}, noise_seed(case))
    rms = {name: score for name, (_, score) in targets.score(record.pixels_db).items()}
    (low, best), (high, worst) = sorted(rms.items(), key=lambda item: item[1])
    assert design_line(2, 12, record, targets).endswith(
        f"differ by {best:.2e} ({low}) to {worst:.2e} ({high}) per dB (rms)"
    )
    history = History([make_run("reference", 0, {"a": 0.6, "b": 0.4}), make_run("design", 0, {"a": 0.2, "b": 0.3})])
    start = "after   1 run (iteration 0): "
    for tolerance, wanted in (
        (0.1, "0 of 2 laws meet the stop criterion; b: rms 0.3, above the tolerance 0.1 so far"),
        (0.25, "1 of 2 laws meets the stop criterion; b: rms 0.3, above the tolerance 0.25 so far"),
        (0.35, "2 of 2 laws meet the stop criterion"),
    ):
        assert progress_line(history, ["a", "b"], Stop(rms=tolerance), "density") == start + wanted
    moved = {"a": 0.13, "b": 0.24}
    scores = {name: make_score(5.0, moved_db=db, gain=0.5) for name, db in moved.items()}
    proposals = {name: Proposal([0.0], "exploit", cost=5.0) for name in moved}
    infill = Run("infill", 0, ["k"], 0.5, scores, proposals)
    history = History([make_run("reference", 0, dict.fromkeys(moved, 9.0)), infill])
    line = progress_line(history, list(moved), Stop(law_db=0.05), "classes")
    assert line.startswith("after   1 run (iteration 1): 0 of 2 laws meet the stop criterion; b: stop criterion not")
    assert "0.24 dB" in line


def test_a_failure_names_its_run():
    about = MissingSign("any")
    said = r"^design run 3 of 12: simulator\.output\.file: no image\.$"
    with pytest.raises(SimulatorError, match=said) as refused, called("design run 3 of 12"):
        raise SimulatorError("simulator.output.file: no image.", about)
    assert refused.value.about == about


def test_a_start_of_another_law_asks_for_its_runner(build_case):
    law = {"law": "tabulated", "angles_deg": [15, 25, 40], "bounds": [[-20, 0]] * 3}
    start = {"law": "mangia", "parameters": [-10.0, 2.0, 4.0, 3.0]}
    case = build_case(
        materials={"field": {"calibrate": True, **law, "start": start}},
        measurement={"synthetic": {"parameters": {"field": [-4.0, -9.5, -12.0]}}},
    )
    with pytest.raises(ValueError, match=r"\['field'\] start with another law"):
        calibrate(case, [], [Targets({})])
