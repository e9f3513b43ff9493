from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from radcal.config import (
    BuiltinScene,
    Case,
    FileMeasurement,
    RasterScene,
    SlantRangeScene,
    SyntheticMeasurement,
    case_from,
    default_yaml,
    expand_path,
    input_files,
    load,
)
from radcal.errors import ConfigError

X = [1.0, 2.0, 3.0, 4.0]
FIXED = {"dyke": {"calibrate": True}, "grass": {"parameters": X}}


def dyke(**keys: Any) -> dict[str, Any]:
    return {"materials": {"dyke": {"calibrate": True, **keys}}}


def flat(**keys: Any) -> dict[str, Any]:
    both = {"labels": "a.tif", "names": "a.json", "near_incidence_deg": 20, "far_incidence_deg": 40}
    return {"scene": {"source": "slant_range", **both, **keys}}


def mapped(**keys: Any) -> dict[str, Any]:
    files = {"elevation": "a.tif", "materials": "b.tif", "names": "a.json"}
    return {"scene": {"source": "raster", **files, **keys}}


def measured(**keys: Any) -> dict[str, Any]:
    return {"measurement": {"source": "file", "path": "a.tif", "scale": "db", **keys}}


def synthetic(**keys: Any) -> dict[str, Any]:
    return {"measurement": {"source": "synthetic", "synthetic": keys}}


