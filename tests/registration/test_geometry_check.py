"""Depression, relief and place against lines, slopes and shifts that are known."""

from dataclasses import replace

import numpy as np
import pytest
from registration_samples import RADAR, hills, registered_by
from scipy.ndimage import gaussian_filter

from radcal.config import Radar, RegistrationConfig
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.model import Measurement
from radcal.measurement.synthetic import smooth_warp
from radcal.radar.projection import make_geometry
from radcal.registration.displacement import warp
from radcal.registration.geometry_check import checked, depression, place, range_line, relief
from radcal.registration.registered import register

FEET = 3.28084


@pytest.fixture(scope="module")
def seen(build_scene):
    """Fields of two materials, in no order, on hills."""
    blobs = gaussian_filter(np.random.default_rng(8).standard_normal((220, 220)), 14, mode="wrap")
    fields = np.where(blobs > 0.0, 1, 2).astype(np.uint8)
    rough = hills((220, 220), 4.0)  # in feet such slopes are still free of layover
    scene = build_scene(lambda *_: rough * FEET, cells=(220, 220), names=("dyke", "grass"), material=fields)
    return make_geometry(scene, RADAR)


def image_of(geometry, angle, db_per_deg, seed=2, dyke=-6.0):
    """Sixteen looks, a level of each material and a slope over an angle."""
    speckle = 10.0 * np.log10(np.random.default_rng(seed).gamma(16.0, 1.0 / 16.0, geometry.shape))
    return (speckle + dyke * (geometry.material == 1) + db_per_deg * (angle - 45.0)).astype(np.float32)


def by_line(geometry, slope, noise_px=0.0, applied=True):
    field = np.zeros((2, *geometry.shape))
    if noise_px:
        field += smooth_warp(geometry.shape, noise_px, np.random.default_rng(4))
    field[0] += slope * (np.arange(geometry.shape[0]) - 30.0)[:, None]
    if applied:
        return registered_by(field)
    return registered_by(0.0 * field, applied=False, refused_px=field.astype(np.float32))


def test_line_is_that_of_most_columns_with_its_share_of_the_variance():
    row = np.arange(120.0) - 59.5
    wave = np.tile(np.where(np.arange(90) % 2, 1.5, -1.5), (120, 1))
    field = np.stack([0.031 * row[:, None] + 2.0 + wave, 9.0 * wave]).astype(np.float32)
    field[0][:, :8] = 40.0  # a few columns elsewhere
    slope, _ = range_line(field)
    assert slope == pytest.approx(0.031, rel=1e-4)
    slope, share = range_line(field[:, :, 8:])
    line = 0.031**2 * (120**2 - 1) / 12.0
    assert (slope, share) == pytest.approx((0.031, line / (line + 1.5**2)), rel=1e-4)
    assert range_line(np.zeros_like(field)) == (0.0, 0.0)


@pytest.mark.parametrize("applied", [True, False])
@pytest.mark.parametrize(
    ("flown", "severity"), [(40.0, "refusal"), (49.1, "refusal"), (43.0, "warning"), (46.3, "warning"), (44.0, None)]
)
def test_a_line_names_the_depression_flown(seen, flown, severity, applied):
    slope = np.cos(np.radians(flown)) / np.cos(np.radians(45.0)) - 1.0
    found = depression(by_line(seen, slope, applied=applied), seen, RADAR)
    if severity is None:
        assert found == []
        return
    (one,) = found
    assert (one.code, one.severity, one.about) == ("depression", severity, "a.tif")
    assert one.numbers["implied_deg"] == pytest.approx(flown, abs=0.01)
    assert one.numbers["px_per_100_rows"] == pytest.approx(100.0 * slope, rel=1e-3)
    assert one.numbers["off_percent"] == pytest.approx(abs(100.0 * slope), rel=1e-3)
    assert one.do == f"radar.depression_deg: {flown:.1f}"


