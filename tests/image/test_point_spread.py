"""Point spread of speckle made with known responses; filters, and what may be mistaken for them."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, uniform_filter

from radcal.config import Radar
from radcal.image import point_spread
from radcal.image.looks import estimate_looks
from radcal.image.point_spread import PointSpread, Width, estimate_point_spread, is_filtered, point_spread_findings
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.reflectivity import uniform

SHAPE = (256, 256)
ONE = np.ones(SHAPE, dtype=np.uint8)
RADAR = Radar()  # 2 m by 3.5 m, 4 looks


def power(level=1.0, seed=1, **keys):
    sigma0 = np.broadcast_to(np.asarray(level, dtype=np.float32), SHAPE)
    return ImageFormation(Radar(**keys), SHAPE, -30.0).intensity(uniform(sigma0), seed).astype(float)


def texture(sigma_px, sd_db):
    smooth = gaussian_filter(np.random.default_rng(4).standard_normal(SHAPE), sigma_px)
    return np.asarray(10.0 ** (0.1 * sd_db * smooth / smooth.std()))


def lee(image, side, looks):
    """Filter of local statistics: mean plus a share of the deviation that grows with the variance beyond speckle's."""
    mean = uniform_filter(image, side)
    variance = uniform_filter(image**2, side) - mean**2
    beyond = np.maximum(variance - mean**2 / looks, 0.0) / (1.0 + 1.0 / looks)
    return np.asarray(mean + beyond / np.maximum(variance, 1e-12) * (image - mean))


def spread_of(range_m, azimuth_m, range_error_m, azimuth_error_m, smoothing, windows):
    return PointSpread(Width(range_m, range_error_m, smoothing), Width(azimuth_m, azimuth_error_m, 1.0), windows)


def found(image, radar=RADAR):
    return estimate_point_spread(decibels(image.astype(np.float32)), ONE, radar)


def told(spread, radar, *pixel_m):
    """Severity and code of each finding on a point spread."""
    return [(one.severity, one.code) for one in point_spread_findings(spread, None, radar, "b.tif", *pixel_m)]


def judged(image, radar=RADAR):
    """Whether the image counts as filtered, and the first words of the findings: severity, code and number."""
    image_db = decibels(image.astype(np.float32))
    spread, looks = estimate_point_spread(image_db, ONE, radar), estimate_looks(image_db, ONE, radar)
    findings = point_spread_findings(spread, looks, radar, "a.tif")
    return is_filtered(spread, looks, radar), [f"{one.severity} {one.code}" for one in findings]


@pytest.mark.parametrize("looks", [1, 4])
@pytest.mark.parametrize(("range_m", "azimuth_m"), [(2.0, 3.5), (2.8, 3.1), (4.0, 6.0)])
def test_widths_are_those_of_the_response(looks, range_m, azimuth_m):
    spread = found(power(looks=looks, range_resolution_m=range_m, azimuth_resolution_m=azimuth_m))
    assert spread.range.width_m == pytest.approx(range_m, rel=0.04)
    assert spread.azimuth.width_m == pytest.approx(azimuth_m, rel=0.04)
    # 5 percent for what is not known, and little from so many windows
    assert spread.range.error_m == pytest.approx(0.05 * range_m, rel=0.2)


@pytest.mark.parametrize(("side", "looks"), [(3, 4), (3, 1), (5, 4)])
def test_a_mean_divides_the_variance_by_its_growth_of_the_correlation_area(side, looks):
    """The mean over n pixels in independent cells of c pixels: looks and correlation area grow by about n / c."""
    radar, image = Radar(looks=looks), power(looks=looks)
    smooth = uniform_filter(image, side)
    variances = [np.var(values) / np.mean(values) ** 2 for values in (image, smooth)]
    assert found(image, radar).smoothing == pytest.approx(1.0, rel=0.1)
    assert found(smooth, radar).smoothing == pytest.approx(variances[0] / variances[1], rel=0.2)


@pytest.mark.slow
def test_errors_are_the_scatter_over_seeds(monkeypatch):
    """The bootstrap's part: of 32 seeds in both directions the scatter is known to 9 %."""
    monkeypatch.setattr(point_spread, "_DRAWS", 25)  # enough for the mean over the seeds
    shape = (96, 144)  # 36 windows
    formation = ImageFormation(RADAR.model_copy(update={"looks": 1}), shape, -30.0)
    level, material = uniform(np.ones(shape, dtype=np.float32)), np.ones(shape, dtype=np.uint8)
    spreads = [estimate_point_spread(decibels(formation.intensity(level, seed)), material, RADAR) for seed in range(32)]
    found = np.array(
        [[[s.range.width_m, s.range.error_m], [s.azimuth.width_m, s.azimuth.error_m]] for s in spreads if s]
    )
    assert found.shape == (32, 2, 2)
    widths, errors = found[..., 0], found[..., 1]
    sampling = errors**2 - (0.05 * widths) ** 2
    ratio = widths.var(axis=0, ddof=1) / sampling.mean(axis=0)
    assert np.sqrt(ratio.mean()) == pytest.approx(1.0, abs=0.25)
    np.testing.assert_allclose(widths.mean(axis=0), [2.0, 3.5], rtol=0.03)


