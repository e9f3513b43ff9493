"""Programs that compute the law of a material, or another law, at the same X."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from calibration_samples import make_run, make_target
from geometry_samples import X, two_materials

from radcal.assessment.conclusion import another_law, beyond_law_db
from radcal.findings import Finding
from radcal.ground.bins import make_classes
from radcal.inference.misfit import law_cumulants
from radcal.laws import LAWS, law_for
from radcal.objectives.history import History
from radcal.speckle.texture import log_speckle_cumulants

LAW, LOOKS = LAWS["mangia"], 4.0
DARK = [-45.0, *X[1:]]


def made(added_db=0.0, power_db=-np.inf, weight=1.0, terrain=False, runs=(DARK, X)):
    """Check of a program whose runs at ``runs``, the last of them the best, differ from the law and get more power."""
    seen = two_materials()
    pixels = seen.pixels("area")
    angle = seen.incidence_deg.ravel()[pixels]
    target = make_target(np.zeros(pixels.size), angle, pixels=pixels, dp=np.array([0.0, 1.0, 0.0]))
    classes = make_classes(target.values_db, target.incidence_deg, 4)

    def statistics(x):
        mean = law_cumulants(LAW, x, classes.nodes_deg)[:, 0] + added_db + 10.0 * np.log10(weight)
        mean = 10.0 * np.log10(10.0 ** (mean / 10.0) + 10.0 ** (power_db / 10.0)) + log_speckle_cumulants(LOOKS)[0]
        return [[one, np.log(2.6), 0.0] for one in mean]

    each = [
        make_run("design", k, {"area": float(len(runs) - k)}, x=x, statistics=statistics(x)) for k, x in enumerate(runs)
    ]
    objective = SimpleNamespace(
        material=SimpleNamespace(law=LAW, decibels=True),
        passes=(SimpleNamespace(classes=classes, material=SimpleNamespace(law=LAW, looks=LOOKS)),),
        in_pass=lambda _, score: score,
    )
    ground = np.zeros_like(seen.ground) if terrain else seen.ground
    there = replace(seen, facet_weight=np.full_like(seen.facet_weight, weight), ground=ground)
    return "area", objective, target, History(each), there


def said(parts):
    name, *rest = parts
    return list(another_law(name, "mangia", *rest))


@pytest.mark.parametrize("added_db", [-12.0, -1.5, 2.0])
def test_a_program_of_another_law_is_told(added_db):
    (found,) = said(made(added_db))
    assert found == Finding("another_law", "warning", "area", found.numbers, "materials.area.law: external")
    assert found.numbers == {"difference_db": pytest.approx(abs(added_db)), "law": "mangia"}


@pytest.mark.parametrize("added_db", [-1.0, 0.0, 1.0])
def test_a_program_of_the_law_is_not(added_db):
    """Differences within 1 dB and three sampling errors."""
    assert said(made(added_db)) == []
    difference, beyond = beyond_law_db(*made(0.0))
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)
    assert (beyond < 0.0).all()


def test_power_that_the_darkest_run_contains_is_explained():
    """Noise 3 dB below the level of the best run."""
    noise_db = float(np.mean(law_cumulants(LAW, X, np.array([[30.0, 45.0]]))[:, 0])) + 2.0
    parts = made(power_db=noise_db)
    assert beyond_law_db(*parts)[0].max() > 4.0
    assert said(parts) == []
    # a run that is as much brighter, and not by the power in the darkest run, is of another law
    assert said(made(4.0)) != []


def test_the_area_of_the_ground_is_explained():
    for weight in (0.4, 2.5):
        assert abs(beyond_law_db(*made(weight=weight))[0]).max() == pytest.approx(3.98, abs=0.01)
        assert said(made(weight=weight)) == []
    # ... and a program without this area
    name, objective, target, history, _ = made()
    assert said((name, objective, target, history, made(weight=2.5)[-1])) == []


@pytest.mark.parametrize(("added_db", "told"), [(-2.0, False), (-3.5, True)])
def test_terrain_leaves_more_unexplained(added_db, told):
    assert bool(said(made(added_db, terrain=True))) is told


def test_what_has_no_law_in_db_is_not_compared():
    name, objective, *rest = made(-12.0)
    for changed in ({"law": law_for("external", names=["mv"])}, {"decibels": False}):
        material = SimpleNamespace(**{**vars(objective.material), **changed})
        assert said((name, SimpleNamespace(**{**vars(objective), "material": material}), *rest)) == []
