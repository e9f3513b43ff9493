"""The cases that radcal ships: valid, in step with the defaults, and plannable."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.warp
import yaml
from raster_files import write_raster
from workflow_project import ROOT

from radcal.config import load

CASES = sorted((ROOT / "config").glob("*.yaml"))


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_every_case_is_valid(path):
    case = load([path])
    assert case.case == path.stem or path.stem == "config"
    assert case.calibrated


def test_the_papers_presets_say_what_the_paper_says():
    paper, small = (load([ROOT / f"config/{name}.yaml"]) for name in ("paper", "paper_small"))
    assert (paper.design.sampler, paper.design.size, small.design.size) == ("monte_carlo", 800, 80)
    assert small.stop.max_runs == 80 + 40
    for case in (paper, small):
        assert (case.surrogate.outputs, case.surrogate.training) == ("direct", "smt")
        assert not case.has_baseline
        assert not case.registers_twice
        assert case.radar.radiometry == "sigma0_local"
        assert (case.optimiser.objective, case.optimiser.polish, case.stop.rms) == ("rms", False, 1e-5)


@pytest.mark.skipif("RADCAL_DATA" not in os.environ, reason="RADCAL_DATA is not set: no measured image")
def test_a_measured_image_from_the_raw_files_to_the_report(project):
    """An eighth of the Flevoland image, with fewer classes to calibrate and a loose tolerance."""
    data = yaml.safe_load((ROOT / "config/flevoland.yaml").read_text())
    raw = Path(os.environ["RADCAL_DATA"]) / "flevoland"
    names = json.loads((raw / "labels.json").read_text())
    for name in ("sigma0_hh.tif", "labels.tif"):
        with rasterio.open(raw / name) as raster:
            part = raster.read(1)[:, 256:384]
        write_raster(project.folder / name, part)
    seen = {names[str(number)] for number in np.unique(part)}
    data["scene"]["labels"] = "labels.tif"
    data["measurement"]["path"] = "sigma0_hh.tif"
    data["materials"] = {name: material for name, material in data["materials"].items() if name in seen}
    for name, material in data["materials"].items():
        if name not in ("beet", "wheat 2"):
            data["materials"][name] = {"parameters": [-20, 0, 0, 0]} if material["calibrate"] else material
    data |= {
        "case": "measured", "design": {"size": 4, "chunk": 2}, "stop": {"rms": 1e-3, "max_runs": 6},
        "uncertainty": {"walkers": 32, "steps": 100},  # too few to converge, as in the tiny case
    }  # fmt: skip
    (project.folder / "measured.yaml").write_text(yaml.safe_dump(data))
    printed = project.ended("--configfile", "measured.yaml")
    assert "sigma0_hh.tif: 96,000 pixels; not used are 0 without data, 0 of zero power, 0 of negative" in printed
    summary = project.summary("measured")
    assert set(summary["materials"]) == {"beet", "wheat 2"}
    # the level of the class, from the data's own description
    target = summary["materials"]["wheat 2"]["target"]
    assert -27.5 < target["xi"] + target["omega"] * 0.798 * target["alpha"] / (1 + target["alpha"] ** 2) ** 0.5 < -23.5
    assert "hidden" not in summary["materials"]["beet"]
    assert "wheat 2" in (project.out("measured") / "report.html").read_text()


def test_a_scene_from_gis_rasters_to_the_report(project):
    """Elevation and materials on the map, a track to the south-west, looks that are not whole, and the level taken
    from the material of a fixed law."""
    north, east = np.mgrid[0:80, 0:80] * 5.0
    profile = {"crs": "EPSG:32631", "transform": rasterio.Affine(5.0, 0.0, 600_000.0, 0.0, -5.0, 5_780_000.0)}
    heights = (20.0 + 2.0 * np.sin(east / 25.0) * np.cos(north / 30.0)).astype(np.float32)
    write_raster(project.folder / "elevation.tif", heights, **profile)
    write_raster(project.folder / "cover.tif", np.where(east < 250, 1, 2).astype(np.uint8), **profile)
    scene = {"source": "raster", "elevation": "elevation.tif", "materials": "cover.tif", "names": "names.json"}
    level = {"pixels": 400, "normalisation": "offset"}
    hidden = {"parameters": {"field": [6.1, 14.2, 21.5, 3.3]}, "seed": 1, "warp_px": 0, "offset_db": 3.0}
    changes = {
        "case": "gis", "target": level,
        "radar": {"altitude_m": 1000.0, "radiometry": "sigma0_local", "heading_deg": 200.0, "looks": 3.6},
        "stop": {"rms": 3e-3, "max_runs": 16}, "measurement": {"synthetic": hidden},
    }  # fmt: skip
    project.write("gis.yaml", scene=scene | {"vertical_datum": "EGM2008"}, **changes)
    lines = project.ended("--configfile", "gis.yaml").splitlines()
    # what is found of the geometry is said before the design
    (told,) = (k for k, line in enumerate(lines) if "was not registered" in line)
    assert told < next(k for k, line in enumerate(lines) if "target of field" in line)
    summary = project.summary("gis")
    assert summary["levels"]["normalisation"] == "offset"
    assert summary["levels"]["offset_db"] == pytest.approx(3.0, abs=0.3)
    assert "lake" in summary["levels"]["sentence"]
    assert summary["levels"]["sentence"][:40] in (project.out("gis") / "report.html").read_text()
    assert summary["looks"]["simulated"] == 3.6
    with rasterio.open(project.out("gis") / "export" / "measured.tif") as raster:
        east_m, north_m = raster.lnglat()
        assert "track of heading 200 degrees" in raster.crs.to_wkt()
        assert raster.width * raster.height < 0.7 * 80 * 80  # the turned rectangle inside of the rasters
    at = rasterio.warp.transform("EPSG:4326", "EPSG:32631", [east_m], [north_m])
    assert (at[0][0], at[1][0]) == pytest.approx((600_200.0, 5_779_800.0), abs=10.0)
