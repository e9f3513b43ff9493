"""Exports: tables, calibrated materials, and images whose places on the map are known."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import rasterio
import yaml
from archives import changed_material, configured, posterior, without_curve
from config_samples import COMMAND, measured
from lxml import etree
from rasterio.enums import ColorInterp
from rasterio.shutil import copy

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.ground.levels import Levels
from radcal.posterior.result import Curve
from radcal.products.export import ground_layers, write_export
from radcal.products.geotiff import SLANT_RANGE, _spacing, map_grid, pixel_at_cell
from radcal.products.tables import calibrated_yaml
from radcal.seeds import noise_seed
from radcal.storage.runs import IndexedRun, Record, RunStore, write_index


@pytest.fixture
def ground(made):
    """Ground of the 40 x 30 pixels: rows are columns of a scene of 70 x 45 cells, in ground range from the west."""
    rows, columns = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    return np.stack([5.0 + 2.0 * columns, 2.0 + rows]).astype(np.float32)  # a pixel is 1 cell by 2


@pytest.fixture
def on_map(made, ground):
    scene = replace(
        made.scene,
        material=np.ones((70, 45), dtype=np.uint8),
        elevation_m=np.zeros((70, 45)),
        crs="EPSG:32631",
        transform=(10.0, 0.0, 500_000.0, 0.0, 10.0, 4_600_000.0),
    )
    return scene, replace(made.geometry, ground=ground)


def test_a_known_corner_lies_at_its_place(made, on_map, tmp_path):
    made.exported(tmp_path, scene=on_map[0], geometry=on_map[1])
    measured = made.archive.measured_db
    with rasterio.open(tmp_path / "measured.tif") as raster:
        assert raster.crs.to_epsg() == 32631
        assert (raster.shape, raster.units, raster.tags()["grid"]) == ((70, 45), ("dB",), "map of the scene")
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert np.isnan(raster.nodata)
        # pixel (3, 7) shows row 19, column 5: 10 m cells, centre 0.5 cells from the corner, row 0 in the south
        for pixel in ((3, 7), (39, 29), (0, 1)):
            x, y = 500_000 + 10 * (2.5 + pixel[0]), 4_600_000 + 10 * (5.5 + 2 * pixel[1])
            assert next(raster.sample([(x, y)]))[0] == measured[pixel]
        values = raster.read(1)
        assert raster.bounds == (500_000, 4_600_000, 500_450, 4_600_700)
    # columns 0 and 1 lie before the first pixel, the last shown is 41; one cell is bridged
    assert np.isnan(values[:, 0]).all()
    assert np.isfinite(values[30, 2:42]).all()
    assert np.isnan(values[:, 43:]).all()


def test_layover_and_shadow_have_no_value(ground):
    layover = np.zeros((40, 30), dtype=bool)
    layover[10:14] = True
    ground[:, 20:30] = np.nan  # in shadow
    pixel = pixel_at_cell(ground, layover, (70, 45))
    assert (pixel[9:60, [14, 24, 25, 28]] == -1).all()  # columns of the scene inside of the two gaps
    assert pixel[5 + 2 * 4, 2 + 30] == 30 * 30 + 4
    assert (pixel[9:60, 2 + 33] >= 0).all()
    assert (pixel_at_cell(np.full_like(ground, np.nan), layover, (3, 4)) == -1).all()


def test_the_spacing_is_that_to_the_nearer_neighbour():
    """On this side of a shadow between the third and the fourth pixel, and of one without any place."""
    along = np.array([0.0, 1.0, 2.5, 12.0, 14.0, np.nan, 20.0])
    places = np.stack([np.broadcast_to(along[:, None], (7, 3)), np.zeros((7, 3))])
    np.testing.assert_allclose(_spacing(places, 1)[:, 0], [1.0, 1.0, 1.5, 2.0, 2.0, 0.0, 0.0])
    turned = np.stack([places[1].T, places[0].T])
    np.testing.assert_allclose(_spacing(turned, 2)[0], [1.0, 1.0, 1.5, 2.0, 2.0, 0.0, 0.0])


def test_masks_tell_layover_from_shadow(made):
    """1: clear; 2: in layover; 3: with ground in shadow; 4: both; 0: no ground."""
    layover, shadow = (np.zeros(made.geometry.shape, dtype=bool) for _ in range(2))
    layover[5, :4], shadow[5, 2:6] = True, True
    hidden = replace(made.geometry, layover=layover, shadow=shadow)
    found = ground_layers(hidden, {}, made.case.materials)["mask"].values  # noqa: PD011
    assert found[5, :7].tolist() == [2, 2, 4, 4, 3, 3, 1]
    nothing = np.flatnonzero(~hidden.visible.ravel() & ~shadow.ravel())
    assert not found.ravel()[nothing].any()


def test_images_of_a_further_pass_are_those_of_its_own_fresh_run(made, tmp_path):
    """Two final runs in each of two passes: with the runs' random numbers, then with fresh ones."""
    image = made.archive.measured_db
    store, keys = RunStore(tmp_path / "runs"), [f"{k}" * 20 for k in range(4)]
    for k, key in enumerate(keys):
        store.put(Record(key, {name: np.zeros(3, np.float32) for name in made.targets}, image + k, 0.1), {})
    write_index(tmp_path / "final.json", [IndexedRun(key, {}) for key in keys])
    radar = [{"depression_deg": 45}, {"depression_deg": 30}]
    case = case_from({**made.case.sections("materials"), "radar": radar, "measurement": [{}, {}]})
    levelled = replace(made.archive.passes["1"], levels=Levels("offset", 0.5, 0.1))
    archive = replace(made.archive, passes={"1": levelled, "2": levelled})
    of_pass = [made.geometry] * 2, [made.registered] * 2
    files = tmp_path / "final.json", tmp_path / "runs"
    write_export(tmp_path / "out", STAGES["archive"].of(case), archive, made.scene, *of_pass, *files)
    found = {}
    for name in ("calibrated", "calibrated_pass2", "measured_pass2"):
        with rasterio.open(tmp_path / f"out/{name}.tif") as raster:
            found[name], text = raster.read(1), raster.descriptions[0]
    np.testing.assert_array_equal(found["calibrated"], made.archive.images.calibrated_db)
    np.testing.assert_array_equal(found["calibrated_pass2"], image + 3)
    np.testing.assert_allclose(found["measured_pass2"], made.registered.measurement.image_db - 0.5, rtol=1e-6)
    assert text == "measured image, not registered, after subtraction of its assumed level"


