"""Traces and layouts of the interactive figures; colours, labels and numbers are those of the static figures.

The script of the page adds what all figures share: fonts, and the colours of text and grid in light and dark mode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.figures import law_figures
from radcal.figures.drawing import BAND, FOUND, HIDDEN, MUTED, SAMPLING, START, TOLERANCE, Array, short
from radcal.inference.moments import STATISTICS
from radcal.posterior.cells import STEP_DEG
from radcal.posterior.result import Curve
from radcal.results.archive import Archive, MaterialResult
from radcal.results.bin_statistics import BinStatistics

Trace = dict[str, Any]
Drawn = tuple[str, list[Trace], dict[str, Any]]
"""Caption, traces and layout."""
Pair = tuple[dict[str, Any], dict[str, Any]]  # horizontal and vertical axis of a panel

_INK = "#000000"  # the script replaces it by the colour of the text in dark mode
_SYMBOLS = {"s": "square", "P": "cross", "D": "diamond", "o": "circle", "^": "triangle-up"}
_DASHES = {"-": "solid", "-.": "dashdot"}
_DIVERGING = [[0.0, "#0072B2"], [0.5, "#F5F5F5"], [1.0, "#D55E00"]]
_INCIDENCE = "local incidence [deg]"
_UNITS = ("mean [dB]", "log sd", "skewness")
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


def _histogram(name: str, values: ArrayLike, edges: Array, colour: str, density: bool = True, **more: Any) -> Trace:
    """Bars of counts, or of a density."""
    heights = np.histogram(values, edges, density=density)[0]
    middles = _numbers(0.5 * (edges[1:] + edges[:-1]))
    return {"type": "bar", "name": name, "x": middles, "y": _numbers(heights), "marker": {"color": colour}, **more}


def _axis(title: str, **more: Any) -> dict[str, Any]:
    return {"title": {"text": title}, **more}


def _law(case: Archive, name: str) -> Drawn | None:
    """Band of sigma0, laws and measured levels over the incidence angle, and histogram of the incidence."""
    if not case.configured.laws[name].has_curve:
        return None
    material, laws = case.materials[name], law_figures.laws_of(case, name)
    seen, edges = law_figures.angle_axis(case, name)
    posterior, angles = material.posterior, np.linspace(edges[0], edges[-1], 121)
    # the gap of a NaN keeps the passes apart
    inside = np.concatenate([[*np.linspace(low, high, 41), np.nan] for low, high in seen.tolist()])
    of_angle = np.isfinite(inside)
    traces = [] if posterior.curve is None else _band(posterior.curve, angles)
    for label, curve, x, style in laws:
        thin, thick, group = style | {"linewidth": 0.8}, style | {"linewidth": 2.6}, {"legendgroup": label}
        traces.append(_line(label, angles, curve(np.radians(angles), x), thin, showlegend=False, **group))
        inside_db = np.full(inside.shape, np.nan)
        inside_db[of_angle] = curve(np.radians(inside[of_angle]), x)  # a formula refuses NaN
        traces.append(_line(label, inside, inside_db, thick, hoverinfo="skip", **group))
    if (points := posterior.points) is not None:
        levels = _points("measured levels, 95 %", points.incidence_deg, points.level_db, _INK)
        traces.append({**levels, "error_y": _bars(1.96 * points.error_db)})
    lowest = min(value for one in traces for value in one["y"] if value is not None)
    limits = law_figures.limits(laws, inside[of_angle], lowest)
    level = _axis(law_figures.SIGMA0, domain=[0.24, 1.0], **({"range": list(limits)} if limits else {}))
    pixels = _histogram("pixels", material.target.incidence_deg, edges, MUTED, density=False, yaxis="y2")
    shade = {"type": "rect", "y0": 0, "y1": 1, "yref": "paper", "fillcolor": MUTED, "opacity": 0.12, "layer": "below"}
    shapes = [{**shade, "line": {"width": 0}, "x0": low, "x1": high} for low, high in seen.tolist()]
    if (known := posterior.known_between_deg) is not None:
        bar = {"type": "line", "y0": 0.245, "y1": 0.245, "yref": "paper", "name": "determined", "showlegend": True}
        shapes.append({**bar, "line": {"width": 5, "color": BAND["color"]}, "x0": known[0], "x1": known[1]})
    below = {"yaxis2": _axis("pixels", domain=[0.0, 0.16]), "shapes": shapes, "bargap": 0}
    layout = {
        "height": 520,
        "xaxis": _axis(_INCIDENCE, range=[edges[0], edges[-1]], anchor="y2"),
        "yaxis": level,
        **below,
    }
    return law_figures.law_caption(case, name), [*traces, {**pixels, "showlegend": False}], layout


def _band(curve: Curve, angles: Array) -> list[Trace]:
    """The 90 % bands of the material and of its fields, and the median."""
    found = []
    for edges, alpha, label in (
        ((curve.p05_db, curve.p95_db), 0.15, "90 % band of the material"),
        ((curve.field_p05_db, curve.field_p95_db), 0.3, "its fields in this image"),
    ):
        low, high = (np.interp(angles, curve.incidence_deg, edge) for edge in edges)
        none, group = BAND | {"linewidth": 0}, {"legendgroup": label, "hoverinfo": "skip"}
        fill = {"fill": "tonexty", "fillcolor": f"rgba(123, 63, 158, {alpha})"}
        found.append(_line(label, angles, low, none, showlegend=False, **group))
        found.append(_line(label, angles, high, none, **fill, **group))
    low, middle, high = curve.at(angles)
    text = [f"90 % band: {a:.2f} to {b:.2f} dB" for a, b in zip(low, high, strict=True)]
    return [*found, _line("median", angles, middle, BAND, text=text)]


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
        f"Mean, logarithm of the standard deviation in dB, and skewness of the pixels in {at.size} incidence-angle "
        "bins: measured, and expected of reference run and best run, at their effective looks and with the variance "
        "between fields. Bars: standard deviation of the difference, by speckle, fields and cells."
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
        "Statistics of the bins; on the line, simulated and measured are equal. Bars: one standard deviation of the "
        "difference."
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
    caption = f"Best run minus measurement in standard deviations. Mean squares, without correlations: {each}."
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
        "Change of each simulated statistic if a parameter grows by 1 % of the width of its bounds, at the X of the "
        "search, in standard deviations of simulated minus measured. By the surrogate of all runs: no run was made for "
        f"it. Root mean square over bins and statistics (composite scaled sensitivity): {each}."
    )
    heats = [[_heat(scaled[:, k].T, labels, names, limit or 1.0, showscale=k == 2)] for k in range(len(_UNITS))]
    return caption, *_panels(heats, [(_axis(one), _axis("", autorange="reversed")) for one in STATISTICS])


def _cost_of(case: Archive, material: MaterialResult) -> tuple[Array, str]:
    """Cost of each run as it is drawn, positive, and its label."""
    if case.bins:
        return np.maximum(2.0 * material.cost, 1e-3), "squared residuals, priors included"
    limits = [case.configured.stop.rms, material.target.rms_sampling]
    return _positive(material.rms, limits), f"densities, rms [1/{case.levels.unit}]"


def _positive(rms: Array, others: Sequence[float] = ()) -> Array:
    """Values for a logarithmic axis, with a third of the smallest positive one in place of 0."""
    every = np.array([*rms, *others])
    return np.where(rms > 0.0, rms, min(every[every > 0.0], default=3.0) / 3.0)


def _cost(case: Archive, name: str) -> Drawn:
    """Misfit of each run to the target, with the surrogate's predictions of the infill runs."""
    material, caption = case.materials[name], law_figures.cost_caption(case, name)
    (shown, label), fidelity, error = _cost_of(case, material), material.fidelity, material.target.rms_sampling
    ends = [-0.5, max(shown.size - 0.5, 1.0)]
    traces = _each_run(case, name, shown)
    if fidelity is not None and np.isfinite(fidelity.cost).any():
        predicted = fidelity.cost * (2.0 if case.bins else 1.0)
        at = np.flatnonzero(case.runs.kind == "infill")
        traces.append(_points("predicted", at, predicted, START["color"], "diamond-open", size=11))
        caption += " Diamonds: cost that the surrogate predicted for each infill run."
    words = f"sampling error of {material.target.values_db.size:,} pixels"
    sampling = [_line(words, ends, [error, error], SAMPLING, hoverinfo="skip")] if error > 0.0 else []
    log = {"type": "log", "nticks": 4}
    layout: dict[str, Any] = {"height": 420, "yaxis": _axis(label.replace(", ", ",<br>"), **log)}
    layout["xaxis"] = _axis("run (0: reference)", range=ends)
    if case.bins:
        lower = [one | {"showlegend": False} for one in _each_run(case, name, _positive(material.rms))]
        traces += [one | {"yaxis": "y2"} for one in (*lower, *sampling)]
        layout["yaxis"]["domain"], layout["xaxis"]["anchor"] = [0.54, 1.0], "y2"
        label = f"densities, rms [1/{case.levels.unit}]"
        return caption, traces, layout | {"height": 560, "yaxis2": _axis(label, domain=[0.0, 0.46], **log)}
    tolerance, floor = case.configured.stop.rms, law_figures.floors(case, material)
    traces += [_line(f"tolerance {short(tolerance)}", ends, [tolerance] * 2, TOLERANCE, hoverinfo="skip"), *sampling]
    if (at := np.flatnonzero(floor > 0.0)).size:
        traces.append(_points("lower bound by the surrogate", at, floor[at], MUTED, "line-ew-open", size=11))
    return caption, traces, layout


