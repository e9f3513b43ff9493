"""Results for scripts: tables, and images with their units and coordinates."""

import re
import shutil
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pystac
import pytest
import rasterio
from archives import changed_material, posterior
from pyproj import Transformer

import radcal
from radcal.errors import StoreError
from radcal.posterior.result import KeptDraws
from radcal.products.stac import stac_item
from radcal.products.tables import write_runs
from radcal.results.summary import summarise
from radcal.storage.records import write_json

PAGE = Path(__file__).parents[2] / "docs" / "exports.md"


def finish(made, folder, **scene):
    """Results folder of a finished calibration, as far as scripts read it."""
    made.exported(folder / "export", scene=replace(made.scene, **scene))
    write_runs(folder / "runs.csv", made.archive)
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


def on_map(made, folder):
    """Results of a scene of 30 x 40 cells of 5 m on a map, each of which one pixel shows."""
    place = {"crs": "EPSG:32631", "transform": (5.0, 0.0, 600_000.0, 0.0, 5.0, 5_780_000.0)}
    rows, columns = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    changed = replace(made, geometry=replace(made.geometry, ground=np.stack([columns, rows]).astype(np.float32)))
    grid = {"material": np.ones((30, 40), dtype=np.uint8), "elevation_m": np.zeros((30, 40))}
    return radcal.open(finish(changed, folder, **place, **grid))


def test_an_image_on_the_map_has_coordinates(made, tmp_path):
    import rioxarray  # noqa: F401 - the accessor rio of arrays

    image = on_map(made, tmp_path).image("measured")
    assert image.dims == ("y", "x")
    assert image.attrs["crs"] == "EPSG:32631"
    # as rioxarray reads them, also after a computation, which drops the attributes
    doubled = 2.0 * image
    assert doubled.rio.crs.to_epsg() == 32631
    assert tuple(doubled.rio.transform())[:6] == (5.0, 0.0, 600_000.0, 0.0, -5.0, 5_780_150.0)
    assert doubled.rio.transform(recalc=True) == doubled.rio.transform()
    # pixel (3, 7) shows row 7, column 3 of the scene
    found = image.sel(x=600_000 + 3.5 * 5, y=5_780_000 + 7.5 * 5)
    assert found.item() == made.archive.measured_db[3, 7]


def test_stac_item(made, folder, tmp_path):
    results = on_map(made, tmp_path)
    made.archive.write(tmp_path / "calibration.h5")
    item = results.to_stac()
    item.validate()
    item.save_object()
    item = pystac.Item.from_file(tmp_path / "item.json")
    to_wgs84 = Transformer.from_crs("EPSG:32631", "EPSG:4326", always_xy=True)
    corners = [to_wgs84.transform(600_000 + 200 * east, 5_780_000 + 150 * north) for east in (0, 1) for north in (0, 1)]
    assert item.bbox == pytest.approx([*np.min(corners, axis=0), *np.max(corners, axis=0)], abs=1e-7)
    np.testing.assert_allclose(sorted(item.geometry["coordinates"][0][:4]), sorted(map(list, corners)), atol=1e-7)
    assert item.assets["measured.tif"].media_type == pystac.MediaType.COG
    assert item.assets["incidence.tif"].extra_fields["bands"] == [{"unit": "deg", "data_type": "float32"}]
    assert item.properties["radcal:materials"]["dyke"]["parameters"]["X2"] == made.archive.laws["dyke"][1]
    assert abs((datetime.now(UTC) - item.datetime).total_seconds()) < 3600
    there = {name for name, asset in item.assets.items() if (tmp_path / asset.href).is_file()}
    assert item.assets.keys() - there == {"report.html"}  # which this test does not make
    # in slant range, and of a product that says when it was taken
    summary = {**results.summary, "findings": [{"code": "acquisition", "numbers": {"start": "2021-12-23T05:11:22.5"}}]}
    flat = stac_item(tmp_path, summary, [])
    assert (flat.geometry, flat.bbox) == (None, None)
    assert flat.datetime == datetime(2021, 12, 23, 5, 11, 22, 500_000, UTC)


def test_posterior_for_arviz(made, tmp_path):
    draws = KeptDraws(np.arange(12.0).reshape(3, 4), np.ones(3), np.ones(3), np.zeros((3, 91)), np.zeros(3))
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(StoreError, match="the calibration is not finished, expected calibration.h5"):
        radcal.open(tmp_path).to_arviz()
    changed_material(made.archive, "dyke", posterior=posterior(draws=draws)).write(tmp_path / "calibration.h5")
    found = radcal.open(tmp_path).to_arviz()
    assert found["posterior"]["X3"].values.ravel().tolist() == [2.0, 6.0, 10.0]
    assert found.attrs["case"] == "small"


def test_without_an_optional_library_the_message_says_what_to_install(folder, monkeypatch):
    results = radcal.open(folder)
    for library in ("pystac", "xarray"):
        monkeypatch.setitem(sys.modules, library, None)
    for call, extra in ((results.to_stac, "stac"), (results.to_arviz, "arviz")):
        with pytest.raises(ImportError, match=rf"to_{extra}\(\) needs .* pip install 'radcal\[{extra}\]'"):
            call()
    with pytest.raises(ImportError, match=r"image\('measured'\) needs .* pip install 'radcal\[xarray\]'"):
        results.image("measured")
    assert results.array("measured").shape == (40, 30)


def test_what_is_missing_is_named(folder, tmp_path):
    with pytest.raises(StoreError, match="no image 'mesured', expected one of .*'measured'"):
        radcal.open(folder).array("mesured")
    with pytest.raises(StoreError, match=r"has no summary.json: its calibration is not finished"):
        radcal.open(tmp_path)
    with pytest.raises(StoreError, match=r"gone is no folder"):
        radcal.open(tmp_path / "gone")


@pytest.mark.parametrize(
    ("name", "content", "read", "told"),
    [
        ("summary.json", b"{}", lambda one: one.verdict, "lacks materials"),
        ("runs.csv", b"", lambda one: one.runs, "No columns to parse"),
        ("export/laws.csv", b"a,b\n1,2\n", lambda one: one.laws, "None of .* are in the columns"),
        ("export/parameters.csv", b"\xff\xfe", lambda one: one.materials, "codec can't decode"),
    ],
)
def test_other_contents_are_one_sentence(folder, tmp_path, name, content, read, told):
    shutil.copytree(folder, tmp_path / "small")
    (tmp_path / "small" / name).write_bytes(content)
    with pytest.raises(StoreError, match=rf"{name}: holds other contents than radcal writes \(.*{told}"):
        read(radcal.open(tmp_path / "small"))


def test_an_image_of_another_program_is_one_sentence(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "small")
    path = tmp_path / "small/export/measured.tif"
    with rasterio.open(path) as raster:
        values, profile = raster.read(), raster.profile
    with rasterio.open(path, "w", **profile) as raster:
        raster.write(values)
    with pytest.raises(StoreError, match=r"measured\.tif: holds other contents .*lacks the tags unit and grid"):
        radcal.open(tmp_path / "small").unit("measured")


def test_the_script_of_the_page_runs(folder, capsys):
    script = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    assert len([line for line in script.splitlines() if line]) <= 10
    exec(script.replace("results/dyke", str(folder)), {})
    printed = capsys.readouterr().out
    assert "X4" in printed
    assert re.search(r"^\d+\.\d+ dB$", printed, flags=re.MULTILINE)
