"""CPHD 1.1 files of raw signals: compensated phase history data of the NGA, in the frequency domain.

References
----------
NGA.STND.0068-1, "Compensated Phase History Data (CPHD) design and implementation description", version 1.1.0 (2021).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import unstructured_to_structured
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.scene.model import Scene
from radcal.signals.history import BLOCK, Pulses, quantised, signal_of
from radcal.signals.places import Site, site_of, start_utc
from radcal.signals.platform import LIGHT_MPS, Collection, Doubles, collection, tangent
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_SPACE = "http://api.nsgreg.nga.mil/schema/cphd/1.1.0"
_USED = 0.9  # share of the window of slant range that holds the swath: the standard wants 1.1 times its samples
_PLACE = np.dtype([(axis, "f8") for axis in "XYZ"])
_VECTOR = np.dtype([
    ("TxTime", "f8"), ("TxPos", _PLACE), ("TxVel", _PLACE), ("RcvTime", "f8"), ("RcvPos", _PLACE), ("RcvVel", _PLACE),
    ("SRPPos", _PLACE), *((name, "f8") for name in ("AmpSF", "aFDOP", "aFRR1", "aFRR2", "FX1", "FX2", "TOA1", "TOA2")),
    ("TDTropoSRP", "f8"), ("SC0", "f8"), ("SCSS", "f8"),
])  # fmt: skip


def check_iq(case: Part, scene: Scene) -> None:
    """Raise the errors of :func:`collection`, and of a place or date that a CPHD file needs and the case lacks."""
    site_of(case, scene, collection(case, scene))
    start_utc(case)


def _vector_parameters(one: Collection, site: Site, dtype: Any) -> NDArray[Any]:
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


def _tree(made: Forward, one: Collection, site: Site, layout: str) -> Any:
    """Metadata of a CPHD file, but for its reference geometry."""
    from lxml import etree
    from sarkit import cphd, wgs84

    case, frequency, pulses, spotlight = made.case, one.frequency_hz, len(one.track_m), one.spot_m is not None
    channel, toa = case.radar.polarisation, 0.5 * _USED / one.step_hz
    # axes of the image plane: the second lies to the left of the first, seen from above
    right = one.side > 0.0
    axes = site.axes[[1, 0] if right else [0, 1]]
    ny, nx = made.scene.material.shape
    half = 0.5 * made.scene.cell_m * np.array([nx, ny] if right else [ny, nx], dtype=np.float64)
    corners = site.origin_m + np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * half @ axes

    def linear(value: float, across: float, along: float) -> Doubles:
        """Coefficients of a time in the image plane: value [m], and slopes in ground range and azimuth."""
        first, second = (across, along) if right else (along, across)
        return np.array([[value, second], [first, 0.0]]) / one.speed_mps

    # a place is in the middle of the band when the antenna is behind it by its slant range times the squint's tangent
    slant = one.range_m * math.sqrt(1.0 - one.middle_sine**2)
    low, middle, high = (tangent(one.middle_sine + part * one.sines) for part in (-0.5, 0.0, 0.5))
    slope, when = one.reference_m[0, 1] / slant, site.middle_m[0] - slant * middle - one.track_m[0, 0]
    dwell = linear(slant * (high - low), (high - low) * slope, 0.0)
    time = linear(when, -middle * slope, 1.0)
    if spotlight:  # all places have the same pulses
        dwell, time = dwell[:1, :1], time[:1, :1]
    root = etree.Element(f"{{{_SPACE}}}CPHD", nsmap={None: _SPACE})
    tree = cphd.ElementWrapper(root)
    tree["CollectionID"] = {
        "CollectorName": "radcal", "CoreName": f"{case.case}-{made.key}", "CollectType": "MONOSTATIC",
        "RadarMode": {"ModeType": case.signals.mode.upper()}, "Classification": "UNCLASSIFIED",
        "ReleaseInfo": "UNRESTRICTED",
    }  # fmt: skip
    tree["Global"] = {
        "DomainType": "FX", "SGN": -1,
        "Timeline": {"CollectionStart": start_utc(case), "TxTime1": 0.0, "TxTime2": (pulses - 1) / one.prf_hz},
        "FxBand": {"FxMin": frequency[0], "FxMax": frequency[-1]}, "TOASwath": {"TOAMin": -toa, "TOAMax": toa},
    }  # fmt: skip
    tree["SceneCoordinates"] = {
        "EarthModel": "WGS_84",
        "IARP": {"ECF": site.origin_m, "LLH": wgs84.cartesian_to_geodetic(site.origin_m)},
        "ReferenceSurface": {"Planar": dict(zip(("uIAX", "uIAY"), axes, strict=True))},
        "ImageArea": {"X1Y1": -half, "X2Y2": half},
        "ImageAreaCornerPoints": wgs84.cartesian_to_geodetic(corners)[:, :2],
    }
    tree["Data"] = {
        "SignalArrayFormat": layout, "NumBytesPVP": _VECTOR.itemsize, "NumCPHDChannels": 1,
        "Channel": [{
            "Identifier": channel, "NumVectors": pulses, "NumSamples": one.samples, "SignalArrayByteOffset": 0,
            "PVPArrayByteOffset": 0,
        }],
        "NumSupportArrays": 0,
    }  # fmt: skip
    tree["Channel"] = {
        "RefChId": channel, "FXFixedCPHD": True, "TOAFixedCPHD": True, "SRPFixedCPHD": spotlight,
        "Parameters": [{
            "Identifier": channel, "RefVectorIndex": pulses // 2, "FXFixed": True, "TOAFixed": True,
            "SRPFixed": spotlight, "Polarization": {"TxPol": channel[0], "RcvPol": channel[1]}, "FxC": one.middle_hz,
            "FxBW": frequency[-1] - frequency[0], "TOASaved": 2.0 * toa,
            "DwellTimes": {"CODId": "middle", "DwellId": "processed band"},
        }],
    }  # fmt: skip
    tree["PVP"] = {
        name: {"Offset": offset // 8, "Size": kind.itemsize // 8, "dtype": kind}
        for name, (kind, offset, *_) in (_VECTOR.fields or {}).items()
    }
    tree["Dwell"] = {
        "NumCODTimes": 1, "CODTime": [{"Identifier": "middle", "CODTimePoly": time}],
        "NumDwellTimes": 1, "DwellTime": [{"Identifier": "processed band", "DwellTimePoly": dwell}],
    }  # fmt: skip
    return root.getroottree()


def write_cphd(path: Path, made: Forward, one: Collection, signal: Pulses) -> None:
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
    site = site_of(made.case, made.scene, one)
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
