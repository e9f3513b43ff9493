from dataclasses import replace

import numpy as np
import pytest
import rasterio
from raster_files import write_raster

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.base import Grid
from radcal.image.raster import RasterReader
from radcal.measurement.sources import make_measurement
from radcal.measurement.synthetic import smooth_warp
from radcal.radar.projection import make_geometry
from radcal.registration.displacement import invert, warp
from radcal.simulators.builtin import BuiltinSimulator


class NoSimulator:
    """A file needs no simulator."""

    def run(self, parameters, noise_seed):
        raise AssertionError("called")


@pytest.fixture(scope="module")
def file_case(build_case):
    """Tiny case whose measurement is a file."""

    def made(path, scale="db", radiometry="sigma0_local", band=None, **sections):
        file = {"source": "file", "path": str(path), "scale": scale, "radiometry": radiometry, "band": band}
        return build_case(measurement=file, **sections)

    return made


@pytest.fixture
def read(tmp_path, geometry, file_case):
    """Write values as GeoTIFF and read them as the measurement of the tiny case."""

    def read(values, scale="db", **sections):
        path = tmp_path / "measured.tif"
        if values is not None:
            write_raster(path, values)
        return make_measurement(file_case(path, scale, **sections), geometry, NoSimulator())

    return read


@pytest.fixture
def image_db(geometry):
    return np.random.default_rng(1).normal(-12.0, 3.0, geometry.shape).astype(np.float32)


def test_findings_tell_what_is_unusable(read, image_db):
    power = 10 ** (image_db / 10)
    power[0, :6] = [0.0, 0.0, np.nan, -1e-9, np.nan, np.nan]
    none = {"pixels": power.size, "no_data": 3, "zero": 2, "negative": 1, "impossible": 0}
    counts, unknown = Finding("pixels", "note", "measured.tif", none), Finding("looks_unknown", "note", "measured.tif")
    counted, looks, spread, *_ = read(power, "power").findings
    assert counted == counts
    assert (spread.code, spread.severity) == ("resolutions", "note")  # finer: these pixels are not correlated
    # a standard deviation of 3 dB is that of 2.5 looks
    assert looks.numbers["looks"] == pytest.approx(2.5, abs=0.5)
    assert (looks.numbers["side_px"], looks.numbers["declared"]) == (6, 4)
    coarse = {"radiometry": "sigma0_local", "range_resolution_m": 40.0}  # few independent pixels are left
    one, other, spread, *_ = read(power, "power", radar=coarse).findings
    assert [one, other] == [counts, unknown]
    assert (spread.code, spread.severity) == ("resolutions", "warning")  # a cell of far less than 40 m
    amplitude = np.sqrt(10 ** (image_db / 10)).astype(np.complex64)
    single = Finding("looks_single", "note", "measured.tif", {"declared": 4})
    assert read(amplitude, "complex", radar=coarse).findings[1] == single
    assert read(amplitude, "complex", radar={"looks": 1, **coarse}).findings[1] == unknown
    power[::3] = np.nan
    unusual = read(power, "power", radar=coarse).findings[-1]
    assert (unusual.code, unusual.about) == ("resolution_unusual", "radar.range_resolution_m")
    with pytest.raises(MeasurementError, match=r"^radar\.range_resolution_m is 4000: no area of a single material "):
        read(power, "power", radar={**coarse, "range_resolution_m": 4000.0, "range_spacing_m": 5.0})


def test_material_without_a_finite_pixel(read, geometry, image_db):
    image_db.ravel()[geometry.pixels("dyke")] = np.nan
    visible = geometry.pixels("dyke").size
    said = rf"materials\.dyke: all {visible} of its pixels .*\(measured\.tif\) are NaN"
    with pytest.raises(MeasurementError, match=said):
        read(image_db)


