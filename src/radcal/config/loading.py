"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
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


@dataclass
class _Read:
    """Plain data of a case, and where each of its keys stands.

    Attributes
    ----------
    data : dict
        Keys and values.
    origin : str
        Names of the case files, with which a sentence on a key begins that stands in none of them.
    places : dict of str to str
        File and line of each key in dotted form, or the command line.
    wrong : list of Mistake
        Mistakes that :meth:`case` has found.
    """

    data: dict[str, Any]
    origin: str
    places: dict[str, str] = field(default_factory=dict)
    wrong: list[Mistake] = field(default_factory=list)

    def case(self, without: Container[str] = ()) -> Case | None:
        """Case of the sections except those named; None if it has mistakes other than contradictions of sections."""
        data = {name: section for name, section in self.data.items() if name not in without}
        contradictions = list[Mistake]()
        try:
            case = Case.model_validate(data, context=contradictions)
        except ValidationError as error:
            self.wrong = mistakes(error, Case)
            return None
        self.wrong = contradictions
        return case

    def said(self, mistake: Mistake) -> str:
        """Sentence on a mistake, which begins with the place of its key or of the innermost section that has one."""
        key = mistake.key
        while key and key not in self.places:
            key = key.rpartition(".")[0]
        return f"{self.places.get(key, self.origin)}: {shown(mistake.text, 600)}"

    def refused(self) -> ConfigError:
        """Error on the first mistake, which tells how many there are."""
        return ConfigError(first_of([self.said(one) for one in self.wrong]))


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Convert plain data to a typed case, and check keys and values.

    Raises
    ------
    ConfigError
        A key or value is wrong; the message describes the first problem.
    """
    return _right(_Read(dict(data), origin))


def _right(read: _Read) -> Case:
    case = read.case()
    if case is None or read.wrong:
        raise read.refused()
    return case


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
    return _right(_read(files, overrides))


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
    read = _read(files, overrides)
    case = read.case()
    forward = case is not None and "measurement" not in read.data and not case.calibrated
    found = [ConfigError(f"{read.said(one)}.", one) for one in read.wrong if not forward]
    return Loaded(case or read.case(without={one.section for one in read.wrong}), found, forward)


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
        As for :func:`load`, but the message has one line for each mistake; or the simulator cannot evaluate a law, or
        the pass lacks the carrier frequency that a law needs.
    """
    read = _read(files, overrides)
    data = {key: value for key, value in read.data.items() if key not in _OF_CALIBRATION}
    if calibrated is not None and isinstance(own := data.get("materials", {}), dict):
        data["materials"] = {**own, **_materials_of(calibrated, "--materials", read.places)}
    passes = data.get("radar")
    if isinstance(passes, list):  # a case must have a measurement for each pass; a forward run reads none of them
        data["measurement"] = [{}] * len(passes)
    read.data = dict(with_undecided(data))
    case = read.case()
    if case is not None:
        found = [text for one in case.passes for text in one.laws_without_pass()]
        read.wrong = [Mistake(key, f"{key}{text}") for key, text in dict.fromkeys(found)]
    if case is None or read.wrong:
        raise ConfigError("\nradcal: ".join(f"{read.said(one)}." for one in read.wrong))
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
    read = _read(files, overrides)
    if "measurement" not in read.data:
        return None
    case = read.case()
    if case is None or (read.wrong and case.calibrated):
        raise read.refused()
    return case


def _read(files: Sequence[str | Path], overrides: Mapping[str, Any] | None) -> _Read:
    """Plain data merged from configuration files and overrides; parameters and errors as for :func:`load`."""
    from radcal.config.yaml_file import leaves, merged, read_case_file  # imports PyYAML, which jobs do not need

    for variants in (LAWS, READERS, SCENES, SIMULATORS, OBJECTIVES, REGISTRATIONS):
        _ = variants.foreign  # a name of two distributions is refused
    data, places = dict[str, Any](), dict[str, str]()
    for file in files:
        data = merged(data, read_case_file(file, places))
    # the configuration that Snakemake has merged repeats what the files say
    told, changes = dict(leaves(data)), _parsed(overrides or {})
    origin = ", ".join(map(str, files)) or "configuration"
    of_command = f"{origin}, command line"
    places |= {key: of_command for key, value in leaves(changes) if key not in told or told[key] != value}
    data = merged(data, changes)
    if (file := data.pop(MATERIALS_FROM, None)) is not None:
        own = data.get("materials", {})
        # a material of the case replaces the other file's whole material, because keys of two laws must not be combined
        data["materials"] = (
            {**_materials_of(file, MATERIALS_FROM, places, own), **own} if isinstance(own, dict) else own
        )
    return _Read(dict(with_undecided(data)), origin, places)


def _materials_of(file: Any, key: str, places: dict[str, str], kept: Container[str] = ()) -> dict[str, Any]:
    """Materials of a file other than the case file, without those that are ``kept``; ``places`` gets their places."""
    from radcal.config.yaml_file import read_case_file

    if not isinstance(file, str | Path):
        raise ConfigError(f"{key} is {shown(repr(file))}, expected the path of a YAML file with a section materials.")
    path = expand_path(str(file), key)
    theirs = dict[str, str]()
    found = read_case_file(path, theirs).get("materials")
    if not isinstance(found, dict) or not found:
        raise ConfigError(f"{key}: {path} has no section materials, expected one, as calibrated.yaml has it.")
    taken = {name: item for name, item in found.items() if name not in kept}
    inside = tuple(f"materials.{name}." for name in taken)
    others = {key: place for key, place in places.items() if not f"{key}.".startswith(inside)}
    places.clear()
    places |= others | {key: place for key, place in theirs.items() if f"{key}.".startswith(inside)}
    return taken
