"""Exports: tables, calibrated materials, and images whose places on the map are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import rasterio
import yaml
from archives import changed_check, changed_material

from radcal.assessment.posterior import Curve
from radcal.config import Material, stages
from radcal.radar.texture import texture_order
from radcal.report.export import write_export
from radcal.report.geotiff import SLANT_RANGE, map_grid, pixel_at_cell
from radcal.seeds import noise_seed
from radcal.simulators.texturing import orders_of, with_textures


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


def export(made, folder, archive=None, scene=None, geometry=None):
    archive = made.archive if archive is None else archive
    case = stages.Export.of(made.case)
    return write_export(folder, case, archive, scene or made.scene, geometry or made.geometry)


def test_a_known_corner_lies_at_its_place(made, on_map, tmp_path):
    export(made, tmp_path, scene=on_map[0], geometry=on_map[1])
    measured = made.archive.images.measured_db
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


def test_a_scene_without_a_map_says_so(made, tmp_path):
    files = export(made, tmp_path)
    assert map_grid(made.scene, made.geometry) is None
    with rasterio.open(tmp_path / "measured.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), made.archive.images.measured_db)
        assert raster.crs is None
        assert raster.tags()["grid"] == SLANT_RANGE
    with rasterio.open(tmp_path / "material.tif") as raster:
        assert (raster.nodata, raster.read(1)[0, 0]) == (0, 0)
        assert yaml.safe_load(raster.tags()["materials"]) == {"1": "dyke", "2": "stem beans", "3": "unused"}
    assert {path.name for path in files} == {path.name for path in tmp_path.iterdir()}


def test_tables(made, tmp_path):
    export(made, tmp_path, changed_check(made.archive, "dyke", looks=2.75))
    table = pd.read_csv(tmp_path / "parameters.csv").set_index(["material", "parameter"])
    assert table["calibrated"].loc["dyke"].tolist() == made.archive.laws["dyke"].values.tolist()  # noqa: PD011
    row = table.loc[("dyke", "X4")]
    assert (row["law"], row["lower"], row["upper"], row["looks"]) == ("mangia", 0, 50, 2.75)
    assert np.isnan(row["p05"])
    assert np.isnan(row["fits"])
    laws = pd.read_csv(tmp_path / "laws.csv").set_index(["material", "incidence_deg"])
    x = made.archive.laws["dyke"].values  # noqa: PD011
    phi = np.radians(35.0)
    expected = x[0] + x[1] * np.cos(phi) + x[2] * np.exp(-x[3] * phi**2)
    assert laws.loc[("dyke", 35.0), "calibrated_db"] == pytest.approx(expected, rel=1e-12)
    assert not laws["known"].any()


def test_bands_are_known_inside_of_their_interval(made, tmp_path):
    degrees = np.arange(20.0, 26.0)
    curve = Curve(degrees, -10.0 - degrees, -11.0 - degrees, -8.0 - degrees, np.full(6, 9.0))
    known = _posterior(curve, (21.5, 24.0))
    export(made, tmp_path, changed_material(made.archive, "dyke", posterior=known))
    laws = pd.read_csv(tmp_path / "laws.csv").query("material == 'dyke'")
    assert laws["known"].tolist() == [False, False, True, True, True, False]
    assert laws[["median_db", "p05_db", "p95_db"]].iloc[2].tolist() == [-32.0, -33.0, -30.0]
    row = pd.read_csv(tmp_path / "parameters.csv").query("material == 'dyke'").iloc[1]
    assert row[["p05", "p95", "known_from_deg", "known_to_deg"]].tolist() == [2.0, 4.0, 21.5, 24.0]


def _posterior(curve, known):
    from radcal.assessment.posterior import Posterior

    four, three = np.arange(4.0), np.arange(3.0)
    return Posterior(
        True, 400.0, 1.01, 500, four + 1, four + 2, four + 3, three, three, three, np.array([[20.0, 25.0]]),
        np.eye(4), four, np.array([1.0]), four[None], (), curve, known,
    )  # fmt: skip


def test_calibrated_materials_give_the_exported_image_again(made, tmp_path):
    archive = changed_check(made.archive, "dyke", looks=2.75, looks_nominal=4.0)
    export(made, tmp_path, archive)
    text = (tmp_path / "calibrated.yaml").read_text()
    found = yaml.safe_load(text)["materials"]
    assert text.startswith("# Materials of the case small, as radcal calibrated them: Of 2 materials")
    assert list(found) == ["dyke", "stem beans", "unused"]
    assert found["dyke"]["looks"] == 2.75
    assert "looks" not in found["stem beans"] | found["unused"]
    assert found["dyke"]["parameters"] == archive.laws["dyke"].values.tolist()  # noqa: PD011
    assert not any(material["calibrate"] for material in found.values())
    radar = made.case.radar
    orders = orders_of({name: Material.model_validate(data) for name, data in found.items()}, radar, radar)
    assert orders == {"dyke": texture_order(4, 2.75)}
    seed = noise_seed(made.case, fresh=True)
    again = with_textures(archive.images.calibrated_db, made.geometry, orders, seed)
    with rasterio.open(tmp_path / "calibrated.tif") as raster:
        np.testing.assert_array_equal(raster.read(1), again)
    changed = again != archive.images.calibrated_db
    assert changed[made.geometry.material == 1].mean() > 0.9
    assert not changed[made.geometry.material != 1].any()
