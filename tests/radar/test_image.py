"""Image formation against the gamma distribution of multilook intensity."""

import numpy as np
import pytest
from scipy import signal, special, stats
from speckle_samples import circular_gaussian

from radcal import compiled
from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.laws import LAWS
from radcal.radar import image
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.projection import make_geometry
from radcal.radar.reflectivity import law_tables, reflectivity, uniform
from radcal.simulators.builtin import BuiltinSimulator
from radcal.speckle.response import beta_share, impulse_response

SHAPE = (330, 330)
APART = np.s_[12:-12:6, 12:-12:6]  # six pixels are four resolutions: uncorrelated; away from the image's edge
N = 51 * 51  # sample size
DYKE, GRASS = [6.1, 14.2, 21.5, 3.3], [10.0, 14.0, 6.0, 4.0]
QUIET = -200.0  # [dB] no noise at all


def log_gamma_moments(looks):
    """Mean, variance and third central moment of the log of gamma speckle, and the central moments 0 to 6."""
    k2, k3, k4, k5, k6 = (float(special.polygamma(n, looks)) for n in range(1, 6))
    central = [1.0, 0.0, k2, k3, k4 + 3 * k2**2, k5 + 10 * k3 * k2, k6 + 15 * k4 * k2 + 10 * k3**2 + 15 * k2**3]
    return float(special.digamma(looks) - np.log(looks)), k2, k3, np.array(central)


@pytest.mark.parametrize("looks", [1.4, 4.0, 7.5])
def test_looks_need_not_be_whole(looks):
    """Mean, variance, looks and log-moments of speckle against the gamma law, within 3 standard errors."""
    formation = ImageFormation(Radar(looks=looks), SHAPE, QUIET)
    images = []
    for seed in range(4):
        thinning = formation.thinning(seed)
        assert (thinning is None) == (looks == 4.0)
        image = formation.intensity(uniform(np.full(SHAPE, 0.2, dtype=np.float32)), seed)
        images.append(image * (1.0 if thinning is None else thinning) / 0.2)
    power = np.stack(images)[(slice(None), *APART)].astype(float).ravel()
    n = power.size
    assert n == 4 * N
    assert stats.kstest(power, stats.gamma(looks, scale=1 / looks).cdf).pvalue > 1e-3
    assert power.mean() == pytest.approx(1.0, abs=3 / np.sqrt(looks * n))
    of_variance = np.sqrt((6 / looks + 2) / n)  # relative standard error, from the excess kurtosis 6 / L
    assert power.var() == pytest.approx(1 / looks, rel=3 * of_variance)
    assert power.mean() ** 2 / power.var() == pytest.approx(looks, rel=3 * of_variance)
    if looks == 4.0:
        return
    assert 3 * of_variance < 0.5 * min(looks - np.floor(looks), np.ceil(looks) - looks)  # whole looks would be noticed
    mean, variance, third, m = log_gamma_moments(looks)
    log = np.log(power)
    assert log.mean() == pytest.approx(mean, abs=3 * np.sqrt(variance / n))
    assert log.var() == pytest.approx(variance, abs=3 * np.sqrt((m[4] - m[2] ** 2) / n))
    error = np.sqrt((m[6] - m[3] ** 2 - 6 * m[4] * m[2] + 9 * m[2] ** 3) / n)
    assert np.mean((log - log.mean()) ** 3) == pytest.approx(third, abs=3 * error)
    # neighbours: the covariance of a product of speckle of whole looks and of shares, which have the same coherence
    taps = impulse_response(Radar().range_resolution_m, Radar().range_spacing_m)
    coherence, whole = taps[1:] @ taps[:-1], np.ceil(looks)
    z, other = np.random.default_rng(1).normal(scale=np.sqrt(0.5), size=(2, 2, 400_000))
    powers = [np.sum(field**2, axis=0) for field in (z, coherence * z + np.sqrt(1 - coherence**2) * other)]
    of_shares = np.cov(*(beta_share(one.astype(np.float32), looks, int(whole)) for one in powers))[0, 1]
    expected = ((1 + coherence**2 / whole) * (1 + of_shares) - 1) * looks
    image = np.stack(images)[:, 12:-12, 12:-12].astype(float)
    found = np.corrcoef(image[:, 1:].ravel(), image[:, :-1].ravel())[0, 1]
    assert found == pytest.approx(expected, abs=0.01)
    assert found == pytest.approx(coherence**2, rel=0.15 if looks < 2 else 0.07)  # of whole looks


def test_image_is_finite_where_nothing_is_visible_and_nothing_is_noise():
    formation = ImageFormation(Radar(), (40, 40), -500.0)
    assert np.isfinite(decibels(formation.intensity(uniform(np.zeros((40, 40), dtype=np.float32)), 1))).all()


@pytest.mark.parametrize("axis", ["range", "azimuth"])
def test_resolution_finer_than_the_sampling_is_refused(axis):
    radar = Radar(**{f"{axis}_resolution_m": 2.0, f"{axis}_spacing_m": 1.8})
    with pytest.raises(ConfigError, match=rf"radar\.{axis}_resolution_m is 2, expected at least 2\.1\d .* 1\.8 m"):
        ImageFormation(radar, (20, 20), QUIET)


def test_a_law_beyond_single_precision_ends_in_a_sentence_about_its_material():
    """Its infinite power would become NaN in the pixels of its neighbours."""
    laws = dict.fromkeys(("dyke", "grass"), LAWS["mangia"])
    with pytest.raises(ConfigError, match=r"^materials\.grass: X1 = 390, .* give a sigma0 of 391 dB, expected at most "
                       r"380 dB, at an incidence of 0 degrees: X1 \+ X2 cos"):  # fmt: skip
        law_tables(("dyke", "grass"), laws, {"dyke": DYKE, "grass": [390.0, 0.0, 1.0, 5.0]})
    assert np.isfinite(law_tables(("grass",), laws, {"grass": [370.0, 0.0, 1.0, 5.0]})).all()


