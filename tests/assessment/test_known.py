"""Findings of the assessment: codes and numbers in the order to act on them, their sentences, and the headline."""

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

from radcal.assessment.conclusion import image_findings, law_findings, material_findings
from radcal.config import Uncertainty
from radcal.findings import Finding
from radcal.ground.pixels import IN_THE_NOISE
from radcal.targets.target import Targets
from radcal.words import asked_steps, degrees, headline, verdict

WRONG = {"1": made_radiometry(0.97)}
UNCHECKED = {"1": NOTHING_SHOWN}
ONE = {"laws_db": {"lake": np.array([0.9, 1.3, 1.8])}, "apart_db": {"lake": np.array([1.4, 2.0, 2.5])}}
LAW_OFF = {"laws_db": {"water": np.array([1.2, 1.9, 2.6]), "wood": np.array([-0.5, -0.1, 0.4])}}
TOO_BRIGHT = {"levels_db": np.array([[0.8, 1.4, 2.0]])}
WIDE = {"known_between_deg": None, "known_half_width_db": None, "curve": made_curve(2.3)}


def case(*declared, normalisation="none", **uncertainty):
    """Parts of a case that findings depend on."""
    passes = [SimpleNamespace(radar=SimpleNamespace(radiometry=one)) for one in declared or ("sigma0_local",)]
    return SimpleNamespace(
        passes=passes,
        target=SimpleNamespace(normalisation=normalisation),
        uncertainty=Uncertainty(**{"known_db": 1.5, **uncertainty}),
    )


def of_image(image, *declared, **keys):
    return list(image_findings(case(*declared, **keys), image))


def of_material(posterior, targets=None, refused=False):
    targets = Targets({"dyke": seen(50)}) if targets is None else targets
    return list(material_findings(case(), "dyke", posterior, [targets], refused))


def seen(pixels, **changes):
    """Target at 20 to 45 degrees."""
    return make_target(np.linspace(-9.0, -5.0, pixels), np.linspace(20.0, 45.0, pixels), **changes)


def codes(findings):
    return [(one.code, one.severity, one.about) for one in findings]


def test_a_right_image_has_a_level_and_nothing_to_act_on():
    (found,) = of_image(made_image())
    assert codes([found]) == [("level", "note", "pass 1")]
    assert found.numbers == {"level_db": 0.1, "p05_db": -0.4, "p95_db": 0.5}
    assert found.do == ""


@pytest.mark.parametrize(
    ("levels", "severity"),
    [
        ((0.1, 0.3, 0.5), "warning"),
        ((-0.5, -0.3, -0.1), "warning"),
        ((-0.1, 0.3, 0.7), "note"),
        ((-0.7, -0.3, 0.1), "note"),
        ((0.1, 0.19, 0.3), "note"),
    ],
)
def test_a_level_is_named_from_a_fifth_of_a_decibel_on(levels, severity):
    (found,) = of_image(made_image(levels_db=np.array([levels])))
    assert codes([found]) == [("level", severity, "pass 1")]


def test_radiometry_then_fixed_laws_then_the_level():
    wrong = made_image(
        levels_db=np.array([[0.8, 1.4, 2.0], [-0.2, 0.0, 0.3]]),
        radiometry={**WRONG, "2": made_radiometry(0.3, -1)},
        sampled=False,
        **LAW_OFF,
    )
    found = of_image(wrong, "sigma0_local", "beta0")
    assert codes(found) == [
        ("radiometry", "refusal", "pass 1"),
        ("radiometry_unchecked", "note", "pass 2"),
        ("fixed_law", "warning", "water"),
        ("level", "warning", "pass 1"),
        ("level", "note", "pass 2"),
        ("not_sampled", "warning", "fixed laws"),
    ]
    numbers = {"chance_percent": 97.0, "exponent": 0.1, "error": 0.2}
    assert found[0].numbers == {**numbers, "declared": "sigma0_local", "other": "sigma0_ref"}
    assert found[0].do == "radar.radiometry: sigma0_ref"
    assert found[1].numbers == {**numbers, "chance_percent": 30.0, "declared": "beta0", "other": "sigma0_local"}
    assert found[2].numbers == {"error_db": 1.9, "p05_db": 1.2, "p95_db": 2.6}
    assert found[2].do == "materials.water.parameters"
    assert of_image(wrong, "sigma0_local", "beta0", normalisation="image") == []


