"""Note, before a run, that finished results of a case keep ``radcal run`` from starting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from radcal.config import Case
from radcal.errors import RadcalError
from radcal.findings import Finding
from radcal.session.replacement import check_replacement

__all__ = ["kept_results"]


def kept_results(
    problems: Sequence[str], shape: tuple[int, int] | None, case: Case, results: str | Path, inputs: Mapping[str, Path]
) -> list[Finding]:
    """Note that ``radcal run`` would refuse to replace a finished calibration of another scene or pass; else empty.

    Parameters
    ----------
    problems : sequence of str
        Problems of the case; with any problem, nothing is said.
    shape : (int, int) or None
        Size of the simulated image; if None, the check has not made the scene, and nothing is said.
    case : Case
        The case.
    results : path
        Folder that contains the results folders of all cases.
    inputs : mapping
        Input files of the case by configuration key.
    """
    if problems or shape is None:
        return []
    try:
        check_replacement(case, Path(results) / case.case, inputs)
    except RadcalError as error:
        return [Finding("refused_beside_results", "note", str(case.case), {"error": str(error)})]
    return []
