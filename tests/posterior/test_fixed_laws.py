"""What fixed materials say of level, radiometry and each other's laws."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, image_of_fixed, made_cells, observed, seen_cells
from scipy.stats import halfnorm, lognorm, multivariate_normal, t

from radcal.config import Uncertainty
from radcal.posterior import fixed_laws
from radcal.posterior.effects import FORM_DEG, Observed, common_columns, form_basis
from radcal.posterior.fixed_laws import _Scales, apart_db

CONFIG = Uncertainty(walkers=64, steps=1500)
BRIEF = Uncertainty(walkers=32, steps=100)
LEVEL = 0


def fixed(errors_db, level_db=0.0, seed=1, area=0.0, **keys):
    """Fixed materials: the image is brighter than the simulated one by the level and by the error of each law."""
    rng = np.random.default_rng(seed)
    return {
        name: observed(seen_cells(rng, 120, added_db=level_db + error, area=area, **keys))
        for name, error in errors_db.items()
    }


RIGHT = {"water": 0.1, "wood": -0.2, "road": 0.15, "grass": 0.0}


def test_in_a_few_steps_there_is_a_level_and_no_convergence():
    found = image_of_fixed(fixed(RIGHT, 1.6), [0.0], BRIEF, False, 3)
    assert found.levels_db[0][1] == pytest.approx(1.6, abs=0.4)
    assert not found.sampled


@pytest.mark.slow
def test_one_wrong_law_is_named_and_is_no_level():
    found = image_of_fixed(fixed({**RIGHT, "water": 2.1}), [0.0], CONFIG, False, 3)
    low, middle, high = found.levels_db[0]
    assert low < 0.0 < high
    assert abs(middle) < 0.3
    assert found.laws_db["water"][0] > 1.0
    assert found.laws_db["water"][1] == pytest.approx(2.1, abs=0.45)
    assert max(abs(error[1]) for name, error in found.laws_db.items() if name != "water") < 0.6


@pytest.mark.parametrize(("offset", "sd"), [(False, 0.4 * np.sqrt(2.0)), (True, 20.0)])
def test_without_fixed_materials_there_are_the_priors(offset, sd):
    config = Uncertainty(level_db=0.4, area=0.07, field_db=0.6)
    found = image_of_fixed({}, [0.3, -0.2], config, offset, 3)
    (shared,) = found.shared.values()
    np.testing.assert_array_equal(shared.mean, np.zeros(9))
    wanted = [sd**2, 0.07**2, 1.0, 1.0, sd**2, 0.07**2, 1.0, 1.0, 1.0]
    np.testing.assert_allclose(shared.covariance, np.diag(wanted))
    np.testing.assert_allclose(found.levels_db, [[-1.6448536 * sd, 0.0, 1.6448536 * sd]] * 2, rtol=1e-3, atol=1e-9)
    assert shared.field == (np.log(0.6), 0.42)
    assert (found.laws_db, found.apart_db, found.sampled) == ({}, {}, True)


def two_passes():
    rng = np.random.default_rng(5)
    each = [seen_cells(rng, n, fields=4) for n in (14, 9)]
    shares = [rng.uniform(0.0, 0.5, one.size) for one in each]
    noise = [np.full(one.size, -25.0) for one in each]
    each = [
        replace(one, share=share, noise_db=floor, beside_db=rng.normal(0.0, 0.3, one.size))
        for one, share, floor in zip(each, shares, noise, strict=True)
    ]
    law = [np.asarray(LINE(np.radians(one.incidence_deg), LINE_X)) for one in each]
    return Observed(each, law, [np.full(one.size, -0.25) for one in each])


def test_columns_of_the_shared_effects():
    of, areas = two_passes(), [0.4, -0.3]
    config = Uncertainty(noise_db=1.5, incidence_floor_deg=0.3, point_spread=0.2)
    found = common_columns(of, areas, config)
    assert found.shape == (23, 9)
    middle = np.concatenate(of.law_db).mean()
    for k, first in ((0, 0), (1, 14)):
        cells = of.cells[k]
        for j in range(cells.size):
            signal = 1.0 - cells.share[j]
            wanted = np.zeros(9)
            wanted[4 * k : 4 * k + 4] = (
                1.0,
                signal * (cells.area_db[j] - areas[k]),
                1.5 * cells.share[j],
                0.3 * signal * -0.25,
            )
            wanted[8] = -0.25 * 0.2 * signal * (of.law_db[k][j] - middle)
            np.testing.assert_allclose(found[first + j], wanted, atol=1e-12)


def test_what_is_above_the_simulated_mean_counts_law_and_noise():
    of = two_passes()
    wanted = [
        one.measured_db - one.beside_db - 10.0 * np.log10(10.0 ** (law / 10.0) + 10.0**-2.5)
        for one, law in zip(of.cells, of.law_db, strict=True)
    ]
    np.testing.assert_allclose(of.above_db, np.concatenate(wanted))
    assert of.size == 23


def test_the_likelihood_is_that_of_a_dense_normal_distribution():
    """Of two materials in two passes, with all effects written out, at scales on the grid of the tables."""
    rng, of = np.random.default_rng(5), two_passes()
    other = Observed(
        [replace(one, measured_db=one.measured_db + rng.normal(0.0, 0.4, one.size)) for one in of.cells[::-1]],
        of.law_db[::-1],
        of.slope_db[::-1],
    )
    config = Uncertainty(level_db=0.7, area=0.2, fixed_slope=0.3)
    materials, areas = {"a": of, "b": other}, [0.1, 0.2]
    chances = {(0, 1): 0.3, (-1, 0): 0.7}
    scales = _Scales(materials, areas, config, False, chances)
    grid = np.log(np.geomspace(0.01, 3.0, 32)), np.log(np.geomspace(0.01, 8.0, 32))
    at = np.concatenate([
        [np.log(0.5), grid[0][17], np.log(0.9), np.log(0.6)], np.log([1.3, 0.8]), np.log([0.7, 2.2]), grid[1][[19, 24]],
    ])[None]  # fmt: skip
    assert scales.dimension == at.size
    sizes = [one.size for one in materials.values()]
    columns, covariance = [], np.zeros((sum(sizes), sum(sizes)))
    for k, one in enumerate(materials.values()):
        angle, patch = one.together("incidence_deg"), one.together("patch")
        error = 0.9**2 * [0.7, 2.2][k]
        basis = form_basis(angle, np.arange(angle.min() - 0.5, angle.max() + 8.0, 4.0), 4)
        slope, signal = (angle - angle.mean()) / 10.0, 1.0 - one.together("share")
        own = error + 0.3**2 * error * np.outer(slope, slope) + 0.6**2 * basis @ basis.T
        own *= np.outer(signal, signal)  # the power of noise changes by no error of a law
        own += np.diag(one.together("variance") + np.exp(2.0 * grid[0][17]))
        own += np.exp(2.0 * grid[1][[19, 24][k]]) * (patch[:, None] == patch)
        part = slice(sum(sizes[:k]), sum(sizes[: k + 1]))
        covariance[part, part] = own
        columns.append(common_columns(one, areas, config))
    shared = np.concatenate(columns)
    prior = np.array([0.49 * 1.3, 0.04, 1.0, 1.0, 0.49 * 0.8, 0.04, 1.0, 1.0, 1.0])
    covariance += (shared * prior) @ shared.T
    # an area term changes the expected level of its pass by the mean area, too
    every = [np.array([0, 0, 0, 0, 0.2, 1, 0, 0, 0.0]), np.array([-0.1, -1, 0, 0, 0, 0, 0, 0, 0])]
    above = np.concatenate([one.above_db for one in materials.values()])
    constant, wanted = 0.5 * above.size * np.log(2.0 * np.pi), []
    for expected, chance in zip(every, chances.values(), strict=True):
        density = multivariate_normal.logpdf(above - shared @ expected, np.zeros(above.size), covariance)
        wanted.append(density + constant + np.log(chance))
    np.testing.assert_allclose(scales.log_densities(at)[0], wanted, atol=1e-6)
    assert scales.log_likelihood(at)[0] == pytest.approx(np.logaddexp(*wanted), abs=1e-6)
    # the draws of the shared effects are those of a normal regression
    many = np.repeat(at, 20_000, axis=0)
    for expected, area_sd in ((every[0], None), (np.zeros(9), 1.0)):
        own = prior.copy()
        own[[1, 5]] = prior[[1, 5]] if area_sd is None else area_sd**2
        whole = covariance + (shared * (own - prior)) @ shared.T
        draws = scales.effects(many, expected, np.random.default_rng(2), area_sd)
        gain = (shared * own).T @ np.linalg.inv(whole)
        sd = np.sqrt(np.diag(np.diag(own) - gain @ shared * own))
        mean = expected + gain @ (above - shared @ expected)
        np.testing.assert_allclose((draws.mean(axis=0) - mean) / sd, 0.0, atol=0.03)
        np.testing.assert_allclose(draws.std(axis=0), sd, rtol=0.03)
    draws, values = scales.effects(many, every[0], np.random.default_rng(2)), above - shared @ every[0]
    # ... and so is the error of a law, given nothing but the values
    ones = np.concatenate([np.zeros(sizes[0]), 1.0 - other.together("share")])
    error = 0.9**2 * 2.2
    mean = error * ones @ np.linalg.solve(covariance, values)
    variance = error - error**2 * ones @ np.linalg.solve(covariance, ones)
    drawn = scales.law_errors(many, draws, 1, np.random.default_rng(4))
    assert drawn.mean() == pytest.approx(mean, abs=0.03 * np.sqrt(variance))
    assert drawn.std() == pytest.approx(np.sqrt(variance), rel=0.03)
    # an offset has a level of 20 dB, whatever its factor
    removed = _Scales(materials, areas, config, True, chances)
    np.testing.assert_allclose(removed.prior_variance(at)[0, [0, 4]], 400.0)


def test_the_error_of_a_form_is_a_gaussian_process():
    angle, knots = np.linspace(25.0, 50.0, 11), np.arange(24.0, 54.0, 2.0)
    basis = form_basis(angle, knots, 8)
    away = angle[:, None] - angle
    np.testing.assert_allclose(basis @ basis.T, np.exp(-0.5 * (away / FORM_DEG) ** 2), atol=0.03)
    assert form_basis(angle, knots, 3).shape == (11, 3)
    np.testing.assert_allclose(form_basis(angle, knots, 3), basis[:, :3])


def test_the_factor_of_a_variance_makes_a_t_distribution():
    """A normal distribution whose variance is multiplied by w is a t distribution of 4 degrees of freedom."""
    w = np.linspace(-6.0, 8.0, 4001)
    weight = np.exp(fixed_laws._scale_mixture(w))
    weight /= weight.sum()
    for x in (0.0, 1.3, 4.0):
        density = (weight * np.exp(-0.5 * (x**2 * np.exp(-w) + w))).sum() / np.sqrt(2.0 * np.pi)
        assert density == pytest.approx(t.pdf(x, 4.0), rel=2e-3)


def test_the_prior_of_all_scales():
    scales = _Scales({"a": two_passes(), "b": two_passes()}, [0.0, 0.0], CONFIG, False, {(0, 0): 1.0})
    rng = np.random.default_rng(1)
    at = rng.normal(0.0, 0.5, (40, scales.dimension))
    wanted = lognorm.logpdf(np.exp(at[:, 0]), 0.42, scale=CONFIG.field_db) + at[:, 0]
    for k, scale in ((1, 0.4), (2, CONFIG.fixed_law_db), (3, CONFIG.form_db)):
        wanted += halfnorm.logpdf(np.exp(at[:, k]), scale=scale) + at[:, k]
    wanted += fixed_laws._scale_mixture(at[:, 4:8]).sum(axis=1)
    wanted += (-0.5 * (at[:, 8:] - at[:, :1]) ** 2).sum(axis=1)
    found = scales.log_prior(at)
    np.testing.assert_allclose(found - found[0], wanted - wanted[0])
    at[3, 2] = 9.1
    assert np.isneginf(scales.log_prior(at)[3])


def test_materials_of_few_angles_have_fewer_components():
    """Knots of one or two angles are fewer than the components of the error of a form."""
    narrow = made_cells(np.full(12, -9.0), np.linspace(40.0, 40.4, 12))
    (table,) = _Scales({"a": observed(narrow)}, [0.0], CONFIG, False, {(0,): 1.0}).tables
    size = 2 + 4 + 5 + 1
    assert table.at(np.zeros(1), np.zeros(1))[0].shape == (1, size, size)


@pytest.mark.parametrize("offset", [False, True])
def test_scales_of_zero_are_allowed(offset):
    """Fixed laws without any error, and an image whose level is exact."""
    config = BRIEF.model_copy(update={"fixed_law_db": 0.0, "level_db": 0.0, "area": 0.0, "steps": 20})
    found = image_of_fixed(fixed(RIGHT), [0.0], config, offset, 3)
    (shared,) = found.shared.values()
    assert np.isfinite(shared.mean).all()
    assert np.isfinite(shared.covariance).all()
    assert abs(found.laws_db["water"][1]) < 0.05
    assert abs(shared.mean[LEVEL]) < (0.5 if offset else 1e-3)


def test_image_minus_law_is_a_mean_with_the_effects_of_its_fields():
    """Three cells in two fields; a law of -7, -8 and -9 dB, to which noise adds 3.0103, 0 and 1.7609 dB."""
    noise = np.array([-7.0, -np.inf, -9.0 + 10.0 * np.log10(0.5)])
    cells = made_cells(
        [-4.0, -6.5, -7.0], [30.0, 33.0, 36.0], beside_db=np.array([0.5, -0.2, 0.4]), noise_db=noise,
        patch=np.array([4, 4, 9]), pixels=np.array([20, 30, 50]), variance=np.array([0.05, 0.1, 0.2]),
    )  # fmt: skip
    middle = 0.2 * (2.5 - 3.0103) + 0.3 * 1.7 + 0.5 * (1.6 - 1.7609)
    half = 1.6449 * np.sqrt(0.04 * 0.05 + 0.09 * 0.1 + 0.25 * 0.2 + 0.6**2 * (0.5**2 + 0.5**2))
    found = apart_db(cells, cells.above_db(np.array([-7.0, -8.0, -9.0])), 0.6)
    np.testing.assert_allclose(found, [middle - half, middle, middle + half], atol=1e-4)