@pytest.mark.parametrize(
    ("declared", "term", "meant"),
    [
        ("sigma0_local", 1, "sigma0_ref"),
        ("gamma0_rtc", 1, "gamma0"),
        ("sigma0_ref", -1, "sigma0_local"),
        ("beta0", -1, "sigma0_local"),
        ("gamma0", -1, "gamma0_rtc"),
    ],
)
def test_the_radiometry_that_is_meant(declared, term, meant):
    found = of_image(made_image(radiometry={"1": made_radiometry(0.97, term)}), declared)
    assert found[0].numbers["other"] == meant


@pytest.mark.parametrize(
    ("error", "named"),
    [((0.1, 1.1, 2.1), True), ((-2.1, -1.1, -0.1), True), ((-0.1, 1.1, 2.3), False), ((0.5, 0.95, 1.4), False)],
)
def test_a_fixed_law_is_named_if_it_is_a_decibel_off(error, named):
    image = made_image(laws_db={"water": np.array(error), "wood": np.array([-0.3, 0.0, 0.3])})
    assert ("fixed_law" in [one.code for one in of_image(image)]) is named


def test_a_fixed_law_near_the_noise_is_not_named():
    """Radiometry counts the materials well above the noise in some pass."""
    for shown, named in ((("wood",), False), (("wood", "water"), True)):
        image = made_image(radiometry={"1": made_radiometry(materials=shown)}, **LAW_OFF)
        assert ("fixed_law" in [one.code for one in of_image(image)]) is named


@pytest.mark.parametrize(("apart", "severity"), [((1.4, 2.0, 2.5), "warning"), ((-0.2, 0.3, 0.8), "note")])
def test_one_fixed_law_is_not_told_from_a_level(apart, severity):
    """However many passes there are, it is said once, of the first."""
    lake = {**ONE, "apart_db": {"lake": np.array(apart)}}
    shown = made_radiometry(0.0, materials=("lake",))
    for passes in (1, 2):
        image = made_image(
            levels_db=np.array([[0.1, 0.7, 1.2]] * passes),
            radiometry={str(k + 1): shown for k in range(passes)}, **lake,
        )  # fmt: skip
        *unchecked, found = of_image(image, *["sigma0_local"] * passes)
        assert [one.code for one in unchecked] == ["radiometry_unchecked"] * passes
        assert codes([found]) == [("fixed_law_and_image", severity, "lake")]
        assert found.numbers == {"apart_db": apart[1], "p05_db": apart[0], "p95_db": apart[2]}


def test_without_fixed_laws_nothing_is_checked():
    nothing = made_image(laws_db={}, apart_db={}, levels_db=np.array([[-0.8, 0.0, 0.8]]), radiometry=UNCHECKED)
    found = of_image(nothing, level_db=0.45)
    assert codes(found) == [("radiometry_unchecked", "note", "pass 1"), ("level_unchecked", "note", "pass 1")]
    assert found[0].numbers == {"declared": "sigma0_local", "other": "sigma0_ref", "chance_percent": 0.0}
    assert found[1].numbers == {"level_db": 0.45}


def test_where_sigma0_is_determined():
    found = of_material(made_posterior())
    assert codes(found) == [("determined", "note", "dyke"), ("not_refuted", "note", "dyke")]
    numbers = {"half_width_db": 1.2, "from_deg": 22.25, "to_deg": 39.5}
    assert found[0].numbers == {
        **numbers,
        "field_half_width_db": pytest.approx(0.5),
        "systematic_db": pytest.approx(0.3),
    }
    assert found[1].numbers == {"p05_db": 0.1, "rms_db": 0.3, "p95_db": 0.7, "noticed_db": 1.4}


