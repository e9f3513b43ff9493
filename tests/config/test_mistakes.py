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
