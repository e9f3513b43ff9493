"""Provenance of a report: when, by which command and from which files it was made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from radcal.config import input_files
from radcal.errors import RadcalError
from radcal.results.archive import Archive
from radcal.results.summary import numbered_jobs, wall_seconds
from radcal.storage.files import file_sha256


@dataclass(frozen=True)
class Provenance:
    """When, by which command and from which files a report was made.

    Attributes
    ----------
    date : str
        Date and time in UTC, to the minute.
    command : str
        Command line; empty if it is unknown.
    seconds : mapping
        Wall time of each stage of the workflow until the report [s].
    inputs : mapping
        Name and SHA-256 of each input file by configuration key; empty if a file is no longer there.
    """

    date: str
    command: str
    seconds: Mapping[str, float]
    inputs: Mapping[str, tuple[str, str]]


def provenance_of(archive: Archive, folder: str | Path, command: str) -> Provenance:
    """Provenance of a report that is made now.

    Parameters
    ----------
    archive : Archive
        Results of the calibration.
    folder : path
        ``results/<case>``.
    command : str
        Command line that makes the report.
    """
    try:
        inputs = {key: (path.name, file_sha256(path)) for key, path in input_files(archive.configured).items()}
    except (RadcalError, OSError):
        inputs = {}
    return Provenance(
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        command=command,
        seconds=wall_seconds(Path(folder) / "benchmarks", numbered_jobs(archive)),
        inputs=inputs,
    )
