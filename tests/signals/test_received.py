"""Phase history that no code of radcal has written, focused; and radcal's own files."""

import re

import h5py
import numpy as np
import pytest
from lxml import etree
from sarkit import cphd, wgs84
from sarkit.verification import CphdConsistency
from signals_samples import errors_of

from radcal.errors import ConfigError
from radcal.signals import received
from radcal.signals.cphd import write_iq
from radcal.signals.focus import backprojected
from radcal.signals.places import site_of
from radcal.signals.platform import collection
from radcal.signals.received import read_cphd, write_image
from radcal.signals.scatterers import scatterers

LIGHT = 299_792_458.0
LLH = np.array([-33.2, 151.3, 120.0])
ORIGIN = wgs84.geodetic_to_cartesian(LLH)
EAST, NORTH, UP = wgs84.east(LLH), wgs84.north(LLH), wgs84.up(LLH)
LOW, HIGH = 9.4e9, 9.7e9  # 0.44 m in slant range
POINTS = np.array([[0.0, 0.0, 0.0], [22.0, -14.0, 3.0], [-17.0, 24.0, -2.0]])  # east, north and up [m]
AMPLITUDES = np.array([1.0, 1.5 * np.exp(2.0j), 0.7 * np.exp(-1.0j)])
SPACE = "http://api.nsgreg.nga.mil/schema/cphd/1.1.0"


def collected(pulses=300):
    """Places of transmitter, receiver and middle on an arc that climbs, at the times of the pulses."""
    time = np.linspace(0.0, 3.0, pulses)
    turn = np.radians(200.0) + (time - 1.5) * 0.02
    place = 7000.0 * (np.multiply.outer(np.sin(turn), EAST) + np.multiply.outer(np.cos(turn), NORTH))
    place += ORIGIN + np.multiply.outer(5000.0 + 3.0 * time, UP)
    velocity = np.gradient(place, time, axis=0)
    delay = 2.0 * np.linalg.norm(place - ORIGIN, axis=1) / LIGHT
    return time, delay, velocity, place - 0.5 * velocity * delay[:, None], place + 0.5 * velocity * delay[:, None]


def delays(sent, received, place):
    return (np.linalg.norm(sent - place, axis=1) + np.linalg.norm(received - place, axis=1)) / LIGHT