@pytest.mark.parametrize("key", ["incidence_deg", "depression_deg"])
def test_over_a_curved_earth_the_incidence_counts(seen, key):
    radar = Radar(**{"altitude_m": 700_000.0, "earth": "curved", key: 39.0})
    radius = 1.0 + 700_000.0 / 6_371_008.8
    declared, flown = np.radians([39.0, 45.0])
    ratio = np.sin(flown) / np.sin(declared)
    if key == "depression_deg":  # law of sines
        ratio = radius * np.cos(flown) / (radius * np.cos(declared))
    (one,) = depression(by_line(seen, ratio - 1.0), seen, radar)
    assert one.numbers["implied_deg"] == pytest.approx(45.0, abs=0.01)
    assert one.do == f"radar.{key}: 45.0"


def test_noise_and_short_lines_name_no_angle(seen):
    assert depression(by_line(seen, 0.0, noise_px=2.0), seen, RADAR) == []
    slope = np.cos(np.radians(43.0)) / np.cos(np.radians(45.0)) - 1.0
    assert depression(by_line(seen, slope, noise_px=2.0), seen, RADAR) == []  # explains less than 80 %
    assert [one.code for one in depression(by_line(seen, slope, noise_px=0.3), seen, RADAR)] == ["depression"]
    # at low depression, a fifth of a pixel would already be an angle
    low = RADAR.model_copy(update={"depression_deg": 8.0})
    assert depression(by_line(seen, 0.4 * np.sqrt(12.0) / seen.shape[0]), seen, low) == []
    assert depression(by_line(seen, 0.6 * np.sqrt(12.0) / seen.shape[0]), seen, low) != []
    # rows of a scene in slant range are not projected
    labels = replace(seen, ground=np.full_like(seen.ground, np.nan))
    assert depression(by_line(seen, 2.0 * slope), labels, RADAR) == []


def test_without_a_registration_geometry_is_unchecked(seen):
    alone = replace(by_line(seen, 0.0), applied=False, method="none")
    numbers = {"key": "radar.depression_deg", "declared_deg": 45.0}
    assert depression(alone, seen, RADAR) == [Finding("geometry_unchecked", "note", "a.tif", numbers)]


def test_the_registration_of_an_image_from_another_depression_shows_it(seen):
    """An image that lies as if it was flown at 47 degrees, where the radar has 45."""
    line = by_line(seen, np.cos(np.radians(47.0)) / np.cos(np.radians(45.0)) - 1.0).displacement_px
    simulated, flown = (image_of(seen, seen.incidence_deg, -0.22, seed) for seed in (2, 3))
    image = Measurement(warp(flown, -line.astype(np.float64)), "a.tif")
    found = checked(register(simulated, image, RegistrationConfig()), simulated, seen, RADAR, 0.0).findings
    assert [(one.code, one.severity) for one in found] == [("depression", "warning")]
    assert found[0].numbers["implied_deg"] == pytest.approx(47.0, abs=0.3)


def test_heights_in_feet_are_refused(seen):
    """The true slope is the scene's over 3.28, along range; across it is neglected."""
    flat = seen.flat_incidence_deg[:, None]
    true = flat - np.degrees(np.arctan(np.tan(np.radians(flat - seen.incidence_deg)) / FEET))
    simulated = image_of(seen, seen.incidence_deg, -0.22)
    (one,) = relief(image_of(seen, true, -0.22, 3), simulated, seen, RADAR, "a.tif", 0.0)
    assert (one.code, one.severity, one.about, one.do) == ("relief", "refusal", "a.tif", "scene.elevation")
    assert one.numbers["of_simulated"] == pytest.approx(1.0 / FEET, abs=0.05)
    assert one.numbers["db_per_deg"] == pytest.approx(-0.22 / FEET, rel=0.15)
    # slopes of the elevation that are mostly errors make every image look flat
    assert relief(image_of(seen, true, -0.22, 3), simulated, seen, RADAR, "a.tif", 30.0) == []


