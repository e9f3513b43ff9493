"""Compiled parts of the bins' likelihood against scipy, for several curves, bins and errors at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import interp1d
from scipy.stats import moment, multivariate_normal

from radcal.assessment.compiled_bins import cumulants_at, shifted_cumulants, whitened

RNG = np.random.default_rng(5)
GRID = np.arange(21.0)
CURVES = np.cumsum(RNG.normal(-1.0, 1.0, (3, GRID.size)), axis=1)
PLACES = np.array([[2.25, 3.5, 6.75, 7.0], [10.1, 11.9, 16.3, 20.0]])


def moments(levels: np.ndarray) -> np.ndarray:
    return np.stack([levels.mean(axis=-1), moment(levels, 2, axis=-1), moment(levels, 3, axis=-1)], axis=-1)


@pytest.mark.parametrize("noise_db", [-np.inf, -8.0])
def test_cumulants_of_levels_and_noise(noise_db: float):
    levels = interp1d(GRID, CURVES)(PLACES)
    power = 10.0 ** (levels / 10.0) + 10.0 ** (noise_db / 10.0)
    assert cumulants_at(CURVES, PLACES, noise_db) == pytest.approx(moments(10.0 * np.log10(power)), rel=1e-10)


def test_change_of_cumulants_by_errors_of_the_places():
    centre, offsets = 9.0, np.array([-1.2, 0.1, 0.9])
    slopes, spreads = RNG.uniform(0.6, 1.3, (3, 2)), RNG.uniform(0.2, 3.0, (3, 2))
    found = shifted_cumulants(CURVES, PLACES, centre, slopes, spreads, offsets)
    for m, curve in enumerate(CURVES):
        at = interp1d(GRID, curve)
        for n, places in enumerate(PLACES):
            moved = np.add.outer(centre + slopes[m, n] * (places - centre), spreads[m, n] * offsets).ravel()
            wanted = moments(at(np.clip(moved, 0.0, 20.0))) - moments(at(places))
            assert found[m, n] == pytest.approx(wanted, rel=1e-9, abs=1e-11)


def test_whitened_differences_have_the_density_of_their_covariance():
    n, count = 4, 5
    difference = RNG.normal(size=(count, 3 * n))

    def covariance(size: int) -> np.ndarray:
        root = RNG.normal(size=(size, size + 3))
        return np.asarray(root @ root.T)

    base, patches, cells = covariance(3 * n), covariance(n), covariance(n)
    between, within, error = (
        RNG.uniform(0.1, 3.0, count),
        RNG.uniform(0.1, 3.0, count),
        RNG.uniform(0.1, 2.0, (count, 3)),
    )
    log_sds = np.array([[covariance(n), covariance(n)], [np.zeros((n, n)), covariance(n)]])
    log_sds[1, 0] = log_sds[0, 1]
    found, log_determinant = whitened(difference, base, between, patches, within, cells, log_sds, error)
    for m in range(count):
        whole = base + np.diag(np.repeat(error[m] ** 2, n))
        whole[:n, :n] += between[m] * patches + within[m] * cells
        both = np.array([between[m], within[m]])
        whole[n : 2 * n, n : 2 * n] += np.einsum("a,b,abij->ij", both, both, log_sds)
        wanted = multivariate_normal(cov=whole).logpdf(difference[m])
        density = -0.5 * (found[m] @ found[m]) - log_determinant[m] - 1.5 * n * np.log(2.0 * np.pi)
        assert density == pytest.approx(wanted, rel=1e-10)


def test_a_covariance_that_is_none_gives_nan():
    found, log_determinant = whitened(
        np.ones((1, 3)), np.diag([1.0, -1.0, 1.0]), np.zeros(1), np.zeros((1, 1)), np.zeros(1), np.zeros((1, 1)),
        np.zeros((2, 2, 1, 1)), np.zeros((1, 3)),
    )  # fmt: skip
    assert np.isnan(log_determinant[0])
    assert np.isnan(found[0, 1:]).all()
