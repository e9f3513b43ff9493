"""Results for scripts: tables, and images with their units and coordinates."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import radcal
from radcal.config.stages import STAGES
from radcal.errors import StoreError
from radcal.products.export import PassImages, write_export
from radcal.results.run_table import write_table
from radcal.results.summary import summarise
from radcal.storage.records import write_json

PAGE = Path(__file__).parents[2] / "docs" / "exports.md"


def finish(made, folder, **scene):
    """Results folder of a finished calibration, as far as scripts read it."""
    images = (made.archive.measured_db, made.archive.images.calibrated_db)
    of_pass = [PassImages(made.case.radar, made.geometry, *images, "measured image, not registered")]
    scene = replace(made.scene, **scene)
    write_export(folder / "export", STAGES["export"].of(made.case), made.archive, scene, of_pass)
    write_table(folder / "runs.csv", made.archive)
    write_json(folder / "summary.json", summarise(made.archive), flat=True)
    return folder


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    return finish(made, tmp_path_factory.mktemp("results") / "small")


def test_tables(folder, made):
    results = radcal.open(folder)
    assert results.verdict == summarise(made.archive)["verdict"]
    assert results.materials.loc[("dyke", "X2"), "calibrated"] == made.archive.laws["dyke"][1]
    assert results.laws.index.names == ["material", "incidence_deg"]
    assert results.runs["key"].nunique() == made.archive.runs.kind.size
    assert results.runs.index.names == ["run", "material"]
    # one number of runs: of 4 runs of the design and 2 of infill, besides the reference run, which the table has, too
    assert results.run_counts["search"] == 6
    assert results.runs.index.get_level_values("run").nunique() == 7
    assert results.images == ["calibrated", "difference", "incidence", "mask", "material", "measured"]


def test_images_have_units(folder, made):
    results = radcal.open(folder)
    images = made.archive.images
    np.testing.assert_array_equal(results.array("incidence"), images.incidence_deg)
    assert [results.unit(name) for name in results.images] == ["dB", "dB", "deg", "1", "1", "dB"]
    image = results.image("difference")
    assert (image.dims, image.attrs["units"], image.name) == (("slant_range", "azimuth"), "dB", "difference")
    np.testing.assert_array_equal(image, images.calibrated_db - made.archive.measured_db)
    assert image.azimuth[-1] == 29


def test_an_image_on_the_map_has_coordinates(made, tmp_path):
    place = {"crs": "EPSG:32631", "transform": (5.0, 0.0, 600_000.0, 0.0, 5.0, 5_780_000.0)}
    rows, columns = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    changed = replace(made, geometry=replace(made.geometry, ground=np.stack([columns, rows]).astype(np.float32)))
    grid = {"material": np.ones((30, 40), dtype=np.uint8), "elevation_m": np.zeros((30, 40))}
    image = radcal.open(finish(changed, tmp_path, **place, **grid)).image("measured")
    assert image.dims == ("y", "x")
    assert image.attrs["crs"] == "EPSG:32631"
    # pixel (3, 7) shows row 7, column 3 of the scene
    found = image.sel(x=600_000 + 3.5 * 5, y=5_780_000 + 7.5 * 5)
    assert found.item() == made.archive.measured_db[3, 7]


def test_without_xarray_the_message_says_what_to_install(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"image\('measured'\) needs .* pip install 'radcal\[xarray\]'"):
        radcal.open(folder).image("measured")
    assert radcal.open(folder).array("measured").shape == (40, 30)


def test_what_is_missing_is_named(folder, tmp_path):
    with pytest.raises(StoreError, match="no image 'mesured', expected one of .*'measured'"):
        radcal.open(folder).array("mesured")
    with pytest.raises(StoreError, match=r"has no summary.json: its calibration is not finished"):
        radcal.open(tmp_path)
    with pytest.raises(StoreError, match=r"gone is no folder"):
        radcal.open(tmp_path / "gone")


def test_the_script_of_the_page_runs(folder, capsys):
    script = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    assert len([line for line in script.splitlines() if line]) <= 10
    exec(script.replace("results/dyke", str(folder)), {})
    printed = capsys.readouterr().out
    assert "X4" in printed
    assert re.search(r"^\d+\.\d+ dB$", printed, flags=re.MULTILINE)