def written(
    path, domain="FX", sign=-1, layout="CF8", without="", hop=0.0, spoil=lambda vectors, signal: None, **changes
):
    """Spotlight collection of some points, by the formulas of the standard alone, after a channel of another size.

    With ``hop`` the pulses differ in their first frequency and in the step, by up to this share of the band.
    """
    time, _, velocity, sent, received = collected()
    places = ORIGIN + POINTS @ np.stack([EAST, NORTH, UP])
    reference = delays(sent, received, ORIGIN)
    middle, width, samples = 0.5 * (LOW + HIGH), HIGH - LOW, 200 if domain == "FX" else 240
    low, high = LOW + 3.0 * hop * width, HIGH - 3.0 * hop * width
    axis = np.linspace(LOW - 6e6, HIGH + 6e6, samples) if domain == "FX" else (np.arange(samples) - 117) / 1.2 / width
    if hop:
        shift = np.sin(np.arange(time.size))[:, None]
        axis = axis + hop * width * shift * (1.0 + np.linspace(0.0, 1.0, samples))
    signal = np.zeros((time.size, samples), complex)
    for place, amplitude in zip(places, AMPLITUDES, strict=True):
        away = (delays(sent, received, place) - reference)[:, None]
        loss = (reference.mean() / delays(sent, received, place)[:, None]) ** 2
        if domain == "FX":
            inside = (axis >= low) & (axis <= high)
            signal += loss * amplitude * np.exp(-2j * np.pi * axis * away) * inside
        else:
            signal += loss * amplitude * np.exp(-2j * np.pi * middle * away) * np.sinc(width * (axis - away))
    signal = signal if sign < 0 else signal.conj()
    names = [("TxTime", 1), ("TxPos", 3), ("TxVel", 3), ("RcvTime", 1), ("RcvPos", 3), ("RcvVel", 3), ("SRPPos", 3)]
    names += [(name, 1) for name in ("AmpSF", "aFDOP", "aFRR1", "aFRR2", "FX1", "FX2", "TOA1", "TOA2", "TDTropoSRP")]
    names += [("SC0", 1), ("SCSS", 1), ("SIGNAL", 1)]
    names = [one for one in names if one[0] != without]
    offsets = np.cumsum([0, *(size for _, size in names)])
    root = etree.Element(f"{{{SPACE}}}CPHD", nsmap={None: SPACE})
    tree, half, toa = cphd.ElementWrapper(root), np.array([40.0, 40.0]), 1.5e-7
    axes = np.stack([EAST, NORTH])
    corners = ORIGIN + np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * half @ axes
    tree["CollectionID"] = {
        "CollectorName": "other", "CoreName": "points", "CollectType": "MONOSTATIC",
        "RadarMode": {"ModeType": "SPOTLIGHT"}, "Classification": "UNCLASSIFIED", "ReleaseInfo": "UNRESTRICTED",
    } | changes  # fmt: skip
    tree["Global"] = {
        "DomainType": domain, "SGN": sign,
        "Timeline": {"CollectionStart": np.datetime64("2026-05-01T10:00:00").item(), "TxTime1": 0.0, "TxTime2": 3.0},
        "FxBand": {"FxMin": low, "FxMax": high}, "TOASwath": {"TOAMin": -toa, "TOAMax": toa},
    }  # fmt: skip
    tree["SceneCoordinates"] = {
        "EarthModel": "WGS_84", "IARP": {"ECF": ORIGIN, "LLH": LLH},
        "ReferenceSurface": {"Planar": {"uIAX": axes[0], "uIAY": axes[1]}},
        "ImageArea": {"X1Y1": -half, "X2Y2": half},
        "ImageAreaCornerPoints": wgs84.cartesian_to_geodetic(corners)[:, :2],
    }  # fmt: skip
    size = 8 * int(offsets[-1])
    channels = [("HV", 5, 16), ("VV", time.size, samples)] if layout == "CF8" else [("VV", time.size, samples)]
    before = np.cumsum([[0, 0], *([8 * rows * columns, size * rows] for _, rows, columns in channels)], axis=0)
    tree["Data"] = {
        "SignalArrayFormat": layout, "NumBytesPVP": size, "NumCPHDChannels": len(channels),
        "Channel": [
            {"Identifier": name, "NumVectors": rows, "NumSamples": columns, "SignalArrayByteOffset": int(at[0]),
             "PVPArrayByteOffset": int(at[1])}
            for (name, rows, columns), at in zip(channels, before[:-1], strict=True)
        ],
        "NumSupportArrays": 0,
    }  # fmt: skip
    tree["Channel"] = {
        "RefChId": "VV", "FXFixedCPHD": True, "TOAFixedCPHD": True, "SRPFixedCPHD": True,
        "Parameters": [{
            "Identifier": "VV", "RefVectorIndex": time.size // 2, "FXFixed": True, "TOAFixed": True, "SRPFixed": True,
            "Polarization": {"TxPol": "V", "RcvPol": "V"}, "FxC": middle, "FxBW": high - low, "TOASaved": 2.0 * toa,
            "DwellTimes": {"CODId": "c", "DwellId": "d"},
        }],
    }  # fmt: skip
    tree["PVP"] = {
        name: {"Offset": int(offset), "Size": size,
               "dtype": np.dtype("i8" if name == "SIGNAL" else "f8" if size == 1 else [(x, "f8") for x in "XYZ"])}
        for (name, size), offset in zip(names, offsets[:-1], strict=True)
    }  # fmt: skip
    tree["Dwell"] = {
        "NumCODTimes": 1, "CODTime": [{"Identifier": "c", "CODTimePoly": np.array([[1.5]])}],
        "NumDwellTimes": 1, "DwellTime": [{"Identifier": "d", "DwellTimePoly": np.array([[3.0]])}],
    }  # fmt: skip
    whole = root.getroottree()
    vectors = np.zeros(time.size, cphd.get_pvp_dtype(whole))
    vectors["TxTime"], vectors["RcvTime"], vectors["TxPos"], vectors["RcvPos"] = time, time + reference, sent, received
    vectors["TxVel"] = vectors["RcvVel"] = velocity
    vectors["SRPPos"], vectors["AmpSF"], vectors["SIGNAL"] = ORIGIN, 1.0, 1
    unit = (sent + received) / 2.0 - ORIGIN
    closing = np.sum(velocity * unit, axis=1) / np.linalg.norm(unit, axis=1)
    vectors["aFDOP"], vectors["aFRR1"], vectors["aFRR2"] = -2.0 * closing / LIGHT, 2.0 * middle / LIGHT, 2.0 / LIGHT
    values = {
        "FX1": low,
        "FX2": high,
        "TOA1": -toa,
        "TOA2": toa,
        "SC0": axis[..., 0],
        "SCSS": axis[..., 1] - axis[..., 0],
    }
    for name in values.keys() - {without}:
        vectors[name] = values[name]
    vectors["SIGNAL"][3] = 0  # a pulse that was lost
    signal[3] = np.nan if layout == "CF8" else 0.0
    array = signal.astype(np.complex64)
    if layout != "CF8":
        kind, full = ("i1", 127.0) if layout == "CI2" else ("i2", 32767.0)
        largest = np.abs(np.stack([signal.real, signal.imag])).max(axis=(0, 2))
        vectors["AmpSF"] = scale = np.where(largest > 0.0, largest / full, 1.0)
        array = np.zeros(signal.shape, [("real", kind), ("imag", kind)])
        array["real"], array["imag"] = (np.rint(part / scale[:, None]) for part in (signal.real, signal.imag))
    root.append(cphd.compute_reference_geometry(whole, pvps=vectors))
    spoil(vectors, array)
    with path.open("wb") as file, cphd.Writer(file, cphd.Metadata(xmltree=whole)) as writer:
        writer.write_signal("VV", array)
        writer.write_pvp("VV", vectors)
    return places


