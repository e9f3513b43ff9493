import os
import re

import pytest
from config_samples import write

from radcal.config.yaml_file import read_case_file, read_value, settings
from radcal.errors import ConfigError


def sentence(folder, content):
    path = write(folder, content)
    with pytest.raises(ConfigError) as caught:
        read_case_file(path)
    assert re.fullmatch(rf"{re.escape(str(path))}.+\.", str(caught.value))
    return str(caught.value).removeprefix(str(path))


def test_anchors_and_merge_keys_behave(tmp_path):
    text = """
materials:
  dyke: &soil {calibrate: true, bounds: &box [[0, 50], [1, 2]]}
  grass: {<<: *soil, calibrate: false}
  road: {<<: [{law: a}, *soil], bounds: *box}
"""
    box = [[0, 50], [1, 2]]
    assert read_case_file(write(tmp_path, text))["materials"] == {
        "dyke": {"calibrate": True, "bounds": box},
        "grass": {"calibrate": False, "bounds": box},
        "road": {"law": "a", "calibrate": True, "bounds": box},
    }


def bomb(item, levels, of="[]"):
    """Aliases of aliases: nine times as many values on every level."""
    lines = [f"k0: &k0 {item}"]
    for n in range(levels):
        items = [f"*k{n}"] * 9 if of == "[]" else [f"m{i}: *k{n}" for i in range(9)]
        lines.append(f"k{n + 1}: &k{n + 1} {of[0]}{', '.join(items)}{of[1]}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("of", ["[]", "{}"])
@pytest.mark.parametrize(("levels", "shown"), [(8, "[0-9,]{10,}"), (60, r"10\^15 and more")])
def test_aliases_that_grow_without_end_are_refused(tmp_path, of, levels, shown):
    text = sentence(tmp_path, bomb("[1]", levels, of))
    assert re.fullmatch(rf": its aliases stand for {shown} values, expected at most 200,000\.", text)


def test_aliases_of_some_thousand_values_are_read(tmp_path):
    found = read_case_file(write(tmp_path, bomb("[7]", 4)))
    assert found["k4"][8][8][8][8] == [7]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("stop:\n  rms: 1\n  max_runs: 9\n  rms: 2\n", ", line 4: stop.rms is given here and in line 2, expected"),
        ("a:\n- b: 1\n- b: 1\n  c: {d: 0,\n    d: 0}\n", ", line 5: a.1.c.d is given here and in line 4"),
        ("a: &a {b: 1}\nc:\n  <<: *a\n  <<: *a\n", ", line 4: c.<< is given here and in line 3"),
        ("a: &a [1, *a]\n", ", line 1: the anchor that a.1 refers to contains itself."),
        ("", ": is empty, expected keys and values such as case: mine."),
        ("seed: 1\nstop:\n\trms: 1\n", ", line 3: not a YAML file (found character '\\t'"),
        ("seed: 1\n---\nseed: 2\n", ", line 2: not a YAML file (but found another document)."),
        ("a: !!python/object/apply:os.system [ls]\n", ", line 1: not a YAML file (could not determine a constructor"),
        ("a: 1\nb: 2024-13-45\n", ", line 2: 2024-13-45 is not a valid timestamp."),
        ("a: " + "9" * 5000 + "\n", f", line 1: {'9' * 57}... is not a valid int."),
        ("a: 0x" + "f" * 5000 + "\n", f", line 1: 0x{'f' * 55}... is not a valid int."),
        ('"a\\e[31m\\n": 1\n"a\\e[31m\\n": 1\n', r", line 2: a\x1b[31m\n is given here and in line 1"),
        pytest.param(
            "a: " + "[" * 2000 + "]" * 2000 + "\n",
            ": not a case (sections or lists nested in one another hundreds",
            marks=pytest.mark.slow,
        ),
        ("a: 1\nb: \x07\n", ", line 2: not a YAML file (character U+0007 in it)."),
        ("? [1, 2]\n: 3\n", ", line 1: not a YAML file (a key is a list or a section, expected a name)."),
        ("a:\n  no: {}\n", ", line 2: YAML reads the key no as False: put it in quotes."),
        ("a: 1\nb: 1:30\n", ", line 2: YAML reads 1:30 as 90: expected digits without colons or leading zeros."),
        ("a: 010\n", ", line 1: YAML reads 010 as 8: expected digits without colons or leading zeros."),
        ("a: *nobody\n", ", line 1: not a YAML file (found undefined alias"),
        ("seed: 1\ncase: é\n".encode("latin-1"), ", line 2: not a text file in UTF-8 (byte 0xe9 is not UTF-8"),
        (b"a: 1\n" * 40_001, ": holds 200,005 bytes, expected a case file of at most 200,000."),
    ],
)
def test_what_is_no_case_ends_in_a_sentence(tmp_path, content, said):
    assert sentence(tmp_path, content).startswith(said)


def test_line_ends_and_byte_order_marks_of_other_systems_are_read(tmp_path):
    found = read_case_file(write(tmp_path, b"\xef\xbb\xbfcase: mine\r\nstop:\r\n  max_runs: 30\r\n"))
    assert found == {"case": "mine", "stop": {"max_runs": 30}}


def test_what_is_no_file_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, why in (("pipe", "not a regular file"), ("gone", "No such file"), ("a\0", "no name")):
        with pytest.raises(ConfigError, match=rf"cannot be read \({why}"):
            read_case_file(tmp_path / name)


def test_values_of_the_command_line():
    assert read_value('{"rms": 1.0e-6}', "--config stop") == {"rms": 1e-6}
    assert read_value("", "--config stop") is None
    with pytest.raises(
        ConfigError, match=r"--config stop=.*: not valid JSON or YAML \(rms is given here and in line 1"
    ):
        read_value("{rms: 1, rms: 2}", "--config stop")
    with pytest.raises(ConfigError, match=r"--config stop=\{.{55,60}\.\.\.: not valid"):
        read_value("{rms: " + "[" * 500, "--config stop")


def test_settings_are_sections_merged_key_by_key():
    words = ["stop.max_runs=30", "materials.wheat 2.bounds=[[0, 1]]", "measurement.path=a=b", "stop={rms: 1}"]
    assert settings(words) == {
        "stop": {"max_runs": 30, "rms": 1},
        "materials": {"wheat 2": {"bounds": [[0, 1]]}},
        "measurement": {"path": "a=b"},
    }
    for word in ("stop.rms", "=3", "stop..rms=1", ".=1", "stop.=1"):
        with pytest.raises(ConfigError, match=r"^--set .*: expected KEY=VALUE such as stop\.rms=1e-6\.$"):
            settings([word], "--set")
    with pytest.raises(ConfigError, match=r"^--config: seed is given twice, expected once\.$"):
        settings(["seed=1", "stop={rms: 1}", "seed=1"])
    with pytest.raises(ConfigError, match=r"^--set: stop\.rms is given twice"):
        settings(["stop.rms=1", "stop={rms: 2}"], "--set")


def test_numbers_are_those_that_people_write(tmp_path):
    found = read_case_file(
        write(tmp_path, "a: [0, 0.5, -3, 1.0e-3, 1e-3, 0x1f, .inf, true, '010', 07:61, 1:30x, 0.0]\n")
    )
    assert found["a"] == [0, 0.5, -3, 1e-3, "1e-3", 31, float("inf"), True, "010", "07:61", "1:30x", 0.0]
