"""Check of a case: every mistake is listed at once, and the need of a right one is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from checking_samples import slant_range
from commands import typed
from raster_files import write_raster
from rasterio.transform import from_origin
from safe_product import LINES, PIXELS, write_ground, write_product

from radcal.checking.case_check import check_case
from radcal.findings import Finding, of_pass
from radcal.words import sentence

SIX_MISTAKES = """
seeed: 2
radar: {looks: 0}
materials: {dyke: {calibrate: yes, law: mangja}}
measurement: {source: file, path: gone.tif, scale: db, radiometry: sigma0_ref}
scene: {source: slant_range, labels: none.tif, names: names.json, near_incidence_deg: 20, far_incidence_deg: 40}
"""
SAID = {
    "unknown key seeed (did you mean 'seed'?)",
    "radar.looks is 0",
    "materials.dyke: law is 'mangja'",
    "measurement.path: the file gone.tif does not exist",
    "scene.labels: the file none.tif does not exist",
    "scene.names: the file names.json does not exist",
}


@pytest.fixture(autouse=True)
def _inside(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def path():
    """Case in slant range, with its files."""
    return slant_range()


def test_mistakes_in_text_and_files_are_found_at_once():
    Path("mine.yaml").write_text(SIX_MISTAKES)
    found = check_case(["mine.yaml"])
    assert len(found.problems) == len(SAID)
    assert found.unseen[0] == "scene"
    for text in SAID:
        assert sum(text in problem for problem in found.problems) == 1, text
    done = typed("check", "mine.yaml", code=1)
    assert done.stderr.startswith("radcal: mine.yaml cannot be run; 6 problems found:\n")
    assert all(text in done.stderr for text in SAID)


def test_what_a_right_case_needs_is_told(tmp_path, path):
    said = list[str]()
    found = check_case([path], results=tmp_path / "results", say=said.append)
    assert (found.problems, found.shape) == ([], (60, 50))
    # a line before each part that takes minutes on large scenes
    assert said == [
        "scene ...",
        "pass 1: geometry of 60 x 50 cells ...",
        "pass 1: measured image for 60 x 50 pixels ...",
        "fixed laws against the measured image ...",
    ]
    numbers = {one.code: one.numbers for one in found.findings}
    assert numbers["level_counted"] == pytest.approx({"level_db": 0.33, "half_width_db": 1.645 * 0.33}, rel=1e-3)
    assert found.search == "simulator: 0 of about 13 runs."
    done = typed("check", path)
    assert (
        "at most 16 simulator runs would be made (1 reference, 1 registration, 3 design, at most 9 infill, at most 2 "
        "final; runs of the search have 4 speckle draws); a search" in done.stdout
    )
    assert "60 x 50 pixels" in done.stdout
    assert "memory: at most 1,100 MB are requested for a job (reference_run)" in done.stdout
    twice = typed("check", path, tmp_path / "gone.yaml", code=1)
    assert "60 x 50 pixels" in twice.stdout
    assert twice.stderr.splitlines()[-1] == f"radcal: 1 of 2 cases cannot be run: {tmp_path / 'gone.yaml'}"


def test_what_only_the_files_show_is_found(tmp_path):
    found = check_case([slant_range(shape=(61, 50))])
    assert any("image.npy" in text and "61 x 50" in text for text in found.problems)
    changed = check_case([tmp_path / "mine.yaml"], {"design": {"reuse": "another"}}, tmp_path / "results")
    assert any("design.reuse is 'another'" in text for text in changed.problems)


def test_bounds_that_no_law_leaves_are_a_mistake(path):
    """The image has 0 dB, also where the bounds end 25 dB below; all else was looked at."""
    narrow = {"materials": {"field": {"bounds": [[-40, -30], [0, 3], [0, 2], [0, 20]]}}}
    found = check_case([path], narrow)
    (said,) = found.problems
    assert said.startswith("materials.field.bounds: inside them the law 'mangia' gives -40.0 to -2")
    assert "and the measured level is -0.1 dB" in said
    assert found.unseen == ()
    assert "fixed_level" in [one.code for one in found.findings]
    case = yaml.safe_load(path.read_text())
    twice = {key: [case[key]] * 2 for key in ("radar", "measurement")}
    path.write_text(yaml.safe_dump(case | twice))
    assert check_case([path], narrow).problems == [said], "once for two passes"


def test_warnings_are_told_as_such_and_first(monkeypatch, path):
    steep, plain = Finding("heading_missing", "warning", "radar.heading_deg"), Finding("scene_large", "note", "scene")
    found = replace(check_case([path]), findings=[plain, steep], search="search: short")
    monkeypatch.setattr("radcal.checking.case_check.check_case", lambda *_: found)
    done = typed("check", path)
    lines = done.stdout.splitlines()
    assert lines[:2] == [f"{path}: no mistake found, 1 warning:", f"  {sentence(steep)}"]
    assert [line for line in lines[2:] if "warning: " in line] == []
    assert {f"  note: {sentence(plain)}", "  search: short"} <= set(lines)
    found = replace(found, findings=[steep], problems=["wrong."])
    assert typed("check", path, code=1).stdout == f"  {sentence(steep)}\n"


def test_the_settings_of_a_synthetic_measurement_are_tried(path):
    own = yaml.safe_load(path.read_text())

    def problems(**changes):
        own["measurement"] = {"source": "synthetic", "synthetic": {"warp_px": 0.5, **changes}}
        path.write_text(yaml.safe_dump(own))
        return check_case([path]).problems

    assert problems() == []
    (fine,) = problems(resolution_factor=0.5)
    assert "measurement.synthetic.resolution_factor is 0.5, which makes radar.range_resolution_m 1 m, exp" in fine
    (dark,) = problems(offset_db=-90.0)
    assert "materials.field" in dark


@pytest.mark.slow
def test_a_sentinel1_product_is_told(tmp_path):
    speckle = np.random.default_rng(4).gamma(4.4, 1.0 / 4.4, (LINES, PIXELS))
    safe = write_product(tmp_path, np.ceil(400.0 * np.sqrt(speckle)).astype(np.uint16))
    write_ground(1)
    Path("names.json").write_text('{"1": "crops"}')
    Path("mine.yaml").write_text(
        "scene: {source: raster, elevation: height.tif, materials: cover.tif, names: names.json, "
        "vertical_datum: WGS84 ellipsoid}\n"
        f"measurement: {{source: file, path: {safe}}}\n"
        "materials: {crops: {calibrate: true, bounds: [[-40, 10], [0, 16], [0, 22], [0, 12]]}}\n"
        "radar: {altitude_m: 693000, depression_deg: 53.4, look_side: left, band: C, polarisation: VV, "
        "range_resolution_m: 11, azimuth_resolution_m: 18, range_spacing_m: 6, azimuth_spacing_m: 9.7, looks: 4}\n"
    )
    found = check_case(["mine.yaml"])
    assert found.problems == []
    (seen,) = (one for one in found.findings if one.code == "acquisition")
    assert "S1B IW GRD VV of 2021-12-23" in sentence(seen)
    said = "section radar as the annotation of the image gives it:\n    radar:   # S1B_IW_GRDH"
    assert said in "\n".join(found.summary())
    # what the product says is told beside the problem, also where section radar is far from usable
    for section, said in (("{depression_deg: 45}", "contradicts section radar"), ("{looks: FILL_IN}", "is FILL_IN")):
        wrong = check_case(["mine.yaml"], {"radar": section})
        assert sum(said in problem for problem in wrong.problems) == 1
        assert "note: S1B_IW_GRDH_1SDV" in "\n".join(wrong.remarks())
    # an image that is not made for the check
    assert check_case(["mine.yaml"], {"radar": "{range_spacing_m: 0.02, azimuth_spacing_m: 0.05}"}).problems == []
    (section,) = wrong.sections
    printed = yaml.safe_load(section)["radar"]
    text = Path("mine.yaml").read_text()
    Path("mine.yaml").write_text(text[: text.index("radar:")] + section)
    found = check_case(["mine.yaml"])
    assert found.problems == []
    assert {"look_direction", "noise_differs", "radar_differs"}.isdisjoint(one.code for one in found.findings)
    assert [yaml.safe_load(text)["radar"]["heading_deg"] for text in found.sections] == [printed["heading_deg"]]


@pytest.fixture
def on_the_map():
    """A case of heights, land cover and an image of two bands in dB, on one map, in the current folder."""
    rng = np.random.default_rng(5)
    cover = np.where(np.arange(40) < 17, 40, 10).astype("uint8")[None].repeat(30, axis=0)
    for name, values in (
        ("dem.tif", rng.normal(90, 2, (1, 30, 40)).astype("float32")),
        ("cover.tif", cover[None]),
        ("image.tif", rng.normal(-12, 2, (2, 30, 40)).astype("float32")),
    ):
        write_raster(name, values, crs="EPSG:32631", transform=from_origin(6e5, 5.8e6, 20.0, 20.0))
    Path("mine.yaml").write_text(ON_THE_MAP)


ON_THE_MAP = """
scene: {source: raster, elevation: dem.tif, materials: cover.tif, landcover: esa_worldcover, vertical_datum: EGM2008}
measurement: {source: file, path: image.tif, band: 1, scale: db, radiometry: sigma0_ref}
radar: {altitude_m: 4000, depression_deg: 45, range_resolution_m: 20, azimuth_resolution_m: 28, range_spacing_m: 14,
  azimuth_spacing_m: 20, looks: 4, nesz_db: -40, polarisation: VV}
