"""The looks estimated against the ones that speckle was made with."""

import numpy as np
import pytest
from scipy import special

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.image import looks as module
from radcal.image.looks import Looks, check_looks, estimate_looks, local_looks, looks_of_log_variance
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.reflectivity import uniform

SHAPE = (400, 400)
ONE = np.ones(SHAPE, dtype=np.uint8)


def speckle_db(looks, level=10.0, seed=1):
    sigma0 = np.broadcast_to(np.asarray(level, dtype=np.float32), SHAPE)
    formation = ImageFormation(Radar(looks=looks), SHAPE, -20.0)
    image, thinning = formation.intensity(uniform(sigma0), seed), formation.thinning(seed)
    return decibels(image if thinning is None else image * thinning)


@pytest.mark.parametrize("looks", [1, 2.5, 4, 4.4, 9])
def test_looks_of_the_simulators_speckle(looks):
    found = estimate_looks(speckle_db(looks), ONE, Radar(looks=looks))
    # about 400 windows of 64 pixels, whose log variance scatters by a fifth: the mode to some percent
    assert found.looks == pytest.approx(looks, rel=0.1)
    assert found.low <= found.looks <= found.high
    assert found.high / found.low < 1.3


def test_homogeneous_areas_count_where_others_are_textured():
    rng = np.random.default_rng(3)
    texture = np.ones(SHAPE)
    texture[:, 200:] = rng.gamma(0.3, 1 / 0.3, size=(SHAPE[0], 200))
    found = estimate_looks(speckle_db(4, 10.0 * texture), ONE, Radar())
    assert found.looks == pytest.approx(4.0, rel=0.12)


def test_windows_of_several_materials_or_without_data_are_left_out():
    image = speckle_db(4)
    whole = estimate_looks(image, ONE, Radar())
    material = ONE.copy()
    material[:, 200:] = 0
    half = estimate_looks(image, material, Radar())
    assert half.windows <= 0.6 * whole.windows
    image[:, 200:] = np.nan
    assert estimate_looks(image, ONE, Radar()) == half


