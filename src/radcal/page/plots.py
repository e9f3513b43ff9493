"""Interactive figures of ``report.html``: traces and layouts of plotly.js, from ``calibration.h5`` alone.

Colours, labels and numbers are those of the static figures.

The script of the page adds what all figures share: fonts, and the colours of text and grid in light and dark mode.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radcal.figures.chart import Chart, Curve
from radcal.figures.drawing import BAND, FOUND, HIDDEN, MUTED, START, Array, short, slugs
from radcal.figures.law_figures import cost_chart, kinds, law_chart, positive, squares, texts
from radcal.inference.moments import STATISTICS
from radcal.posterior.cells import STEP_DEG
from radcal.results.archive import Archive, BinStatistics


@dataclass(frozen=True)
class Interactive:
    """Interactive figure of one material.

    Attributes
    ----------
    name : str
        Unique name: kind of the figure and material, as ``law-dyke``.
    material : str
        Material that the figure shows.
    title, caption, alt : str
        Texts for the report: heading, explanation, and description for readers who cannot see the figure.
    spec : dict
        Traces ``data`` and ``layout`` of plotly.js, which JSON can express.
    """

    name: str
    material: str
    title: str
    caption: str
    alt: str
    spec: dict[str, Any]


Trace = dict[str, Any]
Drawn = tuple[str, list[Trace], dict[str, Any]]
"""Caption, traces and layout."""
Pair = tuple[dict[str, Any], dict[str, Any]]  # horizontal and vertical axis of a panel

_INK = "#000000"  # the script replaces it by the colour of the text in dark mode
_SYMBOLS = {"_": "line-ew-open", "s": "square", "P": "cross", "D": "diamond", "o": "circle", "^": "triangle-up"}
_DASHES = {"-": "solid", "-.": "dashdot"}
_DIVERGING = [[0.0, "#0072B2"], [0.5, "#F5F5F5"], [1.0, "#D55E00"]]
_INCIDENCE = "local incidence [deg]"
_UNITS = ("mean [dB]", "log sd", "skewness")
_SMOOTH = 100  # points that a smooth line needs
_MOST_PARAMETERS = 8  # of a corner plot
_MOST_POINTS = 6000  # in all panels of a corner plot


def _numbers(values: ArrayLike, digits: int = 4) -> list[float | None]:
    """Numbers for JSON with the given significant digits, and None for what is not finite."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in flat]


def _line(name: str, x: ArrayLike, y: ArrayLike, style: Mapping[str, Any], shape: str = "linear", **more: Any) -> Trace:
    """Line in a style of the static figures."""
    width, dash = style.get("linewidth", 1.6), style.get("linestyle", "-")
    dash = _DASHES[dash] if isinstance(dash, str) else ",".join(f"{part * width:g}px" for part in dash[1])
    line = {"color": style["color"], "width": width, "dash": dash, "shape": shape}
    return {"name": name, "x": _numbers(x), "y": _numbers(y), "mode": "lines", "line": line, **more}


def _points(name: str, x: ArrayLike, y: ArrayLike, colour: str, symbol: str = "circle", **more: Any) -> Trace:
    """Markers with a thin edge, or open ones with a wide one."""
    size = more.pop("size", 8.0)
    edge = {"width": 2.0} if symbol.endswith("open") else {"width": 0.6 if size > 5.0 else 0.0, "color": _INK}
    marker = {"color": colour, "symbol": symbol, "size": size, "line": edge}
    return {"name": name, "x": _numbers(x), "y": _numbers(y), "mode": "markers", "marker": marker, **more}


def _bars(sd: ArrayLike, **more: Any) -> dict[str, Any]:
    return {"type": "data", "array": _numbers(sd), "color": _INK, "thickness": 1.2, "width": 0, **more}


