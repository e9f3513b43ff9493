"""Targets by incidence-angle bin."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import TRUTH

from radcal.config import RegistrationConfig
from radcal.image.model import Measurement
from radcal.inference.misfit import BinMisfit
from radcal.laws import LAWS, law_for
from radcal.registration.registered import register
from radcal.targets import target_fit
from radcal.targets.target_fit import HELD_OUT, bin_targets


def test_ground_is_held_out_in_whole_blocks(parts):
    case, _, geometry, _, targets = parts
    columns = geometry.shape[1]
    for name, target in targets.items():
        assert set((target.pixels // columns // 20) % 2) == {0}
        out = (geometry.pixels(name, case.target.margin_px) // columns // 20) % 2
        assert 0.9 * np.count_nonzero(out) < target.left_out[HELD_OUT] <= np.count_nonzero(out)
        assert np.unique(target.patch).tolist() == [1]


def test_the_law_found_without_a_simulator_is_nearly_right(parts):
    case, *_, targets = parts
    angle = np.radians(np.linspace(21.5, 43.5, 40))
    for name, truth in TRUTH.items():
        first = targets[name].classes.first
        assert np.abs(LAWS["mangia"](angle, first) - LAWS["mangia"](angle, truth)).mean() < 1.0
    assert targets["lake"].classes.first_looks == pytest.approx(2.5, rel=0.2)
    # a run has K draws of speckle, the difference 1 + 1/K times the variance of the measured statistics
    bins = targets["field"].classes
    share = case.simulator.draws / (case.simulator.draws + 1.0)
    count, together = bins.classes.count, bins.classes.pairs[0]
    assert count.sum() ** 2 / (count @ together @ count) == pytest.approx(share * targets["field"].effective, rel=1e-9)


def registered_with(shape, uncertainty_px):
    nothing = np.zeros(shape, dtype=np.float32)
    still = register(nothing, Measurement(nothing, "a.tif"), RegistrationConfig(method="none"))
    return replace(still, uncertainty_px=np.full(shape, uncertainty_px, dtype=np.float32))


@pytest.mark.slow
def test_the_laws_of_the_image_are_those_of_its_bins_for_every_objective(parts, monkeypatch):
    case, _, geometry, _, targets = parts
    registered = registered_with(geometry.shape, 0.7)
    bins = bin_targets(case, targets, geometry, registered, BinMisfit, 1.5)
    asked = {name: target.classes.first.tolist() for name, target in bins.items()}
    # whole numbers are simulated as such
    whole = case.materials["lake"].model_copy(update={"integer": True})
    density = {"objective": "density", "materials": {**case.materials, "lake": whole}}

    def made(case, geometry, registered, reference_db, misfit, scene):
        return bin_targets(case, targets, geometry, registered, misfit, 1.5)

    monkeypatch.setattr(target_fit, "make_targets", made)
    found = target_fit.laws_of_image(case.model_copy(update=density), geometry, registered, None, None)
    assert found == {"field": asked["field"], "lake": np.round(asked["lake"]).tolist()}
    assert found != asked


def test_errors_of_slopes_and_of_the_place_add_up(parts):
    case, _, geometry, _, targets = parts
    registered = registered_with(geometry.shape, 2.0)
    only = replace_targets(targets, "field")
    errors = [
        bin_targets(case, only, geometry, registered, BinMisfit, slope)["field"].classes.incidence_error_deg
        for slope in (0.0, 3.0)
    ]
    # a displacement of 2 pixels in any direction, on rows of which each has its incidence
    rows = targets["field"].pixels // geometry.shape[1]
    a_row = np.gradient(geometry.incidence_deg[:, 0])
    assert errors[0] == pytest.approx(np.sqrt((a_row[rows] ** 2).mean()) * 2.0 / np.sqrt(2.0), rel=1e-3)
    assert errors[1] == pytest.approx(np.hypot(errors[0], 3.0))


def replace_targets(targets, name):
    """One of the targets alone, at the same levels."""
    return type(targets)({name: targets[name]}, targets.levels, targets.looks)


@pytest.mark.parametrize("classes", [3, 1])
def test_a_law_without_a_curve_has_bins_and_a_spread_of_fields(parts, classes):
    case, _, geometry, _, targets = parts
    outside = SimpleNamespace(
        target=case.target.model_copy(update={"incidence_classes": classes}),
        materials=case.materials,
        simulator=case.simulator,
        radar=case.radar,
        laws={"field": law_for("external", names=["a", "b", "c", "d"])},
    )
    only = replace_targets(targets, "field")
    found = bin_targets(outside, only, geometry, registered_with(geometry.shape, 0.0), BinMisfit)["field"].classes
    assert found.classes.size == classes
    assert found.first.size == 0
    assert found.priors
    if classes == 3:
        np.testing.assert_array_equal(found.classes.cumulants, targets["field"].classes.classes.cumulants)
        assert found.first_looks == pytest.approx(targets["field"].classes.first_looks, rel=0.15)
        # one bin takes the law itself for a spread; the levels at three angles that are found differ from the true law
        # by a standard deviation of 0.87 dB over the cells, a law does not
        assert targets["field"].classes.spread.within < 0.25
        assert found.spread.within == pytest.approx(0.87, rel=0.2)
