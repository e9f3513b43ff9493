"""Sentences of findings, and the headline."""

from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import (
    LINE,
    LINE_X,
    NOTHING_SHOWN,
    made_curve,
    made_form,
    made_image,
    made_posterior,
    made_radiometry,
)
from calibration_samples import make_target

from radcal.assessment.known import image_findings, law_findings, material_findings
from radcal.assessment.registration_check import moved_finding
from radcal.catalogue import _OF_MODEL
from radcal.config import Uncertainty
from radcal.findings import Finding
from radcal.ground.pixels import IN_THE_NOISE
from radcal.targets.target import Targets
from radcal.words import degrees, headline, next_steps, sentence, verdict

WRONG = {"1": made_radiometry(0.9)}
UNCHECKED = {"1": NOTHING_SHOWN}
ONE = {"laws_db": {"lake": np.array([0.9, 1.3, 1.8])}, "apart_db": {"lake": np.array([1.4, 2.0, 2.5])}}
LAW_OFF = {"laws_db": {"water": np.array([1.2, 1.9, 2.6]), "wood": np.array([-0.5, -0.1, 0.4])}}
TOO_BRIGHT = {"levels_db": np.array([[0.8, 1.4, 2.0]])}
OF_OTHERS = {  # codes that registrations, levels of targets and the check before any run give
    *("depression", "geometry_unchecked", "relief", "place"),
    *("level_found", "level_subtracted", "level_of_image", "images_mapped", "all_images_mapped", "fixed_level"),
}
WIDE = {"known_between_deg": None, "known_half_width_db": None, "curve": made_curve(2.3)}


def of_image(**changes):
    case = SimpleNamespace(
        passes=[SimpleNamespace(radar=SimpleNamespace(radiometry="sigma0_local"))],
        target=SimpleNamespace(normalisation="none"),
        uncertainty=Uncertainty(level_db=0.45),
    )
    return list(image_findings(case, made_image(**changes)))


def of_material(name="dyke", refused=False, spread_deg=12.0, left_out=None, **changes):
    angle = np.linspace(32.0 - spread_deg, 32.0 + spread_deg, 50)
    target = make_target(np.linspace(-9.0, -5.0, 50), angle, left_out=left_out or {})
    case = SimpleNamespace(uncertainty=Uncertainty(known_db=1.5))
    return list(material_findings(case, name, made_posterior(**changes), Targets({name: target}), refused))


def every():
    """At least one finding of each code that the assessment gives."""
    yield from of_image(radiometry=WRONG, sampled=False, **LAW_OFF)
    yield from of_image(radiometry=UNCHECKED, laws_db={}, apart_db={})
    yield from of_image(radiometry={"1": made_radiometry(0.3)}, **TOO_BRIGHT)
    yield from of_image(**ONE)
    yield from of_material(sampled=False, left_out={IN_THE_NOISE: 20})
    yield from of_material(form=made_form(noticed=True), **WIDE)
    yield from of_material(form=made_form(noticed=True, refuted=True), refused=True)
    yield from of_material(form=made_form(noticed_db=float("inf")), curve=None)
    yield from of_material(spread_deg=0.0)
    yield from of_material(cells=0, curve=None, form=None)
    yield from law_findings("dyke", made_posterior(), LINE, LINE_X + 9.0, ())
    yield Finding("another_law", "warning", "dyke", {"difference_db": 3.21, "law": "mangia"}, "materials.dyke.law")
    yield Finding("texture", "note", "dyke", {"looks": 2.75, "looks_nominal": 4.0})
    yield moved_finding("dyke", 0.81, 0.34, 1.42, 0.7)


def test_every_code_has_a_sentence_for_its_numbers():
    found = list(every())
    assert {one.code for one in found} == set(_OF_MODEL) - OF_OTHERS
    for one in found:
        said = sentence(one)
        assert said.endswith(".")
        assert "{" not in said
        assert "nan" not in said
        assert one.about in said
        assert said.startswith(f"{one.severity}: ") is (one.severity != "note")
        assert sentence(one, prefix=False).startswith(f"{one.about}: ")
        if one.do and one.severity != "note":
            assert one.do in said


@pytest.mark.parametrize(
    ("finding", "said"),
    [
        (
            of_image(radiometry=WRONG)[0],
            "refusal: pass 1: by the fixed materials the image is sigma0_ref, not sigma0_local as the case says "
            "(against sigma0_local it goes with the ground area to the power +0.10, standard error 0.20); the "
            "bands are given for sigma0_ref: set radar.radiometry: sigma0_ref.",
        ),
        (
            of_material()[0],
            "dyke: sigma0 is determined to +-1.2 dB (90 %) between 23 and 39 degrees, if scene, geometry and pixels "
            "are what the case says.",
        ),
        (
            of_material(left_out={IN_THE_NOISE: 20})[-1],
            "warning: dyke: 29% of its pixels are masked, because they are in the noise (target.snr_db); the pixels "
            "that remain near the noise are the brighter ones.",
        ),
    ],
)  # fmt: skip
def test_sentences(finding, said):
    assert sentence(finding) == said


