"""An image that is registered twice: its run, the loop in one process, and one registration afterwards."""

from __future__ import annotations

import numpy as np
import pandas as pd
from workflow_project import COLUMNS, ROWS, write_raster

from radcal.calibration.history import read_runs
from radcal.calibration.loop import calibrate, register_rounds
from radcal.config import load
from radcal.measurement.model import read_measurement
from radcal.measurement.registration import read_registered
from radcal.measurement.target import read_targets
from radcal.radar.geometry import read_geometry
from radcal.scene.model import read_scene
from radcal.simulators.sources import make_runner
from radcal.storage.dataclass_groups import same
from radcal.storage.records import read_json
from radcal.storage.run_index import read_index

MOVED = {"parameters": {"field": [6.1, 14.2, 21.5, 3.3]}, "seed": 1, "warp_px": 1}
# the start is nearly the lake's law, so that the reference run shows little of the field
FIELD = {"calibrate": True, "law": "mangia", "bounds": [[0, 15], [5, 25], [10, 35], [0, 10]], "start": [2, 5, 10, 9]}
CASE = {
    "materials": {"field": FIELD, "lake": {"law": "mangia", "parameters": [5, 5, 5, 5]}},
    "objective": "classes",
    "simulator": {"draws": 2},
    "measurement": {"source": "synthetic", "synthetic": MOVED},
    "registration": {"method": "gefolki"},
    "design": {"size": 1},
    "stop": {"max_runs": 6},
}


def test_the_image_is_registered_again_onto_a_run_of_the_laws_found(project, monkeypatch, tmp_path):
    rng, labels = np.random.default_rng(3), np.ones((ROWS, COLUMNS), dtype=np.uint8)
    for top, left, high, wide in rng.integers([0, 0, 8, 8], [ROWS, COLUMNS, 30, 30], (12, 4)):
        labels[top : top + high, left : left + wide] = 2
    write_raster(project.folder / "labels.tif", labels)
    project.write(**CASE)
    done = project.run("--configfile", "tiny.yaml", "--dry-run")
    most = "at most 11 simulator runs would be made (1 measurement, 2 reference (1 of them for the registration), "
    assert most in done.stdout
    assert "1 design, at most 5 infill, at most 2 final" in done.stdout
    done = project.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    out, summary = project.out(), project.summary()
    assert summary["runs"]["reference"] == 2
    assert summary["runs"]["total"] == sum(summary["runs"][kind] for kind in ("reference", "design", "infill", "final"))
    table = pd.read_csv(out / "runs.csv")
    assert table["kind"].tolist()[:3] == ["reference", "registration", "design"]
    (run,) = read_index(out / "registration_run.json")
    laws = read_json(out / "laws_of_image.json")
    assert run.key == table["key"][1]
    assert len(run.draws) == 1
    assert run.parameters["field"] == laws["field"] == table[["X1", "X2", "X3", "X4"]].to_numpy()[1].tolist()
    assert "second registration" in summary["registration"]["verdict"]
    first, registered = (read_registered(out / name) for name in ("first/registered.h5", "registered.h5"))
    assert registered.correlation.mean() > first.correlation.mean()
    assert "second" not in first.verdict

    # the same in one process
    monkeypatch.chdir(project.folder)
    case, geometry, scene = load(["tiny.yaml"]), read_geometry(out / "geometry.h5"), read_scene(out / "scene.h5")
    runner = make_runner(case, out / "scene.h5", out / "geometry.h5", tmp_path / "runs")
    again, made = register_rounds(case, runner, geometry, read_measurement(out / "measurement.h5"), scene)
    assert same(again, registered)
    history, _ = calibrate(case, runner, read_targets(out / "target.h5"), registration=made)
    theirs = read_runs(
        [out / "scores.json", *(out / f"iterations/{k}/verified.json" for k in range(len(history.infill)))]
    )
    assert [(run.kind, run.key) for run in history.runs] == [(run.kind, run.key) for run in theirs.runs]
    for ours, others in zip(history.runs, theirs.runs, strict=True):
        np.testing.assert_array_equal(ours.scores["field"].statistics, others.scores["field"].statistics)

    # one registration: the run is not used, and nothing is made anew for it
    records = project.records()
    project.write(**{**CASE, "registration": {"method": "gefolki", "rounds": 1}})
    done = project.run("design", "--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    assert project.records() == records
    once = read_registered(out / "registered.h5")
    assert same(once, first)
    assert [run.kind for run in read_runs([out / "scores.json"]).runs] == ["reference", "design"]
