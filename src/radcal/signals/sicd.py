"""SICD 1.4 files of complex images: sensor independent complex data of the NGA, on the grid of slant range and azimuth.

References
----------
NGA.STND.0024-1, "Sensor Independent Complex Data (SICD), Volume 1, Design & Implementation Description Document",
version 1.4.0 (2023).
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.radar.earth import line_of_sight
from radcal.radar.radiometry import of_sigma0
from radcal.signals.places import Site, image_places, site_of, start_utc
from radcal.signals.platform import LIGHT_MPS, Collection, Doubles, collection
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_SPACE = "urn:SICD:1.4.0"
_LEVEL_GROUND = ("sigma0_ref", "sigma0", "beta0", "gamma0")  # radiometries of areas on level ground


def write_sicd(stem: Path, made: Forward, looks: Iterable[NDArray[np.complex64]], apart: bool) -> list[Path | Finding]:
    """Write each look of a pass as SICD, whose squared magnitude is sigma0 on level ground.

    Parameters
    ----------
    stem : path
        Path of the files without suffix; those of several looks end in ``_look<k>``.
    made : Forward
        Forward run of the pass.
    looks : iterable of ndarray of complex64, shape (slant range, azimuth)
        Looks in the radiometry of the pass. In sigma0_local and gamma0_rtc, which no polynomial of the file converts,
        the file has no radiometric calibration.
    apart : bool
        Whether the looks are parts of the azimuth band of one aperture, from behind to ahead; otherwise they all have
        zero Doppler in the middle.

    Returns
    -------
    list of path or Finding
        The files, or why there are none: a finding on a place or a date that the case lacks, or on its scene.
    """
    try:
        one = collection(made.case, made.scene)
        if apart and (one.middle_sine or one.spot_m is not None):
            raise ConfigError("signals: with squint or in spotlight mode, expected stripmap at zero Doppler.")
        site, began = site_of(made.case, made.scene, one), start_utc(made.case)
    except ConfigError as error:
        return [Finding("file_left_out", "note", "SICD", {"why": str(error)})]
    paths, width = list[Path | Finding](), one.band / one.looks
    level = 1.0 / of_sigma0(made.case.radar.radiometry, made.geometry.flat_incidence_deg)
    for k, look in enumerate(looks):
        pixels = (look * np.sqrt(level).astype(np.float32)[:, None]).astype(np.complex64)
        middle = (k - 0.5 * (one.looks - 1)) * width if apart else 0.0
        tree = _tree(made, one, site, began, middle, width)
        path = stem.with_name(stem.name + f"_look{k + 1}" * (one.looks > 1) + ".nitf")
        paths.append(path)
        _write(path, tree, pixels if one.side > 0.0 else pixels[:, ::-1], f"{made.case.case}-{made.key}")
    return paths


def _tree(made: Forward, one: Collection, site: Site, began: datetime, middle: float, width: float) -> Any:
    """Metadata of a look with a band of azimuth frequencies, along the flight [1/m]; the middle pixel is on the ground.

    Columns run along the flight if the radar looks to the right, else against it.
    """
    from lxml import etree
    from sarkit import sicd, wgs84

    assert made.scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    radar, speed, along, (rows, columns) = made.case.radar, one.speed_mps, one.side, made.geometry.shape
    row, column = rows // 2, columns // 2
    place = image_places(made)[row, column]
    antenna = np.array([place[0], 0.0, made.scene.elevation_m.mean() + line_of_sight(radar).height_m])
    line, seconds = place - antenna, float((place[0] - one.track_m[0, 0]) / speed)
    slant_m, column = float(np.linalg.norm(line)), column if along > 0.0 else columns - 1 - column
    scp, start = site.ecf(np.stack([place, antenna - [seconds * speed, 0.0, 0.0]]))
    unit, velocity = site.turned(np.stack([line / slant_m, [speed, 0.0, 0.0]]))
    ends = np.array([(0, 0), (0, columns - 1), (rows - 1, columns - 1), (rows - 1, 0)]) - [row, column]
    ground = np.sqrt((slant_m + ends[:, 0] * radar.range_spacing_m) ** 2 - line[2] ** 2)
    azimuth = place[0] + along * ends[:, 1] * radar.azimuth_spacing_m
    corners = np.stack([azimuth, ground, np.full(4, place[2])], axis=1)
    duration, frequency = (len(one.track_m) - 1) / one.prf_hz, one.frequency_hz
    sine = 0.5 * one.wavelength_m * middle
    # a pixel is seen in the middle of the look's band before or after its zero Doppler
    seen = [[seconds - sine * slant_m / speed, along / speed], [-sine / speed, 0.0]]
    bandwidth = 2.0 * (frequency[-1] - frequency[0] + one.step_hz) / LIGHT_MPS

    def axis(
        vector: Doubles, spacing: float, resolution: float, wide: float, centre: float, at: float
    ) -> dict[str, Any]:
        low, high = at - 0.5 * wide, at + 0.5 * wide
        if max(-low, high) > 0.5 / spacing:  # the band is folded by the spacing of the pixels
            low, high = -0.5 / spacing, 0.5 / spacing
        return {
            "UVectECF": vector, "SS": spacing, "ImpRespWid": resolution, "Sgn": -1, "ImpRespBW": wide, "KCtr": centre,
            "DeltaK1": low, "DeltaK2": high, "DeltaKCOAPoly": np.array([[at]]),
            "WgtType": {"WindowName": "TAYLOR"},
        }  # fmt: skip

    root = etree.Element(f"{{{_SPACE}}}SICD", nsmap={None: _SPACE})
    channel = ":".join(radar.polarisation)
    whole = {"NumRows": rows, "NumCols": columns}
    taken = {"Min": frequency[0], "Max": frequency[-1]}
    sicd.ElementWrapper(root).from_dict({
        "CollectionInfo": {
            "CollectorName": "radcal", "CoreName": f"{made.case.case}-{made.key}", "CollectType": "MONOSTATIC",
            "RadarMode": {"ModeType": "STRIPMAP"}, "Classification": "UNCLASSIFIED",
        },
        "ImageData": {
            "PixelType": "RE32F_IM32F", **whole, "FirstRow": 0, "FirstCol": 0, "FullImage": whole,
            "SCPPixel": np.array([row, column]),
        },
        "GeoData": {
            "EarthModel": "WGS_84", "SCP": {"ECF": scp, "LLH": wgs84.cartesian_to_geodetic(scp)},
            "ImageCorners": wgs84.cartesian_to_geodetic(site.ecf(corners))[:, :2],
        },
        "Grid": {
            "ImagePlane": "SLANT", "Type": "RGZERO", "TimeCOAPoly": np.array(seen),
            "Row": axis(unit, radar.range_spacing_m, radar.range_resolution_m, bandwidth,
                        2.0 * one.middle_hz / LIGHT_MPS, 0.0),
            "Col": axis(along * velocity / speed, radar.azimuth_spacing_m, radar.azimuth_resolution_m, width, 0.0,
                        along * middle),
        },
        "Timeline": {"CollectStart": began, "CollectDuration": duration},
        "Position": {"ARPPoly": np.stack([start, velocity])},
        "RadarCollection": {
            "TxFrequency": taken, "TxPolarization": radar.polarisation[0],
            "RcvChannels": {"@size": "1", "ChanParameters": [{"@index": "1", "TxRcvPolarization": channel}]},
        },
        "ImageFormation": {
            "RcvChanProc": {"NumChanProc": 1, "ChanIndex": [1]}, "TxRcvPolarizationProc": channel, "TStartProc": 0.0,
            "TEndProc": duration, "TxFrequencyProc": {"MinProc": frequency[0], "MaxProc": frequency[-1]},
            "ImageFormAlgo": "RMA", "STBeamComp": "SV", "ImageBeamComp": "NO", "AzAutofocus": "NO", "RgAutofocus": "NO",
        },
        "RMA": {
            "RMAlgoType": "RG_DOP", "ImageType": "INCA",
            "INCA": {
                "TimeCAPoly": np.array([seconds, along / speed]), "R_CA_SCP": slant_m,
                "FreqZero": one.middle_hz, "DRateSFPoly": np.array([[1.0]]),
            },
        },
    })  # fmt: skip
    tree = root.getroottree()
    at = [each.tag for each in root].index(f"{{{_SPACE}}}ImageFormation") + 1
    root.insert(at, sicd.compute_scp_coa(tree))
    if radar.radiometry in _LEVEL_GROUND:
        sicd.ElementWrapper(root)["Radiometric"] = {"SigmaZeroSFPoly": np.array([[1.0]])}
    return tree


def _write(path: Path, tree: Any, pixels: NDArray[np.complex64], title: str) -> None:
    from sarkit import sicd

    security = sicd.NitfSecurityFields(clas="U")
    metadata = sicd.NitfMetadata(
        xmltree=tree,
        file_header_part=sicd.NitfFileHeaderPart(ostaid="radcal", ftitle=title[:80], security=security),
        im_subheader_part=sicd.NitfImSubheaderPart(isorce="radcal", security=security),
        de_subheader_part=sicd.NitfDeSubheaderPart(security=security),
    )
    with atomic(path) as partial, partial.open("wb") as file, sicd.NitfWriter(file, metadata) as writer:
        writer.write_image(np.ascontiguousarray(pixels))