def _histogram(name: str, values: ArrayLike, edges: Array, colour: str, **more: Any) -> Trace:
    """Bars of a density."""
    heights = np.histogram(values, edges, density=True)[0]
    middles = _numbers(0.5 * (edges[1:] + edges[:-1]))
    return {"type": "bar", "name": name, "x": middles, "y": _numbers(heights), "marker": {"color": colour}, **more}


def _axis(title: str, **more: Any) -> dict[str, Any]:
    return {"title": {"text": title}, **more}


def _of_curve(curve: Curve) -> list[Trace]:
    """Traces of a curve of a static figure; a band has two."""
    style, name = curve.style, curve.label.removeprefix("_")
    each = slice(None, None, 1 if {"marker", "drawstyle"} & set(style) else 1 + curve.x.size // _SMOOTH)
    x, y = curve.x[each], curve.y[..., each]
    more: Trace = {"legendgroup": name, "showlegend": curve.label == name}
    if curve.text:
        more["text"] = list(curve.text[each])
    elif curve.label == name:  # a law is thin where it tells its numbers
        more["hoverinfo"] = "skip"
    if curve.y.ndim == 2:
        shape, line = "hv" if "step" in style else "linear", {**style, "linewidth": 0}
        red, green, blue = bytes.fromhex(style["color"][1:])
        fill = {"fill": "tonexty", "fillcolor": f"rgba({red}, {green}, {blue}, {style.get('alpha', 1.0)})"}
        low, high = (_line(name, x, edge, line, shape, **more) for edge in y)
        return [low | {"showlegend": False}, high | fill]
    if "marker" not in style:
        return [_line(name, x, y, style, "hv" if "drawstyle" in style else "linear", **more)]
    size = {"size": 1.3 * style["s"] ** 0.5} if "s" in style else {}
    bars = {} if curve.error is None else {"error_y": _bars(curve.error)}
    return [_points(name, x, y, style["color"], _SYMBOLS[style["marker"]], **size, **bars, **more)]


def _of_chart(chart: Chart) -> Drawn:
    """Caption, traces and layout of a static figure."""
    traces: list[Trace] = []
    named: set[str] = set()
    shapes: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"height": round(95 * chart.height), "shapes": shapes}
    gap, top, whole = 0.08, 1.0, sum(panel.share for panel in chart.panels)
    for number, panel in enumerate(chart.panels, start=1):
        key = f"{number}" if number > 1 else ""
        for one in (one for curve in panel.curves for one in _of_curve(curve)):
            traces.append({**one, "yaxis": f"y{key}", "showlegend": one["showlegend"] and one["name"] not in named})
            named |= {one["name"]} if one["showlegend"] else set()
        foot = max(top - panel.share / whole * (1.0 - gap * (len(chart.panels) - 1)), 0.0)
        axis = _axis(panel.y_label.replace("\n", "<br>"), domain=[foot, top])
        if panel.log:
            axis |= {"type": "log", "nticks": 4}
        if panel.limits is not None:
            axis["range"] = np.log10(panel.limits).tolist() if panel.log else list(panel.limits)
        layout[f"yaxis{key}"], top = axis, foot - gap
    shade = {"type": "rect", "y0": 0, "y1": 1, "yref": "paper", "fillcolor": MUTED, "opacity": 0.12, "layer": "below"}
    shapes += [{**shade, "line": {"width": 0}, "x0": low, "x1": high} for low, high in chart.shaded]
    if chart.determined is not None:
        low, high = chart.determined
        bar = {"type": "line", "y0": 0.015, "y1": 0.015, "yref": "y domain", "name": "determined", "showlegend": True}
        shapes.append({**bar, "line": {"width": 5, "color": BAND["color"]}, "x0": low, "x1": high})
    layout["xaxis"] = _axis(chart.x_label, range=chart.limits, anchor=f"y{key}")
    return chart.caption, traces, layout


def _law(case: Archive, name: str) -> Drawn | None:
    """Band of sigma0, laws and measured levels over the incidence angle, and histogram of the incidence."""
    chart = law_chart(case, name)
    return None if chart is None else _of_chart(chart)


