"""A new case from options: what the files say is in it, what is open is marked, and it loads."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
import yaml
from commands import typed
from raster_files import write_raster
from rasterio.transform import from_origin
from safe_product import write_ground, write_product

from radcal.checking.case_check import check_case
from radcal.config import load


def written(*arguments):
    """Content of the case of these options."""
    Path("mine.yaml").unlink(missing_ok=True)
    Path("mine_names.json").unlink(missing_ok=True)
    typed("new", "mine", *arguments)
    return dict(yaml.safe_load(Path("mine.yaml").read_text()))


def write(path, bands, names=(), pixel_m=20.0):
    where = {} if pixel_m is None else {"crs": "EPSG:32631", "transform": from_origin(6e5, 5.8e6, pixel_m, pixel_m)}
    return write_raster(path, np.stack(bands), names, **where).name


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Options that name a scene of 30 x 40 pixels of 20 m, and an image of two bands in power."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(4)
    cover = np.full((30, 40), 7, dtype=np.uint8)
    cover[:, :13], cover[:4] = 2, 0
    power = rng.gamma(4.0, 0.25, (2, 30, 40)).astype(np.float32)
    return [
        "--elevation", write(tmp_path / "dem.tif", [rng.normal(90, 2, (30, 40)).astype(np.float32)]),
        "--landcover", write(tmp_path / "cover.tif", [cover]),
        "--image", write(tmp_path / "image.tif", [*power], ("sigma0_VH", "sigma0 VV")),
    ]  # fmt: skip


def test_what_the_files_say_is_read_and_the_rest_is_marked(files):
    data = written(*files, "--polarisation", "VV", "--depression", "40")
    text = Path("mine.yaml").read_text()
    assert data["measurement"] == {
        "source": "file", "path": "image.tif", "band": 2, "scale": "FILL_IN", "radiometry": "FILL_IN",
    }  # fmt: skip
    # pixels of 20 m on the ground are 20 m times the cosine of 40 degrees in slant range
    assert (data["radar"]["range_spacing_m"], data["radar"]["azimuth_spacing_m"]) == (15.32, 20)
    assert "30 x 40 pixels, 2 bands, EPSG:32631, pixels of 20 x 20 m" in text
    assert "bands of the file: 1 VH, 2 VV" in text
    # 26 rows of 13 and of 27 columns
    assert "code_2:  # code 2: 338 of 1,040 pixels" in text
    assert "code_7:  # code 7: 702 of 1,040 pixels" in text
    # what is known of neither of them is told apart at the start, so that the start image shows their border
    starts = [material["start"] for material in data["materials"].values()]
    assert starts == [[-20.86, 6.05, 0, 4], [-17.86, 6.05, 0, 4]]
    assert [material["bounds"][0] for material in data["materials"].values()] == [[-40, 0]] * 2
    assert json.loads(Path("mine_names.json").read_text()) == {"2": "code_2", "7": "code_7"}
    assert data["uncertainty"] == {"level_db": 0.33}
    marked = {f"{s}.{key}" for s in ("scene", "measurement", "radar") for key, x in data[s].items() if x == "FILL_IN"}
    assert marked == {
        "scene.vertical_datum", "measurement.scale", "measurement.radiometry", "radar.radiometry", "radar.altitude_m",
        "radar.look_side", "radar.heading_deg", "radar.frequency_ghz", "radar.range_resolution_m",
        "radar.azimuth_resolution_m", "radar.looks", "radar.nesz_db",
    }  # fmt: skip
    # every one of them has its comment, and radcal check lists it with its line
    listed = check_case(["mine.yaml"]).problems
    for number, line in enumerate(text.splitlines(), start=1):
        if key := line.partition(": FILL_IN")[0].strip() * (": FILL_IN" in line):
            assert "  # " in line
            assert sum(f", line {number}: " in one and f".{key} is FILL_IN, expected" in one for one in listed) == 1, (
                key
            )
    assert "mine.yaml, line 9: scene.vertical_datum is FILL_IN" in typed("run", "mine.yaml", code=1).stderr


def test_the_search_lies_about_the_levels_of_the_image(files):
    """Levels from -40.5 to -0.5 dB: X1 from 10 dB below their 5 % quantile to 10 dB above their 95 % quantile."""
    level = np.linspace(-40.5, -0.5, 1200).reshape(30, 40)
    for scale, values in (("db", level), ("power", 10.0 ** (level / 10.0)), ("amplitude", 10.0 ** (level / 20.0))):
        image = write(Path("one.tif"), [values.astype(np.float32)])
        materials = written(*files[:4], "--image", image, "--scale", scale)["materials"]
        assert [one["bounds"][0] for one in materials.values()] == [[-49, 8]] * 2
        # the median of -20.5 dB as gamma, and the next one 3 dB apart
        assert [one["start"][0] for one in materials.values()] == [-25.86, -22.86]
    # a start of its own kind of terrain stays inside
    Path("names.json").write_text('{"2": "water", "7": "field"}')
    materials = written(*files[:4], "--image", image, "--scale", "amplitude", "--names", "names.json")["materials"]
    assert materials["water"]["bounds"][0] == [-60, 8]
    # numbers below zero are in dB
    assert written(*files[:4], "--image", write(Path("db.tif"), [level]))["measurement"]["scale"] == "db"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--elevation", "gone.tif"], "scene.elevation: gone.tif does not exist, expected a file"),
        (["--image", "synthetc"], "measurement.path: synthetc does not exist, expected a file, a SAFE folder, or the"),
        (["--landcover", "dem.tif"], "scene.materials: dem.tif holds float32, expected whole material ids"),
        (["--material", "grass"], "there is no material 'grass' in the land cover (known: code_2, code_7)"),
        (["--fixed", "code_2=low"], "--fixed code_2=low: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,..."),
        (["--fixed", "code_2=-15", "--material", "code_2"], "code_2 has --material (it is calibrated) and --fixed"),
        (["--fixed", "code_2=magia:1,2"], "materials.code_2: law is 'magia', expected one of"),
        (["--landcover-preset", "nlcd"], "scene.landcover: the map has no code 2, 7 of cover.tif, expected --names."),
        (["--sensor", "radarsat"], "radar.sensor is 'radarsat', expected"),
        (["--band", "3"], "measurement.band is 3, image.tif has 2, counted from 1."),
        (["--image", "none", "--band", "2"], "measurement.band is given, and --image none makes a case without a"),
        (["--image", "none", "--material", "code_2"], "code_2 is given, and --image none makes a case without a"),
    ],
)
def test_a_wrong_option_writes_nothing(files, arguments, said):
    done = typed("new", "mine", *files, *arguments, code=1)
    assert done.stdout == ""
    assert f"radcal: {said}" in done.stderr
    assert not Path("mine.yaml").exists()
    assert not Path("mine_names.json").exists()


def test_nothing_is_overwritten(files):
    Path("old.yaml").write_text("case: old\n")
    Path("mine_names.json").write_text("{}")
    for name, said in (
        ("old", "old.yaml: exists, and radcal new overwrites nothing"),
        ("my case", "my case.yaml: the name of the case is 'my case', expected a letter followed by"),
        ("mine", "mine_names.json: exists, and radcal new overwrites nothing: give it with --names"),
    ):
        assert said in typed("new", name, *files, code=1).stderr
    assert (Path("old.yaml").read_text(), Path("mine_names.json").read_text()) == ("case: old\n", "{}")
    assert not Path("mine.yaml").exists()


def test_a_case_for_a_simulation_alone_needs_no_further_answer(files):
    done = typed("new", "alone", *files[:4], "--image", "none", "--fixed", "code_2=mangia:-28,8,14,8")
    assert done.stdout.endswith("Next: radcal check alone.yaml\nThen: radcal simulate alone.yaml\n")
    data = yaml.safe_load(Path("alone.yaml").read_text())
    assert list(data) == ["case", "scene", "radar", "materials"]
    assert data["scene"]["vertical_datum"] == "local"
    # as for a synthetic image: as large as the cells
    assert (data["radar"]["range_spacing_m"], data["radar"]["azimuth_resolution_m"]) == (14.14, 28)
    assert data["materials"]["code_7"] == {"law": "constant_gamma", "parameters": [-15]}
    found = check_case(["alone.yaml"])
    assert (found.problems, found.forward) == ([], True)
    typed("new", "empty", "--image", "none")
    assert all("FILL_IN" in text for text in check_case(["empty.yaml"]).problems)


def test_hidden_laws_differ_and_lie_inside_of_the_bounds(files):
    """Those of dark and bright materials, too, whose starts keep their distance."""
    Path("names.json").write_text('{"2": "water", "7": "lake"}')
    given = [*files[:4], "--names", "names.json", "--vertical-datum", "local", "--image", "synthetic"]
    typed("new", "mine", *given)
    case = load(["mine.yaml"])
    hidden = case.measurement.synthetic.parameters
    assert hidden.keys() == {"water", "lake"}
    assert all(abs(a - b) > 0.05 for a, b in zip(*hidden.values(), strict=True))
    assert [material.start[0] for material in case.materials.values()] == [-45.86, -42.86]
    middle = np.radians(45.0)
    for name, (x1, x2, x3, x4) in hidden.items():
        box, start = case.materials[name].box, case.materials[name].start
        assert all(low < x < high for x, (low, high) in zip(hidden[name], box, strict=True))
        level = x1 + x2 * np.cos(middle) + x3 * np.exp(-x4 * middle**2)
        assert abs(level - start[0] - start[1] * np.cos(middle)) < 2.1
    typed("new", "again", *given)
    assert load(["again.yaml"]).measurement == case.measurement


def test_a_synthetic_case_has_a_law_for_every_material(files):
    scene = [*files[:4], "--image", "synthetic", "--vertical-datum", "local", "--material", "code_7"]
    assert written(*scene)["materials"]["code_2"] == {"law": "constant_gamma", "parameters": ["FILL_IN"]}
    written(*scene, "--fixed", "code_2=-12.5")
    case = load(["mine.yaml"])
    assert (case.calibrated, case.materials["code_2"].parameters) == (["code_7"], [-12.5])
    assert list(case.measurement.synthetic.parameters) == ["code_7"]
    assert (case.radar.range_spacing_m, case.radar.azimuth_resolution_m) == (14.14, 28)


def test_a_sensor_leaves_no_line_open(files):
    Path("names.json").write_text('{"2": "water", "7": "crops"}')
    scene = ["--names", "names.json", "--vertical-datum", "EGM2008", "--band", 1, "--scale", "power"]
    radar = ["--sensor", "sentinel1_iw_grdh", "--radiometry", "gamma0", "--incidence", 39, "--heading", 190.5]
    laws = ["--nesz", -25, "--material", "crops", "--fixed", "water=mangia:-28,8,14,8"]
    written(*files, *scene, *radar, *laws)
    assert "FILL_IN" not in Path("mine.yaml").read_text()
    assert not Path("mine_names.json").exists()
    case = load(["mine.yaml"])
    assert (case.radar.sensor, case.radar.incidence_deg, case.radar.heading_deg) == ("sentinel1_iw_grdh", 39, 190.5)
    assert (case.radar.looks, case.radar.altitude_m) == (4.4, 693_000)
    assert case.radar.radiometry == case.measurement.radiometry == "gamma0"
    assert case.radar.polarisation == "VH"  # of the band
    assert (case.materials["water"].law, case.materials["water"].parameters) == ("mangia", [-28, 8, 14, 8])


def test_a_sensor_leaves_open_what_it_does_not_give(files):
    sensor = ["--sensor", "sentinel1_iw_grdh", "--incidence", "40"]
    radar = written(*files, *sensor, "--polarisation", "VV")["radar"]
    assert {key for key, value in radar.items() if value == "FILL_IN"} == {"heading_deg", "nesz_db", "radiometry"}
    # pixels of 20 m are too large for the sensor's resolution; those of 15 m are 15 m times the sine of 40 degrees
    assert not {"range_spacing_m", "azimuth_spacing_m"} & radar.keys()
    write(Path("fine.tif"), [np.ones((30, 40), np.float32)], ("VV",), 15.0)
    radar = written(*files[:4], "--image", "fine.tif", *sensor)["radar"]
    assert (radar["range_spacing_m"], radar["azimuth_spacing_m"]) == (9.642, 15)


def test_land_cover_without_a_place_is_a_scene_in_slant_range(files):
    np.save("image.npy", np.random.default_rng(1).normal(-12, 2, (20, 30)).astype(np.float32))
    labels = write(Path("labels.tif"), [np.full((20, 30), 3, dtype=np.uint8)], pixel_m=None)
    data = written("--landcover", labels, "--image", "image.npy")
    assert data["scene"]["labels"] == "labels.tif"
    assert {"near_incidence_deg", "far_incidence_deg"} < data["scene"].keys()
    assert "altitude_m" not in data["radar"]
    assert "band" not in data["measurement"]


def test_nothing_given_gives_a_case_that_check_lists(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").mkdir()
    typed("new", "mine")
    problems = check_case(["config/mine.yaml"]).problems
    for key in ("scene.elevation", "scene.names", "measurement.path", "radar.looks", "materials.FILL_IN"):
        assert sum(f"{key} is FILL_IN" in text for text in problems) == 1, key
    assert not any("missing" in text for text in problems)


def test_known_land_cover_names_the_codes(files):
    cover = np.full((30, 40), 40, dtype=np.uint8)
    cover[:, :13] = 80
    scene = ["--elevation", "dem.tif", "--landcover", write(Path("known.tif"), [cover]), "--vertical-datum", "local"]
    written(*scene, "--image", "synthetic")
    assert "maps with these codes (--landcover-preset): esa_worldcover\n" in Path("mine.yaml").read_text()
    preset = ["--landcover-preset", "esa_worldcover", "--image", "synthetic", "--material", "cropland"]
    written(*scene, *preset)
    assert not Path("mine_names.json").exists()
    case = load(["mine.yaml"])
    assert case.materials["cropland"].start_parameters == [-20.86, 6.05, 0, 4]
    assert (case.calibrated, case.materials["permanent_water_bodies"].parameters) == (["cropland"], [-40.0])


@pytest.mark.slow
def test_a_land_cover_of_vectors_is_read(files):
    shapes = [shapely.box(6e5 + 260 * k, 5.79e6, 6e5 + 260 * k + 240, 5.81e6) for k in range(3)]
    kinds = ["Open water", "field", "field"]
    features = [
        {"type": "Feature", "geometry": json.loads(shapely.to_geojson(shape)), "properties": {"class": kind}}
        for shape, kind in zip(shapes, kinds, strict=True)
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32631"}}
    Path("lc.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    case = ["--elevation", "dem.tif", "--landcover", "lc.geojson", "--image", "none"]
    data = written(*case)
    assert data["scene"] == {
        "source": "vectors", "elevation": "dem.tif", "materials": "lc.geojson", "names": "mine_names.yaml",
        "vertical_datum": "local",
    }  # fmt: skip
    surfaces = {"class=Open water": "open_water", "class=field": "field"}
    assert yaml.safe_load(Path("mine_names.yaml").read_text()) == {"surfaces": surfaces}
    assert "field:  # field: 2 of 3 features" in Path("mine.yaml").read_text()
    assert check_case(["mine.yaml"]).problems == []
    Path("own.yaml").write_text("attribute: class\nbackground: soil\nsurfaces: {field: crops}\n")
    assert list(written(*case, "--names", "own.yaml")["materials"]) == ["soil", "crops"]
    for feature in features:
        feature["properties"] = {"height": 2.5}
    Path("lc.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    assert "has no attribute of 1 to 254 values (attributes: height)" in typed("new", "other", *case, code=1).stderr


def test_a_product_fills_the_section_of_the_radar(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    safe = write_product(tmp_path)
    write_ground(40)
    scene = ["--elevation", "height.tif", "--landcover", "cover.tif", "--landcover-preset", "esa_worldcover"]
    written(*scene, "--vertical-datum", "WGS84 ellipsoid", "--image", safe, "--nesz", "-31")
    assert "FILL_IN" not in Path("mine.yaml").read_text()
    found = check_case(["mine.yaml"])
    assert found.problems == []
    radar, printed = load(["mine.yaml"]).radar, yaml.safe_load(found.sections[0])["radar"]
    assert (radar.heading_deg, radar.incidence_deg) == (printed["heading_deg"], printed["incidence_deg"])
    assert (radar.looks, radar.nesz_db, radar.look_side) == (4.4, -31.0, "right")
