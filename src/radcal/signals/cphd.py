"""CPHD 1.1 files of raw signals: compensated phase history data of the NGA, in the frequency domain.

References
----------
NGA.STND.0068-1, "Compensated Phase History Data (CPHD) design and implementation description", version 1.1.0 (2021).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import unstructured_to_structured
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.scene.crs import transformer
from radcal.scene.model import Scene
from radcal.signals.history import BLOCK, quantised
from radcal.signals.platform import LIGHT_MPS, Collection, collection, tangent
from radcal.signals.record import Signal, signal_of
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_SPACE = "http://api.nsgreg.nga.mil/schema/cphd/1.1.0"
_INVENTED_UTC = "2026-01-01T00:00:00Z"  # start of collections over the built-in scene
_BUILTIN = (36.6244, -84.1825)  # latitude and longitude of the middle of the built-in scene, in its elevation model
_USED = 0.9  # share of the window of slant range in which the swath lies
# vector parameters: name, number of values
_VECTOR = (
    ("TxTime", 1), ("TxPos", 3), ("TxVel", 3), ("RcvTime", 1), ("RcvPos", 3), ("RcvVel", 3), ("SRPPos", 3),
    ("AmpSF", 1), ("aFDOP", 1), ("aFRR1", 1), ("aFRR2", 1), ("FX1", 1), ("FX2", 1), ("TOA1", 1), ("TOA2", 1),
    ("TDTropoSRP", 1), ("SC0", 1), ("SCSS", 1),
)  # fmt: skip

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class _Site:
    """Earth-centred coordinates of the scene's middle, and unit vectors along azimuth, ground range and up."""

    origin_m: Doubles
    azimuth: Doubles
    ground: Doubles
    up: Doubles
    middle_m: Doubles  # coordinates of the scene's middle in azimuth, ground range and elevation

    def ecf(self, place_m: Doubles) -> Doubles:
        """Earth-centred coordinates of places in the tangent plane at the scene's middle, shape (n, 3) [m]."""
        return np.asarray(self.origin_m + self.turned(place_m - self.middle_m))

    def turned(self, vector: Doubles) -> Doubles:
        """Earth-centred components of vectors, shape (n, 3)."""
        return np.asarray(vector @ np.stack([self.azimuth, self.ground, self.up]))


def _origin(case: Part, scene: Scene) -> tuple[float, float]:
    """Latitude and longitude of the scene's middle [deg]."""
    if case.signals.origin is not None:
        return case.signals.origin
    if scene.crs is not None and scene.transform is not None:
        ny, nx = scene.material.shape
        a, b, c, d, e, f = scene.transform
        east, north = a * nx / 2 + b * ny / 2 + c, d * nx / 2 + e * ny / 2 + f
        longitude, latitude = transformer(scene.crs, "EPSG:4326").transform(east, north)
        return float(latitude), float(longitude)
    if case.scene.source == "builtin":
        return _BUILTIN
    raise ConfigError("signals.origin is missing, expected latitude and longitude: the scene is not on a map.")


def _start_utc(case: Part) -> str:
    """Start of the collection."""
    if case.signals.start_utc is not None:
        return str(case.signals.start_utc)
    if case.scene.source == "builtin":
        return _INVENTED_UTC
    raise ConfigError("signals.start_utc is missing, expected the date and time of the first pulse for a CPHD file.")


def check_iq(case: Part, scene: Scene) -> None:
    """Raise the errors of :func:`collection`, and of a place or date that a CPHD file needs and the case lacks."""
    collection(case, scene)
    _origin(case, scene)
    _start_utc(case)


def _site(case: Part, scene: Scene, one: Collection) -> _Site:
    from sarkit import wgs84

    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    mean, heading = float(scene.elevation_m.mean()), np.radians(case.radar.heading_deg)
    llh = np.array([*_origin(case, scene), mean])
    north, east = wgs84.north(llh), wgs84.east(llh)
    right = np.cos(heading) * east - np.sin(heading) * north
    middle = np.array([0.5 * scene.elevation_m.shape[0] * scene.cell_m, one.reference_m[0, 1], mean])
    azimuth = np.cos(heading) * north + np.sin(heading) * east
    side = 1.0 if case.radar.look_side == "right" else -1.0
    return _Site(wgs84.geodetic_to_cartesian(llh), azimuth, side * right, wgs84.up(llh), middle)


def _xml(parent: Any, tag: str, value: Any = None, **attributes: object) -> Any:
    """Add an element, with the elements of a mapping, those of a list of mappings, or the text of a value."""
    from lxml import etree

    one = etree.SubElement(parent, f"{{{_SPACE}}}{tag}", {key: str(text) for key, text in attributes.items()})
    if isinstance(value, Mapping):
        for key, item in value.items():
            _xml(one, key, item)
    elif isinstance(value, bool):
        one.text = str(value).lower()
    elif value is not None:
        one.text = repr(float(value)) if isinstance(value, float) else str(value)
    return one


