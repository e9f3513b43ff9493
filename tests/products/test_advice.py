"""Table of further passes: which are compared, in which order, and what is said."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from radcal.config import case_from
from radcal.errors import ConfigError, StoreError
from radcal.findings import Finding
from radcal.laws import law_for
from radcal.posterior.result import WHOLE_DEG, KeptDraws
from radcal.products import advice
from radcal.products.advice import (
    Advised,
    _opposite,
    _rows,
    _table,
    advice_on,
    advise,
    best_passes,
    candidates,
    common_ratio,
    judged,
)
from radcal.scene.model import Scene
from radcal.words import sentence

FLAT = law_for("tabulated", angles_deg=(20.0, 60.0))


def case(**radar):
    return case_from(sections(**radar))


def sections(**radar):
    return {
        "radar": {"depression_deg": 45, "nesz_db": -60, **radar},
        "materials": {"slope": {"calibrate": True}, "rest": {"parameters": [1, 2, 3, 4]}},
        "measurement": {"synthetic": {"parameters": {"slope": [1, 2, 3, 4]}}},
        "target": {"margin_px": 0},
        "uncertainty": {"level_db": 0.2, "noise_db": 0.0},
    }


def scene():
    """A plain with a material on rough ground that faces west, towards a radar that looks right (east)."""
    north, east = np.meshgrid(np.arange(60), np.arange(60), indexing="ij")
    material = np.where((east > 15) & (east < 45), 1, 2).astype(np.uint8)
    relief = 0.25 * 5.0 * np.clip(east, 15, 45) + 2.0 * np.sin(east / 3.0) * np.sin(north / 4.0)
    return Scene("made up", ("slope", "rest"), material, relief, 5.0)


def found(**more):
    """Posterior and law of lines known at 35 degrees, the less the further away."""
    slope = np.random.default_rng(2).normal(0.0, 0.08, (400, 1))
    lines = -10.0 + slope * (WHOLE_DEG - 35.0) + np.random.default_rng(3).normal(0.0, 0.2, (400, 1))
    nothing = np.zeros(400)
    draws = KeptDraws(**{
        "parameters": np.zeros((400, 2)), "field_db": nothing, "cell_db": nothing, "form_db": lines,
        "fields_db": nothing, **more,
    })  # fmt: skip
    return {"slope": (SimpleNamespace(draws=draws, looks=4.0), FLAT)}


def test_passes_to_compare():
    found = [(one.depression_deg, one.look_side) for one in candidates(case())]
    assert found == [(45, "left"), (30, "right"), (30, "left"), (60, "right"), (60, "left")]
    steep = candidates(case(depression_deg=65, look_side="left"))
    assert [(one.depression_deg, one.look_side) for one in steep] == [(65, "right"), (50, "right"), (50, "left")]
    assert [(one.depression_deg, one.look_side) for one in candidates(case(), [45.0])] == [(45, "left")]
    assert candidates(case())[0].nesz_db == -60
    # 10 and 75 degrees are the last that are offered by themselves
    assert {one.depression_deg for one in candidates(case(depression_deg=60))} == {60, 45, 75}
    assert {one.depression_deg for one in candidates(case(depression_deg=25))} == {25, 10, 40}
    assert {one.depression_deg for one in candidates(case(depression_deg=24))} == {24, 39}
    with pytest.raises(ConfigError, match="--depression is 85, expected an angle above 5 and below 85"):
        candidates(case(), [30.0, 85.0])


def test_passes_of_an_orbit_are_offered_by_incidence():
    one = case(altitude_m=693_000)
    orbit = one.radar.model_copy(update={"incidence_deg": 37.0, "earth": "curved", "heading_deg": 189.0})
    one = one.model_copy(update={"radars": [orbit]})
    found = candidates(one)
    assert [(each.incidence_deg, each.look_side) for each in found] == [
        (37, "left"), (22, "right"), (22, "left"), (52, "right"), (52, "left"),
    ]  # fmt: skip
    assert {each.heading_deg for each in found} == {189.0}
    assert [each.incidence_deg for each in candidates(one, [60.0])] == [30.0, 30.0]
    with pytest.raises(ConfigError, match="--depression is 3, expected an angle above 5 and below 85"):
        candidates(one, [3.0])
    assert Advised(found[1], "slope", None, 1.0, 1.0, (20.0, 60.0), 0.0, 0.0).name == "incidence 22 deg right"
    assert _opposite(orbit).numbers == pytest.approx({"heading_deg": 189.0, "opposite_deg": 351.0})


def test_only_passes_that_the_sensor_can_fly_are_offered():
    given = {"sensor": "sentinel1_iw_grdh", "incidence_deg": 38.0, "polarisation": "VV", "nesz_db": -23}
    at = {**sections(), "radar": given}
    found = candidates(case_from(at))
    assert [(each.incidence_deg, each.look_side) for each in found] == [(29.1, "right"), (46.0, "right")]
    assert [each.incidence_deg for each in candidates(case_from(at), [55.0])] == [35.0]
    with pytest.raises(ConfigError, match="incidence_deg 23, which sentinel1_iw_grdh does not fly .* 29.1 to 46.0"):
        candidates(case_from(at), [67.0])
    # nearer to the end of the swath than a step, and in an experimental pass to the left
    at["radar"] = {**given, "incidence_deg": 46.0, "look_side": "left"}
    assert [(each.incidence_deg, each.look_side) for each in candidates(case_from(at))] == [(31.0, "left")]
    # by depression: over a sphere of 6371 km, 29.1 degrees are seen from 693 km at arccos(sin 29.1 / 1.1088)
    del given["incidence_deg"]
    curved = case_from({**at, "radar": {**given, "depression_deg": 60.0, "earth": "curved"}})
    assert [each.depression_deg for each in candidates(curved)] == pytest.approx([49.55, 63.99], abs=0.01)
    # a radar that looks to both sides, whose incidences were found in no source
    alos = {"sensor": "alos2_fine_l15", "incidence_deg": 38.0, "look_side": "right", "polarisation": "HH",
            "nesz_db": -26, "range_resolution_m": 6, "azimuth_resolution_m": 8}  # fmt: skip
    both = candidates(case_from({**at, "radar": alos}))
    assert [each.incidence_deg for each in both] == [38.0, 23.0, 23.0, 53.0, 53.0]


@pytest.mark.slow
def test_passes_far_from_the_known_angle_narrow_a_slope_most():
    one, known = case(), found()
    passes = candidates(one, [30.0, 45.0])
    rows = [row for (row,) in advice_on(one, scene(), known, passes)]
    assert [row.after_db for row in rows] == sorted(row.after_db for row in rows)
    assert len(rows) == 3
    # the slope faces a radar that looks right: looked at from the other side it is seen at larger angles
    best, worst = rows[0], rows[-1]
    assert (best.radar.depression_deg, best.radar.look_side) == (30.0, "left")
    assert best.incidence_deg is not None
    assert best.incidence_deg[0] > 60.0
    assert worst.after_db < rows[0].now_db
    lowest, highest = (extreme(row.incidence_deg[k] for row in rows) for k, extreme in ((0, min), (1, max)))
    assert best.over_deg[0] <= lowest
    assert best.over_deg[1] == highest
    # at the known angle alone, the pass that sees it says most
    ((near,), *_) = advice_on(one, scene(), known, passes, (34.0, 36.0))
    assert near.now_db < 0.5 * best.now_db
    assert near.over_deg == (34.0, 36.0)


def test_each_pass_has_its_own_noise_and_fields_count_by_their_interval():
    one = case()
    loud = candidates(one, [45.0])[0]
    passes = [loud, loud.model_copy(update={"nesz_db": 5.0})]

    def after(field_db):
        rows = advice_on(one, scene(), found(field_db=field_db), passes, (30.0, 60.0))
        return {row.radar.nesz_db: row.after_db / row.now_db for (row,) in rows}

    clear = after(np.zeros(400))
    # 15 dB below the noise a change of the ground is hardly seen
    assert clear[-60] < 0.7 * clear[5.0]
    # standard deviations of 0 and of 2 dB are worth as much as a normal distribution with the same 90 % interval
    assert after(np.repeat([0.0, 2.0], 200))[-60] > 1.05 * clear[-60]
    assert after(np.repeat([0.0, 2.0], [398, 2]))[-60] == pytest.approx(clear[-60], rel=0.02)


@pytest.mark.slow
def test_what_a_pass_shares_with_the_passes_of_the_case_is_not_measured_again():
    """A level that is uncertain because of the one field's effect, which is the same in a further pass."""
    levels = np.random.default_rng(5).normal(-10.0, 1.0, (400, 1)) + np.zeros((1, 91))
    known = found(form_db=levels, field_db=np.ones(400))
    rows = advice_on(case(), scene(), known, candidates(case(), [30.0, 45.0]), (30.0, 60.0))
    # two independent effects would leave 0.7 of the half-width
    assert len(rows) == 3
    assert all(0.93 < row.after_db / row.now_db <= 1.0 for (row,) in rows)
    # nor is the error of a level that the same fixed laws give in all passes
    for removed, least, most in ((1.0, 0.93, 1.0), (None, 0.0, 0.5)):
        rows = advice_on(case(), scene(), found(form_db=levels), candidates(case(), [30.0]), (30.0, 60.0), removed)
        assert all(least < row.after_db / row.now_db <= most for (row,) in rows)


