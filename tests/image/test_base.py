"""Readers by the path of a file, and what they say before an image is read."""

import numpy as np
import pytest
from raster_files import write_raster
from rasterio.transform import from_origin
from safe_product import write_product

from radcal.config import FileMeasurement, Radar
from radcal.image.base import opened
from radcal.reading.base import READERS, reader_of

pytestmark = [
    pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning"),
    pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning"),  # of rasterio about affine
]


@pytest.mark.parametrize(
    ("path", "name", "radiometry"),
    [
        ("/data/S1A_IW_GRDH_1SDV.SAFE/", "sentinel1", "sigma0_ref"),
        ("${DATA}/S1A_IW_GRDH_1SDV.SAFE/manifest.safe", "sentinel1", "sigma0_ref"),
        ("gone.NITF", "sicd", None),
        ("a.npy", "array", None),
        ("OPERA_L2_RTC-S1_T093-197867-IW3_20210426T013646Z_S1A_30_v1.0_VH.tif", "raster", "gamma0_rtc"),
        ("image", "raster", None),
    ],
)
def test_the_name_of_a_file_chooses_its_reader(path, name, radiometry):
    reader = reader_of(path)
    assert reader is READERS[name]
    named = reader.named(path)
    assert (named and named.radiometry) == radiometry


def test_products_and_rasters_with_a_place_are_on_the_map(tmp_path):
    safe = write_product(tmp_path)
    values = np.ones((4, 5), dtype=np.float32)
    place = {"crs": "EPSG:32631", "transform": from_origin(6e5, 5.8e6, 20.0, 20.0)}
    for name, where in (("placed.tif", place), ("plain.tif", {})):
        write_raster(tmp_path / name, values, **where)
    np.save(tmp_path / "plain.npy", values)
    keys = {"scale": "db", "radiometry": "sigma0_ref"}
    files = dict.fromkeys(("placed.tif", "plain.tif", "plain.npy"), keys) | {safe.name: {}}
    found = {
        name: opened(FileMeasurement(path=str(tmp_path / name), **more), Radar()).facts().on_map
        for name, more in files.items()
    }
    assert found == {"placed.tif": True, "plain.tif": False, "plain.npy": False, safe.name: True}
