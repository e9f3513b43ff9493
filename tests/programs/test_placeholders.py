"""Numbers reach the program's input files exactly, or not at all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radcal.errors import ConfigError
from radcal.programs.placeholders import argument, template

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite, st.integers(0, 2**63 - 1))
def test_numbers_are_written_in_full(x, seed):
    values = {"wet field-2.X1": x, "noise_seed": seed}
    text = argument("--x={wet field-2.X1} {{{noise_seed}}}", "key").filled(values)
    number, _, rest = text.removeprefix("--x=").partition(" ")
    assert float(number) == x
    assert rest == f"{{{seed}}}"
    line = template("a @ wet field-2.X1 @ $@noise_seed@\n", "@", "key").filled(values)
    assert line == f"a {x!r} ${seed}\n"


@given(st.binary(max_size=200))
def test_all_bytes_around_markers_stay_as_they_are(content):
    around = content.replace(b"@", b"").decode("latin-1")
    marked = template(f"{around}@a.b@{around}", "@", "key")
    assert marked.filled({"a.b": 1.5}).encode("latin-1") == (f"{around}1.5{around}").encode("latin-1")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{dyke.X5}", r"^key: unknown placeholder 'dyke\.X5' \(did you mean 'dyke\.X1'\?\)\.$"),
        ("{", r"^key is '\{': .* braces\.$"),
        ("}", "braces"),
        ("{}", "expected {name}"),
        ("{dyke.X1!r}", "expected {name}"),
        ("{dyke.X1:d}", r"dyke\.X1 cannot be written as 'd'"),
        ("{dyke.X1:1..9}", r"^key: dyke\.X1:1\.\.9 has a range, which only noise_seed may have\.$"),
        ("{noise_seed:9..1}", r"^key: the range of noise_seed is 9\.\.1, expected lower < upper\.$"),
        ("{noise_seed:9..9}", r"^key: the range of noise_seed is 9\.\.9, expected lower < upper\.$"),
        ("{noise_seed:1...9}", r"noise_seed cannot be written as '1\.\.\.9'"),
    ],
)
def test_wrong_arguments_are_refused(text, words):
    with pytest.raises(ConfigError, match=words):
        argument(text, "key").checked({"dyke.X1": 1.0, "noise_seed": 1})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("first\nmail@home\n", r"^key: line 2 holds @ 1 times, expected pairs"),
        ("a @dyke.X9@", "unknown placeholder 'dyke.X9'"),
        ("a @ @", "line 1 has an empty marker"),
        ("nothing", "no marker between two @"),
    ],
)
def test_wrong_templates_are_refused(text, words):
    with pytest.raises(ConfigError, match=words):
        template(text, "@", "key").checked({"dyke.X1": 1.0})
