"""Figures of the calibrated law, and of each run's misfit to the target (its cost)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.figures import drawing
from radcal.figures.chart import Chart, Curve, Panel, drawn
from radcal.figures.drawing import RUNS, SIGMA0, Array, Drawn, short
from radcal.laws import Law
from radcal.posterior.cells import STEP_DEG
from radcal.posterior.result import Curve as Sigma0
from radcal.results.archive import Archive, MaterialResult
from radcal.words import state, widths

Styled = tuple[str, Law, Array, dict[str, Any]]
"""Label, law, X and style of a law."""
_GRAZING_DB = -60.0
_LAST_DEG = 85.0  # largest incidence at which bands and curves are drawn
_SEARCH, _NEAREST = "law of the search", "law nearest to the median"
_CONTEXT_DEG = 5.0  # smallest margin of the angle axis on each side of the incidence seen
_BEST: dict[str, Any] = {"color": "#000000", "linewidth": 1.6, "drawstyle": "steps-post"}
_POINTS: dict[str, Any] = {
    "color": "#000000", "linestyle": "none", "marker": "o", "markersize": 4.5, "elinewidth": 1.2, "zorder": 4,
}  # fmt: skip


def kinds(case: Archive, material: MaterialResult) -> list[tuple[str, NDArray[np.intp], dict[str, Any]]]:
    """Label, numbers and style of the runs of each kind.

    The infill runs after the end of a material's search, which repeat its best X for other materials, are a kind.
    """
    after = np.zeros(case.runs.kind.size, dtype=bool)
    if material.fidelity is not None:
        after[case.runs.kind == "infill"] = [mode == "ended" for mode in material.fidelity.mode]
    found = [(label, np.flatnonzero((case.runs.kind == kind) & ~after), style) for kind, (label, style) in RUNS.items()]
    late = ("infill after it ended", np.flatnonzero(after), RUNS["infill"][1] | {"color": drawing.PALE, "s": 26})
    return [one for one in (*found, late) if one[1].size]


def texts(case: Archive, name: str, which: NDArray[np.intp]) -> list[str]:
    """Number and X of some runs."""
    names, parameters = case.configured.materials[name].parameter_names, case.materials[name].parameters
    each = [", ".join(f"{one} {x:.4g}" for one, x in zip(names, parameters[run], strict=True)) for run in which]
    other = np.asarray(np.isnan(parameters[which]).any(axis=1))
    return [f"run {run}: {'another law' if of else x}" for run, x, of in zip(which, each, other, strict=True)]


def _each_run(case: Archive, name: str, shown: Array) -> list[Curve]:
    """Value of each run by its kind, and the smallest value up to each run; a run of another law is never the best."""
    own = np.flatnonzero(np.isfinite(case.materials[name].parameters).all(axis=1))
    best = Curve("best so far", own, np.minimum.accumulate(shown[own]), _BEST)
    each = kinds(case, case.materials[name])
    return [best, *(Curve(label, at, shown[at], style, text=texts(case, name, at)) for label, at, style in each)]


def positive(rms: Array, others: Sequence[float] = ()) -> Array:
    """Values for a logarithmic axis, with a third of the smallest positive one in place of 0."""
    every = np.array([*rms, *others])
    return np.where(rms > 0.0, rms, min(every[every > 0.0], default=3.0) / 3.0)


def squares(material: MaterialResult) -> Array:
    """Sum of squared residuals of each run, priors included, as it is drawn on a logarithmic axis."""
    return np.maximum(2.0 * material.cost, 1e-3)


def cost_chart(case: Archive, name: str) -> Chart:
    """Misfit of each run to the target (its cost): that of the bins, and the rms difference of the densities."""
    material, unit, tolerance = case.materials[name], case.levels.unit, case.configured.stop.rms
    best, error = material.best, material.target.rms_sampling
    ends = np.array([-0.5, max(material.rms.size - 0.5, 1.0)])
    rms = positive(material.rms, () if case.bins else (tolerance, error))
    densities = _each_run(case, name, rms)
    if not case.bins:
        densities.append(Curve(f"tolerance {short(tolerance)}", ends, np.full(2, tolerance), drawing.TOLERANCE))
    if error > 0.0:
        words = f"sampling error of {material.target.values_db.size:,} pixels"
        densities.append(Curve(words, ends, np.full(2, error), drawing.SAMPLING))
    if case.bins:
        shown = squares(material)
        upper = Panel("squared residuals,\npriors included", _each_run(case, name, shown), log=True)
        panels = [upper, Panel(f"densities, rms [1/{unit}]", densities, log=True)]
        title = f"best misfit {short(shown[best])} in run {best}"
        alt = f"Misfit of each run of {name} on logarithmic axes: incidence-angle bins, density."
    else:
        bottom = positive(np.zeros(1), (*material.rms, tolerance, error)).item()
        floor = _floors(case, material)
        known = np.flatnonzero(floor > 0.0)
        if known.size:
            bars = {"color": drawing.MUTED, "marker": "_", "s": 81, "linewidths": 1.8}
            densities.append(Curve("lower bound by the surrogate", known, np.maximum(floor[known], bottom), bars))
        limits = bottom, 2.0 * max(float(rms.max()), tolerance, error)
        panels = [Panel(f"difference of the densities, rms [1/{unit}]", densities, log=True, limits=limits)]
        title = f"best rms {short(material.rms[best])} 1/{unit} in run {best}"
        alt = f"Cost of each run of {name} on a logarithmic axis, with the tolerance."
    return Chart(
        title=title,
        caption=_cost_caption(case, name),
        alt=alt,
        x_label="run (0: reference)",
        limits=(float(ends[0]), float(ends[1])),
        panels=panels,
        height=6.2 if case.bins else 4.8,
    )


def cost(case: Archive, name: str) -> Drawn:
    """Figure of each run's misfit to the target (its cost)."""
    return drawn(cost_chart(case, name), case, name)


