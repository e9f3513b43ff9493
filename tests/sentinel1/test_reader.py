"""Sentinel-1 products: radiometry, noise and acquisition against the functions that their tables were written from."""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from affine import Affine
from pyproj import Transformer
from safe_product import LINES, NAME, PIXELS, STEM, digital_numbers, divisor, noise, place_of, write_product

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.image.acquisition import contradictions, differences, look_azimuth_deg, radar_section
from radcal.image.base import Grid
from radcal.radar.projection import make_geometry
from radcal.reading.intake import parse_xml
from radcal.scene.model import Scene
from radcal.sentinel1.annotation import noise_of
from radcal.sentinel1.overpass import open_product, overpass_of, overpass_unchecked
from radcal.sentinel1.reader import Sentinel1Reader

UTM = "EPSG:32633"
CELL_M, SIDE, HEIGHT_M = 20.0, 30, 120.0
PASS = {
    "altitude_m": 693_000, "depression_deg": 53.4, "look_side": "left", "band": "C", "polarisation": "VV",
    "range_resolution_m": 11.0, "azimuth_resolution_m": 22.0, "range_spacing_m": 6.3, "azimuth_spacing_m": 10.0,
    "looks": 4, "nesz_db": -30.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def safe(tmp_path_factory):
    return write_product(tmp_path_factory.mktemp("product"))


def config(path, **keys):
    return FileMeasurement.model_validate({"path": str(path), **keys})


def scene(line=60.0, pixel=50.0):
    """Level ground around what a pixel shows, at a height on the ellipsoid."""
    x, y = Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(*place_of(line, pixel, HEIGHT_M))
    corner = 0.5 * SIDE * CELL_M
    crops, level = np.ones((SIDE, SIDE), np.uint8), np.full((SIDE, SIDE), HEIGHT_M)
    place = {"crs": UTM, "transform": tuple(Affine(CELL_M, 0, x - corner, 0, CELL_M, y - corner))[:6]}
    return Scene("level", ("crops",), crops, level, CELL_M, vertical_datum="WGS 84 ellipsoid", **place)


def opened(safe, **keys):
    radar = Radar.model_validate({key: value for key, value in {**PASS, **keys}.items() if value is not None})
    return open_product(safe, config(safe), radar), radar


def acquisition_at(safe, line=60.0, pixel=50.0, **changed):
    """Acquisition over level ground around what a pixel shows."""
    product, radar = opened(safe)
    ground = scene(line, pixel)
    return overpass_of(replace(product, **changed), ground, make_geometry(ground, radar).ground).acquisition


def test_sigma0_follows_from_the_tables(safe):
    """At positions that ``test_geolocation.py`` compares with places that were solved for."""
    power, acquisition, findings = taken(safe)
    product, radar = opened(safe)
    ground = scene()
    shown = np.isfinite(power)
    assert shown.sum() > 1000
    row, column = make_geometry(ground, radar).ground[:, shown].astype(float) + 0.5
    x, y = ground.transform[2] + CELL_M * column, ground.transform[5] + CELL_M * row
    places = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True).transform(x, y)
    position = np.array(product.annotation.ground.positions(*places, np.full(shown.sum(), HEIGHT_M)))
    line, pixel = np.round(position).astype(int)
    expected = (digital_numbers()[line, pixel] / divisor(line, pixel)) ** 2
    sure = (np.abs(position % 1 - 0.5) > 0.01).all(axis=0)  # not between two pixels
    np.testing.assert_allclose(power[shown][sure], expected[sure], rtol=1e-6)
    assert acquisition.product == NAME
    assert "noise_subtracted" not in [one.code for one in findings]
    facts = Sentinel1Reader(safe, config(safe), radar).facts()
    assert (facts.on_map, facts.radiometry) == (True, "sigma0_ref")


