"""Numbers of a file to dB, with counts and limits at their boundaries."""

from dataclasses import replace

import numpy as np
import pytest
from raster_files import file_to_read

from radcal.errors import MeasurementError
from radcal.reading.images import check_header, to_db
from radcal.reading.intake import LARGEST_VALUES


def file(scale="power", **fields):
    return replace(file_to_read("image.tif", scale), **fields)


def test_each_kind_of_value_without_power_is_counted_once():
    values = np.full((20, 30), 5.0)
    values[0, :4], values[1, :3], values[2, :2] = np.nan, 0.0, -1.0
    image, counts = to_db(values, file())
    assert (counts.pixels, counts.no_data, counts.zero, counts.negative, counts.impossible) == (600, 4, 3, 2, 0)
    assert np.count_nonzero(np.isnan(image)) == 9
    levels = np.log10(values, where=values > 0, out=np.full(values.shape, -np.inf)) * 10
    levels[0, :4] = np.nan
    _, in_db = to_db(levels, file("db"))
    assert (in_db.no_data, in_db.zero) == (4, 5)


@pytest.mark.parametrize(("negative", "refused"), [(3, False), (4, True)])
def test_one_in_a_hundred_known_values_may_be_negative(negative, refused):
    values = np.full((20, 30), 5.0)
    values[10:] = np.nan  # 300 are known
    values[0, :negative] = -1.0
    if refused:
        with pytest.raises(MeasurementError, match=r"4 of 300 values of image\.tif are negative, which power cannot"):
            to_db(values, file())
    else:
        assert to_db(values, file())[1].negative == 3


def test_the_largest_level_is_allowed_and_the_worst_beyond_it_named():
    values = np.array([[200.0, -200.0, 1.0]])
    np.testing.assert_array_equal(to_db(values, file("db"))[0], values)
    values = np.array([[201.0, -350.0, 1.0, 250.0]])
    with pytest.raises(MeasurementError, match=r"image\.tif holds -350 dB and 3 of 4 values like it"):
        to_db(values, file("db"))
    # a share of them is masked
    image, counts = to_db(values, file("db", impossible_share=0.75))
    assert np.isnan(image).tolist() == [[True, True, False, True]]
    assert counts.impossible == 3


@pytest.mark.parametrize(
    ("shape", "ending"), [((4, 3), ": turn it."), ((3, 5), ": resize it."), ((4, 4), ": resize it.")]
)
def test_an_image_of_another_shape_is_told_what_to_do(shape, ending):
    known = file(shape=(3, 4), turned=": turn it", resized=": resize it")
    check_header(known, (3, 4), np.dtype("f4"))
    said = rf"image\.tif has {shape[0]} x {shape[1]} pixels, the scene's image 3 x 4{ending}"
    with pytest.raises(MeasurementError, match=said):
        check_header(known, shape, np.dtype("f4"))


def test_the_largest_image_is_allowed():
    check_header(file(), (LARGEST_VALUES // 100, 100), np.dtype("f4"))
    with pytest.raises(MeasurementError, match="1000000 x 101 pixels, expected at most 1e"):
        check_header(file(), (LARGEST_VALUES // 100, 101), np.dtype("f4"))
