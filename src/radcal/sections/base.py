"""Base class of all sections of the configuration, check of case names, and names of keys with a special role."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from radcal.errors import ConfigError
from radcal.sections.limits import Count

_LONGEST_NAME = 100  # file systems allow names of 255 bytes, and the names of some files contain the name of the case

# sections that exist in several kinds, and for each section the key that chooses the kind
TAGS = {"scene": "source", "simulator": "kind", "measurement": "source"}

# keys with a section for each pass: a list, or the section itself if there is one pass
PASSES = ("radar", "measurement")


def _case_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", value):
        raise ValueError(f"is {value!r}, expected a letter followed by letters, digits, _ or -")
    if len(value) > _LONGEST_NAME:
        raise ValueError(f"has {len(value)} letters, expected at most {_LONGEST_NAME}: it names a folder")
    return value


def check_case_name(name: str, origin: str) -> None:
    """Raise an error if a name is not allowed as the name of a case.

    Parameters
    ----------
    name : str
        Name of a case.
    origin : str
        Source of the name, such as an option of a command, for the error message.

    Raises
    ------
    ConfigError
        The name is too long, or does not consist of a letter followed by letters, digits, _ or -.
    """
    try:
        _case_name(name)
    except ValueError as error:
        raise ConfigError(f"{origin}: the name of the case {error}.") from None


CaseName = Annotated[str, AfterValidator(_case_name)]


def with_tag(section: str, kind: str) -> BeforeValidator:
    """Validator that inserts the default kind into the data of a section that exists in several kinds."""
    tag = TAGS[section]
    return BeforeValidator(lambda data: {tag: kind, **data} if isinstance(data, dict) and tag not in data else data)


# key of a case file that names another file; before the sections are checked, that file's materials replace the key
MATERIALS_FROM = "materials_from"

# keys that several sections have
VrtFolders = Annotated[
    list[str] | None, Field(description="folders with source files of a VRT mosaic, besides its own folder")
]
Band = Annotated[
    Count | None, Field(description="number of the raster band, from 1; required if the raster has several bands")
]
Dataset = Annotated[
    str | None,
    Field(description="name of the array in an npz, mat or HDF5 file; required if the file has several arrays"),
]

FILL_IN = "FILL_IN"  # mark of a missing value in a case that radcal new has written; the user must replace it


class _Undecided:
    """Value that no key of a case accepts."""


UNDECIDED = _Undecided()


def with_undecided(data: Any) -> Any:
    """Plain data in which ``UNDECIDED`` stands for each value, list and section of the name that hold ``FILL_IN``."""
    if isinstance(data, dict):
        return {key: UNDECIDED if key == FILL_IN else with_undecided(value) for key, value in data.items()}
    if isinstance(data, list):
        return UNDECIDED if FILL_IN in data else [with_undecided(item) for item in data]
    return UNDECIDED if data == FILL_IN else data


class Section(BaseModel):
    """Section of the configuration; it cannot be changed after its creation, and an unknown key is an error."""

    # defer_build: pydantic builds a validator at its first use; a job needs only the validators of its own stage
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
