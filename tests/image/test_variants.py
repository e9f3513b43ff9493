"""Wrong variants of looks, directions and spacings of a measured image, and of the tables in its annotation."""

import numpy as np
from scipy import stats
from scipy.interpolate import RegularGridInterpolator
from variants import agrees

from radcal.config import Radar
from radcal.image.acquisition import Acquisition, _apart, _turned_deg
from radcal.image.looks import local_looks, looks_of_log_variance
from radcal.sentinel1.annotation import LookUpTable

K = 10.0 / np.log(10.0)


def acquisition(side):
    return Acquisition(
        "S1.SAFE", "S1B IW GRD", "2020", "ascending", 349.5, side, 38.0, 7e5, 5.405e9, "VV", 4.4, (5, 1), 10.0,
        9.0, 3.1, 22.0, ((30.0, -24.0), (45.0, -22.0)), False,
    )  # fmt: skip


def test_directions_and_spacings():
    right, left = acquisition("right"), acquisition("left")
    agrees(right.look_azimuth_deg, 79.5, left=259.5, flight=349.5, unturned=439.5, below_satellite=76.0)
    agrees(left.look_azimuth_deg, 259.5, right=79.5, flight=349.5)
    rad = np.radians(38.0)
    agrees(
        right.slant_spacing_m,
        10.0 * np.sin(rad),
        ground=10.0,
        inverse=10.0 / np.sin(rad),
        cosine=10.0 * np.cos(rad),
        degrees=10.0 * np.sin(38.0),
        azimuth=9.0 * np.sin(rad),
    )
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


def test_looks_from_the_variance_in_decibels():
    for looks in (1.0, 3.7):
        variance = K**2 * stats.loggamma.var(looks)
        agrees(
            looks_of_log_variance(variance),
            looks,
            rtol=1e-9,
            coefficient_of_variation=K**2 / variance,
            nepers=1.0 / stats.loggamma.var(looks) / K**2,
            amplitude=K**2 / (4.0 * variance),
            sd=K / np.sqrt(variance),
        )


def test_looks_from_half_the_mean_square_of_differences():
    """Independent pixels on a slope of level, which differences between near pixels hardly see."""
    radar = Radar(range_resolution_m=1.0, azimuth_resolution_m=1.0, range_spacing_m=2.5, azimuth_spacing_m=2.5)
    image = K * np.log(np.random.default_rng(0).gamma(3.0, 1.0 / 3.0, (400, 300)))
    image += np.linspace(0.0, 9.0, 400)[:, None]
    found = local_looks(image.astype(np.float32), np.arange(image.size), radar)
    agrees(
        found,
        3.0,
        rtol=0.02,
        whole_square=looks_of_log_variance(2.0 * K**2 * stats.loggamma.var(3.0)),
        with_the_slope=looks_of_log_variance(image.var()),
        of_power=1.0 / (10.0 ** (image / 10.0)).var() * (10.0 ** (image / 10.0)).mean() ** 2,
    )


def test_table_between_its_lines_and_pixels():
    lines, pixels = np.array([0.0, 100.0, 250.0]), np.array([0.0, 40.0, 90.0])
    values = np.array([[3.0, 5.0, 4.0], [7.0, 6.0, 9.0], [2.0, 8.0, 1.0]])
    table = LookUpTable(lines, (pixels,) * 3, tuple(values))
    line, pixel = np.array([30.0, 160.0, 249.0]), np.array([10.0, 70.0, 85.0])
    right = RegularGridInterpolator((lines, pixels), values)(np.column_stack([line, pixel]))
    agrees(
        table.at(line, pixel),
        right,
        nearest=RegularGridInterpolator((lines, pixels), values, "nearest")(np.column_stack([line, pixel])),
        line_before=[np.interp(p, pixels, values[k]) for p, k in zip(pixel, (0, 1, 1), strict=True)],
        transposed=RegularGridInterpolator((lines, pixels), values.T)(np.column_stack([line, pixel])),
        squared=RegularGridInterpolator((lines, pixels), values**2)(np.column_stack([line, pixel])),
    )
    agrees(table.at(np.array([400.0]), np.array([-9.0])), [2.0], extrapolated=[2.0 - 5.0, 1.0][:1], zero=[0.0])
