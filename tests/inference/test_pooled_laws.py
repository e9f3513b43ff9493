"""Laws from measured pixels, and held-out ground, on simulated fields."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import polygamma

from radcal.ground.bins import make_classes
from radcal.ground.ground import Ground
from radcal.ground.patches import Spread, spreads
from radcal.inference.misfit import BinMisfit, LikelihoodMisfit, Method
from radcal.inference.pooled_laws import FittedLaw, LawFit, curve_prior, fit_law, fit_laws
from radcal.inference.priors import looks_residuals
from radcal.laws import LAWS, law_for

LAW = LAWS["mangia"]
BOUNDS = [[-80.0, 10.0], [0.0, 60.0], [0.0, 60.0], [0.0, 20.0]]
TRUTH = np.array([-32.0, 20.0, 6.0, 4.0])
METHOD = Method(LAW, BOUNDS, looks=4.0)


def fields(rng, x=TRUTH, looks=2.8, between=0.0, within=0.0, rows=120, columns=96, width=8, height=1000):
    """Fields over rows of incidence, blocks of 5 rows."""
    row, column = np.indices((rows, columns))
    row, column = row.ravel(), column.ravel()
    incidence = 25.0 + 25.0 * row / rows
    patch, block = column // width + 1 + 100 * (row // height), row // 5
    effect = between * rng.normal(size=patch.max() + 1)
    cell = within * rng.normal(size=(patch.max() + 1, block.max() + 1))
    values = LAW(np.radians(incidence), x) + effect[patch] + cell[patch, block]
    values = values + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, row.size))
    return Ground(values, incidence, patch, block)


def law_error(found, x=TRUTH):
    phi = np.radians(np.linspace(26.0, 49.0, 50))
    return np.abs(LAW(phi, found.fit.parameters) - LAW(phi, x)).max()


@pytest.mark.slow
@pytest.mark.parametrize("misfit", [BinMisfit, LikelihoodMisfit])
def test_law_and_looks_are_found(misfit):
    found = fit_laws({"field": fields(np.random.default_rng(1))}, {"field": replace(METHOD, misfit=misfit)})
    assert law_error(found["field"]) < 0.35
    assert found["field"].fit.looks == pytest.approx(2.8, rel=0.08)


def test_the_prior_on_looks_needs_no_curve():
    """It is that of the ground, which a law known to a program alone has, too."""
    ground = fields(np.random.default_rng(5), rows=20, columns=12)
    external = Method(law_for("external", names=["mv", "s"]), [[0.0, 1.0]] * 2, looks=4.0)
    np.testing.assert_array_equal(curve_prior(ground, external)(np.array([0.5, 0.5]), 2.5), looks_residuals(2.5, 4.0))
    for off in (replace(external, priors=False), replace(external, free_looks=False)):
        assert curve_prior(ground, off)(np.array([0.5, 0.5]), 2.5).size == 0
    assert curve_prior(ground, METHOD)(TRUTH, 2.5)[-1] == looks_residuals(2.5, 4.0)[-1]


@pytest.mark.parametrize("cells", ["of a pixel and the rest", "of one pixel each", "of equal pixels"])
@pytest.mark.parametrize("classes", ["auto", 1])
def test_degenerate_cells_and_classes_do_not_end_in_an_error(cells, classes):
    ground = fields(np.random.default_rng(5), rows=20, columns=12)
    if cells == "of equal pixels":
        ground = replace(ground, values_db=np.where(ground.incidence_deg < 30.0, -5.0, ground.values_db))
    else:
        number = np.arange(ground.block.size)
        ground = replace(ground, block=number if cells == "of one pixel each" else (number == 0).astype(int))
    law = fit_laws({"field": ground}, {"field": replace(METHOD, classes=classes)})["field"]
    assert np.isfinite([law.spread.between, law.spread.within, *law.fit.parameters]).all()


def known_law(ground, looks=2.8, classes=3):
    """The true law of a ground, as if it had been found."""
    made = make_classes(ground.values_db, ground.incidence_deg, classes)
    return FittedLaw(ground, METHOD, made, Spread(0.5, 0.3), LawFit(TRUTH, looks, 0.0, np.eye(5), np.eye(5)))


def test_levels_and_their_derivatives():
    law = known_law(fields(np.random.default_rng(8), rows=30, columns=24))
    angle = np.array([26.0, 37.0, 48.5])
    phi = np.radians(angle)
    # of X1 + X2 cos(phi) + X3 exp(-X4 phi^2), and of the mean of log speckle (psi(L) - ln L) by ln L
    curve = np.exp(-4.0 * phi**2)
    of_looks = 10.0 / np.log(10.0) * (2.8 * polygamma(1, 2.8) - 1.0)
    wanted = np.stack([np.ones(3), np.cos(phi), curve, -6.0 * phi**2 * curve, np.full(3, of_looks)], axis=-1)
    np.testing.assert_allclose(law.slopes(angle), wanted, rtol=1e-5)
    speckle = 10.0 / np.log(10.0) * (polygamma(0, 2.8) - np.log(2.8))
    np.testing.assert_allclose(law.levels_db(angle), LAW(phi, TRUTH) + speckle)


def test_what_priors_say_is_told_from_what_the_data_say():
    """A linear problem: inverse covariances of bounds (uniform laws), of the prior and of the data add."""
    data = np.array([[2.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 3.0]])

    def residuals(x, looks):
        return data @ [x[0] - 1.0, x[1] + 0.3, np.log(looks / 2.0)]

    fit = fit_law(residuals, [[-5.0, 5.0], [-2.0, 2.0]], 4.0, prior=lambda x, _: np.array([1.25 * (x[0] - 1.0)]))
    known = np.diag([12.0 / 10.0**2, 12.0 / 4.0**2, 12.0 / np.log(1.1 * 4.0 / 0.3) ** 2])
    known[0, 0] += 1.25**2
    np.testing.assert_allclose(fit.prior_information, known, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(known + data.T @ data), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("right", [3.0, -3.0])
def test_of_several_minima_the_lowest_is_taken(right):
    fit = fit_law(
        lambda x, _: np.array([0.5 * (x[0] ** 2 - 9.0), 0.2 * (x[0] - right)]), [[-5.0, 5.0]], 4.0, free_looks=False
    )
    assert fit.parameters[0] == pytest.approx(right, abs=1e-4)
    assert fit.cost == pytest.approx(0.0, abs=1e-9)


def test_law_and_spread_of_fields_agree_with_each_other():
    """The spread that the last law's residuals tell is that with which it was fitted."""
    ground = fields(np.random.default_rng(3), between=3.0, within=0.2, rows=60, columns=48, height=30)
    law = fit_laws({"field": ground}, {"field": METHOD})["field"]
    (again,) = spreads([law.cell_residuals()])
    assert (law.spread.between, law.spread.within) == pytest.approx((again.between, again.within), rel=1e-4)
    assert law.spread.between > 2.0


def test_looks_that_are_not_searched_are_those_of_the_start():
    """Without a start, they are those of the sensor."""
    box = [[-5.0, 5.0]]
    for start, looks in (((np.array([1.0]), 2.5), 2.5), (None, 4.0)):
        assert fit_law(lambda x, n: np.array([x[0] - n]), box, 4.0, False, start).parameters == pytest.approx([looks])
