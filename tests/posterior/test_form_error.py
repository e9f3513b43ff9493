"""Error of a law's form: its size, whether it is noticed, and the smallest one that would be."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import ANGLES, FORM_KNOTS, KNOTS, known_common, line_model, seen_cells

from radcal.posterior.calibrated import FORMS
from radcal.posterior.effects import form_basis
from radcal.posterior.form_error import form_error, noticed_db

SEEN = float(ANGLES[0]), float(ANGLES[-1])
AT = np.array([-0.2, 0.3, np.log(0.5), np.log(0.2), np.log(0.3)])
COLUMNS = form_basis(ANGLES, FORM_KNOTS, FORMS)


@pytest.mark.parametrize(
    ("size", "noticed", "refuted"),
    [(0.05, False, False), (0.8, True, False), (1.2, True, False), (1.5, True, True), (2.2, True, True)],
)
def test_a_form_is_noticed_from_its_interval_and_refuted_from_its_rms(size, noticed, refuted):
    """Draws of one shape, whose size scatters by 0.2 dB."""
    rng = np.random.default_rng(3)
    shape = np.sin(np.linspace(0.0, 2.0 * np.pi, 41, endpoint=False)) * np.sqrt(2.0)
    draws = (size + 0.2 * rng.normal(size=(4000, 1))) * shape
    found = form_error(draws, 1.7)
    assert (found.noticed, found.refuted, found.noticed_db) == (noticed, refuted, 1.7)
    wanted = np.quantile(np.abs(size + 0.2 * rng.normal(size=100_000)), [0.05, 0.5, 0.95])
    np.testing.assert_allclose(found.rms_db, wanted, atol=0.02)


def smallest(cells, at=AT, **keys):
    model = line_model(cells, replace(known_common(), mean=np.zeros(5)), **keys)
    return noticed_db(model, at, COLUMNS, KNOTS, SEEN)


def test_what_nothing_would_show_is_infinite():
    """Three cells at one end of the incidence seen."""
    cells = seen_cells(np.random.default_rng(1), 3, seen_deg=(26.0, 27.0), fields=1)
    assert smallest(cells) == np.inf


@pytest.mark.parametrize("form_db", [0.3, 0.02])
def test_the_power_is_that_of_a_normal_regression(form_db):
    """One bump: mean and noise of the form that generalised least squares with priors finds in images with it.

    The prior of the form has the scale of the posterior, or, if this is smaller, that of the bump.
    """
    cells = seen_cells(np.random.default_rng(1), 150, fields=15)
    at = np.array([*AT[:4], np.log(form_db)])
    size = smallest(cells, at)
    rng, field, cell = np.random.default_rng(6), np.exp(AT[2]), np.exp(AT[3])
    model = line_model(cells, replace(known_common(), mean=np.zeros(5)))
    covariance = np.diag(cells.variance + cell**2) + field**2 * (cells.patch[:, None] == cells.patch)
    inverse = np.linalg.inv(covariance)
    step = 1e-4 * np.eye(2)
    levels = [model.law.levels(model.law.scaled(AT[:2] + sign * step)) for sign in (1.0, -1.0)]
    slopes = (levels[0] - levels[1]) / 2e-4
    weights = np.maximum(0.0, 1.0 - np.abs(cells.incidence_deg[:, None] - KNOTS))
    columns = np.column_stack([model.linear, *[weights @ one for one in slopes]])
    prior = np.ones(columns.shape[1])
    prior[:FORMS] = max(form_db**2, (0.5 * size) ** 2)
    posterior = np.linalg.inv(columns.T @ inverse @ columns + np.diag(1.0 / prior))
    shapes = (COLUMNS - COLUMNS.mean(axis=0)) @ posterior[:FORMS]
    gain = shapes @ columns.T @ inverse
    sd = 1.6449 * np.sqrt(np.einsum("ij,ij->i", shapes[:, :FORMS], COLUMNS - COLUMNS.mean(axis=0)))
    noise = np.linalg.cholesky(covariance) @ rng.normal(size=(150, 4000))
    rates = []
    for share in (0.125, 0.25):
        for middle in np.linspace(*SEEN, 5):
            bump = np.exp(-0.5 * ((KNOTS - middle) / (share * (SEEN[1] - SEEN[0]))) ** 2)
            found = gain @ (noise + size * (weights @ bump)[:, None])
            # of the angle that shows it best
            rates.append((np.abs(found) > sd[:, None]).mean(axis=1).max())
    assert min(rates) == pytest.approx(0.9, abs=0.03)
