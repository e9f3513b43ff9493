"""Files and overrides that a case is read from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from config_samples import FIXED, synthetic, write

from radcal.config import Case, SyntheticMeasurement, load
from radcal.errors import ConfigError


def test_file_needs_only_the_keys_that_differ(tmp_path: Path) -> None:
    case = load([write(tmp_path, "case: mine\nstop: {rms: 1.0e-4}\n")])
    assert case.case == "mine"
    assert case.stop.rms == 1e-4
    assert case.stop.max_runs == Case().stop.max_runs
    assert case.radar == Case().radar
    assert load([write(tmp_path, "{}\n")]) == Case()


def test_later_files_win_key_by_key(tmp_path: Path) -> None:
    first = write(tmp_path, "seed: 3\nstop: {rms: 0.1, max_runs: 50}\n")
    second = write(tmp_path, "stop: {rms: 0.2}\n", "more.yaml")
    case = load([first, second])
    assert (case.seed, case.stop.rms, case.stop.max_runs) == (3, 0.2, 50)


@pytest.mark.parametrize("value", ['{"rms": 1e-4}', "{rms: 1e-4}", {"rms": "1e-4"}, {"rms": 1e-4}])
def test_override_merges_into_the_files_section(tmp_path: Path, value: object) -> None:
    path = write(tmp_path, "seed: 3\nstop: {rms: 0.1, max_runs: 50}\n")
    case = load([path], {"stop": value, "seed": "7"})
    assert case.stop.rms == 1e-4
    assert case.stop.max_runs == 50
    assert case.seed == 7


def test_override_reaches_into_materials_and_lists(tmp_path: Path) -> None:
    path = write(tmp_path, yaml.safe_dump({"materials": FIXED}))
    case = load([path], {"materials": '{"dyke": {"bounds": [[0, 1], [0, 1], [0, 1], [0, 1]]}}'})
    assert case.materials["dyke"].box == [(0.0, 1.0)] * 4
    assert case.materials["dyke"].calibrate
    assert list(case.materials) == ["dyke", "grass"]


def test_override_of_a_measurement_keeps_its_other_keys(tmp_path: Path) -> None:
    path = write(tmp_path, yaml.safe_dump(synthetic(seed=5, offset_db=1.0)))
    measurement = load([path], {"measurement": '{"synthetic": {"warp_px": 2.0}}'}).measurement
    assert isinstance(measurement, SyntheticMeasurement)
    assert (measurement.synthetic.seed, measurement.synthetic.offset_db, measurement.synthetic.warp_px) == (5, 1.0, 2.0)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"stop": '{"rms": '}, ["--config stop", "not valid"]),
        ({"stop": '{"rsm": 1}'}, ["stop.rsm", "'rms'"]),
        ({"stop": "1e-4"}, ["stop is '1e-4'"]),
        ({"sede": 3}, ["sede", "'seed'"]),
    ],
)
def test_bad_overrides(tmp_path: Path, overrides: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        load([write(tmp_path, "seed: 3\n")], overrides)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("seed: 3\nradar: [1, 2\n", r"case\.yaml, line 3: not a YAML file"),
        ("seed: 1\n\tcase: x\n", r"case\.yaml, line 2: not a YAML file"),
        ("a: b: c\n", r"case\.yaml, line 1: not a YAML file"),
        ("!!python/object/apply:os.getcwd []\n", "not a YAML file"),
        (b"seed: 1\ncase: \xff\xfe\n", r"case\.yaml, line 2: not a text file in UTF-8"),
        ("# nothing\n", r"case\.yaml: is empty, expected keys and values"),
        ("- seed\n- 3\n", r"case\.yaml: holds list, expected keys and values"),
        ("just text\n", r"case\.yaml: holds str, expected keys and values"),
        ("seed: minus one\n", r"case\.yaml: seed is 'minus one'"),
    ],
)
def test_bad_files(tmp_path: Path, content: str | bytes, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load([write(tmp_path, content)])


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: cannot be read \(No such file"):
        load([tmp_path / "nowhere.yaml"])
    with pytest.raises(ConfigError, match="cannot be read"):
        load([tmp_path])
