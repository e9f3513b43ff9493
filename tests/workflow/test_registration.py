"""An image that is registered twice: its run, and one registration afterwards."""

import numpy as np
import pandas as pd
from workflow_project import COLUMNS, ROWS, write_raster

from radcal.calibration.loop import calibrate, register_rounds
from radcal.config import load
from radcal.image.model import Measurement
from radcal.objectives.history import read_runs
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.simulators.runner import make_runners
from radcal.storage.dataclass_groups import same
from radcal.storage.records import read_json
from radcal.storage.runs import read_index
from radcal.targets.target import Targets

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
    project.ended("--configfile", "tiny.yaml")
    out, summary = project.out(), project.summary()
    assert summary["runs"]["reference"] == 2
    assert summary["runs"]["total"] == sum(summary["runs"][kind] for kind in ("reference", "design", "infill", "final"))
    table = pd.read_csv(out / "runs.csv")
    assert table["kind"].tolist()[:3] == ["reference", "registration", "design"]
    (run,) = read_index(out / "passes/1/registration_run.json")
    laws = read_json(out / "laws_of_image.json")
    assert run.key == table["key"][1]
    assert len(run.draws) == 1
    assert run.parameters["field"] == laws["field"] == table[["X1", "X2", "X3", "X4"]].to_numpy()[1].tolist()
    assert "second registration" in summary["registration"]["verdict"]
    first, registered = (Registered.read(out / f"passes/1/{name}registered.h5") for name in ("first/", ""))
    assert registered.correlation > first.correlation
    assert "second" not in first.verdict

    # the same registration in one process
    monkeypatch.chdir(project.folder)
    case, scene = load(["tiny.yaml"]), Scene.read(out / "scene.h5")
    geometry = read_geometry(out / "passes/1/geometry.h5")
    runners = make_runners(case, out / "scene.h5", [out / "passes/1/geometry.h5"], tmp_path / "runs")
    again, made = register_rounds(case, runners, geometry, Measurement.read(out / "passes/1/measurement.h5"), scene)
    assert same(again, registered)
    history, _ = calibrate(case, runners, [Targets.read(out / "passes/1/target.h5")], registration=made)
    assert (history.runs[1].kind, history.runs[1].keys[0]) == ("registration", run.key)

    # one registration: the run is not used, and nothing is made anew for it
    records = project.records()
    project.write(**{**CASE, "registration": {"method": "gefolki", "rounds": 1}})
    project.ended("design", "--configfile", "tiny.yaml")
    assert project.records() == records
    once = Registered.read(out / "passes/1/registered.h5")
    assert same(once, first)
    assert [run.kind for run in read_runs([out / "scores.json"]).runs] == ["reference", "design"]