def _named(letters: Sequence[str], values: Doubles) -> dict[str, float]:
    return dict(zip(letters, map(float, values), strict=True))


def _vector_parameters(one: Collection, site: _Site, dtype: Any) -> NDArray[Any]:
    """Parameters of each pulse; transmitter and receiver stand still between sending and receiving."""
    time, found = np.arange(len(one.track_m)) / one.prf_hz, np.zeros(len(one.track_m), dtype)
    velocity = np.gradient(one.track_m, time, axis=0)
    frequency, toa = one.frequency_hz, 0.5 * _USED / one.step_hz
    found["TxTime"], found["RcvTime"] = time, time + 2.0 * one.distance_m / LIGHT_MPS
    found["TxPos"] = found["RcvPos"] = site.ecf(one.track_m)
    found["TxVel"] = found["RcvVel"] = site.turned(velocity)
    found["SRPPos"] = site.ecf(one.reference_m)
    closing = np.sum(velocity * (one.track_m - one.reference_m), axis=1) / one.distance_m
    found["aFDOP"] = -2.0 * closing / LIGHT_MPS
    found["aFRR1"], found["aFRR2"] = 2.0 * one.middle_hz / LIGHT_MPS, 2.0 / LIGHT_MPS
    found["FX1"], found["FX2"], found["TOA1"], found["TOA2"] = frequency[0], frequency[-1], -toa, toa
    found["SC0"], found["SCSS"] = frequency[0], one.step_hz
    return found


def _tree(made: Forward, one: Collection, site: _Site, layout: str) -> Any:
    """Metadata of a CPHD file, but for its reference geometry."""
    from lxml import etree
    from sarkit import wgs84

    case, frequency, pulses, spotlight = made.case, one.frequency_hz, len(one.track_m), one.spot_m is not None
    channel, toa = case.radar.polarisation, 0.5 * _USED / one.step_hz
    root = etree.Element(f"{{{_SPACE}}}CPHD", nsmap={None: _SPACE})
    _xml(root, "CollectionID", {
        "CollectorName": "radcal", "CoreName": f"{case.case}-{made.key}", "CollectType": "MONOSTATIC",
        "RadarMode": {"ModeType": case.signals.mode.upper()}, "Classification": "UNCLASSIFIED",
        "ReleaseInfo": "UNRESTRICTED",
    })  # fmt: skip
    _xml(root, "Global", {
        "DomainType": "FX", "SGN": -1,
        "Timeline": {"CollectionStart": _start_utc(case), "TxTime1": 0.0, "TxTime2": (pulses - 1) / one.prf_hz},
        "FxBand": {"FxMin": frequency[0], "FxMax": frequency[-1]}, "TOASwath": {"TOAMin": -toa, "TOAMax": toa},
    })  # fmt: skip
    # axes of the image plane: the second lies to the left of the first, seen from above
    right = case.radar.look_side == "right"
    axes = (site.ground, site.azimuth) if right else (site.azimuth, site.ground)
    ny, nx = made.scene.material.shape
    half = 0.5 * made.scene.cell_m * np.array([nx, ny] if right else [ny, nx], dtype=np.float64)
    places = _xml(root, "SceneCoordinates", {"EarthModel": "WGS_84"})
    llh = wgs84.cartesian_to_geodetic(site.origin_m)
    _xml(places, "IARP", {"ECF": _named("XYZ", site.origin_m), "LLH": _named(("Lat", "Lon", "HAE"), llh)})
    planar = {name: _named("XYZ", axis) for name, axis in zip(("uIAX", "uIAY"), axes, strict=True)}
    _xml(places, "ReferenceSurface", {"Planar": planar})
    _xml(places, "ImageArea", {"X1Y1": _named("XY", -half), "X2Y2": _named("XY", half)})
    corners = _xml(places, "ImageAreaCornerPoints")
    for number, signs in enumerate(((-1, -1), (-1, 1), (1, 1), (1, -1)), start=1):
        corner = site.origin_m + half * np.array(signs) @ np.stack(axes)
        _xml(corners, "IACP", _named(("Lat", "Lon"), wgs84.cartesian_to_geodetic(corner)[:2]), index=number)
    data = _xml(root, "Data", {"SignalArrayFormat": layout, "NumBytesPVP": 8 * sum(n for _, n in _VECTOR)})
    _xml(data, "NumCPHDChannels", 1)
    _xml(data, "Channel", {
        "Identifier": channel, "NumVectors": pulses, "NumSamples": one.samples, "SignalArrayByteOffset": 0,
        "PVPArrayByteOffset": 0,
    })  # fmt: skip
    _xml(data, "NumSupportArrays", 0)
    _xml(root, "Channel", {
        "RefChId": channel, "FXFixedCPHD": True, "TOAFixedCPHD": True, "SRPFixedCPHD": spotlight,
        "Parameters": {
            "Identifier": channel, "RefVectorIndex": pulses // 2, "FXFixed": True, "TOAFixed": True,
            "SRPFixed": spotlight, "Polarization": {"TxPol": channel[0], "RcvPol": channel[1]}, "FxC": one.middle_hz,
            "FxBW": frequency[-1] - frequency[0], "TOASaved": 2.0 * toa,
            "DwellTimes": {"CODId": "middle", "DwellId": "processed band"},
        },
    })  # fmt: skip
    parameters, offset = _xml(root, "PVP"), 0
    for name, size in _VECTOR:
        layout = "F8" if size == 1 else "X=F8;Y=F8;Z=F8;"
        _xml(parameters, name, {"Offset": offset, "Size": size, "Format": layout})
        offset += size
    dwell = _xml(root, "Dwell", {"NumCODTimes": 1})
    # a place is in the middle of the band when the antenna is behind it by its slant range times the squint's tangent
    slant, slope = one.range_m * math.sqrt(1.0 - one.middle_sine**2), tangent(one.middle_sine)
    time, along, across = (
        site.middle_m[0] - slant * slope - one.track_m[0, 0],
        1.0,
        -slope * one.reference_m[0, 1] / slant,
    )
    seen = slant * (tangent(one.middle_sine + 0.5 * one.sines) - tangent(one.middle_sine - 0.5 * one.sines))
    if spotlight:  # all places have the same pulses
        along, across = 0.0, 0.0
    per_axis = np.array([across, along] if right else [along, across]) / one.speed_mps
    rows = [[time / one.speed_mps, per_axis[1]], [per_axis[0], 0.0]]
    _polynomial(_xml(dwell, "CODTime", {"Identifier": "middle"}), "CODTimePoly", rows)
    _xml(dwell, "NumDwellTimes", 1)
    named = _xml(dwell, "DwellTime", {"Identifier": "processed band"})
    _polynomial(named, "DwellTimePoly", [[seen / one.speed_mps]])
    return root.getroottree()


