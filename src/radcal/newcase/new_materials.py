"""Section ``materials`` of a new case: starting laws of the materials to calibrate, and given laws of the others."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from radcal.config import Case
from radcal.errors import ConfigError
from radcal.sections.base import FILL_IN
from radcal.seeds import derived_rng
from radcal.tables.landcover import starting_keys, starting_levels

_X1 = (-40.0, 0.0)  # bounds of X1 [dB] where no level is read from an image
_AROUND_DB = 10.0  # distance of the bounds of X1 from the levels of the image
_BELOW_DB, _ABOVE_DB, _STEP_DB = 10.0, 2.0, 5.0  # smallest distances of a start from the bounds, and their rounding
_UPPER = (20, 25, 12)  # upper bounds of X2 to X4
# shares of the bounds between which hidden X2 to X4 are drawn; largest difference of the hidden level from the start
_DRAWN, _AWAY_DB = (0.1, 0.7), 2.0
_MIDDLE = math.radians(45.0)  # incidence of that level
_CONSTANT = "constant_gamma"
_NUMBERS = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?(\s*,\s*[-+]?\d+(\.\d*)?([eE][-+]?\d+)?)*")


def fixed_laws(words: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Law and parameters of materials, from words such as ``water=-17`` (gamma in dB) or ``road=mangia:-28,8,14,8``.

    Raises
    ------
    ConfigError
        A word has another form, or two laws are given for a material.
    """
    found = dict[str, dict[str, Any]]()
    for word in words:
        name, _, value = (part.strip() for part in word.partition("="))
        law, colon, numbers = value.rpartition(":")
        if not name or not _NUMBERS.fullmatch(numbers.strip()):
            raise ConfigError(f"--fixed {word}: expected NAME=DB such as water=-17, or NAME=LAW:X1,X2,... of its law.")
        if name in found:
            raise ConfigError(f"--fixed {word}: a law of {name} is given twice, expected once.")
        found[name] = {"law": law if colon else _CONSTANT, "parameters": [float(text) for text in numbers.split(",")]}
    return found


def new_materials(
    of_cover: Mapping[str, str],
    calibrated: Sequence[str],
    fixed: Mapping[str, Mapping[str, Any]],
    landcover: str | None,
    calibrates: bool = True,
    levels_db: tuple[float, float, float] | None = None,
) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, list[float]]]:
    """Bounds and start of the materials to calibrate, and laws of the other materials.

    Parameters
    ----------
    of_cover : mapping
        Comment on each material of the land cover.
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

    Returns
    -------
    materials : dict
        Section ``materials``.
    comments : dict
        Comments by key in dotted form.
    hidden : dict
        Parameters of the hidden law of each material to calibrate, for a synthetic image.

    Raises
    ------
    ConfigError
        Materials are not in the land cover, or are both calibrated and fixed.
    """
    for name in (*calibrated, *fixed):
        if name in calibrated and name in fixed:
            raise ConfigError(f"{name} has --material (it is calibrated) and --fixed (it is not), expected one.")
        if of_cover and name not in of_cover:
            raise ConfigError(f"there is no material {name!r} in the land cover (known: {', '.join(of_cover)}).")
    listed = list(of_cover) or [*calibrated, *fixed]
    chosen = calibrated or [name for name in of_cover if name not in fixed and calibrates]
    others = [name for name in listed if name not in chosen and name not in fixed]
    presets = [starting_keys(landcover, name, {}) for name in others] if landcover else []
    taken = [keys["parameters"][0] for keys in (*fixed.values(), *presets) if keys.get("law") == _CONSTANT]
    x1 = _X1 if levels_db is None else (levels_db[0] - _AROUND_DB, levels_db[2] + _AROUND_DB)
    unknown = {} if levels_db is None else {"unknown_db": float(round(levels_db[1]))}
    levels = starting_levels([name for name in listed if name in chosen], taken, **unknown)
    materials, hidden = dict[str, dict[str, Any]](), dict[str, list[float]]()
    comments = {f"materials.{name}": text for name, text in of_cover.items()}
    for name in listed:
        about = dict[str, str]()
        if name in chosen:
            start = levels[name].start
            # wider than about the image's levels if the start would lie near the bounds or outside
            low = math.floor(min(math.floor((start[0] - _BELOW_DB) / _STEP_DB) * _STEP_DB, x1[0]))
            high = math.ceil(max(math.ceil((start[0] + _ABOVE_DB) / _STEP_DB) * _STEP_DB, x1[1]))
            bounds = [[low, high], *([0, upper] for upper in _UPPER)]
            hidden[name] = _hidden(name, start, (low, high))
            materials[name] = {"calibrate": True, "law": "mangia", "bounds": bounds, "start": start}
            about = {"law": "or another one of docs/laws.md", "bounds": "in dB: narrow them"}
            about["start"] = f"{levels[name]} (docs/landcover.md); the image at the start needs contrast"
        elif name in fixed:
            materials[name], about["law"] = dict(fixed[name]), "not calibrated"
        elif landcover is not None:
            materials[name] = {"calibrate": False}
            about["calibrate"] = "with the starting law of docs/landcover.md: a guess of its level"
        elif calibrates:
            materials[name] = {"law": _CONSTANT, "parameters": [FILL_IN]}
            about = {"law": "not calibrated", "parameters": "gamma [dB], for example parameters: [-15]"}
        else:  # one by one, because only a registration needs levels that differ
            (level,) = starting_levels([name]).values()
            materials[name] = {"law": _CONSTANT, "parameters": [level.gamma_db]}
            about = {"law": f"{level} (docs/landcover.md)", "parameters": "gamma [dB]"}
        comments |= {f"materials.{name}.{key}": text for key, text in about.items()}
    if not (of_cover or chosen):
        materials[FILL_IN] = {"calibrate": True} if calibrates else {"law": _CONSTANT, "parameters": [-15]}
        comments[f"materials.{FILL_IN}"] = "name of a material, and its law (docs/laws.md)"
    return materials, comments, hidden


def _hidden(name: str, start: Sequence[float], bounds: tuple[int, int]) -> list[float]:
    """Parameters of a hidden law, drawn for each material: other shape than the start, and similar level.

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
    return [round(float(x), 1) for x in (np.clip(x1, bounds[0] + 1, bounds[1] - 1), x2, x3, x4)]
