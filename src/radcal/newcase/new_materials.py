"""Section ``materials`` of a new case: starting laws of the materials to calibrate, and given laws of the others."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from radcal.config import FILL_IN, Case
from radcal.errors import ConfigError
from radcal.seeds import derived_rng
from radcal.tables.landcover import StartingLevel, starting_keys, starting_levels

__all__ = ["Fixed", "Materials", "Raw", "fixed_laws", "material_lines", "scalar"]

_X1 = (-40.0, 0.0)  # bounds of X1 [dB] where no level is read from an image
_AROUND_DB = 10.0  # distance of the bounds of X1 from the levels of the image
_BELOW_DB, _ABOVE_DB, _STEP_DB = 10.0, 2.0, 5.0  # smallest distances of a start from the bounds, and their rounding
_UPPER = (20, 25, 12)  # upper bounds of X2 to X4
# shares of the bounds between which hidden X2 to X4 are drawn; largest difference of the hidden level from the start
_DRAWN, _AWAY_DB = (0.1, 0.7), 2.0
_MIDDLE = math.radians(45.0)  # incidence of that level
_CONSTANT = "constant_gamma"
_NUMBERS = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?(\s*,\s*[-+]?\d+(\.\d*)?([eE][-+]?\d+)?)*")
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


@dataclass
class Materials:
    """Content of section ``materials`` in a new case file.

    Attributes
    ----------
    lines : list of str
        Lines in YAML.
    hidden : dict
        Parameters of the hidden law of each material to calibrate, in YAML, for a synthetic image.
    undecided : list of str
        Keys without a value; a key that lacks several values is repeated.
    """

    lines: list[str] = field(default_factory=list)
    hidden: dict[str, str] = field(default_factory=dict)
    undecided: list[str] = field(default_factory=list)


def fixed_laws(words: Iterable[str]) -> dict[str, Fixed]:
    """Laws of materials by name, from words such as ``water=-17`` (gamma in dB) or ``road=mangia:-28,8,14,8``.

    Raises
    ------
    ConfigError
        A word has another form, or two laws are given for a material.
    """
    found = dict[str, Fixed]()
    for word in words:
        name, _, said = (part.strip() for part in word.partition("="))
        law, colon, numbers = said.rpartition(":")
        if not name or not _NUMBERS.fullmatch(numbers.strip()):
            raise ConfigError(f"--fixed {word}: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.")
        if name in found:
            raise ConfigError(f"--fixed {word}: a law of {name} is given twice, expected once.")
        found[name] = Fixed(law if colon else _CONSTANT, tuple(float(text) for text in numbers.split(",")))
    return found


def material_lines(
    names: Mapping[int, str],
    counts: Mapping[int, int],
    calibrated: Sequence[str],
    fixed: Mapping[str, Fixed],
    landcover: str | None,
    calibrates: bool = True,
    levels_db: tuple[float, float, float] | None = None,
) -> Materials:
    """Lines of all materials: bounds and start for the materials to calibrate, and laws for the other materials.

    Parameters
    ----------
    names, counts : mapping
        Name and number of pixels of each code of the land cover.
    calibrated : sequence of str
        Materials to calibrate; if empty, all materials without a law in ``fixed``.
    fixed : mapping
        Given laws by material.
    landcover : str or None
        Land-cover map that gives the laws of materials that are neither calibrated nor in ``fixed``.
    calibrates : bool
        Whether materials are calibrated; otherwise each material without a law gets its starting level.
    levels_db : (float, float, float), optional
        Lowest, median and highest level of the measured image [dB], about which X1 is searched.

    Raises
    ------
    ConfigError
        Materials are not in the land cover, or are both calibrated and fixed.
    """
    for name in (*calibrated, *fixed):
        if name in calibrated and name in fixed:
            raise ConfigError(f"{name} has --material (it is calibrated) and --fixed (it is not), expected one.")
        if names and name not in names.values():
            raise ConfigError(f"there is no material {name!r} in the land cover (known: {', '.join(names.values())}).")
    chosen = calibrated or [name for name in names.values() if name not in fixed and calibrates]
    listed: list[tuple[int | None, str]] = list(names.items()) or [
        (None, name) for name in dict.fromkeys([*chosen, *fixed])
    ]
    others = [name for _, name in listed if name not in chosen and name not in fixed]
    presets = [starting_keys(landcover, name, {}) for name in others] if landcover else []
    taken = [one.parameters[0] for one in fixed.values() if one.law == _CONSTANT]
    taken += [keys["parameters"][0] for keys in presets if keys]
    x1 = _X1 if levels_db is None else (levels_db[0] - _AROUND_DB, levels_db[2] + _AROUND_DB)
    unknown = {} if levels_db is None else {"unknown_db": float(round(levels_db[1]))}
    levels = starting_levels([name for _, name in listed if name in chosen], taken, **unknown)
    found = Materials()
    for code, name in listed:
        seen = "" if code is None else f"  # code {code}: {counts.get(code, 0):,} of {sum(counts.values()):,} pixels"
        found.lines.append(f"  {scalar(name)}:{seen}")
        if name in chosen:
            start = levels[name].start(-math.inf, math.inf)
            low, high = _bounds(start, x1)
            found.hidden[name] = _hidden(name, start, (low, high))
            found.lines += [
                "    calibrate: true",
                "    law: mangia  # or another one of docs/laws.md",
                f"    bounds: {[[low, high], *([0, upper] for upper in _UPPER)]}  # in dB: narrow them",
                f"    start: [{', '.join(f'{x:g}' for x in start)}]  # {_about(name, levels[name])}; the image at the "
                "start needs contrast",
            ]
        elif name not in fixed and landcover is not None:
            found.lines.append(
                "    calibrate: false  # with the starting law of docs/landcover.md: a guess of its level"
            )
        elif name not in fixed and not calibrates:  # one by one, because only a registration needs levels that differ
            (level,) = starting_levels([name]).values()
            found.lines.append(f"    law: {_CONSTANT}  # {_about(name, level)}")
            found.lines.append(f"    parameters: [{level.gamma_db:g}]  # gamma [dB]")
        elif name in fixed:
            found.lines.append(f"    law: {fixed[name].law}  # not calibrated")
            found.lines.append(f"    parameters: [{', '.join(f'{x:.10g}' for x in fixed[name].parameters)}]")
        else:
            found.undecided.append("materials.fixed")
            found.lines.append(f"    law: {_CONSTANT}  # not calibrated")
            found.lines.append(f"    parameters: [{FILL_IN}]  # gamma [dB], for example parameters: [-15]")
    if not (names or chosen):
        law = "{calibrate: true}" if calibrates else f"{{law: {_CONSTANT}, parameters: [-15]}}"
        found.lines.append(f"  {FILL_IN}: {law}  # name of a material, and its law (docs/laws.md)")
        found.undecided.append("materials")
    return found


def _about(name: str, level: StartingLevel) -> str:
    """Source of a material's starting level, in words."""
    if level.terrain is not None:
        return str(level)
    moved = ", moved apart from another material" * level.moved
    return f"no starting law is known for {name!r} (docs/landcover.md), gamma {level.gamma_db:g} dB is a guess{moved}"