def row(side, after, now=2.0):
    radar = case().radar.model_copy(update={"look_side": side})
    return Advised(radar, "slope", (20.04, 41.0), now, after, (20.0, 60.0), 0.0123, 0.002)


def codes(rows):
    return [(one.about, one.code) for one in best_passes(rows)]


def test_lines():
    lines = list(_table([[row("left", 1.25)], [replace(row("right", 1.5), incidence_deg=None)]]))
    assert lines[1].split("  ")[0] == "45 deg left"
    assert "20.0-41.0 deg" in lines[1]
    assert lines[1].endswith("+-2.00 dB       +-1.25 dB  1.2 %    0.2 %")
    assert "too few pixels" in lines[2]
    (found,) = best_passes([[row("left", 1.25)], [row("right", 1.5)]])
    assert sentence(found) == (
        "slope: a pass of 45 deg left is expected to narrow the band most, from +-2.00 dB to +-1.25 dB (mean "
        "half-width between 20.0 and 60.0 degrees)."
    )
    third = replace(row("right", 1.5), radar=case().radar.model_copy(update={"depression_deg": 30.0}))
    equal = best_passes([[row("left", 1.25)], [row("right", 1.31)], [third]])[1]
    assert equal == Finding("passes_equal", "note", "slope", {"names": "45 deg right"})
    assert codes([[row("left", 1.85)]]) == [("slope", "band_none")]


