"""Values that are still to be decided, by their place, line and example."""

from __future__ import annotations

from pathlib import Path

import yaml

from radcal.config.undecided import undecided

CASE = """\
case: mine
radar:
  looks: FILL_IN
  depression_deg: 40
materials:
  FILL_IN: {calibrate: true}
  crops:
    law: constant_gamma
    parameters: [FILL_IN, 2, FILL_IN]
scene: {elevation: FILL_IN, cell_m: FILL_IN}
"""


def test_each_value_is_found_once_at_its_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(CASE)
    found = undecided(yaml.safe_load(CASE), [file])
    assert [(one.key, one.line) for one in found] == [
        ("radar.looks", 3),
        ("materials.FILL_IN", 6),
        # the items of a list are decided together
        ("materials.crops.parameters", 9),
        ("materials.crops.parameters", 9),
        ("scene.elevation", 10),
        ("scene.cell_m", 10),
    ]
    assert [one.text for one in found[:1] + found[2:3] + found[4:]] == [
        "radar.looks is FILL_IN (line 3), expected its value, for example looks: 4.4",
        "materials.crops.parameters is FILL_IN (line 9), expected its value, for example parameters: [-15]",
        "scene.elevation is FILL_IN (line 10), expected its value, for example elevation: data/dem.tif",
        "scene.cell_m is FILL_IN (line 10), expected its value",
    ]
    assert "expected the name of a material of the scene in its place" in found[1].text


def test_a_list_has_the_line_of_its_key_and_a_setting_none(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("materials:\n  crops:\n    parameters:\n    - 1\n    - FILL_IN\n    - FILL_IN\n")
    assert undecided(yaml.safe_load(file.read_text()), [file])[0].line == 3
    (setting,) = undecided({"radar": {"looks": "FILL_IN"}}, [file])
    assert setting.line is None
    assert setting.text.startswith("radar.looks is FILL_IN, expected")
    assert undecided({"radar": {"looks": 4}}, [file]) == []