def test_where_it_is_not():
    """The half-width is smallest where it is seen: 0.05 dB per degree from 21 degrees on."""
    wide = made_posterior(known_between_deg=None, known_half_width_db=None, curve=made_curve(0.1 * np.arange(86.0)))
    found = of_material(wide)[0]
    assert codes([found]) == [("undetermined", "warning", "dyke")]
    assert found.numbers == {"narrowest_db": pytest.approx(2.1), "known_db": 1.5}
    refused = of_material(wide, refused=True)[0]
    assert codes([refused]) == [("withheld", "refusal", "dyke")]
    assert refused.numbers == {"half_width_db": pytest.approx(4.4)}
    assert codes(of_material(made_posterior(curve=None, form=None)))[0] == ("parameters_only", "note", "dyke")
    without = of_material(made_posterior(curve=None, form=None, cells=0))
    assert codes(without)[0] == ("without_cells", "warning", "dyke")


def test_a_level_alone():
    """Pixels at one incidence."""
    target, curve = make_target(np.linspace(-9.0, -5.0, 50), np.full(50, 40.0)), made_curve()
    found = of_material(made_posterior(form=None, seen_deg=np.array([[39.0, 41.0]])), Targets({"dyke": target}))
    assert codes(found) == [("level_only", "note", "dyke")]
    level = float(np.interp(40.0, curve.incidence_deg, curve.median_db))
    wanted = {"incidence_deg": 40.0, "median_db": level, "p05_db": level - 1.0, "p95_db": level + 1.0}
    assert found[0].numbers == {key: pytest.approx(value) for key, value in wanted.items()}


@pytest.mark.parametrize(
    ("changes", "code", "severity"),
    [
        ({"noticed": True}, "form_noticed", "warning"),
        ({"noticed": True, "refuted": True}, "refuted", "warning"),
        ({"noticed_db": float("inf")}, "not_refuted", "note"),
    ],
)
def test_the_form_of_the_law(changes, code, severity):
    found = of_material(made_posterior(form=made_form(**changes)))[1]
    assert (found.code, found.severity) == (code, severity)
    assert ("noticed_db" in found.numbers) is ("noticed_db" not in changes)


def test_remarks_come_last():
    """Of 400 pixels that might be used, 30 are in the noise."""
    target = seen(370, left_out={IN_THE_NOISE: 30, "layover": 500})
    found = of_material(made_posterior(sampled=False), Targets({"dyke": target}))
    assert [one.code for one in found] == ["determined", "not_refuted", "not_sampled", "in_the_noise"]
    assert found[2].numbers == {"r_hat": 1.01, "ess": 812.0}
    assert found[3].numbers == {"share": pytest.approx(30 / 400)}
    few = seen(390, left_out={IN_THE_NOISE: 10})
    assert len(of_material(made_posterior(), Targets({"dyke": few}))) == 2


def test_a_law_of_the_search_outside_of_the_band():
    """Half a decibel above the upper edge at 44 degrees, where it is seen last; beyond it is farther."""
    away = LINE_X + np.array([0.0, 2.5])
    edge = made_curve(1.0)
    (found,) = law_findings("dyke", made_posterior(curve=edge), LINE, away, ["level of pass 1"])
    assert codes([found]) == [("law_outside_band", "warning", "dyke")]
    assert found.numbers == {"beyond_db": pytest.approx(2.5 * 24.0 / 40.0 - 1.0), "cause": "level of pass 1"}
    (below,) = law_findings("dyke", made_posterior(curve=edge), LINE, LINE_X - [0.0, 2.5], ())
    assert below.numbers == {"beyond_db": pytest.approx(2.5 * 24.0 / 40.0 - 1.0), "cause": "unknown"}
    bent = made_posterior(curve=edge, form=made_form(noticed=True))
    (formed,) = law_findings("dyke", bent, LINE, away, ["level of pass 1"])
    assert formed.numbers["cause"] == "level of pass 1, form of the law"
    assert list(law_findings("dyke", made_posterior(), LINE, LINE_X + [0.9, 0.9], ())) == []
    assert list(law_findings("dyke", made_posterior(curve=None), LINE, away, ())) == []


