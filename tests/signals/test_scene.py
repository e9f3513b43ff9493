"""Raw signals and focused images of a small scene against the fast image and its geometry."""

import json
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest
from commands import typed
from raster_files import write_raster
from rasterio.transform import from_origin
from waiting import wait_until

from radcal.errors import ConfigError
from radcal.radar.projection import lit_facets
from radcal.radar.reflectivity import law_tables, reflectivity
from radcal.scene.objects import Objects, Walls
from radcal.signals.focus import backprojected, check, focused, write_focused
from radcal.signals.history import RawSignal, signal_of
from radcal.signals.places import image_places
from radcal.signals.platform import collection, nesz
from radcal.signals.scatterers import Scatterers, scatterers
from radcal.simulators.builtin import BuiltinSimulator

GRASS, DYKE = {"law": "constant_gamma", "parameters": [-40.0]}, {"law": "constant_gamma", "start": [-40.0]}


def raw_of(made, one):
    return RawSignal(one, scatterers(made.case, made.scene, made.seed, one.facet_m), made.seed)[:]


@pytest.mark.parametrize("side", ["right", "left"])
def test_power_of_the_scatterers_is_that_of_the_fast_image(forward_of, side):
    """In the image's rows and columns, summed over the two halves of the scene."""
    made = forward_of(radar={"look_side": side})
    radar, geometry = made.case.radar, made.geometry
    one = collection(made.case, made.scene)
    found = scatterers(made.case, made.scene, made.seed, one.facet_m)
    again = scatterers(made.case, made.scene, made.seed, one.facet_m)
    np.testing.assert_array_equal(found.amplitude, again.amplitude)
    assert np.all(np.diff(found.place_m[:, 0]) >= 0.0)
    first = image_places(made)[0, 0]
    near = np.hypot(first[1], one.track_m[0, 2] - first[2]) - 0.5 * radar.range_spacing_m
    slant = np.hypot(found.place_m[:, 1], one.track_m[0, 2] - found.place_m[:, 2])
    row, column = (slant - near) / radar.range_spacing_m, found.place_m[:, 0] / radar.azimuth_spacing_m
    tables = law_tables(geometry.names, made.case.laws, made.case.start_parameters)
    expected = reflectivity(geometry, tables).image
    expected *= radar.range_spacing_m * radar.azimuth_spacing_m
    expected /= np.sin(np.radians(geometry.flat_incidence_deg))[:, None]
    half = geometry.shape[0] // 2
    for rows in (slice(0, half), slice(half, geometry.shape[0])):
        inside = (row >= rows.start) & (row < rows.stop) & (column >= 0) & (column < geometry.shape[1])
        power = np.abs(found.amplitude[inside].astype(np.complex128)) ** 2
        assert 10.0 * np.log10(power.sum() / expected[rows].sum()) == pytest.approx(0.0, abs=0.1)


# ground that is dark at 45 degrees, and bright at the 4 degrees at which the double bounce of the wall shows it
GROUND = [-60.0, 0.0, 50.0, 6.0]
BOX = {"length_m": 24.0, "width_m": 8.0, "height_m": 6.0, "heading_deg": 4.0}


@pytest.fixture
def with_box(build_scene, forward_of, monkeypatch):
    """Forward run of a box with roof and walls on level ground, whose facets are computed once for all seeds."""

    def made(wall_db=-100.0, roof_db=-100.0, bounce=False):
        zero, first = np.zeros(1), np.zeros(1, np.int16)
        walls = Walls(first, zero + wall_db, np.array([bounce]), ("grass",))
        box = {name: zero + value for name, value in BOX.items()}
        objects = Objects(zero + 26.0, zero + 20.0, **box, rcs_dbsm=zero * np.nan, aspect=first - 1, walls=walls)
        scene = build_scene(lambda east, north: 0.0 * east, cells=(40, 50), cell_m=1.0, names=("dyke", "grass"))
        found = forward_of(
            replace(scene, objects=objects), radar={"nesz_db": -100.0, "looks": 1},
            materials={
                "dyke": {"calibrate": True, "bounds": [[-70, 0], [0, 9], [0, 60], [0, 9]], "start": GROUND},
                "grass": {"law": "constant_gamma", "parameters": [roof_db]},
            },
            measurement={"synthetic": {"parameters": {"dyke": GROUND}}},
        )  # fmt: skip
        one = collection(found.case, found.scene)
        lit = lit_facets(found.scene, found.case.radar, 1)
        monkeypatch.setattr("radcal.signals.scatterers.lit_facets", lambda *_: lit)
        return found, one, (scatterers(found.case, found.scene, seed, one.facet_m) for seed in range(200))

    return made