def test_noise_of_early_processors_has_one_table():
    vector = "<noiseVector><line>{}</line><pixel>0 10</pixel><noiseLut>{}</noiseLut></noiseVector>"
    text = f"<noise><noiseVectorList>{vector.format(0, '4 8')}{vector.format(100, '6 20')}</noiseVectorList></noise>"
    found = noise_of(parse_xml(text.encode())).at(np.array([0.0, 25.0, 300.0]), np.array([5.0, 2.5, 40.0]))
    np.testing.assert_allclose(found, [6.0, 0.75 * 5.0 + 0.25 * 9.5, 20.0])


def test_acquisition_is_read_from_the_annotation(safe):
    found = acquisition_at(safe, 70.0, 30.0)
    assert (found.sensor, found.polarisation, found.pass_direction) == ("S1B IW GRD", "VV", "descending")
    assert found.frequency_hz == 5.405e9
    assert (found.look_side, found.looks, found.numbers_of_looks) == ("right", 4.4, (5, 1))
    assert (found.range_spacing_m, found.azimuth_spacing_m) == (10.0, 9.7)
    # without a window the response is that of sinc, 0.8859 / B wide
    assert found.range_resolution_m == pytest.approx(299_792_458.0 / 2 / 14.1e6 * measured_width(0.7), rel=3e-3)
    assert found.azimuth_resolution_m == pytest.approx(9.7 / 1.4965e-3 / 327.0 * 0.8859, rel=1e-3)
    line, pixel = 70.0, np.array([0.0, 60.0])
    levels = 10 * np.log10(noise(line, pixel) / divisor(line, pixel) ** 2)
    assert levels[1] < levels[0] - 1.0
    angles, table = np.array(found.nesz_db).T
    assert (np.diff(angles) > 0).all()
    assert table[0] == pytest.approx(levels[0], abs=0.05)
    assert angles[0] < found.incidence_deg < angles[-1]
    second = acquisition_at(safe, 70.0, 75.0)
    assert second.range_resolution_m / found.range_resolution_m == pytest.approx(14.1 / 12.1)  # the other swath
    assert second.incidence_deg > found.incidence_deg


def test_noise_is_told_at_the_incidence_of_the_scenes_own_height(safe):
    """The geolocation grid has other heights, 10 m a pixel."""
    product, _ = opened(safe)
    found = acquisition_at(safe, 70.0, 85.0)
    angles, levels = np.array(found.nesz_db).T
    at = np.linspace(0.0, 99.0, 100)
    places = np.array([place_of(70.0, pixel, HEIGHT_M) for pixel in at]).T
    own = product.annotation.ground.look(*places, np.full(100, HEIGHT_M)).incidence_deg
    there = at[np.argmin(np.abs(own - found.incidence_deg))]
    expected = 10 * np.log10(noise(70.0, there) / divisor(70.0, there) ** 2)
    assert np.interp(found.incidence_deg, angles, levels) == pytest.approx(expected, abs=0.05)


def test_looks_of_other_modes_are_multiplied(safe):
    annotation = opened(safe)[0].annotation
    swaths = tuple(
        replace(one, range=replace(one.range, looks=6), azimuth=replace(one.azimuth, looks=3))
        for one in annotation.swaths
    )
    found = acquisition_at(safe, annotation=replace(annotation, mode="EW", swaths=swaths))
    assert (found.looks, found.numbers_of_looks) == (18.0, (6, 3))


def test_heights_above_the_geoid_are_raised_by_it(safe, monkeypatch):
    product, radar = opened(safe)
    ground = scene()
    geometry = make_geometry(ground, radar)
    higher = replace(ground, elevation_m=ground.elevation_m + 45.0)
    expected = overpass_of(product, higher, geometry.ground)
    monkeypatch.setattr("radcal.sentinel1.overpass.geoid_m", lambda *_: 45.0)
    found = overpass_of(product, replace(ground, vertical_datum="EGM2008 height"), geometry.ground)
    np.testing.assert_allclose(found.pixel, expected.pixel, atol=1e-6)
    assert found.findings == ()


