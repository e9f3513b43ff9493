"""Positions in a ground-range image against places that were solved for, and against a real product's own grid."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from pyproj import Geod, Transformer
from safe_product import LINES, NAME, PIXELS, STEM, place_of, radar_at, write_product

from radcal.radar.earth import heading_at_scene
from radcal.sentinel1.annotation import annotation_of


@pytest.fixture(scope="module")
def annotation(tmp_path_factory):
    safe = write_product(tmp_path_factory.mktemp("product"))
    return annotation_of(etree.parse(safe / f"annotation/{STEM}.xml").getroot())


@pytest.mark.parametrize("height", [0.0, 800.0, -150.0])
def test_places_lead_back_to_their_pixels(annotation, height):
    line = np.array([0.0, 13.4, 60.0, 119.2])
    pixel = np.array([70.0, 2.3, 50.6, 98.9])
    places = np.array([place_of(a, b, height) for a, b in zip(line, pixel, strict=True)]).T
    found = annotation.ground.positions(*places, np.full(4, height))
    np.testing.assert_allclose(found[0], line, atol=0.01)
    np.testing.assert_allclose(found[1], pixel, atol=0.01)


def test_the_image_ends_half_a_pixel_beyond_its_outer_centres(annotation):
    inside = [(-0.4, 50.0), (LINES - 0.6, 50.0), (60.0, -0.4), (60.0, PIXELS - 0.6)]
    outside = [(-0.6, 50.0), (LINES - 0.4, 50.0), (60.0, -0.6), (60.0, PIXELS - 0.4)]
    for ends, shown in ((inside, True), (outside, False)):
        places = np.array([place_of(*end) for end in ends]).T
        found = np.stack(annotation.ground.positions(*places, np.zeros(4)), axis=-1)
        assert np.isfinite(found).all(axis=1).tolist() == [shown] * 4
        if shown:
            np.testing.assert_allclose(found, ends, atol=0.01)


def test_positions_do_not_depend_on_where_the_search_begins(annotation):
    """It begins at the middle of the image, here 15 s later; polynomials may count from other slant ranges."""
    ground = annotation.ground
    line, pixel = np.array([5.0, 110.0]), np.array([20.0, 90.0])
    places = np.array([place_of(a, b) for a, b in zip(line, pixel, strict=True)]).T
    later = replace(ground, shape=(20_000, PIXELS))
    moved = replace(
        ground, near_m=ground.near_m + [0.0, 100.0], coefficients=ground.coefficients + [[0.0, 0.0], [160.0, 0.0]]
    )
    for one in (later, moved):
        found = one.positions(*places, np.zeros(2))
        np.testing.assert_allclose(found, [line, pixel], atol=0.01)


def test_places_outside_have_no_position(annotation):
    inside = np.array(place_of(60.0, 50.0))
    far = inside[:, None] + np.array([[0.0, 1.0, 0.0, 90.0], [0.0, 0.0, 0.1, 0.0]])
    line, _ = annotation.ground.positions(*far, np.zeros(4))
    assert np.isfinite(line).tolist() == [True, False, False, False]


def test_look_agrees_with_geodesics_and_triangles(annotation):
    longitude, latitude = place_of(30.0, 80.0)
    look = annotation.ground.look(np.array([longitude]), np.array([latitude]), np.zeros(1))
    time = 30.0 * annotation.ground.line_s
    radar = radar_at(time)
    below = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*radar)
    _, to_radar, _ = Geod(ellps="WGS84").inv(below[0], below[1], longitude, latitude)  # from the place, back
    assert look.right[0]
    assert (look.heading_deg[0] + 90.0) % 360.0 == pytest.approx((to_radar + 180.0) % 360.0, abs=0.05)
    assert look.altitude_m[0] == pytest.approx(below[2], abs=1e-3)
    # sphere through the place: cosine rule with the distances from the earth's centre
    place = np.array(Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(longitude, latitude, 0.0))
    own, ray = np.linalg.norm(place), np.linalg.norm(radar - place)
    angle = np.degrees(np.arccos((radar @ radar - own**2 - ray**2) / (2.0 * own * ray)))
    assert look.incidence_deg[0] == pytest.approx(angle, abs=0.25)  # the ellipsoid's normal is 0.19 deg off the radius


@pytest.mark.skipif("RADCAL_DATA" not in os.environ, reason="RADCAL_DATA is not set: real data are elsewhere")
def test_a_real_product_agrees_with_its_own_grid():
    safe = Path(os.environ["RADCAL_DATA"]) / "sentinel1" / NAME
    root = etree.parse(safe / f"annotation/{STEM}.xml").getroot()
    annotation = annotation_of(root)
    line, pixel, longitude, latitude, height = annotation.grid.T
    found = annotation.ground.positions(longitude, latitude, height)
    known = np.isfinite(found[0])
    assert known.mean() > 0.9
    assert np.abs(found[0] - line)[known].max() < 0.3
    assert np.abs(found[1] - pixel)[known].max() < 0.7
    own = np.array([float(point.findtext("incidenceAngle")) for point in root.iter("geolocationGridPoint")])
    look = annotation.ground.look(longitude, latitude, height)
    angle = look.incidence_deg
    # the annotated angle counts from the direction to the earth's centre, which is 0.19 deg off the ellipsoid's normal
    assert 0.02 < (angle - own).max() < 0.05
    place = np.array(
        Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(longitude, latitude, height)
    )
    ray = annotation.ground._orbit(annotation.ground._zero_doppler(place.T)) - place.T
    central = (place.T * ray).sum(axis=1) / np.linalg.norm(place, axis=0) / np.linalg.norm(ray, axis=1)
    assert np.abs(np.degrees(np.arccos(central)) - own).max() < 0.003
    # the annotated heading is that below the satellite, 2.7 to 4.7 degrees from the heading at the place
    platform = float(root.findtext(".//platformHeading"))
    places = zip(angle, look.altitude_m, latitude, strict=True)
    at_place = np.array([heading_at_scene(platform, *one) for one in places])
    assert np.abs((platform - look.heading_deg) % 360.0 - 3.7).max() < 1.5
    assert np.abs((at_place - look.heading_deg + 180.0) % 360.0 - 180.0).max() < 0.4
    assert annotation.ground.shape == (16705, 26102)
    assert annotation.ground.shape != (LINES, PIXELS)
