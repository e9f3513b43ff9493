"""Measured images with a place on the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from rasterio.transform import from_origin
from safe_product import write_product

from radcal.checking.outlook import is_on_map
from radcal.config import FileMeasurement

pytestmark = [
    pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning"),
    pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning"),  # of rasterio about affine
]


def test_products_and_rasters_with_a_place_are_on_the_map(tmp_path: Path) -> None:
    safe = write_product(tmp_path)
    values = np.ones((4, 5), dtype=np.float32)
    place = {"crs": "EPSG:32631", "transform": from_origin(6e5, 5.8e6, 20.0, 20.0)}
    for name, where in (("placed.tif", place), ("plain.tif", {})):
        write_raster(tmp_path / name, values, **where)
    np.save(tmp_path / "plain.npy", values)
    found = {
        path.name: is_on_map(FileMeasurement(path=str(path), scale="db", radiometry="sigma0_ref"))
        for path in (tmp_path / "placed.tif", tmp_path / "plain.tif", tmp_path / "plain.npy")
    }
    assert found == {"placed.tif": True, "plain.tif": False, "plain.npy": False}
    assert is_on_map(FileMeasurement(path=str(safe)))
