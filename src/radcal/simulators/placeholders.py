"""Placeholders for parameters in a program's arguments and in templates of its input files.

Arguments use braces, ``{dyke.X1}``; ``{{`` and ``}}`` are written for braces themselves. Templates use markers between
two delimiters, ``@dyke.X1@``, in the manner of PEST's template files (PEST++ users manual, section 2.3). A number
format may follow a colon: ``@dyke.X1:14.6e@``. Without a format, numbers are written with enough digits to recover the
same double. A seed may first be mapped into a range that includes both ends: ``@noise_seed:1..30000@``. The format of
such a seed, if there is one, follows the range: ``@noise_seed:1..30000:6d@``.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping
from dataclasses import dataclass

from radcal.config import nearest
from radcal.errors import ConfigError, SimulatorError

__all__ = ["SEED", "Marked", "Marker", "argument", "template"]

SEED = "noise_seed"
_RANGE = re.compile(r"\s*(-?\d{1,19})\.\.(-?\d{1,19})\s*(?::(.*))?", re.DOTALL)
_WIDTH = re.compile(r"(?:.?[<>=^])?[-+ ]?z?#?0?(\d+)")


@dataclass(frozen=True)
class Marker:
    """Placeholder for a value.

    Attributes
    ----------
    name : str
        Name of the value, such as ``dyke.X1`` or ``noise_seed``.
    spec : str
        Python's format specification, empty for full precision.
    interval : (int, int) or None
        Range into which a seed is mapped: the smallest number plus the seed modulo the count of numbers.
    """

    name: str
    spec: str = ""
    interval: tuple[int, int] | None = None

    @classmethod
    def read(cls, name: str, spec: str) -> Marker:
        """Marker of a placeholder, from the texts before and after its first colon."""
        found = _RANGE.fullmatch(spec)
        if found is None:
            return cls(name, spec)
        return cls(name, (found[3] or "").strip(), (int(found[1]), int(found[2])))

    def text(self, value: float | int | str, where: str) -> str:
        """Text of a value; a text that is wider than its field is refused."""
        if self.interval is not None:
            low, high = self.interval
            value = low + int(value) % (high - low + 1)
        text = format(value, self.spec) if self.spec else value if isinstance(value, str) else repr(value)
        width = _WIDTH.match(self.spec)
        if width and len(text) > int(width[1]):
            raise SimulatorError(
                f"{where}: {self.name} = {value!r} written as {self.spec} is {text!r}, wider than its field of "
                f"{width[1]} characters: use a wider field, fewer digits or narrower bounds."
            )
        return text


@dataclass(frozen=True)
class Marked:
    """Text with placeholders for values.

    Attributes
    ----------
    parts : tuple of str or Marker
        Texts and markers in their order.
    where : str
        Name of the text in messages.
    """

    parts: tuple[str | Marker, ...]
    where: str

    @property
    def names(self) -> set[str]:
        """Names of all values that the text needs."""
        return {part.name for part in self.parts if isinstance(part, Marker)}

    def places(self, name: str) -> list[Marker]:
        """All placeholders of one value."""
        return [part for part in self.parts if isinstance(part, Marker) and part.name == name]

    def filled(self, values: Mapping[str, float | int | str]) -> str:
        """Text with values in place of the placeholders.

        Raises
        ------
        SimulatorError
            A number is wider than its field.
        """
        return "".join(
            part if isinstance(part, str) else part.text(values[part.name], self.where) for part in self.parts
        )

    def checked(self, known: Mapping[str, float | int | str]) -> Marked:
        """The text with its placeholders, after a check that every name is known and every format can write its value.

        Parameters
        ----------
        known : mapping
            Sample values by name, of the types that will be filled in.

        Raises
        ------
        ConfigError
            An unknown name, or a format that does not fit.
        """
        for part in self.parts:
            if isinstance(part, str):
                continue
            if part.name not in known:
                raise ConfigError(f"{self.where}: unknown placeholder {part.name!r}{nearest(part.name, known)}.")
            if part.interval is not None:
                low, high = part.interval
                if part.name != SEED:
                    raise ConfigError(
                        f"{self.where}: {part.name}:{low}..{high} has a range, which only {SEED} may have."
                    )
                if not low < high:
                    raise ConfigError(f"{self.where}: the range of {SEED} is {low}..{high}, expected lower < upper.")
            try:
                format(known[part.name], part.spec)
            except ValueError as error:
                raise ConfigError(f"{self.where}: {part.name} cannot be written as {part.spec!r} ({error}).") from None
        return self


def argument(text: str, where: str) -> Marked:
    """Read an argument with placeholders in braces.

    Parameters
    ----------
    text : str
        Argument such as ``--x1={dyke.X1}``.
    where : str
        Name of the text in messages.

    Raises
    ------
    ConfigError
        A brace without its partner, or an empty placeholder.
    """
    parts: list[str | Marker] = []
    try:
        for literal, name, spec, conversion in string.Formatter().parse(text):
            parts.append(literal)
            if name is not None:
                if conversion or not name.strip() or "{" in (spec or ""):
                    raise ValueError("expected {name} or {name:format}")
                parts.append(Marker.read(name.strip(), spec or ""))
    except ValueError as error:
        raise ConfigError(f"{where} is {text!r}: {error}; write {{{{ and }}}} for braces.") from None
    return Marked(tuple(parts), where)


def template(text: str, delimiter: str, where: str) -> Marked:
    """Read a template with markers between delimiters.

    Parameters
    ----------
    text : str
        Text of the template; a marker must lie within one line.
    delimiter : str
        Character on both sides of a marker.
    where : str
        Name of the text in messages.

    Raises
    ------
    ConfigError
        A delimiter without its partner, an empty marker, or no marker at all.
    """
    parts: list[str | Marker] = []
    for number, line in enumerate(re.findall(r"[^\n]*\n|[^\n]+", text), start=1):
        pieces = line.split(delimiter)
        if len(pieces) % 2 == 0:
            raise ConfigError(
                f"{where}: line {number} holds {delimiter} {len(pieces) - 1} times, expected pairs around each marker; "
                "if the file needs the character itself, choose another delimiter."
            )
        for k, piece in enumerate(pieces):
            name, _, spec = piece.partition(":")
            # known names are ASCII; any other name is quoted as it was written
            name = name.encode("latin-1", "replace").decode("utf-8", "replace")
            if k % 2 == 0:
                parts.append(piece)
            elif name.strip():
                parts.append(Marker.read(name.strip(), spec.strip()))
            else:
                raise ConfigError(f"{where}: line {number} has an empty marker {delimiter}{piece}{delimiter}.")
    found = Marked(tuple(parts), where)
    if not found.names:
        raise ConfigError(
            f"{where}: no marker between two {delimiter} in it; a file without markers goes to simulator.files."
        )
    return found
