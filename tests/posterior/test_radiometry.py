"""Radiometry of an image by the area of the ground in cells of fixed materials."""

from dataclasses import replace

import numpy as np
import pytest
from assessment_samples import image_of_fixed, made_cells, made_radiometry, observed, seen_cells

from radcal.config import Uncertainty
from radcal.posterior.radiometry import before_the_image, likely, shown_by

CONFIG = Uncertainty(walkers=32, steps=100)


def cells_of(area, names=("water", "wood"), seed=1, **keys):
    """Fixed materials in an image with some exponent on the area; each law is off by a level of its own."""
    rng = np.random.default_rng(seed)
    return {name: seen_cells(rng, 120, area=area, added_db=1.5 * (-1) ** k, **keys) for k, name in enumerate(names)}


def shown(cells, declared, config=CONFIG):
    image = image_of_fixed({name: observed(one) for name, one in cells.items()}, [0.0], config, declared=declared)
    return image.radiometry["1"]


@pytest.mark.parametrize(
    ("declared", "area", "found"),
    [
        ("sigma0_local", 1.0, 1),
        ("sigma0_ref", -1.0, -1),
        ("sigma0_ref", -0.3, 0),
        # the declared radiometry has no area that could be left out, or has it already
        ("sigma0_local", -1.0, 0),
        ("sigma0_ref", 1.0, 0),
    ],
)
def test_the_area_term_that_an_image_lacks_or_has_too_much(declared, area, found):
    one = shown(cells_of(area), declared)
    assert (one.found, one.checked, one.materials) == (found, True, ("water", "wood"))
    assert one.exponent == pytest.approx(area, abs=3.0 * one.error)
    assert 0.005 < one.error < 0.1


@pytest.mark.parametrize(("slope", "form_db", "found"), [(0.2, 0.5, 0), (0.0, 0.0, -1)])
def test_errors_of_slope_and_form_are_not_taken_for_the_area(slope, form_db, found):
    """Where the area changes with the incidence alone, a law whose slope is wrong looks like the other radiometry."""
    cells = cells_of(0.0, relief_db=0.02)
    along = 0.08 * (cells["water"].incidence_deg - 37.0)
    measured = cells["water"].measured_db + along
    cells["water"] = replace(cells["water"], area_db=cells["water"].area_db - along, measured_db=measured)
    config = CONFIG.model_copy(update={"fixed_slope": slope, "form_db": form_db or 1e-3})
    one = shown(cells, "sigma0_ref", config)
    assert (one.found, one.error > 0.1) == (found, found == 0)


def test_too_few_materials_or_too_little_relief_check_nothing():
    one = shown(cells_of(1.0, ("water",)), "sigma0_local")
    assert (one.checked, one.found, one.chance, one.materials) == (False, 0, 0.0, ("water",))
    assert one.exponent == pytest.approx(1.0, abs=0.2)
    flat = shown(cells_of(1.0, relief_db=0.002), "sigma0_local")
    assert (flat.checked, flat.found, len(flat.materials)) == (False, 0, 2)
    assert flat.chance == pytest.approx(0.1, abs=0.03)
    assert flat.error > 0.5
    nothing = shown({}, "sigma0_local")
    assert (nothing.checked, nothing.found, nothing.materials, nothing.error) == (False, 0, (), np.inf)
    assert np.isnan(nothing.exponent)


def test_few_cells_and_dark_materials_do_not_count():
    """A material needs 30 cells, and a simulated level of 10 dB above the noise in half of them."""
    both = cells_of(1.0, ("water", "wood", "road"))
    cells = both["wood"]
    for count, counted in ((30, True), (29, False)):
        few = cells.part(np.arange(cells.size) < count)
        assert ("wood" in shown_by({**both, "wood": few})) is counted
    for share, counted in ((0.099, True), (0.101, False)):
        dark = made_cells(**{**vars(cells), "share": np.full(cells.size, share)})
        assert ("wood" in shown_by({**both, "wood": dark})) is counted


@pytest.mark.parametrize(
    ("chance", "found", "checked"), [(0.049, 0, True), (0.051, 0, False), (0.949, 0, False), (0.951, -1, True)]
)
def test_what_is_found_and_what_is_checked(chance, found, checked):
    one = made_radiometry(chance, -1)
    assert (one.found, one.checked) == (found, checked)
    assert not made_radiometry(chance, materials=("water",)).checked


def test_radiometries_of_several_passes():
    """One of ten images has the other radiometry, if two materials show it; improbable combinations are left out."""
    two, one = ("water", "wood"), ("water",)
    found = before_the_image(["sigma0_ref", "sigma0_local", "sigma0_ref"], [two, two, one])
    assert found == pytest.approx({(0, 0, 0): 0.81, (0, 1, 0): 0.09, (-1, 0, 0): 0.09, (-1, 1, 0): 0.01})
    wanted = {(0, 0, 0): 0.81 / 0.99, (0, 1, 0): 0.09 / 0.99, (-1, 0, 0): 0.09 / 0.99}
    assert likely(found) == pytest.approx(wanted)
    term = {"sigma0_local": 1, "gamma0_rtc": 1, "sigma0_ref": -1, "beta0": -1, "gamma0": -1}
    assert {declared: list(before_the_image([declared], [two]))[1:] for declared in term} == {
        declared: [(one,)] for declared, one in term.items()
    }
    kept = likely({(0,): 0.2, (-1,): 0.8})
    assert (list(kept), kept) == ([(-1,), (0,)], {(-1,): 0.8, (0,): 0.2})
