"""Cells, posteriors and images made from arrays, for tests of the assessment."""

import numpy as np
from archives import image, posterior

from radcal.config import Uncertainty
from radcal.laws import law_for
from radcal.posterior.calibrated import FORMS, LawModel, Parameters
from radcal.posterior.cells import CellMeans
from radcal.posterior.effects import Observed, Shared, form_basis
from radcal.posterior.fixed_laws import image_from
from radcal.posterior.radiometry import Radiometry
from radcal.posterior.result import Curve, FormError, HeldOut, Predicted

LINE = law_for("tabulated", angles_deg=(20.0, 60.0))
LINE_BOX = np.array([[-30.0, 10.0], [-40.0, 0.0]])
LINE_X = np.array([-6.0, -16.0])
"""Law that falls by a quarter of a decibel per degree."""

BOTH = ("water", "wood")
NOTHING_SHOWN = Radiometry(float("nan"), float("inf"), 1, 0.0, ())
"""Fixed materials of an image, and radiometry of an image without any."""

KNOTS = np.arange(26.0, 49.0)
FORM_KNOTS = np.arange(26.0, 52.0, 2.0)
ANGLES = np.linspace(28.0, 46.0, 13)
"""Knots of a law and of the error of its form, and angles of bands, for cells at 26 to 48 degrees."""


def made_cells(measured_db, incidence_deg, **changes):
    """Cells without noise, relief and neighbours, of 60 pixels and 4 looks, each of a speckle of 0.28 dB."""
    measured = np.asarray(measured_db, dtype=np.float64)
    n, zeros = measured.size, np.zeros(measured.size)
    keys = {
        "patch": np.ones(n, dtype=np.int64),
        "incidence_deg": np.asarray(incidence_deg, dtype=np.float64),
        "measured_db": measured,
        "beside_db": zeros,
        "area_db": zeros,
        "noise_db": np.full(n, -np.inf),
        "share": zeros,
        "variance": np.full(n, 0.08),
        "pixels": np.full(n, 60),
        "fold": np.zeros(n, dtype=np.int64),
        "looks": 4.0,
        **changes,
    }
    return CellMeans(**keys)


def seen_cells(
    rng,
    n=240,
    *,
    law=LINE,
    x=LINE_X,
    added_db=0.0,
    seen_deg=(26.0, 48.0),
    fields=10,
    field_db=0.5,
    cell_db=0.2,
    area=0.0,
    relief_db=1.5,
):
    """Cells of a law with effects of fields, of cells, of relief and of speckle; ``area`` is the image's exponent."""
    incidence = np.sort(rng.uniform(*seen_deg, n))
    patch = rng.integers(1, fields + 1, n)
    variance, relief = rng.uniform(0.03, 0.12, n), rng.normal(0.0, relief_db, n)
    level = np.asarray(law(np.radians(incidence), x)) + added_db + area * relief
    level = level + rng.normal(0.0, field_db, fields + 1)[patch] + rng.normal(0.0, cell_db, n)
    measured = level + np.sqrt(variance) * rng.normal(size=n)
    return made_cells(measured, incidence, patch=patch, variance=variance, area_db=relief)


def observed(cells, law=LINE, x=LINE_X):
    """Cells of one pass with the law at which the image was simulated."""
    above, below = (np.asarray(law(np.radians(cells.incidence_deg + step), x)) for step in (0.5, -0.5))
    return Observed([cells], [np.asarray(law(np.radians(cells.incidence_deg), x))], [above - below])


def made_curve(half_db=1.0, median_db=None):
    """Curve of :data:`LINE` at :data:`LINE_X`, with a band of some half-width; that of the fields is half as wide."""
    angle = np.arange(86.0)
    median = LINE(np.radians(angle), LINE_X) if median_db is None else np.broadcast_to(median_db, angle.shape)
    half = np.broadcast_to(np.asarray(half_db, dtype=np.float64), angle.shape)
    return Curve(angle, median, median - half, median + half, 0.3 * half, median, median - half / 2, median + half / 2)