def _cost(case: Archive, name: str) -> Drawn:
    """Misfit of each run to the target, with the surrogate's predictions of the infill runs."""
    fidelity, (caption, traces, layout) = case.materials[name].fidelity, _of_chart(cost_chart(case, name))
    if fidelity is not None and np.isfinite(fidelity.cost).any():
        predicted = fidelity.cost * (2.0 if case.bins else 1.0)
        at = np.flatnonzero(case.runs.kind == "infill")
        traces.append(_points("predicted", at, predicted, START["color"], "diamond-open", size=11))
        caption += " Diamonds: value that the surrogate predicted for each infill run."
    return caption, traces, layout


def _panels(traces: Sequence[list[Trace]], axes: Sequence[Pair]) -> tuple[list[Trace], dict[str, Any]]:
    """Traces and layout of a panel for each statistic; the script puts them below each other if there is no room."""
    data: list[Trace] = []
    layout: dict[str, Any] = {"height": 360, "grid": {"rows": 1, "columns": len(axes), "pattern": "independent"}}
    for n, (own, both) in enumerate(zip(traces, axes, strict=True), start=1):
        place = {"xaxis": f"x{n}", "yaxis": f"y{n}"}
        data += [{"showlegend": n == 1, **one, **place, "legendgroup": one["name"]} for one in own]
        layout[f"xaxis{n}"], layout[f"yaxis{n}"] = both
    return data, layout


def _runs_of_bins(found: BinStatistics) -> list[tuple[str, Array, str, str]]:
    """Label, statistics, colour and symbol of the runs whose bins are shown."""
    start = [] if found.start is None else [("start", found.start, START["color"], "square-open")]
    return [*start, ("calibrated", found.calibrated, FOUND["color"], "triangle-up")]


def _bins(case: Archive, name: str) -> Drawn | None:
    """Measured and simulated mean, log sd and skewness of each incidence-angle bin."""
    if (found := case.materials[name].bins) is None:
        return None
    at, traces = found.incidence_deg, []
    for k in range(len(_UNITS)):
        each = [_points(label, at, values[:, k], *look) for label, values, *look in _runs_of_bins(found)]
        traces.append([_points("measured", at, found.measured[:, k], _INK, error_y=_bars(found.error[:, k])), *each])
    caption = (
        f"Three statistics of the pixels in each of {at.size} incidence-angle bins: mean, logarithm of the standard "
        "deviation in dB, and skewness. “Start” is the reference run and “calibrated” the best run, each with its "
        "effective looks and with the variance between fields. Bars: standard deviation of simulated minus measured, "
        "by speckle, fields and cells (parts of fields)."
    )
    return caption, *_panels(traces, [(_axis(_INCIDENCE), _axis(unit)) for unit in _UNITS])


def _one_to_one(case: Archive, name: str) -> Drawn | None:
    """Simulated against measured statistics of the incidence-angle bins."""
    if (found := case.materials[name].bins) is None:
        return None
    runs, text = _runs_of_bins(found), [f"{angle:.1f} deg" for angle in found.incidence_deg]
    every = np.concatenate([found.measured, *(values for _, values, *_ in runs)])
    margin, traces, axes = 0.08 * np.ptp(every, axis=0), [], []
    for k, ends in enumerate(np.stack([every.min(axis=0) - margin, every.max(axis=0) + margin], axis=1).tolist()):
        more: dict[str, Any] = {"error_x": _bars(found.error[:, k], thickness=0.7), "text": text}
        each = [_points(label, found.measured[:, k], values[:, k], *look, **more) for label, values, *look in runs]
        traces.append([_line("equal", ends, ends, {"color": MUTED}, hoverinfo="skip"), *each])
        axes.append((_axis(f"measured {_UNITS[k]}", range=ends), _axis(f"simulated {_UNITS[k]}", range=ends)))
    caption = (
        "Each point is a statistic of an incidence-angle bin; on the line, simulated and measured value are equal. "
        "Bars: one standard deviation of simulated minus measured."
    )
    return caption, *_panels(traces, axes)


