"""Largest number of runs, and their time."""

from __future__ import annotations

from pathlib import Path

import pytest

from radcal.config import case_from
from radcal.forecast.runs_and_time import duration, largest_runs, stored_iteration_seconds, time_expected
from radcal.storage.records import write_hdf5

EXTERNAL = {
    "kind": "command",
    "command": ["./sim", "{input}"],
    "input": {"format": "json"},
    "output": {"file": "a.npy", "scale": "db"},
}


def test_the_largest_number_of_runs_is_that_of_all_passes(build_case) -> None:
    case = build_case(design={"size": 5}, stop={"max_runs": 40})
    assert largest_runs(case) == {"reference": 2, "design": 5, "infill": 35, "final": 2}, "with the registration run"
    case = build_case(design={"size": 5}, stop={"max_runs": 40}, registration={"rounds": 1})
    assert largest_runs(case) == {"reference": 1, "design": 5, "infill": 35, "final": 2}
    external = build_case(design={"size": 5}, stop={"max_runs": 40}, simulator=EXTERNAL)
    assert largest_runs(external)["reference"] == 3, "repeated, to find out whether it can be"
    declared = build_case(simulator={**EXTERNAL, "deterministic": True})
    assert largest_runs(declared)["reference"] == 2
    file = {"source": "file", "path": "a.npy", "scale": "db", "radiometry": "sigma0_ref"}
    passes = {"radar": [{}, {"depression_deg": 50}], "measurement": [file, file]}
    one = {"materials": {"field": {"calibrate": True}}, "design": {"size": 5}, "stop": {"max_runs": 40}}
    assert largest_runs(case_from({**one, **passes})) == {"reference": 4, "design": 10, "infill": 70, "final": 4}


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.42, "0.42 s"), (89, "89 s"), (91, "1.5 min"), (420, "7 min"), (5500, "1.5 h"), (4e5, "4.6 days")],
)
def test_durations_are_said_in_a_fitting_unit(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_time_of_stored_iterations(tmp_path: Path) -> None:
    assert stored_iteration_seconds(tmp_path / "gone") is None
    for number, seconds in enumerate((12.0, 3.0, 5.0)):
        for stage in ("train", "propose", "verify"):
            (tmp_path / f"{stage}_{number}.tsv").write_text(f"s\th:m:s\n{seconds}\t0:00:12\n")
    (tmp_path / "verify_3.tsv").write_text("s\th:m:s\n900\t0:15:00\n")  # its training has left no file
    assert stored_iteration_seconds(tmp_path) == 15.0
    (tmp_path / "train_2.tsv").write_text("s\n")
    assert stored_iteration_seconds(tmp_path) == 22.5


def test_the_time_follows_from_stored_runs_and_iterations(build_case, tmp_path: Path) -> None:
    case = build_case(case="mine", design={"size": 3}, stop={"max_runs": 43}, simulator={"draws": 4})
    assert time_expected(case, tmp_path).startswith("time: not known before the first run")
    for number, seconds in enumerate((9.0, 4.0, 2.5)):
        with write_hdf5(tmp_path / f"mine/runs/{number}.h5", "run") as file:
            file.attrs["seconds"] = seconds
    # four draws of 4 s; reference, registration, three of the design and two final runs; then 16 or 40 iterations
    assert time_expected(case, tmp_path) == (
        "time: about 6.1 min with 16 iterations, within which most searches end (docs/right_law.md), at most 13 min "
        "with 40 (a run takes 16 s, an iteration 16 s)"
    )
    (tmp_path / "mine/benchmarks").mkdir()
    for stage in ("train", "propose", "verify"):
        (tmp_path / f"mine/benchmarks/{stage}_0.tsv").write_text("s\th:m:s\n11\t0:00:11\n")
    said = time_expected(case, tmp_path)
    assert "about 11 min with 16 iterations" in said
    assert said.endswith("at most 24 min with 40 (a run takes 16 s, an iteration 33 s)")
