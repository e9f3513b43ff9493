import re

import numpy as np
import pytest
import registration_samples
from registration_samples import displaced, smooth_field, speckled

from radcal.config import RegistrationConfig
from radcal.errors import MeasurementError
from radcal.image.model import Measurement
from radcal.registration import registered as module
from radcal.registration.registered import LEAST_CONTRAST_DB, contrast_db, register

SHAPE = (200, 230)
GEFOLKI = RegistrationConfig()


def ground(seed=1):
    return registration_samples.ground(SHAPE, seed)


def field(length, seed=3):
    return smooth_field(SHAPE, seed, length, 45.0)


def measured(displacement, seed=11):
    return Measurement(speckled(displaced(ground(), displacement), seed), "image.tif")


FIXED = speckled(ground(), 10)


@pytest.fixture(scope="module")
def registered():
    return register(FIXED, measured(field(4.0)), GEFOLKI)


def test_a_displaced_image_is_brought_back(registered):
    assert registered.applied
    error = np.hypot(*(registered.displacement_px - field(4.0)))
    assert error[15:-15, 15:-15].mean() < 0.4
    length = np.hypot(*registered.displacement_px)
    numbers = np.sqrt(np.mean(length**2)), length.max(), np.median(registered.uncertainty_px)
    said = "moved by {:.1f} pixels (rms, at most {:.1f}) with a standard error of {:.2f};"
    assert said.format(*numbers) in registered.verdict
    # a pixel's value is a measured one: speckle keeps its statistics
    moved = registered.measurement.image_db
    assert np.isin(moved[np.isfinite(moved)], registered.unregistered_db).all()


@pytest.mark.slow
def test_the_uncertainty_is_that_of_the_error():
    errors, said = [], []
    for seed in range(4):
        found = register(FIXED, measured(field(4.0, seed), 20 + seed), GEFOLKI)
        assert found.applied
        errors.append(np.hypot(*(found.displacement_px - field(4.0, seed)))[15:-15, 15:-15])
        said.append(found.uncertainty_px[15:-15, 15:-15])
    ratio = np.sqrt(np.mean(np.square(said)) / np.mean(np.square(errors)))
    assert 0.8 < ratio < 1.25


def test_squares_are_judged_by_the_field_of_the_other_squares():
    """The field of one half is right, that of the other wrong: only squares not used for the right one agree."""
    fixed = np.random.default_rng(2).normal(size=(96, 130)).astype(np.float32)
    squares = module._chequerboard(fixed.shape)
    right, wrong = np.zeros((2, 96, 130)), np.full((2, 96, 130), 7.0)
    found = module._held_out((fixed, fixed), (right, wrong), squares).reshape(6, 8)
    used = squares[8::16, 8:128:16]
    assert used[0, 0]
    assert not used[0, 1]
    # mean products of 256 values in a square
    assert found[~used].mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 256 / 24))
    assert abs(found[used].mean()) < 4 * np.sqrt(1 / 256 / 24)
    other = module._held_out((fixed, fixed), (wrong, right), squares).reshape(6, 8)
    assert other[used].mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 256 / 24))


def test_an_image_in_its_place_is_left_there():
    in_place = Measurement(speckled(ground(), 31), "in_place.tif")
    found = register(FIXED, in_place, GEFOLKI)
    assert not found.applied
    assert found.measurement is in_place
    assert not found.displacement_px.any()
    assert not found.uncertainty_px.any()
    before, after = map(float, re.findall(r"(\d\.\d+) (?:before|after)", found.verdict))
    assert after - before < 0.0015


@pytest.mark.slow
def test_ilk_is_an_alternative_with_a_wider_uncertainty(registered):
    found = register(FIXED, measured(field(4.0)), RegistrationConfig(method="ilk"))
    assert found.applied
    assert np.hypot(*(found.displacement_px - field(4.0)))[15:-15, 15:-15].mean() < 0.8
    assert np.median(found.uncertainty_px) > np.median(registered.uncertainty_px)


@pytest.mark.slow
def test_a_large_shift_is_found_by_phase_correlation_first():
    shift = np.array([31.0, -22.0])
    moving = Measurement(np.roll(speckled(ground(), 12), shift.astype(int), axis=(0, 1)), "shifted.tif")
    found = register(FIXED, moving, RegistrationConfig(global_shift=True, max_displacement_px=60))
    inside = found.displacement_px[:, 60:-60, 60:-60].mean(axis=(1, 2))
    np.testing.assert_allclose(inside, shift, atol=0.5)


