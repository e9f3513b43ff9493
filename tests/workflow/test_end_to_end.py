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


def test_several_materials_share_each_run(project):
    """Laws of several kinds: a table that starts as a law of soil, and a formula of the user, which is exported."""
    formula = {
        "law": "formula",
        "formula": "base + rise*cos(phi) + peak*exp(-fall*phi**2)",
        "names": ["base", "rise", "peak", "fall"],
        "units": ["dB", "dB", "dB", ""],
    }
    soil = {"law": "oh1992", "parameters": [8.0, 1.5, 1.0]}
    table = {"law": "tabulated", "angles_deg": [15, 25, 35], "bounds": [[-20, 0]] * 3, "start": soil}
    truth = {"field": [-4.0, -9.5, -12.0], "lake": [10.0, 20.0, 5.0, 8.0]}
    project.write(
        radar={"frequency_ghz": 9.6, "polarisation": "VV"},
        materials={
            "field": {"calibrate": True, **table},
            "lake": {"calibrate": True, **formula, "bounds": [[0, 50]] * 4, "start": [5, 5, 5, 5]},
        },
        measurement={"synthetic": {"parameters": truth, "seed": 2}},
        design={"size": 1},
        stop={"rms": 5e-3, "max_runs": 5},
    )
    project.ended("--configfile", "tiny.yaml")
    summary, page = project.summary(), (project.out() / "report.html").read_text()
    assert set(summary["materials"]) == {"field", "lake"}
    # one run carries both proposals
    with h5py.File(project.out() / "calibration.h5") as file:
        n = len(file["runs/kind"])
        assert len(file["materials/field/rms"]) == len(file["materials/lake/rms"]) == n
        # of a run with another law the table has no values
        assert np.isnan(file["materials/field/parameters"][()]).any(axis=1).tolist() == [True] + [False] * (n - 1)
        modes = {name: file[f"materials/{name}/fidelity/mode"].asstr()[()] for name in truth}
    assert n == 1 + 1 + summary["runs"]["infill"]
    assert len(project.records()) == summary["runs"]["total"]
    table = pd.read_csv(project.out() / "runs.csv").query("material == 'field'")
    assert table["X2"].isna().tolist() == [True] + [False] * (n - 1)
    # whoever ends first repeats its best while the other goes on
    for mode in modes.values():
        ended = np.flatnonzero(mode == "ended")
        assert list(ended) == list(range(len(mode) - len(ended), len(mode)))
    field = summary["materials"]["field"]
    assert list(field["parameters"]) == ["sigma0_15deg", "sigma0_25deg", "sigma0_35deg"]
    assert (field["law"], field["start_law"]) == ("tabulated", "oh1992")
    assert "The start has another law: “oh1992” with 8.000, 1.500, 1.000." in page
    assert list(summary["materials"]["lake"]["parameters"]) == formula["names"]
    x = list(summary["materials"]["lake"]["parameters"].values())
    laws = pd.read_csv(project.out() / "export/laws.csv").query("material == 'lake'")
    phi = np.radians(laws["incidence_deg"].to_numpy())
    curve = x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2)
    assert laws["calibrated_db"].to_numpy() == pytest.approx(curve, abs=0.01)
    assert "peak*exp(-fall*phi**2)" in page
