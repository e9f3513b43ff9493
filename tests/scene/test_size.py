"""Sizes of scenes before they are made."""

import json

import numpy as np
from affine import Affine
from raster_files import write_raster

from radcal.config import RasterScene, SlantRangeScene
from radcal.scene.base import SceneSize, scene_size
from radcal.sections.scene import BuiltinScene


def write(path, shape, pixel_m, crs):
    transform = Affine(pixel_m, 0.0, 600_000.0, 0.0, -pixel_m, 5_780_000.0) if crs else Affine.identity()
    return str(write_raster(path, np.ones(shape, dtype=np.uint8), crs=crs, transform=transform))


def test_size_of_rasters_is_that_of_the_finer_one_in_cells(tmp_path):
    (tmp_path / "names.json").write_text(json.dumps({"1": "grass"}))
    config = RasterScene(
        elevation=write(tmp_path / "heights.tif", (40, 30), 10.0, "EPSG:32631"),
        materials=write(tmp_path / "ids.tif", (80, 60), 5.0, "EPSG:32631"),
        names=str(tmp_path / "names.json"), vertical_datum="EGM96", cell_m=20.0,
    )  # fmt: skip
    # 20 x 15 cells, each of 2 x 2 heights and 4 x 4 ids
    assert scene_size(config) == SceneSize(300, 20.0, 300 * 16)


def test_size_of_labels_and_of_the_built_in_scene(tmp_path):
    (tmp_path / "names.json").write_text(json.dumps({"1": "grass"}))
    labels = SlantRangeScene(
        labels=write(tmp_path / "labels.tif", (12, 7), 1.0, None), names=str(tmp_path / "names.json"),
        near_incidence_deg=20.0, far_incidence_deg=40.0,
    )  # fmt: skip
    assert scene_size(labels) == SceneSize(84, None, 84)
    assert scene_size(BuiltinScene()) == SceneSize(400 * 400, 5.0, 400 * 400)