@pytest.mark.parametrize(
    ("keys", "expected_m2"),
    [
        # both faces that the radar sees, and the roof at 45 degrees
        ({"wall_db": -5.0}, 10.0**-0.5 * 6.0 * (24.0 + 8.0)),
        ({"roof_db": -7.0}, 10.0**-0.7 * np.cos(np.radians(45.0)) * 24.0 * 8.0),
        (
            {"bounce": True},
            4.0 * 6.0 * 24.0 * np.cos(np.radians(4.0)) * 10.0 ** (-6.0 + 5.0 * np.exp(-6.0 * 0.0698**2)),
        ),
    ],
    ids=["walls", "roof", "bounce"],
)
def test_cross_sections_of_a_box_are_the_closed_form_and_those_of_the_fast_image(with_box, keys, expected_m2):
    made, _, draws = with_box(**keys)
    power = np.mean([np.sum(np.abs(found.amplitude.astype(np.complex128)) ** 2) for found in draws])
    tables = law_tables(made.geometry.names, made.case.laws, made.case.start_parameters)
    area = made.case.radar.range_spacing_m * made.case.radar.azimuth_spacing_m
    fast = reflectivity(made.geometry, tables).image / np.sin(np.radians(made.geometry.flat_incidence_deg))[:, None]
    assert 10.0 * np.log10(power / (fast.sum() * area)) == pytest.approx(0.0, abs=0.1)
    assert 10.0 * np.log10(power / expected_m2) == pytest.approx(0.0, abs=0.15)


def test_focused_rows_of_a_box_are_those_of_the_fast_image(with_box):
    """Layover of wall and roof before the foot, and the double bounce at the foot, summed along the track."""
    made, one, draws = with_box(wall_db=-5.0, roof_db=-3.0, bounce=True)
    total = 0.0
    for found in draws:
        bright = np.abs(found.amplitude) > 1e-2
        some = Scatterers(found.place_m[bright], found.amplitude[bright])
        signal = RawSignal(one, some, 1)[:]
        total = total + np.sum(np.abs(focused(one, signal, made)) ** 2, axis=(0, 2)) / 200.0
    simulator = BuiltinSimulator(made.geometry, made.case.radar, made.case.laws)
    expected = np.sum(10.0 ** (simulator.expected(made.case.start_parameters) / 10.0), axis=1)
    assert 10.0 * np.log10(total.sum() / expected.sum()) == pytest.approx(0.0, abs=0.2)
    np.testing.assert_allclose(total, expected, atol=0.08 * expected.max())


