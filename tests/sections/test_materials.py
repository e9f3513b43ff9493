"""Section materials: laws, bounds, starts and whole parameters."""

import math

import pytest
from config_samples import COMMAND, FIXED, FORMULA, NO_TRUTH, SOIL, WHOLE, X, dyke, outside, synthetic

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.errors import ConfigError


def test_start_is_the_middle_of_the_bounds_unless_given():
    bounds = [[-50, 0], [0, 20], [0, 1], [2, 4]]
    assert case_from(dyke(bounds=bounds)).materials["dyke"].start_parameters == [-25, 10, 0.5, 3]
    given = case_from(dyke(bounds=bounds, start=[-1, 1, 1, 2])).materials["dyke"]
    assert given.start_parameters == [-1, 1, 1, 2]
    assert case_from({"materials": FIXED}).materials["grass"].start_parameters == X


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