def _cost_caption(case: Archive, name: str) -> str:
    """Caption of the figure of each run's misfit to the target."""
    material, unit = case.materials[name], case.levels.unit
    pixels, sampling = material.target.values_db.size, short(material.target.rms_sampling)
    if case.bins:
        return (
            "Above: misfit of each run. It is the sum of the squared residuals of the incidence-angle bins and of the "
            "priors, in standard deviations, at the effective looks that fit the run best. "
            "Below: root mean square difference between the simulated and the target density, which the search does "
            f"not minimise. The dotted line is the sampling error: another sample of {pixels:,} pixels would move the "
            f"target by about {sampling} 1/{unit}."
        )
    caption = (
        "Root mean square difference between the simulated and the target density of each run; the line is the "
        f"smallest so far. The dotted line is the sampling error: another sample of {pixels:,} pixels would move the "
        f"target by about {sampling} 1/{unit}, so that a smaller difference tells nothing more about the material."
    )
    if (_floors(case, material) > 0.0).any():
        caption += " Short bars: smallest rms inside the bounds that the surrogate predicts, less two standard errors."
    if not np.all(material.rms > 0):
        caption += " Runs on the lower edge have an rms of 0."
    return caption


def _floors(case: Archive, material: MaterialResult) -> Array:
    """Smallest cost that the surrogate allows inside the bounds, by run, shape (n,); NaN where it is unknown."""
    found = np.full(material.rms.size, np.nan)
    if material.fidelity is not None:
        found[case.runs.kind == "infill"] = material.fidelity.floor
    return found


