"""Largest number of runs, and their time."""

import pytest
from config_samples import COMMAND, measured

from radcal.config import case_from
from radcal.forecast.runs_and_time import (
    duration,
    largest_runs,
    planned_runs,
    runs_sentence,
    standing,
    stored_iteration_seconds,
)
from radcal.storage.records import write_hdf5


def test_the_largest_number_of_runs_is_that_of_all_passes(build_case):
    case = build_case(design={"size": 5}, stop={"max_runs": 40})
    assert largest_runs(case) == {"reference": 1, "registration": 1, "design": 5, "infill": 35, "final": 2}
    case = build_case(design={"size": 5}, stop={"max_runs": 40}, registration={"rounds": 1})
    assert largest_runs(case) == {"reference": 1, "registration": 0, "design": 5, "infill": 35, "final": 2}
    external = build_case(design={"size": 5}, stop={"max_runs": 40}, simulator=COMMAND)
    assert largest_runs(external)["reference"] == 2, "repeated, to find out whether it can be"
    declared = build_case(simulator={**COMMAND, "deterministic": True})
    assert largest_runs(declared)["reference"] == 1
    passes = {"radar": [{}, {"depression_deg": 50}], "measurement": [measured()["measurement"]] * 2}
    one = {"materials": {"field": {"calibrate": True}}, "design": {"size": 5}, "stop": {"max_runs": 40}}
    counts = largest_runs(case_from({**one, **passes}))
    assert counts == {"reference": 2, "registration": 2, "design": 10, "infill": 70, "final": 4}


START = [("scene", {}), ("geometry", {"p": "1"}), ("measurement", {"p": "1"}), ("reference_run", {"p": "1"})]
CHUNKS = [("design_chunk", {"chunk": str(k)}) for k in range(3)]
LOOP = [("scores", {}), ("final_runs", {}), ("archive", {})]


def test_planned_jobs_make_at_most_so_many_runs(build_case):
    case = build_case(design={"size": 10, "chunk": 4}, stop={"max_runs": 30})
    counts = planned_runs(case, [*START, *CHUNKS, *LOOP])
    assert counts == {"measurement": 1, "reference": 1, "registration": 0, "design": 10, "infill": 20, "final": 2}
    assert runs_sentence(counts) == (
        "at most 34 simulator runs would be made (1 measurement, 1 reference, 10 design, at most 20 infill, at "
        "most 2 final); a search that meets its stop criterion ends earlier, and no stored run is repeated."
    )
    counts = planned_runs(case, [*START, ("registration_run", {"p": "1"}), CHUNKS[2]])
    assert counts == {"measurement": 1, "reference": 1, "registration": 1, "design": 2, "infill": 0, "final": 0}
    assert "1 reference, 1 registration, 2 design; runs of the search have 4 sp" in runs_sentence(counts, 4)
    assert runs_sentence(planned_runs(case, [("report", {})])) == "no simulator run would be made."
    # six iterations are done; then the search has ended, and the last runs are made again
    planned = [("train", {"k": "6"}), ("propose", {"k": "6"}), ("verify", {"k": "6"}), *LOOP[1:]]
    assert [planned_runs(case, jobs)["infill"] for jobs in (planned, LOOP[1:])] == [14, 0]


def test_planned_jobs_of_every_pass_count(build_case):
    passes = {"radar": [{}, {"depression_deg": 50}], "measurement": [measured()["measurement"]] * 2}
    case = build_case(**passes, design={"size": 6, "chunk": 4}, stop={"max_runs": 20})
    second = [(rule, {"p": "2"}) for rule, _ in START[1:]]
    second += [("design_chunk", {"chunk": chunk}) for chunk in "23"]
    counts = planned_runs(case, [*START, *CHUNKS[:2], *second, *LOOP])
    assert counts == {"measurement": 0, "reference": 2, "registration": 0, "design": 12, "infill": 28, "final": 4}
    assert planned_runs(case, second)["design"] == 6


def test_durations_are_said_in_a_fitting_unit():
    said = {0.42: "0.42 s", 89: "89 s", 91: "1.5 min", 420: "7 min", 5500: "1.5 h", 4e5: "4.6 days"}
    assert {seconds: duration(seconds) for seconds in said} == said


def test_time_of_stored_iterations(tmp_path):
    assert stored_iteration_seconds(tmp_path / "gone") is None
    for number, seconds in enumerate((12.0, 3.0, 5.0)):
        for stage in ("train", "propose", "verify"):
            (tmp_path / f"{stage}_{number}.tsv").write_text(f"s\th:m:s\n{seconds}\t0:00:12\n")
    (tmp_path / "verify_3.tsv").write_text("s\th:m:s\n900\t0:15:00\n")  # its training has left no file
    assert stored_iteration_seconds(tmp_path) == 15.0
    (tmp_path / "train_2.tsv").write_text("s\n")
    assert stored_iteration_seconds(tmp_path) == 22.5


def test_the_standing_follows_from_the_files_of_the_case(build_case, tmp_path):
    """Of a case with 2 reference runs, 5 of the design, 2 final ones, and half of all searches ending within 6."""
    case = build_case(design={"size": 5}, stop={"max_runs": 40})

    def runs(count, seconds):
        for k in range(count):
            with write_hdf5(tmp_path / f"runs/{k}.h5", "run") as file:
                file.attrs["seconds"] = seconds

    def iteration(k):
        path = tmp_path / f"iterations/{k}/verified.json"
        path.parent.mkdir(parents=True)
        path.touch()

    assert str(standing(case, tmp_path / "gone")) == "0 of about 15 runs"
    runs(3, 2.0)
    assert str(standing(case, tmp_path)) == "3 of about 15 runs"  # the rest of an iteration may take longer than a run
    # four draws of the reference run, and one of its repetition
    four = build_case(design={"size": 5}, stop={"max_runs": 40}, simulator={"draws": 4})
    runs(5, 2.0)
    assert str(standing(four, tmp_path)) == "2 of about 15 runs"
    (tmp_path / "runs/4.h5").unlink()
    (tmp_path / "runs/3.h5").unlink()
    runs(3, 100.0)
    # 4 runs, 6 iterations of one run and 2 final runs
    assert (standing(case, tmp_path).expected, standing(case, tmp_path).left_s) == (15, 1200.0)
    # of four draws, 1 run is done; 6 more, and those of 6 iterations, have all draws, the 2 final runs one each
    assert standing(four, tmp_path).left_s == pytest.approx((6 + 6 + 2 / 4) * 400.0)
    runs(9, 100.0)
    for k in range(2):
        iteration(k)
    (tmp_path / "benchmarks").mkdir()
    for stage, seconds in (("train", 10), ("propose", 20), ("verify", 110)):
        (tmp_path / f"benchmarks/{stage}_0.tsv").write_text(f"s\n{seconds}\n")
    found = standing(case, tmp_path)
    assert (found.done, found.expected, found.left_s) == (9, 15, 4 * 140.0 + 2 * 100.0)
    assert str(found) == "9 of about 15 runs, about 13 min to the end of the search"
    # a search that takes longer than most, up to its last run; and one whose earlier settings left more runs
    for k in range(2, 35):
        iteration(k)
    assert standing(case, tmp_path).expected == 44
    runs(60, 100.0)
    assert (standing(case, tmp_path).expected, standing(case, tmp_path).left_s) == (60, 200.0)
    (tmp_path / "final.json").touch()
    assert str(standing(case, tmp_path)) == "60 runs, the search has ended"
