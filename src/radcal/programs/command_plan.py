"""Program, files, placeholders and seed of an external simulator, checked before its first run.

Placeholders must write numbers that resolve the bounds of a parameter, and distinct seeds. A format with few digits
makes the image change in steps, which no surrogate can represent, or gives the program values outside of the bounds.
"""

from __future__ import annotations

import platform
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from radcal.config import Case, CommandSimulation, Material, SyntheticMeasurement, expand_path
from radcal.config.inputs import executable_path, files_below
from radcal.config.part import Part
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, SimulatorError
from radcal.programs.placeholders import SEED, Marked, Marker, argument, template
from radcal.sections.simulator import SimulatorConfig
from radcal.seeds import measurement_seed, noise_seed
from radcal.storage.files import file_sha256
from radcal.storage.runs import Parameters

_TRIED = 102  # values of a parameter that are written for the check: the bounds, and 100 between them
_FEWEST = 50  # different numbers that the bounds must be resolved by
_ROUNDING = 0.5 / _FEWEST  # largest share of the interval by which rounding may move a bound outwards


def handed(materials: Mapping[str, Material], parameters: Parameters) -> dict[str, float | int]:
    """Parameters X of materials, by the names of their placeholders, as :meth:`.Material.handed` passes them."""
    each = {name: material.handed(parameters[name]) for name, material in materials.items()}
    return {f"{name}.{key}": x for name, own in each.items() for key, x in own.items()}


class CommandPlan:
    """Program, files, placeholders and seed of an external simulator, checked before the first run.

    Parameters
    ----------
    config : CommandSimulation
        Configuration of the external simulator.
    materials : mapping
        Materials by name, with the names of their parameters.

    Raises
    ------
    ConfigError
        The program, a template or a file is missing, a placeholder is unknown, or radcal would not pass a parameter or
        the seed to the program.
    """

    def __init__(self, config: CommandSimulation, materials: Mapping[str, Material]) -> None:
        self.config = config
        self.executable = executable_path(config.command[0], "simulator.command", config.environment)
        self.files = [expand_path(text, f"simulator.files.{k}") for k, text in enumerate(config.files)]
        self.links = [expand_path(text, f"simulator.links.{k}", folder=True) for k, text in enumerate(config.links)]
        parameters = handed(materials, {name: material.start_parameters for name, material in materials.items()})
        known: dict[str, float | int | str] = {**parameters, SEED: 1}
        paths = dict.fromkeys(("output", "folder", "geometry", "python"), "")
        if config.input is not None:
            paths["input"] = ""
        self.arguments = [
            argument(text, f"simulator.command.{k}").checked({**known, **paths})
            for k, text in enumerate(config.command[1:], start=1)
        ]
        self.templates: list[tuple[Marked, str]] = []
        for k, item in enumerate(config.templates):
            path = expand_path(item.template, f"simulator.templates.{k}.template")
            # latin-1 preserves every byte of the template, in any encoding
            text = path.read_bytes().decode("latin-1")
            marked = template(text, item.delimiter, f"simulator.templates.{k}.template: {path}").checked(known)
            self.templates.append((marked, item.file))
        if config.input is None:
            used = {marker.name for marked in self.texts for marker in marked.markers}
            unused = [name for name in parameters if name not in used]
            if unused:
                raise ConfigError(
                    f"simulator: the parameter {unused[0]} never reaches the program"
                    f"{f' (nor do {len(unused) - 1} more)' if len(unused) > 1 else ''}: put {{{unused[0]}}} into "
                    f"simulator.command, @{unused[0]}@ into a template, or set simulator.input."
                )
            if SEED not in used and not config.seedless:
                raise ConfigError(
                    f"simulator: {SEED} never reaches the program, so that every run has the same random numbers: put "
                    f"{{{SEED}}} into simulator.command, @{SEED}@ into a template, or set simulator.input; for a "
                    "program that takes no seed set simulator.seedless: true."
                )

    @property
    def texts(self) -> list[Marked]:
        """All texts with placeholders: arguments of the command, and templates."""
        return [*self.arguments, *(marked for marked, _ in self.templates)]

    def stage(self, folder: Path) -> None:
        """Copy the configured files into a run's folder, and make the configured symbolic links in this folder."""
        for path in self.files:
            shutil.copy2(path, folder / path.name)
        for path in self.links:
            (folder / path.name).symlink_to(path.resolve())

    def hashes(self) -> dict[str, Any]:
        """SHA-256 of all configured files on which the program's output may depend."""
        config = self.config
        return {
            # for Python, the version replaces the hash, so that an update of the system does not invalidate all runs
            "executable": f"{platform.python_implementation()} {platform.python_version()}"
            if config.command[0] == "{python}"
            else file_sha256(self.executable),
            "templates": [file_sha256(expand_path(item.template, "simulator.templates")) for item in config.templates],
            "files": {path.name: file_sha256(path) for path in self.files},
            "links": self.linked(),
        }

    def linked(self) -> dict[str, str]:
        """SHA-256 of all linked files, by their paths relative to the folder of a run."""
        return {
            str(item.relative_to(path.parent)): file_sha256(item) for path in self.links for item in files_below(path)
        }


def changed_links(case: Part, identity: Mapping[str, Any]) -> str:
    """Sentence about linked files that the program has changed; empty without changes.

    Parameters
    ----------
    case : Part
        Simulator and materials.
    identity : mapping
        Identity of the simulator, computed before the program ran.
    """
    if not isinstance(case.simulator, CommandSimulation):
        return ""
    now, before = CommandPlan(case.simulator, case.materials).linked(), identity["sha256"]["links"]
    changed = sorted(name for name in now.keys() | before.keys() if now.get(name) != before.get(name))
    if not changed:
        return ""
    more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
    return (
        f"simulator.links: {changed[0]}{more} changed while the program ran, so the next command repeats all runs: "
        "let the program write only into the folder in which it runs."
    )


