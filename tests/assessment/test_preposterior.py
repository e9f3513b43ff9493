"""Expected narrowing of a band by a further pass: against Gaussian formulas worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from radcal.assessment.budget import Budget
from radcal.assessment.curves import GRID_DEG
from radcal.assessment.posterior import KeptDraws
from radcal.assessment.preposterior import (
    Sight,
    equivalent_sd,
    half_widths_after,
    half_widths_now,
    normal_scores,
    sight_of,
)
from radcal.config import Radar, TargetConfig
from radcal.radar.laws import LAWS
from radcal.radar.texture import log_speckle_cumulants

EXACT = Budget(0.0, 0.5, 0.0, 0.0, 0.0)
NO_FIELDS = np.zeros(2)
AT_30, AT_50 = np.array([120]), np.array([200])  # places of 30 and 50 degrees in the grid


def sight(
    angle: int = 120, independent: float = 100.0, noise_db: float = -300.0, fields: float = 0.25, number: int = 0
) -> Sight:
    """One bin, whose pixels all have the incidence of one place of the grid; with a number, all lie in this field."""
    weights = np.zeros((1, GRID_DEG.size))
    weights[0, angle] = 1.0
    one = np.ones((1, 1))
    incidence, edges = np.full(9, GRID_DEG[angle]), GRID_DEG[[angle, angle]]
    count, noise = np.array([independent]), np.array([noise_db])
    known = (np.array([number]), one) if number else (np.empty(0, dtype=np.int64), one[:, :0])
    return Sight(np.arange(9), incidence, edges, weights, fields * one, 0.5 * one, count, noise, *known)


def lines(count: int = 4000, level_sd: float = 0.8, slope_sd: float = 0.06) -> np.ndarray:
    """Curves -10 + a + b (phi - 30 deg), a and b normal and independent [dB]."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(0.0, level_sd, (count, 1)), rng.normal(0.0, slope_sd, (count, 1))
    return -10.0 + a + b * (GRID_DEG - 30.0)


def kept(count: int, fields_db: Any = (0.0, 0.0), looks: Any = 4.0) -> KeptDraws:
    return KeptDraws(np.zeros((count, 4)), np.full(count, looks), np.full((count, 2), fields_db))


def sd(values: np.ndarray) -> float:
    """Standard deviation of a normal distribution with the 90 % interval of the values."""
    return float(half_widths_now(values[:, None])[0] / 1.6448536269514722)


def sd_left(curves: np.ndarray, seen: list[Sight], at: np.ndarray, budget: Budget = EXACT, **more: Any) -> float:
    draws = kept(len(curves), more.get("fields", NO_FIELDS))
    half_width = half_widths_after(curves, draws, more.get("own", []), seen, budget, at)
    return float(half_width[0] / 1.6448536269514722)


def test_a_known_variance_shrinks_as_two_normal_measurements_do() -> None:
    curves = lines()
    prior, speckle = sd(curves[:, 120]) ** 2, float(log_speckle_cumulants(4.0)[1]) / 7.0
    expected = np.sqrt(prior * speckle / (prior + speckle))
    assert sd_left(curves, [sight(independent=7.0)], AT_30) == pytest.approx(expected, rel=1e-6)
    twice = np.sqrt(1.0 / (1.0 / prior + 2.0 / speckle))
    assert sd_left(curves, [sight(independent=7.0)] * 2, AT_30) == pytest.approx(twice, rel=1e-6)


@pytest.mark.parametrize(("number", "common"), [(3, 0.36), (5, 0.0)])
def test_a_pass_over_the_same_field_does_not_measure_its_effect_again(number: int, common: float) -> None:
    """Level a, known from one pass: a further pass has an error of its own, and the effect of field 3 in common.

    By hand: the draws have the variance p; the errors of the passes have the variances c + s and c + t, and the
    covariance c if the field is the same.
    """
    curves = lines(slope_sd=0.0)
    p, speckle = sd(curves[:, 120]) ** 2, float(log_speckle_cumulants(4.0)[1])
    s, t, c = speckle / 40.0, speckle / 90.0, 0.36
    own, further = sight(independent=40.0, fields=1.0, number=3), sight(independent=90.0, fields=1.0, number=number)
    gain = common / (c + s)
    error = c + t - gain * common
    expected = np.sqrt(p - p**2 * (1.0 - gain) ** 2 / (p * (1.0 - gain) ** 2 + error))
    found = sd_left(curves, [further], AT_30, fields=np.array([0.6, 0.0]), own=[own])
    assert found == pytest.approx(expected, rel=1e-6)
    # by far more is left of the level if its error is that of the field
    assert (found > 0.8 * np.sqrt(p)) == (number == 3)