def test_the_band_limit_is_the_full_convolution():
    """Tiles and separable taps against one convolution of the whole amplitude by scipy."""
    shape = (300, 290)
    radar = Radar(looks=1)
    sigma0 = np.random.default_rng(3).random(shape, dtype=np.float32)
    amplitude = np.sqrt(sigma0) * circular_gaussian(9, 0, 1, shape) + np.float32(10**-0.5) * circular_gaussian(
        9, 0, 256, shape
    )
    taps = np.outer(
        impulse_response(radar.range_resolution_m, radar.range_spacing_m),
        impulse_response(radar.azimuth_resolution_m, radar.azimuth_spacing_m),
    )
    # along the border the impulse response has unit energy within the image
    energy = signal.convolve2d(np.ones(shape), taps**2, mode="same")
    expected = signal.fftconvolve(amplitude.astype(complex), taps, mode="same") / np.sqrt(energy)
    found = ImageFormation(radar, shape, -10.0).look(uniform(sigma0), 9)
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())


def test_single_material_images_sum_to_the_full_one(geometry, radar):
    laws, x = dict.fromkeys(("dyke", "grass"), LAWS["mangia"]), {"dyke": DYKE, "grass": GRASS}
    formation = ImageFormation(radar, geometry.shape, -500.0)
    looks = [
        formation.look(reflectivity(geometry, law_tables(geometry.names, some, x)), 3)
        for some in (laws, {"dyke": laws["dyke"]}, {"grass": laws["grass"]})
    ]
    assert (geometry.material == 0).any()  # where both meet in a pixel too
    np.testing.assert_allclose(looks[0], looks[1] + looks[2], atol=1e-5 * np.abs(looks[0]).max())


@pytest.mark.parametrize("place", [(0, 0), (64, 127), (77, 150), (50, 111), (140, 169)])
def test_a_changed_pixel_is_formed_anew_in_all_tiles_within_reach(place):
    """One pixel of another material, near the borders of tiles of 64 pixels: the rest of the image stays."""
    shape, radar = (141, 170), Radar(looks=1, range_spacing_m=1.6, azimuth_spacing_m=1.0)
    reach = [len(impulse_response(r, s)) // 2 for r, s in ((2.0, 1.6), (3.5, 1.0))]
    assert reach == [10, 28]
    formation = ImageFormation(radar, shape, QUIET)
    cells = uniform(np.ones(shape, dtype=np.float32))
    cells.material[place[0] * shape[1] + place[1]] = 2
    changed = np.array([False, False, True])
    tiles = formation.touched(cells, changed)
    found = np.zeros(shape, dtype=bool)
    for top, left, bottom, right in tiles:
        found[top:bottom, left:right] = True
    expected = np.zeros(shape, dtype=bool)
    for top in range(0, shape[0], 64):
        for left in range(0, shape[1], 64):
            away = [max(start - at, at - (min(start + 64, n) - 1), 0)
                    for start, at, n in zip((top, left), place, shape, strict=True)]  # fmt: skip
            expected[top : top + 64, left : left + 64] = away[0] <= reach[0] and away[1] <= reach[1]
    np.testing.assert_array_equal(found, expected)
    before = formation.intensity(cells, 5)
    cells.power[cells.material == 2] = 1000.0
    again = formation.intensity(cells, 5, before.copy(), tiles)
    np.testing.assert_array_equal(again, formation.intensity(cells, 5))
    assert np.count_nonzero(again != before) > 300


def test_noise_follows_the_rows(geometry, radar):
    """Dark ground: the image's level in each third of the rows is the table's there."""
    table = [(float(geometry.flat_incidence_deg[0]), -25.0), (float(geometry.flat_incidence_deg[-1]), -15.0)]
    noisy = radar.model_copy(update={"nesz_db": table, "radiometry": "beta0", "looks": 16})
    image = BuiltinSimulator(geometry, noisy, {}).run({}, 3)
    for part in np.array_split(np.arange(geometry.shape[0]), 3):
        power = 10 ** (image[part, 12:-12:2].astype(float) / 10)
        incidence = np.radians(geometry.flat_incidence_deg[part])
        nesz = np.interp(geometry.flat_incidence_deg[part], *zip(*table, strict=True))
        expected = (10 ** (nesz / 10) / np.sin(incidence)).mean()  # beta0 is sigma0 over the sine
        # 3 sigma; a resolution cell is at least two of these pixels
        assert power.mean() == pytest.approx(expected, rel=3 / np.sqrt(16 * power.size / 4))


def test_results_do_not_depend_on_the_number_of_threads(scene, monkeypatch):
    monkeypatch.setattr(image, "_TILE", 16)
    radar = Radar(altitude_m=1000.0, nesz_db=-20.0, radiometry="gamma0_rtc")
    found = []
    for threads in (1, 3):
        monkeypatch.setattr(compiled._config, "NUMBA_NUM_THREADS", threads)
        geometry = make_geometry(scene, radar)
        laws = dict.fromkeys(geometry.names, LAWS["mangia"])
        tables = law_tables(geometry.names, laws, {"dyke": DYKE, "grass": GRASS})
        power = reflectivity(geometry, tables)
        found.append((geometry, power.power, ImageFormation(radar, geometry.shape, -20.0).intensity(power, 7)))
    for name, value in vars(found[0][0]).items():
        np.testing.assert_array_equal(getattr(found[1][0], name), value)
    for one, other in zip(found[0][1:], found[1][1:], strict=True):
        np.testing.assert_array_equal(one, other)
