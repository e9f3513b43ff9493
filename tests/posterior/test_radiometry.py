"""Radiometry of an image by the area of the ground in cells of fixed materials."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X, NOTHING_SHOWN, made_cells, made_radiometry, seen_cells
from scipy.optimize import least_squares
from scipy.stats import norm

from radcal.config import Uncertainty
from radcal.posterior import radiometry
from radcal.posterior.cells import with_noise_db
from radcal.posterior.effects import form_basis, law_columns
from radcal.posterior.radiometry import area_exponent, chances_of, radiometry_of

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
    flat = radiometry_of(materials(1.0, relief_db=0.02), "sigma0_local", CONFIG)
    assert (flat.checked, flat.found, len(flat.materials)) == (False, 0, 2)
    assert flat.error > 0.5
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


def test_the_exponent_is_that_of_least_squares_with_priors_on_slopes_and_forms():
    """Without outliers: columns of area, slopes, forms and fields, written out; noise lowers the effect of the area.

    Slopes of the ground along range change the area with the incidence, so that the priors of slopes and forms count.
    """
    config = Uncertainty(fixed_law_db=0.6, fixed_slope=0.4, form_db=0.3)
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
        angle = cells.incidence_deg
        forms = form_basis(angle, np.arange(angle.min() - 0.5, angle.max() + 8.0, 4.0), 4)
        for j in range(40):
            row = np.zeros(1 + 10 + 6)
            row[0] = (1.0 - share[j]) * cells.area_db[j]
            row[1 + 5 * k] = (1.0 - share[j]) * (angle[j] - angle.mean()) / 10.0
            row[2 + 5 * k : 6 + 5 * k] = (1.0 - share[j]) * forms[j]
            row[11 + 3 * k + cells.patch[j] - 1] = 1.0
            rows.append(row)
            values.append(measured[j] - beside[j] - 10.0 * np.log10(10.0 ** (law[j] / 10.0) + 10.0**-3.0))
            weights.append(1.0 / (cells.variance[j] + 0.15**2))
    a, w = np.array(rows), np.array(weights)
    each = [1.0 / 0.24**2, *[1.0 / (0.6745 * 0.3) ** 2] * 4]
    precise = a.T @ (w[:, None] * a) + np.diag([0.0, *each, *each, *[0.0] * 6])
    exponent, error = area_exponent(parts, config)
    assert exponent == pytest.approx(np.linalg.solve(precise, a.T @ (w * values))[0], abs=1e-3)
    assert error == pytest.approx(np.sqrt(np.linalg.inv(precise)[0, 0]), rel=0.05)


def test_outliers_count_as_by_the_loss_of_huber():
    """Minimum of the loss of two standard errors, by an optimiser; the outliers lie where the area is large."""
    rng = np.random.default_rng(8)
    cells = seen_cells(rng, 90, fields=2, area=0.4, field_db=0.2)
    outlying = (cells.area_db > 1.0) & (rng.uniform(size=90) < 0.7)
    cells = replace(cells, measured_db=cells.measured_db + np.where(outlying, rng.uniform(0.5, 5.0, 90), 0.0))
    law = law_of(cells)
    columns = np.column_stack(
        [cells.area_db, law_columns(cells.incidence_deg)[:, 1:], cells.patch == 1, cells.patch == 2]
    )
    precise = 1.0 / np.sqrt(cells.variance + 0.15**2)
    sd = np.array([CONFIG.fixed_slope * CONFIG.fixed_law_db, *[0.6745 * CONFIG.form_db] * 4])

    def residuals(x):
        return np.append(precise * (cells.measured_db - law - columns @ x), x[1:6] / sd)

    wanted = least_squares(residuals, np.zeros(8), loss="huber", f_scale=2.0, xtol=1e-12, ftol=1e-12).x[0]
    assert area_exponent({"a": (cells, law)}, CONFIG)[0] == pytest.approx(wanted, abs=0.01)
    plain, wider = (
        least_squares(residuals, np.zeros(8), loss=loss, f_scale=scale).x[0]
        for loss, scale in (("linear", 1.0), ("huber", 3.0))
    )
    assert plain - wanted > wider - wanted > 0.02


@pytest.mark.parametrize(("exponent", "error"), [(0.59, 0.1), (0.3, 0.4), (1.2, 0.5), (-0.5, 0.3), (0.8, 0.3)])
def test_the_probability_of_the_other_radiometry_is_that_of_two_normal_distributions(exponent, error, monkeypatch):
    """One of ten images has it, before its values are seen; what cannot be told widens both by `area`."""
    for declared, sign in (("sigma0_local", 1), ("sigma0_ref", -1)):
        monkeypatch.setattr(radiometry, "area_exponent", lambda *_, sign=sign: (sign * exponent, error))
        shown, sd = radiometry_of(materials(0.0), declared, CONFIG), np.hypot(error, CONFIG.area)
        of_other, of_declared = 0.1 * norm.pdf(exponent, 1.0, sd), 0.9 * norm.pdf(exponent, 0.0, sd)
        assert shown.chance == pytest.approx(of_other / (of_other + of_declared), rel=1e-9)
        assert shown.term == sign


@pytest.mark.parametrize(
    ("chance", "found", "checked"), [(0.049, 0, True), (0.051, 0, False), (0.49, 0, False), (0.51, -1, True)]
)
def test_what_is_found_and_what_is_checked(chance, found, checked):
    shown = made_radiometry(chance, -1)
    assert (shown.found, shown.checked) == (found, checked)
    assert not made_radiometry(chance, materials=("water",)).checked


def test_radiometries_of_several_passes():
    """Decided ones count as such; of the others, each combination has the product of its probabilities."""
    decided = [made_radiometry(0.01), made_radiometry(0.7, -1), NOTHING_SHOWN]
    assert chances_of(decided) == {(0, -1, 0): 1.0}
    either = chances_of([made_radiometry(0.3), made_radiometry(0.7, -1), made_radiometry(0.4, -1)])
    wanted = {(0, -1, 0): 0.42, (0, -1, -1): 0.28, (1, -1, 0): 0.18, (1, -1, -1): 0.12}
    assert either == pytest.approx(wanted)
    # a combination that is twenty times less probable than another is left out
    rare = chances_of([made_radiometry(0.15), made_radiometry(0.15)])
    assert rare == pytest.approx({(0, 0): 0.85 / 1.15, (0, 1): 0.15 / 1.15, (1, 0): 0.15 / 1.15})
    # ... and not one of many that are alike
    assert len(chances_of([made_radiometry(0.4)] * 5)) == 32