def test_shares_of_fields_that_two_passes_have_in_common() -> None:
    one, other = (sight(number=1) for _ in range(2))
    two = np.array([[0.2, 0.8], [0.7, 0.3]])
    one = replace(one, weights=np.ones((2, 361)), fields=np.array([4, 9]), shares=two)
    other = replace(other, fields=np.array([2, 9]), shares=np.array([[0.4, 0.6]]))
    np.testing.assert_allclose(one.in_common(other), [[0.8 * 0.6], [0.3 * 0.6]])
    np.testing.assert_allclose(other.in_common(one), [[0.8 * 0.6, 0.3 * 0.6]])


def test_one_draw_far_away_changes_neither_scores_nor_the_standard_deviation_of_fields() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, (999, 2))
    scores = normal_scores(values)
    assert scores.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert scores.std(axis=0) == pytest.approx([sd(values[:, 0]), sd(values[:, 1])])
    assert (np.argsort(scores, axis=0) == np.argsort(values, axis=0)).all()
    far = values.copy()
    far[values.argmax(axis=0), [0, 1]] = 1e3
    np.testing.assert_allclose(normal_scores(far), scores)
    # half of the draws without an effect, half with 2 dB: 1.2816 and 1.6449 are the normal quantiles of 90 and 95 %
    half = np.repeat([[0.0, 0.3], [2.0, 0.3]], 500, axis=0)
    assert equivalent_sd(half) == pytest.approx([2.0 * 1.281552 / 1.644854, 0.3], rel=1e-5)
    assert equivalent_sd(np.zeros((9, 1))) == pytest.approx([0.0])
    half[-1] = 1e3
    assert equivalent_sd(half) == pytest.approx([2.0 * 1.281552 / 1.644854, 0.3], rel=0.01)


def test_looks_that_differ_between_draws_shift_the_means() -> None:
    """The mean of log speckle depends on the looks: a pass then says less of the level."""
    curves = lines(slope_sd=0.0)
    looks = np.exp(np.random.default_rng(8).normal(np.log(3.0), 0.4, len(curves)))
    left = half_widths_after(
        curves, replace(kept(len(curves)), looks=looks), [], [sight(independent=1e9)], EXACT, AT_30
    )
    shift = np.array([float(log_speckle_cumulants(x)[0]) for x in looks])
    p, q = curves[:, 120].var(), shift.var()
    assert float(left[0] / 1.6448536) == pytest.approx(np.sqrt(p * q / (p + q)), rel=0.05)


def test_without_a_pass_nothing_changes() -> None:
    curves = lines(500)
    some = np.arange(80, 240, 40)
    left = half_widths_after(curves, kept(500), [sight()], [], EXACT, some)
    assert left == pytest.approx(half_widths_now(curves[:, some]))


def test_a_pass_says_of_other_angles_what_the_draws_correlate() -> None:
    curves = lines()
    # at 30 degrees the slope is not seen: the level's part of the variance at 50 degrees goes
    assert sd_left(curves, [sight(independent=1e9)], AT_50) == pytest.approx(20.0 * 0.06, rel=0.05)
    # at 50 degrees level and slope are seen together
    total, level = 0.8**2 + (20.0 * 0.06) ** 2, 0.8**2
    left = np.sqrt(level * (1.0 - level / total))
    assert sd_left(curves, [sight(200, independent=1e9)], AT_30) == pytest.approx(left, rel=0.05)


@pytest.mark.parametrize(
    ("budget", "fields", "variance"),
    [
        (Budget(0.4, 0.5, 0.0, 0.0, 0.0), NO_FIELDS, 0.16),
        (EXACT, np.array([0.6, 0.0]), 0.36 * 0.25),
        (EXACT, np.array([0.0, 0.6]), 0.36 * 0.5),
    ],
)
def test_level_and_fields_limit_what_a_pass_says(budget: Budget, fields: np.ndarray, variance: float) -> None:
    curves = lines()
    prior = sd(curves[:, 120]) ** 2
    expected = np.sqrt(prior * variance / (prior + variance))
    assert sd_left(curves, [sight(independent=1e9)], AT_30, budget, fields=fields) == pytest.approx(expected, rel=1e-5)


def test_an_error_of_the_noise_floor_counts_by_the_noise_in_the_mean_level() -> None:
    """Noise 10 dB below the mean of curves that differ much is a tenth of the power."""
    curves = lines(level_sd=3.0, slope_sd=0.0)
    seen = sight(independent=1e12, noise_db=-20.0)
    floor = 10.0 ** ((-20.0 - float(seen.means_db(curves).mean())) / 10.0)
    prior, variance = sd(seen.means_db(curves)[:, 0]) ** 2, (2.0 * floor) ** 2
    found = half_widths_after(curves, kept(len(curves)), [], [seen], Budget(0.0, 0.5, 0.0, 0.0, 0.0, 2.0), AT_30)
    ratio = float((found / half_widths_now(curves[:, AT_30]))[0])
    assert ratio == pytest.approx(np.sqrt(variance / (prior + variance)), rel=1e-3)


