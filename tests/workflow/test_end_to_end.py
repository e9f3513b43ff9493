"""The workflow on a tiny case: its end, its contracts, and what a second command does."""

from __future__ import annotations

import json
import math

import h5py
import numpy as np
import pandas as pd

from radcal.calibration.loop import calibrate
from radcal.config import load
from radcal.measurement.target import read_targets
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


def test_the_same_command_again_has_nothing_to_do(finished):
    before = finished.listing()
    again = finished.run("--configfile", "tiny.yaml")
    assert again.returncode == 0
    assert "Nothing to be done" in again.stdout
    assert finished.listing() == before


def test_first_steps_are_targets_of_their_own(project):
    done = project.run("reference", "--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    assert len(project.records()) == 1
    done = project.run("design", "--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    assert len(project.records()) == 13
    assert (project.out() / "scores.json").is_file()
    assert not (project.out() / "iterations").exists()


def test_a_larger_design_keeps_the_runs_of_a_smaller_one(project):
    project.write(design={"size": 6, "chunk": 4})
    assert project.run("design", "--configfile", "tiny.yaml").returncode == 0
    before = project.records()
    project.write(design={"size": 9, "chunk": 4})
    assert project.run("design", "--configfile", "tiny.yaml").returncode == 0
    after = project.records()
    assert len(before) == 7
    assert len(after) == 10
    assert {name: after[name] for name in before} == before


def test_several_materials_share_each_run(project):
    truth = {"field": [6.1, 14.2, 21.5, 3.3], "lake": [10.0, 20.0, 5.0, 8.0]}
    project.write(
        materials={
            "field": {"calibrate": True, "law": "mangia"},
            "lake": {"calibrate": True, "law": "mangia", "start": [5, 5, 5, 5]},
        },
        measurement={"synthetic": {"parameters": truth, "seed": 2}},
        stop={"rms": 5e-3, "max_runs": 14},
    )
    done = project.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    summary = project.summary()
    assert set(summary["materials"]) == {"field", "lake"}
    assert all(
        material["stop_reason"] in ("rms", "unreachable", "max_runs") for material in summary["materials"].values()
    )
    # one run carries both proposals
    with h5py.File(project.out() / "calibration.h5") as file:
        n = len(file["runs/kind"])
        assert len(file["materials/field/rms"]) == len(file["materials/lake/rms"]) == n
        modes = {name: file[f"materials/{name}/mode"].asstr()[()] for name in truth}
    assert n == 1 + 12 + summary["runs"]["infill"]
    assert len(project.records()) == summary["runs"]["total"]
    # whoever ends first repeats its best while the other goes on
    for mode in modes.values():
        ended = np.flatnonzero(mode == "ended")
        assert list(ended) == list(range(len(mode) - len(ended), len(mode)))


def test_the_loop_in_one_process_gives_the_same_runs(finished, tmp_path, monkeypatch):
    monkeypatch.chdir(finished.folder)
    case = load(["tiny.yaml"])
    runner = make_runner(case, finished.out() / "scene.h5", finished.out() / "geometry.h5", tmp_path / "runs")
    history, decision = calibrate(case, runner, read_targets(finished.out() / "target.h5"))
    assert decision.converged
    with h5py.File(finished.out() / "calibration.h5") as file:
        assert [run.key for run in history.runs] == list(file["runs/key"].asstr()[()])
        np.testing.assert_array_equal([run.rms["field"] for run in history.runs], file["materials/field/rms"][()])