@pytest.mark.parametrize(
    "signals", [{}, {"motion_m": 0.5}, {"mode": "spotlight", "motion_m": 0.3}, {"squint_deg": -20.0}]
)
def test_cross_section_of_an_object_is_that_of_the_focused_image(forward_of, with_point, signals):
    """A point at a height above the ground, on dark ground, also with motion errors, spotlight and squint."""
    made = forward_of(
        with_point(131.0, 92.3, 25.0, 4.0), signals=signals, radar={"nesz_db": -60.0, "looks": 2},
        materials={"dyke": {**DYKE, "calibrate": True, "bounds": [[-50, 0]]}, "grass": GRASS},
    )  # fmt: skip
    one = collection(made.case, made.scene)
    found = scatterers(made.case, made.scene, made.seed, one.facet_m)
    brightest = int(np.abs(found.amplitude).argmax())
    place = found.place_m[brightest]
    assert place[0] == pytest.approx(92.3, abs=1e-6)
    slant = np.hypot(place[1], one.track_m[0, 2] - place[2]) if signals == {} else None
    signal = raw_of(made, one)
    looks = backprojected(one, signal, place[None])[:, 0]
    np.testing.assert_allclose(20.0 * np.log10(np.abs(looks)), 25.0, atol=0.1)
    assert np.abs(np.degrees(np.angle(looks / found.amplitude[brightest]))).max() < 1.0
    if slant is not None:  # where the fast image has it
        first = image_places(made)[0, 0]
        near = np.hypot(first[1], one.track_m[0, 2] - first[2])
        row = (slant - near) / made.case.radar.range_spacing_m
        assert row == pytest.approx(made.geometry.point_row[0], abs=0.01)
        assert place[0] / made.case.radar.azimuth_spacing_m - 0.5 == pytest.approx(made.geometry.point_column[0])


def test_levels_of_the_focused_image_are_those_of_the_fast_image(forward_of, tmp_path):
    """Mean over the pixels of each material and over draws, against the expectation of the fast image."""
    draws = []
    for seed in range(3):
        made = forward_of(seed=seed, radar={"looks": 4, "nesz_db": -25.0})
        one = collection(made.case, made.scene)
        draws.append(focused(one, raw_of(made, one), made))
    power = np.mean(np.abs(draws) ** 2, axis=(0, 1))
    simulator = BuiltinSimulator(made.geometry, made.case.radar, made.case.laws)
    expected = 10.0 ** (simulator.expected(made.case.start_parameters) / 10.0)
    inner = np.zeros(power.shape, dtype=bool)
    inner[8:-8, 8:-8] = True
    for number in (1, 2):
        pixels = inner & (made.geometry.material == number)
        assert pixels.sum() > 500
        level_db = 10.0 * np.log10(power[pixels].mean() / expected[pixels].mean())
        assert level_db == pytest.approx(0.0, abs=0.25)
    paths = write_focused(tmp_path / "focused", made)
    looks = [f"focused_look{number}.nitf" for number in range(1, 5)]  # the built-in scene has a place and a date
    assert sorted(path.name for path in paths) == sorted(["focused.h5", "focused.png", *looks])
    with h5py.File(paths[0]) as file:
        np.testing.assert_array_equal(file["looks"][()], draws[-1])
        assert file.attrs["product"] == "focused"


def test_noise_in_the_middle_of_the_scene_is_the_configured_level(forward_of):
    """By default the power follows from ``radar.nesz_db``; with a power, the noise follows from it."""
    made = forward_of(radar={"nesz_db": -21.0, "radiometry": "beta0"})
    one = collection(made.case, made.scene)
    assert 10.0 * np.log10(nesz(one, one.range_m, 45.0)) == pytest.approx(-21.0, abs=1e-9)
    signals = {"power_w": 50.0, "gain_db": 28.0, "pulse_us": 8.0, "noise_figure_db": 3.0}
    given = collection(forward_of(signals=signals).case, made.scene)
    # peak power of the echo of 1 m2 over thermal noise in the band, and the compression of the pulse
    echo = 50.0 * (10.0**2.8 * one.wavelength_m) ** 2 / ((4.0 * np.pi) ** 3 * one.range_m**4)
    noise = 1.380649e-23 * 290.0 * 10.0**0.3 * one.samples * one.step_hz
    compression = 8e-6 * one.samples * one.step_hz
    assert given.noise_m2 / given.samples == pytest.approx(noise / echo / compression, rel=1e-6)