def test_heights_between_the_centres_of_cells_are_interpolated(safe):
    """A plane that rises by 6 m a row and falls by 2.5 m a column."""
    product, _ = opened(safe)
    level = scene()
    row, column = np.indices((SIDE, SIDE))
    tilted = replace(level, elevation_m=HEIGHT_M + 6.0 * row - 2.5 * column)
    at = np.array([[12.3, 14.5, 17.8], [15.25, 11.9, 18.4]])[..., None]
    found = overpass_of(product, tilted, at.astype(np.float32))
    x, y = (level.transform[k] + CELL_M * (at[j] + 0.5) for k, j in ((2, 1), (5, 0)))
    places = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True).transform(x, y)
    expected = product.annotation.ground.positions(*places, HEIGHT_M + 6.0 * at[0] - 2.5 * at[1])
    np.testing.assert_allclose((found.line, found.pixel), expected, atol=0.01)


def test_a_product_tells_its_pass_whatever_the_polarisation_of_the_case(safe):
    for polarisation in ("HH", "VV"):
        found = overpass_unchecked(safe, config(safe), Radar(polarisation=polarisation), scene())
        assert found.acquisition.polarisation == "VV"


def measured_width(coefficient):
    """-3 dB width of a window's response, from its spectrum."""
    spectrum = np.zeros(1 << 20)
    frequency = np.linspace(-0.5, 0.5, 1024, endpoint=False)
    spectrum[:1024] = coefficient + (1 - coefficient) * np.cos(2 * np.pi * frequency)
    power = np.abs(np.fft.fft(spectrum)) ** 2
    return 2.0 * float(np.argmax(power < 0.5 * power[0])) * 1024 / (1 << 20)


def test_the_printed_section_is_one_of_radar(safe):
    acquisition = acquisition_at(safe)
    section = radar_section(acquisition)
    printed = Radar.model_validate(yaml.safe_load(section)["radar"])
    assert printed.incidence_deg == pytest.approx(acquisition.incidence_deg, abs=0.005)
    # not that below the satellite, 193.7
    assert printed.heading_deg == pytest.approx(acquisition.heading_deg, abs=0.005)
    assert abs(printed.heading_deg - 193.7) > 2.0
    assert printed.range_spacing_m == pytest.approx(10.0 * np.sin(np.radians(acquisition.incidence_deg)), rel=1e-3)
    assert (printed.looks, printed.band, printed.polarisation, printed.look_side) == (4.4, "C", "VV", "right")
    acquisition = replace(acquisition, azimuth_resolution_m=21.3)
    assert "look_side: right   # to 2" in section
    # on slopes of 60 degrees, a look that is wrong by a degree is a contradiction
    assert contradictions(acquisition, printed, np.full(3, printed.incidence_deg), 60.0) == []
    assert differences(acquisition, printed) == []
    assert printed.nesz_db == list(acquisition.nesz_db)
    assert "heading_deg: 0 " in radar_section(replace(acquisition, heading_deg=359.998))
    denoised = radar_section(replace(acquisition, noise_removed=True))
    assert Radar.model_validate(yaml.safe_load(denoised)["radar"]).nesz_db == -100.0


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"polarisation": "HH"}, "cannot be read as a Sentinel-1 product (it has VV, radar.polarisation is HH)."),
        ({"polarisation": "VH"}, f"(manifest.safe lists {STEM[:10]}-vh-"),
        ({"band": "X"}, f"{NAME} contradicts section radar: radar.band is X, its carrier 5.405 GHz (band C)."),
        ({"frequency_ghz": 5.3}, "radar.frequency_ghz is 5.3, its carrier 5.405 GHz (band C)."),
        ({"looks": 2}, "radar.looks is 2, its equivalent number of looks 4.4."),
        ({"depression_deg": 45.0}, "radar.depression_deg is 45, an incidence of 45.0"),
        ({"incidence_deg": 39.0, "depression_deg": None}, "radar.incidence_deg is 39, an incidence of 39.0"),
        ({"look_side": "right"}, "radar.look_side is right, a look to 90 deg from north, it looks to 2"),
    ],
)
def test_contradictions_are_refused(safe, keys, words):
    with pytest.raises(MeasurementError, match=re.escape(words)):
        taken(safe, **keys)


