"""A small calibration through Snakemake, from the configuration to the report: its end and its contracts."""

from __future__ import annotations

import json
import math
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import yaml

import radcal
from radcal.calibration.loop import calibrate
from radcal.config import load, load_forward
from radcal.measurement.target import read_targets
from radcal.report.showing import show
from radcal.report.simulated import forward
from radcal.seeds import noise_seed
from radcal.simulators.sources import make_runner


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
    assert {"design", "train", "propose", "verify", "report"} <= summary["wall_seconds"].keys()
    json.dumps(summary, allow_nan=False)
    assert math.isfinite(field["law_difference_db"])
    assert not [path for path in finished.out().rglob("*") if "partial" in path.name or "tmp" in path.name]


def test_archive_and_table_hold_every_run(finished):
    table = pd.read_csv(finished.out() / "runs.csv")
    with h5py.File(finished.out() / "calibration.h5") as file:
        group = file["materials/field"]
        assert list(file["runs/kind"].asstr()[()]) == table["kind"].tolist()
        np.testing.assert_array_equal(group["rms"][()], table["rms"])
        np.testing.assert_array_equal(group["parameters"][()], table[["X1", "X2", "X3", "X4"]])
        best = group["rms"][()].argmin()
        assert int(group.attrs["best"]) == best
    assert set(table["key"]) <= {name.removesuffix(".h5") for name in finished.records()}


def test_pictures_and_page_are_there(finished):
    figures = finished.out() / "figures"
    for stem in ("histogram_field", "densities_field", "cost_field", "law_field"):
        for suffix in (".png", ".pdf"):
            assert (figures / (stem + suffix)).stat().st_size > 1000
    page = (finished.out() / "report.html").read_text()
    assert "data:image/png;base64," in page
    assert 'src="http' not in page


def test_the_loop_in_one_process_gives_the_same_runs(finished, tmp_path, monkeypatch):
    monkeypatch.chdir(finished.folder)
    case = load(["tiny.yaml"])
    runner = make_runner(case, finished.out() / "scene.h5", finished.out() / "geometry.h5", tmp_path / "runs")
    history, decision = calibrate(case, runner, read_targets(finished.out() / "target.h5"))
    assert decision.converged
    with h5py.File(finished.out() / "calibration.h5") as file:
        assert [run.key for run in history.runs] == list(file["runs/key"].asstr()[()])
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
    runner = make_runner(case, finished.out() / "scene.h5", finished.out() / "geometry.h5", tmp_path / "runs")
    parameters = {name: material.start_parameters for name, material in case.materials.items()}
    image = runner.run(parameters, noise_seed(case, fresh=True), image=True).image_db
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
    said = show(finished.out())
    assert said[0] == finished.summary()["verdict"]
    assert f"exports: {finished.out() / 'export'}" in said
