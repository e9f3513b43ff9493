"""SICD files: checker of their standard, radcal's reader, and what another library makes of them."""

from dataclasses import replace

import numpy as np
import pytest
from raster_files import read_image
from sarkit import wgs84
from sarkit.verification import SicdConsistency
from signals_samples import errors_of

from radcal.config import FileMeasurement
from radcal.radar.radiometry import of_sigma0
from radcal.signals.places import site_of
from radcal.signals.platform import collection
from radcal.signals.sicd import write_sicd


def looks_of(made, count, seed=3):
    rng = np.random.default_rng(seed)
    parts = rng.standard_normal((2, count, *made.geometry.shape)).astype(np.float32)
    return parts[0] + 1j * parts[1] * 0.5


def headed(made, heading):
    """The built-in scene has no heading of its own."""
    radar = made.case.radar.model_copy(update={"heading_deg": heading})
    return replace(made, case=made.case.model_copy(update={"radars": [radar]}))


def sigma0_db(path):
    return read_image(path, FileMeasurement(path=str(path), scale="complex"), None)


@pytest.mark.parametrize(
    ("side", "heading", "radiometry", "apart"),
    [("right", 0.0, "sigma0_ref", False), ("left", 75.0, "beta0", True), ("right", 200.0, "gamma0", True)],
)
def test_the_checker_finds_no_error_and_the_reader_gives_the_image(
    forward_of, tmp_path, side, heading, radiometry, apart
):
    made = headed(forward_of(radar={"look_side": side, "radiometry": radiometry, "looks": 2}), heading)
    looks = looks_of(made, 2)
    paths = write_sicd(tmp_path / "image", made, looks, apart)
    assert [path.name for path in paths] == ["image_look1.nitf", "image_look2.nitf"]
    level = of_sigma0(radiometry, made.geometry.flat_incidence_deg)[:, None]
    for path, look in zip(paths, looks, strict=True):
        with path.open("rb") as file:
            assert errors_of(SicdConsistency.from_file(file)) == {}
        right = 10.0 * np.log10(np.abs(look.astype(np.complex128)) ** 2 / level)
        np.testing.assert_allclose(sigma0_db(path).image_db, right, atol=1e-4)


@pytest.mark.parametrize(("side", "apart"), [("right", True), ("left", False)])
def test_another_library_finds_the_pixels_where_they_are(forward_of, tmp_path, side, apart):
    """Places on the earth of pixels beside the middle, at its height, and the bands of the looks."""
    from sarpy.io.complex import converter as sarpy

    signals = {"origin": [48.2, 11.4], "start_utc": "2026-05-01T10:00:00Z"}
    made = headed(forward_of(radar={"look_side": side, "looks": 2}, signals=signals), 30.0)
    looks = looks_of(made, 2)
    path = write_sicd(tmp_path / "image", made, looks, apart)[1]
    reader = sarpy.open_complex(str(path))
    found, of_look = reader.sicd_meta, looks[1] if side == "right" else looks[1][:, ::-1]
    np.testing.assert_allclose(reader[:, :], of_look, rtol=1e-6)
    assert str(found.Timeline.CollectStart).startswith("2026-05-01T10:00:00")
    assert found.SCPCOA.SideOfTrack == side[0].upper()
    assert found.SCPCOA.DopplerConeAng == pytest.approx(90.0, abs=2.0)
    one = collection(made.case, made.scene)
    site, radar = site_of(made.case, made.scene, one), made.case.radar
    (rows, columns), row, column = made.geometry.shape, found.ImageData.SCPPixel.Row, found.ImageData.SCPPixel.Col
    hae = found.GeoData.SCP.LLH.HAE
    asked = np.array([[row, column], [row + 20, column + 9], [3, columns - 2], [rows - 4, 1]])
    at = found.project_image_to_ground_geo(asked, projection_type="HAE", hae0=hae)
    azimuth = (asked[:, 1] if side == "right" else columns - 1 - asked[:, 1]) + 0.5
    height = made.scene.elevation_m.mean() + one.track_m[0, 2] - one.reference_m[0, 2]
    near = np.cos(np.radians(made.geometry.flat_incidence_deg[0]))
    slant = (one.track_m[0, 2] - one.reference_m[0, 2]) / near + asked[:, 0] * radar.range_spacing_m
    ground = np.sqrt(slant**2 - (height - hae) ** 2)
    place = np.stack([azimuth * radar.azimuth_spacing_m, ground, np.full(4, hae)], axis=1)
    # the plane at the scene's middle and the ellipsoid are the same within millimetres here
    np.testing.assert_allclose(wgs84.geodetic_to_cartesian(at), site.ecf(place), atol=0.05)
    width = one.band / 2
    assert found.Grid.Col.DeltaKCOAPoly.Coefs[0, 0] == pytest.approx(0.5 * width if apart else 0.0)


def test_a_scene_without_a_place_or_without_heights_has_no_file(forward_of, tmp_path):
    made = forward_of(radar={"looks": 1})
    elsewhere = made.case.model_copy(update={"scene": made.case.scene.model_copy(update={"source": "raster"})})
    (found,) = write_sicd(tmp_path / "image", replace(made, case=elsewhere), looks_of(made, 1), False)
    assert found.numbers["why"].startswith("signals.origin is missing")
    flat = replace(made, scene=replace(made.scene, elevation_m=None))
    (found,) = write_sicd(tmp_path / "image", flat, looks_of(made, 1), False)
    assert "has no elevation" in found.numbers["why"]
    assert list(tmp_path.iterdir()) == []
