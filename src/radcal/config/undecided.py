"""Search for values that a case still lacks (``FILL_IN``): their keys and lines, and what the user must write there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from radcal.sections.base import EXAMPLES, MATERIALS_FROM

__all__ = ["EXAMPLES", "FILL_IN", "Undecided", "undecided"]

FILL_IN = "FILL_IN"  # mark of a missing value in a case that radcal new has written; the user must replace it


@dataclass(frozen=True)
class Undecided:
    """Value or material name in a case for which ``FILL_IN`` is still written.

    Attributes
    ----------
    place : tuple
        Keys that lead to the value; for a value in a list, the keys that lead to the list.
    line : int or None
        Line of the case file, from 1; None for a value that was set on the command line.
    """

    place: tuple[int | str, ...]
    line: int | None

    @property
    def key(self) -> str:
        """Key in dotted form."""
        return ".".join(map(str, self.place))

    @property
    def text(self) -> str:
        """Sentence that says which value the user must write at which key, with an example, without a full stop."""
        key, line = self.place[-1], "" if self.line is None else f" (line {self.line})"
        if key == FILL_IN:
            return (
                f"{self.key} is {FILL_IN}{line}, expected the name of a material of the scene in its place, for "
                "example crops: {calibrate: true}"
            )
        example = EXAMPLES.get(f"{self.place[0]}.{key}")
        such = "its value" if example is None else f"its value, for example {key}: {example}"
        return f"{self.key} is {FILL_IN}{line}, expected {such}"


def undecided(data: Mapping[str, Any], files: Sequence[str | Path] = ()) -> list[Undecided]:
    """List of all values of a case for which ``FILL_IN`` is still written.

    Parameters
    ----------
    data : mapping
        Plain data of the case.
    files : sequence of path
        Case files that the data were read from; a later file overrides an earlier one.
    """
    places = list(_marked(data))
    if not places:
        return []
    from radcal.config.yaml_file import lines_of

    lines: dict[str, int] = {}
    for file in files:
        lines |= lines_of(file)
    return [Undecided(place, lines.get(".".join(map(str, place)))) for place in places if place[0] != MATERIALS_FROM]


def _marked(data: Any, above: tuple[int | str, ...] = ()) -> Iterator[tuple[int | str, ...]]:
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        place = (*above, key)
        if FILL_IN in (value, key):
            yield above if isinstance(data, list) else place
        else:
            yield from _marked(value, place)
