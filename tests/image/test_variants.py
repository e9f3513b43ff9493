"""Wrong variants of the directions of a measured image's look."""

import numpy as np
from variants import agrees

from radcal.image.acquisition import Acquisition, _apart, _turned_deg, look_azimuth_deg


def acquisition(side):
    return Acquisition(
        "S1.SAFE", "S1B IW GRD", "2020", "ascending", 349.5, side, 38.0, 7e5, 5.405e9, "VV", 4.4, (5, 1), 10.0,
        9.0, 3.1, 22.0, ((30.0, -24.0), (45.0, -22.0)), False,
    )  # fmt: skip


def test_directions():
    agrees(look_azimuth_deg(acquisition("right")), 79.5, left=259.5, flight=349.5, unturned=439.5, below_satellite=76.0)
    agrees(look_azimuth_deg(acquisition("left")), 259.5, right=79.5, flight=349.5)
    agrees([_apart(350.0, 20.0), _apart(10.0, 200.0)], [30.0, 170.0], plain=[330.0, 190.0], signed=[-30.0, 170.0])
    # the cosine between aspect and look changes most for aspects at right angles to the middle of two looks
    aspect = np.radians(np.arange(0.0, 360.0, 0.1))
    most = np.abs(4.0 * (np.cos(aspect) - np.cos(aspect - np.radians(50.0)))).max()
    agrees(
        _turned_deg(4.0, 50.0),
        most,
        rtol=1e-5,
        along_the_slope=4.0 * (1.0 - np.cos(np.radians(50.0))),
        whole_angle=4.0 * np.sin(np.radians(50.0)),
        half=2.0 * np.sin(np.radians(25.0)),
        degrees=8.0 * np.sin(25.0),
    )