def message(data: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as caught:
        case_from(data, "some.yaml")
    text = str(caught.value)
    assert text.startswith("some.yaml: ")
    assert text.endswith(".")
    assert "\n" not in text
    assert "pydantic" not in text
    return text


def test_defaults_are_a_valid_case() -> None:
    case = Case()
    assert case == case_from({})
    assert case == case_from(case.model_dump(mode="json"))
    assert case.case == "dyke"
    assert case.calibrated == ["dyke"]
    assert len(case.materials) == 7
    assert isinstance(case.scene, BuiltinScene)
    assert isinstance(case.measurement, SyntheticMeasurement)
    assert case.measurement.synthetic.parameters == {"dyke": [6.1, 14.2, 21.5, 3.3]}
    assert case.materials["dyke"].box == [(0.0, 50.0)] * 4
    assert (case.stop.rms, case.stop.max_runs, case.stop.stagnation_runs) == (1e-5, 200, 20)
    assert (case.objective, case.design.sampler, case.design_size) == ("classes", "sobol", 2)
    # the published method is one key away
    assert case_from({"objective": "density"}).design_size == 16
    assert case_from({"objective": "density", "design": {"size": 20}}).design_size == 20


def test_default_yaml_is_the_default_case(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(default_yaml())
    assert load([path]) == Case()
    assert yaml.safe_load(default_yaml())["stop"]["rms"] == 1e-5  # a number, not text


def test_shipped_config_is_the_default_case() -> None:
    shipped = Path(__file__).parents[1] / "config" / "config.yaml"
    assert shipped.read_text() == default_yaml()


def test_module_writes_the_default_yaml() -> None:
    done = subprocess.run([sys.executable, "-m", "radcal.config"], capture_output=True, text=True, check=True)
    assert done.stdout == default_yaml()


@pytest.mark.parametrize(
    ("data", "key", "near"),
    [
        ({"sede": 1}, "sede", "seed"),
        ({"material": {}}, "material", "materials"),
        ({"radar": {"lokos": 4}}, "radar.lokos", "looks"),
        ({"radar": {"altitude": 4000}}, "radar.altitude", "altitude_m"),
        ({"radar": {"polarization": "HH"}}, "radar.polarization", "polarisation"),
        ({"simulator": {"knd": "builtin"}}, "simulator.knd", "kind"),
        ({"simulator": {"keep_image": True}}, "simulator.keep_image", "keep_images"),
        ({"registration": {"methd": "none"}}, "registration.methd", "method"),
        ({"target": {"pixel": 100}}, "target.pixel", "pixels"),
        ({"target": {"normalization": "none"}}, "target.normalization", "normalisation"),
        ({"design": {"sizes": 8}}, "design.sizes", "size"),
        ({"surrogate": {"output": "direct"}}, "surrogate.output", "outputs"),
        ({"optimiser": {"polsh": True}}, "optimiser.polsh", "polish"),
        ({"stop": {"max_run": 20}}, "stop.max_run", "max_runs"),
        ({"scene": {"source": "builtin", "sed": 1}}, "scene.sed", "seed"),
        (flat(near_incidence=20), "scene.near_incidence", "near_incidence_deg"),
        (mapped(vertical_dtum="EGM96"), "scene.vertical_dtum", "vertical_datum"),
        (measured(radiometri="x"), "measurement.radiometri", "radiometry"),
        (synthetic(offset=1.0), "measurement.synthetic.offset", "offset_db"),
        (dyke(bound=[]), "materials.dyke.bound", "bounds"),
        (dyke(strat=X), "materials.dyke.strat", "start"),
        (synthetic(parameters={"dkye": X}), "measurement.synthetic.parameters.dkye", "dyke"),
    ],
)
def test_misspelt_keys_are_refused_with_the_nearest(data: dict[str, Any], key: str, near: str) -> None:
    text = message(data)
    assert key in text
    assert f"did you mean {near!r}?" in text


def test_key_like_no_other_is_refused_with_all_known() -> None:
    text = message({"stop": {"xyzzy": 1}})
    assert "unknown key stop.xyzzy" in text
    assert "known: at_sampling_error, law_db, max_runs, rms, stagnation_runs" in text


def test_keys_of_another_source_are_not_known() -> None:
    assert "unknown key scene.labels" in message({"scene": {"source": "builtin", "labels": "a.tif"}})
    assert "unknown key measurement.synthetic" in message(measured(synthetic={}))


def truth(x: list[float], law: dict[str, Any], **radar: Any) -> dict[str, Any]:
    """A calibrated dyke of some law with a hidden truth."""
    return {**dyke(**law), **synthetic(parameters={"dyke": x}), "radar": radar}


GAMMA = {"law": "constant_gamma", "bounds": [[-30, 0]]}
TABLE = {"law": "tabulated", "angles_deg": [20, 40, 60], "bounds": [[-30, 0]] * 3}
OH = {"law": "oh1992"}

BAD: list[tuple[dict[str, Any], list[str]]] = [
    # laws
    (truth([-1, -2], GAMMA), ["measurement.synthetic.parameters.dyke has 2 numbers, law 'constant_gamma' takes 1"]),
    (dyke(**GAMMA), ["measurement.synthetic.parameters.dyke is missing", "'mangia'", "is 'constant_gamma'"]),
    (truth([-1], {"law": "constant_gamma"}), ["materials.dyke: bounds is missing", "no default", "gamma"]),
    (truth(X + X[:2], {"law": "ulaby_dobson"}), ["materials.dyke: bounds is missing", "P1, P2, P3, P4, P5, P6"]),
    (dyke(law="ulaby_dobson", bounds=[[0, 1]] * 2 + [[0, 101]] + [[0, 1]] * 3), ["P3", "is 101", "-100 to 100"]),
    ({"materials": {"dyke": {"law": "ulaby_dobson"}}}, ["materials.dyke", "6 numbers", "'P6'"]),
    (dyke(law="tabulated", bounds=[[-30, 0]] * 3), ["materials.dyke: angles_deg is missing", "'tabulated'"]),
    (dyke(**{**TABLE, "angles_deg": [20, 20, 60]}), ["materials.dyke: angles_deg is [20.0, 20.0, 60.0]", "increasing"]),
    (dyke(**{**TABLE, "angles_deg": [20]}), ["materials.dyke.angles_deg is [20]", "at least 2"]),
    (dyke(**{**TABLE, "angles_deg": [20, 40, 91]}), ["materials.dyke.angles_deg.2 is 91"]),
    (dyke(**{**TABLE, "bounds": [[-30, 0]] * 2}), ["materials.dyke: bounds has 2 intervals, law 'tabulated' takes 3"]),
    (dyke(angles_deg=[20, 40]), ["materials.dyke: angles_deg is given, law 'mangia' has no knots"]),
    (truth([8, 1, 1], OH), ["radar.frequency_ghz is missing: law 'oh1992' of materials.dyke depends on it"]),
    (truth([8, 1, 0], OH, frequency_ghz=9.6), ["rms_height of law 'oh1992' is 0, expected 0.01 to 100"]),
    (truth([8, 1, 1], {**OH, "bounds": [[5, 9], [-1, 1], [1, 2]]}, frequency_ghz=9.6), ["bounds", "permittivity_imag"]),
    ({"radar": {"frequency_ghz": 5.4}}, ["radar: frequency_ghz is 5.4, which is not in band 'X'"]),
    ({"radar": {"frequency_ghz": -1}}, ["radar.frequency_ghz is -1"]),
    # starts of another law
    (dyke(start={"law": "constant_gamma"}), ["materials.dyke.start.parameters is missing"]),
    (dyke(start={"law": "constant_gamma", "parameters": [1, 2]}), ["materials.dyke.start", "2 numbers", "takes 1"]),
    (dyke(start={"law": "gamma", "parameters": [1]}), ["materials.dyke.start: law is 'gamma', expected one of"]),
    (dyke(start={"low": "mangia", "parameters": X}), ["materials.dyke.start.low", "did you mean 'law'?"]),
    (dyke(start={"law": "mangia", "parameters": [60, 1, 1, 1]}), ["materials.dyke", "X1 is 60", "inside its bounds"]),
    (
        {**dyke(start={"law": "oh1992", "parameters": [8, 1, 1]}), **synthetic(parameters={"dyke": X})},
        ["radar.frequency_ghz is missing", "materials.dyke.start depends"],
    ),
    (
        {**dyke(start={"law": "constant_gamma", "parameters": [-9]}), **synthetic(parameters={})},
        ["measurement.synthetic.parameters.dyke is missing", "materials.dyke.start is of another law"],
    ),
    (dyke(start=5), ["materials.dyke.start is 5"]),
    (dyke(start=[1, 2, 3, "x"]), ["materials.dyke.start.3 is 'x'"]),
    # top level
    ({"case": "a b"}, ["case", "'a b'", "a letter"]),
    ({"case": "a" * 101}, ["case", "has 101 letters", "at most 100"]),
    ({"case": "../up"}, ["case", "'../up'"]),
    ({"case": "1st"}, ["case", "'1st'"]),
    ({"case": ""}, ["case", "''"]),
    ({"case": 3}, ["case is 3"]),
    ({"case": "new\n"}, ["case"]),
    ({"seed": -1}, ["seed is -1"]),
    ({"seed": 1.5}, ["seed is 1.5"]),
    ({"seed": "one"}, ["seed is 'one'"]),
    ({"seed": None}, ["seed is None"]),
    ({"seed": 2**63}, ["seed is 9223372036854775808"]),
    ({1: 2}, ["1"]),
    ({"radar": None}, ["radar is None"]),
    ({"stop": [1, 2]}, ["stop is [1, 2]"]),
    ({"scene": "builtin"}, ["scene is 'builtin'"]),
    # radar
    ({"radar": {"altitude_m": 0}}, ["radar.altitude_m is 0", "greater than or equal to 1"]),
    ({"radar": {"altitude_m": "high"}}, ["radar.altitude_m is 'high'"]),
    ({"radar": {"altitude_m": float("nan")}}, ["radar.altitude_m is nan"]),
    ({"radar": {"altitude_m": float("inf")}}, ["radar.altitude_m is inf"]),
    ({"radar": {"depression_deg": 90}}, ["radar.depression_deg is 90", "less than 85"]),
    ({"radar": {"depression_deg": 5}}, ["radar.depression_deg is 5"]),
    ({"radar": {"look_side": "up"}}, ["radar.look_side is 'up'", "'right' or 'left'"]),
    ({"radar": {"polarisation": "hh"}}, ["radar.polarisation is 'hh'", "'HH'"]),
    ({"radar": {"range_spacing_m": -1.5}}, ["radar.range_spacing_m is -1.5"]),
    ({"radar": {"looks": 0}}, ["radar.looks is 0"]),
    ({"radar": {"looks": 2.5}}, ["radar.looks is 2.5"]),
    ({"radar": {"nesz_db": float("-inf")}}, ["radar.nesz_db is -inf"]),
    ({"radar": {"nesz_db": [[30, -20]]}}, ["radar.nesz_db is [[30, -20]]", "at least 2"]),
    ({"radar": {"nesz_db": [[30, -20], [20, -18]]}}, ["radar.nesz_db", "[30.0, 20.0], expected increasing angles"]),
    ({"radar": {"nesz_db": [[30, -20], [95, -18]]}}, ["radar.nesz_db.1.0 is 95", "less than 90"]),
    ({"radar": {"nesz_db": [[30, -20], [40]]}}, ["radar.nesz_db.1.1 is missing"]),
    ({"radar": {"radiometry": "beta"}}, ["radar.radiometry is 'beta'", "'sigma0_local'"]),
    # scene
    ({"scene": {"source": "buitlin"}}, ["scene.source is 'buitlin'", "'builtin'", "'slant_range'"]),
    ({"scene": {"source": "builtin", "seed": -4}}, ["scene.seed is -4"]),
    (flat(near_incidence_deg=0), ["scene.near_incidence_deg is 0"]),
    (flat(far_incidence_deg=90), ["scene.far_incidence_deg is 90"]),
    (flat(near_incidence_deg=50), ["scene", "near_incidence_deg (50)", "far_incidence_deg (40)"]),
    (flat(labels=7), ["scene.labels is 7"]),
    ({"scene": {"source": "slant_range"}}, ["scene.labels is missing"]),
    ({"scene": {"source": "raster"}}, ["scene.elevation is missing"]),
    (mapped(cell_m=0), ["scene.cell_m is 0", "greater than or equal to 0.001"]),
    (mapped(crs=32631), ["scene.crs is 32631"]),
    (mapped(bounds=[0, 1, 2]), ["scene.bounds.3 is missing"]),
    (mapped(bounds=[0, 2, 1, 1]), ["scene", "bounds are [0, 2, 1, 1]", "south < north"]),
    (mapped(bounds=[0, 0, 1, float("nan")]), ["scene.bounds.3 is nan"]),
    # materials
    ({"materials": {}}, ["materials"]),
    ({"materials": None}, ["materials is None"]),
    ({"materials": {"dyke": None}}, ["materials.dyke is None"]),
    ({"materials": {"a/b": {"calibrate": True}}}, ["materials", "'a/b'"]),
    ({"materials": {"grass": {"parameters": X}}}, ["materials", "calibrate: true"]),
    ({"materials": {"grass": {}}}, ["materials.grass", "needs parameters", "X1"]),
    ({"materials": {"grass": {"parameters": [1, 2]}}}, ["materials.grass", "2 numbers", "takes 4"]),
    (dyke(law="mangy"), ["materials.dyke", "'mangy'", "mangia"]),
    (dyke(calibrate="maybe"), ["materials.dyke.calibrate is 'maybe'"]),
    (dyke(parameters=X), ["materials.dyke", "start and bounds, not parameters"]),
    (dyke(bounds=[[0, 1]] * 3), ["materials.dyke", "3 intervals", "takes 4"]),
    (dyke(bounds=[[0, 1]] * 5), ["materials.dyke", "5 intervals", "takes 4"]),
    (dyke(bounds=[[0, 1]] * 3 + [[2, 1]]), ["materials.dyke", "X4", "[2, 1]", "lower < upper"]),
    (dyke(bounds=[[0, 1]] * 3 + [[1, 1]]), ["materials.dyke", "X4", "[1, 1]"]),
    (dyke(bounds=[[0, 1, 2]] * 4), ["materials.dyke.bounds.0", "[0, 1, 2]"]),
    (dyke(bounds=[[0, float("nan")]] * 4), ["materials.dyke.bounds.0.1 is nan"]),
    (dyke(bounds="wide"), ["materials.dyke.bounds is 'wide'"]),
    (dyke(start=[1, 2, 3]), ["materials.dyke", "start has 3 numbers", "takes 4"]),
    (dyke(start=[1, 2, 3, 51]), ["materials.dyke", "start of X4 is 51", "[0, 50]"]),
    # measurement
    ({"measurement": {"source": "satellite"}}, ["measurement.source is 'satellite'", "'file'", "'synthetic'"]),
    (measured(scale="dB"), ["measurement.scale is 'dB'", "'db', 'power', 'amplitude' or 'complex'"]),
    (measured(scale=None), ["measurement.scale is None"]),
    ({"measurement": {"source": "file", "path": "a.tif"}}, ["measurement.scale is missing"]),
    ({"measurement": {"source": "file", "scale": "db"}}, ["measurement.path is missing"]),
    (measured(polarisation="HH "), ["measurement.polarisation is 'HH '", "'HH', 'HV', 'VH' or 'VV'"]),
    (measured(polarisation="HV"), ["measurement.polarisation is HV, radar.polarisation is HH", "never mixed"]),
    (measured(carrier_band="C"), ["measurement.carrier_band is 'C', radar.band is 'X'", "never mixed"]),
    (synthetic(parameters={"dyke": [1, 2]}), ["measurement.synthetic.parameters.dyke", "2 numbers", "takes 4"]),
    (synthetic(parameters={"dyke": [1, 2, 3, "x"]}), ["measurement.synthetic.parameters.dyke.3 is 'x'"]),
    (synthetic(offset_db=float("nan")), ["measurement.synthetic.offset_db is nan"]),
    (synthetic(warp_px=-1), ["measurement.synthetic.warp_px is -1"]),
    (synthetic(warp_px=float("nan")), ["measurement.synthetic.warp_px is nan"]),
    (synthetic(seed=-1), ["measurement.synthetic.seed is -1"]),
    (
        {"radar": {"azimuth_resolution_m": 1e4}},
        ["radar: azimuth_resolution_m is 10000, expected at most 1000 times azimuth_spacing_m (2.5)"],
    ),
    # other shapes than those expected
    ({"radar": None}, ["some.yaml: radar is None, expected keys and values."]),
    ({"radar": [{"looks": 4}]}, ["radar is [{'looks': 4}], expected keys and values."]),
    ({"materials": {}}, ["materials is {}, expected at least 1 item, not 0."]),
    ({"materials": ["dyke"]}, ["materials is ['dyke'], expected keys and values."]),
    (dyke(bounds=[0, 1, 2, 3]), ["materials.dyke.bounds.0 is 0, expected a list (and 3 more)."]),
    (dyke(bounds=[[0, 1, 2]] * 4), ["bounds.0 is [0, 1, 2], expected at most 2 items, not 3 (and 3 more)."]),
    ({"\x1b[31mred\n": 1}, ["unknown key \\x1b[31mred\\n (known: "]),
    ({"stop": {"[rms": 1}}, ["unknown key stop.[rms (did you mean 'rms'?)"]),
    ({"seed": [0] * 9000}, ["seed is [" + "0, " * 18 + "0,..., expected a valid integer."]),
    # the rest
    ({"simulator": {"kind": "emprise"}}, ["simulator.kind is 'emprise'", "'builtin'"]),
    ({"registration": {"method": "magic"}}, ["registration.method is 'magic'", "'none'"]),
    ({"target": {"pixels": 49}}, ["target.pixels is 49", "50"]),
    ({"target": {"margin_px": -1}}, ["target.margin_px is -1"]),
    ({"design": {"sampler": "halton"}}, ["design.sampler is 'halton'", "'sobol'", "'latin_hypercube'"]),
    ({"design": {"size": 0}}, ["design.size is 0"]),
    ({"design": {"chunk": 0}}, ["design.chunk is 0"]),
    ({"surrogate": {"training": "hot"}}, ["surrogate.training is 'hot'", "'warm'"]),
    ({"surrogate": {"retrain_every": 0}}, ["surrogate.retrain_every is 0"]),
    ({"optimiser": {"population": 3}}, ["optimiser.population is 3", "4"]),
    ({"optimiser": {"evaluations": 0}}, ["optimiser.evaluations is 0"]),
    ({"stop": {"rms": 0}}, ["stop.rms is 0"]),
    ({"stop": {"rms": float("nan")}}, ["stop.rms is nan"]),
    ({"objective": "density", "stop": {"max_runs": 15}}, ["stop.max_runs is 15", "design.size (16)"]),
    ({"stop": {"stagnation_runs": 0}}, ["stop.stagnation_runs is 0"]),
]


@pytest.mark.parametrize(("data", "words"), BAD, ids=lambda value: None if isinstance(value, list) else str(value)[:60])
def test_bad_values_are_refused_in_a_sentence(data: dict[str, Any], words: list[str]) -> None:
    text = message(data)
    for word in words:
        assert word in text, text


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"seed": True}, "seed"),
        ({"radar": {"looks": True}}, "radar.looks"),
        ({"radar": {"frequency_ghz": True}}, "radar.frequency_ghz"),
        ({"target": {"pixels": True}}, "target.pixels"),
        ({"stop": {"stagnation_runs": True}}, "stop.stagnation_runs"),
        (dyke(bounds=[[True, 50.0], *[[0.0, 50.0]] * 3]), "materials.dyke.bounds.0.0"),
        (dyke(start=[True, 10.0, 10.0, 10.0]), "materials.dyke.start.0"),
        (synthetic(parameters={"dyke": [*X[:3], True]}), "measurement.synthetic.parameters.dyke.3"),
    ],
)
def test_yes_and_no_are_no_numbers(data: dict[str, Any], key: str) -> None:
    assert message(data) == f"some.yaml: {key} is True, expected a number."