def test_material_with_too_few_pixels(read, geometry, image_db):
    pixels = geometry.pixels("dyke", 1)
    image_db.ravel()[pixels[49:]] = np.nan
    with pytest.raises(MeasurementError, match=r"materials\.dyke: 49 usable pixels, expected at least 50") as caught:
        read(image_db)
    whole = geometry.pixels("dyke").size
    for words in (
        f"{whole} visible pixels", f"{pixels.size - 49} without data", f"{whole - pixels.size} near other ground",
        "target.margin_px is 1",
    ):  # fmt: skip
        assert words in str(caught.value)
    image_db.ravel()[pixels[49]] = -12.0
    read(image_db)


@pytest.fixture(scope="module")
def synthetic(geometry, build_case):
    def make(parameters=None, **keys):
        parameters = {"dyke": [6.1, 14.2, 21.5, 3.3]} if parameters is None else parameters
        case = build_case(measurement={"source": "synthetic", "synthetic": {"parameters": parameters, **keys}})
        return make_measurement(case, geometry, BuiltinSimulator(geometry, case.radar, case.laws))

    return make


def test_synthetic_measurement_is_reproducible(synthetic):
    a, b, other = synthetic(), synthetic(), synthetic(seed=3)
    np.testing.assert_array_equal(a.image_db, b.image_db)
    assert np.nanmean(np.abs(a.image_db - other.image_db)) > 1.0
    assert "synthetic" in a.source
    assert a.findings == ()


def test_synthetic_measurement_hides_the_truth(synthetic, geometry):
    truth = synthetic()
    assert truth.hidden == {"dyke": (6.1, 14.2, 21.5, 3.3)}
    brighter = synthetic({"dyke": [11.1, 14.2, 21.5, 3.3]})
    change = (brighter.image_db - truth.image_db).ravel()
    assert np.median(change[geometry.pixels("dyke", 3)]) == pytest.approx(5.0, abs=0.01)
    assert np.median(change[geometry.pixels("grass", 3)]) == pytest.approx(0.0, abs=0.01)
    # without a hidden truth a material keeps its starting parameters
    assert synthetic({}).hidden == {"dyke": (25.0,) * 4}


def test_speckle_of_the_measurement_is_not_that_of_the_runs(synthetic, geometry, case):
    x = {"dyke": [6.1, 14.2, 21.5, 3.3], "grass": [10.0, 14.0, 6.0, 4.0]}
    pixels = geometry.pixels("grass", 3)
    measured = synthetic().image_db.ravel()[pixels]
    for seed in (1, 2):
        run = BuiltinSimulator(geometry, case.radar, case.laws).run(x, seed).ravel()[pixels]
        assert abs(np.corrcoef(measured, run)[0, 1]) < 0.3


@pytest.mark.parametrize("offset_db", [1.5, -30.0])
def test_offset_is_added_exactly(synthetic, offset_db):
    np.testing.assert_array_equal(synthetic(offset_db=offset_db).image_db, synthetic().image_db + np.float32(offset_db))


@pytest.mark.parametrize("rms_px", [0.5, 4.0])
def test_displacement_field_has_the_requested_rms_and_is_smooth(rms_px):
    field = smooth_warp((200, 150), rms_px, np.random.default_rng(0))
    assert field.shape == (2, 200, 150)
    assert np.sqrt((field**2).sum(axis=0).mean()) == pytest.approx(rms_px, rel=1e-9)
    assert max(np.abs(np.diff(field, axis=k)).max() for k in (1, 2)) < 0.05 * rms_px
    assert not np.array_equal(field, smooth_warp((200, 150), rms_px, np.random.default_rng(1)))


def test_the_image_is_displaced_by_the_field_that_is_kept(synthetic):
    moved = synthetic(warp_px=3.0)
    field = moved.misregistration_px.astype(np.float64)
    assert np.sqrt((field**2).sum(axis=0).mean()) == pytest.approx(3.0, rel=1e-5)
    # nearest pixels, of which the field's rounding changes few
    expected = warp(synthetic(warp_px=0.0).image_db, invert(field))
    assert np.mean((moved.image_db == expected) | np.isnan(moved.image_db)) > 0.999
    assert np.mean(np.isnan(moved.image_db)) < 0.2


