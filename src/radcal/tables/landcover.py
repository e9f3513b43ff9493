"""Land-cover maps whose codes have known names, and starting laws for materials with these names.

A starting law only gives starting values. A starting law is one constant gamma for a kind of terrain and one band,
whatever the polarisation, season and moisture. A calibration replaces the starting law. A material with fixed
parameters keeps the starting law, so that its level may be wrong by many dB.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from radcal.laws import DEFAULT_LAW
from radcal.tables import read_table

LandCover = Literal["esa_worldcover", "corine", "nlcd"]

# X1 + X2 cos(phi) is 10 log10(cos(phi)) within 0.2 dB from 20 to 60 degrees (least squares)
_LINE_DB = (-5.86, 6.05)
_BELOW_DB, _ABOVE_DB = 30.0, 15.0  # bounds of X1 about gamma; those of X2 to X4 are the default case's
_BOUNDS = [[0.0, 16.0], [0.0, 22.0], [0.0, 12.0]]
_X4 = 4.0
_APART_DB = 3.0  # smallest difference of two starting levels, so that the start image shows where the materials meet
_UNKNOWN_DB = -15.0  # gamma if neither the name nor the map shows the terrain


@dataclass(frozen=True)
class StartingLevel:
    """Level from which the law of a material starts in a new case.

    Attributes
    ----------
    gamma_db : float
        Constant gamma [dB].
    terrain : str or None
        Kind of terrain that has this gamma; None if the kind is unknown.
    moved : bool
        Whether the level was moved away from that of another material.
    """

    gamma_db: float
    terrain: str | None
    moved: bool

    @property
    def start(self) -> list[float]:
        """Parameters of the default law that approximate the level's constant gamma."""
        return [round(self.gamma_db + _LINE_DB[0], 2), _LINE_DB[1], 0.0, _X4]

    def __str__(self) -> str:
        kind = "of no known kind" if self.terrain is None else f"of {self.terrain}"
        return f"gamma {self.gamma_db:g} dB {kind}" + ", moved apart from another material" * self.moved


@dataclass(frozen=True)
class Cover:
    """Class of a land-cover map.

    Attributes
    ----------
    name : str
        Name of the material.
    terrain : str
        Kind of terrain whose gamma starts its law.
    taken_for : bool
        Whether the source of the gammas has no value for this class, so that the gamma of a similar terrain is used.
    """

    name: str
    terrain: str
    taken_for: bool = False


@functools.cache
def landcovers() -> dict[str, dict[int, Cover]]:
    """Classes of each land-cover map, by the code of the class."""
    maps = read_table("landcover")["maps"]
    return {name: {code: Cover(**one) for code, one in classes.items()} for name, classes in maps.items()}


def gamma_db(terrain: str) -> float:
    """Gamma of a kind of terrain [dB]."""
    return float(read_table("landcover")["terrain"][terrain]["gamma_db"])


def brightest_db() -> float:
    """Largest gamma of the kinds of terrain [dB]."""
    return max(map(gamma_db, read_table("landcover")["terrain"]))


def starting_keys(landcover: str, name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a material that follow from the starting law of its land-cover class and are missing in the case.

    Parameters
    ----------
    landcover : str
        Name of the land-cover map.
    name : str
        Material.
    given : mapping
        Keys of the material in the case.

    Returns
    -------
    dict
        Keys and values. A fixed material gets the law of constant gamma. A calibrated material gets bounds of the
        default law, and as start the parameters that approximate constant gamma. The dict is empty if the case gives
        another law, fixed parameters or bounds, and for a name that the map does not contain.
    """
    cover = next((cover for cover in landcovers().get(landcover, {}).values() if cover.name == name), None)
    if cover is None or given.get("law", DEFAULT_LAW) != DEFAULT_LAW:
        return {}
    gamma = gamma_db(cover.terrain)
    if not given.get("calibrate"):
        return {} if "law" in given or "parameters" in given else {"law": "constant_gamma", "parameters": [gamma]}
    if "bounds" in given:
        return {}
    bounds = {"bounds": [[gamma - _BELOW_DB, gamma + _ABOVE_DB], *_BOUNDS]}
    start = {"start": [gamma + _LINE_DB[0], _LINE_DB[1], 0.0, _X4]}
    return bounds if "start" in given else {**bounds, **start}


def starting_levels(
    names: Sequence[str], taken_db: Iterable[float] = (), unknown_db: float = _UNKNOWN_DB
) -> dict[str, StartingLevel]:
    """Starting levels of the laws of several materials, at least 3 dB apart from each other.

    A measured image is registered onto the simulated start image. The start image shows the border of two materials
    only if their levels differ. The registration does not depend on the sign of the contrast between two materials.

    Parameters
    ----------
    names : sequence of str
        Names of the materials. The kind of terrain follows from a name that a land-cover map contains, or from a word
        in the name.
    taken_db : iterable of float
        Gamma of other materials [dB], from which the new levels differ by at least 3 dB.
    unknown_db : float
        Gamma of a material whose name does not show its kind of terrain [dB].
    """
    used, found = list(taken_db), dict[str, StartingLevel]()
    for name in names:
        terrain = _terrain(name)
        level = unknown_db if terrain is None else gamma_db(terrain)
        steps = (sign * k * _APART_DB for k in itertools.count() for sign in ((1.0, -1.0) if k else (1.0,)))
        away = next(step for step in steps if all(abs(level + step - other) >= _APART_DB for other in used))
        used.append(level + away)
        found[name] = StartingLevel(level + away, terrain, away != 0.0)
    return found


def _terrain(name: str) -> str | None:
    """Kind of terrain that follows from the name of a material; None if the name does not show it."""
    covers = (cover for classes in landcovers().values() for cover in classes.values())
    if (known := next((cover.terrain for cover in covers if cover.name == name), None)) is not None:
        return known
    words = re.split(r"[^A-Za-z]+", name.lower())
    for terrain, one in read_table("landcover")["terrain"].items():
        if any(re.fullmatch(pattern, word) for pattern in one["words"].split() for word in words):
            return str(terrain)
    return None