def _bounds(start: Sequence[float], x1: tuple[float, float]) -> tuple[int, int]:
    """Bounds of X1 [dB], wider than ``x1`` if the start would lie near them or outside."""
    low = math.floor((start[0] - _BELOW_DB) / _STEP_DB) * _STEP_DB
    high = math.ceil((start[0] + _ABOVE_DB) / _STEP_DB) * _STEP_DB
    return math.floor(min(low, x1[0])), math.ceil(max(high, x1[1]))


def _hidden(name: str, start: Sequence[float], bounds: tuple[int, int]) -> str:
    """Parameters of a hidden law in YAML, drawn for each material: other shape than the start, and similar level.

    Parameters
    ----------
    name : str
        Name of the material, from which the random numbers follow.
    start : sequence of 4 float
        Parameters of the starting law.
    bounds : (int, int)
        Bounds of X1 [dB].
    """
    rng = derived_rng(Case.model_fields["seed"].default, "new", "hidden law", name)
    x2, x3, x4 = rng.uniform(*_DRAWN, 3) * _UPPER
    level = start[0] + start[1] * math.cos(_MIDDLE) + rng.uniform(-_AWAY_DB, _AWAY_DB)
    x1 = level - x2 * math.cos(_MIDDLE) - x3 * math.exp(-x4 * _MIDDLE**2)
    return f"[{', '.join(f'{x:.1f}' for x in (np.clip(x1, bounds[0] + 1, bounds[1] - 1), x2, x3, x4))}]"
