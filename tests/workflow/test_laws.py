"""Other laws than the default one, from the configuration to the report."""

import csv

import numpy as np

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

    with (project.out("tiny") / "runs.csv").open() as handle:
        rows = list(csv.DictReader(handle))
    assert [row["sigma0_25deg"] == "" for row in rows] == [True] + [False] * 7
    text = (project.out("tiny") / "report.html").read_text()
    assert "The start has another law: “oh1992” with 8.000, 1.500, 1.000." in text
    assert (project.out("tiny") / "figures" / "law_field.png").is_file()
