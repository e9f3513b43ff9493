"""Functions that make a typed case from case files, command-line settings or plain data, and find what it names.

A file, program or earlier case that is missing is a ConfigError.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config.case import Case
from radcal.config.part import Part
from radcal.config.stages import FORWARD, model_of
from radcal.errors import ConfigError, MissingFile
from radcal.laws import LAWS
from radcal.reading.base import READERS, reader_of
from radcal.reading.intake import raster_files
from radcal.reading.vectors import vector_files
from radcal.sections.base import MATERIALS_FROM, Mistake, first_of, mistakes, mistakes_of, shown, with_undecided
from radcal.sections.measurement import REGISTRATIONS, FileMeasurement
from radcal.sections.objectives import OBJECTIVES
from radcal.sections.scene import SCENES, SceneSection
from radcal.sections.simulator import SIMULATORS, CommandSimulation

_SECTIONS = {field.alias or name for name, field in Case.model_fields.items()}
# sections that a forward run does not read
_OF_CALIBRATION = (
    "measurement", "registration", "objective", "target", "validation", "design", "surrogate", "optimiser",
    "uncertainty", "stop",
)  # fmt: skip


def expand_path(text: str, key: str, folder: bool = False) -> Path:
    """Expand ``~`` and ``${VARIABLES}`` in a configured path, and check that the file exists.

    Parameters
    ----------
    text : str
        Path as written in the case file.
    key : str
        Configuration key, for the error message.
    folder : bool
        Whether the path may also be a folder.

    Raises
    ------
    ConfigError
        An environment variable is not set, or the file is missing or not readable.
    """
    missing = [name for name in re.findall(r"\$\{(\w+)\}", text) if name not in os.environ]
    if missing:
        raise ConfigError(
            f"{key} is {text!r} but the environment variable {missing[0]} is not set: "
            f"type export {missing[0]}=FOLDER first."
        )
    path = Path(os.path.expanduser(os.path.expandvars(text)))
    try:
        found = path.exists()
    except OSError as error:  # the name is too long for the file system
        raise ConfigError(f"{key}: the file {shown(str(path), 200)} cannot be read ({error.strerror}).") from None
    if not found:
        where = "" if path.is_absolute() else f" in {Path.cwd()}, the current folder"
        text = f"{key}: the file {shown(str(path), 200)} does not exist{where}."
        raise ConfigError(text, MissingFile(key, path))
    if not path.is_file() and not (folder and path.is_dir()):
        raise ConfigError(f"{key}: {path} is not a file, expected one.")
    if not os.access(path, os.R_OK):
        raise ConfigError(f"{key}: no permission to read {path}.")
    return path


def executable_path(word: str, key: str, environment: Mapping[str, str]) -> Path:
    """Path of the program that is named by the first word of a command.

    Parameters
    ----------
    word : str
        First word of the command: ``{python}`` for the interpreter that runs radcal, a path that contains a slash, or
        the name of a program on the PATH.
    key : str
        Configuration key, for the error message.
    environment : mapping
        Environment variables that the case configures for the program.

    Raises
    ------
    ConfigError
        The program does not exist or is not executable.
    """
    if word == "{python}":
        return Path(sys.executable)
    if not word.strip():
        raise ConfigError(f"{key}: its first word is empty, expected a program.")
    if "/" not in word:
        found = shutil.which(word, path=environment.get("PATH"))
        if found is None:
            raise ConfigError(
                f"{key}: no program {word!r} on the PATH; write a path, such as ./{word}, for a program elsewhere."
            )
        return Path(found).absolute()
    path = expand_path(word, key)
    if not os.access(path, os.X_OK):
        raise ConfigError(f"{key}: {path} is not executable: type chmod +x {path}.")
    return path.absolute()


def files_below(path: Path) -> list[Path]:
    """Sorted list of all files below a folder; the list contains only ``path`` if ``path`` is a file."""
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def input_files(case: Case) -> dict[str, Path]:
    """Paths of all input files of a case by configuration key, after a check that each file exists.

    Raises
    ------
    ConfigError
        An input file is missing or cannot be read.
    """
    files = dict[str, Path]()
    for _, error in missing_inputs(case, files):
        raise error
    return files


def missing_inputs(case: Case, files: dict[str, Path]) -> list[tuple[str, ConfigError]]:
    """Keys and errors of the input files that are missing or cannot be read; ``files`` gets the others."""
    missing = []
    for key, source in _sources(case):
        try:
            files |= source(key)
        except ConfigError as error:
            missing.append((key, error))
    return missing


def _sources(case: Case) -> Iterator[tuple[str, Callable[[str], dict[str, Path]]]]:
    """Configuration keys, each with the function that finds its input files."""
    scene = case.scene
    of_kind: dict[str, Callable[[Path], list[Path]]] = {
        "raster": lambda path: [path, *raster_files(path, vrt_folders(scene))],
        "file": lambda path: [path, *vector_files(path)],
        "database": scene.files_in,
    }
    named = [(name, getattr(scene, name), kind) for name, kind in scene.files.items()]
    if scene.on_ground:
        named += [(f"objects.{key}", getattr(scene.on_ground, key), "file") for key in ("path", "cross_sections")]
    for name, text, kind in named:
        if text is not None:
            yield f"scene.{name}", partial(_found, text, f"a {kind}", of_kind[kind], kind == "database")
    for number, one in enumerate(case.passes, start=1):
        if isinstance(image := one.measurement, FileMeasurement):
            key = f"measurement.{number}.path" if len(case.radars) > 1 else "measurement.path"
            reader = reader_of(image.path)
            files = partial(_of_image, image, one.radar.polarisation)
            yield key, partial(_found, image.path, reader.called, files, reader.folder)
    if isinstance(case.simulator, CommandSimulation):
        yield "simulator", partial(_simulator_files, case.simulator)


def _found(text: str, called: str, files: Callable[[Path], list[Path]], folder: bool, key: str) -> dict[str, Path]:
    """Path of a key, and paths of the other files that are read with it."""
    path = expand_path(text, key, folder=folder)
    try:
        first, *others = files(path)
    except ValueError as error:
        raise ConfigError(f"{key}: {path} cannot be read as {called} ({error}).") from None
    return {key: first} | {f"{key}.{k}": other for k, other in enumerate(others)}


def _of_image(image: FileMeasurement, polarisation: str, path: Path) -> list[Path]:
    return reader_of(image.path).files(path, polarisation, vrt_folders(image))


def check_reuse(case: Case, results: str | Path) -> None:
    """Raise an error if ``design.reuse`` names a case that has no runs, so that no job starts.

    Parameters
    ----------
    case : Case
        The configuration.
    results : path
        Folder that contains the results folders of all cases.

    Raises
    ------
    ConfigError
        The case that ``design.reuse`` names does not exist or has no runs.
    """
    name = case.design.reuse
    if name is None or any((Path(results) / name / "runs").glob("[!.]*.h5")):
        return
    others = sorted(path.parent.name for path in Path(results).glob("*/runs") if any(path.glob("[!.]*.h5")))
    known = f"one of {', '.join(others)}" if others else "a case that has runs, of which there are none"
    raise ConfigError(f"design.reuse is {name!r}, which has no runs in {results}/{name}/runs, expected {known}.")


def vrt_folders(config: SceneSection | FileMeasurement) -> tuple[Path, ...]:
    """Configured folders that may contain the source files of a mosaic (VRT), besides the folder of the mosaic.

    Raises
    ------
    ConfigError
        A configured folder is missing.
    """
    section = "measurement" if isinstance(config, FileMeasurement) else "scene"
    folders = getattr(config, "vrt_folders", None) or ()
    return tuple(expand_path(text, f"{section}.vrt_folders.{k}", folder=True) for k, text in enumerate(folders))


def _simulator_files(config: CommandSimulation, key: str) -> dict[str, Path]:
    files = {}
    if config.command[0] != "{python}":
        files[f"{key}.command"] = executable_path(config.command[0], f"{key}.command", config.environment)
    for k, item in enumerate(config.templates):
        files[f"{key}.templates.{k}"] = expand_path(item.template, f"{key}.templates.{k}.template")
    for k, text in enumerate(config.files):
        files[f"{key}.files.{k}"] = expand_path(text, f"{key}.files.{k}")
    for k, text in enumerate(config.links):
        for n, path in enumerate(files_below(expand_path(text, f"{key}.links.{k}", folder=True))):
            files[f"{key}.links.{k}.{n}"] = path
    return files


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
