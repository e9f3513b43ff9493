"""Tracks through the detections of several scans."""

import json
from dataclasses import replace

import numpy as np
import pytest
import signals
from gmti_samples import GMTI, SPEED, movers

from radcal.findings import Finding
from radcal.gmti.product import write
from radcal.gmti.tracks import tracked
from radcal.simulators.forward import Forward
from radcal.words import sentence


def test_a_mover_among_false_alarms_is_one_track():
    """It turns by 30 degrees half way, is missed twice, and the velocity to the east is measured, too."""
    rng, scans, place = np.random.default_rng(3), [], np.array([100.0, 900.0])
    true = []
    for k in range(16):
        velocity = 11.0 * np.array(
            [np.sin(np.radians(70.0 + 30.0 * (k >= 8))), np.cos(np.radians(70.0 + 30.0 * (k >= 8)))]
        )
        place = place + 3.0 * velocity
        true.append([*place, *velocity])
        row = [place[0] + rng.normal(0.0, 2.0), velocity[0] + rng.normal(0.0, 0.5), place[1] + rng.normal(0.0, 6.0)]
        rows = rng.uniform([0.0, -15.0, 0.0], [900.0, 15.0, 1500.0], (4, 3)).tolist() + [row] * (k not in (5, 11))
        scans.append((3.0 * k, np.array(rows)))
    (found,) = tracked(scans, [2.0, 0.5, 6.0])
    assert found.seconds.tolist() == [3.0 * k for k in range(16)]
    assert np.flatnonzero(~found.detected).tolist() == [5, 11]
    true = np.array(true)
    assert np.abs(found.place_m - true[:, :2])[[3, 7, 15]].max() < 12.0
    np.testing.assert_allclose(found.velocity_mps[[7, 15]], true[[7, 15], 2:], atol=2.0)


def test_scans_without_detections_have_no_track():
    assert tracked([(0.0, np.zeros((0, 2))), (2.0, np.zeros((0, 2)))], [15.0, 15.0]) == []


@pytest.mark.slow
def test_drawn_detections():
    found = signals.tracks(3)
    assert found["completeness"] >= 0.95
    assert found["spurious"] <= 1.0
    assert found["rms_m"] < 0.75 * found["rms_detections_m"]


@pytest.fixture
def made(build_case, scene):
    """Two movers, 5 scans."""
    moving = replace(scene, objects=movers([120.0, 200.0], [110.0, 190.0], [270.0, 60.0], [SPEED, 7.0]))
    return Forward(build_case(gmti=GMTI | {"scans": 5, "revisit_s": 1.5}), moving, None, None, "key", 1, False, None)


def test_movers_of_several_scans_have_tracks(made, tmp_path):
    paths = write(tmp_path / "gmti", made)
    reports = json.loads(paths[0].read_text())["features"]
    assert {one["properties"]["scan"] for one in reports} == {1, 2, 3, 4, 5}
    numbers = paths[-1].numbers
    assert (numbers["movers"], numbers["movers_in_tracks"], numbers["scans"]) == (2.0, 2.0, 5.0)
    tracks = [one["properties"] for one in json.loads((tmp_path / "gmti_tracks.geojson").read_text())["features"]]
    west = min(tracks, key=lambda one: abs(one["place_m"][0][0] - 120.0))
    away = np.array(west["place_m"][-1]) - west["place_m"][0]
    np.testing.assert_allclose(away, [-SPEED * (west["seconds"][-1] - west["seconds"][0]), 0.0], atol=8.0)
    assert west["velocity_mps"][-1][0] == pytest.approx(-SPEED, abs=1.5)


def test_without_packages_findings_say_what_to_type(made, tmp_path, monkeypatch):
    monkeypatch.setattr("radcal.gmti.product.find_spec", lambda name: None)
    found = [one for one in write(tmp_path / "gmti", made) if isinstance(one, Finding)]
    assert [one.about for one in found] == ["gmti", "STANAG 4607", "tracks"]
    assert [sentence(one).split("'")[1] for one in found[1:]] == ["radcal[stanag]", "radcal[tracking]"]
    assert {one.suffix for one in tmp_path.iterdir()} == {".geojson", ".png"}
