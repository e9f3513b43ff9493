"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config.case import Case
from radcal.config.inputs import expand_path
from radcal.config.part import Part
from radcal.config.stages import FORWARD, model_of
from radcal.errors import ConfigError
from radcal.laws import LAWS
from radcal.reading.base import READERS
from radcal.sections.base import MATERIALS_FROM, with_undecided
from radcal.sections.errors import Mistake, first_of, mistakes, shown
from radcal.sections.measurement import REGISTRATIONS
from radcal.sections.objectives import OBJECTIVES
from radcal.sections.scene import SCENES
from radcal.sections.simulator import SIMULATORS

__all__ = [
    "Loaded",
    "case_from",
    "load",
    "load_forward",
    "load_measured",
    "load_with_problems",
    "origin_of",
    "read_cases",
]

_SECTIONS = {field.alias or name for name, field in Case.model_fields.items()}
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
        if isinstance(value, str) and key in _SECTIONS - {"case", "seed"}:
            parsed[key] = read_value(value, f"--config {key}")
    return parsed


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Convert plain data to a typed case, and check keys and values.

    Raises
    ------
    ConfigError
        A key or value is wrong; the message describes the first problem.
    """
    return _validated(dict(data), origin)


def _validated(
    data: dict[str, Any], origin: str, contradictions: list[str] | None = None, files: Sequence[str | Path] = ()
) -> Case:
    """Case of plain data; a list given for ``contradictions`` collects those between sections, which are no errors."""
    try:
        return Case.model_validate(data, context=contradictions)
    except ValidationError as error:
        raise ConfigError(f"{origin}: {first_of([one.text for one in _mistakes(error, files)])}") from None


def _mistakes(error: ValidationError, files: Sequence[str | Path]) -> list[Mistake]:
    """Mistakes that pydantic found in a case, with lines of the case files, of which a later one counts."""
    from radcal.config.yaml_file import lines_of

    lines: dict[str, int] = {}
    for file in files:
        lines |= lines_of(file)
    return mistakes(error, Case, lines)


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
    return _validated(read_cases(files, overrides), origin_of(files), None, files)


@dataclass(frozen=True)
class Loaded:
    """Result of reading a case with mistakes.

    Attributes
    ----------
    case : Case or None
        Case with default values in place of all sections with mistakes, for further checks; None if this is no case.
    found : list of ConfigError
        One error for each wrong key and each contradiction between settings.
    forward : bool
        Whether the case has neither a measurement nor a material with ``calibrate: true``, so that it is for
        ``radcal simulate``.
    """

    case: Case | None
    found: list[ConfigError]
    forward: bool = False

    @property
    def problems(self) -> list[str]:
        """One sentence for each error."""
        return [str(error) for error in self.found]


def load_with_problems(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Loaded:
    """Read configuration files and list all wrong keys and values, not only the first.

    Contradictions between sections are listed only if each section by itself is right and complete.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML, or contains a key twice.
    """
    data, origin = read_cases(files, overrides), origin_of(files)
    contradictions: list[str] = []
    try:
        case = Case.model_validate(data, context=contradictions)
    except ValidationError as error:
        wrong = _mistakes(error, files)
    else:
        forward = "measurement" not in data and not case.calibrated
        told = [] if forward else contradictions
        return Loaded(case, [ConfigError(f"{origin}: {shown(text, 600)}.") for text in told], forward)
    found = [ConfigError(f"{origin}: {shown(one.text, 600)}.", one) for one in wrong]
    left_out = {one.section for one in wrong}
    with contextlib.suppress(ValidationError):
        rest = {name: section for name, section in data.items() if name not in left_out}
        return Loaded(Case.model_validate(rest, context=[]), found)
    return Loaded(None, found)


def load_forward(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None, calibrated: str | Path | None = None
) -> Part:
    """Read the sections of a case that a forward run needs, without the sections on measurement and calibration.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.
    calibrated : path, optional
        File whose materials replace those of the case.

    Returns
    -------
    Part
        Sections that a forward run needs; the case need not mark any material ``calibrate: true``.

    Raises
    ------
    ConfigError
        As for :func:`load`; or the simulator cannot evaluate a law, or the pass lacks the carrier frequency that a law
        needs.
    """
    origin = origin_of(files)
    data = {key: value for key, value in read_cases(files, overrides).items() if key not in _OF_CALIBRATION}
    if calibrated is not None and isinstance(own := data.get("materials", {}), dict):
        data["materials"] = {**own, **_materials_of(calibrated, "--materials")}
    passes = data.get("radar")
    if isinstance(passes, list):  # a case must have a measurement for each pass; a forward run reads none of them
        data["measurement"] = [{}] * len(passes)
    case = _validated(data, origin, [], files)
    for one in case.passes:
        for text in one.laws_without_pass():
            raise ConfigError(f"{origin}: {text}.")
    return model_of(*FORWARD).of(case)


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
    data = read_cases(files, overrides)
    if "measurement" not in data:
        return None
    found: list[str] = []
    case = _validated(data, origin_of(files), found, files)
    if found and case.calibrated:
        raise ConfigError(f"{origin_of(files)}: {shown(found[0], 600)}.")
    return case


def origin_of(files: Sequence[str | Path]) -> str:
    """Names of the case files, as text with which error messages begin."""
    return ", ".join(str(f) for f in files) or "configuration"


def read_cases(files: Sequence[str | Path], overrides: Mapping[str, Any] | None) -> dict[str, Any]:
    """Plain data merged from configuration files and overrides; parameters and errors as for :func:`load`."""
    from radcal.config.yaml_file import merged, read_case_file  # imports PyYAML, which workflow jobs do not need

    for variants in (LAWS, READERS, SCENES, SIMULATORS, OBJECTIVES, REGISTRATIONS):
        _ = variants.foreign  # a name of two distributions is refused
    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file))
    data = merged(data, _parsed(overrides or {}))
    if (file := data.pop(MATERIALS_FROM, None)) is not None:
        own = data.get("materials", {})
        # a material of the case replaces the other file's whole material, because keys of two laws must not be combined
        data["materials"] = {**_materials_of(file, MATERIALS_FROM), **own} if isinstance(own, dict) else own
    return dict(with_undecided(data))


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
