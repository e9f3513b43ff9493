"""The results hold what they were gathered from."""

from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import h5py
import numpy as np
import pandas as pd
import pytest
from archives import changed_material, image

from radcal import skewnormal
from radcal.config import case_from
from radcal.errors import StoreError
from radcal.findings import Finding
from radcal.ground.levels import Levels
from radcal.laws import LAWS
from radcal.objectives.base import Reason
from radcal.objectives.history import History, PassScore
from radcal.products.tables import write_runs
from radcal.results.law_notes import law_notes
from radcal.results.summary import summarise
from radcal.speckle.texture import log_speckle_cumulants
from radcal.targets.target import Targets
from radcal.words import ENDINGS, sentence


def test_final_runs_that_the_search_has_made_are_no_new_ones_and_equal_pixels_are_told(made, tmp_path):
    """The first final run is the best run of the search, the second one has fresh random numbers."""
    assert summarise(made.archive)["runs"]["final"] == 1
    assert "seed_without_effect" not in [one.code for one in made.archive.notes]
    first = made.final[0]
    again = made.gathered(tmp_path / "again.h5", final=(first, replace(first, key="fresh")))
    assert summarise(again)["runs"]["final"] == 1
    assert "seed_without_effect" in [one.code for one in again.notes]
    assert summarise(again)["materials"]["dyke"]["rms_fresh"] is None


def test_the_final_runs_have_the_texture_of_the_best_run(made, tmp_path):
    """The picture is the run with fresh random numbers; each run's density is that of the target's pixels."""
    *runs, last = made.history.runs
    textured = replace(last, scores={**last.scores, "dyke": replace(last.scores["dyke"], looks=1.7)})
    archive = made.gathered(tmp_path / "again.h5", history=History([*runs, textured]))
    added = archive.images.calibrated_db - made.final[1].image_db
    inside = np.zeros(added.size, dtype=bool)
    inside[made.geometry.pixels("dyke")] = True
    assert not added.ravel()[~inside].any()
    looks = made.case.radar.looks
    wanted = log_speckle_cumulants(1.7)[1] - log_speckle_cumulants(looks)[1]
    assert added.ravel()[inside].var() == pytest.approx(wanted, rel=0.25)
    dyke, beans = archive.materials["dyke"], archive.materials["stem beans"]
    target = made.targets["dyke"]
    pixels = archive.images.calibrated_db.ravel()[made.geometry.pixels("dyke")][target.order]
    assert dyke.rms_fresh == skewnormal.density_rms(skewnormal.fit(pixels).dp, target.dp)
    assert dyke.rms_final not in (dyke.rms_fresh, made.archive.materials["dyke"].rms_final)
    target = made.targets["stem beans"]
    each = [skewnormal.fit(run.pixels_db["stem beans"][target.order]).dp for run in made.final]
    expected = [skewnormal.density_rms(dp, target.dp) for dp in each]
    assert [beans.rms_final, beans.rms_fresh] == expected


def test_an_external_law_has_names_and_no_curve(build_archive, tmp_path):
    made = build_archive(tmp_path, external=True)
    with h5py.File(made.path) as file:
        assert file["laws/unused"].shape == (0,)
        assert file["law_notes"][()].tolist() == []
    archive = made.archive
    write_runs(tmp_path / "runs.csv", archive)
    headings = pd.read_csv(tmp_path / "runs.csv").columns.tolist()
    assert headings[6:10] == ["X1", "X2", "X3", "X4"]  # of two materials whose names differ
    dyke = summarise(archive)["materials"]["dyke"]
    assert dyke["hidden"] == dict(zip(["mv", "s", "l", "t"], [6.1, 14.2, 21.5, 3.3], strict=True))
    assert "law_difference_db" not in dyke


