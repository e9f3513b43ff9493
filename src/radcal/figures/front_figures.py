"""Figure of the front of a search with several objectives."""

from __future__ import annotations

import numpy as np

from radcal.figures.drawing import RUNS, Array, Drawn, add_legend, head, new_canvas, short
from radcal.results.archive import Archive

_LEAST = 1e-12  # smaller sums of squares are drawn at this value
_LEAST_REACH = 0.12  # smallest half-length of an axis [decades]
_WIDE = 300.0  # ratio of the ends of an axis; from this ratio on, only powers of ten are labelled


def front(case: Archive, name: str) -> Drawn | None:
    """Figure of the front and the runs; each panel compares the first objective with another objective."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    material = case.materials[name]
    found = material.front
    if found is None:
        return None
    others = range(1, len(found.objectives))
    canvas = new_canvas(6.2, 0.8 + 4.4 * len(others))
    panels = canvas.subplots(len(others), 1, squeeze=False)[:, 0]
    for axes, other in zip(panels, others, strict=True):
        line, runs = (np.maximum(values[:, [0, other]], _LEAST) for values in (found.predicted, found.verified))
        line = line[np.argsort(line[:, 0], kind="stable")]
        axes.plot(*line.T, color="black", linewidth=1.2, marker=".", markersize=4, label="front, predicted")
        shown = np.concatenate([line, runs[[material.best]]])
        (left, right), (bottom, top) = limits = _limits(shown[:, 0]), _limits(shown[:, 1])
        for kind, (label, style) in RUNS.items():
            x, y = runs[(case.runs.kind == kind) & np.isfinite(runs).all(axis=1)].T
            # a kind without a run inside the axes has no place in the legend, either
            if ((x >= left) & (x <= right) & (y >= bottom) & (y <= top)).any():
                axes.scatter(x, y, label=label, zorder=3, **style)
        x, y = runs[[material.best]].T
        axes.scatter(
            x, y, label="chosen run", marker="o", s=190, facecolors="none", edgecolors="black", linewidths=1.6, zorder=4
        )
        axes.set(xscale="log", yscale="log", xlim=limits[0], ylim=limits[1])
        for axis in (axes.xaxis, axes.yaxis):
            low, high = axis.get_view_interval()
            powers = LogLocator(subs=(1.0, 2.0, 5.0) if high < _WIDE * low else (1.0,))
            axis.set_major_locator(powers if high > 10.0 * low else MaxNLocator(5))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_locator(NullLocator())
        axes.set_xlabel(f"squared residuals: {found.objectives[0]}")
        axes.set_ylabel(f"squared residuals: {found.objectives[other]}")
    head(panels[0], case, name, "front of the last search")
    add_legend(canvas, panels[0].get_legend_handles_labels(), 3)
    best = found.verified[material.best]
    each = ", ".join(f"{short(value)} ({of})" for value, of in zip(best, found.objectives, strict=True))
    caption = (
        f"NSGA-II, a genetic algorithm, minimises {len(found.objectives)} sums of squared residuals on the surrogate. "
        "The line is their Pareto front in the last iteration: along it, one sum decreases only if another increases. "
        "A least-squares search on the surrogate then minimises the total of the sums. It starts from the best point "
        "of the line, from the best run and from further X, so that runs may lie below the line. Markers are runs of "
        "the simulator near the front. "
        f"The sums of squared residuals of the chosen run are {each}; smaller is better."
    )
    return canvas, caption, f"Front of the search for {name} with the runs and the chosen run, on logarithmic axes."


def _limits(values: Array) -> tuple[float, float]:
    """Ends of a logarithmic axis around ``values``, which do not include runs far from the front."""
    log = np.log10(values)
    middle, half_length = 0.5 * (log.min() + log.max()), max(_LEAST_REACH, 0.9 * float(np.ptp(log)))
    return float(10.0 ** (middle - half_length)), float(10.0 ** (middle + half_length))
