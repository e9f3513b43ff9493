"""Typed cases from files, from the command line and from plain data."""

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
    """Overrides in which sections given as text on the command line are parsed to data."""
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
        One sentence about the first problem found.
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
        YAML files; keys of later files override those of earlier ones.
    overrides : mapping, optional
        Settings of ``snakemake --config``, or Snakemake's merged configuration; nested
        values may be text.

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML, a key is given twice, or a value is refused.
    """
    from radcal.config.yaml_file import merged, read_case_file  # imports PyYAML, which jobs do not need

    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file))
    data = merged(data, _parsed(overrides or {}))
    return case_from(data, ", ".join(str(f) for f in files) or "configuration")
