from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from radcal.calibration.history import (
    History,
    Proposal,
    Run,
    read_proposals,
    read_runs,
    score,
    write_proposals,
    write_runs,
)
from radcal.calibration.stopping import decide
from radcal.config import Stop
from radcal.measurement.target import Targets
from radcal.storage.runs import Record


def run(kind, index, x, rms):
    return Run(kind, index, f"{kind}{index}", 0.5, {"dyke": list(x)}, {"dyke": [0.0, 1.0, 0.1]}, {"dyke": rms})


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
    assert history.best("dyke") is RUNS[3], "the earliest of equals"
    assert History(RUNS[:3]).best("dyke") is RUNS[2], "of the design alone"
    assert history.infill == RUNS[3:]


def test_failures_count_proposals_since_the_best():
    def infill(index, rms, mode="exploit"):
        return Run("infill", index, "", 0.0, {"dyke": [0.0]}, {}, {"dyke": rms}, {"dyke": Proposal([0.0], mode)})

    assert History(RUNS[:3]).failures("dyke") == 0
    runs = [*RUNS[:3], infill(0, 0.4), infill(1, 0.3)]
    assert History(runs).failures("dyke") == 2
    runs += [infill(2, 0.1), infill(3, 0.2), infill(4, 0.1, "ended")]
    assert History(runs).failures("dyke") == 1


def test_training_holds_each_point_once():
    x, dp = History(RUNS).training("dyke")
    np.testing.assert_array_equal(x, [[0.1, 1 / 3], [0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    assert dp.shape == (4, 3)


def test_a_reference_run_of_another_law_counts_for_nothing():
    reference = replace(RUNS[0], parameters={"dyke": [-9.0]}, rms={"dyke": 0.01}, other_law=["dyke"])
    history = History([reference, *RUNS[1:]])
    assert history.best("dyke") is RUNS[3]
    np.testing.assert_array_equal(history.training("dyke")[0], [[0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    assert decide(History([reference, *RUNS[1:3]]), ["dyke"], Stop(rms=0.05)).reason is None
    assert decide(History([*RUNS[1:3]]), ["dyke"], Stop(rms=0.25)).reason == "rms"


def test_files_round_trip_to_the_last_bit(tmp_path):
    proposal = Proposal([0.1 + 0.2, 1e-300], "explore", 1e-5, None, 0.3)
    runs = [
        replace(RUNS[0], other_law=["dyke"]),
        *RUNS[1:3],
        Run("infill", 0, "k", 0.1, {"dyke": [0.1 + 0.2]}, {"dyke": [1, 2, 3]}, {"dyke": 0.1}, {"dyke": proposal}),
    ]
    write_runs(tmp_path / "a.json", runs[:2])
    write_runs(tmp_path / "b.json", runs[2:])
    assert list(read_runs([tmp_path / "a.json", tmp_path / "b.json"]).runs) == runs
    write_proposals(tmp_path / "p.json", {"dyke": proposal})
    assert read_proposals(tmp_path / "p.json") == {"dyke": proposal}


def test_score_asks_every_target():
    record = Record("k", {"a": np.zeros(3, np.float32), "b": np.ones(3, np.float32)}, None, 0.2)
    one = SimpleNamespace(score=lambda p, mapping: (np.array([p[0], *mapping]), float(p[0])))
    targets = Targets(dict.fromkeys("ab", one))
    found = score("design", 4, record, {"a": [1.0], "b": [2.0], "fixed": [3.0]}, targets)
    assert found.rms == {"a": 0.0, "b": 1.0}
    assert found.parameters == {"a": [1.0], "b": [2.0]}