def test_a_pass_is_judged_by_how_far_it_narrows_a_band():
    assert judged([0.8, 0.5, 0.52]) == (1, [2])
    assert judged([0.53, 0.5]) == (1, [])
    assert judged([0.5]) == (0, [])
    assert judged([0.525, 0.5]) == (1, [0])
    assert judged([0.91, 0.95]) == (None, [1])
    assert judged([0.9, 1.0]) == (0, [])


def test_the_pass_that_is_best_for_all_materials_is_named():
    """Factors of 0.75 and 0.25 are worth more than of 0.5 and 1, although the bands are wider in the mean."""
    left, right = row("left", 2.0, 4.0), row("right", 3.0, 4.0)
    narrow = [replace(one, material="flat", now_db=0.4, after_db=x) for one, x in ((left, 0.4), (right, 0.1))]
    passes = [[right, narrow[1]], [left, narrow[0]]]
    assert [common_ratio(each) for each in passes] == pytest.approx([np.sqrt(0.75 * 0.25), np.sqrt(0.5)])
    lines = list(_table(passes))
    assert [line.split("  ")[0] for line in lines[1:]] == ["45 deg right"] * 3 + ["45 deg left"] * 3
    assert lines[3].split("  ")[1] == "all materials"
    assert lines[3].endswith("times 0.43")
    assert list(_rows(passes))[2][2] == "all materials"
    assert list(_rows(passes))[2][7] == pytest.approx(np.sqrt(0.1875))
    first, second, last = best_passes(passes)
    assert [(one.code, one.numbers["name"]) for one in (first, second)] == [
        ("band_best", "45 deg left"), ("band_best", "45 deg right"),
    ]  # fmt: skip
    assert (last.code, last.numbers["name"]) == ("bands_best", "45 deg right")
    assert last.numbers["ratio"] == pytest.approx(np.sqrt(0.1875))
    little = [[replace(one, now_db=4.0, after_db=3.7) for one in each] for each in passes]
    assert codes(little)[-1] == ("all materials", "bands_none")