def taken(safe, ground=None, **keys):
    """Power, acquisition and findings of a product."""
    product, radar = opened(safe, **keys)
    ground = ground or scene()
    read = Sentinel1Reader(product.path, config(safe), radar).read(Grid(make_geometry(ground, radar), ground))
    acquisition = overpass_of(product, ground, make_geometry(ground, radar).ground).acquisition
    return 10.0 ** (read.image_db.astype(float) / 10.0), acquisition, read.findings


def test_differences_are_said(safe):
    _, acquisition, findings = taken(safe, nesz_db=-22.0, range_resolution_m=5.0)
    found = {one.code: one.numbers for one in findings}
    radar = Radar.model_validate(PASS)
    along = replace(acquisition, heading_deg=176.0)  # within 5 degrees of a look to the west
    assert not any(one.code == "look_direction" for one in differences(along, radar))
    turned = {one.code: one.numbers for one in differences(replace(acquisition, heading_deg=199.5), radar)}
    assert turned["look_direction"] == {"look_deg": 289.5, "heading_deg": 199.5, "configured_deg": 270.0}
    noise = found["noise_differs"]
    assert noise["configured_db"] == pytest.approx(-22.0)
    assert 30.0 < noise["angle_deg"] < 40.0
    assert noise["nesz_db"] < -10.0
    (width,) = (one.numbers for one in findings if one.numbers.get("key") == "range_resolution_m")
    assert width["configured_m"] == 5.0
    assert 11.0 <= width["own_m"] < 12.0


def test_another_heading_contradicts_where_the_ground_is_steep(safe):
    level = scene()
    relief = np.random.default_rng(5).normal(0.0, 4.0, level.material.shape).cumsum(axis=0).cumsum(axis=1) * 0.2
    hills = replace(level, elevation_m=level.elevation_m + relief)
    found = acquisition_at(safe)
    apart = (look_azimuth_deg(found) - 270.0 + 180.0) % 360.0 - 180.0
    with pytest.raises(MeasurementError, match=r"radar\.heading_deg is 0, a look to 270\.0 deg from north") as refused:
        taken(safe, hills)
    said = re.search(r"on slopes of (\d+\.\d) deg, as the scene has them, by up to (\d+\.\d) deg", str(refused.value))
    east, north = (np.diff(hills.elevation_m, axis=axis)[:29, :29] / CELL_M for axis in (1, 0))
    steep = np.degrees(np.arctan(np.quantile(np.hypot(east, north), 0.95)))
    assert float(said[1]) == pytest.approx(steep, abs=0.06)
    turn, tilt = np.radians(abs(apart)), np.radians(steep)
    assert float(said[2]) == pytest.approx(np.degrees(tilt) * 2 * np.sin(turn / 2), abs=0.06)
    assert f"(look_side: right, heading_deg: {found.heading_deg:.2f})" in str(refused.value)


ANNOTATION, CALIBRATION = f"annotation/{STEM}.xml", f"annotation/calibration/calibration-{STEM}.xml"
PIXELS_FILE = f"measurement/{STEM}.tiff"


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("manifest.safe", None, "", "it has no manifest.safe, expected the whole folder"),
        (CALIBRATION, None, "", f"manifest.safe lists calibration-{STEM}.xml, which is missing"),
        (PIXELS_FILE, None, "", f"manifest.safe lists {STEM}.tiff, which is missing"),
        (ANNOTATION, "<geolocationGrid>.*</geolocationGrid>", "", "product (it has no geolocationGrid/"),
        (ANNOTATION, "<orbitList>.*</orbitList>", "", "it has no generalAnnotation/orbitList"),
        (ANNOTATION, "<productType>GRD", "<productType>SLC", "is SLC, expected a ground-range product"),
        (ANNOTATION, "<sr0>850000.0", "<sr0>850900.0", "orbit and geolocation grid of"),
        (ANNOTATION, "<polarisation>VV", "<polarisation>HH", "is of polarisation HH, its name says VV"),
        (CALIBRATION, "<sigmaNought>", "<sigmaNought>x ", "its sigmaNought is 'x "),
        (CALIBRATION, "<sigmaNought>", "<sigmaNought>1 ", "sigmaNought at"),
        (CALIBRATION, "<pixel>0 25 ", "<pixel>0 0 ", "expected ascending pixels"),
        ("manifest.safe", r"\./annotation", "../annotation", "expected a file of the folder"),
    ],
)
def test_damaged_products_are_refused(tmp_path, file, old, new, words):
    safe = write_product(tmp_path)
    if old is None:
        (safe / file).unlink()
    else:
        text = (safe / file).read_text()
        changed = re.sub(old, new, text, flags=re.DOTALL)
        assert changed != text
        (safe / file).write_text(changed)
    with pytest.raises(MeasurementError, match=re.escape(words)):
        taken(safe)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros((LINES, PIXELS), np.uint16), "holds no data (digital number 0) over the scene: the image is blank"),
        (np.full((LINES, PIXELS), 7, np.uint16), "holds the digital number 7 alone over the scene: the image is blank"),
        (np.ones((LINES, 50), np.uint16), f"it has {LINES} x 50 pixels, its annotation {LINES} x {PIXELS}"),
    ],
)
def test_blank_images_are_refused(tmp_path, values, words):
    with pytest.raises(MeasurementError, match=re.escape(words)):
        taken(write_product(tmp_path, values))