def _heat(z: Array, x: Sequence[str], y: Sequence[str], limit: float, **more: Any) -> Trace:
    """Signed values as coloured cells; z has shape (y, x)."""
    cells = {"z": [_numbers(row, 3) for row in z], "x": list(x), "y": list(y), "xgap": 2, "ygap": 2}
    bar = {"title": {"text": "standard<br>deviations"}, "thickness": 12}
    scale = {"colorscale": _DIVERGING, "zmin": -limit, "zmax": limit, "colorbar": bar}
    return {"type": "heatmap", "name": "", **cells, **scale, **more, "showlegend": False}


def _names_of_bins(case: Archive, found: BinStatistics) -> list[str]:
    several, each = len(case.passes) > 1, zip(found.incidence_deg, found.in_pass, strict=True)
    return [f"{angle:.1f}\N{DEGREE SIGN}" + f" ({number})" * several for angle, number in each]


def _misfit(case: Archive, name: str) -> Drawn | None:
    """Misfit of the best run by incidence-angle bin and statistic."""
    if (found := case.materials[name].bins) is None:
        return None
    away = ((found.calibrated - found.measured) / found.error).T
    each = ", ".join(f"{label} {short(float((row**2).mean()))}" for label, row in zip(STATISTICS, away, strict=True))
    caption = (
        "Each square: statistic of the best run minus that of the measurement, in standard deviations of this "
        f"difference. Mean squares over the bins, with correlations neglected: {each}."
    )
    heat = _heat(away, _names_of_bins(case, found), STATISTICS, 3.0, texttemplate="%{z:.2f}")
    return caption, [heat], {"height": 240, "xaxis": _axis(""), "yaxis": _axis("", autorange="reversed")}


def _sensitivity(case: Archive, name: str) -> Drawn | None:
    """Change of each statistic of each bin with each parameter, by the surrogate."""
    if (found := case.materials[name].bins) is None or found.sensitivity is None:
        return None
    names, labels = case.configured.materials[name].parameter_names, _names_of_bins(case, found)
    scaled = found.sensitivity / found.error[..., None]
    limit, composite = float(np.abs(scaled).max()), np.sqrt((scaled**2).mean(axis=(0, 1)))
    each = ", ".join(f"{one} {short(float(value))}" for one, value in zip(names, composite, strict=True))
    caption = (
        "Each square: change of a simulated statistic if one parameter of the law of the search grows by 1 % of the "
        "width of its bounds, in standard deviations of simulated minus measured. The surrogate predicts these "
        "changes; no run was made for them. Their root mean square over bins and statistics (composite scaled "
        f"sensitivity) is {each}."
    )
    heats = [[_heat(scaled[:, k].T, labels, names, limit or 1.0, showscale=k == 2)] for k in range(len(_UNITS))]
    return caption, *_panels(heats, [(_axis(one), _axis("", autorange="reversed")) for one in STATISTICS])


