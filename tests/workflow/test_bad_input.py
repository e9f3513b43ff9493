"""Every bad input ends in one sentence, before any simulator run, and touches no earlier result."""

import numpy as np
from workflow_project import COLUMNS, ROWS, write_raster


def image(project, values):
    write_raster(project.folder / "image.tif", values.astype(np.float32))
    project.write(measurement={"source": "file", "path": "image.tif", "scale": "db", "radiometry": "sigma0_ref"})


def test_an_image_of_another_place_or_level_costs_the_reference_run_and_no_other(project):
    image(project, np.random.default_rng(1).normal(-10, 3, (ROWS, COLUMNS)))
    done = project.radcal("tiny.yaml", "--cores", "2", "--set", "registration.method=gefolki")
    assert done.returncode == 1
    assert "radcal: registration: image.tif has nothing in common with the simulated image" in done.stdout
    assert "Traceback" not in done.stdout
    assert len(project.records()) == 1
    done = project.radcal("tiny.yaml", "--cores", "2")
    assert done.returncode == 1
    assert "radcal: materials.field.bounds: inside them the law 'mangia' gives 5.9 to 72.2 dB" in done.stdout
    assert "the measured level is -9.4 dB" in done.stdout
    assert "Traceback" not in done.stdout
    assert len(project.records()) == 1


def test_a_refused_image_leaves_a_finished_case_untouched(finished):
    before, content = finished.listing(), (finished.out() / "passes/1/measurement.h5").read_bytes()
    image(finished, np.full((ROWS + 4, COLUMNS), -10.0))
    done = finished.run("--configfile", "tiny.yaml")
    finished.write()
    assert done.returncode != 0
    assert "radcal: measurement.path" in done.stdout
    # Snakemake puts the one file back that the refused job would have replaced
    assert (finished.out() / "passes/1/measurement.h5").read_bytes() == content
    now = finished.listing()
    assert now.keys() == before.keys()
    assert [name for name in now if now[name] != before[name]] in ([], ["passes/1/measurement.h5"])
    finished.ended("--configfile", "tiny.yaml")
    assert finished.records() == {
        k.removeprefix("runs/"): v[1] for k, v in before.items() if k.startswith("runs/") and k.endswith(".h5")
    }
