"""Traces and layouts of the interactive figures; colours, labels and numbers are those of the static figures.

The script of the page adds what all figures share: fonts, and the colours of text and grid in light and dark mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radcal.figures.drawing import BAND, FOUND, MUTED, PALE, RUNS, SAMPLING, START, TOLERANCE, short
from radcal.figures.law_figures import (
    GRAZING_DB,
    PIXEL_BINS,
    SIGMA0,
    cost_caption,
    ended,
    floors,
    law_caption,
    laws_of,
    levels_seen,
    seen_and_view,
)
from radcal.results.archive import Archive, MaterialResult

__all__ = ["Drawn", "bins", "cost", "law"]

Trace = dict[str, Any]
Drawn = tuple[str, str, dict[str, Any]]
"""Caption, description for readers who cannot see the figure, and traces and layout."""

INK = "#000000"  # the script replaces it by the colour of the text in dark mode
_SYMBOLS = {"s": "square", "P": "cross", "D": "diamond", "o": "circle", "^": "triangle-up"}
_DASHES = {"-": "solid", ":": "dot", "-.": "dashdot"}
_INCIDENCE = "local incidence [deg]"
_LABELS = ("mean [dB]", "log sd", "skewness")
_STEP_DEG = 0.5  # between the points of a curve


def numbers(values: ArrayLike, digits: int = 5) -> list[float | None]:
    """Numbers for JSON with the given significant digits, and None for what is not finite."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in flat]


def trace(name: str, x: ArrayLike, y: ArrayLike, **more: Any) -> Trace:
    """Trace of points or lines with a name in the legend."""
    return {"type": "scatter", "name": name, "x": numbers(x), "y": numbers(y), **more}


def lined(style: Mapping[str, Any], width: float | None = None) -> dict[str, Any]:
    """Line of plotly in a style of matplotlib."""
    width, shape = width or style["linewidth"], style["linestyle"]
    dash = _DASHES[shape] if isinstance(shape, str) else ",".join(f"{part * width:g}px" for part in shape[1])
    return {"color": style["color"], "width": width, "dash": dash}


def marked(colour: str, symbol: str = "circle", size: float = 8.0, **more: Any) -> dict[str, Any]:
    """Markers in the mode of a trace, with a thin edge."""
    edge = {"width": 0.6, "color": INK}
    return {"mode": "markers", "marker": {"color": colour, "symbol": symbol, "size": size, "line": edge, **more}}


def axis(title: str, **more: Any) -> dict[str, Any]:
    """Axis with a title."""
    return {"title": {"text": title}, **more}


def level(y: float, style: Mapping[str, Any], ends: Sequence[float], name: str, **more: Any) -> Trace:
    """Horizontal line, with a name in the legend."""
    return trace(name, ends, [y, y], mode="lines", line=lined(style), **more)


def law(case: Archive, name: str) -> Drawn | None:
    """Band of sigma0, laws and measured levels over the incidence angle, and histogram of the incidence."""
    if not case.configured.laws[name].has_curve:
        return None
    material = case.materials[name]
    seen, view = seen_and_view(case, name)
    angles = np.arange(view[0], view[1] + _STEP_DEG, _STEP_DEG).clip(*view)
    traces = _band(material, angles)
    laws = laws_of(case, name)
    for label, curve, x, style in laws:
        text = f"{label}: %{{y:.2f}} dB<extra></extra>"
        shown = {"legendgroup": label, "mode": "lines"}
        traces.append(
            trace(label, angles, curve(np.radians(angles), x), **shown, line=lined(style, 1.0), showlegend=False,
                  hovertemplate=text)
        )  # fmt: skip
        for k, (first, last) in enumerate(seen):
            there = np.linspace(first, last, 61)
            traces.append(
                trace(label, there, curve(np.radians(there), x), **shown, line=lined(style, 2.8), showlegend=k == 0,
                      hoverinfo="skip")
            )  # fmt: skip
    posterior = material.posterior
    if posterior is not None and (points := posterior.points) is not None:
        bars = {"type": "data", "array": numbers(1.96 * points.error_db), "color": INK, "thickness": 1.2, "width": 0}
        traces.append(
            trace("measured levels, 95 %", points.incidence_deg, points.level_db, error_y=bars, **marked(INK, size=7),
                  hovertemplate="%{x:.1f} deg: %{y:.2f} +- %{error_y.array:.2f} dB<extra>measured</extra>")
        )  # fmt: skip
    counts, edges = np.histogram(material.target.incidence_deg, bins=np.linspace(*view, PIXEL_BINS + 1))
    traces.append(
        {"type": "bar", "x": numbers(0.5 * (edges[1:] + edges[:-1])), "y": counts.tolist(), "yaxis": "y2",
         "marker": {"color": MUTED}, "name": "pixels", "showlegend": False,
         "hovertemplate": "%{x:.1f} deg: %{y} pixels<extra></extra>"}
    )  # fmt: skip
    limits: dict[str, Any] = {}
    if min(value for one in traces[:-1] for value in one["y"] if value is not None) < GRAZING_DB:
        limits = {"range": list(levels_seen(laws, list(seen)))}
    shaded = [
        {"type": "rect", "x0": low, "x1": high, "y0": 0, "y1": 1, "yref": "paper", "fillcolor": MUTED, "opacity": 0.12,
         "line": {"width": 0}, "layer": "below"}
        for low, high in seen.tolist()
    ]  # fmt: skip
    if posterior is not None and (known := posterior.known_between_deg) is not None:
        shaded.append(
            {"type": "line", "x0": known[0], "x1": known[1], "y0": 0.245, "y1": 0.245, "yref": "paper",
             "line": {"width": 5, "color": BAND["color"]}, "name": "determined", "showlegend": True}
        )  # fmt: skip
    layout = {
        "height": 520,
        "xaxis": axis(_INCIDENCE, range=list(view), anchor="y2"),
        "yaxis": axis(SIGMA0, domain=[0.24, 1.0], **limits),
        "yaxis2": axis("pixels", domain=[0.0, 0.16]),
        "shapes": shaded,
        "bargap": 0,
    }
    return (
        law_caption(case, name),
        f"Backscatter laws of {name} in dB against local incidence in degrees.",
        {"data": traces, "layout": layout},
    )


