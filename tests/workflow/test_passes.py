"""A pass that is added to a case, a kill in between, and the report of both."""

import json

import numpy as np
import yaml
from workflow_project import tiny_case

import radcal
from radcal.calibration.loop import calibrate
from radcal.config import load
from radcal.objectives.history import read_runs
from radcal.simulators.runner import make_runners
from radcal.targets.target import Targets

TRUTH = {"parameters": {"field": [6.1, 14.2, 21.5, 3.3]}, "warp_px": 0}
ONE = {
    "objective": "classes",
    "simulator": {"kind": "builtin", "draws": 1},
    "design": {"size": 2, "chunk": 1},
    "stop": {"max_runs": 8},
    "radar": {"looks": 4, "nesz_db": -40},
    "measurement": {"source": "synthetic", "synthetic": {**TRUTH, "seed": 1}},
}
LATER = {"looks": 3, "nesz_db": -30, "look_side": "left"}


def test_a_pass_added_later_reuses_all_runs_and_a_kill_loses_none(project, monkeypatch, tmp_path):
    project.write(**ONE)
    project.ended("design", "--configfile", "tiny.yaml")
    first, files = project.records(), project.listing()
    assert len(first) == 3

    config = json.loads(json.dumps(ONE))
    second = {"source": "synthetic", "synthetic": {**TRUTH, "seed": 9}}
    config |= {"radar": [ONE["radar"], LATER], "measurement": [ONE["measurement"], second]}
    case = {**tiny_case(**{key: config[key] for key in ("objective", "simulator", "design", "stop")}), **config}
    (project.folder / "tiny.yaml").write_text(yaml.safe_dump(case))
    project.killed_when(lambda: len(project.records()) >= 5, "--configfile", "tiny.yaml")
    killed = project.records()

    project.ended("--configfile", "tiny.yaml")
    assert "pass 2: target of field: " in (project.out() / "logs/passes/2/target.log").read_text()
    records, summary = project.records(), project.summary()
    assert {name: records[name] for name in killed} == killed
    assert {name: records[name] for name in first} == first
    # nothing of the first pass alone was made again
    same = {"scene.h5", "design/0.json", *(name for name in files if name.startswith("passes/1/"))}
    now = project.listing()
    assert {name: now[name] for name in same} == {name: files[name] for name in same}
    runs = summary["runs"]
    assert (runs["reference"], runs["design"], runs["infill"] % 2, runs["final"]) == (2, 4, 0, 2)
    assert len(records) == runs["total"] == sum(one["runs"] for one in summary["passes"])
    assert [one["look_side"] for one in summary["passes"]] == ["right", "left"]
    for one in summary["passes"]:
        law = one["materials"]["field"]
        assert 0.0 < law["half_width_db"] < 10.0
        assert law["difference_db"] < 2.5 * law["half_width_db"]
    assert "For each pass and material, the table gives" in (project.out() / "report.html").read_text()
    assert (project.out() / "figures/front_field.png").exists()
    exported = radcal.open(project.out())
    assert {"calibrated_pass2", "difference_pass2", "incidence_pass2", "mask_pass2"} <= set(exported.images)
    measured = exported.array("calibrated_pass2") - exported.array("difference_pass2")
    np.testing.assert_allclose(measured, exported.array("measured_pass2"), atol=1e-4)

    # the loop in one process makes the same runs
    monkeypatch.chdir(project.folder)
    out = project.out()
    case = load(["tiny.yaml"])
    geometries = [out / "passes/1/geometry.h5", out / "passes/2/geometry.h5"]
    targets = [Targets.read(path) for path in (out / "passes/1/target.h5", out / "passes/2/target.h5")]
    runners = make_runners(case, out / "scene.h5", geometries, tmp_path / "runs")
    history, decision = calibrate(case, runners, targets)
    assert decision.ended
    iterations = range(len(history.infill))
    theirs = read_runs([out / "scores.json", *(out / f"iterations/{k}/verified.json" for k in iterations)])
    assert [run.keys for run in history.runs] == [run.keys for run in theirs.runs]
    for ours, others in zip(history.runs, theirs.runs, strict=True):
        np.testing.assert_array_equal(ours.scores["field"].statistics, others.scores["field"].statistics)

    done = project.run("--configfile", "tiny.yaml")
    assert "Nothing to be done" in done.stdout
    assert project.records() == records