def test_more_than_one_mistake_is_counted() -> None:
    assert "(and 2 more)" in message({"seed": -1, "radar": {"looks": 0}, "stop": {"rms": -1}})


def test_each_union_member_is_read() -> None:
    assert case_from(flat()).scene == SlantRangeScene(
        source="slant_range", labels="a.tif", names="a.json", near_incidence_deg=20, far_incidence_deg=40
    )
    assert case_from(mapped(bounds=[0, 1, 2, 3])).scene == RasterScene(
        source="raster", elevation="a.tif", materials="b.tif", names="a.json", bounds=(0, 1, 2, 3)
    )
    assert case_from(measured()).measurement == FileMeasurement(source="file", path="a.tif", scale="db")


def test_measurement_of_the_same_pass() -> None:
    declared = case_from(
        {"radar": {"polarisation": "VV", "band": "L"}} | measured(polarisation="VV", carrier_band="l-band")
    )
    assert isinstance(declared.measurement, FileMeasurement)
    assert (declared.measurement.polarisation, declared.measurement.carrier_band) == ("VV", "l-band")
    assert case_from(measured(band=2)).measurement == FileMeasurement(path="a.tif", scale="db", band=2)


def test_start_is_the_middle_of_the_bounds_unless_given() -> None:
    bounds = [[-50, 0], [0, 20], [0, 1], [2, 4]]
    assert case_from(dyke(bounds=bounds)).materials["dyke"].start_parameters == [-25, 10, 0.5, 3]
    given = case_from(dyke(bounds=bounds, start=[-1, 1, 1, 2])).materials["dyke"]
    assert given.start_parameters == [-1, 1, 1, 2]
    assert case_from({"materials": FIXED}).materials["grass"].start_parameters == X