def focused(found, place_m):
    return backprojected(found.one, found, place_m, found.frequency_hz)[0]


@pytest.mark.parametrize(
    ("domain", "sign", "layout", "hop"),
    [
        ("FX", -1, "CF8", 0.0), ("FX", 1, "CF8", 0.0), ("FX", 1, "CI4", 0.0), ("FX", -1, "CI2", 0.0),
        ("TOA", -1, "CF8", 0.0), ("TOA", 1, "CI2", 0.0), ("FX", -1, "CI4", 0.01),
    ],
)  # fmt: skip
def test_points_of_another_program_have_place_amplitude_and_phase(tmp_path, domain, sign, layout, hop):
    places = written(tmp_path / "other.cphd", domain, sign, layout, hop=hop)
    if layout != "CF8":  # a lost pulse is NaN otherwise, which the checker does not expect
        with (tmp_path / "other.cphd").open("rb") as file:
            assert errors_of(CphdConsistency.from_file(file, thorough=True)) == {}
    found = read_cphd(tmp_path / "other.cphd")
    one = found.one
    assert one.samples * one.step_hz == pytest.approx((HIGH - LOW) * (1.0 - 6.0 * hop), rel=0.03)
    coarse = 1.0 if domain == "FX" else 10.0  # times the ends of the sinc function that the window cuts off
    for place, amplitude in zip(places, AMPLITUDES, strict=True):
        ratio = focused(found, (place[None] - ORIGIN) @ found.axes.T)[0] / amplitude
        assert abs(np.degrees(np.angle(ratio))) < 0.5 * coarse
        assert 20.0 * np.log10(np.abs(ratio)) == pytest.approx(0.0, abs=0.05 * coarse)
        for axis, cell in ((one.track_m[-1] - one.track_m[0], 0.886 / one.band), (one.track_m.mean(axis=0), 0.45)):
            away = np.linspace(-0.5, 0.5, 201)
            line = (place - ORIGIN) @ found.axes.T + np.multiply.outer(away * cell, axis / np.linalg.norm(axis))
            assert abs(away[np.abs(focused(found, line)).argmax()]) < 0.01 * coarse


def test_the_image_has_the_points_at_their_pixels(tmp_path):
    written(tmp_path / "other.cphd")
    paths = write_image(tmp_path / "other.cphd", tmp_path / "image")
    assert [one.name for one in paths] == ["focused.h5", "focused.png"]
    with h5py.File(paths[0]) as file:
        image, step, first = np.abs(file["image"][()]), file.attrs["spacing_m"], file.attrs["first_m"]
        np.testing.assert_allclose(file.attrs["axis_x"], EAST, atol=1e-9)
    east, north = (np.array(np.unravel_index(image.argmax(), image.shape)) * step + first).tolist()
    # the strongest point lies 3 m above the image plane, and towards the radar in it
    up = UP @ (collected()[3][150] - ORIGIN) / 7000.0 * 3.0
    turn = np.radians(200.0)
    assert (east, north) == pytest.approx((22.0 + up * np.sin(turn), -14.0 + up * np.cos(turn)), abs=1.5 * step)


