"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config import stages
from radcal.config.case import Case
from radcal.config.inputs import expand_path
from radcal.config.undecided import undecided
from radcal.errors import ConfigError
from radcal.sections.base import MATERIALS_FROM
from radcal.sections.errors import Collected, first_error, shown

__all__ = ["case_from", "listed_by", "load", "load_forward", "load_measured", "origin_of", "read_cases"]

# sections that a forward run does not read
_OF_CALIBRATION = (
    "measurement", "registration", "objective", "target", "validation", "design", "surrogate", "optimiser",
    "uncertainty", "stop",
)  # fmt: skip


def _parsed(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Overrides with plain data in place of each section that the command line gives as text."""
    from radcal.config.yaml_file import read_value

    parsed = dict(overrides)
    for key, value in overrides.items():
        if isinstance(value, str) and key in Case.model_fields.keys() - {"case", "seed"}:
            parsed[key] = read_value(value, f"--config {key}")
    return parsed


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Convert plain data to a typed case, and check keys and values.

    Raises
    ------
    ConfigError
        A key or value is wrong; the message describes the first problem.
    """
    try:
        return Case.model_validate(dict(data))
    except ValidationError as error:
        raise first_error(error, origin, Case) from None


def load(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Case:
    """Read configuration files and command-line overrides into one typed case.

    Parameters
    ----------
    files : sequence of path
        YAML files; a key in a later file overrides the same key in an earlier file.
    overrides : mapping, optional
        Settings of ``snakemake --config``, or the configuration that Snakemake has merged; sections may be text in
        YAML or JSON.

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML, a key occurs twice, or a key or value is wrong.
    """
    data, origin = read_cases(files, overrides), origin_of(files)
    if marked := undecided(data, files):
        where = listed_by(files, overrides) or "; radcal check lists them"
        more = f" (and {len(marked) - 1} more{where})" if len(marked) > 1 else ""
        raise ConfigError(f"{origin}: {marked[0].text}{more}.")
    try:
        return Case.model_validate(data)
    except ValidationError as error:
        raise first_error(error, origin, Case, listed_by(files, overrides)) from None


def load_forward(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None, calibrated: str | Path | None = None
) -> stages.ForwardStage:
    """Read the sections of a case that a forward run needs, without the sections on measurement and calibration.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.
    calibrated : path, optional
        File whose materials replace those of the case.

    Returns
    -------
    stages.ForwardStage
        Sections that a forward run needs; the case need not mark any material ``calibrate: true``.

    Raises
    ------
    ConfigError
        As for :func:`load`; or the simulator cannot evaluate a law, or the pass lacks the carrier frequency that a law
        needs.
    """
    origin = origin_of(files)
    data = {key: value for key, value in read_cases(files, overrides).items() if key not in _OF_CALIBRATION}
    if calibrated is not None:
        data["materials"] = {**data.get("materials", {}), **_materials_of(calibrated, "--materials")}
    passes = data.get("radar")
    if isinstance(passes, list):  # a case must have a measurement for each pass; a forward run reads none of them
        data["measurement"] = [{}] * len(passes)
    try:
        case = Case.model_validate(data, context=Collected())
    except ValidationError as error:
        where = listed_by(files, overrides) if calibrated is None else ""
        raise first_error(error, origin, Case, where) from None
    for one in case.passes:
        for text in one.laws_without_pass():
            raise ConfigError(f"{origin}: {text}.")
    return stages.ForwardStage.of(case)


def load_measured(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Case | None:
    """Read a case with a measured image; the case need not mark any material ``calibrate: true``.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.

    Returns
    -------
    Case or None
        The case, or None if the files have no section ``measurement``.

    Raises
    ------
    ConfigError
        As for :func:`load`.
    """
    data, found = read_cases(files, overrides), Collected()
    if "measurement" not in data:
        return None
    try:
        case = Case.model_validate(data, context=found)
    except ValidationError as error:
        raise first_error(error, origin_of(files), Case, listed_by(files, overrides)) from None
    if found and case.calibrated:
        raise ConfigError(f"{origin_of(files)}: {shown(str(found[0]), 600)}.")
    return case


def listed_by(files: Sequence[str | Path], overrides: Mapping[str, Any] | None) -> str:
    """Words on the command that lists all mistakes; empty for several files, which it checks one by one."""
    settings = " with the same settings" if overrides else ""
    return f"; radcal check {shlex.quote(str(files[0]))}{settings} lists them all" if len(files) == 1 else ""


def origin_of(files: Sequence[str | Path]) -> str:
    """Names of the case files, as text with which error messages begin."""
    return ", ".join(str(f) for f in files) or "configuration"


def read_cases(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None, twice: list[str] | None = None
) -> dict[str, Any]:
    """Plain data merged from configuration files and overrides; parameters and errors as for :func:`load`.

    ``twice`` collects sentences on duplicate keys, as in :func:`radcal.config.yaml_file.read_case_file`.
    """
    from radcal.config.yaml_file import merged, read_case_file  # imports PyYAML, which workflow jobs do not need

    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file, twice))
    data = merged(data, _parsed(overrides or {}))
    if (file := data.pop(MATERIALS_FROM, None)) is not None:
        own = data.get("materials", {})
        # a material of the case replaces the other file's whole material, because keys of two laws must not be combined
        data["materials"] = {**_materials_of(file, MATERIALS_FROM), **own} if isinstance(own, dict) else own
    return data


def _materials_of(file: Any, key: str) -> dict[str, Any]:
    """Section ``materials`` of a file other than the case file, such as ``calibrated.yaml``."""
    from radcal.config.yaml_file import read_case_file

    if not isinstance(file, str | Path):
        raise ConfigError(f"{key} is {shown(repr(file))}, expected the path of a YAML file with a section materials.")
    path = expand_path(str(file), key)
    found = read_case_file(path).get("materials")
    if not isinstance(found, dict) or not found:
        raise ConfigError(f"{key}: {path} has no section materials, expected one, as calibrated.yaml has it.")
    return found