def test_calibrated_materials_keep_the_order_of_the_file() -> None:
    names = ["water", "dyke", "asphalt"]
    case = case_from({"materials": {name: {"calibrate": True} for name in names}})
    assert case.calibrated == names


@pytest.mark.parametrize(
    ("path", "value"),
    [(("seed",), 2), (("stop", "rms"), 1e-3), (("radar", "looks"), 1), (("scene", "seed"), 4), (("nothing",), 1)],
)
def test_configuration_is_frozen(path: tuple[str, ...], value: object) -> None:
    section: Any = Case()
    for name in path[:-1]:
        section = getattr(section, name)
    with pytest.raises(ValidationError):
        setattr(section, path[-1], value)


def write(folder: Path, text: str | bytes, name: str = "case.yaml") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


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


def test_paths_expand_variables_and_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a b.tif").write_text("")
    monkeypatch.setenv("RADCAL_TEST", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert expand_path("${RADCAL_TEST}/a b.tif", "key") == tmp_path / "a b.tif"
    assert expand_path("~/a b.tif", "key") == tmp_path / "a b.tif"
    with pytest.raises(ConfigError, match=r"^key: the file .*/b\.tif does not exist\.$"):
        expand_path("${RADCAL_TEST}/b.tif", "key")
    with pytest.raises(ConfigError, match="is not a file"):
        expand_path(str(tmp_path), "key")  # a folder
    monkeypatch.delenv("RADCAL_TEST")
    with pytest.raises(ConfigError, match=r"^key is '\$\{RADCAL_TEST\}/x' but .* RADCAL_TEST is not set: type export"):
        expand_path("${RADCAL_TEST}/x", "key")


def test_names_that_no_file_has_end_in_a_sentence() -> None:
    with pytest.raises(
        ConfigError, match=r"^scene\.labels: the file a{197}\.\.\. cannot be read \(File name too long\)\.$"
    ):
        expand_path("a" * 5000, "scene.labels")
    with pytest.raises(ConfigError, match=r"^scene\.labels: the file a\\nb\\x00\.tif does not exist\.$"):
        expand_path("a\nb\0.tif", "scene.labels")


def test_variables_are_expanded_when_the_file_is_read_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RADCAL_TEST", raising=False)
    case = case_from(measured(path="${RADCAL_TEST}/a.tif"))
    assert isinstance(case.measurement, FileMeasurement)
    assert case.measurement.path == "${RADCAL_TEST}/a.tif"
    with pytest.raises(ConfigError, match=r"measurement\.path .* RADCAL_TEST"):
        input_files(case)


def test_input_files_are_those_that_the_case_reads(tmp_path: Path) -> None:
    assert input_files(Case()) == {}
    paths = {name: tmp_path / name for name in ("labels.tif", "names.json", "image.tif")}
    for path in paths.values():
        path.write_text("")
    labels, names, image = (str(path) for path in paths.values())
    case = case_from(flat(labels=labels, names=names) | measured(path=image))
    assert input_files(case) == {
        "scene.labels": paths["labels.tif"],
        "scene.names": paths["names.json"],
        "measurement.path": paths["image.tif"],
    }
    files = {"elevation": image, "materials": labels, "names": names}
    assert input_files(case_from(mapped(**files))) == {f"scene.{key}": Path(path) for key, path in files.items()}


def test_what_a_raster_is_read_together_with_is_an_input_too(tmp_path: Path) -> None:
    paths = {name: tmp_path / name for name in ("own/a.vrt", "own/a.prj", "other/tile.tif", "names.json")}
    for path in paths.values():
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    source = '<SourceFilename relativeToVRT="1">../other/tile.tif</SourceFilename>'
    paths["own/a.vrt"].write_text(
        f"<VRTDataset><VRTRasterBand><SimpleSource>{source}</SimpleSource></VRTRasterBand></VRTDataset>"
    )
    keys = {"labels": str(paths["own/a.vrt"]), "names": str(paths["names.json"])}
    case = case_from(flat(**keys, vrt_folders=[str(tmp_path / "other")]) | measured(path=str(paths["names.json"])))
    assert input_files(case) == {
        "scene.labels": paths["own/a.vrt"],
        "scene.labels.0": paths["own/a.prj"],
        "scene.labels.1": paths["other/tile.tif"],
        "scene.names": paths["names.json"],
        "measurement.path": paths["names.json"],
    }
    with pytest.raises(ConfigError, match=r"^scene\.labels: .*a\.vrt cannot be read as a raster \(a\.vrt names"):
        input_files(case_from(flat(**keys) | measured(path=str(paths["names.json"]))))
    with pytest.raises(ConfigError, match=r"scene\.vrt_folders\.0: the file .*gone does not exist"):
        input_files(case_from(flat(**keys, vrt_folders=[str(tmp_path / "gone")]) | measured(path=str(tmp_path / "x"))))


def test_sections_rebuild_a_case_without_the_rest() -> None:
    case = case_from(flat() | {"materials": FIXED, "measurement": {"source": "file", "path": "a.tif", "scale": "db"}})
    sections = case.sections("scene", "radar", "materials", "measurement")
    assert yaml.safe_load(yaml.safe_dump(sections)) == sections  # plain data
    part = Case.of_sections(sections)
    assert (part.scene, part.radar, part.materials) == (case.scene, case.radar, case.materials)
    assert part.measurement == case.measurement
    assert part.calibrated == ["dyke"]
    for name in ("stop", "target", "seed", "design"):
        with pytest.raises(AttributeError):
            getattr(part, name)


def test_bounds_of_absurd_size_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"bounds of X1 are \[0, 1e\+30\], expected within"):
        case_from({"materials": {"dyke": {"calibrate": True, "bounds": [[0, 1e30]] * 4}}})


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"materials": {"road": {"parameters": [1001, 0, 0, 0]}}}, "materials.road: parameters: X1 of law 'mangia' is"),
        (synthetic(parameters={"dyke": [0, -1e30, 0, 0]}), "parameters.dyke: X2 of law 'mangia' is -1e+30, expected"),
        (dyke(start={"law": "constant_gamma", "parameters": [2000]}), "gamma of law 'constant_gamma' is 2000,"),
    ],
)
def test_parameters_of_absurd_size_are_refused(data: dict[str, Any], words: str) -> None:
    text = message(data)
    assert words in text
    assert "expected -1000 to 1000" in text


