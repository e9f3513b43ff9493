"""Pixels that are masked, and how many for which reason."""

from dataclasses import replace

import numpy as np
import pytest

from radcal.config import Radar, TargetConfig
from radcal.ground.pixels import eligible_pixels, point_targets
from radcal.image.model import Measurement
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.reflectivity import uniform

SHAPE = (200, 200)


def test_every_pixel_is_eligible_or_counted_once(geometry):
    dyke = geometry.pixels("dyke")
    rng = np.random.default_rng(1)

    def some(share):
        return rng.random(geometry.shape) < share

    image = np.where(some(0.1), np.nan, 1.0).astype(np.float32)
    flags = {"point targets": some(0.05)}
    damaged = replace(geometry, layover=some(0.1), shadow=some(0.1))
    found = eligible_pixels("dyke", damaged, Measurement(image, "x"), TargetConfig(margin_px=1), None, flags)
    assert found.pixels.size + sum(found.masked.values()) == dyke.size
    assert list(found.masked) == ["layover", "shadow", "without data", "near other ground", "point targets"]
    assert min(found.masked.values()) > 0
    out = damaged.layover | damaged.shadow | ~np.isfinite(image) | flags["point targets"]
    expected = np.intersect1d(geometry.pixels("dyke", 1), np.flatnonzero(~out))
    np.testing.assert_array_equal(found.pixels, expected)


@pytest.mark.parametrize(("length_px", "more"), [(0.3, 1), (0.9, 2), (1.1, 3)])
def test_an_uncertain_registration_widens_the_margin(geometry, length_px, more):
    """By two standard errors of a component, which is shorter than the length by a root of 2, and half a pixel."""
    image = Measurement(np.ones(geometry.shape, dtype=np.float32), "x")
    uncertainty = np.full(geometry.shape, length_px, dtype=np.float32)
    found = eligible_pixels("dyke", geometry, image, TargetConfig(margin_px=1), uncertainty)
    np.testing.assert_array_equal(found.pixels, geometry.pixels("dyke", 1 + more))


def test_point_target_and_its_surroundings_are_found():
    radar = Radar()
    image = decibels(ImageFormation(radar, SHAPE, -20.0).intensity(uniform(np.full(SHAPE, 10.0, dtype=np.float32)), 1))
    image[60, 80] = 30.0
    image[150, 20] = 14.0  # 4 dB above the mean is speckle
    found = point_targets(image, np.ones(SHAPE, dtype=np.uint8), radar)
    reach = np.indices(SHAPE) - np.array([60, 80])[:, None, None]
    # resolutions of 2.0 and 3.5 m at 1.5 and 2.5 m a pixel
    np.testing.assert_array_equal(found, np.abs(reach).max(axis=0) <= 2)


def test_edges_of_fields_are_no_point_targets():
    radar = Radar()
    material = np.where(np.arange(SHAPE[1]) < 100, 1, 2).astype(np.uint8) * np.ones((SHAPE[0], 1), dtype=np.uint8)
    sigma0 = np.where(material == 1, 0.1, 10.0).astype(np.float32)
    image = decibels(ImageFormation(radar, SHAPE, -20.0).intensity(uniform(sigma0), 2))
    assert not point_targets(image, material, radar)[:, 104:].any()
