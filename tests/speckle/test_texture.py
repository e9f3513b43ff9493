"""Speckle and texture in dB, against scipy's log-gamma law and sampling."""

import numpy as np
import pytest
from scipy import stats

from radcal.speckle.texture import equal_texture, log_speckle_cumulants, order_of_texture, texture_db, texture_order


@pytest.mark.parametrize("looks", [1.0, 2.5, 4.0, 40.0])
def test_cumulants_are_those_of_scipys_log_gamma_law(looks):
    mean, variance, skewness = stats.loggamma(looks, scale=10.0 / np.log(10.0)).stats("mvs")
    found = log_speckle_cumulants(looks)
    np.testing.assert_allclose(found[0], mean - 10.0 * np.log10(looks), atol=1e-12)
    np.testing.assert_allclose(found[1:], [variance, skewness * variance**1.5], rtol=1e-10)


def test_cumulants_take_arrays():
    assert log_speckle_cumulants([[1.0, 2.0]]).shape == (1, 2, 3)


def test_texture_lowers_the_looks_seen_in_db():
    rng = np.random.default_rng(1)
    n = 400_000
    speckle = 10.0 * np.log10(rng.gamma(4.0, 0.25, n))
    texture = texture_db(rng.random(n), texture_order(4.0, 2.5))
    wanted = log_speckle_cumulants(2.5)[1]
    assert np.var(speckle + texture) == pytest.approx(wanted, rel=0.01)
    assert np.mean(10.0 ** (texture / 10.0)) == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize("effective", [4.0, 4.3])
def test_no_texture_where_looks_are_the_sensors(effective):
    order = texture_order(4.0, effective)
    assert order == np.inf
    assert not texture_db([0.1, 0.9], order).any()


def test_texture_is_a_smooth_function_of_its_order():
    u = np.random.default_rng(2).random(100)
    assert np.abs(texture_db(u, 5.0) - texture_db(u, 5.001)).max() < 0.01


def test_equal_texture_adds_the_same_variance_in_db():
    there = equal_texture(4.0, 2.5, 8.0)
    added = log_speckle_cumulants(2.5)[1] - log_speckle_cumulants(4.0)[1]
    assert log_speckle_cumulants(there)[1] - log_speckle_cumulants(8.0)[1] == pytest.approx(added, rel=1e-9)
    assert equal_texture(8.0, there, 4.0) == pytest.approx(2.5, rel=1e-9)
    assert equal_texture(4.0, 4.2, 8.0) == pytest.approx(8.4)  # above the sensor's looks there is no texture
    assert equal_texture(4.0, 2.5, 4.0) == 2.5


@pytest.mark.parametrize("sd_db", [0.5, 1.5, 6.0])
def test_a_texture_of_a_standard_deviation_has_it(sd_db):
    assert texture_db((np.arange(20_000) + 0.5) / 20_000, order_of_texture(sd_db)).std() == pytest.approx(
        sd_db, rel=0.01
    )
    assert order_of_texture(0.0) == np.inf