def test_pixels_without_correlation_are_narrow():
    independent = np.random.default_rng(1).gamma(4.0, 0.25, SHAPE)
    assert found(independent).range.width_m < 1.3
    assert judged(independent)[1][0].endswith(" resolutions")


@pytest.mark.parametrize("image", ["box 3", "box 5", "lee 5", "lee 7"])
def test_filtered_speckle_is_recognised(image):
    name, side = image.split()
    speckle = power(texture(10.0, 1.0))
    filtered = uniform_filter(speckle, int(side)) if name == "box" else lee(speckle, int(side), 4)
    assert judged(filtered) == (True, ["warning filtered"])
    # where radar.looks has been set to what is left, the point spread still tells
    left = estimate_looks(decibels(filtered.astype(np.float32)), ONE, RADAR)
    assert judged(filtered, Radar(looks=min(64, round(left.looks)))) == (False, ["warning smoothed"])


@pytest.mark.parametrize(
    ("keys", "sd_db", "exponent", "note"),
    [
        ({}, 0.0, 1.0, None),
        ({}, 1.5, 1.0, None),
        ({"texture_px": 3.0}, 1.0, 1.0, None),  # correlated over 2 times the area, too, but with fewer looks
        ({"looks": 16}, 0.0, 1.0, None),  # of the sensor
        ({"looks": 16}, 1.5, 1.0, None),
        ({}, 0.0, 0.5, None),  # amplitude, read as power
        (
            {"range_resolution_m": 2.6, "azimuth_resolution_m": 4.55}, 0.0, 1.0,
            "warning resolutions",
        ),
    ],
)  # fmt: skip
def test_what_is_not_a_filter(keys, sd_db, exponent, note):
    keys = dict(keys)
    pattern = texture(keys.pop("texture_px", 10.0), sd_db)
    is_so, found = judged(power(pattern, **keys) ** exponent)
    assert not is_so
    assert found[:1] == ([] if note is None else [note])


def test_findings_give_both_numbers():
    spread = spread_of(2.5, 3.4, 0.13, 0.17, 1.2, 100)
    (wider,) = point_spread_findings(spread, None, RADAR, "b.tif")
    assert (wider.code, wider.severity, wider.about) == ("resolutions", "warning", "b.tif")
    assert wider.numbers == {
        "range_m": 2.5, "range_error_m": 0.13, "range_least": "", "range_declared_m": 2.0, "range_possible_m": 2.5,
        "azimuth_m": 3.4, "azimuth_error_m": 0.17, "azimuth_least": "", "azimuth_declared_m": 3.5,
        "azimuth_possible_m": 3.4, "correlation_ratio": 1.2,
    }  # fmt: skip
    # an image whose speckle is hardly correlated: 1.184 times the spacings is the finest, rounded upwards
    fine = spread_of(1.2, 2.71, 0.06, 0.14, 0.9, 100)
    coarse = Radar(range_spacing_m=1.5, azimuth_spacing_m=2.3, range_resolution_m=2.2, azimuth_resolution_m=3.5)
    (finer,) = point_spread_findings(fine, None, coarse, "b.tif")
    assert (finer.severity, finer.code) == ("note", "resolutions")
    assert [finer.numbers[f"{way}_possible_m"] for way in ("range", "azimuth")] == [1.78, 2.74]
    far = coarse.model_copy(update={"range_resolution_m": 5.1})  # 1.78 x 2.74 m are 0.27 of its cell, 1 / 3.7
    assert told(fine, far) == [("warning", "resolutions")]
    advised = coarse.model_copy(update={"range_resolution_m": 1.78, "azimuth_resolution_m": 2.74})
    assert told(fine, advised) == []  # no nearer ones are possible
    assert told(spread_of(2.2, 3.4, 0.13, 0.17, 1.1, 100), RADAR) == []


