"""Wrong variants of the radius of the earth, and of aspect."""

import numpy as np
from pyproj import CRS, Geod
from variants import agrees

from radcal.scene.crs import earth_radius_m, transformer
from radcal.scene.objects import Objects

UTM = CRS.from_epsg(32632)
LONGITUDE, LATITUDE = 7.3, 51.6
GEOD = Geod(ellps="WGS84")


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