@pytest.mark.parametrize(
    ("measured", "simulated", "refused"),
    [
        (-0.22, -0.22, False),
        (-0.12, -0.22, False),
        (-0.04, -0.22, True),
        (-0.04, -0.05, False),  # the starting law is as flat
        (-0.20, -0.60, False),  # the starting law is too steep, the image is as ground usually is
        (-0.60, -0.22, True),
        (-0.60, -0.40, False),
        (-0.25, -0.05, False),  # the starting law is too flat
    ],
)
def test_only_slopes_far_from_both_the_simulated_and_constant_gamma_are_refused(seen, measured, simulated, refused):
    angle = seen.incidence_deg
    images = image_of(seen, angle, measured, 3), image_of(seen, angle, simulated)
    assert bool(relief(*images, seen, RADAR, "a.tif", 0.0)) == refused


def test_an_image_of_another_place_is_refused(seen):
    angle = seen.incidence_deg
    simulated = image_of(seen, angle, -0.22)
    assert place(image_of(seen, angle, -0.3, 3), simulated, seen, "a.tif") == []
    for shift in ((60, 0), (-72, 55), (0, 100)):
        (one,) = place(np.roll(image_of(seen, angle, -0.22, 3), shift, (0, 1)), simulated, seen, "a.tif")
        assert (one.code, one.severity, one.about, one.do) == ("place", "refusal", "a.tif", "measurement.path")
        assert one.numbers["correlation"] < 0.6 < one.numbers["shifted"]
    noise = np.random.default_rng(11).normal(0.0, 3.0, seen.shape).astype(np.float32)
    assert place(noise, simulated, seen, "a.tif") != []


def test_what_a_start_gets_wrong_is_no_other_place(seen):
    """With a wrong order of brightness, the materials lie where the scene has them."""
    angle = seen.incidence_deg
    measured = image_of(seen, angle, -0.22, 3)
    measured[:60, :90] = np.nan
    assert place(measured, image_of(seen, angle, -0.22, dyke=6.0), seen, "a.tif") == []


def test_where_an_image_shows_no_place(seen):
    simulated, noise = image_of(seen, seen.incidence_deg, -0.22), image_of(seen, seen.incidence_deg, 0.0, dyke=0.0)
    shifted = np.roll(simulated, (70, 60), (0, 1))
    assert place(shifted, simulated, seen, "a.tif") != []
    assert place(shifted, noise, seen, "a.tif") == []  # no contrast
    small = replace(seen, material=seen.material[:119, :120])
    assert place(shifted[:119, :120], simulated[:119, :120], small, "a.tif") == []  # too few shifts
    assert place(np.full_like(shifted, np.nan), simulated, seen, "a.tif") == []


def test_relief_and_place_are_judged_where_the_image_was_found_to_lie(seen):
    """Moved by 70 rows, and the registration refused as too far."""
    simulated = image_of(seen, seen.incidence_deg, -0.22)
    found = by_line(seen, 0.0, applied=False)
    field = np.zeros((2, *seen.shape), np.float32)
    field[0] = 70.0
    lies = warp(image_of(seen, seen.incidence_deg, -0.22, 3), -field.astype(np.float64))
    found = replace(found, unregistered_db=lies, refused_px=field)
    assert checked(found, simulated, seen, RADAR, 0.0).findings == ()
    unsought = replace(found, refused_px=None, method="none")
    codes = [one.code for one in checked(unsought, simulated, seen, RADAR, 0.0).findings]
    assert codes == ["geometry_unchecked", "place"]


def test_a_refusal_ends_the_case(seen):
    simulated = image_of(seen, seen.incidence_deg, -0.22)
    slope = np.cos(np.radians(40.0)) / np.cos(np.radians(45.0)) - 1.0
    flown = replace(by_line(seen, slope, applied=False), unregistered_db=simulated)
    said = r"registration: a\.tif .* \+8\.3 pixels per 100 rows .* 8\.3 %: set radar\.depression_deg: 40\.0\.$"
    with pytest.raises(MeasurementError, match=said):
        checked(flown, simulated, seen, RADAR, 0.0)