def test_resampling_from_a_map_explains_a_wider_spread():
    """4 looks on a map of 10 m pixels, taken to pixels of 6 by 10 m."""
    given = {"range_resolution_m": 11.0, "azimuth_resolution_m": 18.0, "azimuth_spacing_m": 10.0}
    on_map = power(**given, range_spacing_m=6.5)
    radar = Radar(**given, range_spacing_m=6.0)
    rows = np.floor(np.arange(int(SHAPE[0] * 6.5 / 6.0) - 1) * 6.0 / 6.5 + 0.3).astype(int)
    image_db = decibels(on_map[rows].astype(np.float32))
    ones = np.ones(image_db.shape, np.uint8)
    spread = estimate_point_spread(image_db, ones, radar)
    # of the nearest neighbour alone, 2.355 / sqrt(12) pixels are added in quadrature
    assert spread.range.width_m == pytest.approx(math.hypot(11.0, 0.68 * 6.5), abs=2 * spread.range.error_m)
    wide = spread_of(13.9, 18.2, 0.7, 0.9, 1.3, 100)
    on_map_m = (6.5, 10.0)
    assert told(wide, radar) == [("warning", "resolutions")]
    assert point_spread_findings(wide, None, radar, "b.tif", on_map_m) == []
    for range_m, severity in ((16.0, "warning"), (8.0, "note")):
        beyond = spread_of(range_m, 18.2, range_m / 22.0, 0.9, 1.3, 100)
        (first,) = point_spread_findings(beyond, None, radar, "b.tif", on_map_m)
        assert (first.code, first.severity) == ("resolutions", severity)
        assert [first.numbers[f"{way}_possible_m"] for way in ("range", "azimuth")] == [range_m, 18.2]
    # wider in azimuth as the resampling explains, and finer in slant range
    assert told(spread_of(8.0, 21.0, 0.4, 0.9, 1.3, 100), radar, on_map_m) == [("note", "resolutions")]
    assert told(spread_of(11.2, 18.2, 0.7, 0.9, 1.0, 9), radar, on_map_m) == []
    # smoothed, unless the resampling explains it
    coarse = spread_of(22.0, 24.0, 1.1, 1.2, 3.1, 100)
    assert told(coarse, radar) == [("warning", "smoothed")]
    assert told(coarse, radar, on_map_m)[0][1] == "resolutions"


def fields(side):
    """Square fields of four materials, so that no two fields with a common edge have the same one."""
    row, column = np.indices(SHAPE) // side
    return (1 + row % 2 + 2 * (column % 2)).astype(np.uint8)


@pytest.mark.parametrize(("looks", "side", "configured_m"), [(1, 10, 2.0), (4, 10, 5.0), (1, 24, 60.0)])
def test_small_fields_are_pooled(looks, side, configured_m):
    """Fields too small for windows, with levels that differ by up to 12 dB, and any configured resolution."""
    material = fields(side)
    image = power(10.0 ** (0.4 * material), looks=looks)
    radar = RADAR.model_copy(update={"looks": looks, "range_resolution_m": configured_m})
    spread = estimate_point_spread(decibels(image.astype(np.float32)), material, radar)
    # with the error of the bootstrap, beside 5 % that has no part in simulated images
    assert spread.range.width_m == pytest.approx(2.0, rel=0.06)
    assert spread.azimuth.width_m == pytest.approx(3.5, rel=0.06)
    assert 0.05 * spread.azimuth.width_m < spread.azimuth.error_m < 0.1 * spread.azimuth.width_m
    declared = [one.numbers.get("range_declared_m") for one in point_spread_findings(spread, None, radar, "b.tif")]
    assert declared[:1] == ([] if configured_m == 2.0 else [configured_m])


def test_edges_of_small_fields_may_be_displaced():
    """The image is not registered yet: up to four pixels at the edges show the neighbouring field."""
    material = fields(20)
    image = np.roll(power(10.0 ** (0.4 * material)), (3, -4), (0, 1))
    spread = estimate_point_spread(decibels(image.astype(np.float32)), material, RADAR)
    assert spread.range.width_m == pytest.approx(2.0, rel=0.06)
    assert spread.azimuth.width_m == pytest.approx(3.5, rel=0.06)


def test_an_uncertain_wide_spread_is_not_called_smoothed():
    uncertain = spread_of(4.0, 5.0, 1.2, 0.9, 2.0, 9)
    assert told(uncertain, RADAR) == []


def test_without_pairs_that_are_far_enough_apart_there_is_no_estimate():
    image_db = decibels(power().astype(np.float32))
    assert estimate_point_spread(image_db, fields(5), RADAR) is None  # 3 pixels without the edges
    assert estimate_point_spread(image_db, np.zeros(SHAPE, dtype=np.uint8), RADAR) is None
    # speckle that is correlated over half the distances
    wide = power(range_resolution_m=40.0)
    # by windows, whose size is fixed by the configured resolution
    by_windows = point_spread_findings(found(wide), None, RADAR, "a.tif")[0].numbers
    assert (by_windows["range_least"], int(by_windows["range_m"])) == ("at least ", 12)
    assert estimate_point_spread(decibels(wide.astype(np.float32)), fields(20), RADAR) is None
    image_db[::3] = np.nan
    assert estimate_point_spread(image_db, ONE, RADAR) is None