def test_motion_errors_have_their_rms(forward_of):
    made = forward_of(signals={"motion_m": 0.4, "motion_length_m": 5.0})
    one = collection(made.case, made.scene)
    away = one.track_m[:, 1:] - [0.0, one.track_m[:, 2].mean()]
    assert np.sqrt(np.mean(away**2)) == pytest.approx(0.4, rel=0.25)
    assert np.abs(np.diff(away, axis=0)).max() < 0.1


def test_no_echo_of_the_swath_leaves_the_window_and_no_pulse_folds_into_the_band(forward_of):
    made = forward_of()
    one = collection(made.case, made.scene)
    window = 299_792_458.0 / (2.0 * one.step_hz)
    place = scatterers(made.case, made.scene, 1, one.facet_m).place_m
    slant = np.linalg.norm(place - one.track_m[len(one.track_m) // 2], axis=1)
    assert np.abs(slant - one.range_m).max() < 0.5 * window
    # azimuth frequencies between the edge of the band and the beam's null fold beyond the band
    assert one.prf_hz / one.speed_mps - 2.0 / one.antenna_m >= 0.5 * one.band
    assert one.pattern(np.array([1.01 * one.wavelength_m / one.antenna_m])) == 0.0


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ({"signals": {"prf_hz": 50.0}}, r"signals\.prf_hz is 50, below the band of the beam .* expected at least \d+"),
        ({"signals": {"prf_hz": 2e6}}, r"prf_hz is 2e\+06: the swath of \d+ m .* unambiguous range of 75 m, expected"),
        ({"signals": {"antenna_m": 9.0}}, r"signals\.antenna_m is 9, whose beam is too narrow .* expected at most"),
        ({"signals": {"mode": "spotlight", "antenna_m": 9.0}}, r"antenna_m is 9, .* narrow for the scene, expected at"),
        ({"signals": {"squint_deg": 60.0, "antenna_m": 0.6}}, r"squint_deg is 60: .* most 0\.9"),
        ({"radar": {"incidence_deg": 35.0, "altitude_m": 5e5}}, r"radar\.earth is curved, expected flat"),
        (
            {"radar": {"radiometry": "gamma0_rtc"}},
            r"radar\.radiometry is gamma0_rtc, expected sigma0_ref, ",
        ),
        (
            {"signals": {"focusing": "omega_k", "mode": "spotlight"}},
            r"signals\.mode is spotlight: .*straight track .*, expected backprojection",
        ),
        (
            {"signals": {"focusing": "omega_k", "motion_m": 0.2}},
            r"signals\.motion_m is 0\.2: .*straight track .*, expected backprojection",
        ),
        ({"radar": {"band": "Q"}}, r"radar\.band is 'Q', which names no known band, expected radar\.frequency_ghz"),
    ],
)
def test_a_radar_that_does_not_suit_the_scene_is_told(forward_of, sections, sentence):
    made = forward_of(**sections)
    with pytest.raises(ConfigError, match=sentence):
        check(made.case, made.scene)


def test_a_scene_without_relief_is_refused(forward_of):
    made = forward_of(signals={"motion_m": 1.0})
    with pytest.raises(ConfigError, match=r"scene\.source: the scene has no elevation, expected one"):
        check(made.case, replace(made.scene, elevation_m=None))


