"""The counts of ``benchmarks/searches.py``, and a search of ``benchmarks/peers.py`` on residuals of known zero."""

import json
import math
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace

import numpy as np
import peers
import platypus
import pytest
import runs_to_tolerance
import searches
from searches import Ended, Results, quartiles, runs_to


def row(*best, **keys):
    return {"best": [list(one) for one in best], **keys}


def test_the_first_run_within_the_rms_counts():
    found = row((1, 2e-2), (4, 3e-3), (9, 8e-6))
    assert [runs_to(found, rms) for rms in (1e-5, 3.2e-3, 1e-6)] == [9.0, 4.0, math.inf]


def test_runs_of_a_design_and_of_an_iteration_are_made_together():
    found = row((3, 1e-2), (9, 8e-6))
    counted = {"radcal": (3, 9), "radcal_2": (4, 10), "radcal_black_box_2": (8, 10), "paper": (800, 800)}
    for method, runs in counted.items():
        made = [runs_to_tolerance.made_to(found, method, rms) for rms in (1e-2, 1e-5, 1e-6)]
        assert made == [*runs, math.inf], method


def test_a_sort_ranks_solutions_of_one_objective_as_platypus_does():
    """Also solutions with equal values, of which the first one is preferred."""
    problem = platypus.Problem(1, 1)
    found = []
    for rank in (platypus.nondominated_sort, searches._sorted):
        solutions = [platypus.Solution(problem) for _ in range(40)]
        for solution, value in zip(solutions, np.random.default_rng(2).integers(0, 12, 40), strict=True):
            solution.objectives[:] = [float(value)]
        rank(solutions)
        found.append([(solution.rank, solution.crowding_distance) for solution in solutions])
    assert found[0] == found[1]


def test_a_search_that_did_not_reach_counts_as_more_than_any_other():
    assert quartiles([5.0, math.inf, 7.0, 6.0, math.inf]) == [6.0, 7.0, None]
    assert quartiles([5.0, 8.0, math.inf, math.inf])[:2] == [7.25, None]
    rows = [row((1, 2e-2), (5, 1e-6)), row((1, 2e-2), (8, 5e-6)), row((1, 2e-2), (700, 4e-4))]
    assert runs_to_tolerance.of_reading(rows, "sbi", 1e-5) == {"success": 2, "n": 3, "median": 8.0, "worst": 8.0}


def test_a_finished_search_is_not_made_again(tmp_path, monkeypatch):
    monkeypatch.setattr(searches, "TimedBench", lambda _: None)
    keys = {"method": "cma_es", "target": "reachable", "number": 3}
    path = tmp_path / "results.jsonl"
    path.write_text(json.dumps(row((620, 5e-6), **keys)) + "\n")
    results = Results(path, tmp_path)
    assert results.search(keys, search=None)["best"] == [[620, 5e-6]]
    assert results.of({"number": 4}) == []


def test_a_killed_published_search_goes_on(tmp_path, monkeypatch):
    """Its folder stays, with the length scales that took most of its time, until the search has ended."""
    trained = []

    def train(unit, values, noisy):
        trained.append(len(unit))
        return np.full(4, 0.5 + len(trained)), 1e-9, "trained"

    def calibrate(case, runners, targets):
        found = [searches.surrogate.train_smt(np.zeros((n, 4)), np.zeros(n), False) for n in (20, 20, 20, 39, 39, 39)]
        assert [list(scales) for scales, *_ in found] == 2 * [[1.5] * 4, [2.5] * 4, [3.5] * 4]
        if len(trained) == 3:
            trained.append(0)
            raise KeyboardInterrupt
        score = {"dyke": SimpleNamespace(rms=5e-6)}
        return SimpleNamespace(runs=[SimpleNamespace(kind="infill", scores=score)]), SimpleNamespace(reason="rms")

    @contextmanager
    def problem_of(bench, method, target, number, folder):
        (folder / "runs").mkdir(parents=True, exist_ok=True)
        yield SimpleNamespace(folder=folder, case=None, runner=None, targets=None, rms=[], own_s=lambda: 7.0)

    for name, one in {"TimedBench": lambda _: None, "train_smt": train, "calibrate": calibrate}.items():
        monkeypatch.setattr(searches, name, one)
    monkeypatch.setattr(searches, "problem_of", problem_of)
    keys = {"method": "paper", "target": "reachable", "number": 2}
    search, results = partial(searches.calibrated, published=True), Results(tmp_path / "results.jsonl", tmp_path)
    with pytest.raises(KeyboardInterrupt):
        results.search(keys, search)
    assert json.loads((tmp_path / "results_paper_reachable_2/scales.json").read_text())["own_s"] == 7.0
    assert results.search(keys, search)["runs"] == 1
    assert trained == [20, 20, 20, 0]
    assert [path.name for path in tmp_path.iterdir()] == ["results.jsonl"]


@pytest.mark.parametrize("method", ["levenberg_marquardt", "dogbox"])
def test_a_peer_finds_the_zero_of_linear_residuals(method):
    slopes = np.array([[1.0, 2.0, 0.0, -1.0], [0.0, 1.0, 3.0, 1.0], [2.0, 0.0, 1.0, 1.0]])
    zero, runs = np.array([0.3, 0.6, 0.2, 0.7]), []

    def residuals(unit):
        runs.append(unit)
        found = slopes @ (unit - zero)
        if np.linalg.norm(found) < 1e-7:
            raise Ended("rms")
        return found

    with pytest.raises(Ended):
        peers.PEERS[method].search(SimpleNamespace(start=np.full(4, 0.5), dimension=4, seed=1, residuals=residuals))
    assert len(runs) <= 50  # a dozen iterations of five runs at most: X is no linear function of v