def _band(material: MaterialResult, angles: np.ndarray) -> list[Trace]:
    """The 90 % bands of the material and of its fields, and the median."""
    if material.posterior is None or (curve := material.posterior.curve) is None:
        return []
    found = []
    for low, high, alpha, label in (
        (curve.p05_db, curve.p95_db, 0.15, "90 % band"),
        (curve.field_p05_db, curve.field_p95_db, 0.3, "its fields in this image"),
    ):
        lower, upper = (np.interp(angles, curve.incidence_deg, edge) for edge in (low, high))
        none = {"mode": "lines", "line": {"width": 0}, "legendgroup": label, "hoverinfo": "skip"}
        found.append(trace(label, angles, lower, **none, showlegend=False))
        found.append(trace(label, angles, upper, **none, fill="tonexty", fillcolor=f"rgba(123, 63, 158, {alpha})"))
    low, middle, high = curve.at(angles)
    widths = np.stack([low, high], axis=1)
    text = "median: %{y:.2f} dB, 90 % band: %{customdata[0]:.2f} to %{customdata[1]:.2f} dB<extra></extra>"
    found.append(
        trace("median", angles, middle, mode="lines", line=lined(BAND), hovertemplate=text,
              customdata=[numbers(one) for one in widths])
    )  # fmt: skip
    return found


def bins(case: Archive, name: str) -> Drawn | None:
    """Measured and simulated mean, log sd and skewness of each incidence-angle bin."""
    found = case.materials[name].bins
    if found is None:
        return None
    traces, layout = [], {"height": 360, "grid": {"rows": 1, "columns": 3, "pattern": "independent"}}
    for k, label in enumerate(_LABELS):
        on = {"xaxis": f"x{k + 1}", "yaxis": f"y{k + 1}", "showlegend": k == 0}
        bars = {"type": "data", "array": numbers(found.error[:, k]), "color": INK, "thickness": 1.2, "width": 0}
        series = [("measured", found.measured, {"error_y": bars, **marked(INK)})]
        if found.start is not None:
            series.append(("start", found.start, marked(START["color"], "square-open", 8, line={"width": 2})))
        series.append(("calibrated", found.calibrated, marked(FOUND["color"], "triangle-up", 9)))
        for words, values, style in series:
            traces.append(
                trace(words, found.incidence_deg, values[:, k], **style, **on, legendgroup=words,
                      hovertemplate=f"{words}, %{{x:.1f}} deg: %{{y:.3f}}<extra></extra>")
            )  # fmt: skip
        layout[f"xaxis{k + 1}"], layout[f"yaxis{k + 1}"] = axis(_INCIDENCE), axis(label)
    passes = f", of {len(case.passes)} passes" if len(case.passes) > 1 else ""
    caption = (
        f"Mean, natural logarithm of the standard deviation in dB, and skewness of the pixels in each of "
        f"{found.incidence_deg.size} incidence-angle bins{passes}: measured, and expected of the reference run and of "
        "the best run at their effective looks, with the variance between fields. Bars: one standard deviation of "
        "simulated minus measured, by speckle and by effects of fields and cells, which the bins share."
    )
    return caption, f"Statistics of {name} by incidence-angle bin: measured, start and calibrated.", {
        "data": traces, "layout": layout
    }  # fmt: skip


