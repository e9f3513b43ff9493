from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import drawn_target
from scipy import stats
from scipy.ndimage import uniform_filter

from radcal import skewnormal
from radcal.config import Radar, TargetConfig, Validation
from radcal.ground.levels import offset_levels
from radcal.ground.one_incidence import incidence_span_deg
from radcal.ground.pixels import eligible_pixels
from radcal.image.model import Measurement
from radcal.storage.dataclass_groups import same
from radcal.targets.target import Targets
from radcal.targets.target_fit import sampling_rms
from radcal.words import sentence

CONFIG = TargetConfig(pixels=500)


def of(seed=1, validation=None, **changed):
    """Case with changed settings of the target."""
    target = TargetConfig(**{"pixels": 500, **changed})
    return SimpleNamespace(target=target, seed=seed, validation=validation, radar=Radar())


@pytest.fixture(scope="module")
def measurement(geometry):
    values = stats.skewnorm.rvs(2.0, -12.0, 4.0, size=geometry.shape, random_state=1)
    return Measurement(values.astype(np.float32), "test")


@pytest.fixture(scope="module")
def target(geometry, measurement):
    return drawn_target(of(), "dyke", geometry, measurement)


def test_pixels_are_drawn_without_replacement_from_the_eligible(geometry, measurement, target):
    assert target.pixels.size == len(set(target.pixels.tolist())) == 500
    allowed = eligible_pixels("dyke", geometry, measurement, CONFIG).pixels
    assert set(target.pixels.tolist()) <= set(allowed.tolist())
    np.testing.assert_array_equal(allowed, geometry.pixels("dyke", 1))
    assert target.eligible == allowed.size > 500
    # spread over the material, not its first 500
    assert np.median(target.pixels) == pytest.approx(np.median(allowed), rel=0.15)


def test_order_finds_the_pixels_in_a_record(geometry, measurement, target):
    np.testing.assert_array_equal(geometry.pixels("dyke")[target.order], target.pixels)
    record = measurement.image_db.ravel()[geometry.pixels("dyke")]  # what the store keeps
    np.testing.assert_array_equal(record[target.order], target.values_db)
    np.testing.assert_array_equal(target.incidence_deg, geometry.incidence_deg.ravel()[target.pixels])


def test_score_of_the_measured_values_is_zero(geometry, measurement, target):
    record = measurement.image_db.ravel()[geometry.pixels("dyke")]
    dp, rms = target.score(record)
    assert rms < 1e-6  # the target's parameters are rounded
    np.testing.assert_allclose(dp, target.dp, rtol=1e-4)
    shifted, rms = target.score(record + np.float32(1.0))
    np.testing.assert_allclose(shifted - target.dp, [1.0, 0.0, 0.0], atol=1e-3)
    grid = skewnormal.target_grid(target.dp)
    pdf = stats.skewnorm(target.dp[2], target.dp[0], target.dp[1]).pdf
    assert rms == pytest.approx(np.sqrt(np.mean((pdf(grid - 1.0) - pdf(grid)) ** 2)), rel=1e-2)


def test_target_is_the_fit_of_its_values(target):
    np.testing.assert_allclose(target.cp, skewnormal.fit(target.values_db).cp, atol=3e-5)
    np.testing.assert_allclose(target.cp, skewnormal.centred(target.dp))
    assert not target.at_boundary
    mean, variance = stats.skewnorm(2.0, -12.0, 4.0).stats("mv")
    assert target.cp[0] == pytest.approx(mean, abs=4 * np.sqrt(variance / 500))


def test_target_and_runs_are_fitted_alike(geometry, measurement):
    target = drawn_target(of(fit="penalised"), "dyke", geometry, measurement)
    likelihood = drawn_target(of(), "dyke", geometry, measurement)
    assert target.penalised
    np.testing.assert_allclose(target.cp, skewnormal.fit(target.values_db, penalised=True).cp, atol=3e-5)
    assert skewnormal.density_rms(target.dp, likelihood.dp) > 1e-5
    record = measurement.image_db.ravel()[geometry.pixels("dyke")]
    assert target.score(record)[1] < 1e-6
    # the samples behind the sampling error are of the same density but for the fit
    assert target.rms_sampling == pytest.approx(likelihood.rms_sampling, rel=0.15)


