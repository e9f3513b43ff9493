"""Reports of moving targets as STANAG 4607, a format of packets with a mission, a job and dwells.

References
----------
AEDP-4607, "NATO ground moving target indicator format (GMTIF)", edition A, version 1.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.gmti.channels import Sides
from radcal.gmti.detection import Report
from radcal.signals.places import site_of, start_utc
from radcal.signals.platform import Collection
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_UNKNOWN = 0xFFFF  # 16-bit values of the job that are not given
_KM = 128.0 / 1e3  # B16: fixed point with 7 bits below the kilometre
_JOB = 1

Array = NDArray[np.floating[Any]]


def write_stanag(
    path: Path,
    made: Forward,
    one: Collection,
    reports: Sequence[Report],
    antennas: Mapping[int, Array],
    half_rad: float,
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
    half_rad : float
        Half of the beam's width along the track [rad].

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
    from stanag4607 import BinaryAngle, JobDefinitionSegment, MissionSegment, SignedBinaryAngle

    def placed(place_m: Array) -> Array:
        return np.asarray(wgs84.cartesian_to_geodetic(site.ecf(np.atleast_2d(place_m))))

    def latitude(degrees: float) -> int:
        return min(round(degrees / 180.0 * 2**32), 2**31 - 1)

    def longitude(degrees: float, bits: int = 32) -> int:
        return int(round(degrees / 360.0 * 2**bits) % 2**bits)

    (ny, nx), cell = made.scene.material.shape, made.scene.cell_m
    half = 0.5 * np.array([ny, nx]) * cell
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
    middle_m, sides, config = site.middle_m.copy(), Sides.of(made.case, made.scene, one), made.case.gmti
    for scan, (number, antenna) in itertools.product(range(1, config.scans + 1), antennas.items()):
        own = [each for each in reports if (each.scan, each.dwell) == (scan, number)]
        places = np.array([(each.north_m, sides.ground_m(each.east_m), each.height_m) for each in own])
        seconds = float((antenna[0] - one.track_m[0, 0]) / one.speed_mps) + (scan - 1) * config.revisit_s
        midnight = (began + timedelta(seconds=seconds) - began.replace(hour=0, minute=0, second=0)).total_seconds()
        middle_m[0] = antenna[0]
        (lat, lon, high), (far_lat, far_lon, _) = placed(antenna)[0], placed(middle_m)[0]
        fields = {
            2: (scan, 2), 3: (number, 2), 4: (int(number == len(antennas)), 1), 5: (len(own), 2),
            6: (round(1e3 * midnight), 4), 7: (latitude(lat), 4), 8: (longitude(lon), 4), 9: (round(100.0 * high), 4),
            15: (longitude(made.case.radar.heading_deg, 16), 2), 16: (round(1e3 * one.speed_mps), 4), 17: (0, 1),
            24: (latitude(far_lat), 4), 25: (longitude(far_lon), 4), 26: (round(half[1] * _KM), 2),
            27: (longitude(np.degrees(half_rad), 16), 2),
        }  # fmt: skip
        targets = [
            {
                1: (k, 2),
                2: (latitude(a), 4),
                3: (longitude(b), 4),
                6: (round(c), 2),
                7: (round(-100.0 * each.velocity_mps), 2),  # positive away from the radar
                8: (wrap, 2),
            }
            for k, ((a, b, c), each) in enumerate(zip(placed(places).tolist() if own else [], own, strict=True))
        ]
        packets.append(_packet([_dwell(fields, targets)], _JOB))
    with atomic(path) as partial:
        partial.write_bytes(b"".join(packet.to_bytes() for packet in packets))
    return [path]


def _dwell(fields: Mapping[int, tuple[int, int]], targets: Sequence[Mapping[int, tuple[int, int]]]) -> Any:
    """Dwell segment of the numbers of fields, with their sizes in bytes, and those of its targets."""
    from stanag4607 import DWELL_SEGMENT_TYPE
    from stanag4607.packet import Segment

    of_targets = (1, 2, 3, 6, 7, 8)  # all targets of a dwell have the same fields, also if there are none
    mask = sum(1 << (65 - field) for field in fields) + sum(1 << (34 - field) for field in of_targets)
    each = [number for row in (fields, *targets) for number in row.values()]
    payload = b"".join((value % 256**size).to_bytes(size, "big") for value, size in each)
    return Segment(DWELL_SEGMENT_TYPE, mask.to_bytes(8, "big") + payload)


def _packet(segments: Sequence[Any], job: int) -> Any:
    from stanag4607.packet import PACKET_HEADER_SIZE, Packet, PacketHeader

    size = PACKET_HEADER_SIZE + sum(segment.header.segment_size for segment in segments)
    # unclassified, of no nation, data of a simulated exercise
    header = PacketHeader(b"40", size, b"  ", 5, b"  ", 0, 129, b"radcal".ljust(10), 1, job)
    return Packet(header, tuple(segments))
