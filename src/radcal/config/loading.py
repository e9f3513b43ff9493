"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config.case import Case
from radcal.config.inputs import expand_path, missing_inputs
from radcal.config.part import Part
from radcal.config.stages import FORWARD, model_of
from radcal.errors import ConfigError
from radcal.laws import LAWS
from radcal.reading.base import READERS
from radcal.sections.base import MATERIALS_FROM, with_undecided
from radcal.sections.errors import Mistake, first_of, mistakes, mistakes_of, shown
from radcal.sections.measurement import REGISTRATIONS
from radcal.sections.objectives import OBJECTIVES
from radcal.sections.scene import SCENES
from radcal.sections.simulator import SIMULATORS

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
class Loaded:
    """Case from plain data, which may have mistakes.

    Attributes
    ----------
    data : dict
        Keys and values.
    origin : str
        Names of the case files, with which a sentence on a key begins that stands in none of them.
    places : dict of str to str
        File and line of each key in dotted form, or the command line.
    case : Case or None
        The case; None if a key is wrong.
    mistakes : list of Mistake
        Wrong keys; if there are none, contradictions between sections.
    """

    data: dict[str, Any]
    origin: str = "configuration"
    places: Mapping[str, str] = field(default_factory=dict)
    case: Case | None = field(init=False, default=None)
    mistakes: list[Mistake] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        try:
            self.case = Case.model_validate(self.data)
            self.mistakes = self.case.contradictions()
        except ValidationError as error:
            self.mistakes = mistakes(error, Case)

    @property
    def rest(self) -> Case | None:
        """Case with default values in place of all sections with wrong keys; None if that is no case."""
        wrong = {one.key.partition(".")[0] for one in self.mistakes}
        return self.case or Loaded({name: section for name, section in self.data.items() if name not in wrong}).case

    @property
    def forward(self) -> bool:
        """Whether the case has neither a measurement nor a material to calibrate: it is for ``radcal simulate``."""
        return self.case is not None and "measurement" not in self.data and not self.case.calibrated

    @property
    def problems(self) -> list[str]:
        """One sentence for each mistake."""
        return [] if self.forward else [f"{self.at(one.key, one.text)}." for one in self.mistakes]

    def at(self, key: str, text: object) -> str:
        """Text that begins with the place of a key, or of the innermost section around it that has one."""
        while key and key not in self.places:
            key = key.rpartition(".")[0]
        return f"{self.places.get(key, self.origin)}: {shown(str(text), 600)}"

    def right(self) -> Case:
        """Case without mistakes; a ConfigError tells the first of them, and how many there are."""
        if self.case is None or self.mistakes:
            raise ConfigError(first_of([self.at(one.key, one.text) for one in self.mistakes]))
        return self.case


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Convert plain data to a typed case, and check keys and values.

    Raises
    ------
    ConfigError
        A key or value is wrong; the message describes the first problem.
    """
    return Loaded(dict(data), origin).right()


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
    return load_with_problems(files, overrides).right()


def load_with_inputs(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None
) -> tuple[Case, dict[str, Path]]:
    """Case, and its input files by configuration key; parameters and errors as for :func:`load`, and missing files."""
    loaded, inputs = load_with_problems(files, overrides), dict[str, Path]()
    case = loaded.right()
    for key, error in missing_inputs(case, inputs):
        raise ConfigError(loaded.at(key, error))
    return case, inputs


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
    return Loaded(*_read(files, overrides))


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
    read, origin, places = _read(files, overrides)
    data = {key: value for key, value in read.items() if key not in _OF_CALIBRATION}
    if calibrated is not None and isinstance(own := data.get("materials", {}), dict):
        data["materials"] = {**own, **_materials_of(calibrated, "--materials", places)}
    passes = data.get("radar")
    if isinstance(passes, list):  # a case must have a measurement for each pass; a forward run reads none of them
        data["measurement"] = [{}] * len(passes)
    loaded = Loaded(dict(with_undecided(data)), origin, places)
    if loaded.case is not None:
        loaded.mistakes = mistakes_of(wrong for one in loaded.case.passes for wrong in one.laws_without_pass())
    if loaded.case is None or loaded.mistakes:
        raise ConfigError("\nradcal: ".join(f"{loaded.at(one.key, one.text)}." for one in loaded.mistakes))
    return model_of(*FORWARD).of(loaded.case)


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
    loaded = load_with_problems(files, overrides)
    if "measurement" not in loaded.data:
        return None
    return loaded.case if loaded.case is not None and not loaded.case.calibrated else loaded.right()


def _read(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None
) -> tuple[dict[str, Any], str, dict[str, str]]:
    """Data, origin and places of :class:`Loaded`, from files and overrides; parameters and errors of :func:`load`."""
    from radcal.config.yaml_file import leaves, merged, read_case_file  # imports PyYAML, which jobs do not need

    for variants in (LAWS, READERS, SCENES, SIMULATORS, OBJECTIVES, REGISTRATIONS):
        _ = variants.foreign  # a name of two distributions is refused
    data, places = dict[str, Any](), dict[str, str]()
    for file in files:
        data = merged(data, read_case_file(file, places))
    # the configuration that Snakemake has merged repeats what the files say
    told, changes = dict(leaves(data)), _parsed(overrides or {})
    changed = [key for key, value in leaves(changes) if key not in told or told[key] != value]
    changed += [key for key in told if any(one.startswith(f"{key}.") for one in changed)]  # a section in its place
    origin = ", ".join(map(str, files)) or "configuration"
    places |= dict.fromkeys(changed, f"{origin}, command line")
    data = merged(data, changes)
    if (file := data.pop(MATERIALS_FROM, None)) is not None:
        own = data.get("materials", {})
        # a material of the case replaces the other file's whole material, because keys of two laws must not be combined
        data["materials"] = (
            {**_materials_of(file, MATERIALS_FROM, places, own), **own} if isinstance(own, dict) else own
        )
    return dict(with_undecided(data)), origin, places


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