def _texts(case: Archive, name: str, which: NDArray[np.intp]) -> list[str]:
    """Number and X of some runs."""
    names, parameters = case.configured.materials[name].parameter_names, case.materials[name].parameters
    each = [", ".join(f"{one} {x:.4g}" for one, x in zip(names, parameters[run], strict=True)) for run in which]
    other = np.asarray(np.isnan(parameters[which]).any(axis=1))
    return [f"run {run}: {'another law' if of else x}" for run, x, of in zip(which, each, other, strict=True)]


def _each_run(case: Archive, name: str, shown: Array) -> list[Trace]:
    """One value for each run by its kind, with X as text, and the smallest value up to each run."""
    own = np.flatnonzero(np.isfinite(case.materials[name].parameters).all(axis=1))
    best = np.minimum.accumulate(shown[own])
    traces = [_line("best so far", own, best, {"color": _INK}, "hv", hoverinfo="skip")]
    for label, which, style in law_figures.kinds(case, case.materials[name]):
        look = {"size": 1.3 * style["s"] ** 0.5, "text": _texts(case, name, which)}
        traces.append(_points(label, which, shown[which], style["color"], _SYMBOLS[style["marker"]], **look))
    return traces


def _parallel(case: Archive, name: str) -> Drawn:
    """Parameters, looks and cost of all runs with the calibrated law as parallel coordinates."""
    material, settings = case.materials[name], case.configured.materials[name]
    cost, label = _cost_of(case, material)
    values = np.column_stack([material.parameters, material.looks, np.log10(cost)])
    ends = np.array([*settings.box, *([np.nanmin(one), np.nanmax(one)] for one in values.T[-2:])])
    unit = (values - ends[:, 0]) / np.maximum(np.ptp(ends, axis=1), 1e-12)
    place, traces = np.arange(len(ends)), []
    best = ("best run", np.array([material.best]), {"color": _INK})
    for words, which, style in (*law_figures.kinds(case, material), best):
        x = np.tile([*place, np.nan], which.size)  # the gap of a NaN ends each run
        rows = np.column_stack([unit[which], np.full(which.size, np.nan)]).ravel()
        text = np.repeat(_texts(case, name, which), place.size + 1).tolist()
        traces.append(_line(words, x, rows, {"color": style["color"]}, text=text, hoverinfo="text"))
    names = [*settings.parameter_names, "looks", "log10 cost"]
    ticks = [f"{one}<br>{low:.3g} to<br>{high:.3g}" for one, (low, high) in zip(names, ends, strict=True)]
    caption = f"Each line is a run. Axes end at the bounds of X and at the extremes of looks and cost ({label})."
    axis = _axis("", tickvals=place.tolist(), ticktext=ticks, range=[-0.5, len(ends) - 0.5], tickangle=0)
    hidden = _axis("", range=[-0.03, 1.03], showticklabels=False, showgrid=False, zeroline=False)
    return caption, traces, {"height": 380, "xaxis": axis, "yaxis": hidden}


