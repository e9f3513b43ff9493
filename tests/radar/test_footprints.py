"""Boxes and points on the ground against closed forms: slopes in both directions, both look sides, any heading."""

import numpy as np
import pytest
from geometry_samples import objects_of

from radcal.config import Radar
from radcal.radar.footprints import raise_boxes, to_boxes_and_spots
from radcal.radar.geometry import PointScatterers
from radcal.radar.points import not_pure
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene

ROWS, COLUMNS, CELL_M = 24, 36, 3.0
NORTH, EAST = (np.arange(ROWS)[:, None] + 0.5) * CELL_M, (np.arange(COLUMNS) + 0.5) * CELL_M


@pytest.mark.parametrize("look_side", ["right", "left"])
@pytest.mark.parametrize("radiometry", ["sigma0_local", "sigma0_ref", "beta0", "gamma0"])
@pytest.mark.parametrize(("x", "y", "height"), [(40.3, 30.1, 0.0), (71.9, 47.2, 4.5)])
def test_point_on_a_slope_has_the_slant_range_of_its_place_and_its_energy(x, y, height, look_side, radiometry):
    elevation = 0.21 * EAST - 0.34 * NORTH
    given = {"look_side": look_side, "radiometry": radiometry}
    radar = Radar(altitude_m=800.0, range_spacing_m=1.1, azimuth_spacing_m=2.1, **given)
    point = objects_of(x_m=x, y_m=y, height_m=height, rcs_dbsm=7.0)
    scene = Scene("slope", ("a",), np.ones((ROWS, COLUMNS), np.uint8), elevation, CELL_M, objects=point)
    geometry = make_geometry(scene, radar)
    track = elevation.mean() + 800.0
    middle = COLUMNS * CELL_M / 2
    away = 800.0 + (x - middle if look_side == "right" else middle - x)
    slant = np.hypot(away, track - (0.21 * x - 0.34 * y) - height)
    assert geometry.point_column[0] == pytest.approx(y / 2.1 - 0.5, abs=1e-9)
    # rows' middles are a pixel apart in slant range, and the point lies among them
    slants = 800.0 / np.cos(np.radians(geometry.flat_incidence_deg))
    np.testing.assert_allclose(np.diff(slants), 1.1, rtol=1e-6)
    assert np.interp(slant, slants, np.arange(slants.size)) == pytest.approx(geometry.point_row[0], abs=1e-4)
    theta = np.arccos(800.0 / slant)
    area = 1.1 * 2.1 * {"beta0": 1.0, "gamma0": 1.0 / np.tan(theta)}.get(radiometry, 1.0 / np.sin(theta))
    assert geometry.point_amplitude[0] ** 2 * area == pytest.approx(10**0.7, rel=1e-4)


@pytest.mark.parametrize("look_side", ["right", "left"])
@pytest.mark.parametrize(("length", "width", "heading"), [(18.0, 6.0, 30.0), (9.0, 15.0, 115.0), (12.0, 7.0, 245.0)])
def test_roof_stands_on_the_mean_of_its_ground(length, width, heading, look_side):
    """On a saddle z = c x y the mean over a rectangle has a closed form, in which length and width differ in sign."""
    c, x, y = 0.01, 61.0, 37.0
    elevation = c * EAST * NORTH
    shown = elevation if look_side == "right" else elevation[:, ::-1]
    box = objects_of(x_m=x, y_m=y, length_m=length, width_m=width, heading_deg=heading, height_m=2.5, rcs_dbsm=13.0)
    boxes, spots = to_boxes_and_spots(box, np.ascontiguousarray(shown), look_side, 3, CELL_M / 3, np.full(1, 10**1.3))
    assert not spots.height_m.size
    # 5 x 5 samples in the middles of equal parts: their mean square is 0.32 of the half length's
    turn = np.radians(heading)
    expected = c * (x * y + 0.32 * ((length / 2) ** 2 - (width / 2) ** 2) * np.sin(turn) * np.cos(turn)) + 2.5
    assert boxes.top_m[0] == pytest.approx(expected, abs=1e-9)
    assert boxes.rcs_m2[0] == pytest.approx(10**1.3)


@pytest.mark.parametrize("heading", [0.0, 25.0, 120.0])
@pytest.mark.parametrize("look_side", ["right", "left"])
def test_footprint_covers_its_rectangle(look_side, heading):
    box = objects_of(x_m=50.2, y_m=33.7, length_m=30.0, width_m=8.0, heading_deg=heading, height_m=3.0)
    boxes, _ = to_boxes_and_spots(box, np.zeros((ROWS, COLUMNS)), look_side, 3, 1.0, np.ones(1))
    found = raise_boxes(boxes, np.zeros((3 * ROWS, 3 * COLUMNS)), 0)[0] == 0
    north, east = np.mgrid[0 : 3 * ROWS, 0 : 3 * COLUMNS] + 0.5
    if look_side == "left":
        east = COLUMNS * CELL_M - east
    turn = np.radians(heading)  # from north to east
    along = (east - 50.2) * np.sin(turn) + (north - 33.7) * np.cos(turn)
    beside = (east - 50.2) * np.cos(turn) - (north - 33.7) * np.sin(turn)
    np.testing.assert_array_equal(found, (np.abs(along) <= 15.0) & (np.abs(beside) <= 4.0))


def test_pixels_of_a_points_main_lobe_are_of_no_material():
    radar = Radar(range_resolution_m=2.0, range_spacing_m=1.0, azimuth_resolution_m=6.0, azimuth_spacing_m=1.5)
    material = np.ones((20, 30), dtype=np.uint8)
    not_pure(
        PointScatterers(np.array([9.0]), np.array([14.0]), np.ones(1, np.float32), np.zeros(1, np.uint32)),
        radar,
        material,
    )
    expected = np.ones_like(material)
    expected[6:13, 8:21] = 0  # 1.5 widths: 3 rows and 6 columns, the edges belong to it
    np.testing.assert_array_equal(material, expected)
