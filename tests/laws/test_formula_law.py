"""Laws written as formulas: against the built-in laws, and what is refused."""

import math

import numpy as np
import pytest

from radcal.errors import ConfigError
from radcal.laws import LAWS, law_for
from radcal.laws.formula import FUNCTIONS, Formula, formula_law, refuse_infinite
from radcal.posterior.curves import GRID_DEG, curves_of

MANGIA = ("X1 + X2*cos(phi) + X3*exp(-X4*phi**2)", ("X1", "X2", "X3", "X4"))
ULABY = ("P1 + P2*exp(-P3*phi) + P4*cos(P5*phi + P6)", ("P1", "P2", "P3", "P4", "P5", "P6"))
GAMMA = ("gamma + 10*log10(max(cos(phi), 1e-6))", ("gamma",))


@pytest.mark.parametrize(("name", "formula"), [("mangia", MANGIA), ("ulaby_dobson", ULABY), ("constant_gamma", GAMMA)])
def test_laws_as_formulas(name, formula):
    rng, phi = np.random.default_rng(3), np.radians(np.linspace(0.0, 90.0, 37))
    for x in rng.uniform(-3.0, 3.0, (20, len(formula[1]))):
        np.testing.assert_allclose(Formula(*formula)(phi, x), LAWS[name](phi, x), rtol=1e-14, atol=1e-13)


def test_angles_in_degrees_and_the_frequency():
    law = law_for("formula", formula="a - theta/b + 20*log10(f_ghz)", names=["a", "b"]).bound(frequency_ghz=5.4)
    assert float(law(math.radians(42.0), [-8.0, 3.0])) == pytest.approx(-8.0 - 14.0 + 20.0 * math.log10(5.4))
    assert law.needs == ()
    assert formula_law("a*f_ghz", ["a"]).needs == ("frequency_ghz",)
    with pytest.raises(ConfigError, match=r"radar.frequency_ghz is missing: law 'formula' depends on it"):
        law_for("formula", formula="a*f_ghz", names=["a"])(0.3, [1.0])


def test_each_function_is_the_one_of_its_name():
    x = 0.37
    own = {
        "arcsin": math.asin, "arccos": math.acos, "arctan": math.atan, "abs": abs, "min": min, "max": max
    }  # fmt: skip
    for name in FUNCTIONS:
        two = name in ("min", "max")
        found = Formula(f"{name}(a - 1{', 0.2' if two else ''})", ("a",))(0.5, [1.0 + x])
        expected = (own.get(name) or getattr(math, name))(*([x, 0.2] if two else [x]))
        assert float(found) == pytest.approx(expected, rel=1e-13), name


def test_all_x_are_evaluated_at_once():
    law = formula_law(*MANGIA)
    x = np.random.default_rng(2).uniform(0.0, 9.0, (7, 4))
    together = law(np.radians(GRID_DEG)[:, None], x.T)
    np.testing.assert_array_equal(together.T, curves_of(LAWS["mangia"], x))
    # without the angle, too
    assert formula_law("a", ["a"])(np.radians([10.0, 20.0]), [-12.0]).tolist() == [-12.0, -12.0]
    assert formula_law("a", ["a"])(np.radians(GRID_DEG)[:, None], x[:, :1].T).shape == (361, 7)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a.real", "found 'a.real'"),
        ("__import__('os').system('true')", "found \"__import__('os').system('true')\""),
        ("a if phi > 1 else 2", "found 'a if phi > 1 else 2'"),
        ("a + True", "found 'True'"),
        ("a + 1j", "found '1j'"),
        ("a + 1e31", "expected numbers up to 1e+30"),
        ("a + b", "found 'b' in 'a + b', expected one of a, phi, theta, f_ghz, pi, or a function"),
        ("a*cos(phi, 2)", "expected cos with 1 argument"),
        ("min(a)", "expected min with 2 arguments"),
        ("cos(x=a)", "found 'cos(x=a)'"),
        ("cos + a", "found 'cos'"),
        ("a // 2", "found 'a // 2'"),
        ("a; a", "expected one expression"),
        ("", "expected one expression"),
        ("a\0", "expected one expression"),
        ("a" + " + a" * 150, "has 601 characters, expected at most 500"),
    ],
)
def test_anything_else_is_refused(text, words):
    with pytest.raises(ValueError, match="formula") as caught:
        Formula(text, ("a",))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("a", "b"), "'b' does not occur in the formula"),
        (("a", "phi"), "'phi' has a meaning in formulas"),
        ((), "names has 0 entries"),
        (tuple(f"a{k}" for k in range(21)), "names has 21 entries, expected 1 to 20"),
    ],
)
def test_names_of_parameters(names, words):
    with pytest.raises(ValueError, match="names") as caught:
        Formula("a + phi", names)
    assert words in str(caught.value)
    with pytest.raises(ValueError, match="names: '_b' is not a letter followed by"):
        law_for("formula", formula="a + _b", names=["a", "_b"])


