"""Section ``materials`` of a new case: starting laws of the materials to calibrate, and given laws of the others."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from radcal.config import FILL_IN, Case
from radcal.config.landcover import StartingLevel, brighter_than_terrain, starting_keys, starting_levels
from radcal.config.materials import Material
from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.seeds import derived_rng

__all__ = ["Fixed", "MaterialLines", "Raw", "fixed_laws", "material_lines", "scalar"]

# bounds of X1 for most real surfaces [dB], because the default bounds of the law are for levels above 0 dB
_X1 = (-40.0, 0.0)
_BELOW_DB, _ABOVE_DB, _STEP_DB = 10.0, 2.0, 5.0  # smallest distances of a start from the bounds, and their rounding
_UPPER = (20, 25, 12)  # upper bounds of X2 to X4
# shares of the bounds between which hidden X2 to X4 are drawn; largest difference of the hidden level from the start
_DRAWN, _AWAY_DB = (0.1, 0.7), 2.0
_MIDDLE = math.radians(45.0)  # incidence of that level
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

    def material(self) -> Material:
        """Material with this law; raises a ValidationError if the law does not exist or takes other parameters."""
        return Material(law=self.law, parameters=list(self.parameters))


@dataclass(frozen=True)
class MaterialLines:
    """Content of section ``materials`` in a new case file.

    Attributes
    ----------
    lines : list of str
        Lines in YAML.
    hidden : dict
        Parameters of the hidden law of each material to calibrate, in YAML, for a synthetic image.
    undecided : list of str
        Keys without a value; a key that lacks several values is repeated.
    findings : list of Finding
        Warnings about given laws that may lack a minus sign.
    """

    lines: list[str]
    hidden: dict[str, str]
    undecided: list[str]
    findings: list[Finding]


def fixed_laws(words: Iterable[str], names: Mapping[int, str]) -> dict[str, Fixed]:
    """Laws of materials by name, from words such as ``water=-17`` (gamma in dB) or ``road=mangia:-28,8,14,8``.

    Parameters
    ----------
    words : iterable of str
        Name and law of each material.
    names : mapping
        Names of the codes of the land cover; empty if they are not known.

    Raises
    ------
    ConfigError
        A word has another form, the material is not in the land cover, the law does not exist, the law has another
        number or range of parameters, or two laws are given for a material. The message has one line for each mistake.
    """
    words = list(words)
    found, wrong = dict[str, Fixed](), list[str]()
    for word in words:
        name, equals, said = word.partition("=")
        law, colon, numbers = said.partition(":")
        values = [text.strip() for text in (numbers if colon else said).split(",")]
        if not (equals and name.strip() and all(_NUMBER.fullmatch(text) for text in values)):
            wrong.append(f"--fixed {word}: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.")
            continue
        fixed = Fixed(law.strip() if colon else _CONSTANT, tuple(map(float, values)))
        try:
            fixed.material()
        except ValidationError as error:
            why = error.errors()[0]["msg"].removeprefix("Value error, ").rstrip(".")
            wrong.append(f"--fixed {word}: {why}.")
        if name.strip() in found:
            wrong.append(f"--fixed {word}: a law of {name.strip()} is given twice, expected once.")
        found[name.strip()] = fixed
    wrong += _unknown([name.strip() for name, equals, _ in (word.partition("=") for word in words) if equals], names)
    if wrong:
        raise ConfigError("\nradcal: ".join(wrong))
    return found


def _unknown(wanted: Iterable[str], names: Mapping[int, str]) -> list[str]:
    """Sentences on names that the land cover lacks; none if its names are not known."""
    known = names.values()
    missing = [name for name in dict.fromkeys(wanted) if names and name not in known]
    return [f"there is no material {name!r} in the land cover (known: {', '.join(known)})." for name in missing]


def material_lines(
    names: Mapping[int, str],
    counts: Mapping[int, int],
    calibrated: Iterable[str],
    fixed: Mapping[str, Fixed],
    landcover: str | None,
    calibrates: bool = True,
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
    calibrates : bool
        Whether materials are calibrated; otherwise each material without a law gets its starting level.

    Raises
    ------
    ConfigError
        Materials are not in the land cover, or are both calibrated and fixed.
    """
    chosen = list(calibrated) or [name for name in names.values() if name not in fixed and calibrates]
    if both := [name for name in fixed if name in chosen]:
        said = (f"{name} has --material (it is calibrated) and --fixed (it is not), expected one." for name in both)
        raise ConfigError("\nradcal: ".join(said))
    if unknown := _unknown(chosen, names):
        raise ConfigError("\nradcal: ".join(unknown))
    others = [name for name in names.values() if name not in chosen and name not in fixed]
    guessed = [] if calibrates or landcover else others
    presets = [starting_keys(landcover, name, {}) for name in others] if landcover else []
    taken = [one.parameters[0] for one in fixed.values() if one.law == _CONSTANT]
    taken += [keys["parameters"][0] for keys in presets if keys]
    listed: list[tuple[int | None, str]] = list(names.items()) or [
        (None, name) for name in dict.fromkeys([*chosen, *fixed])
    ]
    levels = starting_levels([name for _, name in listed if name in chosen], taken)
    for name in guessed:  # one by one, because only a registration needs levels that differ
        levels |= starting_levels([name])
    total = sum(counts.values())
    lines, undecided, hidden = list[str](), list[str](), dict[str, str]()
    for code, name in listed:
        seen = "" if code is None else f"  # code {code}: {counts.get(code, 0):,} of {total:,} pixels"
        lines.append(f"  {scalar(name)}:{seen}")
        if name in chosen:
            start = levels[name].start(-math.inf, math.inf)
            hidden[name] = _hidden(name, start)
            bounds = [list(_bounds(start)), *([0, upper] for upper in _UPPER)]
            lines += [
                "    calibrate: true",
                "    law: mangia  # or another one of docs/laws.md",
                f"    bounds: {bounds}  # wide ones for levels of real surfaces in dB: narrow them",
                f"    start: [{', '.join(f'{x:g}' for x in start)}]  # {_about(name, levels[name])}; the image at the "
                "start needs contrast",
            ]
        elif name in guessed:
            lines.append(f"    law: {_CONSTANT}  # {_about(name, levels[name])}")
            lines.append(f"    parameters: [{levels[name].gamma_db:g}]  # gamma [dB]")
        elif name not in fixed and landcover is not None:
            lines.append("    calibrate: false  # with the starting law of docs/landcover.md: a guess of its level")
        else:
            undecided += ["materials.fixed"] * (name not in fixed)
            lines += _fixed_lines(fixed.get(name))
    if not (names or chosen):
        law = "{calibrate: true}" if calibrates else f"{{law: {_CONSTANT}, parameters: [-15]}}"
        lines += [f"  {FILL_IN}: {law}  # name of a material, and its law (docs/laws.md)"]
        undecided.append("materials")
    bright = (brighter_than_terrain(one.material(), f"--fixed {name}") for name, one in fixed.items())
    return MaterialLines(lines, hidden, undecided, [one for one in bright if one is not None])


