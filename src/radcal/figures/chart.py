"""Description of a figure of curves over a common axis, which matplotlib and plotly draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from radcal.figures.drawing import BAND, Array, Drawn, add_legend, head, new_canvas
from radcal.results.archive import Archive

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Interval = tuple[float, float]


@dataclass(frozen=True)
class Curve:
    """Line, markers, markers with bars, or a band.

    Attributes
    ----------
    label : str
        Entry of the legend; a curve whose label begins with ``_`` has none, as in matplotlib.
    x, y : ndarray
        Coordinates, shape (n,); ``y`` of a band has shape (2, n). A NaN interrupts a line.
    style : mapping
        Arguments of matplotlib's ``plot``, of ``scatter`` (with ``s``), ``errorbar`` or ``fill_between``.
    error : ndarray, optional
        Half-lengths of bars, shape (n,).
    text : sequence of str
        Text at each point where a figure is interactive.
    """

    label: str
    x: NDArray[Any]
    y: Array
    style: Mapping[str, Any]
    error: Array | None = None
    text: Sequence[str] = ()

    def draw(self, axes: Axes) -> None:
        """Draw with matplotlib."""
        if self.y.ndim == 2:
            axes.fill_between(self.x, *self.y, label=self.label, linewidth=0, **self.style)
        elif self.error is not None:
            axes.errorbar(self.x, self.y, self.error, label=self.label, **self.style)
        elif "s" in self.style:
            axes.scatter(self.x, self.y, label=self.label, zorder=3, clip_on=False, **self.style)
        else:
            axes.plot(self.x, self.y, label=self.label, **self.style)


@dataclass(frozen=True)
class Panel:
    """Axes with curves; ``share`` is their height relative to that of the other panels."""

    y_label: str
    curves: Sequence[Curve]
    share: float = 1.0
    log: bool = False
    limits: Interval | None = None


@dataclass(frozen=True)
class Chart:
    """Panels of one material, one below the other, over the same axis.

    Attributes
    ----------
    title, caption, alt : str
        Remark behind the material's name, caption, and description for readers who cannot see the figure.
    x_label : str
        Label of the common axis.
    panels : sequence of Panel
        Panels from the top.
    height : float
        Height of the figure [inches].
    limits : (float, float)
        Ends of the common axis.
    shaded : sequence of (float, float)
        Intervals of the common axis that are shaded.
    determined : (float, float), optional
        Interval of the common axis with a bar at the foot of the first panel.
    """

    title: str
    caption: str
    alt: str
    x_label: str
    panels: Sequence[Panel]
    height: float
    limits: Interval
    shaded: Sequence[Interval] = ()
    determined: Sequence[float] | None = None


def drawn(chart: Chart, case: Archive, name: str) -> Drawn:
    """Figure of a material by matplotlib."""
    canvas = new_canvas(6.2, chart.height)
    shares = [panel.share for panel in chart.panels]
    panels = canvas.subplots(len(shares), 1, sharex=True, squeeze=False, height_ratios=shares)[:, 0]
    entries: dict[str, Any] = {}
    for axes, panel in zip(panels, chart.panels, strict=True):
        for interval in chart.shaded:
            axes.axvspan(*interval, color="#EFEFEF", zorder=0, linewidth=0)
        for curve in panel.curves:
            curve.draw(axes)
        if chart.determined is not None and axes is panels[0]:
            foot = {"linewidth": 5.0, "solid_capstyle": "butt", "transform": axes.get_xaxis_transform()}
            axes.plot(chart.determined, [0.015, 0.015], color=BAND["color"], label="determined", **foot)
        axes.set(ylabel=panel.y_label, yscale="log" if panel.log else "linear")
        if panel.limits is not None:
            axes.set_ylim(*panel.limits)
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    panels[-1].set_xlabel(chart.x_label)
    panels[-1].set_xlim(*chart.limits)
    panels[-1].locator_params(axis="x", integer=True)
    head(panels[0], case, name, chart.title)
    add_legend(canvas, (list(entries.values()), list(entries)), 3)
    return canvas, chart.caption, chart.alt