def test_large_powers_end_at_once_and_are_refused():
    """Python's whole numbers would grow without limit here."""
    law = formula_law("a + 9**9**9**9", ["a"])
    with pytest.raises(ConfigError, match=r"is inf at an incidence of 0 degrees and a = 1, expected a finite sigma0"):
        law(0.0, [1.0])


def test_a_value_that_is_not_finite_is_named():
    law = formula_law("a + 10*log10(cos(phi) - b)", ["a", "b"])
    sentence = (
        r"formula 'a \+ 10\*log10\(cos\(phi\) - b\)' is nan at an incidence of 80 degrees and a = -10, b = 0.3, "
        r"expected a finite sigma0 in dB from 0 to 90 degrees\."
    )
    with pytest.raises(ConfigError, match=sentence):
        law(np.radians([70.0, 80.0]), [-10.0, 0.3])
    assert np.isfinite(law(np.radians([60.0, 70.0]), [-10.0, 0.3])).all()


def test_bounds_are_tried_at_their_middle_corners_and_between():
    root = formula_law("a + sqrt(b)", ["a", "b"])
    refuse_infinite(root, box=[(-30, 0), (0, 4)])
    with pytest.raises(ValueError, match=r"is nan at an incidence of 0 degrees and a = -30, b = -0.01"):
        refuse_infinite(root, box=[(-30, 0), (-0.01, 4)])
    with pytest.raises(ValueError, match="is inf at an incidence of 0 degrees and a = 1, b = 2"):
        refuse_infinite(formula_law("a/(b - 2)", ["a", "b"]), at=[1.0, 2.0])
    between = formula_law("a + sqrt((b - 1)*(b - 2))", ["a", "b"])  # finite at corners and middle
    with pytest.raises(ValueError, match="is nan at an incidence"):
        refuse_infinite(between, box=[(-30, 0), (0, 5)])


def test_angles_of_single_precision_do_not_exceed_90_degrees():
    law = formula_law("a + 10*log10(cos(phi))", ["a"])
    assert np.isfinite(law(np.float32(np.pi / 2), [0.0]))


def test_blanks_and_brackets_change_nothing():
    assert formula_law(" a+(b* cos( phi))", ["a", "b"]).formula == formula_law("a + b*cos(phi)", ["a", "b"]).formula
    assert formula_law("(a + b)*phi", ["a", "b"]).formula != formula_law("a + b*phi", ["a", "b"]).formula
    for names in (["a", "b"], ["b", "a"]):  # whose order is part of a run's key
        described = law_for("formula", formula=" a+b*(phi)", names=names).description
        assert described == {"law": "formula", "formula": "a + b * phi", "names": names}


def test_limits_of_a_formula_hold_on_both_sides():
    """Exponents from -20 to 20; trees of 30 levels."""
    for exponent in (-20, 20, -20.0):
        Formula(f"a*phi**{exponent}", ("a",))
    for exponent in (-21, 21, -20.5):
        with pytest.raises(ValueError, match="expected exponents up to 20"):
            Formula(f"a*phi**{exponent}", ("a",))
    Formula("abs(" * 29 + "a" + ")" * 29, ("a",))
    with pytest.raises(ValueError, match="nested more than 30 deep"):
        Formula("abs(" * 30 + "a" + ")" * 30, ("a",))


def test_a_formula_is_tried_up_to_90_degrees_and_inside_of_its_bounds_alone():
    refuse_infinite(formula_law("a + sqrt(3 - a)*cos(phi)", ["a"]), box=[(1.0, 3.0)])
    with pytest.raises(ValueError, match="at an incidence of 0 degrees and a = 3\\."):
        refuse_infinite(formula_law("a + sqrt(3 - a)*cos(phi)", ["a"]), box=[(1.0, 3.5)])
    with pytest.raises(ValueError, match="is inf at an incidence of 90 degrees"):
        refuse_infinite(formula_law("a/(pi/2 - phi)", ["a"]), at=[1.0])


def test_a_pole_is_found_in_spite_of_rounding():
    """30 degrees converted to radians and back are not exactly 30, so that the value is finite, and huge."""
    said = r"formula 'a \+ 1/\(theta-30\)' is -2\.8.*e\+14 at an incidence of 30 degrees"
    with pytest.raises(ValueError, match=said):
        refuse_infinite(formula_law("a + 1/(theta-30)", ["a"]), box=[(-30.0, 0.0)])
    refuse_infinite(formula_law("a - 1/cos(phi)", ["a"]), at=[1.0])  # a pole at 90 degrees, which no facet reaches
