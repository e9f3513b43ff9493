"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config import stages
from radcal.config.case import Case
from radcal.config.inputs import expand_path
from radcal.config.pydantic_errors import sentence, shown, wrong_keys
from radcal.config.sections import MATERIALS_FROM
from radcal.errors import ConfigError

__all__ = ["FILL_IN", "case_from", "load", "load_forward", "load_measured", "load_with_problems"]

FILL_IN = "FILL_IN"  # mark of a value that is still to be decided, in a case that radcal new has written
# sections that a forward run does not read
_OF_CALIBRATION = (
    "measurement", "registration", "objective", "target", "validation", "design", "surrogate", "optimiser",
    "uncertainty", "stop",
)  # fmt: skip


def _parsed(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Overrides in which each section that is text, as the command line gives it, is converted to plain data."""
    from radcal.config.yaml_file import read_value

    parsed = dict(overrides)
    for key, value in overrides.items():
        if isinstance(value, str) and key in Case.model_fields.keys() - {"case", "seed"}:
            parsed[key] = read_value(value, f"--config {key}")
    return parsed


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Check plain data and return the typed case.

    Raises
    ------
    ConfigError
        A key or value is wrong; the message names the first problem.
    """
    try:
        return Case.model_validate(dict(data))
    except ValidationError as error:
        raise ConfigError(sentence(error, origin, Case)) from None


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
    data, origin = _read(files, overrides), _origin(files)
    if undecided := list(_undecided(data)):
        more = f" (and {len(undecided) - 1} more)" if len(undecided) > 1 else ""
        raise ConfigError(f"{origin}: {_still(undecided[0])}{more}.")
    return case_from(data, origin)


def load_with_problems(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None
) -> tuple[Case | None, list[str]]:
    """Read configuration files and list all wrong keys and values, not only the first.

    A wrong key is left out, and its section is left out if the key is missing, until the rest is a case.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.

    Returns
    -------
    case : Case or None
        Case without the wrong keys, with which further checks can go on; None if what is left is no case.
    problems : list of str
        One sentence for each wrong key and each contradiction between settings.

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML, or a key occurs twice.
    """
    data, origin = _read(files, overrides), _origin(files)
    undecided = list(_undecided(data))
    problems: list[str] = [_still(place) for place in undecided]
    data = deepcopy(data)
    for place in undecided:
        _leave_out(data, place)
    while True:
        contradictions: list[str] = []
        try:
            case = Case.model_validate(data, context=contradictions)
        except ValidationError as error:
            wrong = wrong_keys(error, Case)
            problems += [key.text for key in wrong]
            rest = deepcopy(data)
            for key in wrong:
                _leave_out(rest, key.place)
            if rest == data:
                return None, _sentences(origin, problems)
            data = rest
        else:
            return case, _sentences(origin, problems + contradictions)


def load_forward(
    files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None, calibrated: str | Path | None = None
) -> stages.Forward:
    """Read the sections of a case that a forward run needs; sections of measurement and calibration are not read.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.
    calibrated : path, optional
        File whose materials replace those of the case.

    Returns
    -------
    stages.Forward
        No material needs to be marked ``calibrate: true``.

    Raises
    ------
    ConfigError
        As for :func:`load`, or a law does not suit simulator or pass.
    """
    origin = _origin(files)
    data = {key: value for key, value in _read(files, overrides).items() if key not in _OF_CALIBRATION}
    if calibrated is not None:
        data["materials"] = {**data.get("materials", {}), **_materials_of(calibrated, "--materials")}
    passes = data.get("radar")
    if isinstance(passes, list):  # an image of each pass, which a case must have and nobody reads
        data["measurement"] = [{}] * len(passes)
    ignored: list[str] = []
    try:
        case = Case.model_validate(data, context=ignored)
    except ValidationError as error:
        raise ConfigError(sentence(error, origin, Case)) from None
    for one in case.passes:
        for text in one.laws_without_pass():
            raise ConfigError(f"{origin}: {text}.")
    return stages.Forward.of(case)


def load_measured(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Case | None:
    """Read a case with a measured image, of which no material need be marked ``calibrate: true``.

    Parameters
    ----------
    files, overrides
        As for :func:`load`.

    Returns
    -------
    Case or None
        None if the files have no section ``measurement``.

    Raises
    ------
    ConfigError
        As for :func:`load`.
    """
    data, found = _read(files, overrides), list[str]()
    if "measurement" not in data:
        return None
    try:
        case = Case.model_validate(data, context=found)
    except ValidationError as error:
        raise ConfigError(sentence(error, _origin(files), Case)) from None
    if found and case.calibrated:
        raise ConfigError(f"{_origin(files)}: {shown(found[0], 600)}.")
    return case


def _sentences(origin: str, problems: Sequence[str]) -> list[str]:
    # a key that was left out may be missed afterwards, or a section changed in between give a text again
    return [f"{origin}: {shown(text, 600)}." for text in dict.fromkeys(problems)]


def _leave_out(data: dict[str, Any], place: Sequence[int | str]) -> None:
    """Remove a key that is wrong, or the innermost section around a key that is missing."""
    inside: Any = data
    above: list[tuple[dict[str, Any], str]] = []
    for part in place:
        if isinstance(inside, dict) and part in inside:
            above.append((inside, str(part)))
            inside = inside[part]
        elif isinstance(inside, list) and isinstance(part, int) and part < len(inside):
            inside = inside[part]
        # any other part is a tag that pydantic inserts, or a missing key
    while above:  # a section without keys would be another mistake
        section, key = above.pop()
        del section[key]
        if section:
            break


def _undecided(data: Any, above: tuple[int | str, ...] = ()) -> Iterator[tuple[int | str, ...]]:
    """Places of values, or of names of keys, that are still to be decided."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        place = (*above, key)
        if FILL_IN in (value, key):
            # an item of a list is decided together with its list
            yield above if isinstance(data, list) else place
        else:
            yield from _undecided(value, place)


def _still(place: Sequence[int | str]) -> str:
    return f"{'.'.join(map(str, place))} is {FILL_IN}, expected a value, which is still to be decided"


def _origin(files: Sequence[str | Path]) -> str:
    return ", ".join(str(f) for f in files) or "configuration"


def _read(files: Sequence[str | Path], overrides: Mapping[str, Any] | None) -> dict[str, Any]:
    """Merged data of configuration files and overrides."""
    from radcal.config.yaml_file import merged, read_case_file  # imports PyYAML, which workflow jobs do not need

    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file))
    data = merged(data, _parsed(overrides or {}))
    if (file := data.pop(MATERIALS_FROM, None)) is not None:
        own = data.get("materials", {})
        # a material of the case replaces the whole material, because keys of two laws do not mix
        data["materials"] = {**_materials_of(file, MATERIALS_FROM), **own} if isinstance(own, dict) else own
    return data


def _materials_of(file: Any, key: str) -> dict[str, Any]:
    """Section ``materials`` of another file, such as ``calibrated.yaml``."""
    from radcal.config.yaml_file import read_case_file

    if not isinstance(file, str | Path):
        raise ConfigError(f"{key} is {shown(repr(file))}, expected the path of a YAML file with a section materials.")
    path = expand_path(str(file), key)
    found = read_case_file(path).get("materials")
    if not isinstance(found, dict) or not found:
        raise ConfigError(f"{key}: {path} has no section materials, expected one, as calibrated.yaml has it.")
    return found