@pytest.mark.parametrize("signals", [{}, {"bits": 8, "motion_m": 0.3}, {"mode": "spotlight", "squint_deg": 10.0}])
def test_own_files_give_back_the_image(forward_of, with_point, tmp_path, signals):
    """A strong point has its peak at its place on the earth; the beam, which a file does not say, is left in it."""
    made = forward_of(
        with_point(110.0, 80.0, 40.0, 15.0), signals=signals, radar={"looks": 1, "heading_deg": 0.0, "nesz_db": -60.0}
    )
    (path,) = write_iq(tmp_path / "iq", made)
    found, own = read_cphd(path), collection(made.case, made.scene)
    assert (found.one.spot_m is None, found.one.samples) == (own.spot_m is None, own.samples)
    assert (found.one.band, found.one.middle_sine) == pytest.approx((own.band, own.middle_sine), rel=0.05, abs=2e-4)
    drawn = scatterers(made.case, made.scene, made.seed, own.facet_m)
    place = drawn.place_m[np.abs(drawn.amplitude).argmax()]
    away = np.linspace(-4.0, 4.0, 161)
    for axis in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])):
        line = site_of(made.case, made.scene, own).ecf(place + np.multiply.outer(away, axis))
        cut = np.abs(focused(found, (line - found.origin_m) @ found.axes.T))
        assert abs(away[cut.argmax()]) < 0.2
        assert 84.0 < cut.max() < 102.0  # two-way beam of -8 dB at the edges of the band


def test_a_part_of_the_image_has_the_pixels_of_the_whole(tmp_path):
    """Also where every second pulse is lost, and far fewer pulses are in memory at once."""

    def lost(vectors, signal):
        vectors["SIGNAL"][::2] = 0
        signal[::2] = np.nan

    written(tmp_path / "other.cphd", spoil=lost)
    place = wgs84.cartesian_to_geodetic(ORIGIN + 20.0 * EAST - 15.0 * NORTH)
    parts = [{}, {"size_m": 12.0, "centre": (float(place[0]), float(place[1]))}]
    images = []
    for number, part in enumerate(parts):
        path = write_image(tmp_path / "other.cphd", tmp_path / str(number), 0.5, **part)[0]
        with h5py.File(path) as file:
            images.append((file["image"][()], file.attrs["first_m"]))
    (whole, first), (image, low) = images
    assert image.shape == (24, 24)
    assert low == pytest.approx([14.25, -20.75], abs=1e-3)
    row, column = np.rint((low - first) / 0.5).astype(int)
    np.testing.assert_allclose(image, whole[row : row + 24, column : column + 24], atol=1e-3 * np.abs(whole).max())
    with pytest.raises(ConfigError, match=r"--centre is .* m from the reference point, outside of the image area"):
        write_image(tmp_path / "other.cphd", tmp_path, size_m=5.0, centre=(float(LLH[0]) + 1.0, float(LLH[1])))


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("FX1", np.nan, r"\(FX1 is no number in some vectors\)"),
        ("AmpSF", 0.0, "AmpSF of channel 'VV' is 0 in a vector, expected more than 0"),
        ("SIGNAL", 0, "has 0 pulses with a signal, expected 2 or more"),
        (
            "SC0",
            1e3,
            r"spectra of channel 'VV' begin at 1000 Hz, expected samples between FX1 and FX2, 9.4e\+09 to 9.7e\+09",
        ),
        ("SCSS", -1e6, "have no common band"),
        ("TxPos", ORIGIN, "go back along the track, expected an advance"),
    ],
)
def test_parameters_of_vectors_that_cannot_be_right_are_told(tmp_path, name, value, told):
    def spoil(vectors, signal):
        vectors[name] = value
        if name == "TxPos":
            vectors["RcvPos"] = value

    written(tmp_path / "other.cphd", spoil=spoil)
    with pytest.raises(ConfigError, match=f"other.cphd: .*{told}"):
        read_cphd(tmp_path / "other.cphd")