@pytest.mark.parametrize("looks", [1, 4, 9])
def test_small_areas_have_smaller_windows(looks):
    """Fields of 20 x 27 pixels hold hardly any window of 8 x 8 independent pixels, which is 16 x 24 pixels large."""
    rows, columns = np.indices(SHAPE)
    material = (1 + (rows // 20 + columns // 27) % 2).astype(np.uint8)
    found = estimate_looks(speckle_db(looks), material, Radar(looks=looks))
    assert found.windows >= 20
    # windows of 16 to 36 pixels, whose log variance scatters by 0.25 to 0.4
    assert found.looks == pytest.approx(looks, rel=0.25)


def log_variance(looks):
    return float((10 / np.log(10)) ** 2 * special.polygamma(1, looks))


@pytest.mark.parametrize("looks", [1.0, 3.0])
def test_looks_among_neighbours_are_those_of_pixels_a_resolution_and_a_half_apart(looks):
    """Speckle that is the same in 2 x 3 pixels: nearer pairs would be correlated, and other ground is far brighter."""
    radar = Radar(range_resolution_m=3.6, range_spacing_m=3.0, azimuth_resolution_m=2.0, azimuth_spacing_m=1.0)
    assert module.independent_steps(radar) == (2, 3)
    power = np.random.default_rng(2).gamma(looks, 1.0 / looks, (90, 80)).repeat(2, axis=0).repeat(3, axis=1)
    image = (10 * np.log10(power)).astype(np.float32)
    inside = np.zeros(image.shape, dtype=bool)
    inside[40:, 30:] = True
    image[~inside] += 40.0
    found = local_looks(image, np.flatnonzero(inside), radar)
    # squared differences of 70 x 70 values, each in two pairs of correlation 1/4 or less: 4 sigma of their mean
    excess = special.polygamma(3, looks) / special.polygamma(1, looks) ** 2
    error = 4 * np.sqrt((excess / 2 + 2) * 1.5 / 4900)
    assert error < 0.2
    semivariance = log_variance(found)
    assert semivariance == pytest.approx(log_variance(looks), rel=error)
    assert np.isnan(local_looks(image, np.array([5]), radar))


def test_variance_of_a_window_is_unbiased_beside_a_plane():
    rows, columns = np.indices((320, 480))
    image = np.random.default_rng(4).normal(0.0, 2.5, rows.shape) + 0.3 * rows - 0.7 * columns
    found = module._window_variances(image, np.ones(rows.shape, dtype=np.uint8), 1, 1, 8)
    assert found.size == 40 * 60
    # chi-squared of 61 degrees of freedom; a plane takes three of 64, 5 % of the variance
    assert found.mean() == pytest.approx(2.5**2, rel=4 * np.sqrt(2 / 61 / found.size))
    assert found.var() == pytest.approx(2 * 2.5**4 / 61, rel=0.2)


@pytest.mark.parametrize(
    ("found", "scale", "said"),
    [
        (looks_of_log_variance(log_variance(4.0) / 4), "power", "would be that of 4 if its numbers are amplitude"),
        (looks_of_log_variance(log_variance(4.0) / 4), "db", "10 log10 of amplitude instead of power"),
        (500.0, "power", "as if its numbers were dB"),
        (looks_of_log_variance(log_variance(4.0) * 4), "amplitude", "would be that of 4 if its numbers are power:"),
        (looks_of_log_variance(log_variance(4.0) * 4), "db", "would be that of 4 if its numbers are 20 log10 of power"),
        (1.39, "power", "set radar.looks to what it has"),
        (1.65, "amplitude", "set measurement.scale: power"),
    ],
)
def test_a_wrong_scale_is_named_by_the_looks_that_it_would_give(found, scale, said):
    with pytest.raises(MeasurementError, match=said):
        check_looks(Looks(found, 0.9 * found, 1.1 * found, 50), 4, scale, "image.tif")


def test_a_filtered_image_is_not_blamed_for_its_scale():
    said = r"^measurement\.path: a\.tif is speckle-filtered: .*set radar\.looks: 14 "
    with pytest.raises(MeasurementError, match=said):
        check_looks(Looks(14.0, 13.0, 15.0, 50), 4, "power", "a.tif", filtered=True)


@pytest.mark.parametrize(("found", "scale"), [(12.0, "power"), (1.3, "amplitude")])
def test_few_windows_refuse_no_image(found, scale):
    """Of one look the mode of 20 windows of 4 x 4 pixels has a standard error of 24 % (simulated)."""
    wide = Looks(found, found / 2.0, found * 2.0, 20, 4)
    told = check_looks(wide, 4, scale, "image.tif")
    numbers = {"looks": found, "low": found / 2.0, "high": found * 2.0, "windows": 20, "side_px": 4, "declared": 4}
    assert (told.code, told.severity, told.about, told.numbers) == ("looks_uncertain", "note", "image.tif", numbers)
    with pytest.raises(MeasurementError, match=r"measurement\.scale"):
        check_looks(Looks(found, found / 1.3, found * 1.3, 20, 4), 4, scale, "image.tif")


def test_heterogeneous_ground_is_no_wrong_scale():
    """More than four standard errors fewer looks, and an interval that reaches 3 of 4 looks: some windows are mixed."""
    assert not Looks(1.43, 1.4, 3.01, 33, 5).differs(4.0)
    assert Looks(1.43, 1.3, 1.71, 33, 5).differs(4.0)
    # no heterogeneity makes the variance smaller
    assert Looks(8.1, 7.5, 8.7, 33, 5).differs(4.0)


@pytest.mark.parametrize("found", [8.1, 1.39])
def test_a_product_whose_scale_is_known_is_refused_for_its_speckle(found):
    with pytest.raises(MeasurementError, match=r"^measurement\.path: the speckle of .*\.SAFE is .*, which is no"):
        check_looks(Looks(found, 0.9 * found, 1.1 * found, 50), 4, None, "S1A.SAFE")
    assert check_looks(Looks(1.41, 1.3, 1.5, 50), 4, None, "S1A.SAFE").code == "looks_fewer"


@pytest.mark.parametrize(
    ("found", "code"),
    [(8.0, "looks_more"), (5.21, "looks_more"), (5.2, "looks"), (2.4, "looks"), (2.39, "looks_fewer"),
     (1.4, "looks_fewer")],
)  # fmt: skip
def test_other_looks_give_the_simulated_speckle_another_spread(found, code):
    assert check_looks(Looks(found, 0.9 * found, 1.1 * found, 50), 4, "power", "image.tif").code == code


@pytest.mark.parametrize(("found", "low", "high"), [(5.25, 3.23, 5.65), (2.2, 1.9, 4.1)])
def test_looks_inside_the_interval_claim_no_other_spread(found, low, high):
    assert check_looks(Looks(found, low, high, 50), 4, "power", "image.tif").code == "looks"
