"""Shared parts of all figures: colours, fonts, canvases, names.

Each colour of the palette (by Okabe and Ito) and each line style has the same meaning in all figures: black and grey
for target and measurement, dashed orange for the start, blue for the law of the search, violet for what the model says
of sigma0, dotted green for the hidden true law, vermilion for the tolerance.

Colours of materials in maps and legends are configured, usual for the material's name, or from a fixed list. The usual
ones and the list are those of ``tables/colours.yaml``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.results.archive import Archive
from radcal.storage.files import atomic
from radcal.tables import read_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure as Canvas

Array = NDArray[np.float64]
Drawn = tuple["Canvas", str, str]
"""Figure, its caption, and its description for readers who cannot see it."""

TARGET: dict[str, Any] = {"color": "#000000", "linewidth": 2.6, "linestyle": "-"}
START: dict[str, Any] = {"color": "#E69F00", "linewidth": 2.0, "linestyle": (0, (5, 2))}
FOUND: dict[str, Any] = {"color": "#0072B2", "linewidth": 2.0, "linestyle": "-"}
HIDDEN: dict[str, Any] = {"color": "#009E73", "linewidth": 2.4, "linestyle": (0, (1, 1.2))}
TOLERANCE: dict[str, Any] = {"color": "#D55E00", "linewidth": 1.6, "linestyle": (0, (6, 2))}
SAMPLING: dict[str, Any] = {"color": "#CC79A7", "linewidth": 2.2, "linestyle": (0, (1, 1.5))}
BAND: dict[str, Any] = {"color": "#7B3F9E", "linewidth": 2.0, "linestyle": (0, (1, 1))}
MODEL: dict[str, Any] = {"color": "#7B3F9E", "linewidth": 2.0, "linestyle": "-."}
PALE = "#D0D0D0"
DESIGN = "#56B4E9"
MUTED = "#7A7A7A"

SIGMA0 = "\N{GREEK SMALL LETTER SIGMA}\N{SUPERSCRIPT ZERO} [dB]"
"""Label of the axis of sigma0."""

_EDGE: dict[str, Any] = {"edgecolors": "black", "linewidths": 0.4}
# label and style of the runs of each kind
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "reference": ("reference (start)", {"color": START["color"], "marker": "s", "s": 62, **_EDGE}),
    "registration": ("registration run", {"color": HIDDEN["color"], "marker": "P", "s": 44, **_EDGE}),
    "reused": ("earlier case", {"color": MUTED, "marker": "D", "s": 26, **_EDGE}),
    "design": ("design", {"color": DESIGN, "marker": "o", "s": 30, **_EDGE}),
    "infill": ("infill", {"color": FOUND["color"], "marker": "^", "s": 40, **_EDGE}),
}

STYLE: Any = {
    "font.family": ["radcal", "DejaVu Sans"],  # the whole font has what is not in its part
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.7,
    "legend.fontsize": 10.0,
    "legend.frameon": False,
    "pdf.fonttype": 42,
}
_TABLE = read_table("colours")
FILLS: Sequence[str] = _TABLE["others"]
_WORDS = [
    ([re.compile(word, re.IGNORECASE) for word in words.split()], shades) for words, shades in _TABLE["usual"].items()
]


@cache
def _add_font() -> None:
    """Make known to matplotlib the figures' font (``.ci/figure_font.py``), which is quickly embedded in a PDF file."""
    from matplotlib import font_manager

    for weight in ("normal", "bold"):
        font_manager.fontManager.addfont(Path(__file__).parent / "font" / f"{weight}.ttf")


def styled() -> AbstractContextManager[None]:
    """Context in which figures are drawn: matplotlib's defaults and :data:`STYLE`, without the user's matplotlibrc."""
    from matplotlib import style

    _add_font()
    return style.context(["default", STYLE])


