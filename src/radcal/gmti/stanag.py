"""Reports of moving targets as STANAG 4607, a format of packets with a mission, a job and dwells.

References
----------
AEDP-4607, "NATO ground moving target indicator format (GMTIF)", edition A, version 1.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.gmti.adaptive import Array
from radcal.gmti.detection import HALF_BEAM, Report
from radcal.signals.places import site_of, start_utc
from radcal.signals.platform import Collection
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_UNKNOWN = 0xFFFF  # 16-bit values of the job that are not given
_KM = 128.0 / 1e3  # B16: fixed point with 7 bits below the kilometre
_JOB = 1
_SIGNED = (-0x8000, 0x7FFF)  # signed 16-bit values: velocities, positive away from the radar
# fields of a dwell, 2 to 9, 15 to 17 and 24 to 27, and of each of its targets, 1 to 3 and 6 to 8
_FIELDS, _TARGET = struct.Struct(">HHBHIiIiHIBiIHH"), struct.Struct(">HiIhhH")
_MASK = (
    sum(1 << (65 - field) for field in (*range(2, 10), *range(15, 18), *range(24, 28)))
    + sum(1 << (34 - field) for field in (1, 2, 3, 6, 7, 8))
).to_bytes(8, "big")


def write_stanag(
    path: Path,
    made: Forward,
    one: Collection,
    reports: Sequence[Report],
    antennas: Mapping[int, Array],
) -> list[Path | Finding]:
    """Write the detections of all dwells.

    Parameters
    ----------
    path : path
        Path of the file.
    made : Forward
        Forward run of the pass.
    one : Collection
        Collection, which gives the times of the dwells.
    reports : sequence of Report
        Detections.
    antennas : mapping of int to ndarray, shape (3,)
        Place of the antenna in each dwell of a scan [m].

    Returns
    -------
    list of path or Finding
        The file, or why there is none: the scene's place or date is missing.
    """
    try:
        site, began = site_of(made.case, made.scene, one), start_utc(made.case)
    except ConfigError as error:
        return [Finding("file_left_out", "note", "STANAG 4607", {"why": str(error)})]
    from sarkit import wgs84
    from stanag4607 import DWELL_SEGMENT_TYPE, BinaryAngle, JobDefinitionSegment, MissionSegment, SignedBinaryAngle
    from stanag4607.packet import Segment

    def placed(place_m: Array) -> Array:
        return np.asarray(wgs84.cartesian_to_geodetic(site.ecf(np.atleast_2d(place_m))))

    def latitude(degrees: float) -> int:
        return min(round(degrees / 180.0 * 2**32), 2**31 - 1)

    def longitude(degrees: float, bits: int = 32) -> int:
        return int(round(degrees / 360.0 * 2**bits) % 2**bits)

    half = 0.5 * np.array(made.scene.material.shape) * made.scene.cell_m
    around = np.array([[a, b, 0.0] for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))]) * [*half, 0.0] + site.middle_m
    area = tuple(
        (SignedBinaryAngle(latitude(a), 32), BinaryAngle(longitude(b), 32)) for a, b, _ in placed(around).tolist()
    )
    mission = MissionSegment(
        b"radcal".ljust(12), made.case.case.encode()[:12].ljust(12), 255, b" " * 10, began.year, began.month, began.day
    )
    # type of platform and sensor, mode and all accuracies are not stated; the priority is the lowest
    unknown: Any = (*[_UNKNOWN] * 3, 0xFF, *[_UNKNOWN] * 4, 0xFF, 0xFF, 0xFF, 0, 0)
    job = JobDefinitionSegment(_JOB, 255, b"radcal", 0, 99, area, 0, 0, *unknown)
    # velocities that differ by it have the same Doppler frequency [cm/s]
    wrap = min(round(50.0 * one.wavelength_m * made.case.gmti.prf_hz), _UNKNOWN)
    packets = [_packet([mission.to_segment(), job.to_segment()], 0)]
    middle_m, config = site.middle_m.copy(), made.case.gmti
    for scan, (number, antenna) in itertools.product(range(1, config.scans + 1), antennas.items()):
        own = [each for each in reports if (each.scan, each.dwell) == (scan, number)]
        places = one.of_grid(np.array([(each.east_m, each.north_m, each.height_m) for each in own]).reshape(-1, 3))
        seconds = float((antenna[0] - one.track_m[0, 0]) / one.speed_mps) + (scan - 1) * config.revisit_s
        midnight = (began + timedelta(seconds=seconds) - began.replace(hour=0, minute=0, second=0)).total_seconds()
        middle_m[0] = antenna[0]
        (lat, lon, high), (far_lat, far_lon, _) = placed(antenna)[0], placed(middle_m)[0]
        fields = (
            scan, number, int(number == len(antennas)), len(own), round(1e3 * midnight),
            latitude(lat), longitude(lon), round(100.0 * high), longitude(made.case.radar.heading_deg, 16),
            round(1e3 * one.speed_mps), 0, latitude(far_lat), longitude(far_lon), round(half[1] * _KM),
            longitude(np.degrees(HALF_BEAM * one.null), 16),
        )  # fmt: skip
        targets = [
            (k, latitude(a), longitude(b), round(c), round(np.clip(-100.0 * each.velocity_mps, *_SIGNED)), wrap)
            for k, ((a, b, c), each) in enumerate(zip(placed(places).tolist(), own, strict=True))
        ]
        payload = b"".join([_MASK, _FIELDS.pack(*fields), *(_TARGET.pack(*target) for target in targets)])
        packets.append(_packet([Segment(DWELL_SEGMENT_TYPE, payload)], _JOB))
    with atomic(path) as partial:
        partial.write_bytes(b"".join(packet.to_bytes() for packet in packets))
    return [path]


def _packet(segments: Sequence[Any], job: int) -> Any:
    from stanag4607.packet import PACKET_HEADER_SIZE, Packet, PacketHeader

    size = PACKET_HEADER_SIZE + sum(segment.header.segment_size for segment in segments)
    # unclassified, of no nation, data of a simulated exercise
    header = PacketHeader(b"40", size, b"  ", 5, b"  ", 0, 129, b"radcal".ljust(10), 1, job)
    return Packet(header, tuple(segments))
