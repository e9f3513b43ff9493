"""Colours of materials in maps and legends: configured, usual for the material's name, or from a fixed list.

The usual ones and the list are those of ``tables/colours.yaml``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radcal.figures.drawing import mark, titled
from radcal.results.archive import Archive
from radcal.tables import read_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import BoundaryNorm, ListedColormap

_TABLE = read_table("colours")
FILLS: Sequence[str] = _TABLE["others"]
_WORDS = [
    ([re.compile(word, re.IGNORECASE) for word in words.split()], shades) for words, shades in _TABLE["usual"].items()
]


def material_colours(names: Sequence[str], configured: Mapping[str, str] | None = None) -> list[str]:
    """Colour of each material.

    Parameters
    ----------
    names : sequence of str
        Names of all materials, in the order of their ids.
    configured : mapping, optional
        Colours by material, as ``#RRGGBB``.

    Returns
    -------
    list of str
        The configured colour of a material, if there is one. Else the usual colour of the kind of ground that a word of
        its name says; further materials of this kind have other shades. Else the colour of the fixed list at the
        material's place, or the next colour there that no other material has.
    """
    given = configured or {}
    found: dict[str, str] = {name: given[name] for name in names if name in given}
    used = {colour.upper() for colour in found.values()}
    for name in names:
        words = re.split(r"[^A-Za-z]+", name)
        shades = next(
            (shades for kind, shades in _WORDS if any(one.fullmatch(word) for one in kind for word in words)), ()
        )
        if name not in found and (colour := next((shade for shade in shades if shade not in used), None)) is not None:
            found[name] = colour
            used.add(colour)
    # a material gets the colour at its own place in the fixed list if that is free, as in a scene without usual names
    for number, name in enumerate(names):
        if name not in found:
            order = [FILLS[(number + k) % len(FILLS)] for k in range(len(FILLS))]
            found[name] = next((colour for colour in order if colour not in used), order[0])
            used.add(found[name])
    return [found[name] for name in names]


def colours_of(case: Archive) -> list[str]:
    """Colours of the materials of a calibration, in the order of their ids."""
    materials = case.configured.materials
    return material_colours(case.names, {name: one.colour for name, one in materials.items() if one.colour})


def of_ids(case: Archive) -> tuple[ListedColormap, BoundaryNorm]:
    """Colour map of the ids of materials, white for 0, and its norm."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    colours = ["#FFFFFF", *colours_of(case)]
    norm = BoundaryNorm((np.arange(len(colours) + 1) - 0.5).tolist(), len(colours))
    return ListedColormap(colours), norm


def colour_of(case: Archive, name: str) -> str:
    """Colour of one material."""
    return colours_of(case)[case.names.index(name)]


def head(axes: Axes, case: Archive, name: str, text: str = "") -> None:
    """Set the title of a material's panel, and draw a square in the colour that the material has in the maps."""
    axes.set_title(titled(name, text))
    mark(axes, colour_of(case, name))