def law_chart(case: Archive, name: str) -> Chart | None:
    """Band of sigma0 and laws over the incidence angle, and their difference from a hidden truth; None without a curve.

    Laws are thick at the angles seen in each pass.
    """
    material, searched = case.materials[name], case.configured.laws[name]
    if not searched.has_curve:
        return None
    posterior, hidden = material.posterior, material.hidden
    each_seen, edges = _angle_axis(case, name)
    angles, laws = np.linspace(edges[0], edges[-1], 361), _laws_of(case, name)
    inside = np.concatenate([np.linspace(low, high, 41) for low, high in each_seen])
    breaks = np.arange(41, inside.size + 1, 41)  # a NaN keeps the passes apart

    def lines(less: Array | None, *shown: Styled) -> list[Curve]:
        found = []
        for label, curve, x, style in shown:
            for at, mark, width in ((angles, "_", 0.8), (inside, "", 2.6)):
                level = curve(np.radians(at), x) - (0.0 if less is None else searched(np.radians(at), less))
                x_line, y_line = (np.insert(one, breaks if at is inside else [], np.nan) for one in (at, level))
                found.append(Curve(mark + label, x_line, y_line, style | {"linewidth": width}))
        return found

    main = [*_bands(posterior.curve, angles), *lines(None, *laws)]
    limits = None
    # a law that falls steeply at grazing incidence would flatten all other curves
    if min(float(np.nanmin(curve.y)) for curve in main) < _GRAZING_DB:
        levels = np.concatenate([curve(np.radians(inside), x) for _, curve, x, _ in laws])
        limits = float(levels.min()) - 3.0, float(levels.max()) + 3.0
    if (points := posterior.points) is not None:
        error = 1.96 * points.error_db
        main.append(Curve("measured levels, 95 %", points.incidence_deg, points.level_db, _POINTS, error))
    panels = [Panel(SIGMA0, main, 4.0, limits=limits)]
    if hidden is not None:
        gaps = lines(hidden, *(law for law in laws if law[0] in (_SEARCH, _NEAREST)))
        bands = _bands(posterior.curve, angles, searched(np.radians(angles), hidden))
        near = np.isin(angles, angles[np.searchsorted(angles, inside).clip(max=angles.size - 1)])
        seen = [*(curve.y for curve in gaps[1::2]), *(band.y[..., near].ravel() for band in bands[:1])]
        largest = 1.2 * max(0.05, float(np.nanmax(np.abs(np.concatenate(seen)))))
        zero = Curve("_truth", edges[[0, -1]], np.zeros(2), drawing.HIDDEN)
        panels.append(Panel("minus\ntruth [dB]", [*gaps, *bands, zero], 1.6, limits=(-largest, largest)))
    counts = np.histogram(material.target.incidence_deg, edges)[0]
    pixels = Curve(
        "_pixels", edges, np.array([0.0 * edges, [*counts, counts[-1]]]), {"color": drawing.MUTED, "step": "post"}
    )
    panels.append(Panel("pixels", [pixels], limits=(0.0, 1.05 * max(float(counts.max()), 1.0))))
    return Chart(
        title=state(name, case.findings) or "law of the search",
        caption=_law_caption(case, name),
        alt=f"Backscatter laws of {name} in dB against local incidence in degrees.",
        x_label="local incidence [deg]",
        limits=(float(edges[0]), float(edges[-1])),
        panels=panels,
        height=4.6 + 0.4 * sum(panel.share for panel in panels[1:]),
        shaded=[(low, high) for low, high in each_seen.tolist()],
        determined=posterior.known_between_deg,
    )


def law(case: Archive, name: str) -> Drawn | None:
    """Figure of the band of sigma0 and of the laws over the incidence angle; None for laws without a curve."""
    chart = law_chart(case, name)
    return None if chart is None else drawn(chart, case, name)


def _bands(curve: Sigma0 | None, angles: Array, less: Array | float = 0.0) -> list[Curve]:
    """The 90 % bands of the material and of its fields, and the median, minus ``less`` [dB] at each angle."""
    if curve is None:
        return []
    low, middle, high = curve.at(angles) - less
    fields = np.stack(
        [np.interp(angles, curve.incidence_deg, y) - less for y in (curve.field_p05_db, curve.field_p95_db)]
    )
    text = [f"90 % band: {a:.2f} to {b:.2f} dB" for a, b in zip(low, high, strict=True)]
    return [
        Curve(
            "90 % band of the material", angles, np.stack([low, high]), {"color": drawing.BAND["color"], "alpha": 0.15}
        ),
        Curve("its fields in this image", angles, fields, {"color": drawing.BAND["color"], "alpha": 0.3}),
        Curve("median", angles, middle, drawing.BAND, text=text),
    ]


