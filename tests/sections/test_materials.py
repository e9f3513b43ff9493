"""Section materials: laws, bounds, starts and whole parameters."""

import math

import pytest
from config_samples import COMMAND, FIXED, NO_TRUTH, SOIL, WHOLE, X, dyke, message, outside, synthetic

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.errors import ConfigError


def test_start_is_the_middle_of_the_bounds_unless_given():
    bounds = [[-50, 0], [0, 20], [0, 1], [2, 4]]
    assert case_from(dyke(bounds=bounds)).materials["dyke"].start_parameters == [-25, 10, 0.5, 3]
    given = case_from(dyke(bounds=bounds, start=[-1, 1, 1, 2])).materials["dyke"]
    assert given.start_parameters == [-1, 1, 1, 2]
    assert case_from({"materials": FIXED}).materials["grass"].start_parameters == X


BEYOND = "expected -1000 to 1000"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (
            {"materials": {"road": {"parameters": [1001, 0, 0, 0]}}},
            ["materials.road: parameters: X1", "'mangia'", BEYOND],
        ),
        (synthetic(parameters={"dyke": [0, -1e30, 0, 0]}), ["parameters.dyke: X2 of law 'mangia' is -1e+30", BEYOND]),
        (
            dyke(start={"law": "constant_gamma", "parameters": [2000]}),
            ["gamma of law 'constant_gamma' is 2000", BEYOND],
        ),
        (dyke(bounds=[[0, 1e30]] * 4), ["bounds of X1 are [0, 1e+30], expected within"]),
        (dyke(looks=2.5), ["looks is 2.5 and calibrate is true, expected looks only with calibrate: false"]),
    ],
)
def test_numbers_that_no_material_has_are_refused(data, words):
    text = message(data)
    assert all(word in text for word in words), text


@pytest.mark.parametrize("start", [X, {"law": "mangia", "parameters": X}])
def test_a_start_of_the_same_law_is_a_start(start):
    case = case_from(dyke(start=start))
    assert case.start_with_another_law == []
    assert case.materials["dyke"].start_parameters == X
    assert case.at_start == case


def test_parameters_of_an_external_law():
    case = case_from({"simulator": COMMAND, "materials": {"soil": SOIL, "lake": {"law": "external"}},
                      "measurement": NO_TRUTH})  # fmt: skip
    soil, lake = case.materials["soil"], case.materials["lake"]
    assert (soil.parameter_names, soil.parameter_units, soil.start_parameters) == (("mv", "s"), ("", ""), [0.5, 5e9])
    assert (lake.parameter_names, lake.parameter_units, lake.start_parameters) == ((), (), [])
    assert STAGES["scene"].model.model_validate(STAGES["scene"].params(case)).materials == case.materials
    assert (case.laws["soil"].names, case.laws["soil"].units) == (("mv", "s"), ("", ""))
    assert case.at_start == case
    with pytest.raises(ConfigError, match=r"parameters \['mv', 's'\] has no curve"):
        case.laws["soil"](0.5, [0.1, 1.0])


def test_whole_parameters():
    soil = case_from(outside(WHOLE)).materials["soil"]
    assert soil.integers == (False, True)
    # the middle of 1 to 12 is none: the next
    assert soil.start_parameters == [4.75, 7.0]
    assert soil.handed([2.5, 3.0]) == {"a": 2.5, "n": 3}
    assert [type(x) for x in soil.handed([2.0, 3.0]).values()] == [float, int]
    with pytest.raises(ValueError, match=r"^X: n is 3\.5, expected a whole number"):
        soil.handed([2.5, 3.5])
    # above 2^53 doubles skip whole numbers
    assert soil.handed([2.5, 2.0**53])["n"] == 2**53
    with pytest.raises(ValueError, match=r"^X: n is 9\.0072e\+15, expected"):
        soil.handed([2.5, 2.0**53 + 2.0])
    assert case_from(outside({"bounds": [[0, 9], [1, 12]], "integer": True})).materials["soil"].integers == (True, True)
    water = {"law": "external", "names": ["n"], "integer": True, "parameters": [3]}
    data = outside(WHOLE)
    data["materials"]["water"] = water
    assert case_from(data).materials["water"].handed([3.0]) == {"n": 3}


@pytest.mark.parametrize(
    ("materials", "sections", "words"),
    [
        (
            {"bounds": [[0, 9], [1, 12.5]]},
            {},
            "bounds: n is 12.5, expected a whole number within +-2^53: the parameter is integer",
        ),
        ({"start": [1, 2.5]}, {}, "start: n is 2.5, expected a whole number"),
        ({"bounds": [[0, 9], [1, 1e17]]}, {}, "bounds: n is 1e+17, expected a whole number within +-2^53"),
        ({"integer": ["m"]}, {}, "integer: no parameter 'm'"),
        ({"integer": 3}, {}, "materials.soil.integer is 3, expected true or false"),
        ({"bounds": [[0, 1], [1, 4]], "integer": True}, {},
         "design.size is 8, expected less than 8, the number of combinations of whole parameters"),
        ({}, {"measurement": {"synthetic": {"parameters": {"soil": [1, 2.5]}}}},
         "measurement.synthetic.parameters.soil: n is 2.5, expected a whole number"),
        ({"law": "mangia", "names": None, "bounds": [[0, 1]] * 4}, {}, "integer is for parameters of law: external"),
    ],
)  # fmt: skip
def test_what_is_not_whole_is_refused(materials, sections, words):
    assert words in message(outside({**WHOLE, **materials}, **sections))


FORMULA = {"law": "formula", "formula": "a + b*cos(phi)", "names": ["a", "b"]}


def test_a_start_and_a_hidden_law_may_be_formulas():
    start = {**FORMULA, "parameters": [-25.0, 4.0]}
    case = case_from({**dyke(start=start), **synthetic(laws={"dyke": {**FORMULA, "parameters": [-3.0, 2.0]}})})
    assert case.start_with_another_law == ["dyke"]
    assert float(case.at_start.laws["dyke"](1.0, [-25.0, 4.0])) == pytest.approx(-25.0 + 4.0 * math.cos(1.0))
    own = {**FORMULA, "bounds": [[-30, 0], [0, 9]]}
    again = dyke(**own, start={**start, "formula": "a - b*cos(phi)"})
    assert case_from({**again, **synthetic(parameters={"dyke": [-3, 2]})}).start_with_another_law == ["dyke"]
    same = case_from({**dyke(**own, start=start), **synthetic(parameters={"dyke": [-3, 2]})})
    assert same.start_with_another_law == []


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"formula": "a.b + b"}, "materials.dyke: formula: found 'a.b' in 'a.b + b', expected numbers, names"),
        ({"bounds": [[0, 1], [0, 2000]]}, "bounds of b are [0, 2000], expected within +-1000"),
        ({"integer": True}, "integer is for parameters of law: external"),
        (
            {"formula": "a + sqrt(b - 1)"},
            "'a + sqrt(b - 1)' is nan at an incidence of 0 degrees and a = -30, b = 0,",
        ),
        ({"law": "mangia", "names": None, "bounds": None}, "formula is given, law is 'mangia'"),
        ({"law": "formulae"}, "mangia, nrl_sea, oh1992, tabulated, ulaby_dobson, formula, external"),
    ],
)
def test_what_a_formula_must_not_be(keys, words):
    own = {**FORMULA, "bounds": [[-30, -10], [0, 20]], **keys}
    text = message(dyke(**{key: value for key, value in own.items() if value is not None}))
    assert words in text
    assert "materials.dyke" in text