materials: {cropland: {calibrate: true}, tree_cover: {}}
"""


@pytest.mark.parametrize(
    ("old", "new", "said", "unseen"),
    [
        ("cropland:", "croplan:", "materials.croplan: not in the scene, which has", "geometry"),
        ("band: 1", "band: 5", "measurement.band is 5, image.tif has 2", "start image"),
        ("azimuth_spacing_m: 20", "azimuth_spacing_m: 2", "radar.azimuth_spacing_m is 2", "start image"),
    ],
)
def test_what_a_stage_refuses_is_told_before_any_run(old, new, said, unseen, on_the_map):
    Path("mine.yaml").write_text(ON_THE_MAP.replace(old, new))
    found = check_case(["mine.yaml"])
    (problem,) = found.problems
    assert said in problem
    assert found.unseen[0].startswith(unseen)
    assert not Path("results").exists()


def test_a_right_case_on_the_map_has_no_problem(on_the_map):
    found = check_case(["mine.yaml"])
    assert (found.problems, found.unseen) == ([], ())
    assert "heading_missing" in [one.code for one in found.findings]


def test_an_image_without_a_crs_is_told_so(on_the_map):
    values = np.random.default_rng(5).normal(-12, 2, (7, 9)).astype("float32")
    write_raster("half.tif", values, crs="EPSG:32631")
    np.save("plain.npy", values)
    for name, lacks in (("half.tif", "has no transform from its pixels to the map"), ("plain.npy", "has no CRS")):
        (said,) = check_case(["mine.yaml"], {"measurement": {"path": name, "band": None}}).problems
        assert said.startswith(f"measurement.path: {name} has 7 x 9 pixels, the scene's image ")
        assert f" and the file {lacks}, expected a georeferenced image, as the scene in WGS 84 / UTM zone" in said


def test_a_case_without_materials_has_those_of_the_default_case(on_the_map):
    Path("mine.yaml").write_text(ON_THE_MAP[: ON_THE_MAP.index("materials: {cropland")])
    (problem,) = check_case(["mine.yaml"]).problems  # not one for each of the seven
    assert problem == "materials.dyke: not in the scene, which has tree_cover, cropland."
    Path("mine.yaml").write_text(ON_THE_MAP.replace("cropland: {", "FILL_IN: {"))
    (problem,) = check_case(["mine.yaml"]).problems  # whose name the scene may have
    assert "materials.FILL_IN is FILL_IN" in problem


@pytest.mark.parametrize(
    ("key", "value"), [("command", ["./gone"]), ("files", ["gone"]), ("templates", [{"template": "gone", "file": "a"}])]
)
def test_a_missing_file_of_a_simulator_is_one_problem(key, value, tmp_path, path):
    (tmp_path / "sim").write_text("#!/bin/sh\n")
    (tmp_path / "sim").chmod(0o755)
    simulator = {"kind": "command", "command": ["./sim", "{folder}"], "output": {"file": "a.npy", "scale": "db"}}
    assert check_case([path], {"simulator": {**simulator, "input": {"format": "json"}}}).problems == []
    changed = {**simulator, key: value}
    if key != "templates":
        changed["input"] = {"format": "json"}
    (problem,) = check_case([path], {"simulator": changed}).problems
    assert f": simulator.{key}" in problem
    assert f"the file gone does not exist in {tmp_path}, the current folder." in problem


@pytest.mark.parametrize(
    ("pole", "said"),
    [
        ("30", "materials.field: formula '1/(theta-30) + a' is -2.81475e+14 at an incidence of 30 degrees and a = "),
        # only the image of the start comes near this one
        ("30.5", "materials.field: a = -20 give a sigma0 of "),
    ],
)
def test_a_formula_with_a_pole_keeps_no_other_case_from_its_check(tmp_path, pole, said):
    right = slant_range()
    data = yaml.safe_load(right.read_text())
    law = {"law": "formula", "formula": f"1/(theta-{pole}) + a", "names": ["a"], "bounds": [[-40, 0]]}
    data["materials"]["field"] = {"calibrate": True, **law}
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(yaml.safe_dump(data))
    done = typed("check", wrong, right, code=1)
    head, problem, *_ = done.stderr.splitlines()
    assert (head, said in problem) == (f"radcal: {wrong} cannot be run; 1 problem found:", True)
    assert f"degrees{': ' * (pole == '30.5')}" in done.stderr
    assert f"{right}: no mistake found" in done.stdout


def test_a_raw_file_of_another_size_is_found_before_a_run(path):
    raw = {"file": "image.raw", "format": "raw", "dtype": "float32", "scale": "db", "shape": [60, 51]}
    simulator = {"kind": "command", "command": ["sh"], "input": {}, "output": raw}
    found = check_case([path], {"simulator": simulator})
    assert ["simulator.output.shape is [60, 51]" in problem for problem in found.problems] == [True]
    assert found.shape == (60, 50)
    # of a scene whose size is not known, nothing is said about it
    names = {"scene": {**yaml.safe_load(path.read_text())["scene"], "near_incidence_deg": "steep"}}
    assert all("output.shape" not in text for text in check_case([path], {"simulator": simulator, **names}).problems)


def test_a_case_for_simulate_is_checked_as_such():
    slant_range()
    scene = "{source: slant_range, labels: labels.tif, names: names.json, near_incidence_deg: 20, far_incidence_deg: "
    laws = "{field: {parameters: [-20, 6, 0, 4]}, lake: {parameters: [-30, 6, 9, 4], calibrate: false}}"
    Path("forward.yaml").write_text(f"scene: {scene}40}}\nmaterials: {laws}\n")
    found = check_case(["forward.yaml"])
    assert (found.problems, found.shape, found.forward) == ([], (60, 50), True)
    assert "radcal simulate\n" in "\n".join(found.summary())
    assert "simulator runs" not in "\n".join(found.summary())
    # its mistakes are found, and a measured image or a material to calibrate makes it a case for a calibration
    assert check_case(["forward.yaml"], {"radar": {"looks": 0}}).problems == [
        "forward.yaml, command line: radar.looks is 0, expected greater than or equal to 1."
    ]
    for change in ({"measurement": {}}, {"materials": {"field": {"calibrate": True, "parameters": None}}}):
        assert not check_case(["forward.yaml"], change).forward


def test_notes_on_one_of_several_images_name_their_pass(path):
    case = yaml.safe_load(path.read_text())
    (alone,) = (one for one in check_case([path]).findings if one.code == "pixels")
    path.write_text(yaml.safe_dump({**case, **{key: [case[key]] * 2 for key in ("radar", "measurement")}}))
    found = check_case([path])
    assert [one for one in found.findings if one.code == "pixels"] == [*of_pass([alone], 1, 2), *of_pass([alone], 2, 2)]
    assert sentence(*of_pass([alone], 2, 2)) == f"pass 2: {sentence(alone)}"
    assert [one.about for one in found.findings if one.code == "radiometry_unchecked"] == ["pass 1", "pass 2"]


def test_a_start_that_is_the_hidden_truth_is_told(path):
    case = yaml.safe_load(path.read_text())
    for hidden, told in (({}, True), ({"field": [-8.0, 4.0, 3.0, 5.0]}, False)):
        path.write_text(yaml.safe_dump({**case, "measurement": {"synthetic": {"parameters": hidden}}}))
        assert (Finding("starts_as_truth", "note", "field") in check_case([path]).findings) == told
