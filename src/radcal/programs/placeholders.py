"""Placeholders for parameters and seed, in the arguments of a program and in templates of its input files.

In arguments, placeholders are written in braces, ``{dyke.X1}``; ``{{`` and ``}}`` stand for literal braces. In
templates, placeholders are markers between two delimiters, ``@dyke.X1@``, as in PEST's template files (PEST++ users
manual, section 2.3). A number format may follow after a colon: ``@dyke.X1:14.6e@``. A number without a format is
written with enough digits to recover the same number in double precision. A seed can be mapped into a range, both ends
included: ``@noise_seed:1..30000@``. A format for the mapped seed follows the range: ``@noise_seed:1..30000:6d@``.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping
from dataclasses import dataclass

from radcal.errors import ConfigError, SimulatorError
from radcal.sections.errors import nearest

SEED = "noise_seed"
_RANGE = re.compile(r"\s*(-?\d{1,19})\.\.(-?\d{1,19})\s*(?::(.*))?", re.DOTALL)
_WIDTH = re.compile(r"(?:.?[<>=^])?[-+ ]?z?#?0?(\d+)")


@dataclass(frozen=True)
class Marker:
    """Placeholder for one value, in an argument or a template.

    Attributes
    ----------
    name : str
        Name of the value, such as ``dyke.X1`` or ``noise_seed``.
    spec : str
        Format specification of Python's ``format``; empty for full precision.
    interval : (int, int) or None
        Range ``(low, high)`` into which a seed is mapped as ``low + seed % (high - low + 1)``; None for no mapping.
    """

    name: str
    spec: str = ""
    interval: tuple[int, int] | None = None

    @classmethod
    def read(cls, name: str, spec: str) -> Marker:
        """Marker from the text of a placeholder: ``name`` precedes the first colon, ``spec`` follows this colon."""
        found = _RANGE.fullmatch(spec)
        if found is None:
            return cls(name, spec)
        return cls(name, (found[3] or "").strip(), (int(found[1]), int(found[2])))

    def text(self, value: float | int | str, where: str) -> str:
        """Text of a value in the format of the placeholder; a text wider than the field raises a SimulatorError."""
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
        Literal texts and markers, in the order of the whole text.
    where : str
        Name of the text in error messages.
    """

    parts: tuple[str | Marker, ...]
    where: str

    @property
    def markers(self) -> list[Marker]:
        """Placeholders of the text."""
        return [part for part in self.parts if isinstance(part, Marker)]

    def filled(self, values: Mapping[str, float | int | str]) -> str:
        """Text with values in place of the placeholders.

        Raises
        ------
        SimulatorError
            The text of a value is wider than the field that the format defines.
        """
        return "".join(
            part if isinstance(part, str) else part.text(values[part.name], self.where) for part in self.parts
        )

    def checked(self, known: Mapping[str, float | int | str]) -> Marked:
        """Check that every placeholder has a known name and a suitable format, and return this object.

        Parameters
        ----------
        known : mapping
            Sample values by name; each has the type of the value that later replaces the placeholder.

        Raises
        ------
        ConfigError
            A placeholder has an unknown name, an impossible range, or a format unsuitable for its value.
        """
        for part in self.markers:
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
    """Parse an argument with placeholders in braces.

    Parameters
    ----------
    text : str
        Argument such as ``--x1={dyke.X1}``.
    where : str
        Name of the text in error messages.

    Raises
    ------
    ConfigError
        A brace is unpaired, or a placeholder is empty.
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
    """Parse a template with markers between delimiters.

    Parameters
    ----------
    text : str
        Text of the template; a marker must lie within one line.
    delimiter : str
        Character on both sides of a marker.
    where : str
        Name of the text in error messages.

    Raises
    ------
    ConfigError
        A delimiter is unpaired, a marker is empty, or the template has no marker.
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
            # all known names are ASCII; an unknown name in UTF-8 is restored for the error message
            name = name.encode("latin-1", "replace").decode("utf-8", "replace")
            if k % 2 == 0:
                parts.append(piece)
            elif name.strip():
                parts.append(Marker.read(name.strip(), spec.strip()))
            else:
                raise ConfigError(f"{where}: line {number} has an empty marker {delimiter}{piece}{delimiter}.")
    found = Marked(tuple(parts), where)
    if not found.markers:
        raise ConfigError(
            f"{where}: no marker between two {delimiter} in it; a file without markers goes to simulator.files."
        )
    return found