def _predictive(case: Archive, name: str) -> Drawn | None:
    """Measured levels against those that the posterior predicts for other images of the ground."""
    posterior = case.materials[name].posterior
    if (points := posterior.points) is None or points.predicted_db is None:
        return None
    low, middle, high = points.predicted_db.T
    band = {"arrayminus": _numbers(middle - low), "symmetric": False, "color": BAND["color"], "thickness": 6}
    at, bars = points.incidence_deg, _bars(high - middle, **band)
    replicated = _points("other images of such ground, 90 %", at, 0.0 * middle, BAND["color"], error_y=bars)
    measured = _points("measured", at, points.level_db - middle, _INK, "diamond")
    layout = {"height": 320, "xaxis": _axis(_INCIDENCE), "yaxis": _axis("minus median of<br>the predictions [dB]")}
    caption = (
        f"Mean level of the cells in each {STEP_DEG:g} deg of incidence: measured, and predicted by the posterior for "
        f"images with other speckle, fields and cells. Of these, {100.0 * (points.p or 0.0):.2g} % lie further from "
        "the draws of the law than the measured image: a share near 0 is a misfit."
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
        f"{len(x)} draws of X, taken evenly from the sample; diagonal: densities of posterior and prior. A narrow "
        "strip is a combination of two parameters that the image fixes, even if it leaves each open. The sampler "
        f"{state}: largest split R-hat {posterior.r_hat:.3f}, smallest effective sample size {posterior.ess:,.0f}."
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
