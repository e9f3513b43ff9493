"""An image that is registered twice: its run, and one registration afterwards."""

import numpy as np
import pandas as pd
import yaml
from rasterio.transform import from_origin
from workflow_project import COLUMNS, ROWS, write_raster

from radcal.calibration.loop import register_rounds
from radcal.config import load
from radcal.image.model import Measurement
from radcal.objectives.history import read_runs
from radcal.radar.geometry import read_geometry
from radcal.radar.projection import make_geometry
from radcal.registration.displacement import warp
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import make_runners
from radcal.storage.dataclass_groups import same
from radcal.storage.records import read_json
from radcal.storage.runs import read_index

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
    again, _ = register_rounds(case, runners, geometry, Measurement.read(out / "passes/1/measurement.h5"), scene)
    assert same(again, registered)

    # one registration: the run is not used, and nothing is made anew for it
    records = project.records()
    project.write(**{**CASE, "registration": {"method": "gefolki", "rounds": 1}})
    project.ended("design", "--configfile", "tiny.yaml")
    assert project.records() == records
    once = Registered.read(out / "passes/1/registered.h5")
    assert same(once, first)
    assert [run.kind for run in read_runs([out / "scores.json"]).runs] == ["reference", "design"]


def test_a_warning_on_the_geometry_is_said_before_the_design(project, monkeypatch):
    """An image that lies as if it was flown at 47 degrees of depression, where the case says 45."""
    monkeypatch.chdir(project.folder)
    rng, cover = np.random.default_rng(8), np.full((150, 150), 40, dtype=np.uint8)
    for top, left, high, wide in rng.integers([0, 0, 12, 12], [150, 150, 40, 40], (40, 4)):
        cover[top : top + high, left : left + wide] = 10
    for name, values in (("dem.tif", np.full(cover.shape, 90.0, dtype=np.float32)), ("cover.tif", cover)):
        write_raster(name, values, crs="EPSG:32631", transform=from_origin(6e5, 5.8e6, 20.0, 20.0))
    fixed = {"law": "constant_gamma", "parameters": [-8.0]}
    case = {
        "scene": {
            "source": "raster", "elevation": "dem.tif", "materials": "cover.tif", "landcover": "esa_worldcover",
            "vertical_datum": "EGM2008",
        },
        "radar": {
            "altitude_m": 400_000, "depression_deg": 45, "range_resolution_m": 20, "azimuth_resolution_m": 28,
            "range_spacing_m": 10, "azimuth_spacing_m": 20, "looks": 8, "nesz_db": -40, "heading_deg": 0,
        },
        "materials": {
            "cropland": {"calibrate": True, "law": "constant_gamma", "bounds": [[-25, -5]], "start": [-14]},
            "tree_cover": fixed,
        },
        "measurement": {"source": "file", "path": "image.npy", "scale": "db", "radiometry": "sigma0_ref"},
        "registration": {"method": "gefolki", "rounds": 1},
        "design": {"size": 2},
    }  # fmt: skip
    np.save("image.npy", np.zeros((1, 1), dtype=np.float32))
    (project.folder / "tiny.yaml").write_text(yaml.safe_dump({"case": "tiny", "objective": "density", **case}))
    ours = load(["tiny.yaml"])
    scene = make_scene(ours.scene, list(ours.materials), 0.0)
    geometry = make_geometry(scene, ours.radar)
    image = BuiltinSimulator(geometry, ours.radar, ours.laws).run({"cropland": [-15.0], "tree_cover": [-8.0]}, 5)
    field = np.zeros((2, *image.shape))
    field[0] = (np.cos(np.radians(47.0)) / np.cos(np.radians(45.0)) - 1.0) * (
        np.arange(image.shape[0]) - image.shape[0] / 2
    )[:, None]
    np.save("image.npy", warp(image, -field))
    lines = project.ended("design", "--configfile", "tiny.yaml").splitlines()
    (told,) = (k for k, line in enumerate(lines) if "is displaced along slant range by -" in line)
    (target,) = (k for k, line in enumerate(lines) if "target of cropland" in line)
    assert "warning: image.npy is displaced" in lines[told]
    assert told < target < next(k for k, line in enumerate(lines) if "design" in line and k > told)