@pytest.mark.slow
def test_from_a_results_folder(tmp_path, monkeypatch):
    with pytest.raises(StoreError, match="is not finished, expected calibration.h5"):
        advise(tmp_path)
    result = SimpleNamespace(posterior=SimpleNamespace(curve=None))
    flat = {"calibrate": True, "law": "tabulated", "angles_deg": [20, 60], "bounds": [[-30, 0]] * 2}
    config = {
        **sections(),
        "materials": {**sections()["materials"], "slope": flat},
        "measurement": {"synthetic": {"parameters": {"slope": [-10, -10]}}},
    }
    archive = SimpleNamespace(
        configured=case_from(config), materials={"slope": result},
        findings=[], image=SimpleNamespace(levels_db=np.array([[-1.6449, 0.1, 1.6449]])),
    )  # fmt: skip
    monkeypatch.setattr(advice, "read_finished", lambda folder: archive)
    scene().write(tmp_path / "scene.h5")
    with pytest.raises(ConfigError, match="no calibrated material has a band of sigma0 in dB"):
        advise(tmp_path)
    result.posterior = SimpleNamespace(curve="one", **vars(found()["slope"][0]))
    lines = advise(tmp_path, [30.0], (30.0, 60.0))
    path = tmp_path / "advice_depression_30_between_30_60.csv"
    table = pd.read_csv(path)
    assert sorted(table["look_side"]) == ["left", "right"]
    assert (table["half_width_after_db"] < table["half_width_now_db"]).all()
    assert table["over_from_deg"].unique().tolist() == [30.0]
    assert lines[-1] == f"table: {path}"
    assert advise(tmp_path)[-1] == f"table: {tmp_path / 'advice.csv'}"
    # an offset that the fixed laws give to 1 dB in all passes
    given = []
    monkeypatch.setattr(advice, "advice_on", lambda *arguments: given.append(arguments) or advice_on(*arguments))
    archive.configured = case_from({**config, "target": {"margin_px": 0, "normalisation": "offset"}})
    advise(tmp_path, [30.0])
    assert given[0][-1] == pytest.approx(1.0, rel=1e-4)
    archive.findings = [
        Finding("refuted", "warning", "slope", {"p05_db": 1.2, "rms_db": 1.9, "p95_db": 3.0}),
        Finding("withheld", "refusal", "slope", {"half_width_db": 0.7}),
        Finding("withheld", "refusal", "other", {"half_width_db": 0.7}),
    ]
    said = [line for line in advise(tmp_path, [30.0]) if line.startswith(("warning", "refusal"))]
    assert len(said) == 2
    assert said[0].startswith("warning: slope: the form of the law is refuted: it is wrong by 1.9 dB")
    assert said[1] == "refusal: slope: sigma0 is determined at no angle, because the image is refused."
    with pytest.raises(ConfigError, match="--between is 60 30, expected two increasing angles in 0 to 90"):
        advise(tmp_path, (), (60.0, 30.0))
    (tmp_path / "scene.h5").unlink()
    replace(scene(), elevation_m=None, incidence_deg=np.full(60, 30.0)).write(tmp_path / "scene.h5")
    with pytest.raises(ConfigError, match="the scene is in slant range, whose incidence is the same in every pass"):
        advise(tmp_path)