def _fixed_lines(fixed: Fixed | None) -> list[str]:
    """YAML lines of a material with a fixed law; without ``fixed``, the lines hold a placeholder to be replaced."""
    level = FILL_IN if fixed is None else ", ".join(f"{x:.10g}" for x in fixed.parameters)
    law = _CONSTANT if fixed is None else fixed.law
    about = "gamma [dB]" if law == _CONSTANT else "of this law (docs/laws.md)"
    such = ", for example parameters: [-15]" * (fixed is None)
    return [f"    law: {law}  # not calibrated", f"    parameters: [{level}]  # {about}{such}"]


def _about(name: str, level: StartingLevel) -> str:
    """Source of a material's starting level, in words."""
    if level.terrain is not None:
        return str(level)
    moved = ", moved apart from another material" * level.moved
    return f"no starting law is known for {name!r} (docs/landcover.md), gamma {level.gamma_db:g} dB is a guess{moved}"


def _bounds(start: Sequence[float]) -> tuple[int, int]:
    """Bounds of X1 [dB]; they are wider than for most surfaces if the start is very dark or very bright."""
    low = math.floor((start[0] - _BELOW_DB) / _STEP_DB) * _STEP_DB
    high = math.ceil((start[0] + _ABOVE_DB) / _STEP_DB) * _STEP_DB
    return round(min(low, _X1[0])), round(max(high, _X1[1]))


def _hidden(name: str, start: Sequence[float]) -> str:
    """Parameters of a hidden law in YAML, drawn for each material: other shape than the start, and similar level.

    Parameters
    ----------
    name : str
        Name of the material, from which the random numbers follow.
    start : sequence of 4 float
        Parameters of the starting law.
    """
    rng = derived_rng(Case.model_fields["seed"].default, "new", "hidden law", name)
    x2, x3, x4 = rng.uniform(*_DRAWN, 3) * _UPPER
    level = start[0] + start[1] * math.cos(_MIDDLE) + rng.uniform(-_AWAY_DB, _AWAY_DB)
    low, high = _bounds(start)
    x1 = level - x2 * math.cos(_MIDDLE) - x3 * math.exp(-x4 * _MIDDLE**2)
    return f"[{', '.join(f'{x:.1f}' for x in (np.clip(x1, low + 1, high - 1), x2, x3, x4))}]"
