"""Wrong variants of coordinates: order of axes, heading, radius of the earth, scale of a grid, aspect, slant range."""

import numpy as np
import pytest
from pyproj import CRS, Geod, Transformer
from variants import agrees

from radcal.scene.crs import earth_radius_m, transformer, turned
from radcal.scene.grid import _common, _empty
from radcal.scene.objects import Objects
from radcal.scene.raster import _slope_error_deg, rounding_error_m
from radcal.scene.slant_range import flat_incidence_deg

UTM = CRS.from_epsg(32632)
LONGITUDE, LATITUDE = 7.3, 51.6
GEOD = Geod(ellps="WGS84")


def test_coordinates_are_longitude_and_latitude_whatever_the_order_of_the_authority():
    """EPSG 4326 names the latitude first; the place is found by the length of its meridian and parallel."""
    x, y = transformer(CRS.from_epsg(4326), UTM).transform(LONGITUDE, LATITUDE)
    meridian = GEOD.inv(9.0, 0.0, 9.0, LATITUDE)[2] * 0.9996
    parallel = GEOD.inv(9.0, LATITUDE, LONGITUDE, LATITUDE)[2] * 0.9996
    agrees(
        [x, y],
        [5e5 - parallel, meridian],
        rtol=1e-3,
        axes=[y, x],
        west=[5e5 + parallel, meridian],
        no_offset=[-parallel, meridian],
    )


@pytest.mark.parametrize("heading", [12.0, 104.0, 349.0, 194.0])
def test_second_axis_points_along_the_track_and_the_first_to_its_right(heading):
    place = transformer(UTM.geodetic_crs, UTM).transform(LONGITUDE, LATITUDE)
    track = turned(UTM, place, heading)
    change = Transformer.from_crs(UTM.geodetic_crs, track, always_xy=True)
    ends = []
    for bearing in (heading, heading + 90.0):
        longitude, latitude, _ = GEOD.fwd(LONGITUDE, LATITUDE, bearing, 1000.0)
        ends.append(change.transform(longitude, latitude))
    agrees(
        ends,
        [[0.0, 1000.0], [1000.0, 0.0]],
        atol=0.5,
        rtol=0.0,
        axes=[[1000.0, 0.0], [0.0, 1000.0]],
        left=[[0.0, 1000.0], [-1000.0, 0.0]],
        backwards=[[0.0, -1000.0], [-1000.0, 0.0]],
        other_turn=[[1000.0 * np.sin(2 * np.radians(heading)), 1000.0 * np.cos(2 * np.radians(heading))], [0.0, 0.0]],
    )


def test_radius_of_curvature_along_a_direction():
    place = transformer(UTM.geodetic_crs, UTM).transform(LONGITUDE, LATITUDE)
    sine, e2 = np.sin(np.radians(LATITUDE)), GEOD.es
    vertical = GEOD.a / np.sqrt(1.0 - e2 * sine**2)
    meridian = vertical * (1.0 - e2) / (1.0 - e2 * sine**2)
    for azimuth in (0.0, 90.0, 30.0):
        c2 = np.cos(np.radians(azimuth)) ** 2
        right = 1.0 / (c2 / meridian + (1.0 - c2) / vertical)
        wrong = {
            "mean_sphere": 6_371_008.8,
            "degrees": 1.0 / (np.cos(azimuth) ** 2 / meridian + np.sin(azimuth) ** 2 / vertical),
        }
        exchanged = 1.0 / ((1.0 - c2) / meridian + c2 / vertical)
        found = earth_radius_m("EPSG:32632", place, azimuth)
        agrees(found, right, rtol=1e-7, exchanged=exchanged, semi_major=GEOD.a, **(wrong if azimuth == 30.0 else {}))


def test_cross_section_by_the_bearing_from_the_front():
    curve = np.array([[0.0, 3.0], [100.0, 21.0], [230.0, -4.0], [300.0, 9.0]])
    zeros, first = np.zeros(1), np.zeros(1, np.int16)
    heading, unknown = np.array([50.0]), np.array([np.nan])
    car = Objects(zeros, zeros, zeros, zeros, heading, zeros, unknown, first, curves={"car": curve})
    table = np.vstack([curve, [360.0, 3.0]])
    at = {bearing: float(np.interp(bearing % 360.0, *table.T)) for bearing in (-40.0, 60.0, 10.0, 140.0)}
    right = 10.0 ** (at[-40.0] / 10.0)
    agrees(
        car.cross_section_m2(10.0),
        [right],
        sum_of_angles=[10.0 ** (at[60.0] / 10.0)],
        north=[10.0 ** (at[10.0] / 10.0)],
        from_behind=[10.0 ** (at[140.0] / 10.0)],
        amplitude=[10.0 ** (at[-40.0] / 20.0)],
        not_periodic=[10.0**0.9],
        linear=[np.interp(320.0, table[:, 0], 10.0 ** (table[:, 1] / 10.0))],
    )


def test_errors_of_heights_and_slopes():
    agrees(
        rounding_error_m(2.0),
        np.std(np.linspace(-1.0, 1.0, 100_001)),
        rtol=1e-4,
        step=2.0,
        half=1.0,
        difference=2.0 / np.sqrt(6.0),
    )
    right = np.degrees(np.arctan(np.sqrt(2.0) * np.hypot(1.5, 2.0 / np.sqrt(12.0)) / 10.0))
    agrees(
        _slope_error_deg(1.5, 2.0, 10.0)[0],
        right,
        radians=np.radians(right),
        one_height=np.degrees(np.arctan(np.hypot(1.5, 2.0 / np.sqrt(12.0)) / 10.0)),
        sum_of_errors=np.degrees(np.arctan(np.sqrt(2.0) * (1.5 + 2.0 / np.sqrt(12.0)) / 10.0)),
        no_rounding=np.degrees(np.arctan(np.sqrt(2.0) * 0.15)),
    )


def test_rows_are_equal_steps_of_slant_range():
    slant = np.linspace(1.0 / np.cos(np.radians(25.0)), 1.0 / np.cos(np.radians(48.0)), 7)
    ground = np.linspace(*np.tan(np.radians([25.0, 48.0])), 7)
    agrees(
        flat_incidence_deg(25.0, 48.0, 7),
        np.degrees(np.arccos(1.0 / slant)),
        equal_angles=np.linspace(25.0, 48.0, 7),
        ground_range=np.degrees(np.arctan(ground)),
        depression=np.degrees(np.arcsin(1.0 / slant)),
        backwards=np.degrees(np.arccos(1.0 / slant))[::-1],
    )


def test_boxes_side_by_side_have_nothing_in_common_in_either_direction():
    """West, south, east and north [m]; northings are larger than eastings, as in UTM."""
    here = (600.0, 5000.0, 700.0, 5100.0)
    for other, empty in (
        ((650.0, 5050.0, 800.0, 5200.0), False),
        ((710.0, 5000.0, 800.0, 5100.0), True),
        ((600.0, 5110.0, 700.0, 5200.0), True),
    ):
        assert _empty(_common(here, other)) is _empty(_common(other, here)) is empty
