"""A small calibration through Snakemake, from the configuration to the report: its end and its contracts."""

import json
import math
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import yaml
from commands import typed

import radcal
from radcal.calibration.loop import calibrate
from radcal.config import load, load_forward
from radcal.figures.drawing import STYLE
from radcal.products.showing import show
from radcal.products.simulated import forward
from radcal.seeds import noise_seed
from radcal.simulators.runner import make_runners
from radcal.targets.target import Targets


def test_ends_within_the_tolerance_and_keeps_its_contracts(finished):
    summary = finished.summary()
    assert summary["case"] == "tiny"
    assert summary["converged"] is True
    assert summary["stop_reason"] == "rms"
    runs = summary["runs"]
    assert runs["total"] == sum(runs[key] for key in ("reference", "design", "infill", "final"))
    assert (runs["reference"], runs["design"], runs["final"]) == (1, 12, 1)
    assert len(finished.records()) == runs["total"]
    field = summary["materials"]["field"]
    assert set(summary["materials"]) == {"field"}
    assert 0 <= field["rms"] <= 1e-3 < field["rms_start"]
    assert field["mse"] == field["rms"] ** 2
    assert field["runs_to_tolerance"] == runs["design"] + runs["infill"]
    assert set(field["target"]) == set(field["calibrated"]) == {"xi", "omega", "alpha"}
    assert all(0 <= x <= 50 for x in field["parameters"].values())
    assert {"design", "train", "propose", "verify", "archive"} <= summary["wall_seconds"].keys()
    json.dumps(summary, allow_nan=False)
    assert math.isfinite(field["law_difference_db"])
    assert not [path for path in finished.out().rglob("*") if "partial" in path.name or "tmp" in path.name]


def test_pictures_and_page_are_there(finished):
    # Type 42, whose text can be edited; tests draw with another
    assert STYLE["pdf.fonttype"] == 42
    figures = finished.out() / "figures"
    for stem in ("histogram_field", "densities_field", "cost_field", "law_field"):
        for suffix in (".png", ".pdf"):
            assert (figures / (stem + suffix)).stat().st_size > 1000
    page = (finished.out() / "report.html").read_text()
    assert "data:image/webp;base64," in page
    assert 'src="http' not in page


def test_the_loop_in_one_process_gives_the_same_runs(finished, tmp_path, monkeypatch):
    monkeypatch.chdir(finished.folder)
    case = load(["tiny.yaml"])
    geometry = finished.out() / "passes/1/geometry.h5"
    runners = make_runners(case, finished.out() / "scene.h5", [geometry], tmp_path / "runs")
    history, decision = calibrate(case, runners, [Targets.read(finished.out() / "passes/1/target.h5")])
    assert decision.converged
    assert [run.index for run in history.infill] == list(range(len(history.infill)))
    with h5py.File(finished.out() / "calibration.h5") as file:
        assert [run.keys[0] for run in history.runs] == list(file["passes/1/keys"].asstr()[()])
        np.testing.assert_array_equal(
            [run.scores["field"].rms for run in history.runs], file["materials/field/rms"][()]
        )


def test_exported_materials_in_another_case_give_the_calibrated_image_again(finished, tmp_path, monkeypatch):
    monkeypatch.chdir(finished.folder)
    own = yaml.safe_load(Path("tiny.yaml").read_text())
    lake = {"calibrate": True, "bounds": [[0, 50]] * 4, "start": own["materials"]["lake"]["parameters"]}
    export = finished.out() / "export/calibrated.yaml"
    other = {**own, "case": "other", "measurement": {}, "materials_from": str(export), "materials": {"lake": lake}}
    Path("other.yaml").write_text(yaml.safe_dump(other))
    case = load(["other.yaml"])
    assert (list(case.materials), case.calibrated) == (["field", "lake"], ["lake"])
    geometry = finished.out() / "passes/1/geometry.h5"
    runners = make_runners(case, finished.out() / "scene.h5", [geometry], tmp_path / "runs")
    parameters = {name: material.start_parameters for name, material in case.materials.items()}
    image = runners[0].run(parameters, noise_seed(case, fresh=True), image=True).image_db
    np.testing.assert_array_equal(radcal.open(finished.out()).array("calibrated"), image)
    # without a measurement, and with nothing to calibrate
    del other["materials"], other["measurement"]
    kept = {key: other[key] for key in ("seed", "scene", "radar", "materials_from") if key in other}
    Path("forward.yaml").write_text(yaml.safe_dump(kept))
    _, (alone,) = forward(load_forward(["forward.yaml"]), tmp_path / "simulated", tmp_path / "own runs")
    np.testing.assert_array_equal(alone.image_db, image)
    assert not alone.kept
    _, (again,) = forward(load_forward(["forward.yaml"]), tmp_path / "simulated", tmp_path / "own runs")
    assert (again.kept, again.key) == (True, alone.key)
    assert show(finished.out())[0] == finished.summary()["verdict"]


def test_laws_on_another_image_of_the_same_scene(finished, monkeypatch):
    monkeypatch.chdir(finished.folder)
    own = yaml.safe_load(Path("tiny.yaml").read_text())
    hidden = {"parameters": {"field": [6.1, 14.2, 21.5, 3.3]}, "seed": 8, "warp_px": 0}
    image = {"source": "synthetic", "synthetic": hidden}
    radar = [{**own["radar"], "looks": 4}, {**own["radar"], "look_side": "left"}]
    other = {**own, "case": "other", "radar": radar, "measurement": [image, image]}
    Path("other.yaml").write_text(yaml.safe_dump(other))
    said = typed("apply", "tiny", "--to", "other.yaml").output
    assert "Each prediction is the average of that by the law and that by a constant sigma0." in said
    table = pd.read_csv("results/other/applied_tiny/predictions.csv")
    assert set(table["pass"]) == {1, 2}
    # the simulated measurement has the law that the calibration has matched in its distribution only
    assert table["inside"].mean() > 0.5
    runs = sorted(path.name for path in Path("results/other/runs").glob("[!.]*.h5"))
    assert len(runs) == 2
    # without a measured image, and again without a run
    del other["measurement"]
    Path("other.yaml").write_text(yaml.safe_dump(other))
    typed("apply", "results/tiny", "--to", "other.yaml", "--out", "elsewhere")
    np.testing.assert_array_equal(pd.read_csv("elsewhere/predictions.csv")["p95_db"], table["p95_db"])
    assert sorted(path.name for path in Path("results/other/runs").glob("[!.]*.h5")) == runs


def test_commands_without_snakemake_refuse_in_a_sentence(finished, monkeypatch):
    monkeypatch.chdir(finished.folder)
    Path("wrong.yaml").write_text("sede: 3\n")
    for words, said in (
        (["advise", "tiny"], "the scene is in slant range, whose incidence is the same in every pass"),
        (["apply", "tiny", "--to", "wrong.yaml"], "wrong.yaml, line 1: unknown key sede"),
        (["simulate", "tiny.yaml", "--materials", "gone.yaml"], "--materials: the file gone.yaml does not exist"),
    ):
        refused = typed(*words, code=1).stderr
        assert said in refused
        assert refused.count("\n") == 1
