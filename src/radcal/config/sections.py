"""Base class of all sections of the configuration, type of a case name, and keys that choose the kind of a section."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

from radcal.errors import ConfigError

__all__ = ["DERIVED", "FURTHER", "MATERIALS_FROM", "TAGS", "CaseName", "Section", "check_case_name"]

_LONGEST_NAME = 100  # file systems allow names of 255 bytes, and files named after a case have longer names

# sections that exist in several kinds, and the key that chooses the kind
TAGS = {"scene": "source", "simulator": "kind", "measurement": "source"}

# sections of which each pass has one, and the fields that hold those of the second and later passes
FURTHER = {"radar": "further_radar", "measurement": "further_measurement"}

# fields of a case that are made from other keys, and are absent where these do not give them
DERIVED = (*FURTHER.values(), "colours")


def _case_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", value):
        raise ValueError(f"is {value!r}, expected a letter followed by letters, digits, _ or -")
    if len(value) > _LONGEST_NAME:
        raise ValueError(f"has {len(value)} letters, expected at most {_LONGEST_NAME}: it names a folder")
    return value


def check_case_name(name: str, origin: str) -> None:
    """Raise an error if a name cannot be that of a case.

    Parameters
    ----------
    name : str
        Name of a case.
    origin : str
        Where the name comes from, for the message.

    Raises
    ------
    ConfigError
        The name is no letter followed by letters, digits, _ or -, or it is too long.
    """
    try:
        _case_name(name)
    except ValueError as error:
        raise ConfigError(f"{origin}: the name of the case {error}.") from None


CaseName = Annotated[str, AfterValidator(_case_name)]


# key of a case file that is replaced by the materials of the file that it names, before the sections are checked
MATERIALS_FROM = "materials_from"


class Section(BaseModel):
    """Section of the configuration, which cannot be changed after its creation; an unknown key is an error."""

    # pydantic builds a validator at its first use, because a job needs only the validators of its own stage
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
