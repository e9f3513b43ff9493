from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_score

from radcal.calibration.stopping import decide
from radcal.config import Stop
from radcal.errors import StoreError
from radcal.objectives.history import (
    History,
    Proposal,
    Run,
    read_proposals,
    read_runs,
    read_search,
    write_proposals,
    write_runs,
)
from radcal.storage.records import read_json, write_json


def run(kind, index, x, cost, proposal=None, **keys):
    score = make_score(cost, list(x), statistics=[[cost, index, 0.2], [1.0, 2.0, 3.0]], **keys)
    return Run(kind, index, [f"{kind}{index}"], 0.5, {"dyke": score}, {"dyke": proposal} if proposal else {})


RUNS = [
    run("reference", 0, [0.1, 1 / 3], 0.5),
    run("design", 0, [0.2, 0.2], 0.3),
    run("design", 1, [0.3, 0.3], 0.2),
    run("infill", 0, [0.4, 0.4], 0.1),
    run("infill", 1, [0.3, 0.3], 0.1),
]


def test_counts_and_best():
    history = History(RUNS)
    assert [history.count(kind) for kind in ("reference", "design", "infill")] == [1, 2, 2]
    assert history.best_run("dyke") is RUNS[3], "the earliest of equals"
    assert History(RUNS[:3]).best_run("dyke") is RUNS[2], "of the design alone"
    assert history.infill == RUNS[3:]


def test_the_best_is_that_of_the_smallest_cost_whatever_the_rms():
    runs = [run("design", 0, [0.2], 3.0, rms=0.4), run("design", 1, [0.3], 4.0, rms=0.1)]
    assert History(runs).best_run("dyke") is runs[0]


def test_failures_count_proposals_since_the_best():
    def infill(index, cost, mode="exploit"):
        return run("infill", index, [0.0], cost, Proposal([0.0], mode))

    assert History(RUNS[:3]).failures("dyke") == 0
    runs = [*RUNS[:3], infill(0, 0.4), infill(1, 0.3)]
    assert History(runs).failures("dyke") == 2
    runs += [infill(2, 0.1), infill(3, 0.2), infill(4, 0.1, "ended")]
    assert History(runs).failures("dyke") == 1


def test_surprise_is_the_mean_square_of_errors_over_the_variance_that_was_stated():
    """Pooled over runs and bins by the ratio of sums; repeated runs, and predictions without an error, do not count."""

    def verified(index, cost, errors, mode="exploit", predicted=((0.5, 0.3, 0.2), (0.9, 2.0, 3.4))):
        proposal = Proposal([0.0], mode, statistics=[list(row) for row in predicted], errors=errors)
        return run("infill", index, [0.1 * index], cost, proposal)

    stated = [[[0.1, 0.2, 0.3]] * 2, [[0.4, 0.1, 0.6]] * 2]
    runs = [*RUNS[:3], verified(0, 0.1, stated[0]), verified(1, 0.7, stated[1], "explore")]
    # verified statistics are (cost, index, 0.2) and (1, 2, 3)
    squares = np.array([0.4**2 + 0.2**2 + 2 * 0.1**2, 0.3**2 + 0.7**2, 2 * 0.4**2])
    variances = 2.0 * np.array([0.1**2 + 0.4**2, 0.2**2 + 0.1**2, 0.3**2 + 0.6**2])
    np.testing.assert_allclose(History(runs).surprise("dyke"), squares / variances)
    silent = [
        verified(2, 9.0, [[0.0] * 3] * 2),
        verified(3, 9.0, [], predicted=()),
        verified(4, 9.0, stated[0], "ended"),
    ]
    again = verified(1, 9.0, stated[0])  # an X that a run before had
    np.testing.assert_allclose(History([*runs, *silent, again]).surprise("dyke"), squares / variances)
    np.testing.assert_array_equal(History([*RUNS[:3], *silent]).surprise("dyke"), 1.0)
    # noise of the runs is no error of the surrogate
    noise = {"dyke": [[0.02, 0.1, 0.05], [0.01, 0.2, 0.03]]}
    noisy = History([*runs, replace(RUNS[0], repeat_variance=noise)]).surprise("dyke")
    left = squares - 2.0 * np.sum(noise["dyke"], axis=0)
    np.testing.assert_allclose(noisy, np.maximum(left, 0.0) / variances)
    assert left[2] > 0.0 > left[1]


