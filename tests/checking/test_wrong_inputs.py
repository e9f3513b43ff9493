"""Wrong cases and files, each told in one sentence with key, value found and value expected."""

from pathlib import Path

import numpy as np
import pytest
from checking_samples import SLANT_RANGE, slant_range
from commands import typed

OUTSIDE = (
    "{kind: command, command: ['{python}', sim.py, '{input}'], input: {format: json}, output: {file: i.h5, scale: db}}"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slant_range()


def refused(text):
    """Sentence on the one problem of a case."""
    Path("mine.yaml").write_text(text, "utf-8")
    done = typed("check", "mine.yaml", code=1)
    assert type(done.exception) is SystemExit
    head, problem, *_ = done.stderr.splitlines()
    assert head == "radcal: mine.yaml cannot be run; 1 problem found:"
    return problem.removeprefix("  - ")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (SLANT_RANGE, "- case: mine\n- case: other\n", "holds list, expected keys and values"),
        ("looks: 4,", "looks: '4,5',", "line 3: radar.looks is '4,5', expected a number."),
        ("{looks: 4,", "{polarisation: [VV, VH],", "line 3: radar.polarisation is ['VV', 'VH'], expected 'HH', 'HV'"),
        ("radar:", "r\u0430dar:", "line 3: unknown key r\u0430dar (did you mean 'radar'?)"),
        ("deg: 20", "deg: 20 deg", "line 4: scene.near_incidence_deg is '20 deg', expected a number."),
        ("labels.tif", "https://a.org/b.tif", "line 4: scene.labels: the file https:/a.org/b.tif does not exist in"),
        ("{source: file, path", "[]\ncolours: {a", "line 6: colours: unknown key, expected a key colour in each"),
        ("{kind: builtin}", "!!set {kind}", "line 9: simulator is {'kind'}, expected keys and values"),
        ("{kind: builtin}", OUTSIDE.replace("sim.py", "3"), "line 9: simulator.command.1 is 3, expected a text"),
        ("{kind: builtin}", OUTSIDE.replace("{python}", "/tmp"), "line 9: simulator.command: /tmp is not a file"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("folder")
def test_wrong_keys(old, new, said):
    assert SLANT_RANGE.count(old) == 1
    assert refused(SLANT_RANGE.replace(old, new).removesuffix(" ")).startswith(said)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("names.json", '{"1": "field", "2": ', 'such as {"1": "grass"} (Expecting value: line 1 column 21 (char 20))'),
        ("names.json", '{"1.0": "field", "2": "lake"}', "(invalid literal for int() with base 10: '1.0')"),
        ("names.json", "[" * 100_000, "(maximum recursion depth exceeded"),
        ("names.json", '{"1": 7, "2": "lake"}', "materials.field: not in the scene, which has 7, lake"),
        ("image.npy", np.full((60, 50), np.nan), "measurement.path: image.npy holds no finite number, expected an im"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("folder")
def test_wrong_files(name, content, said):
    if isinstance(content, str):
        Path(name).write_text(content)
    else:
        np.save(name, content)
    assert said in refused(SLANT_RANGE)