def image_found(**changes):
    return of_image(made_image(**changes), level_db=0.45)


def material_found(name="dyke", refused=False, spread_deg=12.0, left_out=None, **changes):
    angle = np.linspace(32.0 - spread_deg, 32.0 + spread_deg, 50)
    target = make_target(np.linspace(-9.0, -5.0, 50), angle, left_out=left_out or {})
    return list(material_findings(case(), name, made_posterior(**changes), [Targets({name: target})], refused))


def test_the_verdict_on_a_material():
    found = [*image_found(), *material_found(sampled=False), *material_found("rest", **WIDE)]
    assert verdict("dyke", found) == (
        "dyke: sigma0 is determined to +-1.2 dB (90 %) between 23 and 39 degrees, if scene, geometry and pixels are "
        "what the case says; the law is not refuted (a bump of 1.4 dB would be noticed in 9 of 10 images)."
    )
    assert verdict("rest", found).startswith("rest: sigma0 is determined at no angle: ")


def test_the_headline_of_one_material():
    alone = material_found()
    assert headline(["dyke"], [*image_found(), *alone], True) == verdict("dyke", alone)
    unfinished = headline(["dyke"], [*image_found(), *alone], False)
    assert unfinished == f"{verdict('dyke', alone)} The search is not finished."


def test_the_headline_says_what_is_unchecked():
    found = [*image_found(radiometry=UNCHECKED, laws_db={}, apart_db={}), *material_found()]
    assert headline(["dyke"], found, True).endswith("images). Unchecked: radiometry, level.")


def test_a_refusal_comes_first_and_takes_the_rest_away():
    found = [*image_found(radiometry=WRONG, **LAW_OFF), *material_found(refused=True)]
    said = headline(["dyke"], found, True)
    assert said.startswith("pass 1: on the fixed materials the image agrees with sigma0_ref")
    assert (
        "set radar.radiometry: sigma0_ref. dyke: sigma0 is determined at no angle, because the image is refused" in said
    )
    assert "water" not in said
    assert said.count("refused") == 1


def test_the_first_thing_to_act_on_is_in_the_headline():
    said = headline(["dyke"], [*image_found(**LAW_OFF, **TOO_BRIGHT), *material_found()], True)
    assert " water: the image minus its fixed law is +1.90 dB" in said
    assert "a level of" not in said


def test_the_headline_of_several_materials_counts_them():
    found = [
        *image_found(),
        *material_found("dyke"),
        *material_found("rest", **WIDE),
        *material_found("road", form=made_form(noticed=True, refuted=True)),
        *material_found("pond", spread_deg=0.0, form=None),
        *material_found("ditch", cells=0, curve=None, form=None),
    ]
    assert headline(["dyke", "rest", "road", "pond", "ditch"], found, False) == (
        "sigma0 of 5 materials: 2 are determined at some angles (dyke, road), 1 is determined at no angle (rest), 1 is "
        "seen at one incidence alone (pond), 1 is without enough pixels side by side (ditch), laws refuted: road. "
        "The search is not finished."
    )
    refused = [*image_found(radiometry=WRONG), *material_found("dyke", True), *material_found("rest", True)]
    assert headline(["dyke", "rest"], refused, True).endswith(
        "sigma0 of 2 materials: 2 are determined at no angle, because an image is refused (dyke, rest)."
    )


def test_next_steps_are_sorted_by_importance():
    found = [
        *image_found(radiometry=WRONG, **TOO_BRIGHT, **LAW_OFF)[::-1],
        *material_found(left_out={IN_THE_NOISE: 20}),
        Finding("another_law", "warning", "dyke", {"difference_db": 3.2, "law": "mangia"}, "materials.dyke.law"),
    ]
    assert [step.text for step in asked_steps(found)] == [
        "set radar.radiometry: sigma0_ref",
        "check materials.water.parameters",
        "check the absolute calibration of the image",
    ]
    assert asked_steps(image_found()) == []
    (step,) = asked_steps(image_found(**ONE))
    assert step.text == "check materials.lake.parameters and the calibration of the image"
    assert not any("offset" in step.text for step in asked_steps(found))


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