def test_the_default_truth_does_not_bind_other_materials() -> None:
    case = case_from({"materials": {"grass": {"calibrate": True}}})
    assert case.calibrated == ["grass"]
    with pytest.raises(ConfigError, match="no such material"):
        written = {"synthetic": {"parameters": {"dyke": [1, 2, 3, 4]}}}
        case_from({"materials": {"grass": {"calibrate": True}}, "measurement": written})


def test_a_start_of_another_law_is_only_the_reference_runs() -> None:
    start = {"law": "tabulated", "angles_deg": [20, 50], "parameters": [-3.0, -9.0]}
    case = case_from({**dyke(start=start), **synthetic(parameters={"dyke": X})})
    assert case == case_from(case.model_dump(mode="json"))
    assert case == case_from(yaml.safe_load(yaml.safe_dump(case.model_dump(mode="json"))))
    assert case.start_with_another_law == ["dyke"]
    assert case.materials["dyke"].start_parameters == [-3.0, -9.0]
    assert case.laws["dyke"].names == ("X1", "X2", "X3", "X4")
    reference = case.at_start
    assert reference.materials["dyke"].law == "tabulated"
    assert reference.materials["dyke"].start_parameters == [-3.0, -9.0]
    assert reference.laws["dyke"].valid_deg == (20.0, 50.0)
    assert reference.calibrated == ["dyke"]
    assert reference.at_start == reference


