"""Echoes of movers in several channels, and their detection in a scene."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gmti_samples import GMTI, SPEED, movers
from pyproj import Proj
from variants import agrees

from radcal.errors import ConfigError
from radcal.gmti.channels import dwells, interval_of, movers_of
from radcal.gmti.detection import trained
from radcal.gmti.product import check, write
from radcal.signals.platform import collection
from radcal.simulators.forward import Forward


@pytest.fixture
def moving(scene):
    """One drives west towards the radar, one stands."""
    return replace(scene, objects=movers([120.0, 60.0], [110.0, 60.0], [270.0, 0.0], [SPEED, 0.0]))


@pytest.fixture
def case(build_case):
    return build_case(gmti=GMTI)


def test_echoes_of_a_mover_are_its_steering_vector(case, moving):
    one = collection(case, moving)
    interval, mover = interval_of(case, one), movers_of(case, moving)
    assert len(mover.amplitude) == 1
    (place,) = one.of_grid(mover.after(0.0))
    dwell = min(
        dwells(case, moving, one, mover, 1), key=lambda each: abs(place[0] - each.antenna_m[0] - 0.002 * one.range_m)
    )
    line = place - dwell.antenna_m
    slant = np.linalg.norm(line)
    # towards the radar, which sees it at an incidence of about 45 degrees
    sine, velocity = line[0] / slant, SPEED * place[1] / slant
    gate = int(np.argmin(np.abs(dwell.range_m - slant)))
    found = dwell.movers[:, gate]

    def alike(u, v):
        vector = interval.steering(u, v)[:, 0]
        return abs(np.vdot(vector, found)) / np.linalg.norm(vector) / np.linalg.norm(found)

    assert alike(sine, velocity) > 0.999
    assert max(alike(-sine, velocity), alike(sine, -velocity), alike(sine, velocity / 2)) < 0.9
    # the peak lies up to half a gate beside the mover
    assert 20.0 * np.log10(np.abs(found[0])) == pytest.approx(25.0, abs=3.0)


def test_a_scene_to_the_left_is_mirrored(build_case, moving):
    right, left = (build_case(gmti=GMTI, radar={"altitude_m": 1000.0, "look_side": side}) for side in ("right", "left"))
    for case, sign in ((right, 1.0), (left, -1.0)):
        one, mover = collection(case, moving), movers_of(case, moving)
        first, later = (one.of_grid(mover.after(seconds))[0] for seconds in (0.0, 2.0))
        assert first[:2] - one.reference_m[0, :2] * [0.0, 1.0] == pytest.approx([110.0, sign * 20.0])
        np.testing.assert_allclose(later - first, [0.0, -sign * 2.0 * SPEED, 0.0], atol=1e-9)


def test_training_gates_are_every_second_one_around_a_gate():
    rng = np.random.default_rng(1)
    echoes = rng.standard_normal((3, 60)) + 1j * rng.standard_normal((3, 60))
    for gate, used in (
        (31, [21, 23, 25, 27, 35, 37, 39, 41]),
        (1, [5, 7, 9, 11, 13, 15, 17, 19, 21]),
        (58, [38, 40, 42, 44, 46, 48, 50, 52, 54]),
    ):
        right = sum(np.outer(echoes[:, k], echoes[:, k].conj()) for k in used)
        agrees(
            np.abs(trained(echoes, 8)[gate]),
            np.abs(right),
            with_itself=np.abs(right + np.outer(*2 * [echoes[:, gate]])),
        )


def test_movers_are_found_and_reported(case, moving, tmp_path):
    """In a scene of cells of 5 m whose grid is turned on the map."""
    place = {"crs": "EPSG:32632", "transform": (3.0, 4.0, 600_000.0, -4.0, 3.0, 5_200_000.0)}
    made = Forward(case, replace(moving, **place), None, None, "key", 1, False, None)
    check(case, moving)
    geojson, picture, found, packets = write(tmp_path / "gmti", made)
    assert packets.name == "gmti.4607"
    assert (geojson.name, picture.name) == ("gmti.geojson", "gmti.png")
    assert (found.numbers["movers"], found.numbers["movers_in_reports"]) == (1.0, 1.0)
    assert found.numbers["alarms"] < 1e-2
    assert 0.0 < found.numbers["least_mps"] < 8.0
    features = json.loads(geojson.read_text())["features"]
    best = max((one["properties"] for one in features), key=lambda one: one["eta"])
    assert best["east_m"] == pytest.approx(120.0, abs=6.0)
    assert best["velocity_mps"] == pytest.approx(SPEED * np.sqrt(0.5), abs=1.5)
    best = max(features, key=lambda one: one["properties"]["eta"])
    assert best["geometry"]["type"] == "Point"
    east, north = (best["properties"][key] / 5.0 for key in ("east_m", "north_m"))
    x, y = Proj("EPSG:32632")(*best["geometry"]["coordinates"])
    assert (x - 600_000.0, y - 5_200_000.0) == pytest.approx(
        (3.0 * east + 4.0 * north, 3.0 * north - 4.0 * east), abs=1e-3
    )


def test_displaced_phase_centres_cancel_the_ground_where_they_meet(build_case, moving, tmp_path):
    """Receivers two ways apart; else the echoes of two places are as unlike as their differences are strong."""
    left = []
    for number, spacing in enumerate((2.0 * 100.0 / 2000.0, 4.0)):
        radar = {"altitude_m": 1000.0, "nesz_db": -70.0}
        case = build_case(gmti=GMTI | {"spacing_m": spacing}, radar=radar)
        made = Forward(case, moving, None, None, "key", 1, False, None)
        geojson, _, found, _ = write(tmp_path / f"gmti{number}", made)
        left.append(found.numbers["dpca_db"])
        geometries = [one["geometry"] for one in json.loads(geojson.read_text())["features"]]
        assert geometries
        assert all(one is None for one in geometries)  # the scene is on no map
    assert left[0] < -25.0
    assert left[1] == pytest.approx(10.0 * np.log10(2.0), abs=1.5)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"prf_hz": 200}, "gmti.prf_hz is 200, below the band of the beam from null to null, expected at least 2"),
        ({"prf_hz": 2_000_000}, "gmti.prf_hz is 2e+06: the swath of"),
        ({"pulses": 128, "channels": 8}, "training gates: choose fewer gmti.channels or gmti.pulses"),
    ],
)
def test_contradictions_with_the_swath(build_case, scene, keys, says):
    with pytest.raises(ConfigError) as caught:
        check(build_case(gmti=GMTI | keys), scene)
    assert says in str(caught.value)


def test_too_few_training_gates(build_case):
    with pytest.raises(ConfigError, match=r"gmti: training_gates is 20, expected at least 96: 2 x channels x pulses"):
        build_case(gmti={"training_gates": 20})


def test_routes_that_leave_the_scene(build_case, moving):
    """From 120 m east, at 9 m/s to the west: 12 s stay inside, 15 s do not."""
    check(build_case(gmti=GMTI | {"scans": 5, "revisit_s": 3.0}), moving)
    with pytest.raises(ConfigError, match=r"gmti.scans is 6: 1 of 1 movers leave the scene within 15 s"):
        check(build_case(gmti=GMTI | {"scans": 6, "revisit_s": 3.0}), moving)
