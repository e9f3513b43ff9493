"""Sizes of facets and pixels in closed form."""

import math

import pytest

from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.radar import size
from radcal.radar.size import check_size, image_size, refinement
from radcal.scene.base import SceneSize


@pytest.mark.parametrize(
    ("cell_m", "depression", "parts"),
    [(5.0, 30.0, 3), (5.0, 75.0, 2), (5.2, 30.0, 4), (1.7, 30.0, 1), (2.5, 75.0, 1), (2.51, 75.0, 2)],
)  # a row is 1.5 m / cos(30 deg) = 1.73 m wide on the ground at 30 degrees and 5.8 m at 75, a column 2.5 m
def test_facets_are_no_larger_than_a_pixel_on_the_ground(cell_m, depression, parts):
    assert refinement(cell_m, Radar(depression_deg=depression)) == parts


def test_facets_and_pixels_of_a_scene():
    found = image_size(SceneSize(1000, 4.0, 1000), Radar(depression_deg=30.0))
    assert found.facets == 1000 * 3**2
    assert found.pixels == math.ceil(1000 * 4.0**2 * math.cos(math.radians(30.0)) / (1.5 * 2.5))
    slant = image_size(SceneSize(77, None, 77), Radar())
    assert (slant.facets, slant.pixels) == (77, 77)


def test_the_largest_size_is_allowed(monkeypatch):
    scene, radar = SceneSize(1000, 4.0, 1000), Radar(depression_deg=30.0)
    monkeypatch.setattr(size, "_LARGEST", 9000)
    check_size(scene, radar)
    monkeypatch.setattr(size, "_LARGEST", 8999)
    with pytest.raises(ConfigError, match=r"9,000 facets and 3,696 pixels, expected at most 8,999"):
        check_size(scene, radar)