def _angle_axis(case: Archive, name: str) -> tuple[Array, Array]:
    """Intervals of incidence seen in the passes, (p, 2), and edges of a histogram over the whole angle axis [deg]."""
    seen = case.materials[name].posterior.seen_deg
    # each margin of the angle axis is as wide as the incidence interval seen
    margin = max(_CONTEXT_DEG, float(np.ptp(seen)))
    low, high = max(0.0, np.floor(seen.min() - margin)), min(_LAST_DEG, np.ceil(seen.max() + margin))
    return seen, np.linspace(low, high, 86)


def _law_caption(case: Archive, name: str) -> str:
    """Caption of the figure of the laws over the incidence angle."""
    material, curve = case.materials[name], case.configured.laws[name]
    several = len(case.passes) > 1
    shaded = " and ".join(f"{low:.1f} to {high:.1f}" for low, high in _angle_axis(case, name)[0])
    histogram = "in each pass (histogram of pass 1 below)" if several else "(histogram below)"
    caption = (
        f"Backscatter against local incidence. Shaded, with thick lines: the incidence seen, {shaded} deg, where 90 % "
        f"of the material's pixels lie {histogram}. Outside of it, every law is an extrapolation."
        f"{_of_band(case, name)}"
    )
    if material.hidden is not None:
        shown = [(words, x) for words, _, x, _ in _laws_of(case, name) if words in (_SEARCH, _NEAREST)]
        angles = material.target.incidence_deg
        each = [(words, curve.largest_difference_db(x, material.hidden, angles)) for words, x in shown]
        found = [f"{words} by at most {largest:.2g} dB" for words, largest in each]
        where = "the incidence of pass 1" if several else "the incidence seen"
        caption += f" Over {where} the hidden truth differs from the {' and from the '.join(found)}."
    if material.posterior.points is not None:
        caption += (
            f" Dots: measured sigma0, the mean over the cells (parts of fields) in each {STEP_DEG:g} deg of incidence. "
            "An offset of the whole image is subtracted, and all that the simulator adds to a law: the area of the "
            "ground in a pixel, noise, and neighbouring ground. Bars: 95 % intervals by speckle and by differences "
            "between fields and between cells."
        )
    return caption


def _of_band(case: Archive, name: str) -> str:
    """Part of the caption that describes the bands; empty without a band."""
    if case.materials[name].posterior.curve is None:
        return ""
    text = (
        " Violet: sigma0, the mean power of the ground, with the median (dotted) and the 90 % band of the material "
        "(pale). The darker band is that of the material's fields in this image alone."
    )
    if width := widths(name, case.findings):
        text += f" Largest half-widths of the bands where sigma0 is determined (violet bar): {width}."
    return text


def _laws_of(case: Archive, name: str) -> list[Styled]:
    """Label, law, X and style of the laws to draw: start, search, nearest to the median, and hidden truth."""
    material, configured, curve = case.materials[name], case.configured.materials[name], case.configured.laws[name]
    posterior, start = material.posterior, case.configured.at_start.laws[name]
    begun = f"start ({configured.at_start.law})" if configured.starts_with_another_law else "start"
    laws = [
        (begun, start, np.array(configured.start_parameters), drawing.START),
        (_SEARCH, curve, material.parameters[material.best], drawing.FOUND),
    ]
    if posterior.parameters_model is not None:
        laws.append((_NEAREST, curve, posterior.parameters_model, drawing.MODEL))
    if material.hidden is not None:
        laws.append(("hidden truth", curve, material.hidden, drawing.HIDDEN))
    return laws
