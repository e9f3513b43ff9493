"""Finished results stay, and a command that would replace them is refused before any job."""

import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from workflow_project import COLUMNS, ROWS, make_case, tiny_case, write_raster

from radcal.checking.case_check import check_case
from radcal.config import case_from, input_files
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.radar.geometry import write_geometry
from radcal.radar.projection import make_geometry
from radcal.scene.sources import make_scene
from radcal.session.replacement import check_replacement
from radcal.storage.records import provenance

OUT = Path("results/tiny")


@pytest.fixture(autouse=True)
def _made(tmp_path, monkeypatch):
    """Scene and geometry of the tiny case beside an archive, without the rest of a finished case."""
    monkeypatch.chdir(tmp_path)
    make_case(tmp_path)
    case = case_from(tiny_case())
    OUT.mkdir(parents=True)
    scene = make_scene(case.scene, list(case.materials))
    with provenance("tiny", STAGES["scene"].params(case)):
        scene.write(OUT / "scene.h5")
    with provenance("tiny", STAGES["geometry"].params(case)):
        write_geometry(OUT / "passes/1/geometry.h5", make_geometry(scene, case.radar), case.radar)
    (OUT / "calibration.h5").touch()


def check(case):
    check_replacement(case, OUT, input_files(case))


STEEPER = {"scene": {**tiny_case()["scene"], "near_incidence_deg": 16.0}}
CHANGED = [
    ({"radar": {"looks": 3}}, r"another geometry \(radar\.looks is 4 there, 3 here\), which stays as it is"),
    (STEEPER, r"another scene \(scene\.near_incidence_deg is 15"),
]


@pytest.mark.parametrize(("changes", "said"), CHANGED)
def test_another_scene_or_pass_is_refused_until_allowed(changes, said):
    with pytest.raises(ConfigError, match=f"results/tiny holds a finished calibration of {said}"):
        check(case_from(tiny_case(**changes)))
    check(case_from(tiny_case(**changes, replace=True)))
    (OUT / "calibration.h5").unlink()
    check(case_from(tiny_case(**changes)))


def test_what_makes_the_same_scene_and_pass_is_not_refused(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("radcal.scene.sources.make_scene", None)  # nothing is built for what has not changed
        check(case_from(tiny_case()))
        check(case_from(tiny_case(materials={"lake": {"law": "mangia", "parameters": [6, 5, 5, 5]}})))
    os.link("labels.tif", "other.tif")
    check(case_from(tiny_case(scene={**tiny_case()["scene"], "labels": "other.tif"})))
    # what an external program is not told changes neither geometry nor run
    case = case_from(tiny_case(radar={"nesz_db": -21.0}))
    with pytest.raises(ConfigError, match=r"radar\.nesz_db"):
        check(case)
    monkeypatch.setattr(type(case.simulator), "not_told", frozenset({"nesz_db"}), raising=False)
    check(case)


def test_a_newer_file_is_compared_by_what_it_holds():
    case = case_from(tiny_case())
    later = (OUT / "scene.h5").stat().st_mtime + 10
    os.utime("labels.tif", (later, later))
    check(case)
    write_raster(Path("labels.tif"), np.repeat([[1, 2]], COLUMNS // 2, axis=1).repeat(ROWS, axis=0).astype(np.uint8))
    os.utime("labels.tif", (later, later))
    with pytest.raises(ConfigError, match="another scene \\(the files that it is made from are others\\)"):
        check(case)


def test_a_damaged_file_is_nothing_to_keep():
    (OUT / "passes/1/geometry.h5").write_bytes((OUT / "passes/1/geometry.h5").read_bytes()[:-1])
    check(case_from(tiny_case(radar={"looks": 3})))
    assert (OUT / "passes/1/geometry.h5").is_file(), "a check sets nothing aside"


def test_radcal_check_notes_that_results_would_not_be_replaced():
    Path("mine.yaml").write_text(yaml.safe_dump(tiny_case()))
    (note,) = check_case(["mine.yaml"], {"radar": {"looks": 3}}).refused
    assert note.startswith("results/tiny holds a finished calibration of another geometry (radar.looks is 4 there, 3 ")
    assert check_case(["mine.yaml"], {"radar": {"looks": 3}}, "elsewhere").refused == []