def made_posterior(**changes):
    """Posterior of a law with two parameters, known between two angles."""
    three = np.array([0.3, 0.5, 0.9])
    keys = {
        "cells": 240, "fields": 10, "looks": 3.8, "between_db": three, "within_db": 0.5 * three,
        "parameters_p05": LINE_X - 1.0, "parameters_p50": LINE_X, "parameters_p95": LINE_X + 1.0,
        "parameters_model": LINE_X, "curve": made_curve(), "known_half_width_db": 1.2, "form": made_form(),
    }  # fmt: skip
    return posterior(**{**keys, **changes})


def held_cells(cells=slice(None)):
    """Three cells of two fields, of which the bands of law, constant and their average hold one, three and two."""
    law = np.array([[-9.0, -10.0, -11.0], [-9.5, -11.0, -12.0], [-8.5, -9.0, -10.0]])[:, cells]
    constant = np.array([[-13.0] * 3, [-14.6] * 3, [-9.0] * 3])[:, cells]
    own = np.array([4, 7, 7])[cells], np.array([25.0, 30.0, 40.0])[cells], np.array([-9.6, -10.5, -14.5])[cells]
    return HeldOut(*own, Predicted(*law), Predicted(*constant))


def made_form(**changes):
    """Error of a law's form that is not noticed."""
    keys = {"rms_db": np.array([0.1, 0.3, 0.7]), "noticed": False, "refuted": False, "noticed_db": 1.4}
    return FormError(**{**keys, **changes})


def made_radiometry(chance=0.001, term=1, materials=BOTH):
    """Radiometry of a pass that two fixed materials show to be right; the other one has a given probability."""
    return Radiometry(0.1, 0.2, term, chance, materials)


def made_image(**changes):
    """Image of one pass, of which two fixed materials say that all is right."""
    keys = {
        "levels_db": np.array([[-0.4, 0.1, 0.5]]),
        "laws_db": {"water": np.array([-0.6, 0.1, 0.7]), "wood": np.array([-0.5, -0.1, 0.4])},
        "apart_db": {"water": np.array([-0.3, 0.2, 0.7]), "wood": np.array([-0.4, 0.0, 0.4])},
        "radiometry": {"1": made_radiometry()},
    }
    return image(**{**keys, **changes})


def image_of_fixed(fixed, areas, config, offset=False, seed=3, declared="sigma0_ref"):
    """What fixed materials say of passes of one declared radiometry."""
    return image_from(fixed, areas, [declared] * len(areas), config, offset, seed)


def known_common(level_db=0.0, sd_db=0.1, rng=None):
    """Common effects of one pass as if the fixed materials had shown them."""
    mean = np.array([level_db, 0.05, 0.2, -0.1, 0.3])
    root = np.zeros((5, 5)) if rng is None else 0.05 * rng.normal(size=(5, 5))
    covariance = np.diag([sd_db**2, 0.01, 0.5, 0.5, 0.5]) + root @ root.T
    return Shared(1.0, mean, covariance, (np.log(0.5), 0.3))


def line_db(x, incidence_deg):
    """Levels of :data:`LINE` for m vectors X at k angles [dB], shape (m, k), without splines."""
    return x[:, :1] + (x[:, 1:] - x[:, :1]) * (incidence_deg - 20.0) / 40.0


def line_parameters(error=None, integer=(False, False)):
    """X of :data:`LINE` in its bounds."""
    return Parameters(
        LINE_BOX, np.array(integer), lambda x: line_db(x, KNOTS),
        lambda x: np.zeros(len(x)), error,
    )  # fmt: skip


def line_model(cells, common, config=None, parameters=None, forms=True, flattening=0.0):
    """Model of :data:`LINE` for cells of one pass."""
    of = observed(cells)
    weights = np.maximum(0.0, 1.0 - np.abs(cells.incidence_deg[:, None] - KNOTS))
    columns = form_basis(cells.incidence_deg, FORM_KNOTS, FORMS) * forms
    flat = flattening * (cells.incidence_deg - 37.0)
    return LawModel(of, weights, parameters or line_parameters(), columns, flat, common, [0.0], config or Uncertainty())