def test_samples_that_are_no_numbers_are_told(tmp_path):
    def spoil(vectors, signal):
        signal[7, 100] = np.inf

    written(tmp_path / "other.cphd", spoil=spoil)
    with pytest.raises(ConfigError, match="vector 7 of channel 'VV' has samples that are no number"):
        write_image(tmp_path / "other.cphd", tmp_path, 2.0)


def test_a_mistake_of_the_reader_is_no_fault_of_the_file(tmp_path, monkeypatch):
    written(tmp_path / "other.cphd")
    monkeypatch.setattr(received, "_collection", lambda *_: None + 1)
    with pytest.raises(TypeError, match="unsupported operand"):
        read_cphd(tmp_path / "other.cphd")


def test_files_that_cannot_be_focused_are_told(tmp_path):
    with pytest.raises(ConfigError, match=r"no readable CPHD file \(it is a folder or a device\)"):
        read_cphd(tmp_path)
    path = tmp_path / "other.cphd"
    path.write_bytes(b"CPHD/1.1.0\nnothing")
    with pytest.raises(ConfigError, match=r"other.cphd: no readable CPHD file"):
        read_cphd(path)
    written(path)
    with pytest.raises(ConfigError, match=r"has no channel 'HH', expected 'HV' or 'VV'"):
        read_cphd(path, "HH")
    with pytest.raises(ConfigError, match=r"6.4e\+13 pixels of 1e-05 m, expected a spacing of at least 0.008 m"):
        write_image(path, tmp_path, 1e-5)
    for part, told in [
        ({"spacing_m": np.inf}, "80 m have no pixel of inf m, expected a smaller spacing"),
        ({"spacing_m": 2.0, "size_m": 1.5}, "1.5 m have no pixel of 2 m"),
        ({"centre": (0.0, 0.0)}, "--centre is given without --size, expected both"),
        ({"size_m": 5.0, "centre": (np.nan, 0.0)}, "--centre is nan and nan m from the reference point, outside"),
    ]:
        with pytest.raises(ConfigError, match=f"other.cphd: {told}"):
            write_image(path, tmp_path, **part)
    good = path.read_bytes()
    for wrong, told in [
        (good.replace(b"XML_BLOCK_SIZE := ", b"XML_BLOCK_SIZE := 9999999"), r"XML_BLOCK_SIZE is 9999999\d+, expected"),
        (good.replace(b"NumVectors>", b"NumVectorz>"), r"\(an element of its metadata is missing or empty\)"),
        (good.replace(b"DomainType>FX<", b"DomainType>XX<"), "DomainType is XX, expected FX or TOA"),
        (good.replace(b"SGN>-1<", b"SGN> 0<"), "SGN is 0, expected -1 or 1"),
        (good.replace(b"IARP>", b"IARQ>"), r"\(SceneCoordinates/IARP/ECF is missing\)"),
        (
            re.sub(rb"(<IARP><ECF><X>)([^<]+)", lambda found: found[1] + b"NaN".ljust(len(found[2])), good),
            r"\(SceneCoordinates/IARP/ECF is \[ *nan",
        ),
        (good.replace(b"uIAY>", b"uIAZ>"), r"\(SceneCoordinates/ReferenceSurface/HAE/uIAXLL is missing\)"),
        (b"CPHD/1.1.0\n" + bytes(1 << 17), r"\(it does not begin with a header of CPHD 1.x\)"),
    ]:
        path.write_bytes(wrong)
        with pytest.raises(ConfigError, match=f"other.cphd: .*{told}"):
            read_cphd(path)
    written(path, without="SCSS")
    with pytest.raises(ConfigError, match=r"other.cphd: no readable CPHD file \(no field of name SCSS\)"):
        read_cphd(path)
    written(path)
    path.write_bytes(path.read_bytes()[:-1000])  # pulse parameters lie before the signal
    with pytest.raises(ConfigError, match=r"other.cphd: no readable CPHD file \(Expected"):
        read_cphd(path)
    written(path, CollectType="BISTATIC")
    with pytest.raises(ConfigError, match="CollectType is BISTATIC, expected MONOSTATIC"):
        read_cphd(path)
