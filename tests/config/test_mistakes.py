"""All mistakes of a case at once, each with key, value found and value expected."""

from pathlib import Path

import pytest
import yaml
from config_samples import COMMAND, measured

from radcal.config import Radar, load_with_problems

IMAGE = measured(path="a.npy")["measurement"]


@pytest.fixture
def loaded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def of(data):
        Path("mine.yaml").write_text(data if isinstance(data, str) else yaml.safe_dump(data))
        return load_with_problems(["mine.yaml"])

    return of


def test_every_wrong_key_of_all_sections_and_passes_is_told_once(loaded):
    radar = [{"looks": 7, "depression_deg": 41}, {"looks": 0, "depression_deg": 52, "loks": 3}]
    materials = {"a": {"law": "constant_gamma", "parameters": ["low"], "calibrate": "maybe"}, "b": {"law": "mangja"}}
    found = loaded({"sede": 3, "radar": radar, "measurement": [IMAGE, IMAGE], "materials": materials})
    said = {" ".join(text.partition(": ")[2].split()[:4]) for text in found.problems}
    assert said == {
        "unknown key sede (did", "unknown key radar.2.loks (did", "radar.2.looks is 0, expected",
        "materials.a.parameters.0 is 'low', expected", "materials.a.calibrate is 'maybe', expected",
        "materials.b: law is 'mangja',",
    }  # fmt: skip
    assert len(found.problems) == 6


def test_a_section_with_a_mistake_leaves_the_others_for_further_checks(loaded):
    found = loaded({"stop": {"rms": "small", "max_runs": 77}, "radar": {"looks": 7}})
    assert len(found.problems) == 1
    assert (found.case, found.rest.radar.looks, found.rest.stop.max_runs) == (None, 7, 200)
    assert loaded({"radar": [{"looks": 7}, {"looks": 9}]}).rest is None


def test_contradictions_between_sections_are_told_once_all_sections_are_right(loaded):
    def problems(**more):
        return list(
            loaded({"design": {"reuse": "mine", "size": 2}, "case": "mine", "stop": {"max_runs": 1}, **more}).problems
        )

    assert [text.split(": ")[1].split()[0] for text in problems()] == ["design.reuse", "stop.max_runs"]
    for key, value in (("seed", -1), ("seed", "FILL_IN"), ("case", "FILL_IN")):
        (problem,) = problems(**{key: value})
        assert f"{key} is" in problem


def test_what_is_still_to_be_decided_has_its_line_and_its_meaning(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "radar:\n  looks: FILL_IN\n  depression_deg: 40\nmaterials:\n  FILL_IN: {calibrate: true}\n"
        "  crops:\n    law: constant_gamma\n    parameters:\n    - 1\n    - FILL_IN\n"
        "scene: {source: raster, elevation: FILL_IN, materials: a.tif, vertical_datum: EGM96, cell_m: FILL_IN}\n"
    )
    found = load_with_problems([file], {"stop": {"rms": "FILL_IN"}}).problems
    assert sorted(text.removeprefix(f"{file}, ") for text in found) == [
        "command line: stop.rms is FILL_IN, expected tolerance of the rms difference between the densities [1/dB].",
        "line 11: scene.cell_m is FILL_IN, expected cell size of the scene [m].",
        "line 11: scene.elevation is FILL_IN, expected GeoTIFF or other raster of heights [m].",
        f"line 2: radar.looks is FILL_IN, expected {Radar.model_fields['looks'].description.partition(';')[0]}.",
        "line 5: materials.FILL_IN is FILL_IN, expected the name of a material of the scene in its place, for example "
        "crops: {calibrate: true}.",
        "line 8: materials.crops.parameters is FILL_IN, expected fixed parameters (calibrate: false).",
    ]


def test_the_kind_of_a_simulator_is_not_its_key_command(loaded):
    for key, value, wrong in (
        ("output", {"file": "i.npy", "scale": "dB"}, ".output.scale is 'dB'"),
        ("files", ["a/s.json", "b/s.json"], ": files.1 and files.0 are both"),
    ):
        (problem,) = loaded({"simulator": {**COMMAND, key: value}}).problems
        assert problem.partition(": simulator")[2].startswith(wrong)


def test_one_mistake_of_two_materials_is_told_of_both(loaded):
    wrong = {"calibrate": True, "bounds": [[0, -40], [0, 1], [3, 2], [0, 1]]}
    assert [text.split(": ")[1:] for text in loaded({"materials": {"a": wrong, "b": wrong}}).problems] == [
        [f"materials.{name}", f"bounds of {x}, expected lower < upper."]
        for name in "ab"
        for x in ("X1 are [0, -40]", "X3 are [3, 2]")
    ]
