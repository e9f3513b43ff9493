"""Cells of one pass: means of power, their bias and variance, and the area of the ground."""

from collections import defaultdict
from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, made_cells
from scipy.special import polygamma

from radcal.config import Radar
from radcal.ground.correlation import Correlation
from radcal.laws import law_for
from radcal.posterior.cells import CellMeans, Simulated, cell_means
from radcal.radar.radiometry import noise_floor_db

RADAR = Radar(altitude_m=1000.0, nesz_db=[(30.0, -24.0), (40.0, -12.0)], radiometry="sigma0_local")
DB = 10.0 / np.log(10.0)


def seen(incidence_deg):
    """Geometry of an image with some incidence in each pixel."""
    shape = incidence_deg.shape
    return SimpleNamespace(
        shape=shape,
        incidence_deg=incidence_deg.astype(np.float32),
        flat_incidence_deg=np.linspace(30.0, 40.0, shape[0]),
    )


def uncorrelated(width):
    lags = np.zeros((13, 13))
    lags[6, 6] = 1.0
    return Correlation(lags, width)


def found(image, simulated, geometry, patch=None, law=LINE, radar=RADAR, **keys):
    """Cells of all pixels; the simulated images have X of the line."""
    pixels = np.arange(image.size)
    patch = np.ones(image.size, dtype=np.int64) if patch is None else patch.ravel()
    each = [one if isinstance(one, Simulated) else Simulated(one, {"a": LINE_X}) for one in simulated]
    keys = {"correlation": uncorrelated(image.shape[1]), "area": np.zeros(image.size), **keys}
    return cell_means(pixels, patch, image, each, "a", law, geometry, radar, **keys)


def speckled(level_db, looks, rng):
    return (level_db + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, level_db.shape))).astype(np.float32)