def test_a_killed_simulation_continues_and_needs_no_more_memory_for_more_pulses(forward_of, tmp_path, monkeypatch):
    """The second of two blocks ends the first command; the next one simulates only what is missing."""
    made, numbers, block = forward_of(radar={"looks": 2}), [], RawSignal.block
    whole = write_focused(tmp_path / "whole", made)

    def ended(raw, number):
        numbers.append(number)
        if len(numbers) == 2:
            raise KeyboardInterrupt
        return block(raw, number)

    monkeypatch.setattr(RawSignal, "block", ended)
    with pytest.raises(KeyboardInterrupt):
        write_focused(tmp_path / "focused", made)
    (folder,) = tmp_path.glob(".focused-*")
    assert [path.name for path in folder.iterdir()] == [f"pulses-{numbers[0]}.h5"]
    (kept,) = folder.iterdir()
    kept.write_bytes(kept.read_bytes()[:-9])  # damaged: made again
    found = write_focused(tmp_path / "focused", made)
    one = collection(made.case, made.scene)
    assert sorted(numbers) == sorted([*range(-(-len(one.track_m) // 64)), *numbers[:2]])
    with h5py.File(whole[0]) as first, h5py.File(found[0]) as second:
        np.testing.assert_array_equal(first["looks"][()], second["looks"][()])
    assert not list(tmp_path.glob(".*"))
    raw = RawSignal(one, scatterers(made.case, made.scene, made.seed, one.facet_m), made.seed)
    np.testing.assert_array_equal(raw[60:70], raw[:][60:70])


def test_a_killed_command_continues_with_the_run_and_the_pulses_that_it_has(tmp_path, monkeypatch):
    """SIGKILL after three blocks of pulses; the same command typed again simulates the others alone."""
    profile = {"crs": "EPSG:32631", "transform": from_origin(600_000.0, 5_780_000.0, 4.0, 4.0)}
    write_raster(tmp_path / "elevation.tif", np.zeros((48, 48), np.float32), **profile)
    write_raster(tmp_path / "cover.tif", np.ones((48, 48), np.uint8), **profile)
    (tmp_path / "names.json").write_text('{"1": "field"}')
    files = {"elevation": "elevation.tif", "materials": "cover.tif", "names": "names.json"}
    case = {
        "case": "small", "scene": {"source": "raster", "vertical_datum": "EGM2008"},
        "radar": {"altitude_m": 1000.0, "looks": 1}, "materials": {"field": {**GRASS}},
        "signals": {"prf_hz": 5000.0, "start_utc": "2026-05-01T10:00:00Z"},
    }  # fmt: skip
    case["scene"] |= {key: str(tmp_path / name) for key, name in files.items()}
    (tmp_path / "case.yaml").write_text(json.dumps(case))
    words = ["simulate", str(tmp_path / "case.yaml"), "--product", "iq", "--results", str(tmp_path)]
    made, numbers, block = tmp_path / "small/simulated", [], RawSignal.block
    with subprocess.Popen([sys.executable, "-m", "radcal", *words], stdout=subprocess.DEVNULL) as process:
        wait_until(lambda: len(list(made.glob(".iq-*/pulses-*.h5"))) >= 3, process)
        process.kill()
    kept = {path.stem.removeprefix("pulses-") for path in made.glob(".iq-*/pulses-*.h5")}
    assert len(kept) >= 3
    assert not (made / "iq.cphd").exists()
    monkeypatch.setattr(RawSignal, "block", lambda raw, number: numbers.append(number) or block(raw, number))
    assert "was in the run store" in typed(*words).stdout
    assert (made / "iq.cphd").exists()
    assert len(numbers) > 10
    assert kept & set(map(str, numbers)) == set()


def test_the_folder_of_a_killed_simulation_with_other_settings_is_removed(forward_of, tmp_path):
    folders = []
    for bits in (None, 8):
        with pytest.raises(KeyboardInterrupt), signal_of(tmp_path / "iq", forward_of(signals={"bits": bits})) as raw:
            raw[:64]
            folders.append(raw.folder)
            raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == folders[1:]


@pytest.mark.parametrize("product", ["iq", "focused"])
def test_nothing_is_written_before_the_radar_is_checked(tmp_path, product):
    (tmp_path / "case.yaml").write_text("case: wrong\n")
    words = ["simulate", tmp_path / "case.yaml", "--product", product, "--set", "signals.prf_hz=9"]
    said = typed(*words, "--results", tmp_path / "results", code=1).stderr
    assert said.count("\n") == 1
    assert "radcal: signals.prf_hz is 9, below the band" in said
    assert not (tmp_path / "results/wrong/simulated").exists()