def cost(case: Archive, name: str) -> Drawn:
    """Misfit of each run to the target, with the surrogate's predictions of the infill runs."""
    material = case.materials[name]
    rms = material.rms
    unit, ends = case.levels.unit, [-0.5, max(rms.size - 0.5, 1.0)]
    of_density = f"densities, rms [1/{unit}]"
    sampling = []
    if (error := material.target.rms_sampling) > 0.0:
        words = f"sampling error of {material.target.values_db.size:,} pixels"
        sampling = [level(error, SAMPLING, ends, words, hoverinfo="skip")]
    layout: dict[str, Any] = {"height": 420, "xaxis": axis("run (0: reference)", range=ends)}
    if case.bins:
        traces = _runs(case, name, np.maximum(2.0 * material.cost, 1e-3), 2.0)
        least = rms[rms > 0].min() / 3.0 if (rms > 0).any() else 1.0
        lower = [*_runs(case, name, np.where(rms > 0, rms, least), None), *sampling]
        traces += [{**one, "yaxis": "y2", "showlegend": one in sampling} for one in lower]
        layout |= {
            "height": 560,
            "yaxis": axis("squared residuals,<br>priors included", type="log", nticks=4, domain=[0.54, 1.0]),
            "yaxis2": axis(of_density.replace(", ", ",<br>"), type="log", nticks=4, domain=[0.0, 0.46]),
        }
        layout["xaxis"]["anchor"] = "y2"
    else:
        tolerance, floor = case.configured.stop.rms, floors(case, material)
        positive = np.concatenate([rms, [tolerance, error]])
        bottom = float(positive[positive > 0].min()) / 3.0
        traces = _runs(case, name, np.where(rms > 0, rms, bottom), 1.0)
        traces += [level(tolerance, TOLERANCE, ends, f"tolerance {short(tolerance)}", hoverinfo="skip"), *sampling]
        known = floor > 0.0
        if known.any():
            bar = marked(MUTED, "line-ew-open", 11, line={"width": 2})
            traces.append(trace("lower bound by the surrogate", np.flatnonzero(known), floor[known], **bar))
        layout["yaxis"] = axis(of_density, type="log")
    caption = cost_caption(case, name)
    if any(one["name"] == "predicted" for one in traces):
        caption += " Diamonds: cost that the surrogate predicted for each infill run."
    return caption, f"Misfit of each run of {name} on logarithmic axes, and its prediction.", {
        "data": traces, "layout": layout
    }  # fmt: skip


def _runs(case: Archive, name: str, shown: np.ndarray, times: float | None) -> list[Trace]:
    """One value for each run by its kind, the best so far, and the predicted cost, if any, multiplied by ``times``."""
    material = case.materials[name]
    runs, counted = np.arange(shown.size), np.asarray(np.isfinite(material.parameters).all(axis=1))
    best = np.minimum.accumulate(shown[counted])
    traces = [
        trace("best so far", runs[counted], best, mode="lines", line={"color": INK, "width": 1.6, "shape": "hv"},
              hoverinfo="skip")
    ]  # fmt: skip
    names = case.configured.materials[name].parameter_names
    texts = [
        ", ".join(f"{one} {value:.4g}" for one, value in zip(names, x, strict=False)) if known else "another law"
        for x, known in zip(material.parameters, counted, strict=True)
    ]
    after = ended(case, material)
    kinds = [(label, (case.runs.kind == kind) & ~after, style) for kind, (label, style) in RUNS.items()]
    for label, which, style in (*kinds, ("infill after it ended", after, {"color": PALE, "marker": "^", "s": 26})):
        if which.any():
            look = marked(style["color"], _SYMBOLS[style["marker"]], 1.3 * style["s"] ** 0.5)
            traces.append(
                trace(label, runs[which], shown[which], **look, text=[texts[run] for run in runs[which]],
                      hovertemplate="run %{x}: %{y:.3g}<br>%{text}<extra></extra>")
            )  # fmt: skip
    if times is not None and material.fidelity is not None and np.isfinite(material.fidelity.cost).any():
        infill = np.flatnonzero(case.runs.kind == "infill")
        look = marked(START["color"], "diamond-open", 11, line={"width": 2})
        text = "run %{x}, predicted: %{y:.3g}<extra></extra>"
        traces.append(trace("predicted", infill, times * material.fidelity.cost, **look, hovertemplate=text))
    return traces