def check_command(case: Case) -> None:
    """Check the configuration of an external simulator without a run; a built-in simulator needs no check.

    Raises
    ------
    ConfigError, SimulatorError
        :class:`CommandPlan`, :func:`.check_numbers` or :func:`.check_seeds` found an error.
    """
    if isinstance(case.simulator, CommandSimulation):
        plan = CommandPlan(case.simulator, case.materials)
        check_numbers(case.materials, plan.texts)
        if case.simulator.input is None:
            check_seeds(case, plan.texts)


def check_image_shape(simulator: SimulatorConfig, shape: tuple[int, ...]) -> None:
    """Raise a ConfigError if a program's raw file is configured with a size other than that of the simulated image.

    Parameters
    ----------
    simulator : SimulatorConfig
        Section ``simulator``; only an external program with ``output.shape`` is checked.
    shape : (int, int)
        Rows (slant range) and columns (azimuth) of the simulated image.
    """
    if not isinstance(simulator, CommandSimulation) or simulator.output.shape is None:
        return
    (rows, columns), given = shape, simulator.output.shape
    stored = (columns, rows) if simulator.output.transpose else (rows, columns)
    if given != stored:
        turned = "false" if simulator.output.transpose else "true"
        other = f"simulator.output.transpose: {turned} if the rows of the file run the other way, else "
        raise ConfigError(
            f"simulator.output.shape is [{given[0]}, {given[1]}], the scene's image has {rows} rows (slant range) and "
            f"{columns} columns (azimuth): write {other * (given == stored[::-1])}shape: [{stored[0]}, {stored[1]}]."
        )


def check_numbers(materials: Mapping[str, Material], texts: Iterable[Marked]) -> None:
    """Raise an error if a placeholder's format cannot write the bounds, or resolves them by too few numbers.

    Parameters
    ----------
    materials : mapping
        Materials by name, with the bounds of the calibrated parameters.
    texts : iterable of Marked
        Arguments and templates.

    Raises
    ------
    ConfigError
        The number written for a bound lies outside of the bounds by more than 1 % of their interval, the values
        between the bounds are written as fewer than 50 different numbers, a bound of an integer parameter is
        written as another number, or a number is wider than the field of its placeholder.
    """
    boxes: dict[str, tuple[float, float, bool]] = {}
    for name, one in materials.items():
        values = one.box if one.calibrate else [(x, x) for x in one.parameters or ()]
        for key, (low, high), whole in zip(one.parameter_names, values, one.integers, strict=True):
            boxes[f"{name}.{key}"] = (low, high, whole)
    for marked in texts:
        for marker in marked.markers:
            if marker.spec and marker.name in boxes:
                _check(marker, *boxes[marker.name], marked.where)


def _check(marker: Marker, low: float, high: float, whole: bool, where: str) -> None:
    """Raise an error if one placeholder cannot write the values of one parameter; fixed ones must fit the field."""
    values = (low, high) if low == high or whole else tuple(map(float, np.linspace(low, high, _TRIED)))
    try:
        texts = [marker.text(int(x) if whole else x, where) for x in values]
    except SimulatorError as error:
        raise ConfigError(str(error)) from None
    try:
        written = [float(text) for text in texts]
    except ValueError:  # a notation such as 30 %, which only the program can read
        return
    if low == high:
        return
    ends = f"{marker.name}:{marker.spec} writes the bounds [{low:g}, {high:g}] of {marker.name} as {texts[0].strip()}"
    ends = f"{where}: {ends} and {texts[-1].strip()}"
    if whole:
        if written != [low, high]:
            raise ConfigError(
                f"{ends}, expected the same whole numbers: write {marker.name}:d, or {marker.name} alone."
            )
        return
    rounding, different = _ROUNDING * (high - low), len(set(written))
    if different < _FEWEST or min(written) < low - rounding or max(written) > high + rounding:
        raise ConfigError(
            f"{ends}, and {_TRIED} values from bound to bound as {different} different numbers, expected at least "
            f"{_FEWEST}, all inside of the bounds: write more digits, or {marker.name} alone for all of them."
        )


def check_seeds(case: Case, texts: Iterable[Marked]) -> None:
    """Raise an error if the placeholders map different seeds of a case to the same number.

    Parameters
    ----------
    case : Case
        The configuration.
    texts : iterable of Marked
        Arguments and templates with placeholders.

    Raises
    ------
    ConfigError
        Two of the following would receive the same number: the runs of the calibration, the final run with fresh random
        numbers, the synthetic measurement.
    SimulatorError
        The text of a seed is wider than the field of its placeholder.
    """
    runs = STAGES["reference_run"].of(case)
    seeds = {
        "the runs of the calibration": noise_seed(runs),
        "the final run with fresh random numbers": noise_seed(runs, fresh=True),
    }
    if isinstance(case.measurement, SyntheticMeasurement):
        seeds["the synthetic measurement"] = measurement_seed(case.simulator, case.measurement.synthetic.seed)
    seen: dict[tuple[str, ...], str] = {}
    places = [(one.where, marker) for one in texts for marker in one.markers if marker.name == SEED]
    for what, seed in seeds.items():
        text = tuple(marker.text(seed, where) for where, marker in places)
        if text and text in seen:
            raise ConfigError(
                f"{places[0][0]}: {SEED} is {text[0].strip()} for {seen[text]} as for {what}: change seed (it is "
                f"{case.seed}), or widen the range."
            )
        seen[text] = what