def _polynomial(parent: Any, tag: str, coefficients: list[list[float]]) -> None:
    one = _xml(parent, tag, order1=len(coefficients) - 1, order2=len(coefficients[0]) - 1)
    for i, line in enumerate(coefficients):
        for j, value in enumerate(line):
            _xml(one, "Coef", value, exponent1=i, exponent2=j)


def write_cphd(path: Path, made: Forward, one: Collection, signal: Signal) -> None:
    """Write a raw signal as CPHD 1.1, as numbers of the converter if there is one.

    Parameters
    ----------
    path : path
        Path of the file.
    made : Forward
        Forward run of the pass.
    one : Collection
        Collection.
    signal : ndarray of complex64, shape (pulses, samples), or RawSignal
        Raw signal before the converter [m], of which one block of pulses is in memory at once.
    """
    from sarkit import cphd

    pulses, channel, layout = len(one.track_m), made.case.radar.polarisation, "CF8"
    kind: np.dtype[Any] = np.dtype(">c8")
    scale = np.ones(pulses)
    if one.bits is not None:
        part, layout = ("i1", "CI2") if one.bits <= 8 else (">i2", "CI4")
        kind = np.dtype([("real", part), ("imag", part)])
    site = _site(made.case, made.scene, one)
    tree = _tree(made, one, site, layout)
    vectors = _vector_parameters(one, site, cphd.get_pvp_dtype(tree))
    tree.getroot().append(cphd.compute_reference_geometry(tree, pvps=vectors))
    with atomic(path) as partial, partial.open("w+b") as file:
        writer = cphd.Writer(file, cphd.Metadata(xmltree=tree))
        file.seek(0)
        _, header = cphd.read_file_header(file)
        file.seek(int(header["SIGNAL_BLOCK_BYTE_OFFSET"]))
        for first in range(0, pulses, BLOCK):  # the writer itself takes a whole signal only
            some = slice(first, first + BLOCK)
            array: NDArray[Any] = signal[some]
            if one.bits is not None:
                numbers, scale[some] = quantised(array, one.bits)
                array = unstructured_to_structured(numbers, kind)
            file.write(array.astype(kind).tobytes())
        vectors["AmpSF"] = scale
        writer.write_pvp(channel, vectors)


def write_iq(stem: Path, made: Forward) -> list[Path]:
    """Simulate the raw signal of a pass, and write it as CPHD.

    Parameters
    ----------
    stem : path
        Path of the file without suffix.
    made : Forward
        Forward run of the pass, whose laws and seed are used.

    Returns
    -------
    list of path
        The file.
    """
    path = stem.with_suffix(".cphd")
    with signal_of(stem, made) as signal:
        write_cphd(path, made, signal.one, signal)
    return [path]
