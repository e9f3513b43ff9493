"""Case of ``radcal simulate``, and remarks on where each of its laws comes from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radcal.config import expand_path, load_forward
from radcal.config.part import Part
from radcal.config.yaml_file import read_case_file


def forward_case(
    file: str | Path, overrides: Mapping[str, Any] | None = None, materials: str | Path | None = None
) -> tuple[Part, list[str]]:
    """Case of a forward run, in which materials of another file may replace materials of the same names.

    Parameters
    ----------
    file : path
        Case file.
    overrides : mapping, optional
        Keys that the command line changes.
    materials : path, optional
        File with a section ``materials``.

    Returns
    -------
    case : Part
        Sections that a forward run needs.
    remarks : list of str
        Sentences on the materials that keep the case's own law, and on those at their starting parameters.

    Raises
    ------
    ConfigError
        As for :func:`radcal.config.load_forward`.
    """
    case = load_forward([file], overrides, materials)
    others = {} if materials is None else read_case_file(expand_path(str(materials), "--materials"))["materials"]
    remarks = []
    if kept := [name for name in case.materials if name not in others and materials is not None]:
        remarks.append(
            f"{materials} has the laws of {', '.join(others)}; the other materials keep the laws of {file}: "
            f"{', '.join(kept)}."
        )
    if case.calibrated:
        remarks.append(f"Simulated at the start, because of calibrate: true: {', '.join(case.calibrated)}.")
    return case, remarks