@pytest.mark.parametrize("look_side", ["right", "left"])
def test_an_image_on_the_map_is_seen_where_its_ground_lies(tmp_path, scene, radar, file_case, look_side):
    on_map = replace(scene, crs="EPSG:32631", transform=(5.0, 0.0, 600_000.0, 0.0, 5.0, 5_780_000.0))
    seen = radar.model_copy(update={"look_side": look_side})
    geometry = make_geometry(on_map, seen)
    # speckle that says where it is, on a level of 1 dB every 10 m to the east
    speckle = 10.0 * np.log10(np.random.default_rng(6).gamma(4.0, 0.25, (220, 220)))
    values = (-20.0 + 0.1 * np.arange(-9.5, 210.0) + speckle).astype(np.float32)
    values[12:19, 12:17] = np.nan
    transform = rasterio.Affine(1.0, 0.0, 600_000.0 - 10.0, 0.0, -1.0, 5_780_000.0 + 210.0)
    path = write_raster(tmp_path / "map.tif", values, crs="EPSG:32631", transform=transform)
    case = file_case(path, radiometry="sigma0_ref", radar={"altitude_m": 1000.0, "look_side": look_side})
    measurement = make_measurement(case, geometry, NoSimulator(), on_map)
    # mean row and column of the facets that fall into each pixel, from the geometry of a plane far enough away
    known = np.isfinite(geometry.ground[0])
    north, east = (5.0 * (place[known] + 0.5) + 10.0 for place in geometry.ground)
    expected = values[np.floor(220.0 - north).astype(int), np.floor(east).astype(int)]
    # places within rounding of the border between two pixels may take either
    assert np.mean(measurement.image_db[known] == expected) > 0.99
    empty = np.count_nonzero(np.isnan(measurement.image_db))
    found = {one.code: one.numbers for one in measurement.findings}
    none = {"zero": 0, "negative": 0, "impossible": 0}
    assert found["pixels_at_ground"] == {"pixels": measurement.image_db.size, "no_data": empty, **none}
    # the scene of 200 m lies 900 to 1100 m from the track of 1000 m
    angle = found["incidence_by_map"]
    assert (angle["key"], angle["declared_deg"]) == ("radar.depression_deg", 45.0)
    assert (angle["from_deg"], angle["to_deg"]) == pytest.approx((42.5, 47.5), abs=0.6)
    pass_38 = Radar(incidence_deg=38.5, altitude_m=700_000.0)
    orbit = RasterReader(path, case.measurement, pass_38)._angle(Grid(geometry, on_map), (on_map.crs, on_map.transform))
    assert (orbit.numbers["key"], orbit.numbers["declared_deg"]) == ("radar.incidence_deg", 38.5)


@pytest.mark.parametrize("name", ["angle", "incidenceAngleFromEllipsoid", "localIncidenceAngle"])
@pytest.mark.parametrize(("turned_deg", "expected"), [(0.9, None), (-9.7, "54.7"), (4.4, "40.6")])
def test_a_band_of_incidence_angles_is_compared(tmp_path, build_scene, file_case, name, turned_deg, expected):
    """Ground that rises by 3 degrees towards the radar's far side, 900 to 1100 m from a track of 1000 m."""
    slope = build_scene(lambda east, _: np.tan(np.radians(3.0)) * east)
    on_map = replace(slope, crs="EPSG:32631", transform=(5.0, 0.0, 6e5, 0.0, 5.0, 5.78e6))
    quiet = {"altitude_m": 1000.0, "nesz_db": -60.0, "polarisation": "VV"}
    materials = {"dyke": {"calibrate": True}}
    case = file_case(tmp_path / "a.tif", radiometry="sigma0_ref", band=1, radar=quiet, materials=materials)
    angle = np.degrees(np.arctan((902.5 + 5.0 * np.arange(40.0)) / 1000.0)) + turned_deg
    angle += -3.0 if name.startswith("local") else 0.0
    speckle = 10.0 * np.log10(np.random.default_rng(6).gamma(4.0, 0.25, (40, 40))) - 12.0
    where = {"crs": "EPSG:32631", "transform": rasterio.Affine(5.0, 0.0, 6e5, 0.0, -5.0, 5.78e6 + 200.0)}
    bands = np.stack([speckle, np.broadcast_to(angle, (40, 40))]).astype(np.float32)
    write_raster(tmp_path / "a.tif", bands, ("VV", name), **where)
    geometry = make_geometry(on_map, case.radar)
    if expected is None:
        findings = make_measurement(case, geometry, NoSimulator(), on_map).findings
        (numbers,) = (one.numbers for one in findings if one.code == "incidence_of_band")
        assert (numbers["band"], numbers["name"]) == (2, name)
        assert numbers["off_deg"] == pytest.approx(-0.9, abs=0.1)
        return
    with pytest.raises(MeasurementError) as caught:
        make_measurement(case, geometry, NoSimulator(), on_map)
    assert str(caught.value) == (
        f"radar.depression_deg is 45, whose incidences differ by {-turned_deg:+.1f} degrees (median) from band 2 "
        f"({name}) of {tmp_path / 'a.tif'}, expected about {expected}."
    )


