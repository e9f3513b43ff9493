"""Mistakes that the configuration finds in a case that is not yet written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, TypeVar

from radcal.config import load_with_problems
from radcal.config.undecided import Undecided
from radcal.config.yaml_file import read_value
from radcal.errors import RadcalError

__all__ = ["Answers", "mistakes_of"]

T = TypeVar("T")

_SOURCES = ("scene", "measurement")  # sections whose keys depend on their source

_ORIGIN = "configuration: "  # beginning of messages about data of no file


class Answers:
    """Answers of a user, by key, and sentences on the mistakes in them.

    Parameters
    ----------
    values : mapping
        Values by key in dotted form.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = dict(values)
        self._mistakes: list[str] = []

    def _tried(self, key: str, read: Callable[..., T], *arguments: Any) -> T | None:
        """Result of a function; after an error, the message is kept, and the key counts as not given."""
        try:
            return read(*arguments)
        except RadcalError as error:
            self._mistakes.append(str(error))
            self._values.pop(key, None)
            return None

    def _refuse_unused(self, given: Iterable[str], sections: Mapping[str, Collection[str]]) -> None:
        """Add a sentence for each given key that has no line in the sections of the case, and is known from no file."""
        for key in given:
            section, _, name = key.partition(".")
            if self._values.get(key, "") != "" and name not in sections.get(section, ()):
                sources = " and ".join(f"{one}.source {self._values[f'{one}.source']}" for one in _SOURCES)
                self._mistakes.append(f"{key} is given, but a case with {sources} has no such key.")


def mistakes_of(text: str, typed: Collection[str]) -> list[str]:
    """Sentences on all mistakes in a new case, as ``radcal check`` gives them, without the values still to be decided.

    Parameters
    ----------
    text : str
        Case in YAML.
    typed : collection of str
        Keys that the user has given, in dotted form. A mistake of a key that follows from these is not told beside
        other mistakes.
    """
    # the name of the case is checked with its path; a mistake that was found leaves section materials empty
    data = {key: value for key, value in read_value(text, "radcal new").items() if key != "case" and value is not None}
    errors = [one for one in load_with_problems([], data).found if not isinstance(one.about, Undecided)]
    found = [str(one).removeprefix(_ORIGIN) for one in errors]
    written = {f"{section}.{key}" for section, keys in data.items() if isinstance(keys, dict) for key in keys}
    return [one for one in found if one.partition(" ")[0] not in written - {*typed}] or found
