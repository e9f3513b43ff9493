"""STANAG 4607 files, read by the library of the format."""

from datetime import timedelta

import numpy as np
import pytest
from sarkit import wgs84
from stanag4607 import (
    ContextualStreamDecoder,
    DwellSegment,
    JobDefinitionSegment,
    MissionSegment,
    validate_dwell,
    validate_job_definition,
    validate_mission,
)

from radcal.gmti.detection import Report
from radcal.gmti.stanag import write_stanag
from radcal.signals.places import site_of
from radcal.signals.platform import collection
from radcal.simulators.forward import Forward

PLACES = np.array([[60.0, 20.0, 4.0], [70.0, -31.0, -2.0]])  # along the track, from the middle, above the mean


def written(build_case, scene, path, source="builtin", **signals):
    case = build_case(
        radar={"altitude_m": 3000.0, "look_side": "left"},
        signals={"origin": [-33.5, 200.0 - 360.0], "start_utc": "2026-05-01T23:59:59Z", **signals},
    )
    # the built-in scene has no heading of its own
    radars = [case.radar.model_copy(update={"heading_deg": 250.0})]
    case = case.model_copy(update={"radars": radars, "scene": case.scene.model_copy(update={"source": source})})
    made = Forward(case, scene, None, None, "key", 1, False, None)
    one = collection(case, scene)
    # the radar looks to the left: ground range grows to the west
    half, mean = 0.5 * scene.material.shape[1] * scene.cell_m, scene.elevation_m.mean()
    reports = [
        Report(half - across, along, mean + up, 3000.0, speed, 0.9, 1, 1)
        for (along, across, up), speed in zip(PLACES.tolist(), (6.5, -3.21), strict=True)
    ]
    antennas = {1: np.array([40.0, 0.0, 3000.0]), 2: np.array([140.0, 0.0, 3000.0])}
    return write_stanag(path, made, one, reports, antennas), made, one


def read(path):
    decoder = ContextualStreamDecoder()
    found = [*decoder.feed(path.read_bytes()), *(decoder.finish() or [])]
    return found, [each.event.value for each in found]


def test_the_library_reads_places_times_and_velocities_without_an_issue(build_case, scene, tmp_path):
    (path,), made, one = written(build_case, scene, tmp_path / "gmti.4607")
    events, values = read(path)
    mission, job, first, last = values
    assert [type(each) for each in values] == [MissionSegment, JobDefinitionSegment, DwellSegment, DwellSegment]
    assert [*validate_mission(mission), *validate_job_definition(job)] == []
    assert [*validate_dwell(first), *validate_dwell(last)] == []
    assert [issue for each in events for issue in getattr(each.event, "issues", ())] == []
    site = site_of(made.case, made.scene, one)
    place = site.ecf(PLACES + np.array([0.0, one.reference_m[0, 1], scene.elevation_m.mean()]))
    found = [
        (
            float(t.high_resolution_latitude.degrees),
            float(t.high_resolution_longitude.degrees),
            t.geodetic_height_meters,
        )
        for t in first.targets
    ]
    np.testing.assert_allclose(
        wgs84.geodetic_to_cartesian(np.array(found)), place, atol=0.6
    )  # heights are whole metres
    # positive away from the radar
    speeds = [t.radial_velocity_centimeters_per_second for t in first.targets]
    assert speeds == [-650, 321]
    wrap = first.targets[0].wrap_velocity_centimeters_per_second / 100.0
    assert wrap == pytest.approx(0.5 * one.wavelength_m * 2000.0, abs=0.005)
    seconds = (40.0 - one.track_m[0, 0]) / one.speed_mps
    assert first.dwell_time_milliseconds == pytest.approx(1e3 * (86_399.0 + seconds), abs=1.0)  # runs past midnight
    times = [each.dwell_time_utc for each in events[2:]]
    assert ([each.day for each in times], times[1] - times[0]) == ([1, 2], timedelta(seconds=1))
    assert (first.last_dwell, last.last_dwell, last.target_report_count) == (0, 1, 0)
    assert float(first.sensor_track.degrees) == pytest.approx(250.0, abs=0.01)
    sensor = [first.sensor_latitude.degrees, first.sensor_longitude.degrees, first.sensor_altitude_centimeters / 100]
    ecf = wgs84.geodetic_to_cartesian(np.array([float(each) for each in sensor]))
    np.testing.assert_allclose(ecf, site.ecf(np.array([[40.0, 0.0, 3000.0]]))[0], atol=0.1)


def test_without_a_place_a_finding_says_why(build_case, scene, tmp_path):
    (found,), _, _ = written(build_case, scene, tmp_path / "gmti.4607", source="raster", origin=None)
    assert found.numbers["why"].startswith("signals.origin is missing")
    assert list(tmp_path.iterdir()) == []
