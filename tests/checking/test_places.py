"""Measured images of another place, in cases with mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from radcal.checking.case_check import check_case

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")  # of rasterio about affine

CASE = """
scene: {source: raster, elevation: dem.tif, materials: cover.tif, landcover: esa_worldcover, vertical_datum: FILL_IN}
measurement: {source: file, path: IMAGE, scale: FILL_IN, radiometry: sigma0_ref}
radar: {altitude_m: 4000, depression_deg: 45, range_resolution_m: 20, azimuth_resolution_m: 28, range_spacing_m: 14,
  azimuth_spacing_m: 20, looks: 4, nesz_db: -40}
materials: {tree_cover: {calibrate: true}}
"""


@pytest.mark.parametrize(
    ("west", "north", "apart"),
    [
        (6e5, 5.8e6, False),
        (6.0079e5, 5.8e6, False),  # a common strip of 10 m
        (6.1e5, 5.8e6, True),
        (6e5, 5.79e6, True),
    ],
)
def test_an_image_of_another_place_is_told_beside_open_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, west: float, north: float, apart: bool
) -> None:
    """Rasters of 600 m times 800 m."""
    monkeypatch.chdir(tmp_path)
    for name, crs, x, y, values in (
        ("dem.tif", "EPSG:32631", 6e5, 5.8e6, np.zeros((30, 40), np.float32)),
        ("cover.tif", "EPSG:32631", 6e5, 5.8e6, np.full((30, 40), 10, np.uint8)),
        ("image.tif", "EPSG:32631", west, north, np.ones((30, 40), np.float32)),
        ("plain.tif", None, 0.0, 0.0, np.ones((30, 40), np.float32)),
    ):
        settings = {"height": 30, "width": 40, "count": 1, "dtype": values.dtype, "driver": "GTiff"}
        where = {} if crs is None else {"crs": crs, "transform": from_origin(x, y, 20.0, 20.0)}
        with rasterio.open(name, "w", **settings, **where) as raster:
            raster.write(values, 1)
    Path("mine.yaml").write_text(CASE.replace("IMAGE", "image.tif"))
    said = [text for text in check_case(["mine.yaml"]).problems if "FILL_IN" not in text]
    assert len(said) == apart
    if apart:
        assert said[0].startswith("measurement.path: image.tif lies at longitude 4.")
        assert ", and scene.elevation: dem.tif at longitude 4.4" in said[0]
        assert said[0].endswith("latitude 52.336 to 52.341: expected an image of the same area.")
    # once, where the image is put on the ground
    keys = {"scene": {"vertical_datum": "EGM2008"}, "measurement": {"scale": "db"}, "stop": {"rms": "small"}}
    said = [text for text in check_case(["mine.yaml"], keys).problems if "of the same area" in text]
    assert len(said) == 1 if apart else len(said) <= 1  # the strip of 10 m is no part of the simulated image
    assert not apart or "covers no place of the scene's image" in said[0]
    Path("mine.yaml").write_text(CASE.replace("IMAGE", "plain.tif"))
    assert not any("same area" in text for text in check_case(["mine.yaml"]).problems)
