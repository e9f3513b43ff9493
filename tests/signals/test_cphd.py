"""CPHD files: checker of their standard, and what another reader can make of them."""

from dataclasses import replace

import numpy as np
import pytest
from sarkit import cphd
from sarkit.verification import CphdConsistency
from signals_samples import errors_of

from radcal.errors import ConfigError
from radcal.signals.cphd import check_iq, write_cphd, write_iq
from radcal.signals.history import converted, echoes
from radcal.signals.platform import LIGHT_MPS, collection
from radcal.signals.scatterers import Scatterers


def read(path):
    with path.open("rb") as file, cphd.Reader(file) as reader:
        return reader.metadata.xmltree, *reader.read_channel("HH")


@pytest.mark.parametrize(
    ("signals", "side", "odd"),
    [
        ({}, "right", 1),
        ({"bits": 8, "motion_m": 0.12}, "left", 0),
        ({"bits": 12, "motion_m": 0.3}, "right", 1),
        ({"mode": "spotlight", "squint_deg": 10.0}, "left", 0),
        ({"squint_deg": -20.0}, "right", 1),
    ],
)
def test_the_checker_finds_no_error_and_the_file_has_the_signal(forward_of, tmp_path, signals, side, odd):
    made = forward_of(signals=signals, radar={"look_side": side, "heading_deg": 0.0, "looks": 1})
    (path,) = write_iq(tmp_path / "iq", made)
    with path.open("rb") as file:
        assert errors_of(CphdConsistency.from_file(file, thorough=True)) == {}
    tree, signal, vectors = read(path)
    if signal.dtype.names:
        signal = signal["real"].astype(float) + 1j * signal["imag"]
    one = collection(made.case, made.scene)
    assert signal.shape == (len(one.track_m), one.samples)
    assert one.samples % 2 == odd  # with and without a frequency in the middle
    assert np.unique(vectors["AmpSF"]).size == (1 if one.bits is None else len(vectors))
    # at its middle time a place is seen in the middle of the band, or all places are, where the beam follows one
    helper, place = cphd.XmlHelper(tree), np.array([40.0, -60.0]) * (one.spot_m is None)
    plane = "{*}SceneCoordinates/{*}ReferenceSurface/{*}Planar/{*}"
    axes = np.array([helper.load(plane + axis) for axis in ("uIAX", "uIAY")])
    corner = helper.load("{*}SceneCoordinates/{*}IARP/{*}ECF") + place @ axes
    poly = helper.load("{*}Dwell/{*}CODTime/{*}CODTimePoly")
    pulse = np.polynomial.polynomial.polyval2d(*place, poly) * one.prf_hz
    line = corner - vectors["TxPos"][round(pulse)]
    along = vectors["TxVel"].mean(axis=0)
    sine = line @ along / np.linalg.norm(line) / np.linalg.norm(along)
    assert sine == pytest.approx(one.middle_sine, abs=0.02 * one.sines + one.speed_mps / one.prf_hz / one.range_m)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_point_is_focused_at_its_place_on_the_earth_from_the_file_alone(forward_of, tmp_path, side):
    """Matched filter in earth-centred coordinates, at the place by the directions of north, east and up there."""
    from sarkit import wgs84

    origin = (48.2, 11.4)
    made = forward_of(
        radar={"look_side": side, "heading_deg": 0.0, "looks": 1},
        signals={"motion_m": 0.4, "origin": list(origin), "start_utc": "2026-05-01T10:00:00Z"},
    )
    one = replace(collection(made.case, made.scene), bits=12)
    place = one.reference_m[0] + [0.0, 30.0, 7.0]
    place[0] = 80.0
    point = Scatterers(place[None], np.array([2.0 - 1.0j], np.complex64))
    signal = echoes(one, point, 0, len(one.track_m))
    write_cphd(tmp_path / "point.cphd", made, one, signal)
    tree, numbers, vectors = read(tmp_path / "point.cphd")
    assert tree.findtext("{*}Global/{*}Timeline/{*}CollectionStart").startswith("2026-05-01T10:00:00")
    stored = (numbers["real"].astype(float) + 1j * numbers["imag"]) * vectors["AmpSF"][:, None]
    np.testing.assert_allclose(stored, converted(signal, 12), atol=1e-5)
    llh = np.array([*origin, made.scene.elevation_m.mean()])
    to_the_right = wgs84.east(llh) if side == "right" else -wgs84.east(llh)
    away = place - [0.5 * 200.0, one.reference_m[0, 1], llh[2]]
    ecf = wgs84.geodetic_to_cartesian(llh) + away @ np.stack([wgs84.north(llh), to_the_right, wgs84.up(llh)])
    frequency = vectors["SC0"][:, None] + np.arange(one.samples) * vectors["SCSS"][:, None]
    delay = 2.0 * (
        np.linalg.norm(vectors["TxPos"] - ecf, axis=1) - np.linalg.norm(vectors["TxPos"] - vectors["SRPPos"], axis=1)
    )
    matched = (stored * np.exp(2j * np.pi * frequency * delay[:, None] / LIGHT_MPS)).sum(axis=1)
    seen = np.abs(signal).mean(axis=1) > 0.3
    assert seen.sum() > 12
    np.testing.assert_allclose(np.degrees(np.angle(matched[seen] / (2.0 - 1.0j))), 0.0, atol=0.5)
    azimuth = 2.0 * np.sum((vectors["TxPos"] - ecf) * vectors["TxVel"], axis=1)
    assert np.argmin(np.abs(azimuth)) == pytest.approx(np.argmin(np.abs(one.track_m[:, 0] - 80.0)), abs=1)


def test_a_scene_without_a_map_needs_place_and_date(forward_of):
    made = forward_of()
    raster = made.case.scene.model_copy(update={"source": "raster"})
    mapped = replace(made.scene, crs="EPSG:32632", transform=(5.0, 0.0, 500_000.0, 0.0, 5.0, 5_000_000.0))

    def check(scene=made.scene, **keys):
        signals = made.case.signals.model_copy(update=keys)
        check_iq(made.case.model_copy(update={"scene": raster, "signals": signals}), scene)

    with pytest.raises(ConfigError, match=r"signals\.origin is missing, expected latitude and longitude"):
        check()
    with pytest.raises(ConfigError, match=r"signals\.start_utc is missing, expected the date and time"):
        check(origin=(45.0, 7.0))
    check(mapped, start_utc="2026-05-01T10:00:00Z")


@pytest.mark.parametrize("wrong", ["yesterday", "2026-13-01T10:00:00Z", "2026-05-01T10:00:00"])
def test_a_date_that_is_none_is_told(forward_of, wrong):
    with pytest.raises(ConfigError, match=r"signals\.start_utc.* is '.*', expected date and time in UTC, as 2026"):
        forward_of(signals={"start_utc": wrong})