def test_missing_reference_run_is_a_sentence(made, tmp_path):
    with pytest.raises(StoreError, match="missing, damaged or"):
        made.gathered(tmp_path / "calibration.h5", runs=tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == []


def test_a_proposal_that_was_simulated_before_is_no_further_run(made, tmp_path):
    *runs, last = made.history.runs
    again = made.gathered(tmp_path / "again.h5", history=History([*runs, replace(last, keys=runs[-1].keys)]))
    before, after = summarise(made.archive), summarise(again)
    assert (before["runs"]["infill"], after["runs"]["infill"]) == (2, 1)
    assert before["iterations"] == after["iterations"] == 2
    # of the design, too, whose later runs and the infill are counted all the same
    twice = list(made.history.runs)
    twice[2] = replace(twice[2], keys=twice[1].keys)
    counted = summarise(made.gathered(tmp_path / "twice.h5", history=History(twice)))["runs"]
    assert (counted["design"], counted["infill"]) == (3, 2)


def test_laws_beyond_their_angles_are_noted(made):
    """Rows of the dyke are seen from 20 to 30.5 degrees."""

    def notes(low, high, doubt=None):
        law = replace(LAWS["mangia"], valid_deg=(low, high), doubt=doubt)
        case = SimpleNamespace(laws={"dyke": law}, materials={"dyke": SimpleNamespace(law="made up")})
        return law_notes(case, made.geometry, {"dyke": [1.0, 2.0, 3.0, 4.0]})

    (found,) = notes(22.0, 90.0)
    assert (found.code, found.about) == ("outside_angles", "dyke")
    numbers = {"share_percent": 19.0, "from_angle_deg": 22.0, "to_angle_deg": 90.0, "law": "made up"}
    assert found.numbers == pytest.approx(numbers, abs=0.5)
    assert summarise(replace(made.archive, law_notes=(found,)))["law_notes"] == [sentence(found)]
    assert notes(20.3, 90.0) == notes(20.0, 30.2) == []
    (doubted,) = notes(20.0, 90.0, lambda x: f"X4 is {x[3]:g}")
    assert doubted == Finding("outside_data", "note", "dyke", {"law": "made up", "doubt": "X4 is 4"})


def several(made):
    """Changes for two passes: other densities, keys, final runs, target and image in the second pass."""
    more = {"dyke": PassScore([1.0, 2.0, 0.5], 0.0375), "stem beans": None}
    runs = []
    for run in made.history.runs:
        scores = {name: replace(one, densities=[*one.densities, more[name]]) for name, one in run.scores.items()}
        runs.append(replace(run, keys=[*run.keys, f"second {run.keys[0]}"], scores=scores))
    keys = (runs[3].keys[0], "new", runs[3].keys[1], "newer")
    final = [replace(record, key=key) for record, key in zip(made.final * 2, keys, strict=True)]
    radar = [{"depression_deg": 45, "looks": 3}, {"depression_deg": 30, "look_side": "left"}]
    case = case_from({**made.case.sections("materials", "objective"), "radar": radar, "measurement": [{}, {}]})
    angles = np.linspace(30.0, 50.0, 201, dtype=np.float32)
    second = Targets({"dyke": replace(made.targets["dyke"], incidence_deg=angles)}, Levels("offset", 1.5, 0.2))
    finding = Finding("looks_unknown", "warning", "b.tif")
    measurement = replace(made.registered.measurement, source="b.tif", findings=(finding,))
    passes = [made.registered, replace(made.registered, measurement=measurement, verdict="not moved.")]
    of_image = image(radiometry=dict.fromkeys("12", image().radiometry["1"]))
    found = {"case": case, "history": History(runs), "every": [made.targets, second], "final": final}
    return {**found, "passes": passes, "image": of_image}


def test_each_pass_has_its_own_runs_and_counts_its_own_new_ones(made, tmp_path):
    """Two final runs in each pass; one of the first pass and one of the second are runs of the search."""
    archive = made.gathered(tmp_path / "two.h5", **several(made))
    assert [one.keys[3] for one in archive.passes.values()] == ["design0002", "second design0002"]
    assert [one.registered.measurement.image_db.size for one in archive.passes.values()] == [1200, 0]
    assert [dict(one.rms) for one in archive.passes.values()] == [
        {name: material.rms[material.best] for name, material in archive.materials.items()},
        {"dyke": 0.0375},
    ]
    summary = summarise(archive)
    first, second = summary["passes"]
    assert (first["runs"], second["runs"], summary["runs"]["final"], summary["runs"]["total"]) == (8, 8, 2, 16)
    assert ([one["depression_deg"] for one in (first, second)], second["look_side"]) == ([45, 30], "left")
    assert (first["looks"], second["looks"], second["measurement"]) == (3.0, 4.0, "b.tif")
    assert (second["registration"], second["levels"]) == ("not moved.", sentence(archive.passes["2"].levels.finding))
    assert [len(one["notes"]) for one in (first, second)] == [0, 2]  # with too few pixels of stem beans
    assert list(second["materials"]) == ["dyke"]
    assert sentence(Finding("looks_unknown", "warning", "b.tif")) in summary["warnings"]


def test_the_law_of_a_pass_is_judged_over_its_own_incidence(made, tmp_path):
    """Band whose half-width grows by 0.1 dB per degree, seen from 30 to 50 degrees; the second pass has its own rms."""
    archive = made.gathered(tmp_path / "two.h5", **several(made))
    angle, known = np.arange(86.0), archive.materials["dyke"].posterior
    curve = replace(
        known.curve, incidence_deg=angle, p05_db=-10.0 - 0.1 * angle, p95_db=-10.0 + 0.1 * angle,
    )  # fmt: skip
    archive = changed_material(archive, "dyke", posterior=replace(known, curve=curve))
    assert [one.numbers for one in archive.notes if one.code == "passes_together"] == [{"passes": 2}]
    assert "passes_together" not in [one.code for one in made.archive.notes]
    first, second = (one["materials"]["dyke"] for one in summarise(archive)["passes"])
    assert (first["rms"], second["rms"]) == (archive.passes["1"].rms["dyke"], 0.0375)
    assert (second["low_deg"], second["high_deg"]) == pytest.approx((31.0, 49.0))
    assert second["half_width_db"] == pytest.approx(4.9)
    assert second["pixels"] == made.targets["dyke"].pixels.size
    unknown = changed_material(archive, "dyke", posterior=replace(known, curve=None))
    assert summarise(unknown)["passes"][1]["materials"]["dyke"]["half_width_db"] is None


@pytest.mark.parametrize("heading_deg", [None, 200.0])
def test_the_scene_keeps_its_place_unless_its_grid_is_turned(made, tmp_path, heading_deg):
    transform = (5.0, 0.0, 612_345.0, 0.0, 5.0, 5_801_000.0)
    scene = replace(made.scene, crs="EPSG:32631", transform=transform, heading_deg=heading_deg)
    found = made.gathered(tmp_path / "calibration.h5", scene=scene).scene
    expected = (None, 0.0, 0.0) if heading_deg else ("EPSG:32631", 612_345.0, 5_801_000.0)
    assert (found.crs, found.west_m, found.south_m) == expected


def test_table_round_trips(made, tmp_path):
    write_runs(tmp_path / "runs.csv", made.archive)
    table = pd.read_csv(tmp_path / "runs.csv", dtype=str).astype({"run": int})
    assert len(table) == len(made.history.runs) * len(made.targets)
    assert table["kind"].value_counts().to_dict() == {"reference": 2, "design": 8, "infill": 4}
    for name in made.targets:
        rows = table[table["material"] == name]
        assert rows["run"].tolist() == list(range(7))
        scores = [run.scores[name] for run in made.history.runs]
        assert rows["rms"].astype(float).tolist() == [one.rms for one in scores]
        for keys, wanted in (("xi omega alpha", "dp"), ("X1 X2 X3 X4", "parameters")):
            found = rows[keys.split()].astype(float).to_numpy().tolist()
            assert found == [getattr(one, wanted) for one in scores]


def test_every_reason_of_an_end_has_words():
    assert set(ENDINGS) == {*get_args(Reason), "running"}
    assert len(set(ENDINGS.values())) == len(ENDINGS)
