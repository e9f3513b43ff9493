"""Findings of a calibration, and what a refusal withholds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import made_curve, made_image, made_posterior, made_radiometry
from calibration_samples import make_run, make_target
from config_samples import synthetic
from geometry_samples import X, two_materials

from radcal.assessment import conclusion
from radcal.assessment.conclusion import conclude, moved_finding, withheld
from radcal.config import case_from
from radcal.findings import Finding
from radcal.laws import LAWS
from radcal.objectives import make_objectives
from radcal.objectives.history import History
from radcal.sections.simulator import PythonSimulation
from radcal.targets.target import Targets

AROUND = made_curve(1.0, LAWS["mangia"](np.radians(np.arange(86.0)), X))
KNOWN = {"area": made_posterior(known_between_deg=(27.0, 40.0), known_half_width_db=0.8, curve=AROUND)}


@pytest.fixture(scope="module")
def parts():
    """Arguments of :func:`conclude`."""
    seen = two_materials()
    rng = np.random.default_rng(4)
    materials = {"area": {"calibrate": True}, "rest": {"parameters": [1, 2, 3, 4]}}
    rest = {"objective": "density", "radar": {"looks": 4}, "stop": {"rms": 1e-3}}
    case = case_from({"materials": materials, **synthetic(parameters={"area": X}), **rest})
    visible = seen.pixels("area")
    order = np.sort(rng.choice(visible.size, 900, replace=False))
    target = make_target(
        rng.normal(-10.0, 2.0, 900), seen.incidence_deg.ravel()[visible[order]], pixels=visible[order], order=order,
        rms_sampling=0.004,
    )  # fmt: skip
    runs = [
        make_run("reference", 0, {"area": 0.3}, x=X),
        make_run("design", 0, {"area": 0.01}, x=X, looks=2.5),
        make_run("design", 1, {"area": 0.2}, x=X, looks=1.5),
    ]
    targets = [Targets({"area": target})]
    made, final_db = make_objectives(case, targets), rng.normal(-8.0, 2.0, seen.shape).astype(np.float32)
    return case, History(runs), targets, made, seen, final_db, KNOWN, made_image()


@pytest.fixture(scope="module")
def found(parts):
    return conclude(*parts)


def test_texture_of_the_simulated_pixels_is_a_finding(parts, found):
    (note,) = [one for one in found if one.code == "texture"]
    assert note == Finding("texture", "note", "area", {"looks": 2.5, "looks_nominal": 4.0})
    case, *rest = parts
    fewer = case.model_copy(update={"radars": [case.radar.model_copy(update={"looks": 2.5})]})
    assert "texture" not in [one.code for one in conclude(fewer, *rest)]


def codes(found):
    return [(one.code, one.severity, one.about) for one in found]


def test_findings_on_the_image_come_before_those_on_each_material(parts, found):
    assert codes(found) == [
        ("level", "note", "pass 1"),
        ("determined", "note", "area"),
        ("not_refuted", "note", "area"),
        ("texture", "note", "area"),
    ]
    assert withheld("area", KNOWN["area"], found) is KNOWN["area"]


def test_a_refused_image_leaves_sigma0_determined_nowhere(parts):
    """The band stays; the radiometry that is declared is the default's."""
    *rest, image = parts
    wrong = replace(image, radiometry={"1": made_radiometry(0.97, -1)})
    found = conclude(*rest, wrong)
    assert codes(found)[0] == ("radiometry", "refusal", "pass 1")
    assert ("withheld", "refusal", "area") in codes(found)
    known = withheld("area", KNOWN["area"], found)
    assert (known.known_between_deg, known.known_half_width_db) == (None, None)
    assert known.curve is KNOWN["area"].curve


def test_a_law_outside_of_its_band_is_put_down_to_what_the_image_shows(parts):
    *rest, _, image = parts
    away = {"area": replace(KNOWN["area"], curve=made_curve(1.0, AROUND.median_db + 3.0))}
    level = replace(image, levels_db=np.array([[2.2, 2.9, 3.6]]))
    last = conclude(*rest, away, level)[-1]
    assert (last.code, last.numbers["cause"]) == ("law_outside_band", "level of pass 1")
    assert last.numbers["beyond_db"] == pytest.approx(2.0, abs=0.01)
    assert conclude(*rest, away, image)[-1].numbers["cause"] == "unknown"


def test_another_law_is_asked_for_of_programs_only(parts, monkeypatch):
    case, *rest = parts
    asked, told = [], Finding("another_law", "warning", "area")
    monkeypatch.setattr(conclusion, "another_law", lambda *given: asked.append(given[:2]) or [told])
    assert told not in conclude(case, *rest)
    assert not asked
    program = case.model_copy(update={"simulator": PythonSimulation(kind="other")})
    found = conclude(program, *rest)
    assert asked == [("area", "mangia")]
    # in place of how well sigma0 is known: band and form are those of the law, not of the program
    assert codes(found) == [
        ("level", "note", "pass 1"),
        ("another_law", "warning", "area"),
        ("texture", "note", "area"),
    ]
    assert withheld("area", KNOWN["area"], found).known_between_deg is None
    assert withheld("other", KNOWN["area"], found) is KNOWN["area"]
    *others, image = rest
    refused = conclude(program, *others, replace(image, radiometry={"1": made_radiometry(0.97, -1)}))
    assert ("withheld", "refusal", "area") in codes(refused)


def test_the_image_is_registered_again_onto_the_final_run(parts, monkeypatch):
    """Of the fresh random numbers; of the materials whose law the pixels can show."""
    *rest, final_db, posteriors, image = parts
    asked = []

    def check(laws, targets, seen, registered, image):
        asked.append((list(laws), registered, image))
        return [moved]

    monkeypatch.setattr(conclusion, "check_registration", check)
    registered, other = SimpleNamespace(findings=()), SimpleNamespace(findings=())
    for moved in (moved_finding("area", 0.8, 0.3, 1.4, 0.7), moved_finding("area", 0.2, 0.3, 0.4, 0.7)):
        found = conclude(*rest, final_db, posteriors, image, [registered, other])
        assert found[-1] is moved
    assert asked[0] == (["area"], registered, final_db)


def test_findings_of_registrations_come_first_and_can_refuse(parts):
    """Of both passes, before those on what the fixed materials show."""
    far, near = Finding("place", "refusal", "pass 1"), Finding("depression", "warning", "pass 2", {"implied_deg": 41.3})
    images = [SimpleNamespace(findings=(one,), applied=False, method="none") for one in (far, near)]
    found = conclude(*parts, images)
    assert found[:2] == [far, near]
    assert ("withheld", "refusal", "area") in codes(found)
    assert withheld("area", KNOWN["area"], found).known_between_deg is None