def _parallel(case: Archive, name: str) -> Drawn:
    """Parameters, looks and cost of all runs with the calibrated law as parallel coordinates."""
    material, settings = case.materials[name], case.configured.materials[name]
    cost, label = squares(material), "squared residuals, priors included"
    if not case.bins:
        cost = positive(material.rms, [case.configured.stop.rms, material.target.rms_sampling])
        label = f"densities, rms [1/{case.levels.unit}]"
    values = np.column_stack([material.parameters, material.looks, np.log10(cost)])
    ends = np.array([*settings.box, *([np.nanmin(one), np.nanmax(one)] for one in values.T[-2:])])
    unit = (values - ends[:, 0]) / np.maximum(np.ptp(ends, axis=1), 1e-12)
    place, traces = np.arange(len(ends)), []
    best = ("best run", np.array([material.best]), {"color": _INK})
    for words, which, style in (*kinds(case, material), best):
        x = np.tile([*place, np.nan], which.size)  # the gap of a NaN ends each run
        rows = np.column_stack([unit[which], np.full(which.size, np.nan)]).ravel()
        text = np.repeat(texts(case, name, which), place.size + 1).tolist()
        traces.append(_line(words, x, rows, {"color": style["color"]}, text=text, hoverinfo="text"))
    names = [*settings.parameter_names, "looks", "log10 cost"]
    ticks = [f"{one}<br>{low:.3g} to<br>{high:.3g}" for one, (low, high) in zip(names, ends, strict=True)]
    caption = (
        "Each line is a run. The axes of X end at the bounds, those of looks and cost at the smallest and the largest "
        f"value of all runs. Cost: {label}."
    )
    axis = _axis("", tickvals=place.tolist(), ticktext=ticks, range=[-0.5, len(ends) - 0.5], tickangle=0)
    hidden = _axis("", range=[-0.03, 1.03], showticklabels=False, showgrid=False, zeroline=False)
    return caption, traces, {"height": 380, "xaxis": axis, "yaxis": hidden}


def _predictive(case: Archive, name: str) -> Drawn | None:
    """Measured levels against those that the posterior predicts for other images of the ground."""
    posterior = case.materials[name].posterior
    if (points := posterior.points) is None:
        return None
    low, middle, high = points.predicted_db.T
    band = {"arrayminus": _numbers(middle - low), "symmetric": False, "color": BAND["color"], "thickness": 6}
    at, bars = points.incidence_deg, _bars(high - middle, **band)
    replicated = _points("other images of such ground, 90 %", at, 0.0 * middle, BAND["color"], error_y=bars)
    measured = _points("measured", at, points.level_db - middle, _INK, "diamond")
    layout = {"height": 320, "xaxis": _axis(_INCIDENCE), "yaxis": _axis("minus median of<br>the predictions [dB]")}
    caption = (
        f"Mean sigma0 of the cells (parts of fields) in each {STEP_DEG:g} deg of incidence: measured, and predicted by "
        "the posterior for other images of such ground, with other speckle, fields and cells. "
        f"{100.0 * points.p:.2g} % of the predicted images lie further from the posterior's laws than the "
        "measured image does; a share near 0 is a misfit."
    )
    return caption, [replicated, measured], layout


