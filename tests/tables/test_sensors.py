"""Values of known sensors: complete, and overridden by the case."""

import contextlib
import math
from typing import get_args

import pytest
from config_samples import mapped, measured

from radcal.config import Radar, case_from
from radcal.errors import ConfigError
from radcal.tables.landcover import LandCover, landcovers
from radcal.tables.sensors import SensorName, sensors

GRD = {"sensor": "sentinel1_iw_grdh", "incidence_deg": 37.0, "polarisation": "VV", "nesz_db": -23.5}
EXAMPLES = {
    "altitude_m": 525e3, "incidence_deg": 33.0, "look_side": "left", "polarisation": "HV", "nesz_db": -21.0,
    "range_resolution_m": 2.1, "azimuth_resolution_m": 3.3, "range_spacing_m": 0.9, "azimuth_spacing_m": 1.6,
    "looks": 1.7,
}  # fmt: skip


def test_lengths_in_ground_range_become_lengths_in_slant_range():
    radar = Radar(**GRD)
    sine = math.sin(math.radians(37.0))
    assert (radar.range_resolution_m, radar.range_spacing_m) == pytest.approx((20.0 * sine, 10.0 * sine))
    assert (radar.azimuth_resolution_m, radar.azimuth_spacing_m) == (22.0, 10.0)
    assert (radar.looks, radar.altitude_m, radar.earth, radar.band, radar.frequency_ghz) == (
        4.4, 693e3, "curved", "C", 5.405,
    )  # fmt: skip


def test_every_name_that_a_case_may_give_is_in_the_table():
    assert tuple(sensors()) == get_args(SensorName)
    assert tuple(landcovers()) == get_args(LandCover)


def test_the_case_overrides_every_value():
    given = {"altitude_m": 700e3, "look_side": "left", "range_spacing_m": 5.0, "looks": 4, "azimuth_resolution_m": 25.0}
    radar = Radar(**GRD, **given)
    assert {key: getattr(radar, key) for key in given} == given
    assert radar.range_resolution_m == pytest.approx(20.0 * math.sin(math.radians(37.0)))


@pytest.mark.parametrize("name", sensors())
def test_what_is_asked_for_and_what_is_given_are_a_whole_pass(name):
    sensor = sensors()[name]
    radar = Radar(sensor=name, **{key: EXAMPLES[key] for key in sensor.asks})
    assert Radar.model_validate(radar.model_dump(mode="json")) == radar
    assert "sensor" not in radar.described()
    known = {*sensor.values, *sensor.asks, "frequency_ghz", "sensor", "depression_deg", "earth", "heading_deg",
             "radiometry"}  # fmt: skip
    assert known >= set(Radar.model_fields)  # no default of another sensor is taken in silence
    assert not sensor.values.keys() & set(sensor.asks)
    for key in sensor.asks:
        rest = {other: EXAMPLES[other] for other in sensor.asks if other != key}
        with pytest.raises(ConfigError, match=f"radar: {key} is missing, which sensor {name} does not give"):
            case_from({"radar": {"sensor": name, **rest}})


@pytest.mark.parametrize("value", [math.inf, math.nan, -1e9, 10**400, "x", None, [], True, 1e-300])
@pytest.mark.parametrize("key", ["incidence_deg", "depression_deg", "altitude_m", "earth"])
def test_wild_values_beside_a_sensor_end_in_a_sentence(key, value):
    for name, more in (("sentinel1_iw_grdh", GRD), ("capella_strip_slc", {**EXAMPLES, "earth": "curved"})):
        angle = {} if key == "incidence_deg" else {"incidence_deg": None, "depression_deg": 50.0, "earth": "curved"}
        with contextlib.suppress(ConfigError):
            case_from({"radar": {**more, **angle, "sensor": name, key: value}})


def test_a_satellite_over_a_map_needs_its_heading():
    scene = mapped()["scene"]
    with pytest.raises(ConfigError, match="radar.heading_deg is missing: the track of sensor sentinel1_iw_grdh does"):
        case_from({"scene": scene, "radar": GRD})
    for heading in (0, 192.5):
        case = case_from({"scene": scene, "radar": {**GRD, "heading_deg": heading}})
        assert case_from(case.model_dump(mode="json")) == case
    with pytest.raises(ConfigError, match=r"scene.objects.path is given, whose positions are not turned"):
        case_from({"scene": {**scene, "objects": {"path": "d.csv"}}, "radar": {**GRD, "heading_deg": 192.5}})
    image = measured(path="d.tif")["measurement"]
    both = [{**GRD, "heading_deg": 192.5}, {**GRD, "heading_deg": 348.0}]
    with pytest.raises(ConfigError, match="heading_deg are 192.5, 348, expected the same .* for each heading"):
        case_from({"scene": scene, "radar": both, "measurement": [image, image]})


def test_a_pass_without_the_later_keys_is_described_as_before():
    later = {"sensor", "incidence_deg", "earth", "heading_deg"}
    for radar in (Radar(), Radar(heading_deg=0.0, earth="flat", looks=4.0)):
        assert not later & radar.model_dump(mode="json").keys()
        assert radar.described() == Radar().model_dump(mode="json")
        assert repr(radar.described()["looks"]) == "4"
    orbit = Radar(altitude_m=7e5, incidence_deg=30.0, heading_deg=192.0)
    assert orbit.described() | {"incidence_deg": 30.0, "earth": "curved", "heading_deg": 192.0} == orbit.described()
    assert "depression_deg" not in orbit.described()
