"""Provenance of a report: when, by which command and from which files it was made."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from radcal.config import input_files
from radcal.errors import RadcalError
from radcal.results.archive import Archive
from radcal.results.summary import numbered_jobs, wall_seconds
from radcal.storage.files import file_sha256


def provenance_of(archive: Archive, folder: str | Path, command: str) -> dict[str, Any]:
    """Provenance of a report that is made now.

    Parameters
    ----------
    archive : Archive
        Results of the calibration.
    folder : path
        ``results/<case>``.
    command : str
        Command line that makes the report.

    Returns
    -------
    dict
        ``date`` in UTC to the minute, ``command``, ``seconds`` of each stage of the workflow until the report [s], and
        ``inputs``, name and SHA-256 of each input file by configuration key; empty if a file is no longer there.
    """
    try:
        inputs = {key: (path.name, file_sha256(path)) for key, path in input_files(archive.configured).items()}
    except (RadcalError, OSError):
        inputs = {}
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": command,
        # the file of an earlier report is not counted
        "seconds": wall_seconds(Path(folder) / "benchmarks", {**numbered_jobs(archive), "report": 0}),
        "inputs": inputs,
    }
