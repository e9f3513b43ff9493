"""Readers by the path of a file, and what they say before an image is read."""

import pytest

from radcal.reading.base import READERS, reader_of


@pytest.mark.parametrize(
    ("path", "name", "radiometry"),
    [
        ("/data/S1A_IW_GRDH_1SDV.SAFE/", "sentinel1", "sigma0_ref"),
        ("${DATA}/S1A_IW_GRDH_1SDV.SAFE/manifest.safe", "sentinel1", "sigma0_ref"),
        ("S1A_IW_GRDH_1SDV.SAFE/measurement/a.tiff", "raster", None),
        ("safe", "raster", None),
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