def test_correlated_pixels_have_larger_standard_errors(geometry):
    noise = np.random.default_rng(3).normal(size=geometry.shape)
    smooth = uniform_filter(noise, 3) * 3.0
    white, correlated = (
        drawn_target(of(), "dyke", geometry, Measurement(image.astype(np.float32), "test")) for image in (noise, smooth)
    )
    assert correlated.effective < 0.7 * white.effective
    relative = [target.cp_error[0] / target.cp[1] for target in (white, correlated)]
    assert relative[1] > 1.2 * relative[0]


def test_draw_depends_on_seed_and_material_only(geometry, measurement, target):
    again = drawn_target(of(), "dyke", geometry, Measurement(measurement.image_db + 3, "other"))
    np.testing.assert_array_equal(again.pixels, target.pixels)
    other = drawn_target(of(seed=2), "dyke", geometry, measurement)
    assert not np.array_equal(other.pixels, target.pixels)
    assert drawn_target(of(), "dyke", geometry, measurement).rms_sampling == target.rms_sampling


def test_fewer_pixels_than_wanted_are_all_taken(geometry, measurement):
    target = drawn_target(of(pixels="all", margin_px=3), "dyke", geometry, measurement)
    np.testing.assert_array_equal(target.pixels, geometry.pixels("dyke", 3))
    assert target.eligible == target.pixels.size


def test_a_material_seen_at_one_incidence_is_level_only(geometry, measurement):
    targets = Targets({name: drawn_target(of(), name, geometry, measurement) for name in ("dyke", "grass")})
    assert not any("one incidence" in line for line in targets.sentences())
    narrow = replace(targets["grass"], incidence_deg=np.linspace(38.92, 39.07, 500, dtype=np.float32))
    (line,) = [line for line in Targets({**targets, "grass": narrow}).sentences() if "one incidence" in line]
    assert line.startswith("target of grass: 500 pixels")
    # a range that the error of the incidence explains
    span = incidence_span_deg(targets["dyke"].incidence_deg)
    doubtful = SimpleNamespace(incidence_error_deg=span / 3.0, classes=SimpleNamespace(size=4))
    assert replace(targets["dyke"], classes=doubtful).level_only
    assert not targets["dyke"].level_only


def test_round_trip_is_exact(geometry, measurement, tmp_path):
    levels = offset_levels("offset", {"grass": (1.5, 0.25)})
    grass = drawn_target(of(fit="penalised"), "grass", geometry, measurement)
    dyke = drawn_target(of(validation=Validation(rows=20)), "dyke", geometry, measurement)
    targets = Targets({"grass": grass, "dyke": dyke}, levels, 3.5)
    targets.write(tmp_path / "targets.h5")
    back = Targets.read(tmp_path / "targets.h5")
    assert list(back) == ["grass", "dyke"]
    assert same(dict(back), dict(targets))
    assert same(back.levels, levels)
    assert back.looks == 3.5


def test_sampling_rms_is_what_fresh_scipy_samples_give():
    xi, omega, alpha = dp = skewnormal.direct([0.0, 3.0, 0.5])
    found = []
    for k in range(150):
        sample = stats.skewnorm.rvs(alpha, xi, omega, size=1000, random_state=k)
        found.append(skewnormal.density_rms(skewnormal.fit(sample).dp, dp))
    own = sampling_rms(dp, 1000, np.random.default_rng(2), draws=300)
    assert own == pytest.approx(np.median(found), rel=0.15)


def test_the_level_is_told_where_a_fixed_law_or_a_mapping_shows_it():
    for normalisation, differences, told in (
        ("none", {"grass": (0.3, 0.2)}, True),
        ("none", {}, False),
        ("offset", {"grass": (1.4, 0.2)}, True),
    ):
        levels = offset_levels(normalisation, differences)
        assert Targets({}, levels).sentences() == [f"levels: {sentence(levels.finding)}"] * told
