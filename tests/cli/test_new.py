"""A new case from options: what the files say is in it, what is open is marked, and it loads."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import rasterio
import yaml
from pyproj import Transformer
from rasterio.transform import from_origin
from safe_product import place_of, write_product
from typer.testing import CliRunner, Result

from radcal.checking.case_check import check_case
from radcal.cli import app
from radcal.config import load

DATA = Path(os.environ.get("RADCAL_DATA", "")) / "sentinel1"
pytestmark = [
    pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning"),
    pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning"),  # of rasterio about affine
]
needs_data = pytest.mark.skipif(not os.environ.get("RADCAL_DATA"), reason="RADCAL_DATA is not set")
LABELS = np.full((20, 30), 3, dtype=np.uint8)
REMAINING = """--vertical-datum EGM2008 --radiometry sigma0_ref --frequency 5.405 --altitude 693000 --depression 51
    --heading 190.5 --look-side right --range-resolution 13 --azimuth-resolution 22 --looks 4 --nesz -22""".split()  # noqa: SIM905


def new(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["new", *map(str, arguments)])


def write(path: Path, bands: list[np.ndarray], names: tuple[str, ...] = (), pixel_m: float | None = 20.0) -> str:
    where = {} if pixel_m is None else {"crs": "EPSG:32631", "transform": from_origin(6e5, 5.8e6, pixel_m, pixel_m)}
    height, width = bands[0].shape
    settings = {"height": height, "width": width, "count": len(bands), "dtype": bands[0].dtype, **where}
    with rasterio.open(path, "w", driver="GTiff", **settings) as raster:
        for number, values in enumerate(bands, start=1):
            raster.write(values, number)
            if names:
                raster.set_band_description(number, names[number - 1])
    return path.name


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
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


def test_what_the_files_say_is_read_and_the_rest_is_marked(files: list[str]) -> None:
    done = new("mine", *files, "--polarisation", "VV", "--depression", "40")
    assert done.exit_code == 0, done.output
    text = Path("mine.yaml").read_text()
    data = yaml.safe_load(text)
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
    assert (
        "# no starting law is known for 'code_7' (docs/landcover.md), gamma -12 dB is a guess, moved apart from "
        "another material; the image at the start needs contrast\n" in text
    )
    assert json.loads(Path("mine_names.json").read_text()) == {"2": "code_2", "7": "code_7"}
    # what the level's error adds to every band is to be decided, too, and has a default
    assert data["uncertainty"] == {"level_db": 0.33}
    marked = {f"{s}.{key}" for s in ("scene", "measurement", "radar") for key, x in data[s].items() if x == "FILL_IN"}
    assert marked == {
        "scene.vertical_datum", "measurement.scale", "measurement.radiometry", "radar.radiometry", "radar.altitude_m",
        "radar.look_side", "radar.heading_deg", "radar.frequency_ghz", "radar.range_resolution_m",
        "radar.azimuth_resolution_m", "radar.looks", "radar.nesz_db",
    }  # fmt: skip
    checked = CliRunner().invoke(app, ["check", "mine.yaml"])
    assert checked.exit_code == 1
    said = checked.stderr.splitlines()
    assert said[0] == f"radcal: mine.yaml cannot be run; {len(marked)} problems found:"
    assert {line.split()[1] for line in said[1:-1]} == marked
    assert said[-1].startswith("Not looked at yet, because of the above: ")
    line = text.splitlines().index("  scale: FILL_IN  # " + text.partition("scale: FILL_IN  # ")[2].partition("\n")[0])
    assert "; for example scale: power" in text.splitlines()[line]
    assert f"  - measurement.scale is FILL_IN (line {line + 1}), expected its value, for example scale: power." in said
    assert done.stdout.splitlines()[-2:] == [
        "Next: radcal check mine.yaml",
        "Then: radcal run mine.yaml reference, and radcal run mine.yaml",
    ]
    assert "--vertical-datum" in done.stdout
    # altitude, side, frequency, both resolutions and looks
    assert "\n--sensor decides up to 6 of them: sentinel1_iw_grdh, terrasarx_stripmap, " in done.stdout
    run = CliRunner().invoke(app, ["run", "mine.yaml"])
    assert run.exit_code == 1
    assert "mine.yaml: scene.vertical_datum is FILL_IN (line 9), expected its value, for exam" in run.stderr


@pytest.mark.parametrize(
    ("names", "lowest", "band", "polarisation", "scale"),
    [
        (("", "sigma0_HV"), (0.1, 0.1), 2, "HV", "FILL_IN"),
        (("sigma0_HH", "sigma0_HV"), (-20.0, -30.0), 1, "HH", "db"),
        (("", ""), (-20.0, 0.1), 1, "VV", "FILL_IN"),
    ],
)
def test_examples_fit_a_file_of_two_bands(
    files: list[str],
    tmp_path: Path,
    names: tuple[str, str],
    lowest: tuple[float, float],
    band: int,
    polarisation: str,
    scale: str,
) -> None:
    bands = [np.linspace(low, low + 1.0, 1200, dtype=np.float32).reshape(30, 40) for low in lowest]
    write(tmp_path / "two.tif", bands, names)
    assert new("mine", *files[:4], "--image", str(tmp_path / "two.tif")).exit_code == 0
    text = Path("mine.yaml").read_text()
    assert f"; for example band: {band}\n" in text
    assert f"; for example polarisation: {polarisation}\n" in text
    data = yaml.safe_load(text)["measurement"]
    assert (data["band"], data["scale"]) == ("FILL_IN", scale)


def test_swapped_rasters_are_asked_about(files: list[str]) -> None:
    done = new("mine", "--elevation", files[3], "--landcover", files[1])
    assert done.stderr == (
        "radcal: scene.materials: dem.tif holds float32, expected whole material ids. scene.elevation: cover.tif "
        "holds whole numbers: are the two files swapped?\n"
    )


def test_nothing_is_overwritten_and_wrong_answers_are_told(files: list[str]) -> None:
    Path("old.yaml").write_text("case: old\n")
    Path("mine_names.json").write_text("{}")
    for arguments, said in (
        (["old"], "old.yaml: exists, and radcal new overwrites nothing"),
        (["my case"], "my case.yaml: the name of the case is 'my case', expected a letter followed by"),
        (["mine", *files], "mine_names.json: exists, and radcal new overwrites nothing: give it with --names"),
        (["mine", "--elevation", "gone.tif"], "scene.elevation: the file gone.tif does not exist"),
        (["mine", *files, "--material", "grass"], "there is no material 'grass' in the land cover (known: code_2, c"),
        (["mine", *files, "--fixed", "code_2=low"], "--fixed code_2=low: expected NAME=DB such as water=-17, or NAME"),
        (
            ["mine", *files, "--fixed", "code_2=magia:1,2"],
            "--fixed code_2=magia:1,2: law is 'magia', expected one of",
        ),
        (["mine", *files, "--landcover-preset", "nlcd"], "--landcover-preset is nlcd, which has no code 2, 7: give"),
        (["mine", *files, "--fixed", "code_2=mangia:1,2"], "code_2=mangia:1,2: parameters has 2 numbers, law 'mangia'"),
        (["mine", "--landcover", "dem.tif"], "scene.materials: dem.tif holds float32, expected whole material ids"),
    ):
        done = new(*arguments)
        assert (done.exit_code, done.stderr.count("\n")) == (1, 1), done.output
        assert said in done.stderr
    assert Path("old.yaml").read_text() == "case: old\n"
    assert not Path("mine.yaml").exists()


def test_a_law_given_twice_is_a_mistake(files: list[str]) -> None:
    """None of the two is taken silently."""
    done = new("mine", *files, "--fixed", "code_2=-15", "--fixed", "code_2=-10")
    assert done.stderr == "radcal: --fixed code_2=-10: a law of code_2 is given twice, expected once.\n"
    done = new("mine", *files, "--fixed", "code_2=-15", "--material", "code_2", "--material", "code_7")
    assert done.stderr == "radcal: code_2 has --material (it is calibrated) and --fixed (it is not), expected one.\n"
    said = new("mine", *files[:4], "--image", "synthetc").stderr
    assert "the file synthetc does not exist, expected a file, a SAFE folder, or the word synthetic or none." in said
    assert not Path("mine.yaml").exists()


def test_all_wrong_answers_are_told_at_once(files: list[str]) -> None:
    """With the sentences of the configuration, and without those on values that follow from a wrong one."""
    done = new(
        "mine", *files, "--scale", "decibel", "--polarisation", "XX", "--looks=-3", "--vertical-datum", "EGM2800",
        "--depression", "100", "--fixed", "code_2=low", "--fixed", "code_7=high",
    )  # fmt: skip
    assert done.exit_code == 1
    assert done.stdout == ""
    assert [line.partition(", expected")[0] for line in done.stderr.splitlines()] == [
        "radcal: scene.vertical_datum is 'EGM2800' (did you mean 'EGM2008 height'?)",
        "radcal: --fixed code_2=low: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.",
        "radcal: --fixed code_7=high: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.",
        "radcal: radar.polarisation is 'XX'",
        "radcal: measurement.scale is 'decibel'",
        "radcal: radar.depression_deg is 100",
        "radcal: radar.looks is -3",
    ]
    gone = [*("--elevation", "a.tif"), *("--landcover", "b.tif"), *("--names", "c.json"), *("--image", "d.tif")]
    done = new("mine", *gone, "--sensor", "radarsat", "--landcover-preset", "corin")
    assert [line.split()[1] for line in done.stderr.splitlines()] == [
        "scene.elevation:", "scene.materials:", "measurement.path:", "--sensor", "scene.landcover", "scene.names:",
    ]  # fmt: skip
    done = new("mine", *files[:4], "--image", "none", "--near-incidence", "20", "--band", "2", "--radiometry", "gamma0")
    assert done.stderr.splitlines() == [
        f"radcal: {key} is given, but a case with scene.source raster and measurement.source none has no such key."
        for key in ("scene.near_incidence_deg", "measurement.band")
    ]
    assert new("mine", *files, "--band", "3").stderr == "radcal: measurement.band is 3, image.tif has 2.\n"
    assert "radcal: measurement.band is 2, dem.tif has 1.\n" in new("mine", "--image", "dem.tif", "--band", "2").stderr
    assert new("mine", "--elevation", ".").stderr == "radcal: scene.elevation: . is a folder, expected a file.\n"
    done = new("mine", *files, "--material", "grass", "--material", "lake", "--fixed", "sea=-3")
    assert done.stderr.count("radcal: there is no material '") == 3
    # a name that the land cover lacks is told beside a wrong number, of the same material and of another one
    done = new(
        "mine", *files, "--fixed", "sea=low", "--fixed", "lake=-15", "--fixed", "lake=-16", "--fixed", "code_7=-9"
    )
    assert done.stderr.splitlines() == [
        "radcal: --fixed sea=low: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.",
        "radcal: --fixed lake=-16: a law of lake is given twice, expected once.",
        "radcal: there is no material 'sea' in the land cover (known: code_2, code_7).",
        "radcal: there is no material 'lake' in the land cover (known: code_2, code_7).",
    ]
    done = new("mine", *files[:2], "--fixed", "sea=low")
    assert done.stderr.count("radcal: ") == 1, "names are not known without a land cover"
    done = new("mine", "--elevation", "dem.tif", "--landcover", write(Path("labels.tif"), [LABELS], pixel_m=None))
    assert done.stderr == (
        "radcal: scene.materials: labels.tif has no CRS and scene.elevation is given, expected land cover on the map.\n"
    )
    assert not Path("mine.yaml").exists()
    assert not Path("mine_names.json").exists()


def test_a_level_without_its_minus_sign_is_asked_about(files: list[str]) -> None:
    done = new("mine", *files, "--fixed", "code_2=17")
    assert done.exit_code == 0, done.output
    assert [line for line in done.stdout.splitlines() if "warning" in line] == [
        "warning: --fixed code_2: constant_gamma gives gamma 17 dB at an incidence of 45 degrees, the brightest "
        "terrain of docs/landcover.md has 0 dB: is a minus sign missing?"
    ]
    assert yaml.safe_load(Path("mine.yaml").read_text())["materials"]["code_2"]["parameters"] == [17]


def test_a_case_for_a_simulation_alone_needs_no_further_answer(files: list[str]) -> None:
    done = new("alone", *files[:4], "--image", "none", "--fixed", "code_2=mangia:-28,8,14,8")
    assert done.exit_code == 0, done.output
    assert done.stdout.endswith("Next: radcal check alone.yaml\nThen: radcal simulate alone.yaml\n")
    data = yaml.safe_load(Path("alone.yaml").read_text())
    assert list(data) == ["case", "scene", "radar", "materials"]
    assert data["scene"]["vertical_datum"] == "local"
    # as for a synthetic image: as large as the cells
    assert (data["radar"]["range_spacing_m"], data["radar"]["azimuth_resolution_m"]) == (14.14, 28)
    assert data["materials"]["code_7"] == {"law": "constant_gamma", "parameters": [-15]}
    made = CliRunner().invoke(app, ["simulate", "alone.yaml"])
    assert made.exit_code == 0, made.output
    assert "results/alone/simulated/simulated.tif" in made.stdout
    refused = new("other", *files[:4], "--image", "none", "--material", "code_2")
    assert refused.stderr == (
        "radcal: --material names a material to calibrate, and --image none gives no image for that.\n"
    )
    assert new("empty", "--image", "none").exit_code == 0
    assert all("FILL_IN" in text for text in check_case(["empty.yaml"]).problems)


def test_hidden_laws_differ_and_lie_inside_of_the_bounds(files: list[str]) -> None:
    """Those of dark and bright materials, too, whose starts keep their distance."""
    names = {"2": "water", "7": "lake"}
    Path("names.json").write_text(json.dumps(names))
    given = [*files[:4], "--names", "names.json", "--vertical-datum", "local", "--image", "synthetic"]
    assert new("mine", *given).exit_code == 0
    text = Path("mine.yaml").read_text()
    assert "  synthetic:  # hidden laws, which the calibration is to find: drawn by the seed of the default c" in text
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
    assert new("again", *given).exit_code == 0
    assert load(["again.yaml"]).measurement == case.measurement


def test_comments_are_about_what_was_given(files: list[str]) -> None:
    Path("own.json").write_text('{"2": "road", "7": "field"}')
    given = ["--names", "own.json", "--range-spacing", "8", "--azimuth-spacing", "9", "--band", "1"]
    assert new("mine", *files, *given).exit_code == 0
    lines = Path("mine.yaml").read_text().splitlines()
    assert "  names: own.json  # JSON file of names by code" in lines
    assert "  range_spacing_m: 8  # pixel spacing in slant range [m]" in lines
    assert "  azimuth_spacing_m: 9  # pixel spacing in azimuth [m]" in lines
    (heading,) = (line for line in lines if line.startswith("  heading_deg: FILL_IN"))
    assert "; a case without this key has a track to the grid's north; for example" in heading
    said = CliRunner().invoke(app, ["check", "mine.yaml"]).stderr
    assert "for example heading_deg: 192.5, or no such line for a track to the grid's north.\n" in said


def test_what_a_sensor_lacks_is_said_once(files: list[str]) -> None:
    given = ["--sensor", "sentinel1_iw_grdh", "--polarisation", "VV", "--band", "2"]
    assert new("mine", *files, *given).exit_code == 0
    assert [text for text in check_case(["mine.yaml"]).problems if "FILL_IN" not in text] == []
    text = Path("mine.yaml").read_text().splitlines()
    Path("mine.yaml").write_text("\n".join(line for line in text if "  nesz_db:" not in line))
    (said,) = (text for text in check_case(["mine.yaml"]).problems if "FILL_IN" not in text)
    assert said.startswith("mine.yaml: radar: nesz_db is missing, which sensor sentinel1_iw_grdh does not give (docs/")


def test_files_of_two_places_are_told_at_once(files: list[str]) -> None:
    with rasterio.open("cover.tif", "r+") as raster:
        raster.transform = from_origin(7e5, 5.8e6, 20.0, 20.0)
    done = new("mine", *files)
    assert (done.exit_code, done.stderr.count("\n")) == (1, 1)
    assert "scene.materials: cover.tif (longitude 5." in done.stderr
    assert done.stderr.endswith(") do not overlap.\n")
    assert not Path("mine.yaml").exists()


def test_materials_are_written_before_the_scene_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert new("both", "--material", "field", "--fixed", "road=-17").exit_code == 0
    written = yaml.safe_load(Path("both.yaml").read_text())["materials"]
    assert list(written) == ["field", "road"]
    assert written["field"]["calibrate"] is True
    assert written["road"] == {"law": "constant_gamma", "parameters": [-17]}
    assert new("one", "--fixed", "road=-17").exit_code == 0
    assert list(yaml.safe_load(Path("one.yaml").read_text())["materials"]) == ["road", "FILL_IN"]


def test_a_sensor_leaves_no_line_open(files: list[str]) -> None:
    Path("names.json").write_text('{"2": "water", "7": "crops"}')
    scene = ["--names", "names.json", "--vertical-datum", "EGM2008", "--band", 1, "--scale", "power"]
    radar = ["--sensor", "sentinel1_iw_grdh", "--radiometry", "gamma0", "--incidence", 39, "--heading", 190.5]
    laws = ["--nesz", -25, "--material", "crops", "--fixed", "water=mangia:-28,8,14,8"]
    done = new("orbit", *files, *scene, *radar, *laws)
    assert "FILL_IN" not in Path("orbit.yaml").read_text(), done.output
    assert not Path("orbit_names.json").exists()
    orbit = load(["orbit.yaml"])
    assert (orbit.radar.sensor, orbit.radar.incidence_deg, orbit.radar.heading_deg) == ("sentinel1_iw_grdh", 39, 190.5)
    assert orbit.radar.radiometry == orbit.measurement.radiometry == "gamma0"
    assert orbit.radar.polarisation == "VH"  # of the band
    assert (orbit.materials["water"].law, orbit.materials["water"].parameters) == ("mangia", [-28, 8, 14, 8])
    # pixels of 20 m are too large for its resolution, so that its own spacing stays
    assert orbit.radar.azimuth_spacing_m == 10


@pytest.mark.slow
def test_a_case_with_a_synthetic_image_can_be_run_at_once(files: list[str]) -> None:
    scene = [*files[:4], "--image", "synthetic", "--vertical-datum", "local"]
    done = new("folder/mine.yaml", *scene, "--material", "code_7")
    assert done.exit_code == 0, done.output
    assert "parameters: [FILL_IN]  # gamma [dB], for example parameters: [-15]" in Path("folder/mine.yaml").read_text()
    (one,) = check_case(["folder/mine.yaml"]).problems
    assert "materials.code_2.parameters is FILL_IN (line 23), expected its value, for example parameters: [-15]" in one
    fixed = ["--material", "code_7", "--fixed", "code_2=-12.5"]
    new("own", *scene, *fixed)
    found = check_case(["own.yaml"])
    assert found.problems == []
    case = load(["own.yaml"])
    assert case.calibrated == ["code_7"]
    assert case.materials["code_2"].parameters == [-12.5]
    assert list(case.measurement.synthetic.parameters) == ["code_7"]
    # as large as the cells, and sampled as the default pass is
    assert (case.radar.range_spacing_m, case.radar.azimuth_resolution_m) == (14.14, 28)


def test_land_cover_without_a_place_is_a_scene_in_slant_range(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    image = np.random.default_rng(1).normal(-12, 2, (20, 30)).astype(np.float32)
    np.save("image.npy", image)
    done = new("flat", "--landcover", write(tmp_path / "labels.tif", [LABELS], pixel_m=None), "--image", "image.npy")
    assert done.exit_code == 0, done.output
    data = yaml.safe_load(Path("flat.yaml").read_text())
    assert data["scene"]["labels"] == "labels.tif"
    assert {"near_incidence_deg", "far_incidence_deg"} < data["scene"].keys()
    assert "altitude_m" not in data["radar"]
    assert "band" not in data["measurement"]


def test_nothing_given_gives_a_case_that_check_lists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").mkdir()
    assert new("mine").exit_code == 0
    problems = check_case(["config/mine.yaml"]).problems
    for key in ("scene.elevation", "scene.names", "measurement.path", "radar.looks", "materials.FILL_IN"):
        assert sum(f"{key} is FILL_IN" in text for text in problems) == 1, key
    assert not any("missing" in text for text in problems)


def test_a_sensor_leaves_open_what_it_does_not_give(files: list[str]) -> None:
    done = new("mine", *files, "--sensor", "sentinel1_iw_grdh", "--polarisation", "VV", "--incidence", "40")
    assert done.exit_code == 0, done.output
    radar = yaml.safe_load(Path("mine.yaml").read_text())["radar"]
    assert {key for key, value in radar.items() if value == "FILL_IN"} == {"heading_deg", "nesz_db", "radiometry"}
    assert radar["incidence_deg"] == 40
    # pixels of 20 m are too large for the sensor's resolution; those of 15 m are 15 m times the sine of 40 degrees
    assert not {"range_spacing_m", "azimuth_spacing_m"} & radar.keys()
    write(Path("fine.tif"), [np.ones((30, 40), np.float32)], ("VV",), 15.0)
    new("fine", *files[:4], "--image", "fine.tif", "--sensor", "sentinel1_iw_grdh", "--incidence", "40")
    radar = yaml.safe_load(Path("fine.yaml").read_text())["radar"]
    assert (radar["range_spacing_m"], radar["azimuth_spacing_m"]) == (9.642, 15)
    whole = ["--heading", "190.5", "--nesz", "-22", "--radiometry", "sigma0_ref", "--incidence", "40"]
    done = new("own", *files[:4], "--image", "synthetic", "--sensor", "sentinel1_iw_grdh", "--vertical-datum", "local",
               *whole, "--polarisation", "VV")  # fmt: skip
    assert done.exit_code == 0, done.output
    case = load(["own.yaml"])
    assert (case.radar.looks, case.radar.heading_deg, case.radar.altitude_m) == (4.4, 190.5, 693_000)
    assert "expected one of sentinel1_iw_grdh, " in new("no", "--sensor", "sentinel").stderr


def test_known_land_cover_names_the_codes(files: list[str], tmp_path: Path) -> None:
    cover = np.full((30, 40), 40, dtype=np.uint8)
    cover[:, :13] = 80
    scene = ["--elevation", "dem.tif", "--landcover", write(tmp_path / "known.tif", [cover])]
    done = new("offered", *scene, "--image", "synthetic", "--vertical-datum", "local")
    assert (
        "the codes are those of esa_worldcover (--landcover-preset esa_worldcover)" in Path("offered.yaml").read_text()
    )
    preset = ["--landcover-preset", "esa_worldcover", "--vertical-datum", "local", "--image", "synthetic"]
    done = new("mine", *scene, *preset, "--material", "cropland")
    assert done.exit_code == 0, done.output
    assert not Path("mine_names.json").exists()
    assert check_case(["mine.yaml"]).problems == []
    case = load(["mine.yaml"])
    assert case.materials["cropland"].start_parameters == [-20.86, 6.05, 0, 4]
    assert (case.calibrated, case.materials["permanent_water_bodies"].parameters) == (["cropland"], [-40.0])
    wrong = new("no", *files, "--landcover-preset", "esa_worldcover")
    assert "--landcover-preset is esa_worldcover, which has no code 2, 7: give --names" in wrong.stderr


@pytest.mark.slow
def test_a_product_fills_the_section_of_the_radar(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    safe = write_product(tmp_path)
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True).transform(*place_of(60.0, 50.0, 120.0))
    where = {"crs": "EPSG:32633", "transform": from_origin(x - 300.0, y + 300.0, 15.0, 15.0)}
    for name, dtype, value in (("level.tif", "float32", 120.0), ("level_cover.tif", "uint8", 40)):
        with rasterio.open(name, "w", "GTiff", 40, 40, 1, dtype=dtype, **where) as raster:
            raster.write(np.full((40, 40), value, dtype=dtype), 1)
    scene = ["--elevation", "level.tif", "--landcover", "level_cover.tif", "--landcover-preset", "esa_worldcover"]
    done = new("mine", *scene, "--vertical-datum", "WGS84 ellipsoid", "--image", str(safe), "--nesz", "-31")
    assert done.exit_code == 0, done.output
    assert "FILL_IN" not in Path("mine.yaml").read_text()
    found = check_case(["mine.yaml"])
    assert found.problems == []
    radar, printed = load(["mine.yaml"]).radar, yaml.safe_load(found.sections[0])["radar"]
    assert (radar.heading_deg, radar.incidence_deg) == (printed["heading_deg"], printed["incidence_deg"])
    assert (radar.looks, radar.nesz_db, radar.look_side) == (4.4, -31.0, "right")


@needs_data
def test_a_sentinel_1_chip_passes_the_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    of = {"--elevation": "elevation_plane", "--landcover": "landcover", "--image": "s1"}
    files = [word for option, name in of.items() for word in (option, str(DATA / f"{name}.tif"))]
    fixed = ["--material", "crops", "--fixed", "water=-17", "--fixed", "bare=-7"]
    done = new("chip", *files, "--names", str(DATA / "names.json"), "--polarisation", "VV", *REMAINING, *fixed)
    assert done.exit_code == 0, done.output
    assert "FILL_IN" not in Path("chip.yaml").read_text()
    found = check_case(["chip.yaml"])
    assert found.problems == []
    case = load(["chip.yaml"])
    assert (case.measurement.band, case.measurement.scale, case.radar.band) == (1, "db", "C")
    assert "crops:  # code 2: 77,303 of 262,133 pixels" in Path("chip.yaml").read_text()
