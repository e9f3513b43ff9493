"""Bands and compound numbers, at values that no other band and no conjugate has."""

import h5py
import numpy as np
import pytest
import rasterio
from raster_files import file_to_read

from radcal.errors import MeasurementError
from radcal.reading.arrays import read_array


@pytest.mark.parametrize(("band", "scale", "offset"), [(1, 1.0, 5.0), (2, 3.0, 0.0), (3, 0.5, -2.0)])
def test_scale_and_offset_are_those_of_the_band(tmp_path, band, scale, offset):
    stored = np.arange(24, dtype=np.float32).reshape(3, 2, 4) ** 2
    with rasterio.open(tmp_path / "b.tif", "w", driver="GTiff", width=4, height=2, count=3, dtype="float32") as raster:
        raster.write(stored)
        raster.scales, raster.offsets = (1.0, 3.0, 0.5), (5.0, 0.0, -2.0)
    found = read_array(file_to_read(tmp_path / "b.tif", band=band))
    np.testing.assert_allclose(found, stored[band - 1] * scale + offset)
    with pytest.raises(MeasurementError, match=r"measurement\.band is 4, .*b\.tif has 3\."):
        read_array(file_to_read(tmp_path / "b.tif", band=4))


def test_compound_numbers_have_their_imaginary_part(tmp_path):
    values = np.array([[(1.0, 2.0), (3.0, -4.0)]], dtype=[("real", "f4"), ("imag", "f4")])
    with h5py.File(tmp_path / "c.h5", "w") as written:
        written["slc"] = values
    found = read_array(file_to_read(tmp_path / "c.h5", scale="complex"))
    np.testing.assert_array_equal(found, [[1.0 + 2.0j, 3.0 - 4.0j]])