def test_ground_in_the_noise_says_little() -> None:
    curves = lines(level_sd=0.1, slope_sd=0.0)
    clear, equal, deep = (sd_left(curves, [sight(independent=2000.0, noise_db=n)], AT_30) for n in (-60.0, -10.0, 10.0))
    assert clear < 0.5 * 0.1
    # at a noise as strong as the signal, half of a change of the signal is seen
    speckle, prior = float(log_speckle_cumulants(4.0)[1]) / 2000.0, sd(curves[:, 120]) ** 2
    assert equal == pytest.approx(np.sqrt(prior * (1.0 - 0.25 * prior / (0.25 * prior + speckle))), rel=1e-3)
    assert deep > 0.95 * 0.1


def test_what_a_pass_sees_of_a_material(geometry_of_slopes) -> None:
    geometry = geometry_of_slopes
    radar, target = Radar(nesz_db=-25.0), TargetConfig(margin_px=0, pixels=300)
    found = sight_of("slope", geometry, radar, target)
    assert found is not None
    usable = geometry.pixels("slope")[~geometry.layover.ravel()[geometry.pixels("slope")]]
    assert found.pixels.tolist() == usable.tolist()
    assert (found.edges_deg[0], found.edges_deg[-1]) == (30.0, 40.0)
    assert found.incidence_deg == pytest.approx(geometry.incidence_deg.ravel()[usable])
    assert found.weights.sum(axis=1) == pytest.approx(1.0)
    means = found.weights @ GRID_DEG
    assert (np.diff(means) > 0).all()
    # 480 pixels, of 1.5 m by 2.5 m, in resolution cells of 2 m by 3.5 m
    assert found.independent.sum() == pytest.approx(480.0 * 3.75 / 7.0)
    fewer = sight_of("slope", geometry, radar, TargetConfig(margin_px=0, pixels=100))
    assert fewer is not None
    assert fewer.independent.sum() == pytest.approx(100.0)
    assert found.noise_db == pytest.approx(-25.0)
    # two fields of unequal size: a bin with shares s and 1 - s has the correlation s^2 + (1 - s)^2
    assert found.patches.diagonal() == pytest.approx(0.6**2 + 0.4**2, abs=0.03)
    assert sight_of("patch", geometry, radar, target) is None  # 40 pixels


@pytest.fixture
def geometry_of_slopes():
    """25 rows of 24 columns: two fields of slope (12 and 8 columns) apart, a patch of 40 pixels, a row in layover."""
    from radcal.radar.geometry import Geometry

    material = np.zeros((25, 24), dtype=np.uint8)
    material[:, :12], material[:, 16:] = 1, 1
    material[:10, 12:16] = 2
    incidence = np.broadcast_to(np.linspace(30.0, 40.0, 25)[:, None], material.shape).astype(np.float32)
    layover = np.zeros(material.shape, dtype=bool)
    layover[3] = True
    n = material.size
    return Geometry(
        shape=(25, 24), names=("slope", "patch"), cell_start=np.arange(n + 1, dtype=np.int32),
        cell_material=material.ravel(), facet_start=np.arange(n + 1, dtype=np.int32),
        facet_incidence=np.zeros(n, dtype=np.uint16), facet_weight=np.ones(n, dtype=np.float32), material=material,
        incidence_deg=incidence, layover=layover, shadow=np.zeros(material.shape, dtype=bool),
        flat_incidence_deg=np.linspace(30.0, 40.0, 25), ground=np.full((2, 25, 24), np.nan, dtype=np.float32),
    )  # fmt: skip


def test_curves_of_kept_draws_are_mean_power() -> None:
    x = np.array([[-24.0, 12.0, 9.0, 4.0], [-20.0, 9.0, 12.0, 2.0], [-22.0, 8.0, 5.0, 1.0]])
    kept = KeptDraws(x, np.array([4.0, 3.0, 2.0]), np.array([[1.0, 0.5], [0.0, 0.0], [2.0, 0.0]]))
    law = np.array([float(LAWS["mangia"](np.radians(35.0), one)) for one in x])
    # ln(10)/20 dB for each dB^2 of the fields' variance
    more = kept.curves_db(LAWS["mangia"])[:, 140] - law
    assert more == pytest.approx([0.115129 * 1.25, 0.0, 0.115129 * 4.0], abs=1e-5)