@pytest.mark.parametrize("start", [X, {"law": "mangia", "parameters": X}])
def test_a_start_of_the_same_law_is_a_start(start: object) -> None:
    case = case_from(dyke(start=start))
    assert case.start_with_another_law == []
    assert case.materials["dyke"].start_parameters == X
    assert case.at_start == case


def test_start_by_law_survives_a_rules_params() -> None:
    case = case_from(
        {**dyke(start={"law": "constant_gamma", "parameters": [-9.0]}), **synthetic(parameters={"dyke": X})}
    )
    again = Case.of_sections(case.sections("materials", "radar"))
    assert again.start_with_another_law == ["dyke"]
    assert again.at_start.laws["dyke"].names == ("gamma",)


def test_laws_know_the_pass() -> None:
    case = case_from(truth([8, 1, 1], OH, frequency_ghz=5.4, band="C", polarisation="VV"))
    higher = case_from(truth([8, 1, 1], OH, frequency_ghz=9.6, polarisation="HH"))
    assert float(case.laws["dyke"](0.6, [8, 1, 1])) != float(higher.laws["dyke"](0.6, [8, 1, 1]))


def test_a_measurement_of_another_radiometry_is_refused() -> None:
    file = {"source": "file", "path": "a.tif", "scale": "power", "radiometry": "gamma0"}
    with pytest.raises(ConfigError, match=r"measurement\.radiometry is gamma0, radar\.radiometry is sigma0_local: set"):
        case_from({"measurement": file})
    assert case_from({"measurement": file, "radar": {"radiometry": "gamma0"}}).radar.radiometry == "gamma0"


COMMAND = {"kind": "command", "command": ["sim"], "output": {"file": "i.npy", "scale": "db"}}
SOIL = {"calibrate": True, "law": "external", "names": ["mv", "s"], "bounds": [[0, 1], [0, 1e10]]}
NO_TRUTH = {"source": "synthetic", "synthetic": {"parameters": {}}}
TRUE_SOIL = {"source": "synthetic", "synthetic": {"parameters": {"soil": [0.2, 1.0]}}}


