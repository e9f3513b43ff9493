"""Number formats that cannot write a parameter between its bounds are found before any run."""

import pytest

from radcal.config import Material, case_from
from radcal.errors import ConfigError
from radcal.programs.command_plan import check_command, check_numbers
from radcal.programs.placeholders import argument, template

SOIL = {"calibrate": True, "law": "external", "names": ["a", "m", "rows"], "integer": ["rows"]}
MATERIALS = {
    "soil": Material.model_validate(SOIL | {"bounds": [[-25, -5], [0.2, 0.8], [1, 12]]}),
    "wood": Material.model_validate({"law": "external", "names": ["g"], "parameters": [-8.25]}),
}


@pytest.mark.parametrize("text", ["soil.m", "soil.m:.2f", "soil.m:14.6e", "soil.a:5.1f", "soil.rows:4d", "wood.g:6.2f",
                                  "soil.m:.1%"])  # fmt: skip
def test_formats_that_resolve_the_bounds_are_accepted(text):
    check_numbers(MATERIALS, [template(f"x=@{text}@", "@", "key"), argument(f"--x={{{text}}}", "key")])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "soil.m:4.0f",
            "soil.m:4.0f writes the bounds [0.2, 0.8] of soil.m as 0 and 1, and 102 values from bound to bound as 2 "
            "different numbers, expected at least 50, all inside of the bounds: write more digits, or soil.m alone for "
            "all of them.",
        ),
        # the bounds are written exactly, but few numbers between them
        ("soil.m:.1f", "as 0.2 and 0.8, and 102 values from bound to bound as 7 different numbers"),
        ("soil.rows:.0e", "as 1e+00 and 1e+01, expected the same whole numbers: write soil.rows:d"),
        ("soil.a:4.1f", "soil.a = -25.0 written as 4.1f is '-25.0', wider than its field of 4 characters"),
        ("wood.g:4.2f", "wood.g = -8.25 written as 4.2f is '-8.25', wider than its field of 4 characters"),
    ],
)
def test_formats_that_cannot_write_a_parameter_are_refused(text, said):
    for marked in (template(f"x=@{text}@", "@", "sim.tpl"), argument(f"--x={{{text}}}", "sim.tpl")):
        with pytest.raises(ConfigError) as refused:
            check_numbers(MATERIALS, [marked])
        assert str(refused.value).startswith("sim.tpl: ")
        assert said in str(refused.value)


def test_only_rounding_may_lead_out_of_the_bounds():
    narrow = {"soil": Material.model_validate(SOIL | {"bounds": [[-25.04, -5.04], [0.26, 0.31], [1, 18]]})}
    check_numbers(narrow, [argument("{soil.a:.1f}", "key")])
    # enough numbers between the bounds, but the upper one is written as 1100
    far = {"soil": Material.model_validate(SOIL | {"bounds": [[-25, -5], [0, 1060], [1, 18]]})}
    with pytest.raises(ConfigError, match=r"as 0\.0e\+00 and 1\.1e\+03, .* write more digits"):
        check_numbers(far, [argument("{soil.m:.1e}", "key")])


def test_the_check_of_a_case_asks_for_it():
    data = {"kind": "command", "command": ["sh", "{soil.a:.0f}", "{soil.m}", "{soil.rows}", "{wood.g}", "{noise_seed}"]}
    output = {"file": "image.npy", "scale": "db"}
    measurement = {"source": "file", "path": "m.npy", "scale": "db", "radiometry": "sigma0_ref"}
    case = {"simulator": data | {"output": output}, "materials": MATERIALS, "measurement": measurement}
    with pytest.raises(ConfigError, match=r"^simulator\.command\.1: soil\.a:\.0f writes the bounds \[-25, -5\]"):
        check_command(case_from(case))