def test_a_scene_without_a_map_says_so(made, tmp_path):
    files = made.exported(tmp_path)
    assert map_grid(made.scene, made.geometry) is None
    with rasterio.open(tmp_path / "measured.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), made.archive.measured_db)
        assert raster.crs is None
        assert raster.tags()["grid"] == SLANT_RANGE
        assert raster.descriptions == ("measured image, not registered",)
    with rasterio.open(tmp_path / "material.tif") as raster:
        assert (raster.nodata, raster.read(1)[0, 0]) == (0, 0)
        assert yaml.safe_load(raster.tags()["materials"]) == {"1": "dyke", "2": "stem beans", "3": "unused"}
    # beside them, styles and names of classes, into which map viewers write
    assert {path.name for path in set(tmp_path.iterdir()) - set(files)} == {
        "calibrated.qml", "mask.qml", "mask.tif.aux.xml", "material.qml", "material.tif.aux.xml", "measured.qml",
    }  # fmt: skip


@pytest.mark.parametrize("georeferenced", [False, True])
def test_map_viewers_show_names_and_colours_of_materials(made, on_map, tmp_path, georeferenced):
    scene, geometry = on_map if georeferenced else (None, None)
    colours = {1: "#0A141E", 2: "#56B4E9", 3: "#009E73"}  # configured, or at the material's place in the list
    changed = deepcopy(made)
    changed.case.materials["dyke"] = changed.case.materials["dyke"].model_copy(update={"colour": colours[1]})
    changed.exported(tmp_path, scene=scene, geometry=geometry)
    with rasterio.open(tmp_path / "material.tif") as raster:
        found = raster.colormap(1)
        assert raster.colorinterp == (ColorInterp.palette,)
    assert [found[k][:3] for k in (1, 2, 3)] == [(10, 20, 30), (86, 180, 233), (0, 158, 115)]
    # a VRT holds what GDAL has read of the image and of the file beside it
    copy(tmp_path / "material.tif", tmp_path / "material.vrt", driver="VRT")
    names = [one.text for one in etree.parse(tmp_path / "material.vrt").iter("Category")]
    assert names == [None, "dyke", "stem beans", "unused"]
    entries = [dict(one.attrib) for one in etree.parse(tmp_path / "material.qml").iter("paletteEntry")]
    assert {int(one["value"]): (one["label"], one["color"]) for one in entries} == {
        k: (names[k], colour) for k, colour in colours.items()
    }


def test_measured_and_calibrated_image_have_one_gray_scale(made, tmp_path):
    made.exported(tmp_path)
    ends = [[float(etree.parse(tmp_path / f"{name}.qml").findtext(f".//{end}")) for end in ("minValue", "maxValue")]
            for name in ("measured", "calibrated")]  # fmt: skip
    assert ends[0] == ends[1]
    levels_db = np.sort(made.archive.measured_db[np.isfinite(made.archive.measured_db)])
    assert ends[0] == pytest.approx([levels_db[levels_db.size // 100], levels_db[-levels_db.size // 100]], abs=0.3)


def test_the_level_of_a_material_seen_at_one_incidence_is_a_row_of_the_laws(made, tmp_path):
    seen = np.array([[38.7, 38.9], [44.0, 44.0]])  # the first angle lies between two rows of whole degrees
    archive = changed_material(made.archive, "dyke", level_only=True, posterior=posterior(seen_deg=seen))
    made.exported(tmp_path, archive)
    laws = pd.read_csv(tmp_path / "laws.csv").set_index(["material", "incidence_deg"]).loc["dyke"]
    assert laws.index[laws["level"]].tolist() == [38.8, 44.0]
    assert len(laws) == 87
    assert laws.index.is_monotonic_increasing
    row = laws.loc[38.8]
    np.testing.assert_allclose(
        [row["median_db"], row["p05_db"], row["p95_db"]],
        [-4.0 - 0.2 * 38.8, -5.0 - 0.21 * 38.8, -3.2 - 0.18 * 38.8],
    )
    x, phi = archive.laws["dyke"], np.radians(38.8)
    assert row["calibrated_db"] == pytest.approx(x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2))
    whole = changed_material(archive, "dyke", level_only=False)
    made.exported(tmp_path, whole)
    assert not pd.read_csv(tmp_path / "laws.csv")["level"].any()


def test_tables(made, tmp_path):
    looks = np.full(made.archive.runs.kind.size, 2.75)
    made.exported(tmp_path, changed_material(made.archive, "dyke", looks=looks, posterior=without_curve()))
    table = pd.read_csv(tmp_path / "parameters.csv").set_index(["material", "parameter"])
    assert table["calibrated"].loc["dyke"].tolist() == made.archive.laws["dyke"].tolist()
    row = table.loc[("dyke", "X4")]
    assert (row["law"], row["lower"], row["upper"], row["looks"]) == ("mangia", 0, 50, 2.75)
    assert row["p05"] == 4.0
    assert np.isnan(row["parameters_model"])
    assert np.isnan(row["fits"])
    laws = pd.read_csv(tmp_path / "laws.csv").set_index(["material", "incidence_deg"])
    x = made.archive.laws["dyke"]
    phi = np.radians(35.0)
    expected = x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2)
    assert laws.loc[("dyke", 35.0), "calibrated_db"] == pytest.approx(expected, rel=1e-12)
    assert not laws.loc["dyke", "known"].any()
    assert laws.loc["dyke", ["median_db", "parameters_model_db"]].isna().all(axis=None)
    # of the other material, which has a posterior
    assert table["parameters_model"].loc["stem beans"].tolist() == [1.8, 2.8, 3.8, 4.8]
    assert table["fits"].loc["stem beans"].tolist() == [True] * 4
    nearest = 1.8 + 2.8 * np.cos(phi) + 3.8 * np.exp(-4.8 * phi**2)
    assert laws.loc[("stem beans", 35.0), "parameters_model_db"] == pytest.approx(nearest, rel=1e-12)


def test_bands_are_known_inside_of_their_interval(made, tmp_path):
    degrees = np.arange(20.0, 26.0)
    middle, low, high = -10.0 - degrees, -11.0 - degrees, -8.0 - degrees
    curve = Curve(degrees, middle, low, high, np.full(6, 0.3), middle, low + 0.1, high - 0.1)
    known = posterior(curve=curve, known_between_deg=(21.5, 24.0))
    made.exported(tmp_path, changed_material(made.archive, "dyke", posterior=known))
    laws = pd.read_csv(tmp_path / "laws.csv").query("material == 'dyke'")
    assert laws["known"].tolist() == [False, False, True, True, True, False]
    assert laws[["median_db", "p05_db", "p95_db"]].iloc[2].tolist() == [-32.0, -33.0, -30.0]
    row = pd.read_csv(tmp_path / "parameters.csv").query("material == 'dyke'").iloc[1]
    assert row[["p05", "p95", "known_from_deg", "known_to_deg"]].tolist() == [2.0, 3.9, 21.5, 24.0]


def test_calibrated_materials(made, tmp_path):
    looks = np.full(made.archive.runs.kind.size, 9.0)
    beans = changed_material(made.archive, "stem beans", looks=looks)  # more than the 4 of the image: no texture
    looks = np.where(np.arange(looks.size) == made.archive.materials["dyke"].best, 2.75, 1.5)
    archive = changed_material(beans, "dyke", looks=looks)
    materials = json.loads(archive.config)["materials"]
    materials["dyke"]["colour"] = "#8A5A2B"
    archive = configured(archive, materials=materials)
    made.exported(tmp_path, archive)
    text = (tmp_path / "calibrated.yaml").read_text()
    found = yaml.safe_load(text)["materials"]
    assert text.startswith("# Materials of the case small, as radcal calibrated them: sigma0 of 2 materials")
    assert list(found) == ["dyke", "stem beans", "unused"]
    assert found["dyke"]["looks"] == 2.75
    assert {name: item.get("colour") for name, item in found.items()} == {
        "dyke": "#8A5A2B", "stem beans": None, "unused": None,
    }  # fmt: skip
    assert "looks" not in found["stem beans"] | found["unused"]
    assert found["dyke"]["parameters"] == archive.laws["dyke"].tolist()
    assert not any(material["calibrate"] for material in found.values())
    with rasterio.open(tmp_path / "calibrated.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), archive.images.calibrated_db)
    with rasterio.open(tmp_path / "difference.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), archive.images.calibrated_db - archive.measured_db)
    # the image is that of the run with fresh random numbers
    case = STAGES["archive"].of(made.case)
    assert f"calibrated image again, bit for bit, with the noise seed {noise_seed(case, fresh=True)}." in text
    # another program need not give the same image
    program = {"kind": "command", "command": ["sar", "{noise_seed}"], "output": {"file": "image.npy", "scale": "db"}}
    other = calibrated_yaml(configured(archive, simulator=program), {}, "v", 5)
    assert "calibrated image again with the noise seed 5." in other
    repeats = configured(archive, simulator={**program, "deterministic": True})
    assert "bit for bit" in calibrated_yaml(repeats, {}, "v", 5)
    assert noise_seed(case, fresh=True) != noise_seed(case)


def test_an_external_law_has_parameters_and_no_curve(build_archive, tmp_path):
    made = build_archive(tmp_path / "made", external=True)
    made.exported(tmp_path / "out")
    assert set(pd.read_csv(tmp_path / "out/laws.csv")["material"]) == {"stem beans"}
    names = pd.read_csv(tmp_path / "out/parameters.csv").query("material == 'dyke'")["parameter"]
    assert names.tolist() == ["mv", "s", "l", "t"]
    found = yaml.safe_load((tmp_path / "out/calibrated.yaml").read_text())["materials"]
    assert (found["dyke"]["law"], found["dyke"]["names"]) == ("external", ["mv", "s", "l", "t"])
    assert found["unused"] == {"calibrate": False, "law": "external", "parameters": []}
    lake = {"calibrate": True, "law": "external", "names": ["p"], "bounds": [[0, 9]]}
    again = case_from({"materials": {**found, "lake": lake}, "simulator": COMMAND, **measured()})
    assert again.materials["dyke"].parameters == made.archive.laws["dyke"].tolist()
