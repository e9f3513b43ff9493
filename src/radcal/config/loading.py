"""Functions that make a typed case from case files, command-line settings or plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config.case import Case
from radcal.config.pydantic_errors import sentence
from radcal.errors import ConfigError

__all__ = ["case_from", "load"]


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
    from radcal.config.yaml_file import (
        merged,
        read_case_file,
    )  # this module imports PyYAML, which workflow jobs do not need

    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file))
    data = merged(data, _parsed(overrides or {}))
    return case_from(data, ", ".join(str(f) for f in files) or "configuration")