@pytest.mark.parametrize(("scale", "copied"), [("db", True), ("power", True), ("db", False)])
def test_a_copy_of_the_elevation_is_no_image(tmp_path, scene, radar, file_case, scale, copied):
    """Heights of -12 to -8 m, and an image with these levels in dB whose brightness follows the heights."""
    on_map = replace(scene, crs="EPSG:32631", transform=(5.0, 0.0, 6e5, 0.0, 5.0, 5.78e6))
    low = replace(on_map, elevation_m=scene.elevation_m - 10.0 if scale == "db" else scene.elevation_m + 30.0)
    geometry = make_geometry(low, radar)
    speckle = 10.0 * np.log10(np.random.default_rng(6).gamma(4.0, 0.25, (40, 40)))
    where = {"crs": "EPSG:32631", "transform": rasterio.Affine(5.0, 0.0, 6e5, 0.0, -5.0, 5.78e6 + 200.0)}
    values = (low.elevation_m + (0.0 if copied else speckle))[::-1].astype(np.float32)
    path = write_raster(tmp_path / "copy.tif", values, **where)
    case = file_case(path, scale, radar={"altitude_m": 1000.0, "nesz_db": -60.0, "radiometry": "sigma0_local"})
    if not copied:
        assert np.isfinite(make_measurement(case, geometry, NoSimulator(), low).image_db).any()
        return
    with pytest.raises(
        MeasurementError,
        match=r"^measurement\.path: the values of \S+copy\.tif, \S+ to \S+, are the heights of scene\.elevation in "
        r"metres, expected backscatter: give the file of the measured image\.$",
    ):
        make_measurement(case, geometry, NoSimulator(), low)


def test_an_image_below_the_noise_floor_is_told_before_any_run(read, image_db):
    dark = image_db - 15.0  # at -27 dB
    with pytest.raises(
        MeasurementError,
        match=r"^materials\.dyke: 0 usable pixels.* in the noise.* the image's own level there is -2[67]\.?\d* dB, "
        r"which radar\.nesz_db and target\.snr_db treat as noise: set radar\.nesz_db to ",
    ):
        read(dark, radar={"nesz_db": -24.0, "radiometry": "sigma0_local"})
    read(dark, radar={"nesz_db": -60.0, "radiometry": "sigma0_local"})
    lost = r"nesz_db \(is a minus sign missing\? -24\)"
    for nesz_db, asked in ((24.0, lost), (-5.0, "nesz_db"), ([[0, -5], [80, -5]], "nesz_db")):
        with pytest.raises(MeasurementError, match=rf"^radar\.nesz_db.* above the mean level of .* -2\d.*{asked}, for"):
            read(dark, radar={"nesz_db": nesz_db, "radiometry": "sigma0_local"})
    # at which level the noise lies in an image of unknown level, the reference run says
    read(dark, target={"normalisation": "offset"})
