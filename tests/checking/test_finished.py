"""Finished results that radcal run would not replace, as radcal check tells of them."""

from pathlib import Path

import yaml
from workflow_project import make_case, tiny_case

from radcal.checking.case_check import check_case
from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.radar.geometry import write_geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import write_scene
from radcal.scene.sources import make_scene
from radcal.storage.provenance import provenance


def test_results_that_a_run_would_not_replace_are_noted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_case(tmp_path)
    case, out = case_from(tiny_case()), tmp_path / "elsewhere/tiny"
    out.mkdir(parents=True)
    scene = make_scene(case.scene, list(case.materials))
    with provenance("tiny", STAGES["scene"].params(case)):
        write_scene(out / "scene.h5", scene)
    with provenance("tiny", STAGES["geometry"].params(case)):
        write_geometry(out / "passes/1/geometry.h5", make_geometry(scene, case.radar), case.radar)
    Path("mine.yaml").write_text(yaml.safe_dump(tiny_case()))

    def noted(results="elsewhere", **changes):
        found = check_case(["mine.yaml"], changes, results)
        assert all(any(reason in line for line in found.remarks()) for reason in found.refused)
        return found.refused

    looks = {"looks": 3, "nesz_db": -20.0}
    assert noted(radar=looks) == []  # not finished
    (out / "calibration.h5").touch()
    assert noted() == []
    (note,) = noted(radar=looks)
    assert note.startswith("elsewhere/tiny holds a finished calibration of another ")
    assert "geometry (radar.looks is 4 there, 3 here), which stays as it is: give this one a name of its own" in note
    assert noted(radar=looks, replace=True) == noted("results", radar=looks) == []
    assert noted(radar=looks, stop={"rms": "small"}) == [], "a case with problems is refused for these"