def test_means_have_no_bias_and_the_variance_that_is_stated():
    """Cells of eight pixels of one look, of which the mean of the logarithm is 0.28 dB too low."""
    rng, shape = np.random.default_rng(2), (192, 192)
    row, column = np.indices(shape)
    patch = 200 * (row // 2) + column // 4
    level = np.full(shape, -7.0)
    images = [speckled(level, looks, rng) for looks in (1.0, 5.0, 5.0)]
    cells = found(images[0], images[1:], seen(np.full(shape, 40.0)), patch, noisy=False)
    n = cells.size
    assert n == 192 * 192 / 8
    # pixels of a cell are compared with their own mean
    assert cells.looks == pytest.approx(1.0 + 1.0 / 8.0, rel=0.03)
    error = DB * np.sqrt(polygamma(1, 8.0) / n)
    assert cells.measured_db.mean() == pytest.approx(-7.0, abs=0.04 + 2.0 * error)
    assert DB * (np.log(8.0) - polygamma(0, 8.0)) > 0.27
    assert cells.beside_db.mean() == pytest.approx(-7.0 - float(LINE(np.radians(40.0), LINE_X)), abs=0.02)
    of_power = DB**2 * polygamma(1, [8.0 * (1.0 + 1.0 / 8.0), 8.0 * (5.0 + 1.0 / 8.0)])
    np.testing.assert_allclose(cells.variance, of_power[0] + of_power[1] / 2.0, rtol=0.03)
    scatter = np.var(cells.measured_db - cells.beside_db)
    assert scatter == pytest.approx(DB**2 * (polygamma(1, 8.0) + polygamma(1, 40.0) / 2.0), rel=0.08)


def test_cells_are_fields_in_blocks_of_24_pixels_and_3_degrees():
    rng, shape = np.random.default_rng(7), (60, 70)
    row, column = np.indices(shape)
    incidence = 20.0 + 0.2 * row + 0.1 * column
    patch = np.array([5, 3, 9])[(row > 20).astype(int) + (column > 31)]
    image, area = rng.normal(-8.0, 2.0, shape).astype(np.float32), rng.normal(0.0, 2.0, shape)
    cells = found(image, [image], seen(incidence), patch, area=area.ravel())
    members = defaultdict(list)
    for k in range(image.size):
        at = np.float32(incidence.ravel()[k])
        members[patch.ravel()[k], row.ravel()[k] // 24, column.ravel()[k] // 24, int(at / 3.0)].append(k)
    wanted = sorted(tuple(one) for one in members.values() if len(one) >= 8)
    assert any(len(one) < 8 for one in members.values())
    assert cells.pixels.sum() == sum(map(len, wanted))
    rows = sorted(zip(cells.pixels, cells.patch, cells.incidence_deg, cells.area_db, strict=True))
    by_hand = sorted(
        (len(one), patch.ravel()[one[0]], incidence.ravel()[list(one)].mean(), area.ravel()[list(one)].mean())
        for one in wanted
    )
    np.testing.assert_allclose(rows, by_hand, rtol=1e-6, atol=1e-6)


def test_correlated_pixels_count_as_fewer():
    """Neighbours in a row have a correlation of 0.4, so that 1 + 2 * 0.4 pixels of a long row count as one."""
    rng, shape = np.random.default_rng(3), (48, 48)
    image = speckled(np.full(shape, -7.0), 4.0, rng)
    lags = np.zeros((13, 13))
    lags[6, 5:8] = 0.4, 1.0, 0.4
    geometry = seen(np.full(shape, 40.0))
    alone, alike = (
        found(image, [image], geometry, correlation=Correlation(one, 48)) for one in (uncorrelated(48).lags, lags)
    )
    share = 1.0 / (1.0 + 2.0 * 0.4 * 23.0 / 24.0)  # a cell has rows of 24 pixels
    np.testing.assert_allclose(alike.variance, alone.variance / share, rtol=0.01)
    # and scatter less about their own mean
    assert alike.looks / alone.looks == pytest.approx((576.0 - 1.0 / share) / 575.0, rel=2e-4)
    # the bias of the logarithm of the mean is half its variance
    np.testing.assert_allclose(
        alike.measured_db - alone.measured_db, (1.0 / share - 1.0) * alone.variance / 4.0 / DB, rtol=0.02
    )


def test_the_simulated_mean_is_relative_to_law_and_noise():
    """Images without speckle: law, noise in power, and 0.7 dB more."""
    shape = (48, 24)
    incidence = np.broadcast_to(np.linspace(30.1, 32.9, 24), shape)
    geometry = seen(incidence)
    floor = noise_floor_db(RADAR, geometry.flat_incidence_deg)[:, None]
    xs = [np.array([-6.0, -30.0]), np.array([-9.0, -26.0])]
    images = []
    for x in xs:
        law = LINE(np.radians(incidence), x)
        images.append((0.7 + DB * np.log(10.0 ** (law / 10.0) + 10.0 ** (floor / 10.0))).astype(np.float32))
    simulated = [Simulated(image, {"a": x.tolist(), "b": [9.0]}) for image, x in zip(images, xs, strict=True)]
    cells = found(images[0], simulated, geometry)
    assert cells.size == 2
    # mean of a curve and curve at the mean differ by some hundredths
    np.testing.assert_allclose(cells.beside_db, 0.7, atol=0.05)
    level = DB * np.log([np.mean(10.0 ** (floor[k : k + 24] / 10.0)) for k in (0, 24)])
    np.testing.assert_allclose(cells.noise_db, level)
    # of the expected power, and not of the images, which are 0.7 dB brighter
    laws = 10.0 ** (np.array([LINE(np.radians(cells.incidence_deg), x) for x in xs]) / 10.0)
    power = 10.0 ** (level / 10.0)
    np.testing.assert_allclose(cells.share, np.mean(power / (laws + power), axis=0), rtol=1e-6)
    assert 0.05 < cells.share.min() < cells.share.max() < 0.9
    quiet = found(images[0], simulated[:1], geometry, noisy=False)
    np.testing.assert_array_equal(quiet.share, 0.0)
    np.testing.assert_array_equal(quiet.noise_db, -np.inf)
    assert (quiet.beside_db > cells.beside_db).all()


def test_noise_above_the_signal_has_a_share_of_one():
    """A law without a curve, whose simulated image is 50 dB below the level of the law."""
    shape = (24, 24)
    dark = np.full(shape, -50.0, dtype=np.float32)
    cells = found(dark, [dark], seen(np.full(shape, 40.0)), law=law_for("external", names=("k", "m")))
    np.testing.assert_array_equal(cells.share, 1.0)


def test_the_share_of_noise_does_not_follow_the_speckle_of_the_simulated_image():
    """On slopes that double the area of the ground, a law of -20 dB gives -17 dB in sigma0_ref."""
    shape, radar = (96, 96), RADAR.model_copy(update={"radiometry": "sigma0_ref"})
    law, geometry = law_for("tabulated", angles_deg=(20.0, 60.0)), seen(np.full(shape, 40.0))
    noise = noise_floor_db(RADAR, geometry.flat_incidence_deg)[:, None]
    power = 2.0 * 0.01 + np.broadcast_to(10.0 ** (noise / 10.0), shape)
    image = speckled(DB * np.log(power), 4.0, np.random.default_rng(7))
    simulated, area = Simulated(image, {"a": [-20.0, -20.0]}), np.full(image.size, 10.0 * np.log10(2.0))
    cells = found(image, [simulated], geometry, law=law, area=area, radar=radar)
    assert cells.size == 16
    assert np.ptp(cells.beside_db) > 0.2
    of_noise = 10.0 ** (cells.noise_db / 10.0)
    np.testing.assert_allclose(cells.share, of_noise / (0.02 + of_noise), rtol=1e-6)
    local = found(image, [simulated], geometry, law=law, area=area)  # sigma0_local, without an area term
    np.testing.assert_allclose(local.share, of_noise / (0.01 + of_noise), rtol=1e-6)


def test_a_law_without_a_curve_counts_as_0_db():
    shape = (24, 24)
    image = np.full(shape, -8.0, dtype=np.float32)
    program = [Simulated(image, {"a": [3.0]})]
    cells = found(image, program, seen(np.full(shape, 40.0)), law=law_for("external", names=["mv"]), noisy=False)
    np.testing.assert_allclose(cells.beside_db, -8.0, atol=1e-4)


def test_few_pixels_make_no_cells():
    shape = (4, 7)
    image = np.full(shape, -8.0, dtype=np.float32)
    cells = found(image, [image], seen(np.full(shape, 40.0)), np.arange(28).reshape(shape) // 7)
    assert cells.size == 0
    pixels = np.empty(0, dtype=np.int64)
    nothing = cell_means(
        pixels, pixels, image, [Simulated(image, {"a": LINE_X})], "a", LINE, seen(np.full(shape, 40.0)), RADAR,
        uncorrelated(7), area=np.zeros(28),
    )  # fmt: skip
    assert nothing.size == CellMeans.none().size == 0
    assert nothing.without_leaks(True).size == 0


def test_leaks_are_simulated_means_away_from_the_median():
    """With the area of the ground, times the share of the signal, taken out where the radiometry has it."""
    area, share = np.array([0.0, 2.0, -1.0, 0.5, 1.0]), np.array([0.0, 0.0, 0.2, 0.0, 0.5])
    beside = 0.1 + (1.0 - share) * area + np.array([0.0, 0.39, -0.38, 0.41, 0.0])
    cells = made_cells(np.arange(5.0), np.full(5, 40.0), beside_db=beside, area_db=area, share=share)
    assert cells.without_leaks(True).measured_db.tolist() == [0.0, 1.0, 2.0, 4.0]
    flat = made_cells(
        np.arange(5.0), np.full(5, 40.0), beside_db=beside - (1.0 - share) * area, area_db=area, share=share
    )
    assert flat.without_leaks(False).measured_db.tolist() == [0.0, 1.0, 2.0, 4.0]
    assert flat.without_leaks(True).size < 4
