"""Section ``materials`` of a new case: starting laws of the materials to calibrate, and given laws of the others."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pydantic import ValidationError

from radcal.config import FILL_IN
from radcal.config.landcover import starting_keys, starting_levels
from radcal.config.materials import Material
from radcal.errors import ConfigError

__all__ = ["Fixed", "MaterialLines", "Raw", "fixed_laws", "material_lines", "scalar"]

# bounds of X1 for real surfaces [dB], because the default bounds of the law are for levels above 0 dB
_X1, _INSIDE_DB = (-40.0, 0.0), 2.0  # bounds of X1, and smallest distance of a start from the bounds
_BOUNDS = f"[[{_X1[0]:g}, {_X1[1]:g}], [0, 20], [0, 25], [0, 12]]"
_HIDDEN = "[-24, 10, 14, 5]"  # X inside the bounds
_CONSTANT = "constant_gamma"
_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")
_PLAIN = re.compile(r"[A-Za-z./~$][A-Za-z0-9_./${}-]*")
_NOT_TEXT = ("y", "n", "yes", "no", "on", "off", "true", "false", "null", "~")


class Raw(str):
    """Text in YAML, which is written without change."""

    __slots__ = ()


def scalar(value: object) -> str:
    """Text of a value in YAML."""
    if isinstance(value, Raw):
        return value
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and value.lower() not in _NOT_TEXT
        return value if plain else json.dumps(value, ensure_ascii=False)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Fixed:
    """Law of a material that is not calibrated, and its parameters in the units of the law."""

    law: str
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class MaterialLines:
    """Content of section ``materials`` in a new case file.

    Attributes
    ----------
    lines : list of str
        Lines in YAML.
    hidden : str
        Laws of the materials to calibrate in a synthetic image, in YAML.
    undecided : list of str
        Keys without a value; a key that lacks several values is repeated.
    """

    lines: list[str]
    hidden: str
    undecided: list[str]


def fixed_laws(words: Iterable[str]) -> dict[str, Fixed]:
    """Laws of materials by name, from words such as ``water=-17`` (gamma in dB) or ``road=mangia:-28,8,14,8``.

    Raises
    ------
    ConfigError
        A word has another form, the law does not exist, or the law has another number or range of parameters.
    """
    found = {}
    for word in words:
        name, equals, said = word.partition("=")
        law, colon, numbers = said.partition(":")
        values = [text.strip() for text in (numbers if colon else said).split(",")]
        if not (equals and name.strip() and all(_NUMBER.fullmatch(text) for text in values)):
            raise ConfigError(f"--fixed {word}: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.")
        fixed = Fixed(law.strip() if colon else _CONSTANT, tuple(map(float, values)))
        try:
            Material(law=fixed.law, parameters=list(fixed.parameters))
        except ValidationError as error:
            why = error.errors()[0]["msg"].removeprefix("Value error, ").rstrip(".")
            raise ConfigError(f"--fixed {word}: {why}.") from None
        found[name.strip()] = fixed
    return found


def material_lines(
    names: Mapping[int, str],
    counts: Mapping[int, int],
    calibrated: Iterable[str],
    fixed: Mapping[str, Fixed],
    landcover: str | None,
) -> MaterialLines:
    """Lines of all materials: bounds and start for the materials to calibrate, and laws for the other materials.

    Parameters
    ----------
    names, counts : mapping
        Name and number of pixels of each code of the land cover.
    calibrated : iterable of str
        Materials to calibrate; if empty, all materials without a law in ``fixed``.
    fixed : mapping
        Given laws by material.
    landcover : str or None
        Land-cover map that gives the laws of materials that are neither calibrated nor in ``fixed``.

    Raises
    ------
    ConfigError
        A material is not in the land cover.
    """
    chosen = list(calibrated) or [name for name in names.values() if name not in fixed]
    for name in [*chosen, *fixed]:
        if names and name not in names.values():
            known = ", ".join(names.values())
            raise ConfigError(f"there is no material {name!r} in the land cover (known: {known}).")
    others = [name for name in names.values() if name not in chosen and name not in fixed]
    presets = [starting_keys(landcover, name, {}) for name in others] if landcover else []
    taken = [one.parameters[0] for one in fixed.values() if one.law == _CONSTANT]
    taken += [keys["parameters"][0] for keys in presets if keys]
    listed: list[tuple[int | None, str]] = list(names.items()) or [
        (None, name) for name in dict.fromkeys([*chosen, *fixed])
    ]
    levels = starting_levels([name for _, name in listed if name in chosen], taken)
    total = sum(counts.values())
    lines, undecided = list[str](), list[str]()
    for code, name in listed:
        seen = "" if code is None else f"  # code {code}: {counts.get(code, 0):,} of {total:,} pixels"
        lines.append(f"  {scalar(name)}:{seen}")
        if name in chosen:
            start = ", ".join(f"{x:g}" for x in levels[name].start(_X1[0] + _INSIDE_DB, _X1[1] - _INSIDE_DB))
            lines += [
                "    calibrate: true",
                "    law: mangia  # or another one of docs/laws.md",
                f"    bounds: {_BOUNDS}  # wide ones for levels of real surfaces in dB: narrow them",
                f"    start: [{start}]  # {levels[name]}: the image at the start needs contrast",
            ]
        elif name not in fixed and landcover is not None:
            lines.append("    calibrate: false  # with the starting law of docs/landcover.md: a guess of its level")
        else:
            undecided += ["materials.fixed"] * (name not in fixed)
            lines += _fixed_lines(fixed.get(name))
    hidden = ", ".join(f"{scalar(name)}: {_HIDDEN}" for _, name in listed if name in chosen)
    if not (names or chosen):
        lines += [f"  {FILL_IN}: {{calibrate: true}}  # name of a material, and its law (docs/laws.md)"]
        undecided.append("materials")
    return MaterialLines(lines, hidden, undecided)


def _fixed_lines(fixed: Fixed | None) -> list[str]:
    """YAML lines of a material with a fixed law; without ``fixed``, the lines hold a placeholder to be replaced."""
    level = FILL_IN if fixed is None else ", ".join(f"{x:.10g}" for x in fixed.parameters)
    law = _CONSTANT if fixed is None else fixed.law
    about = "gamma [dB]" if law == _CONSTANT else "of this law (docs/laws.md)"
    such = ", for example parameters: [-15]" * (fixed is None)
    return [f"    law: {law}  # not calibrated", f"    parameters: [{level}]  # {about}{such}"]
