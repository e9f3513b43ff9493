"""What is left of a case with mistakes, so that all other keys are checked as well."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from radcal.config.mistakes import Loaded, load_with_problems

IMAGE = {"source": "file", "path": "a.npy", "scale": "db", "radiometry": "sigma0_ref"}
FIELD = {"field": {"calibrate": True}}


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.chdir(tmp_path)
    Path("a.npy").touch()

    def of(data: dict[str, Any]) -> Loaded:
        Path("mine.yaml").write_text(yaml.safe_dump(data))
        return load_with_problems(["mine.yaml"])

    return of


def test_a_wrong_key_of_a_further_pass_leaves_the_first_as_it_is(loaded: Any) -> None:
    radar = [{"looks": 7, "depression_deg": 41}, {"looks": 0, "depression_deg": 52}]
    found = loaded({"radar": radar, "measurement": [IMAGE, IMAGE], "materials": FIELD})
    assert len(found.problems) == 1
    assert "looks is 0" in found.problems[0]
    assert [one.radar.depression_deg for one in found.case.passes] == [41, 52]
    assert found.case.passes[0].radar.looks == 7


def test_a_wrong_key_leaves_the_others_of_its_section(loaded: Any) -> None:
    found = loaded({"stop": {"rms": "small", "max_runs": 77}})
    assert found.wrong == {"stop.rms"}
    assert found.case.stop.max_runs == 77
    assert found.without == frozenset()
    # a section of wrong keys alone is left out
    assert loaded({"stop": {"rms": "small"}}).without == {"stop"}


def test_a_misspelt_key_is_taken_for_the_nearest_that_is_not_there(loaded: Any) -> None:
    found = loaded({"stop": {"max_rnus": 77}})
    assert (len(found.problems), found.case.stop.max_runs, found.wrong) == (1, 77, frozenset())
    both = loaded({"stop": {"max_rnus": 77, "max_runs": 99}})
    assert (len(both.problems), both.case.stop.max_runs) == (1, 99)
    # what is wrong about its value is told, too
    assert len(loaded({"stop": {"max_rnus": 0}}).problems) == 2


def test_a_required_key_that_was_left_out_is_not_called_missing(loaded: Any) -> None:
    found = loaded({"measurement": {**IMAGE, "path": [1]}, "materials": FIELD})
    assert len(found.problems) == 1
    assert "measurement.path is [1]" in found.problems[0]
    missing = loaded({"measurement": {key: value for key, value in IMAGE.items() if key != "path"}})
    assert len(missing.problems) == 1
    assert "measurement.path is missing" in missing.problems[0]


@pytest.mark.parametrize(
    ("keys", "wrong"),
    [
        ({"output": {"file": "image.npy", "scale": "dB"}}, "output.scale is 'dB'"),
        ({"output": {"scale": "db"}}, "output.file is missing"),
        ({"output": {"file": "image.npy", "scale": "db", "dtype": "float32"}}, "output: dtype is for files"),
        ({"timeout_s": "60s"}, "timeout_s is '60s'"),
        ({"files": ["a/s.json", "b/s.json"]}, "files.1 and files.0 are both"),
    ],
)
def test_a_wrong_key_of_a_program_leaves_its_command(loaded: Any, keys: dict[str, Any], wrong: str) -> None:
    """The kind of simulator, command, is the name of a key, too."""
    command = {"kind": "command", "command": ["./sim"], "output": {"file": "image.npy", "scale": "power"}}
    (problem,) = loaded({"simulator": command | keys}).problems
    assert problem.removeprefix("mine.yaml: simulator").lstrip(".: ").startswith(wrong)


@pytest.mark.parametrize(
    ("material", "wrong"),
    [
        ({"law": "tabulated", "parameters": [-9, -10], "angles_deg": "low"}, "angles_deg is 'low'"),
        ({"law": "formula", "parameters": [-9], "names": ["a"], "formula": [1]}, "formula is [1]"),
        ({"law": "constant_gamma", "parameters": "low"}, "parameters is 'low'"),
        ({"law": "external", "calibrate": True, "names": ["p"], "bounds": "low"}, "bounds is 'low'"),
        ({"law": "external", "calibrate": True, "names": [3], "bounds": [[0, 1]]}, "names.0 is 3"),
        ({"calibrate": True, "start": {"law": "constant_gamma", "parameters": ["low"]}}, "start.parameters.0 is 'low'"),
    ],
)
def test_a_key_of_a_material_that_was_left_out_is_not_called_missing(
    loaded: Any, material: dict[str, Any], wrong: str
) -> None:
    command = {"kind": "command", "command": ["./sim"], "output": {"file": "image.npy", "scale": "power"}}
    case = {"simulator": command} if material.get("law") == "external" else {}
    (problem,) = loaded({**case, "materials": {**FIELD, "other": material}}).problems
    assert problem.startswith(f"mine.yaml: materials.other.{wrong}, expected")


def test_one_mistake_of_two_materials_is_told_of_both(loaded: Any) -> None:
    """The same words about two materials, of which none may stand for the other."""
    found = loaded({"materials": {name: {"calibrate": True, "bounds": [[0, -40] for _ in range(4)]} for name in "ab"}})
    assert sum("a: bounds of X1 are [0, -40]" in text for text in found.problems) == 1
    assert sum("b: bounds of X1 are [0, -40]" in text for text in found.problems) == 1


def test_keys_of_a_sensor_that_were_left_out_are_not_called_missing(loaded: Any) -> None:
    radar = {"sensor": "sentinel1_iw_grdh", "incidence_deg": "steep", "polarisation": "VV"}
    first, second = loaded({"radar": radar, "materials": FIELD}).problems
    assert "radar.incidence_deg is 'steep'" in first
    assert second.endswith("radar: nesz_db is missing, which sensor sentinel1_iw_grdh does not give (docs/sensors.md).")
    (alone,) = loaded({"radar": {**radar, "nesz_db": -22}, "materials": FIELD}).problems
    assert alone == first


def test_that_nothing_is_calibrated_is_told_unless_materials_are_wrong(loaded: Any) -> None:
    said = "mine.yaml: materials: none is marked calibrate: true, expected at least one."
    fixed = {"law": "constant_gamma", "parameters": [-12]}
    assert loaded({"materials": {"a": fixed}, "measurement": IMAGE}).problems == [said]
    (problem,) = loaded({"materials": {"a": fixed, "b": {"calibrate": True, "law": 3}}, "measurement": IMAGE}).problems
    assert problem.startswith("mine.yaml: materials.b.law is 3")
    assert loaded({"materials": {"a": fixed}}).problems == []  # for radcal simulate


def test_a_section_that_was_left_out_is_not_compared_with_the_others(loaded: Any) -> None:
    """The defaults in its place contradict what the case says elsewhere."""
    dyke = {"law": "constant_gamma", "calibrate": True, "bounds": [[-20, 0]]}
    found = loaded({"materials": {"dyke": dyke}, "measurement": {**IMAGE, "path": [1], "scale": 3, "radiometry": 4}})
    assert found.without == {"measurement"}
    assert [text.split()[1] for text in found.problems] == [
        f"measurement.{key}" for key in ("scale", "radiometry", "path")
    ]


def test_a_duplicate_key_hides_no_other_mistake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("seed: 1\nradar: {looks: 3}\nseed: 2\nradar: {looks: 0}\nstop: {rms: low}\n")
    found = load_with_problems(["mine.yaml"])
    assert [text.partition(",")[0] for text in found.problems[2:]] == [
        "mine.yaml: radar.looks is 0",
        "mine.yaml: stop.rms is 'low'",
    ]
    assert found.problems[0].startswith("mine.yaml, line 3: seed is given here and in line 1, expected each key once")
    assert found.problems[1].startswith("mine.yaml, line 4: radar is given here and in line 2, expected each key once")
    assert found.case.seed == 2


def test_a_contradiction_in_a_pass_leaves_its_other_keys(loaded: Any) -> None:
    found = loaded({"radar": {"altitude_m": 693, "incidence_deg": 38, "looks": 7, "frequency_ghz": 5.4, "band": "X"}})
    assert [text.split()[2] for text in found.problems] == ["altitude_m", "frequency_ghz"]
    assert found.wrong == {"radar.altitude_m", "radar.frequency_ghz"}
    assert found.case.radar.looks == 7


def test_one_mistake_of_a_material_is_told_once(loaded: Any) -> None:
    law = {"law": "constant_gamma"}
    found = loaded({"materials": {"a": {**law, "parameters": ["nineteen"]}, "b": {**law, "calibrate": "yes please",
        "parameters": [-15]}, "c": {**law, "calibrate": "on top", "bounds": [-20, -10]}}})  # fmt: skip
    assert sorted(text.removeprefix("mine.yaml: materials.") for text in found.problems) == [
        "a.parameters.0 is 'nineteen', expected a valid number, for example -15.",
        "b.calibrate is 'yes please', expected true or false.",
        "c.bounds: -20 is no interval, expected [lower, upper] for each parameter, for example bounds: [[-20, -10]].",
        "c.calibrate is 'on top', expected true or false.",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [("-24 dB", "(without its unit: -24)"), ("-24,5", "(with a decimal point: -24.5)"), ("low", ", for example -24")],
)
def test_a_text_for_a_number_is_answered_with_a_number(loaded: Any, text: str, said: str) -> None:
    assert loaded({"radar": {"looks": 3, "nesz_db": text}}).problems == [
        f"mine.yaml: radar.nesz_db is {text!r}, expected a valid number{' ' * said.startswith('(')}{said}."
    ]


def test_a_material_with_a_wrong_law_still_is_a_known_name(loaded: Any) -> None:
    materials = {"field": {"calibrate": True}, "water": {"calibrate": True, "law": "mangai"}}
    hidden = [-30.0, 6.5, 22.0, 11.0]
    synthetic = {"parameters": {"field": hidden, "water": hidden}, "fields_db": {"water": 0.5}}
    data = {"materials": materials, "target": {"reference_materials": ["water"]}}
    found = loaded({**data, "measurement": {"synthetic": synthetic}})
    assert [text.partition(",")[0] for text in found.problems] == ["mine.yaml: materials.water: law is 'mangai'"]
    synthetic["parameters"] = {"field": hidden, "watre": hidden}
    found = loaded({**data, "measurement": {"synthetic": synthetic}})
    misspelt = loaded({"mateirals": {**materials, "water": {"parameters": [-30, 6, 9, 4]}}, "target": data["target"]})
    assert misspelt.problems == ["mine.yaml: unknown key mateirals (did you mean 'materials'?)."]
    assert found.problems[1:] == [
        "mine.yaml: measurement.synthetic.parameters.watre: no such material (did you mean 'water'?)."
    ]
