"""Largest number of runs, and words on the time that is left."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from radcal.config import case_from
from radcal.forecast.time_left import (
    at_most,
    duration,
    iteration_seconds,
    largest_runs,
    most_need,
    stored_iteration_seconds,
)
from radcal.session.jobs import STARTED

WHOLE = ", with training and proposal"
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


def test_what_may_still_come_is_said_once_a_time_is_known() -> None:
    both = (
        "; about 7.2 min each: most laws of docs/right_law.md took at most 7 more (50 min), stop.max_runs allows at "
        "most 30 more (3.6 h"
    )
    assert at_most(30, 430.0, 7) == f"{both})".replace(" each", f" each{WHOLE}")
    assert at_most(30, 430.0, 7, " of simulation") == f"{both} of simulation)"
    # a search that took longer than others, and one that is allowed no more than others take
    for usual in (0, -4, 30, 33):
        assert at_most(30, 430.0, usual) == f"; about 7.2 min each{WHOLE}: stop.max_runs allows at most 30 more (3.6 h)"
    # the first run of 11 s is compiled, later ones take 0.6 s, and an iteration takes 16 s: only that is told
    assert at_most(202, 11.0, 20, " of simulation") == at_most(201, 29.0, 19, " of simulation") == ""
    laws = "most laws of docs/right_law.md took at most"
    assert at_most(201, 31.0, 19, " of simulation").startswith(f"; about 31 s each: {laws} 19 more (9.")
    assert at_most(197, 16.0, 15).startswith(f"; about 16 s each{WHOLE}: {laws} 15 more (4 min)")
    assert at_most(0, 430.0, 7) == at_most(30, None, 7) == at_most(29, 2.0, 7) == ""


def test_what_most_searches_need_is_bounded_by_the_limit() -> None:
    assert most_need(2, 200) == 18
    assert most_need(800, 1000) == 816
    assert most_need(2, 12) == 12


def test_an_iterations_time_is_measured_in_this_command_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = []
    # a design of an earlier command, an iteration after a night, and then iterations of 30, 80 and 50 s
    for number, ended in enumerate((1000, 50_000, 50_030, 50_110)):
        files.append(tmp_path / str(number))
        files[-1].touch()
        os.utime(files[-1], (ended, ended))
    monkeypatch.setenv(STARTED, "49_960")
    assert iteration_seconds(files, now=50_160.0) == 50.0
    assert iteration_seconds(files[:1], now=50_000.0) is None
    # of seven iterations the last five: 50, 70, 90, 110 and 130 s
    for number, ended in enumerate((50_160, 50_230, 50_320, 50_430), start=4):
        files.append(tmp_path / str(number))
        files[-1].touch()
        os.utime(files[-1], (ended, ended))
    assert iteration_seconds(files, now=50_560.0) == 90.0
    monkeypatch.delenv(STARTED)
    assert iteration_seconds(files, now=50_160.0) is None


def test_time_of_stored_iterations(tmp_path: Path) -> None:
    assert stored_iteration_seconds(tmp_path / "gone") is None
    for number, seconds in enumerate((12.0, 3.0, 5.0)):
        for stage in ("train", "propose", "verify"):
            (tmp_path / f"{stage}_{number}.tsv").write_text(f"s\th:m:s\n{seconds}\t0:00:12\n")
    (tmp_path / "verify_3.tsv").write_text("s\th:m:s\n900\t0:15:00\n")  # its training has left no file
    assert stored_iteration_seconds(tmp_path) == 15.0
    (tmp_path / "train_2.tsv").write_text("s\n")
    assert stored_iteration_seconds(tmp_path) == 22.5