def test_unquoted_placeholders_are_what_was_meant(tmp_path: Path) -> None:
    text = "simulator: {kind: command, command: [sim, {input}, {soil.mv}, a], output: {file: i.npy, scale: db}}"
    (tmp_path / "a.yaml").write_text(text)
    case = load([tmp_path / "a.yaml"])
    assert case.simulator.command == ["sim", "{input}", "{soil.mv}", "a"]
    # what a job gets is what the workflow read
    assert Case.of_sections(case.sections("simulator")).simulator == case.simulator


def test_parameters_of_an_external_law() -> None:
    case = case_from({"simulator": COMMAND, "materials": {"soil": SOIL, "lake": {"law": "external"}},
                      "measurement": NO_TRUTH})  # fmt: skip
    soil, lake = case.materials["soil"], case.materials["lake"]
    assert (soil.parameter_names, soil.parameter_units, soil.start_parameters) == (("mv", "s"), ("", ""), [0.5, 5e9])
    assert (lake.parameter_names, lake.parameter_units, lake.start_parameters) == ((), (), [])
    assert Case.of_sections(case.sections("materials")).materials == case.materials
    assert (case.laws["soil"].names, case.laws["soil"].units) == (("mv", "s"), ("", ""))
    assert case.at_start == case
    with pytest.raises(ConfigError, match=r"parameters \['mv', 's'\] has no curve"):
        case.laws["soil"](0.5, [0.1, 1.0])


