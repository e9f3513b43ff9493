"""Largest number of runs that planned jobs make, without those that the run store has."""

from __future__ import annotations

from pathlib import Path

import pytest

from radcal.config import stages
from radcal.forecast.planned_runs import planned_runs
from radcal.forecast.runs_and_time import runs_sentence
from radcal.objectives.history import Run, write_runs
from radcal.proposals.design import design_points
from radcal.scene.model import write_scene
from radcal.seeds import noise_seed
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

START = [("scene", {}), ("geometry", {"p": "1"}), ("measurement", {"p": "1"}), ("reference_run", {"p": "1"})]
CHUNKS = [("design_chunk", {"chunk": str(k)}) for k in range(3)]
LOOP = [("scores", {}), ("final_runs", {}), ("archive", {})]


@pytest.fixture
def case(build_case):
    return build_case(design={"size": 10, "chunk": 4}, stop={"max_runs": 30})


def test_a_new_case_may_take_all_its_runs(case, tmp_path: Path) -> None:
    counts = planned_runs(case, [*START, *CHUNKS, *LOOP], tmp_path)
    assert counts == {"measurement": 1, "reference": 1, "design": 10, "infill": 20, "final": 2}
    assert runs_sentence(counts) == (
        "at most 34 simulator runs would be made (1 measurement, 1 reference, 10 design, at most 20 infill, at "
        "most 2 final); a search that meets its stop criterion ends earlier, and repeats no stored run."
    )
    assert "2 reference (1 of them for the registration)" in runs_sentence({"reference": 2}, registration=1)
    counts = planned_runs(case, [*START, CHUNKS[2]], tmp_path)
    assert counts == {"measurement": 1, "reference": 1, "design": 2, "infill": 0, "final": 0}
    assert "(1 measurement, 1 reference, 2 design, each of 4 speckle draws); stored" in runs_sentence(counts, 4)
    twice = [("registration_run", {"p": "1"}), ("registration_run", {"p": "2"})]
    assert planned_runs(case, [*START, *twice], tmp_path)["reference"] == 2, "the case has no second pass"
    assert runs_sentence(planned_runs(case, [("report", {})], tmp_path)) == "no simulator run would be made."


def test_stored_runs_are_left_out(case, scene, geometry, tmp_path: Path) -> None:
    write_scene(tmp_path / "scene.h5", scene)
    stage = stages.DesignChunk.of(case)
    simulator = BuiltinSimulator(geometry, case.radar, case.laws)
    runner = Runner(RunStore(tmp_path / "runs"), simulator, geometry, scene.identity, stage)
    for point in design_points(stage, 10)[3:6]:
        runner.run(point, noise_seed(stage))
    assert planned_runs(case, CHUNKS, tmp_path)["design"] == 7
    assert planned_runs(case, CHUNKS[:1], tmp_path)["design"] == 3
    assert planned_runs(case, [START[3]], tmp_path)["reference"] == 1
    runner.run(case.start_parameters, noise_seed(stage))
    assert planned_runs(case, [START[3]], tmp_path)["reference"] == 0
    # the scene may become another one
    assert planned_runs(case, [*START, *CHUNKS], tmp_path)["design"] == 10
    # beside a finished calibration it may not, until that is allowed
    (tmp_path / "calibration.h5").touch()
    counts = planned_runs(case, [*START, *CHUNKS], tmp_path)
    assert (counts["reference"], counts["design"]) == (0, 7)
    assert planned_runs(case.model_copy(update={"replace": True}), [*START, *CHUNKS], tmp_path)["design"] == 10
    assert planned_runs(case, [*START, ("simulator", {"p": "1"}), *CHUNKS], tmp_path)["design"] == 10


def test_finished_iterations_are_left_out(case, tmp_path: Path) -> None:
    made = [Run(kind, 0, ["0" * 20], 0.5, {}) for kind in ["reference", *["design"] * 10]]
    write_runs(tmp_path / "scores.json", made)
    planned = [("train", {"k": "6"}), ("propose", {"k": "6"}), ("verify", {"k": "6"}), *LOOP[1:]]
    assert planned_runs(case, planned, tmp_path) == {
        "measurement": 0, "reference": 0, "design": 0, "infill": 14, "final": 2,
    }  # fmt: skip
    # the search has ended, and the last runs are made again
    assert planned_runs(case, LOOP[1:], tmp_path)["infill"] == 0


def test_every_pass_counts(build_case, tmp_path: Path) -> None:
    file = {"source": "file", "path": "a.npy", "scale": "db", "radiometry": "sigma0_local"}
    radar = {"altitude_m": 1000.0, "radiometry": "sigma0_local"}
    case = build_case(
        radar=[radar, {**radar, "depression_deg": 50}], measurement=[file, file], design={"size": 6, "chunk": 4},
        stop={"max_runs": 20},
    )  # fmt: skip
    second = [(rule, {"p": "2"}) for rule, _ in START[1:]]
    second += [("design_chunk", {"chunk": chunk}) for chunk in "23"]
    counts = planned_runs(case, [*START, *CHUNKS[:2], *second, *LOOP], tmp_path)
    assert counts == {"measurement": 0, "reference": 2, "design": 12, "infill": 28, "final": 4}
    assert planned_runs(case, second, tmp_path)["design"] == 6
