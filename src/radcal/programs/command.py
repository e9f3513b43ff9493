"""External simulators: programs that radcal starts once per run, in a separate folder for each run."""

from __future__ import annotations

import json
import logging
import shlex
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from radcal.config import CommandSimulation
from radcal.config.inputs import executable_path
from radcal.config.part import Part
from radcal.errors import ConfigError, SimulatorError, StoreError, WrongNumbers
from radcal.programs.command_plan import CommandPlan, check_image_shape, handed
from radcal.programs.placeholders import SEED
from radcal.programs.process import output_tail, run_program
from radcal.reading.arrays import read_array
from radcal.reading.images import NOT_FINITE, ImageFile, Values, reading, to_db
from radcal.sections.simulator import Output
from radcal.storage.files import atomic, case_folder, working_folder
from radcal.storage.runs import Parameters

if TYPE_CHECKING:
    from radcal.radar.geometry import Geometry

_VERSION_SECONDS = 60.0
_MEND = (
    ": mend the program (and its simulator.version, if none of its files changes), or set bounds in which it computes "
    "all pixels"
)

logger = logging.getLogger(__name__)


class _Failed(SimulatorError):
    """Failed run for which a retry may succeed."""


class CommandSimulator:
    """External program with the interface of :class:`radcal.simulators.base.Simulator`.

    Parameters
    ----------
    case : Part
        Program, materials and pass, whose description may be written into the input file.
    geometry : Geometry
        Image grid and pixels of the materials.
    geometry_path : path
        Path of the geometry file, which the program may read.

    Raises
    ------
    ConfigError
        The configured size of a raw file is not that of the image.
    """

    def __init__(self, case: Part, geometry: Geometry, geometry_path: str | Path) -> None:
        assert isinstance(case.simulator, CommandSimulation)  # noqa: S101 - the kind of this class
        check_image_shape(case.simulator, geometry.shape)
        self._config, self._plan = case.simulator, CommandPlan(case.simulator, case.materials)
        self._materials, self._radar, self._geometry = case.materials, case.radar, geometry
        self._calibrated = [name for name, material in case.materials.items() if material.calibrate]
        self._geometry_path = Path(geometry_path).absolute()
        self._work = case_folder(geometry_path) / "external"

    @classmethod
    def of(cls, case: Part, geometry: Geometry, geometry_path: str | Path) -> CommandSimulator:
        """Simulator of the configured program and pass."""
        return cls(case, geometry, geometry_path)

    @cached_property
    def identity(self) -> Mapping[str, Any]:
        """Name, version and command line of the program, settings for reading its image, and hashes of all its files.

        Raises
        ------
        SimulatorError
            The program of ``version_command`` failed or printed nothing.
        """
        config = self._config
        return {
            "kind": "command",
            "name": config.name or Path(config.command[0]).name,
            "version": config.version if config.version_command is None else self._version(config.version_command),
            "command": list(config.command),
            # a later key, which is left out if it has its default, so that earlier runs keep their keys
            "input": config.input.model_dump(mode="json", exclude={"radar"} if config.input.radar else None)
            if config.input is not None
            else None,
            "templates": [item.model_dump(mode="json", exclude={"template"}) for item in config.templates],
            "environment": dict(config.environment),
            "output": config.output.model_dump(mode="json"),
            "sha256": self._plan.hashes(),
        }

    def run(self, parameters: Parameters, noise_seed: int) -> NDArray[np.float32]:
        """Run the program; after a failure, repeat the run up to ``retries`` times.

        Parameters
        ----------
        parameters : mapping
            Law parameters X by material.
        noise_seed : int
            Seed of speckle and noise, which the program receives.

        Returns
        -------
        ndarray of float32, shape (slant range, azimuth)
            Image [dB]. Outside the calibrated materials, pixels without a value are NaN.

        Raises
        ------
        SimulatorError
            The program failed in every attempt, or its output is not an image of this scene.
        """
        attempts = self._config.retries + 1
        for attempt in range(1, attempts + 1):
            try:
                with self._folder("simulator.command", f", attempt {attempt} of {attempts}" * (attempts > 1)) as folder:
                    return self._attempt(folder, parameters, noise_seed)
            except _Failed as failure:
                if attempt == attempts:
                    raise
                wait = self._config.retry_wait_s * 2.0 ** (attempt - 1)
                logger.warning("%s Tried again in %g s.", failure, wait)
                time.sleep(wait)
        raise AssertionError  # the last attempt returns or raises

    @contextmanager
    def _folder(self, key: str, remark: str = "") -> Iterator[Path]:
        """Folder with the program's files for one run: removed after success (unless kept), renamed after failure."""
        folder = working_folder(self._work).absolute()
        ended = folder.name.rsplit("-", 1)[-1]
        try:
            try:
                self._plan.stage(folder)
            except OSError as error:
                raise StoreError(f"{folder}: cannot be filled ({error.strerror or error}).") from error
            yield folder
        except (SimulatorError, ConfigError) as error:
            text = str(error).removesuffix(".")
            text = text if text.startswith("simulator.") else f"{key}: {text}"
            if not folder.is_dir():  # the program has removed the folder, or replaced it by a file
                raise type(error)(f"{text}{remark}.") from None
            kept = self._work / f"failed-{ended}"
            folder.rename(kept)
            text = text.replace(str(folder), str(kept))
            raise type(error)(f"{text}; its folder is kept as {kept}{remark}.") from None
        finally:
            if folder.exists():
                if self._config.keep_folders and key == "simulator.command":
                    folder.rename(self._work / f"run-{ended}")
                else:
                    shutil.rmtree(folder, ignore_errors=True)

    def write_input(self, folder: Path, parameters: Parameters, noise_seed: int) -> list[Path]:
        """Write the input files and the command line of a run, each file atomically, without starting the program.

        Parameters
        ----------
        folder : path
            Folder of the files; the command line contains paths in this folder.
        parameters, noise_seed
            As for :meth:`run`.

        Returns
        -------
        list of path
            Paths of the input files, and of ``command.txt`` with the command line for a POSIX shell.
        """
        command, texts = self._filled(folder.absolute(), parameters, noise_seed)
        return _write(folder, {**texts, "command.txt": (shlex.join(command) + "\n").encode()})

    def _filled(self, folder: Path, parameters: Parameters, noise_seed: int) -> tuple[list[str], dict[str, bytes]]:
        """Command line of a run in a folder, and content of each input file by file name."""
        config = self._config
        output = folder / config.output.file
        values: dict[str, float | int | str] = {**handed(self._materials, parameters)}
        values |= {SEED: noise_seed, "output": str(output), "folder": str(folder), "geometry": str(self._geometry_path)}
        values["python"] = str(executable_path("{python}", "simulator.command", {}))
        texts: dict[str, bytes] = {}
        if config.input is not None:
            values["input"] = str(folder / config.input.file)
            texts[config.input.file] = self._input_text(parameters, noise_seed).encode()
        texts |= {file: marked.filled(values).encode("latin-1") for marked, file in self._plan.templates}
        return [str(self._plan.executable), *(marked.filled(values) for marked in self._plan.arguments)], texts

    def _attempt(self, folder: Path, parameters: Parameters, noise_seed: int) -> NDArray[np.float32]:
        config = self._config
        output = folder / config.output.file
        command, texts = self._filled(folder, parameters, noise_seed)
        _write(folder, texts)
        output.parent.mkdir(parents=True, exist_ok=True)
        ended = run_program(command, folder, config.environment, config.timeout_s)
        program = self._plan.executable.name
        if ended.code is None:
            raise _Failed(f"{program} {ended} (simulator.timeout_s: {config.timeout_s:g}), {output_tail(folder)}")
        if ended.code not in config.accept_exit_codes:
            accepted = f"{', '.join(map(str, config.accept_exit_codes))} (simulator.accept_exit_codes)"
            raise _Failed(f"{program} {ended}, expected {accepted}, {output_tail(folder)}")
        if not output.is_file():
            left = "a folder" if output.is_dir() else "no file"
            raise _Failed(
                f"{program} {ended} but left {left} {config.output.file} (simulator.output.file), {output_tail(folder)}"
            )
        try:
            return self._image(output)
        except SimulatorError as error:
            own = {name: self._materials[name] for name in self._calibrated}
            at = ", ".join(f"{key} = {x:.6g}" for key, x in handed(own, parameters).items())
            missing = isinstance(error.about, WrongNumbers) and error.about.what == NOT_FINITE
            raise SimulatorError(
                f"{str(error).removesuffix('.')}, in the run with {at}{_MEND * missing}", error.about
            ) from None

    def _image(self, path: Path) -> NDArray[np.float32]:
        """Read the program's image, check its size, scale and levels, and orient it as the simulated image."""
        config = self._config.output
        shape = self._geometry.shape
        stored = shape[::-1] if config.transpose else shape
        turn = ": change simulator.output.transpose"
        file = ImageFile(path, config, "simulator.output", "file", SimulatorError, stored, turned=turn)
        if config.format == "raw":
            with reading(file, "raw numbers"):
                values = read_raw(file, config, config.shape or stored)
        else:
            values = read_array(file, config.format)
        image, _ = to_db(values, file)
        image = image.T if config.transpose else image
        image = image[:: -1 if config.flip_rows else 1, :: -1 if config.flip_columns else 1]
        for name in self._calibrated:
            pixels = image.ravel()[self._geometry.pixels(name)]
            missing = np.count_nonzero(~np.isfinite(pixels))
            if missing:
                raise file.refused(
                    f"{missing} of the {pixels.size} pixels of {name} in {path} are NaN, infinite or without power, "
                    "expected a value in each",
                    NOT_FINITE,
                )
        return np.ascontiguousarray(image)

    def _input_text(self, parameters: Parameters, noise_seed: int) -> str:
        assert self._config.input is not None  # noqa: S101 - asked by the caller
        toml = self._config.input.format == "toml"  # which has no null
        data: dict[str, Any] = {
            SEED: noise_seed,
            "output": self._config.output.file,
            "shape": list(self._geometry.shape),
            "parameters": {name: material.handed(parameters[name]) for name, material in self._materials.items()},
        }
        if self._config.input.radar:
            data["radar"] = self._radar.model_dump(mode="json", exclude_none=toml)
        return tomli_w.dumps(data) if toml else json.dumps(data, indent=1) + "\n"

    def _version(self, words: Sequence[str]) -> str:
        """Version that the program of ``version_command`` prints."""
        key = "simulator.version_command"
        program = executable_path(words[0], key, self._config.environment)
        with self._folder(key) as folder:
            ended = run_program([str(program), *words[1:]], folder, self._config.environment, _VERSION_SECONDS)
            if ended.code != 0:
                expected = "" if ended.code is None else ", expected 0"
                raise SimulatorError(f"{program.name} {ended}{expected}, {output_tail(folder)}")
            with (folder / "radcal.stdout").open("rb") as file:
                printed = " ".join(file.read(10_000).decode("utf-8", "replace").split())[:200]
            if not printed:
                raise SimulatorError(f"{program.name} printed nothing, expected its version")
            return printed


def _write(folder: Path, texts: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder, each atomically; return their paths."""
    for name, content in texts.items():
        with atomic(folder / name) as partial:
            partial.write_bytes(content)
    return [folder / name for name in texts]


def read_raw(file: ImageFile, config: Output, shape: tuple[int, int]) -> Values:
    """Read the numbers of a raw file; a file of unexpected length raises an error.

    Parameters
    ----------
    file : ImageFile
        Raw file.
    config : Output
        Section with the type of the numbers, the byte order and the length of the header.
    shape : (int, int)
        Numbers of rows and columns, in the order in which the file stores them.

    Raises
    ------
    SimulatorError
        The length of the file does not match type, shape and header.
    """
    dtype = np.dtype(str(config.dtype)).newbyteorder("<" if config.byte_order in (None, "little") else ">")
    header = config.header_bytes or 0
    expected = header + shape[0] * shape[1] * dtype.itemsize
    found = file.path.stat().st_size
    if found != expected:
        raise file.refused(
            f"{file.path} has {found} bytes, expected {expected} for {shape[0]} x {shape[1]} numbers of {config.dtype}"
            f"{f' after a header of {header}' if header else ''}"
        )
    return np.fromfile(file.path, dtype=dtype, offset=header).reshape(shape)
