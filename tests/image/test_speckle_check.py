"""Repeated pixels against resampling by known factors."""

import numpy as np
import pytest

from radcal.config import Radar
from radcal.image.speckle_check import check_speckle, repeated_pixels, sides_m
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.reflectivity import uniform

SPECKLE = (10.0 * np.log10(np.random.default_rng(3).gamma(4.0, 0.25, (160, 200)))).astype(np.float32)


@pytest.mark.parametrize(("down", "across"), [(1.6, 1.0), (1.0, 3.0), (2.0, 1.25)])
def test_shares_are_those_of_the_factors(down, across):
    rows, columns = ((np.arange(n) / factor).astype(int) for n, factor in ((160, down), (200, across)))
    image = SPECKLE[np.ix_(rows, columns)]
    image[50:60, 30:90] = np.nan  # gaps are no repetitions
    found = repeated_pixels(image)
    assert found == pytest.approx([1.0 - 1.0 / down, 1.0 - 1.0 / across], abs=0.01)
    radar = Radar(range_spacing_m=1.5, azimuth_spacing_m=2.5)
    sides = [spacing * factor * (factor > 1.0) for spacing, factor in ((1.5, down), (2.5, across))]
    np.testing.assert_allclose(sides_m(found, radar), sides, rtol=0.03)


def test_equal_values_by_chance_and_constant_images_are_no_repetitions():
    assert repeated_pixels(SPECKLE) is None
    assert repeated_pixels(np.round(2.0 * SPECKLE) / 2.0) is None  # steps of 0.5 dB
    assert repeated_pixels(np.zeros((160, 200), np.float32)) is None
    assert repeated_pixels(np.full((160, 200), np.nan, np.float32)) is None


def test_a_clean_image_with_repeated_pixels_is_not_called_coarse_or_textured():
    given = {"range_resolution_m": 4.0, "azimuth_resolution_m": 6.5}
    shape, taken = (100, 120), np.ix_(np.arange(200) // 2, np.arange(240) // 2)
    before = Radar(range_spacing_m=3.0, azimuth_spacing_m=5.0, **given)
    level = uniform(np.ones(shape, np.float32))
    image_db = decibels(ImageFormation(before, shape, -30.0).intensity(level, 1))[taken]
    radar = Radar(range_spacing_m=1.5, azimuth_spacing_m=2.5, **given)
    found = check_speckle(image_db, np.ones(image_db.shape, np.uint8), radar, "a.tif", "db")
    assert found[0].code == "pixels_repeated"
    assert found[0].numbers == pytest.approx({"range_percent": 50.0, "azimuth_percent": 50.0}, abs=0.5)
    assert all(one.severity == "note" for one in found)
    assert {one.code for one in found}.isdisjoint({"looks_fewer", "resolutions"})
