"""The workflow on a tiny case: what a second command does, first steps, a larger design, several materials."""

import h5py
import numpy as np
import pandas as pd
import pytest


def test_the_same_command_again_has_nothing_to_do(finished):
    before = finished.listing()
    printed = finished.ended("--configfile", "tiny.yaml")
    assert "Nothing to be done" in printed
    summary, report = finished.summary(), f"radcal: report: {finished.out() / 'report.html'}"
    assert [line for line in printed.splitlines() if line.startswith("radcal: ")] == [
        f"radcal: {summary['verdict']}",
        report.replace(f"{finished.folder}/", ""),
    ]
    assert finished.listing() == before
    # neither of one stage nor of a dry run
    for words in (["design"], ["--dry-run"]):
        assert summary["verdict"] not in finished.ended(*words, "--configfile", "tiny.yaml")


def test_a_dry_run_lists_the_stages_in_their_order(project):
    (line,) = (
        line
        for line in project.run("--configfile", "tiny.yaml", "--dry-run").stdout.splitlines()
        if line.startswith("radcal: stages in their order: ")
    )
    order = ["scene", "geometry", "measurement", "reference_run", "registration", "target", "design_chunk", "scores"]
    assert sorted(order, key=line.index) == order
    assert "design_chunk (2 jobs)" in line


def test_several_materials_share_each_run_and_need_no_design(project):
    """One of the laws is a formula of the user, which the exports contain."""
    formula = {
        "law": "formula",
        "formula": "base + rise*cos(phi) + peak*exp(-fall*phi**2)",
        "names": ["base", "rise", "peak", "fall"],
        "units": ["dB", "dB", "dB", ""],
    }
    truth = {"field": [6.1, 14.2, 21.5, 3.3], "lake": [10.0, 20.0, 5.0, 8.0]}
    project.write(
        materials={
            "field": {"calibrate": True, "law": "mangia"},
            "lake": {"calibrate": True, **formula, "bounds": [[0, 50]] * 4, "start": [5, 5, 5, 5]},
        },
        measurement={"synthetic": {"parameters": truth, "seed": 2}},
        design={"size": 0},
        stop={"rms": 5e-3, "max_runs": 5},
    )
    project.ended("--configfile", "tiny.yaml")
    summary = project.summary()
    assert set(summary["materials"]) == {"field", "lake"}
    # one run carries both proposals
    with h5py.File(project.out() / "calibration.h5") as file:
        n = len(file["runs/kind"])
        assert len(file["materials/field/rms"]) == len(file["materials/lake/rms"]) == n
        modes = {name: file[f"materials/{name}/fidelity/mode"].asstr()[()] for name in truth}
    assert n == 1 + summary["runs"]["infill"]
    assert summary["runs"]["design"] == 0
    assert len(project.records()) == summary["runs"]["total"]
    # whoever ends first repeats its best while the other goes on
    for mode in modes.values():
        ended = np.flatnonzero(mode == "ended")
        assert list(ended) == list(range(len(mode) - len(ended), len(mode)))
    assert list(summary["materials"]["lake"]["parameters"]) == formula["names"]
    x = list(summary["materials"]["lake"]["parameters"].values())
    laws = pd.read_csv(project.out() / "export/laws.csv").query("material == 'lake'")
    phi = np.radians(laws["incidence_deg"].to_numpy())
    curve = x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2)
    assert laws["calibrated_db"].to_numpy() == pytest.approx(curve, abs=0.01)
    assert "peak*exp(-fall*phi**2)" in (project.out() / "report.html").read_text()
