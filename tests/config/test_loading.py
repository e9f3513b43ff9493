"""Files and overrides that a case is read from."""

import pytest
import yaml
from config_samples import X, write

from radcal.config import Case, load, load_forward
from radcal.errors import ConfigError


@pytest.mark.parametrize("value", ['{"rms": 1e-4}', "{rms: 1e-4}", {"rms": "1e-4"}, {"rms": 1e-4}])
def test_later_files_and_overrides_win_key_by_key(tmp_path, value):
    first = write(tmp_path, "seed: 3\nstop: {rms: 0.1, max_runs: 50}\n")
    second = write(tmp_path, "stop: {rms: 0.2}\n", "more.yaml")
    for case, rms, seed in ((load([first, second]), 0.2, 3), (load([first], {"stop": value, "seed": "7"}), 1e-4, 7)):
        assert (case.seed, case.stop.rms, case.stop.max_runs) == (seed, rms, 50)


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        # Snakemake hands over what it has merged: a key of the file keeps its line
        (
            {"seed": 3, "materials": {"dyke": {"calibrate": True, "bounds": [[0, -1]]}}},
            "case.yaml, line 6: materials.dyke: bounds",
        ),
        ({"materials": {"dyke": {"bounds": [[1, -1]]}}}, "case.yaml, command line: materials.dyke: bounds"),
        ({"materials": {"dyke": {"bounds": {"0": [0, 1]}}}}, "case.yaml, command line: materials.dyke.bounds is {'0'"),
    ],
)
def test_a_mistake_has_the_place_of_its_key(tmp_path, monkeypatch, overrides, said):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "seed: 3\n\nmaterials:\n  dyke:\n    calibrate: true\n    bounds: [[0, -1]]\n")
    with pytest.raises(ConfigError) as caught:
        load(["case.yaml"], overrides)
    assert str(caught.value).startswith(said)


CALIBRATED = {
    "dyke": {"calibrate": False, "parameters": [-20.0, 5.0, 9.0, 2.0], "looks": 2.5},
    "grass": {"parameters": [-22.0, 9.0, 9.0, 3.5]},
}


def test_materials_of_another_file(tmp_path):
    other = write(tmp_path, yaml.safe_dump({"materials": CALIBRATED, "stop": {"rms": 0.3}}), "calibrated.yaml")
    lake = {"calibrate": True, "bounds": [[0, 1]] * 4}
    path = write(tmp_path, yaml.safe_dump({"materials_from": str(other), "materials": {"lake": lake, "grass": lake}}))
    case = load([path])
    assert list(case.materials) == ["dyke", "grass", "lake"]
    assert case.materials["dyke"].parameters == [-20.0, 5.0, 9.0, 2.0]
    assert case.materials["dyke"].looks == 2.5
    assert case.materials["grass"].calibrate  # of the case itself, as a whole
    assert case.materials["grass"].parameters is None
    assert case.stop == Case().stop
    assert load([path], {"materials_from": str(other)}).materials == case.materials


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("nowhere.yaml", "materials_from: the file .*nowhere.yaml does not exist"),
        (3, "materials_from is 3, expected the path of a YAML file with a section materials"),
        ("case.yaml", "case.yaml has no section materials, expected one, as calibrated.yaml has it"),
        ("bad.yaml", r"bad.yaml, line 1: not a YAML file"),
    ],
)
def test_a_file_without_materials(tmp_path, monkeypatch, value, words):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, "a: [", "bad.yaml")
    with pytest.raises(ConfigError, match=words):
        load([write(tmp_path, yaml.safe_dump({"materials_from": value}))])


def test_a_forward_run_needs_neither_measurement_nor_calibration(tmp_path):
    keys = {"materials": CALIBRATED, "radar": [{"looks": 3}, {"look_side": "left"}], "seed": 5, "stop": {"max_runs": 0}}
    case = load_forward([write(tmp_path, yaml.safe_dump(keys))])
    assert [one.radar.look_side for one in case.passes] == ["right", "left"]
    assert (case.radar.looks, case.seed, case.calibrated) == (3, 5, [])
    found = load_forward([write(tmp_path, "seed: 2")], {"seed": 3}, write(tmp_path, yaml.safe_dump(keys), "b.yaml"))
    assert (found.seed, found.materials["dyke"].looks) == (3, 2.5)
    own = {"dyke": {"parameters": X}, "lake": {"parameters": X}}
    both = load_forward([write(tmp_path, yaml.safe_dump({"materials": own}))], None, tmp_path / "b.yaml")
    assert list(both.materials) == ["dyke", "lake", "grass"]
    assert both.materials["dyke"].parameters == [-20.0, 5.0, 9.0, 2.0]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"radar": {"look": 3}}, "unknown key radar.look"),
        ({"sede": 3}, "unknown key sede"),
        ({"materials": {"soil": {"law": "external"}}}, "case.yaml, line 3: materials.soil.law is external, which only"),
        ({"materials": {"soil": {"law": "oh1992", "parameters": [8, 1, 1]}}}, "radar.frequency_ghz is missing"),
    ],
)
def test_a_wrong_forward_run(tmp_path, keys, words):
    with pytest.raises(ConfigError, match=words):
        load_forward([write(tmp_path, yaml.safe_dump(keys))])