def test_laws_of_several_kinds_beside_an_external_one() -> None:
    materials = {
        "soil": SOIL | {"units": ["m3/m3", "cm"]},
        "field": {"calibrate": True, **TABLE},
        "lake": {"law": "constant_gamma", "parameters": [-12]},
    }
    case = case_from({"simulator": COMMAND, "materials": materials, "measurement": NO_TRUTH})
    assert case.materials["soil"].parameter_units == ("m3/m3", "cm")
    assert case.materials["field"].parameter_names == ("sigma0_20deg", "sigma0_40deg", "sigma0_60deg")
    assert [name for name, law in case.laws.items() if law.has_curve] == ["field", "lake"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"materials": {"soil": SOIL}, "simulator": {}}, "materials.soil.law is external, which only simulator.kind"),
        ({"materials": {"soil": SOIL | {"bounds": None}}}, "law external needs names and bounds"),
        ({"materials": {"soil": SOIL | {"names": ["mv", "mv"]}}}, "names are .* expected each once"),
        ({"materials": {"soil": SOIL | {"names": ["m v", "s"]}}}, "names: 'm v' is not a letter"),
        ({"materials": {"soil": SOIL | {"units": ["cm"]}}}, "units has 1 entries, names 2"),
        ({"materials": {"soil": SOIL | {"names": ["mv"]}}}, r"bounds has 2 intervals, .* takes 1 \(names: mv\)"),
        ({"materials": {"soil": {"calibrate": True, "names": ["a"]}}}, "names its own parameters"),
        ({"materials": {"soil": SOIL | {"angles_deg": [20, 40]}}}, "law 'external' has no knots"),
        ({"materials": {"soil": SOIL | {"law": "external", "start": [0.5]}}}, r"start has 1 numbers, .*names: mv, s"),
        (
            {"materials": {"soil": SOIL | {"start": {"law": "external", "parameters": [0.5, 1]}}}},
            r"materials\.soil\.start: law is 'external', which is no law to start with",
        ),
        (
            {"materials": {"soil": SOIL | {"start": {"law": "mangia", "parameters": X}}}, "measurement": TRUE_SOIL},
            r"materials\.soil\.start is of law 'mangia', .* expected a list of 2 numbers for law 'external'",
        ),
        ({"materials": {"soil": SOIL}, "measurement": {"synthetic": {"parameters": {"soil": [1]}}}}, "names: mv, s"),
        ({"simulator": COMMAND | {"output": {"file": "../i.npy", "scale": "db"}}}, r"simulator\.output\.file: .*own f"),
        ({"simulator": COMMAND | {"files": ["a/i.npy"]}}, r"files\.0 and output\.file are both 'i\.npy'"),
        ({"simulator": COMMAND | {"version": "1", "version_command": ["a"]}}, "version and version_command are both"),
        ({"simulator": COMMAND | {"output": {"file": "i", "scale": "db", "format": "raw"}}}, "expected dtype"),
        ({"simulator": COMMAND | {"output": {"file": "i", "scale": "db", "dtype": "uint8"}}}, "files of format: raw"),
        ({"simulator": {"kind": "command", "output": COMMAND["output"]}}, r"simulator\.command is missing"),
        ({"simulator": COMMAND | {"timeout": 3}}, r"unknown key simulator\.timeout \(did you mean 'timeout_s'\?\)"),
        (
            {"simulator": COMMAND | {"templates": [{"tempalte": "a"}]}},
            r"templates\.0\.tempalte \(did you mean 'template'",
        ),
        ({"simulator": {"kind": "comand"}}, r"simulator\.kind is 'comand', expected 'builtin', 'command'"),
    ],
)
def test_wrong_external_simulators_end_in_a_sentence(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        case_from({"simulator": COMMAND, "materials": {"soil": SOIL}, "measurement": NO_TRUTH} | changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"objective": "entropy"}, r"objective is 'entropy', expected 'classes', 'density' or 'likelihood'"),
        (
            {"objective": "density", "target": {"incidence_classes": 4}},
            r"target\.incidence_classes is 4, .* expected objective: classes",
        ),
        (
            {"objective": "classes", "target": {"normalisation": "image"}},
            r"target\.normalisation is image, .* expected normalisation none or offset",
        ),
        (
            {"validation": {}, "target": {"normalisation": "image"}},
            r"validation is asked for and target\.normalisation is image, .* expected normalisation none or offset",
        ),
        ({"validation": {"rows": 20, "means": 3}}, r"means is 3, expected a divisor of rows \(20\)"),
        ({"validation": {"keep": "all"}}, r"validation\.keep is 'all', expected 'even', 'odd' or 'both'"),
        ({"validation": {"row": 20}}, r"unknown key validation\.row \(did you mean 'rows'"),
        (
            {"target": {"incidence_classes": 0}},
            r"target\.incidence_classes is 0, expected greater than or equal to 1\.",
        ),
        ({"design": {"size": "many"}}, r"design\.size is 'many', expected"),
        ({"target": {"looks": 3}}, r"target\.looks is 3, expected 'free' or 'nominal'"),
        ({"target": {"incidence_error_deg": -1}}, r"target\.incidence_error_deg is -1, expected"),
    ],
)
def test_wrong_objectives_end_in_a_sentence(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        case_from(changes)
    assert "\n" not in str(caught.value)


def test_where_there_can_be_no_classes_the_density_is_minimised() -> None:
    assert case_from({"target": {"incidence_classes": 1}}).objective == "density"
    assert case_from({"target": {"normalisation": "image"}}).objective == "density"
    external = {"simulator": COMMAND, "materials": {"soil": SOIL}, "measurement": NO_TRUTH}
    assert case_from(external).objective == "density"
    assert case_from({"target": {"incidence_classes": 5}}).objective == "classes"


def test_an_external_law_has_no_classes() -> None:
    soil = {"calibrate": True, "law": "external", "names": ["a"], "bounds": [[0, 1]], "start": [0.5]}
    case = {"simulator": COMMAND, "materials": {"soil": soil}, "measurement": NO_TRUTH}
    case_from(case)
    for changes in ({"objective": "classes"}, {"validation": {}}):
        with pytest.raises(ConfigError, match=r"materials\.soil\.law is external, whose curve only the simulator"):
            case_from(case | changes)


def outside(materials: dict[str, Any], **sections: Any) -> dict[str, Any]:
    """Plain data of a case of an external program."""
    return {
        "simulator": {"kind": "command", "command": ["sh"], "output": {"file": "i.npy", "scale": "db"}},
        "materials": {"soil": {"calibrate": True, "law": "external", "names": ["a", "n"], **materials}},
        "measurement": {"source": "file", "path": "m.tif", "scale": "db"},
        **sections,
    }


WHOLE = {"bounds": [[0.5, 9], [1, 12]], "integer": ["n"]}


def test_whole_parameters() -> None:
    soil = case_from(outside(WHOLE)).materials["soil"]
    assert soil.integers == (False, True)
    # the middle of 1 to 12 is none: the next
    assert soil.start_parameters == [4.75, 7.0]
    assert soil.handed([2.5, 3.0]) == {"a": 2.5, "n": 3}
    assert [type(x) for x in soil.handed([2.0, 3.0]).values()] == [float, int]
    with pytest.raises(ValueError, match=r"^X: n is 3\.5, expected a whole number"):
        soil.handed([2.5, 3.5])
    assert case_from(outside({"bounds": [[0, 9], [1, 12]], "integer": True})).materials["soil"].integers == (True, True)
    water = {"law": "external", "names": ["n"], "integer": True, "parameters": [3]}
    data = outside(WHOLE)
    data["materials"]["water"] = water
    assert case_from(data).materials["water"].handed([3.0]) == {"n": 3}


@pytest.mark.parametrize(
    ("materials", "sections", "words"),
    [
        ({"bounds": [[0, 9], [1, 12.5]]}, {}, "bounds: n is 12.5, expected a whole number within +-2^53: it is int"),
        ({"start": [1, 2.5]}, {}, "start: n is 2.5, expected a whole number"),
        ({"bounds": [[0, 9], [1, 1e17]]}, {}, "bounds: n is 1e+17, expected a whole number within +-2^53"),
        ({"integer": ["m"]}, {}, "integer: no parameter 'm'"),
        ({"integer": 3}, {}, "materials.soil.integer is 3, expected a valid boolean"),
        ({"bounds": [[0, 3], [1, 4]], "integer": True}, {},
         "design.size is 16, expected less than 16: so many combinations of whole parameters"),
        ({}, {"measurement": {"synthetic": {"parameters": {"soil": [1, 2.5]}}}},
         "measurement.synthetic.parameters.soil: n is 2.5, expected a whole number"),
        ({"law": "mangia", "names": None, "bounds": [[0, 1]] * 4}, {}, "integer is for parameters of law: external"),
    ],
)  # fmt: skip
def test_what_is_not_whole_is_refused(materials: dict[str, Any], sections: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        case_from(outside({**WHOLE, **materials}, **sections))
    assert words in str(caught.value)


def test_another_program_ends_at_the_sampling_error_unless_a_tolerance_is_asked_for() -> None:
    assert case_from(outside(WHOLE)).stop.at_sampling_error
    assert case_from(outside(WHOLE, stop={"max_runs": 30})).stop.at_sampling_error
    assert not case_from(outside(WHOLE, stop={"rms": 1e-5})).stop.at_sampling_error
    assert not case_from(outside(WHOLE, stop={"at_sampling_error": False})).stop.at_sampling_error
    assert not case_from({}).stop.at_sampling_error
    for name in ("paper", "paper_small"):
        assert not load([Path(__file__).parents[1] / f"config/{name}.yaml"]).stop.at_sampling_error
