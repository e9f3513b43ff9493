"""Other laws than the default one, from the configuration to the report."""

import csv
import json

import h5py
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from radcal.results.archive import read_archive

TABLE = {"law": "tabulated", "angles_deg": [15, 25, 35], "bounds": [[-20, 0]] * 3}
HIDDEN = [-4.0, -9.5, -12.0]
SOIL = [8.0, 1.5, 1.0]


def test_laws_of_several_kinds_from_the_configuration_to_the_report(project):
    name = project.write(
        radar={"frequency_ghz": 9.6, "polarisation": "VV"},
        materials={
            "field": {"calibrate": True, **TABLE, "start": {"law": "oh1992", "parameters": SOIL}},
            "lake": {"law": "constant_gamma", "parameters": [-12.0]},
        },
        measurement={"synthetic": {"parameters": {"field": HIDDEN}, "warp_px": 0}},
        design={"size": 6},
        stop={"rms": 1e-9, "max_runs": 7},
    )
    project.ended("--configfile", name)
    summary = project.summary("tiny")
    field = summary["materials"]["field"]
    assert list(field["parameters"]) == ["sigma0_15deg", "sigma0_25deg", "sigma0_35deg"]
    assert (field["law"], field["start_law"]) == ("tabulated", "oh1992")
    assert summary["runs"]["reference"] == 1

    archive = read_archive(project.out("tiny") / "calibration.h5", images=False)
    result, material = archive.materials["field"], archive.configured.materials["field"]
    assert np.isnan(result.parameters[0]).all()
    assert np.isfinite(result.parameters[1:]).all()
    assert (material.at_start.law, material.start_parameters) == ("oh1992", SOIL)
    angles, key = np.percentile(result.target.incidence_deg, [5, 95]), archive.passes["1"].keys[0]
    found = result.parameters[result.best]
    grid = np.linspace(*angles, 201)
    fitted, hidden = (PchipInterpolator(TABLE["angles_deg"], x)(grid) for x in (found, HIDDEN))
    assert field["law_difference_db"] == pytest.approx(np.abs(fitted - hidden).max(), rel=1e-6)

    with h5py.File(project.out("tiny") / "runs" / f"{key}.h5") as file:
        description = json.loads(file.attrs["description"])
    assert description["materials"] == {
        "field": {"law": "oh1992", "parameters": SOIL},
        "lake": {"law": "constant_gamma", "parameters": [-12.0]},
    }
    assert description["pass"]["frequency_ghz"] == 9.6

    with (project.out("tiny") / "runs.csv").open() as handle:
        rows = list(csv.DictReader(handle))
    assert [row["sigma0_25deg"] == "" for row in rows] == [True] + [False] * 7

    # the scene is seen at 15 to 35 deg, and constant_gamma is for 30 deg and more
    (note,) = summary["law_notes"]
    assert note.startswith("lake: ")
    assert "outside of the 30 to 80 deg that law 'constant_gamma' was made for" in note
    text = (project.out("tiny") / "report.html").read_text()
    assert "The start has another law: “oh1992” with 8.000, 1.500, 1.000." in text
    assert (project.out("tiny") / "figures" / "law_field.png").is_file()