def test_pixels_without_data_are_nan(tmp_path):
    values = digital_numbers()
    values[:, 55:60] = 0
    power, *_ = taken(write_product(tmp_path, values))
    whole, *_ = taken(write_product(tmp_path / "whole"))
    assert 0.05 < np.isnan(power[np.isfinite(whole)]).mean() < 0.3


def test_noise_that_the_processor_removed_is_said(tmp_path):
    _, acquisition, findings = taken(write_product(tmp_path, noise_removed="true"))
    assert acquisition.noise_removed
    assert "noise_subtracted" in [one.code for one in findings]


def test_heights_above_a_geoid_without_a_grid_are_said(safe):
    product, radar = opened(safe)
    ground = replace(scene(), vertical_datum="EGM2008 height")
    (found,) = overpass_of(product, ground, make_geometry(ground, radar).ground).findings
    assert (found.code, found.numbers["datum"]) == ("geoid_unknown", "EGM2008 height")
    assert found.numbers["m_per_m"] == pytest.approx(1.35, abs=0.05)


def test_a_scene_elsewhere_or_off_the_map_is_refused(safe):
    product, radar = opened(safe)
    ground = scene()
    away = replace(ground, transform=(CELL_M, 0.0, ground.transform[2] + 50_000.0, 0.0, CELL_M, ground.transform[5]))
    geometry = make_geometry(ground, radar)
    with pytest.raises(MeasurementError, match=r"covers no place of the scene's image, which lies around \d\d\.\d+"):
        overpass_of(product, away, geometry.ground)
    with pytest.raises(MeasurementError, match=r"expected scene\.source: raster"):
        overpass_of(product, replace(ground, crs=None), geometry.ground)


@pytest.mark.skipif("RADCAL_DATA" not in os.environ, reason="RADCAL_DATA is not set: real data are elsewhere")
def test_a_real_product_is_read_and_its_blank_image_refused():
    real = Path(os.environ["RADCAL_DATA"]) / "sentinel1" / NAME
    product, radar = opened(real, depression_deg=45.9)
    x, y = Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(12.5, 42.0)
    ground = replace(scene(), transform=(CELL_M, 0.0, x, 0.0, CELL_M, y))
    found = overpass_of(product, ground, make_geometry(ground, radar).ground).acquisition
    assert (found.heading_deg, found.incidence_deg) == pytest.approx((189.3, 44.1), abs=0.1)
    assert found.looks == 4.4
    # table 5-1 of the Sentinel-1 Product Definition gives 20.5 m in ground range for IW3
    assert found.range_resolution_m / np.sin(np.radians(found.incidence_deg)) == pytest.approx(20.5, abs=0.6)
    assert all(-31.0 < level < -29.0 for _, level in found.nesz_db)
    with pytest.raises(MeasurementError, match=r"the image is blank, and only its annotation could be read \(S1B_IW"):
        taken(real, ground, depression_deg=45.9)