def test_training_holds_each_point_once():
    """With the statistics of its latest run: its neighbours' laws are then nearest to their own."""
    x, statistics = History(RUNS).training("dyke")
    np.testing.assert_array_equal(x, [[0.1, 1 / 3], [0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    assert statistics.shape == (4, 2, 3)
    np.testing.assert_array_equal(statistics[2, 0], [0.1, 1.0, 0.2])
    np.testing.assert_array_equal(statistics[1, 0], [0.3, 0.0, 0.2])


def test_a_reference_run_of_another_law_counts_for_nothing():
    reference = run("reference", 0, [-9.0], 0.01, own_law=False)
    history = History([reference, *RUNS[1:]])
    assert history.best_run("dyke") is RUNS[3]
    np.testing.assert_array_equal(history.training("dyke")[0], [[0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    assert decide(History([reference, *RUNS[1:3]]), ["dyke"], Stop(rms=0.05), "density").reason is None
    assert decide(History(RUNS[1:3]), ["dyke"], Stop(rms=0.25), "density").reason == "rms"


def test_noise_is_the_mean_of_what_repetitions_measured():
    repeated = [
        replace(RUNS[0], repeat_variance={"dyke": [[k, 2.0 * k, 0.5], [1.0, k, 3.0]]}, repeat_db=float(k))
        for k in (1.0, 4.0)
    ]
    history = History([RUNS[0], *repeated])
    np.testing.assert_allclose(history.noise_variance("dyke"), [[2.5, 5.0, 0.5], [1.0, 2.5, 3.0]])
    assert history.repeat_db == [1.0, 4.0]
    assert History(RUNS).noise_variance("dyke") is None
    assert history.rms_sampling("dyke") == 0.0
    assert History([replace(RUNS[0], rms_sampling={"dyke": 2e-3}), *RUNS]).rms_sampling("dyke") == 2e-3


def test_files_round_trip_to_the_last_bit(tmp_path):
    proposal = Proposal([0.1 + 0.2, 1e-300], "explore", 1e-5, None, 0.3, 0.7, [[1 / 3, 0.0, -0.1]], [[0.1, 0.2, 1e-9]])
    runs = [
        run("reference", 0, [0.1, 1 / 3], 0.5, own_law=False),
        *RUNS[1:3],
        run("infill", 0, [0.1 + 0.2], 0.1, proposal, gain=1e-17, floor=None, moved_db=0.1 + 0.7, looks=2 / 3),
    ]
    runs[0] = replace(runs[0], repeat_variance={"dyke": [[0.1, 0.2, 1 / 7]]}, rms_sampling={"dyke": 1e-3})
    write_runs(tmp_path / "a.json", runs[:2])
    write_runs(tmp_path / "b.json", runs[2:])
    assert list(read_runs([tmp_path / "a.json", tmp_path / "b.json"]).runs) == runs
    both = [{"dyke": proposal}, {"dyke": replace(proposal, mode="exploit")}]
    write_proposals(tmp_path / "p.json", both)
    assert read_proposals(tmp_path / "p.json") == both
    write_json(tmp_path / "p.json", read_json(tmp_path / "p.json")[0])  # as an earlier version wrote it
    assert read_proposals(tmp_path / "p.json") == both[:1]


def test_the_last_iteration_names_those_before_it(tmp_path):
    verified = [tmp_path / f"iterations/{k}/verified.json" for k in range(11)]
    for k, path in enumerate(verified):
        write_runs(path, [run("infill", k, [0.5 + 0.01 * k], 0.1)])
    write_runs(tmp_path / "scores.json", RUNS[:1])

    def infill(*named):
        history = read_search(tmp_path / "scores.json", [str(path) for path in named])
        assert history.runs[0] == RUNS[0]
        return [one.index for one in history.runs[1:]]

    assert infill() == []
    assert infill(verified[0]) == [0]
    assert infill(verified[9]) == infill(*verified[:10]) == [*range(10)]  # as numbers, not as words: 10 comes last
    assert infill(verified[10]) == [*range(11)]


def test_a_file_of_a_newer_version_is_named(tmp_path):
    file = tmp_path / "proposal.json"
    write_proposals(file, [{"dyke": Proposal([1.0, 2.0], "exploit")}])
    data = read_json(file)
    data[0]["dyke"]["front"]["colour"] = 3
    write_json(file, data)
    said = r"proposal\.json: holds other .* 0\.dyke\.front\.colour: Unexpected keyword argument, found 3\)"
    with pytest.raises(StoreError, match=said):
        read_proposals(file)


def test_runs_of_an_earlier_version_are_read_with_their_passes(tmp_path):
    write_runs(tmp_path / "now.json", [replace(RUNS[1], keys=["a", "b"])])
    (entry,) = read_json(tmp_path / "now.json")
    (entry["key"], *entry["further_keys"]), score = entry.pop("keys"), entry["scores"]["dyke"]
    (first,) = score.pop("densities")
    score |= {**first, "further": [None]}
    write_json(tmp_path / "earlier.json", [entry])
    (run,) = read_runs([tmp_path / "earlier.json"]).runs
    assert run.keys == ["a", "b"]
    assert run.scores["dyke"].densities == [*RUNS[1].scores["dyke"].densities, None]


def test_other_contents_under_a_right_checksum_are_one_sentence(tmp_path):
    file = tmp_path / "scores.json"
    write_runs(file, RUNS[:1])
    damaged = read_json(file)
    damaged[0]["scores"]["dyke"]["cost"] = None
    for content, said in (
        ("nothing", "0: Input should be an object, found 'n'"),
        (damaged, "0.scores.dyke.cost: Input should be a .*, found None"),
    ):
        write_json(file, content)
        with pytest.raises(StoreError, match=rf"scores\.json: holds other contents .* \(ValueError: {said}.*delete"):
            read_runs([file])
