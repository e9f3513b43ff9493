"""Case of ``radcal simulate``: all mistakes in its materials at once, and remarks on where each law comes from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config import Case, expand_path, load_forward
from radcal.config.loading import read_cases
from radcal.config.part import Part
from radcal.config.yaml_file import lines_of, read_case_file
from radcal.errors import ConfigError
from radcal.sections.base import with_undecided
from radcal.sections.errors import mistakes, shown

__all__ = ["forward_case"]


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
        As for :func:`radcal.config.load_forward`. The message has one line for each mistake in the other file.
    """
    others = {}
    if materials is not None:
        others = _checked_materials(materials, read_cases([file], overrides).get("scene", {}))
    case = load_forward([file], overrides, materials)
    remarks = []
    if kept := [name for name in case.materials if name not in others and materials is not None]:
        remarks.append(
            f"{materials} has the laws of {', '.join(others)}; the other materials keep the laws of {file}: "
            f"{', '.join(kept)}."
        )
    if case.calibrated:
        remarks.append(f"Simulated at the start, because of calibrate: true: {', '.join(case.calibrated)}.")
    return case, remarks


def _checked_materials(file: str | Path, scene: Any) -> dict[str, Any]:
    """Section ``materials`` of a file, without mistakes; ``scene`` is the section of the case, for its land cover."""
    path = expand_path(str(file), "--materials")
    found = read_case_file(path).get("materials")
    if not isinstance(found, dict) or not found:
        raise ConfigError(f"--materials: {path} has no section materials, expected one, as calibrated.yaml has it.")
    try:
        Case.model_validate({"scene": scene, "materials": with_undecided(found)}, context=[])
    except ValidationError as error:
        wrong = [one for one in mistakes(error, Case, lines_of(path)) if one.section == "materials"]
        if wrong:
            raise ConfigError("\nradcal: ".join(f"{path}: {shown(one.text, 600)}." for one in wrong)) from None
    return found
