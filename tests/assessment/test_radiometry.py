"""Radiometry of an image by the area of the ground in cells of fixed materials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, made_cells, seen_cells
from scipy.optimize import least_squares

from radcal.assessment import radiometry
from radcal.assessment.cells import with_noise_db
from radcal.assessment.radiometry import Radiometry, area_exponent, radiometry_of
from radcal.config import Uncertainty

CONFIG = Uncertainty()


def law_of(cells):
    return np.asarray(LINE(np.radians(cells.incidence_deg), LINE_X))


def materials(area, names=("water", "wood"), seed=1, **keys):
    """Fixed materials in an image with some exponent on the area; each law is off by a level of its own."""
    rng = np.random.default_rng(seed)
    found = {}
    for k, name in enumerate(names):
        cells = seen_cells(rng, 120, area=area, added_db=1.5 * (-1) ** k, **keys)
        found[name] = cells, law_of(cells)
    return found


@pytest.mark.parametrize(
    ("declared", "area", "found"),
    [
        ("sigma0_local", 1.0, 1),
        ("gamma0_rtc", 1.0, 1),
        ("sigma0_ref", -1.0, -1),
        ("beta0", -1.0, -1),
        ("gamma0", -1.0, -1),
        ("sigma0_local", 0.0, 0),
        ("sigma0_ref", 0.0, 0),
        ("sigma0_local", 0.3, 0),
        ("sigma0_ref", -0.3, 0),
        # the declared radiometry has no area that could be left out, or has it already
        ("sigma0_local", -1.0, 0),
        ("sigma0_ref", 1.0, 0),
    ],
)
def test_the_area_term_that_an_image_lacks_or_has_too_much(declared, area, found):
    shown = radiometry_of(materials(area), declared, CONFIG)
    assert shown.found == found
    assert shown.checked
    assert shown.materials == ("water", "wood")
    assert shown.exponent == pytest.approx(area, abs=3.0 * shown.error)
    assert shown.error < 0.1


def test_too_few_materials_or_too_little_relief_check_nothing():
    one = radiometry_of(materials(1.0, ("water",)), "sigma0_local", CONFIG)
    assert (one.checked, one.found, one.materials) == (False, 0, ("water",))
    assert one.exponent == pytest.approx(1.0, abs=0.2)
    flat = radiometry_of(materials(1.0, relief_db=0.05), "sigma0_local", CONFIG)
    assert (flat.checked, flat.found, len(flat.materials)) == (False, 0, 2)
    assert flat.error > 0.25
    nothing = radiometry_of({}, "sigma0_local", CONFIG)
    assert (nothing.checked, nothing.found, nothing.materials, nothing.error) == (False, 0, (), np.inf)
    assert np.isnan(nothing.exponent)


def test_few_cells_and_dark_materials_do_not_count():
    """A material needs 30 cells, and a simulated level of 10 dB above the noise in half of them."""
    both = materials(1.0, ("water", "wood", "road"))
    cells, law = both["wood"]
    for count, counted in ((30, True), (29, False)):
        few = np.arange(cells.size) < count
        shown = radiometry_of({**both, "wood": (cells.part(few), law[few])}, "sigma0_local", CONFIG)
        assert ("wood" in shown.materials) is counted
    for share, counted in ((0.099, True), (0.101, False)):
        dark = made_cells(**{**vars(cells), "share": np.full(cells.size, share)})
        shown = radiometry_of({**both, "wood": (dark, law)}, "sigma0_local", CONFIG)
        assert ("wood" in shown.materials) is counted


def test_the_exponent_is_that_of_least_squares_with_a_prior_on_slopes():
    """Without outliers: columns of area, slopes and fields, written out; noise lowers the effect of the area.

    Slopes of the ground along range change the area with the incidence, so that the prior of the slopes counts.
    """
    config = Uncertainty(fixed_law_db=0.6, fixed_slope=0.4)
    rng = np.random.default_rng(6)
    parts, rows, values, weights = {}, [], [], []
    for k, name in enumerate(("a", "b")):
        cells = seen_cells(rng, 40, fields=3, relief_db=0.2)
        cells = replace(cells, area_db=cells.area_db + 0.08 * (cells.incidence_deg - 37.0))
        share, beside = rng.uniform(0.0, 0.09, 40), rng.normal(0.0, 0.1, 40)
        noise = np.full(40, -30.0)
        law = law_of(cells)
        measured = with_noise_db(law, noise) + beside + 0.6 * (1.0 - share) * cells.area_db
        measured = measured + 0.3 * cells.patch + 0.1 * rng.normal(size=40)
        changes = {"measured_db": measured, "beside_db": beside, "share": share, "noise_db": noise}
        cells = made_cells(**{**vars(cells), **changes})
        parts[name] = cells, law
        for j in range(40):
            row = np.zeros(3 + 6)
            row[0] = (1.0 - share[j]) * cells.area_db[j]
            row[1 + k] = (1.0 - share[j]) * (cells.incidence_deg[j] - cells.incidence_deg.mean()) / 10.0
            row[3 + 3 * k + cells.patch[j] - 1] = 1.0
            rows.append(row)
            values.append(measured[j] - beside[j] - 10.0 * np.log10(10.0 ** (law[j] / 10.0) + 10.0**-3.0))
            weights.append(1.0 / (cells.variance[j] + 0.15**2))
    a, w = np.array(rows), np.array(weights)
    precise = a.T @ (w[:, None] * a) + np.diag([0.0, 1.0 / 0.24**2, 1.0 / 0.24**2, *[0.0] * 6])
    exponent, error = area_exponent(parts, config)
    assert exponent == pytest.approx(np.linalg.solve(precise, a.T @ (w * values))[0], abs=1e-3)
    # speckle and fields alone count twice
    alone = np.linalg.inv(a[:, [0, *range(3, 9)]].T @ (w[:, None] * a[:, [0, *range(3, 9)]]))[0, 0]
    assert error == pytest.approx(np.sqrt(np.linalg.inv(precise)[0, 0] + 3.0 * alone), rel=0.05)


def test_outliers_hardly_move_the_exponent():
    clean = materials(0.0)
    cells, law = clean["water"]
    bright = cells.measured_db + np.where((np.arange(cells.size) % 12 == 0) & (cells.area_db > 0.0), 8.0, 0.0)
    rough = {**clean, "water": (made_cells(**{**vars(cells), "measured_db": bright}), law)}
    assert abs(area_exponent(rough, CONFIG)[0] - area_exponent(clean, CONFIG)[0]) < 0.1


def test_outliers_count_as_by_the_loss_of_huber():
    """Minimum of the loss of two standard errors, by an optimiser; the outliers lie where the area is large."""
    rng = np.random.default_rng(8)
    cells = seen_cells(rng, 90, fields=2, area=0.4, field_db=0.2)
    outlying = (cells.area_db > 1.0) & (rng.uniform(size=90) < 0.7)
    cells = replace(cells, measured_db=cells.measured_db + np.where(outlying, rng.uniform(0.5, 5.0, 90), 0.0))
    law = law_of(cells)
    angle = (cells.incidence_deg - cells.incidence_deg.mean()) / 10.0
    columns = np.column_stack([cells.area_db, angle, cells.patch == 1, cells.patch == 2])
    precise = 1.0 / np.sqrt(cells.variance + 0.15**2)
    slope = CONFIG.fixed_slope * CONFIG.fixed_law_db

    def residuals(x):
        return np.append(precise * (cells.measured_db - law - columns @ x), x[1] / slope)

    wanted = least_squares(residuals, np.zeros(4), loss="huber", f_scale=2.0, xtol=1e-12, ftol=1e-12).x[0]
    assert area_exponent({"a": (cells, law)}, CONFIG)[0] == pytest.approx(wanted, abs=0.01)
    plain, wider = (
        least_squares(residuals, np.zeros(4), loss=loss, f_scale=scale).x[0]
        for loss, scale in (("linear", 1.0), ("huber", 3.0))
    )
    assert plain - wanted > wider - wanted > 0.03


@pytest.mark.slow
def test_the_exponent_scatters_by_less_than_its_error():
    """Twice the statistical error is stated, so that half of it is seen."""
    found = [area_exponent(materials(0.0, seed=seed, relief_db=0.5), CONFIG) for seed in range(60)]
    exponents, errors = np.array(found).T
    assert 0.35 < exponents.std() / errors.mean() < 0.65
    assert abs(exponents.mean()) < 0.05


@pytest.mark.parametrize(
    ("exponent", "error", "found"),
    [(0.59, 0.1, 0), (0.61, 0.1, 1), (0.8, 0.31, 1), (0.8, 0.33, 0), (-0.8, 0.1, 0)],
)
def test_another_radiometry_is_found_by_exponent_and_error(exponent, error, found, monkeypatch):
    """From 0.6 on, and from 2.5 standard errors on."""
    monkeypatch.setattr(radiometry, "area_exponent", lambda *_: (exponent, error))
    assert radiometry_of(materials(0.0), "sigma0_local", CONFIG).found == found
    assert radiometry_of(materials(0.0), "sigma0_ref", CONFIG).found == -int(exponent < -0.6)


def test_a_wide_error_is_unchecked():
    assert Radiometry(0.9, 0.25, 0, ("a", "b")).checked
    assert not Radiometry(0.9, 0.26, 0, ("a", "b")).checked
    assert not Radiometry(0.9, 0.1, 0, ("a",)).checked
