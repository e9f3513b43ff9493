"""Search for the files, programs and earlier runs that a case names; a missing file or program is a ConfigError."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from radcal.config.case import Case
from radcal.errors import ConfigError, MissingFile
from radcal.reading.base import reader_of
from radcal.reading.rasters import raster_files
from radcal.reading.vectors import vector_files
from radcal.sections.errors import shown
from radcal.sections.measurement import FileMeasurement
from radcal.sections.scene import SceneSection
from radcal.sections.simulator import CommandSimulation


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