def test_the_verdict_on_a_material():
    found = [*of_image(), *of_material(sampled=False), *of_material("rest", **WIDE)]
    assert verdict("dyke", found) == (
        "dyke: sigma0 is determined to +-1.2 dB (90 %) between 23 and 39 degrees, if scene, geometry and pixels are "
        "what the case says; the law is not refuted (a bump of 1.4 dB would be noticed in 9 of 10 images)."
    )
    assert verdict("rest", found).startswith("rest: sigma0 is determined at no angle: ")


def test_the_headline_of_one_material():
    alone = of_material()
    assert headline(["dyke"], [*of_image(), *alone], True) == verdict("dyke", alone)
    unfinished = headline(["dyke"], [*of_image(), *alone], False)
    assert unfinished == f"{verdict('dyke', alone)} The search is not finished."


def test_the_headline_says_what_is_unchecked():
    found = [*of_image(radiometry=UNCHECKED, laws_db={}, apart_db={}), *of_material()]
    assert headline(["dyke"], found, True).endswith("images). Unchecked: radiometry, level.")


def test_a_refusal_comes_first_and_takes_the_rest_away():
    found = [*of_image(radiometry=WRONG, **LAW_OFF), *of_material(refused=True)]
    said = headline(["dyke"], found, True)
    assert said.startswith("pass 1: by the fixed materials the image is sigma0_ref")
    assert (
        "set radar.radiometry: sigma0_ref. dyke: sigma0 is determined at no angle, because the image is refused" in said
    )
    assert "water" not in said
    assert said.count("refused") == 1


def test_the_first_thing_to_act_on_is_in_the_headline():
    said = headline(["dyke"], [*of_image(**LAW_OFF, **TOO_BRIGHT), *of_material()], True)
    assert " water: the image minus its fixed law is +1.90 dB" in said
    assert "a level of" not in said


def test_the_headline_of_several_materials_counts_them():
    found = [
        *of_image(),
        *of_material("dyke"),
        *of_material("rest", **WIDE),
        *of_material("road", form=made_form(noticed=True, refuted=True)),
        *of_material("pond", spread_deg=0.0, form=None),
        *of_material("ditch", cells=0, curve=None, form=None),
    ]
    assert headline(["dyke", "rest", "road", "pond", "ditch"], found, False) == (
        "sigma0 of 5 materials: 2 are determined at some angles (dyke, road), 1 is determined at no angle (rest), 1 is "
        "seen at one incidence alone (pond), 1 is without enough pixels side by side (ditch), laws refuted: road. "
        "The search is not finished."
    )
    many = [one for k in range(5) for one in of_material(f"field {k}")]
    assert (
        headline([f"field {k}" for k in range(5)], many, True)
        == "sigma0 of 5 materials: 5 are determined at some angles."
    )
    refused = [*of_image(radiometry=WRONG), *of_material("dyke", True), *of_material("rest", True)]
    assert headline(["dyke", "rest"], refused, True).endswith(
        "sigma0 of 2 materials: 2 are determined at no angle, because an image is refused (dyke, rest)."
    )


def test_next_steps_are_sorted_by_importance():
    found = [
        *of_image(radiometry=WRONG, **TOO_BRIGHT, **LAW_OFF)[::-1],
        *of_material(left_out={IN_THE_NOISE: 20}),
        Finding("another_law", "warning", "dyke", {"difference_db": 3.2, "law": "mangia"}, "materials.dyke.law"),
    ]
    assert next_steps(found) == [
        "set radar.radiometry: sigma0_ref",
        "check materials.water.parameters",
        "check the absolute calibration of the image",
    ]
    assert next_steps(of_image()) == []
    assert next_steps(of_image(**ONE)) == ["check materials.lake.parameters and the calibration of the image"]
    assert not any("offset" in step for step in next_steps(found))


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (10.0, 25.0, "10 and 25"),
        (10.25, 25.75, "11 and 25"),
        (14.75, 15.25, "14.75 and 15.25"),
        (14.9, 16, "15 and 16"),
    ],
)
def test_degrees_are_rounded_into_the_interval(low, high, said):
    assert degrees(low, high) == f"between {said} degrees"