def _corner(case: Archive, name: str) -> Drawn | None:
    """Draws from the posterior of X by pairs of parameters, with prior and posterior of each on the diagonal."""
    material, settings = case.materials[name], case.configured.materials[name]
    posterior, names, d = material.posterior, settings.parameter_names, len(settings.box)
    if posterior.draws is None or d > _MOST_PARAMETERS:
        return None
    every = posterior.draws.parameters
    x = every[:: 1 + len(every) * d * (d - 1) // (2 * _MOST_POINTS)]
    marks = [("law of the search", material.parameters[material.best], FOUND["color"], "cross")]
    marks += [] if material.hidden is None else [("hidden truth", material.hidden, HIDDEN["color"], "x")]
    box, margin = np.array(settings.box, dtype=np.float64), 0.3 * np.ptp(every, axis=0)
    box += 0.03 * np.ptp(box, axis=1, keepdims=True) * [-1.0, 1.0]  # a marker on a bound is not cut
    low, high = np.maximum(box[:, 0], every.min(axis=0) - margin), np.minimum(box[:, 1], every.max(axis=0) + margin)
    traces: list[Trace] = []
    grid = {"rows": d, "columns": d, "pattern": "independent", "xgap": 0.08, "ygap": 0.1}
    layout: dict[str, Any] = {"height": 120 + 150 * d, "bargap": 0, "grid": grid}
    for column, row in combinations_with_replacement(range(d), 2):
        n, bottom, left = row * d + column + 1, row == d - 1, column == 0 < row
        on: dict[str, Any] = {"xaxis": f"x{n}", "yaxis": f"y{n}", "showlegend": column == 0 and row < 2}
        across, up = [low[column], high[column]], {} if row == column else {"range": [low[row], high[row]]}
        layout[f"xaxis{n}"] = _axis(names[column] * bottom, range=across, showticklabels=bottom, nticks=4)
        layout[f"yaxis{n}"] = _axis(names[row] * left, showticklabels=left, nticks=4, **up)
        if row > column:
            traces.append(_points("draw", x[:, column], x[:, row], BAND["color"], size=4, opacity=0.5, **on))
            traces += [_points(words, [at[column]], [at[row]], *look, **on) for words, at, *look in marks]
            continue
        edges = np.linspace(low[row], high[row], 21)
        traces.append(_histogram("posterior", every[:, row], edges, BAND["color"], opacity=0.5, **on))
        prior = np.histogram(material.prior[:, row], edges)[0] / len(material.prior) / np.diff(edges)
        traces.append(_line("prior", 0.5 * (edges[1:] + edges[:-1]), prior, {"color": MUTED}, "hvh", **on))
    state = "has converged" if posterior.sampled else "has not converged"
    caption = (
        f"Points: {len(x)} draws of X from the posterior. On the diagonal: densities of posterior and prior of each "
        "parameter. Where the points form a narrow strip, the image determines a combination of two parameters, though "
        f"neither of them alone. The sampler {state}: largest split R-hat {posterior.r_hat:.3f}, smallest effective "
        f"sample size {posterior.ess:,.0f}."
    )
    return caption, traces, layout


PLOTS: Sequence[tuple[str, str, str, Callable[[Archive, str], Drawn | None]]] = (
    ("law", "Sigma0 and laws", "Backscatter laws of {} in dB against local incidence in degrees.", _law),
    ("bins", "Incidence-angle bins", "Statistics of {} by incidence-angle bin: measured, start, calibrated.", _bins),
    ("one_to_one", "Simulated against measured bins", "Simulated against measured statistics of {}.", _one_to_one),
    ("misfit", "Misfit by bin and statistic", "Misfit of the best run of {} by bin and statistic.", _misfit),
    ("predictive", "Posterior predictive check", "Measured levels of {} and their predictions.", _predictive),
    ("corner", "Prior and posterior of X", "Corner plot of the posterior of the parameters of {}.", _corner),
    ("sensitivity", "Sensitivity of the statistics to X", "Sensitivity of the statistics of {} to X.", _sensitivity),
    ("cost", "Cost of each run", "Misfit of each run of {} on logarithmic axes, and its prediction.", _cost),
    ("parallel", "Parameters of all runs", "Parallel coordinates of the runs of {}.", _parallel),
)
"""Kind, title, description for readers who cannot see the figure, and function of each figure of a material."""


def interactive(archive: Archive) -> list[Interactive]:
    """Interactive figures of a calibration, material by material; a figure without data is left out.

    Parameters
    ----------
    archive : Archive
        Results of a calibration; the images are not read.
    """
    found = []
    for name, slug in zip(archive.materials, slugs(archive.materials), strict=True):
        for kind, title, alt, draw in PLOTS:
            if (drawn := draw(archive, name)) is not None:
                caption, data, layout = drawn
                spec = {"data": data, "layout": layout}
                found.append(Interactive(f"{kind}-{slug}", name, title, caption, alt.format(name), spec))
    return found


def packed(text: str) -> str:
    """Text compressed by gzip and written in base64; the same characters every time."""
    return base64.b64encode(gzip.compress(text.encode(), 6, mtime=0)).decode("ascii")


def embedded_library() -> str:
    """plotly.js as :func:`packed` text."""
    return packed(files("plotly").joinpath("package_data/plotly.min.js").read_text(encoding="utf-8"))


def script() -> str:
    """Script of the page that draws the interactive figures (``interactive.js``)."""
    return files("radcal.page").joinpath("interactive.js").read_text(encoding="utf-8")