@pytest.mark.slow
def test_a_registration_that_moves_too_far_is_not_used():
    found = register(FIXED, measured(field(6.0)), RegistrationConfig(max_displacement_px=2.0))
    assert not found.applied
    assert "max_displacement_px = 2" in found.verdict
    np.testing.assert_array_equal(found.measurement.image_db, measured(field(6.0)).image_db)
    assert not found.displacement_px.any()
    assert np.hypot(*(found.found_px - field(6.0)))[15:-15, 15:-15].mean() < 0.6


def other_images():
    rng = np.random.default_rng(0)
    square = speckled(ground(), 13)[:200, :200]
    return {
        "noise": (FIXED, rng.normal(0.0, 3.0, SHAPE)),
        "another place": (FIXED, speckled(ground(77), 14)),
        "turned": (FIXED[:200, :200], np.rot90(square)),
        "mirrored": (FIXED[:200, :200], square[:, ::-1]),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", other_images())
def test_an_image_of_something_else_is_refused(name):
    fixed, moving = other_images()[name]
    image = Measurement(moving.astype(np.float32), "other.tif")
    with pytest.raises(MeasurementError, match=r"other\.tif has nothing in common .*method: none") as said:
        register(fixed, image, GEFOLKI)
    assert ("it fits mirrored in azimuth." in str(said.value)) == (name == "mirrored")


def test_an_image_too_small_is_refused():
    small = Measurement(FIXED[:40, :100], "small.tif")
    with pytest.raises(MeasurementError, match="40 x 100 pixels, expected at least 64"):
        register(FIXED[:40, :100], small, GEFOLKI)


def test_contrast_is_that_under_speckle_and_beside_a_trend():
    rows, columns = np.indices((250, 330))
    trend = (-0.03 * rows).astype(np.float32)
    blank = speckled(trend, seed=5)
    assert contrast_db(trend) < 0.01
    assert contrast_db(blank) < LEAST_CONTRAST_DB
    # two levels 2.4 dB apart in patches of 48 pixels that fill half of the image: an sd of 1.2 dB
    patches = np.where((rows // 48 + columns // 48) % 2, 2.4, 0.0).astype(np.float32)
    assert contrast_db(patches) == pytest.approx(1.2, rel=0.1)
    assert contrast_db(speckled(trend + patches, seed=5)) == pytest.approx(contrast_db(patches), abs=0.1)
    hidden = np.where(rows < 100, np.nan, trend + patches)
    assert contrast_db(hidden) == pytest.approx(1.2, rel=0.15)
    # a border along a row or a column is contrast, too
    for border in (rows < 90, columns < 90):
        assert contrast_db(np.where(border, 2.4, 0.0)) > LEAST_CONTRAST_DB
    assert np.isnan(contrast_db(patches[:30, :30]))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("squares", [1, 2, 3, 4, 5])
def test_contrast_of_few_rows_is_that_beside_the_mean_of_each_row(squares):
    """Squares of 16 pixels with levels of their own; up to four rows of squares, the trend takes each row's mean."""
    levels = np.random.default_rng(7).normal(-12.0, 2.0, (squares, 20))
    levels += np.arange(squares)[:, None] ** 2
    image = np.kron(levels, np.ones((16, 16))).astype(np.float32)
    beside = np.sqrt(np.mean((levels - levels.mean(axis=1, keepdims=True)) ** 2))
    assert contrast_db(image) == pytest.approx(beside, rel=1e-5) if squares < 5 else contrast_db(image) > beside


def test_a_start_without_contrast_is_blamed_and_not_the_image():
    blank = speckled(np.full((192, 208), -12.0, dtype=np.float32), seed=8)
    image = speckled(ground(), seed=4)[:192, :208]
    said = r"simulated at the start has no contrast between materials \(the level"
    with pytest.raises(MeasurementError, match=said) as e:
        register(blank, Measurement(image, "a.tif"), RegistrationConfig())
    assert "give the materials starts that differ (materials.*.start, as radcal new writes them). If" in str(e.value)


def test_a_significant_correlation_is_not_called_nothing(monkeypatch):
    monkeypatch.setattr(module, "_mirrored", lambda *_: {"turned by 180 degrees.": 0.9})
    monkeypatch.setattr(module, "_FITS", 9.0)
    said = r"^registration: image\.tif agrees with the simulated image \(corr"
    with pytest.raises(MeasurementError, match=said) as e:
        register(FIXED, measured(field(4.0)), GEFOLKI)
    assert "mirrored 0.900, expected at least 1.5 times as much): are starting or fixed laws wrong" in str(e.value)