def shortened(name: str, width: int) -> str:
    """Name cut to at most ``width`` characters."""
    return name if len(name) <= width else f"{name[: width - 1].rstrip()}\N{HORIZONTAL ELLIPSIS}"


def label(name: str, width: int = 44) -> str:
    """Name for a figure, shortened, and escaped so that it is not read as a formula."""
    return shortened(name, width).replace("$", r"\$")


def titled(name: str, text: str = "") -> str:
    """Title from a material's name and a remark, on two lines if they do not fit on one."""
    shown = label(name)
    if not text:
        return shown
    return f"{shown}: {text}" if len(shown) <= 16 and len(shown) + len(text) < 56 else f"{shown}:\n{text}"


def mark(axes: Axes, colour: str) -> None:
    """Draw a square at the upper right corner of a panel, in the colour that its material has in the maps."""
    from matplotlib.patches import Rectangle

    box = axes.get_window_extent()
    height = 0.045
    width = height * box.height / box.width
    square = Rectangle(
        (1.0 - width, 1.015), width, height, transform=axes.transAxes, facecolor=colour, edgecolor="black",
        linewidth=0.6, clip_on=False,
    )  # fmt: skip
    square.set_in_layout(False)
    axes.add_patch(square)


def slugs(names: Iterable[str]) -> Iterator[str]:
    """File names for the given names: short, in plain characters, and all different."""
    used: set[str] = set()
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:80]
        slug, n = stem, 2
        while slug.lower() in used:
            slug, n = f"{stem}_{n}", n + 1
        used.add(slug.lower())
        yield slug


def short(value: float) -> str:
    """Text of a number with two significant digits."""
    return f"{value:.2g}"


def new_canvas(width: float, height: float, layout: Literal["constrained", "compressed"] = "constrained") -> Canvas:
    """Empty figure of the given width and height [inches]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(width, height), layout=layout)
    FigureCanvasAgg(canvas)
    return canvas


def write_png(path: str | Path, canvas: Canvas) -> None:
    """Write a figure as PNG, without the name of the program, so that the same figure has the same bytes."""
    with atomic(path) as partial:
        canvas.savefig(partial, format="png", dpi=150, metadata={"Software": None}, facecolor="white")


@contextmanager
def law_panels(path: str | Path, names: Sequence[str], y_label: str) -> Iterator[Iterator[tuple[Axes, str]]]:
    """Yield one panel over the incidence for each material, and write the figure as PNG after the ``with`` block."""
    with styled():
        columns = min(len(names), 3)
        rows = -(-len(names) // columns)
        canvas = new_canvas(0.8 + 4.4 * columns, 0.8 + 3.2 * rows)
        panels = canvas.subplots(rows, columns, squeeze=False).ravel()
        for axes, name in zip(panels, names, strict=False):
            axes.set(title=titled(name), xlabel="local incidence [deg]", ylabel=y_label)
        yield zip(panels, names, strict=False)
        for axes in panels[len(names) :]:
            axes.remove()
        add_legend(canvas, panels[0].get_legend_handles_labels(), 2)
        write_png(path, canvas)


def add_fills(canvas: Canvas, colours: Iterable[str], labels: Sequence[str], columns: int) -> None:
    """Add a legend of filled squares."""
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=colour, edgecolor="black", linewidth=0.5) for colour in colours]
    add_legend(canvas, (handles, labels), columns)


def add_legend(canvas: Canvas, entries: tuple[Sequence[Any], Sequence[str]], columns: int) -> None:
    """Add a legend below the axes, with ``columns`` columns or, if these are too wide, with as many as fit."""
    while True:
        legend = canvas.legend(
            *entries,
            loc="outside lower center",
            ncols=columns,
            handlelength=2.8,
            handleheight=1.0,
            columnspacing=1.4,
        )
        if columns == 1 or legend.get_window_extent().width <= 0.98 * canvas.bbox.width:
            return
        legend.remove()
        columns -= 1


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
