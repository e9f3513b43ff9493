"""Colours of materials in maps and legends: configured, usual for the material's name, or from a fixed list."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radcal.figures.drawing import mark, titled
from radcal.results.archive import Archive

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import BoundaryNorm, ListedColormap

# Sixteen colours of different lightness; the map also has numbers, so that nothing depends on colour alone. Sixteen
# more differ by 28 or more in CIELAB from each other, from the first sixteen, white and black.
FILLS = (
    "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#8C8C8C",
    "#332288", "#B7E1B0", "#882255", "#FBD5A5", "#B4C7F0", "#6B4A1B", "#D9D9D9", "#117777",
    "#69870F", "#87000F", "#A596FF", "#00F0F0", "#FF7878", "#004B0F", "#3C2D5A", "#5AF0A5",
    "#964BA5", "#B4963C", "#A55A5A", "#96D269", "#FFA569", "#FFA5FF", "#69784B", "#0F3C4B",
)  # fmt: skip

# usual colours of kinds of ground, and darker or lighter ones for further materials of a kind. The kinds differ in
# lightness, too: no red is as light as a green, because a colour-blind reader may take one for the other.
_USUAL: Mapping[str, tuple[str, str, str]] = {
    "wetlands? marsh(es)? bogs? swamps? mangroves? peat": ("#44AA99", "#2B7A6D", "#8FD0C4"),
    "water sea ocean lakes? rivers? lagoons? estuar(y|ies)": ("#2C6FBB", "#123E73", "#7FB2E5"),
    "snow ice glaciers?": ("#DCEBF7", "#B9D3EA", "#F2F8FD"),
    "urban built buildings? developed city houses? settlements?": ("#C8371B", "#8E1F0B", "#E8836E"),
    "roads? rail asphalt runways? airports?": ("#6E6E6E", "#474747", "#9C9C9C"),
    "forests? trees? woods? woodlands?": ("#0B5D1E", "#073A13", "#3B8549"),
    "shrubs? shrubland scrub heathland moors?": ("#8A8A2B", "#636318", "#B5B564"),
    "grass(es)? grasslands? pastures? meadows? lawns?": ("#8CCB5E", "#5FA233", "#BBE39B"),
    "crops? croplands? arable cultivated farmland agriculture": ("#EBD04B", "#C4A51E", "#F6E798"),
    "bare soil sands? barren rocks? beaches desert": ("#B9824F", "#8A5A2E", "#D9B48F"),
}
_WORDS = [([re.compile(word, re.IGNORECASE) for word in words.split()], shades) for words, shades in _USUAL.items()]


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
