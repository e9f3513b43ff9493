"""Recommended predictor of fields that were not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import polygamma
from scipy.stats import truncnorm

from radcal.assessment.constant import constants
from radcal.assessment.gain import Gain
from radcal.assessment.recommendation import (
    FieldCheck,
    fold_of_fields,
    half_width_db,
    leave_fields_out,
    recommend,
    share_among_cells,
    trend,
)
from radcal.calibration.grounds import GroundLaw, fit_grounds, refit
from radcal.calibration.law_fit import LawFit
from radcal.calibration.misfit import Method
from radcal.measurement.classes import make_classes
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
METHOD = Method(LAW, [[-80.0, 10.0], [0.0, 60.0], [0.0, 60.0], [0.0, 20.0]], looks=4.0)
STEEP, FLAT = np.array([-42.0, 32.0, 2.0, 4.0]), np.array([-18.0, 0.0, 0.0, 5.0])


def fields(seed: int, x: np.ndarray, places: list[tuple[float, float]], between: float = 0.3) -> Ground:
    """Fields of 12 cells, each at the angles of its own."""
    rng = np.random.default_rng(seed)
    patch, cell = np.repeat(np.arange(len(places)) + 3, 600), np.tile(np.repeat(np.arange(12), 50), len(places))
    low, high = np.array(places).T
    incidence = low[patch - 3] + (high - low)[patch - 3] * (cell + rng.uniform(0.0, 1.0, patch.size)) / 12.0
    values = LAW(np.radians(incidence), x) + between * rng.normal(size=len(places))[patch - 3]
    values = values + 10.0 * np.log10(rng.gamma(3.5, 1.0 / 3.5, patch.size))
    return Ground(values, incidence, patch, 100 * patch + cell)


APART = [(28.0 + 2.0 * k, 30.5 + 2.0 * k) for k in range(8)]


def found(ground: Ground):
    return fit_grounds({"field": ground}, {"field": METHOD})["field"]


def check(law) -> FieldCheck:
    return leave_fields_out(law, constants({"field": law.ground})["field"])


def test_no_fold_shares_a_field_with_another():
    patch = np.array([7, 3, 3, 12, 7, 5, 9, 12, 20, 21, 21])
    for folds, used in ((3, 3), (10, 7)):
        fold = fold_of_fields(patch, folds)
        assert all(np.unique(fold[patch == label]).size == 1 for label in patch)
        assert np.unique(fold).size == used
    assert fold_of_fields(np.full(4, 6)).tolist() == [0, 0, 0, 0]


@pytest.mark.slow
def test_a_law_that_fields_bear_out_is_recommended():
    law = found(fields(1, STEEP, APART))
    outcome = check(law)
    assert outcome.gain.fields == 8
    assert outcome.gain.better
    assert outcome.rmse_law_db < 0.6 * outcome.rmse_constant_db
    assert outcome.power > 2.0
    assert half_width_db(law) < 1.5
    choice = recommend(law, outcome, 1.5)
    assert choice.predictor == "average"
    assert choice.weight == outcome.weight > 0.85
    assert "geometric mean over 8 fields" in choice.why
    assert choice.why.endswith(": better by more than this error")


def test_a_flat_law_gets_less_weight_and_is_not_called_better():
    law = found(fields(2, FLAT, APART, between=0.8))
    choice = recommend(law, check(law), 1.5)
    assert 0.2 < choice.weight < 0.6
    assert choice.why.endswith(": not better by more than this error")


def test_a_wide_band_is_not():
    law = found(fields(1, STEEP, APART))
    outcome = check(law)
    wide = replace(law, fit=replace(law.fit, covariance=100.0 * law.fit.covariance))
    assert half_width_db(wide) == pytest.approx(10.0 * half_width_db(law))
    choice = recommend(wide, outcome, 1.5)
    assert choice.predictor == "constant"
    assert choice.weight == 0.0
    assert recommend(wide, outcome, 1.2 * half_width_db(wide)).weight == outcome.weight
    assert recommend(law, outcome, 0.8 * half_width_db(law)).predictor == "constant"
    assert "the law's linear 90 % band over the 5-95 % of the incidence, without the level's error, reaches +-" in choice.why


def test_one_field_tells_a_steep_law_from_its_own_gradient_and_a_weak_one_not():
    """0.4 dB a degree over 22 degrees, and 0.1 over 4, of a field whose effect may vary by 0.8 dB."""
    slope = {"steep": STEEP, "weak": np.array([-27.0, 9.0, 0.0, 4.0])}
    places = {"steep": [(28.0, 50.0)], "weak": [(34.0, 38.0)]}
    laws = {name: found(fields(4, x, places[name])) for name, x in slope.items()}
    assert trend(laws["weak"]) < 4.0 < trend(laws["steep"])
    outcomes = {name: check(law) for name, law in laws.items()}
    assert all(outcome.gain.fields == 0 for outcome in outcomes.values())
    choices = {name: recommend(law, outcomes[name], 1.5) for name, law in laws.items()}
    assert choices["steep"].predictor == "law"
    assert choices["weak"].predictor == "constant"
    assert "gradients inside of one field" in choices["weak"].why


@pytest.mark.slow
def test_fields_that_hold_all_angles_alike_are_silent():
    """Leaving such fields out says nothing, whatever it happens to say; the pixels inside say the law."""
    ground = fields(5, STEEP, APART)
    rng = np.random.default_rng(6)
    mixed = rng.permutation(ground.incidence_deg.size)
    alike = replace(ground, values_db=ground.values_db[mixed], incidence_deg=ground.incidence_deg[mixed])
    law = found(alike)
    assert share_among_cells(found(ground)) > 0.9
    assert share_among_cells(law) < 0.1
    against = FieldCheck(1.0, 0.9, Gain(-0.1, 0.02, 8), 0.1, 0.25)
    assert recommend(law, against, 1.5).predictor == "law"
    assert recommend(found(ground), against, 1.5).weight == 0.25


@pytest.fixture(scope="module")
def steep():
    """The true steep law, as if found, on eight fields at angles of their own."""
    ground = fields(1, STEEP, APART)
    classes = make_classes(ground.values_db, ground.incidence_deg, 4)
    covariance = np.diag([0.04, 0.02, 1e-6, 1e-6, 0.01])
    fit = LawFit(STEEP, 3.5, 0.0, covariance, np.eye(5))
    return GroundLaw(ground, METHOD, classes, Spread(0.5, 0.3), fit)


def test_the_band_is_that_of_a_normal_law(steep):
    """Largest at the smallest angle, where cos(phi) is; X1 and X2 have errors of 0.2 and 0.14."""
    low = np.radians(np.quantile(steep.ground.incidence_deg, 0.05))
    variance = 0.04 + 0.02 * np.cos(low) ** 2
    assert half_width_db(steep) == pytest.approx(1.6449 * np.sqrt(variance), rel=1e-3)
    # looks that are hardly known are no error of sigma0, and neither do they make it better known
    assert np.sqrt(0.8) * 10.0 / np.log(10.0) * (3.5 * polygamma(1, 3.5) - 1.0) > 0.5
    for shared in (0.0, -0.15):
        covariance = steep.fit.covariance.copy()
        covariance[-1, -1], covariance[0, -1], covariance[-1, 0] = 0.8, shared, shared
        loose = replace(steep, fit=replace(steep.fit, covariance=covariance))
        assert half_width_db(loose) == half_width_db(steep)


def test_an_error_of_the_incidence_does_not_narrow_the_band(steep):
    """What such an error flattens is the level at mapped angles, and not sigma0."""
    mapped = replace(steep, method=replace(steep.method, incidence_error_deg=4.0))
    assert np.ptp(mapped.slopes([25.0, 45.0])[:, 1]) < 0.8 * np.ptp(steep.slopes([25.0, 45.0])[:, 1])
    assert half_width_db(mapped) == half_width_db(steep)


def test_the_trend_is_the_law_in_generalised_least_squares_of_all_cells(steep):
    """Dense algebra: effects of fields with a gradient as large across each of them."""
    cells, at = steep.ground.cells, steep.ground.incidence_deg
    mean, law, angle = (cells.mean(v) for v in (steep.ground.values_db, steep.levels_db(at), at))
    covariance = np.diag(steep.ground.sampling + 0.3**2)
    for label in np.unique(cells.patch):
        of = cells.patch == label
        z = np.where(of, (angle - angle[of].mean()) / angle[of].std(), 0.0)
        covariance += 0.5**2 * (np.outer(of, of) + np.outer(z, z))
    inverse = np.linalg.inv(covariance)
    design = np.stack([np.ones(mean.size), law], axis=-1)
    normal = np.linalg.inv(design.T @ inverse @ design)
    slope = (normal @ design.T @ inverse @ mean)[1]
    assert slope == pytest.approx(1.0, abs=0.2)
    assert trend(steep) == pytest.approx(slope**2 / normal[1, 1], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("x", "between"), [(STEEP, 0.3), (FLAT, 0.8)])
def test_the_weight_is_the_mean_of_a_normal_one_between_0_and_1(x, between):
    """Dense algebra over all folds: effects of fields with a gradient, and the error that a fold's constant shares."""
    law = found(fields(7, x, [(20.0 + 4.0 * k, 24.0 + 4.0 * k) for k in range(4)], between))
    level = constants({"field": law.ground})["field"]
    information = right = 0.0
    for label in np.unique(law.ground.patch):
        rest, out = (law.ground.part(mask) for mask in (law.ground.patch != label, law.ground.patch == label))
        cells, others = out.cells, replace(level, ground=rest)
        angle = cells.mean(out.incidence_deg)
        z = (angle - angle.mean()) / angle.std()
        covariance = np.diag(out.sampling + law.spread.within**2) + others.variance
        inverse = np.linalg.inv(covariance + law.spread.between**2 * (1.0 + np.outer(z, z)))
        difference = cells.mean(refit(law, rest).levels_db(out.incidence_deg)) - others.level_db
        information += difference @ inverse @ difference
        right += difference @ inverse @ (cells.mean(out.values_db) - others.level_db)
    middle, sd = right / information, information**-0.5
    expected = truncnorm(-middle / sd, (1.0 - middle) / sd, middle, sd).mean()
    assert leave_fields_out(law, level).weight == pytest.approx(expected, abs=1e-3)


def test_two_fields_are_averaged_and_one_decides_alone(steep):
    outcomes = [FieldCheck(0.3, 0.5, Gain(0.5, 0.1, fields), 5.0, 0.625) for fields in (2, 1)]
    two, one = (recommend(steep, outcome, 1.5) for outcome in outcomes)
    assert (two.predictor, two.weight) == ("average", 0.625)
    assert (one.predictor, one.weight) == ("law", 1.0)
    np.testing.assert_allclose(two.levels_db([-8.0, -12.0], -16.0), [-11.0, -13.5])


@pytest.mark.slow
def test_cells_of_twenty_pixels_are_compared(steep):
    """With cells of 19 pixels in their place no field is left."""
    fields_seen = []
    for size in (20, 19):
        number = np.arange(steep.ground.patch.size) % 600
        ground = steep.ground.part(number < 5 * size)
        ground = replace(ground, block=100 * ground.patch + number[number < 5 * size] // size)
        law = replace(steep, ground=ground, classes=make_classes(ground.values_db, ground.incidence_deg, 2))
        fields_seen.append(leave_fields_out(law, constants({"a": ground})["a"]).gain.fields)
    assert fields_seen == [8, 0]
