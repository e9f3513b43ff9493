"""Likely causes of a law that does not fit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import make_target

from radcal.assessment.causes import UNKNOWN, area_slope, joint_cause, likely_cause
from radcal.assessment.fit_test import FitTest
from radcal.assessment.incidence_check import error_behind
from radcal.calibration.grounds import fit_grounds
from radcal.calibration.misfit import Method
from radcal.measurement.classes import make_classes
from radcal.measurement.correlation import Correlation
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
BOX = np.array([[-60.0, 0.0], [0.0, 40.0], [0.0, 25.0], [0.5, 20.0]])
TRUTH = np.array([-28.0, 20.0, 6.0, 4.0])
ROWS, COLUMNS = 60, 50
FLAT = np.linspace(20.0, 50.0, ROWS)
NAN = float("nan")


def misfit_of(**changes):
    fields = FitTest(False, 90.0, 20.0, 0.001, 30.0, 2.0, 1.0, 0.0, 2.0, 2.0, "", (), 1.0)
    return replace(fields, **changes)


def made(area=0.0, box=BOX, looks=4.0):
    """Law of slopes towards and from the radar, with so many times their area in the pixels."""
    rng = np.random.default_rng(4)
    row = np.repeat(np.arange(ROWS), COLUMNS)
    local = FLAT[row] + rng.normal(0.0, 6.0, row.size)
    area_db = 10.0 * np.log10(np.sin(np.radians(FLAT[row])) / np.sin(np.radians(local)))
    values = LAW(np.radians(local), TRUTH) + area * area_db + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, row.size))
    ground = Ground(values, local, row % 5, row // 30)
    law = fit_grounds({"a": ground}, {"a": Method(LAW, box, 4.0)})["a"]
    target = make_target(values, local, dp=np.array([0.0, 1.0, 0.0]))
    geometry = SimpleNamespace(shape=(ROWS, COLUMNS), flat_incidence_deg=FLAT)
    return law, target, geometry, area_db


@pytest.fixture(scope="module")
def right():
    return made()


def cause_of(parts, test, image_looks=NAN):
    law, target, geometry, _ = parts
    return likely_cause("mangia", law, test, target, geometry, image_looks)


def test_nothing_shown_is_unknown(right):
    assert cause_of(right, misfit_of()) == UNKNOWN


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_area_of_slopes_is_radiometry(sign):
    parts = made(area=sign)
    law, *_, area_db = parts
    slope, error = area_slope(law, area_db)
    assert slope == pytest.approx(sign, abs=4.0 * error)
    assert error < 0.1
    said = "radiometry: the residuals go with the area of the ground in a pixel"
    assert cause_of(parts, misfit_of()).startswith(f"{said} ({'+' if sign > 0 else '-'}")
    # half as many independent pixels leave sqrt(2) times the error
    # neighbours in a row of the image correlated by a half: half of the pixels are independent, but for the row's ends
    lags = np.zeros((13, 13))
    lags[6, 5:8] = [0.5, 1.0, 0.5]
    pixels = np.arange(ROWS * COLUMNS)
    alone = replace(law, spread=Spread(0.0, 0.0))
    half = replace(alone, ground=replace(law.ground, pixels=pixels, correlation=Correlation(lags, pixels.size)))
    assert area_slope(half, area_db) == pytest.approx((slope, np.sqrt(2.0) * area_slope(alone, area_db)[1]), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [Spread(0.8, 0.0), Spread(0.0, 0.8), Spread(0.0, 0.0)])
def test_fields_that_differ_make_the_slope_against_the_area_uncertain(spread):
    """Images with effects of fields and cells drawn anew, on ground whose area factor goes with both."""
    law, *_, area_db = made()
    rng, cells = np.random.default_rng(8), law.ground.cells
    _, field = np.unique(cells.patch, return_inverse=True)
    of_cell = 0.6 * rng.normal(size=5)[field] + 0.4 * rng.normal(size=field.size)
    area = area_db + of_cell[cells.of_pixel]
    expected, slopes, errors = law.levels_db(law.ground.incidence_deg), [], []
    for _ in range(200):
        effect = spread.between * rng.normal(size=5)[field] + spread.within * rng.normal(size=field.size)
        values = expected + effect[cells.of_pixel] + 10.0 * np.log10(rng.gamma(4.0, 0.25, expected.size))
        found = area_slope(replace(law, spread=spread, ground=replace(law.ground, values_db=values)), area)
        slopes.append(found[0])
        errors.append(found[1])
    # a standard deviation from 200 draws is known to 5 %
    assert np.mean(errors) == pytest.approx(np.std(slopes), rel=0.15)
    if spread.between:  # ten times what the speckle of the pixels alone says
        assert np.mean(errors) > 5.0 * area_slope(replace(law, spread=Spread(0.0, 0.0)), area)[1]


def test_a_bent_law_is_no_area():
    """Residuals of third degree in the incidence, as a law of the wrong form leaves them in a bin."""
    law, *_, area_db = made()
    at = law.ground.incidence_deg
    whole = replace(law, classes=make_classes(law.ground.values_db, at, 1))
    bent = replace(whole, ground=replace(law.ground, values_db=law.ground.values_db + 5e-4 * (at - 25.0) ** 3))
    assert area_slope(bent, area_db) == pytest.approx(area_slope(whole, area_db), rel=1e-6, abs=1e-9)


def test_half_of_the_area_is_not_radiometry():
    assert not cause_of(made(area=0.4), misfit_of()).startswith("radiometry")


def test_the_area_shows_nothing_on_level_ground(right):
    law, *_, area_db = right
    assert area_slope(law, 0.05 * area_db) == (0.0, np.inf)


def test_looks_of_the_image_tell_a_filter(right):
    assert (
        cause_of(right, misfit_of(), image_looks=6.1) == "the image has 6.1 looks, radar.looks is 4: speckle-filtered?"
    )
    assert cause_of(right, misfit_of(), image_looks=5.9) == UNKNOWN
    upper, lower = (cause_of(right, misfit_of(looks_limit=end)) for end in ("upper", "lower"))
    assert upper == "the pixels spread less than the speckle of radar.looks 4: speckle-filtered?"
    assert lower == "the pixels spread more than any speckle: mixed ground?"
    # looks pressed to a limit by a level that is off: the spread that is wrong is the simulated one
    upper, lower = (
        cause_of(right, misfit_of(looks_limit=end, sd_db=sd)) for end, sd in (("upper", 1.7), ("lower", 2.4))
    )
    most, fewest = (f"the looks found are the {word} that the search allows, and" for word in ("most", "fewest"))
    assert upper == f"{most} narrow the simulated pixels alone"
    assert lower == f"{fewest} spread the simulated pixels alone"
    for end, sd in (("upper", 1.8), ("lower", 2.2)):
        assert cause_of(right, misfit_of(looks_limit=end, sd_db=sd)).startswith("the pixels spread ")


def test_several_passes_name_what_the_test_alone_shows():
    for changes in ({"looks_limit": "upper"}, {"looks_limit": "lower"}, {"bounds": ("X1",)}):
        assert UNKNOWN not in joint_cause(misfit_of(**changes), "no curve")
    assert joint_cause(misfit_of(bounds=("X1",)), "no curve") == "X1 is held back by its bound"
    assert joint_cause(misfit_of(), "no curve") == "cause unknown: no curve"


def test_bounds_are_named_by_the_level_that_they_cannot_reach():
    box = BOX.copy()
    box[0, 0] = -5.0
    law = made(box=box)
    found = cause_of(law, misfit_of(bounds=("X1",), worst_deg=45.0, worst_mean_db=8.0))
    assert found.startswith("mangia's bounds cannot reach -1")
    for reached in (-2.0, 0.1):
        test = misfit_of(bounds=("X1",), worst_deg=45.0, worst_mean_db=reached)
        assert cause_of(law, test) == "X1 is held back by its bound"
    found = cause_of(law, misfit_of(bounds=("X1", "X2"), worst_deg=45.0, worst_mean_db=0.1))
    assert found == "X1 and X2 are held back by their bounds"


def test_few_looks_may_be_an_error_of_the_incidence():
    found = cause_of(made(looks=2.6), misfit_of(worst_mean_db=0.4, worst_spread=1.3))
    assert found.startswith("an error of the local incidence of ")
    # an error of the incidence does not move the mean of a bin by 2 dB
    assert cause_of(made(looks=2.6), misfit_of()) == UNKNOWN
    assert found.endswith(" degrees would spread the pixels so, as would texture")


def test_an_error_that_is_nearly_all_of_the_map_explains_nothing():
    """A map whose standard deviation is 1.6 degrees, and an error of 1.5."""
    law, target, geometry, _ = made(looks=2.6)
    at = 39.0 + 0.15 * (law.ground.incidence_deg - 39.0)
    narrow = replace(law, ground=replace(law.ground, incidence_deg=at))
    error, _ = error_behind(LAW, narrow.fit, at, 4.0)
    assert 0.9 * np.var(at) < error**2 < error * 0.9 * np.var(at)
    assert cause_of((narrow, target, geometry, None), misfit_of(worst_mean_db=0.4)) == UNKNOWN


def test_at_one_incidence_no_error_of_it_explains_few_looks():
    law, target, geometry, _ = made(looks=2.6)
    one = replace(law, ground=replace(law.ground, incidence_deg=39.0 + 0.005 * (law.ground.incidence_deg - 39.0)))
    assert cause_of((one, target, geometry, None), misfit_of(worst_mean_db=0.4)) == UNKNOWN


def test_ground_darker_than_the_simulated_noise_is_told(right):
    """The level of the worst bin, from which the mean of log speckle is taken off, beside the noise."""
    law, target, geometry, area = right
    level = float(LAW(np.radians(law.classes.nodes_deg[0]), TRUTH).mean())
    below, above = (replace(target, noise_db=level + away) for away in (-0.4, 0.4))
    dark = misfit_of(worst_deg=float(law.classes.nodes_deg[0].mean()), worst_mean_db=1.5)
    assert "radar.nesz_db" in cause_of((law, above, geometry, area), dark)
    assert cause_of((law, below, geometry, area), dark) == UNKNOWN
    # a simulated image darker than the measured one has no noise too many
    assert cause_of((law, above, geometry, area), replace(dark, worst_mean_db=-1.5)) == UNKNOWN
