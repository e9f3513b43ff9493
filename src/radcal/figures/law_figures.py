"""Figures of the calibrated law, and of each run's misfit to the target (its cost)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.figures.colours import head
from radcal.figures.drawing import (
    BAND,
    FOUND,
    HIDDEN,
    MODEL,
    MUTED,
    PALE,
    RUNS,
    SAMPLING,
    START,
    TOLERANCE,
    Array,
    Drawn,
    add_legend,
    new_canvas,
    short,
)
from radcal.laws import Law
from radcal.posterior.cells import STEP_DEG
from radcal.posterior.result import Curve
from radcal.results.archive import Archive, MaterialResult
from radcal.words import state, widths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Styled = Sequence[tuple[str, Law, Array, dict[str, Any]]]
"""Label, law, X and style of each of several laws."""
SIGMA0 = "\N{GREEK SMALL LETTER SIGMA}\N{SUPERSCRIPT ZERO} [dB]"
"""Label of the axis of sigma0."""

_GRAZING_DB = -60.0
_LAST_DEG = 85.0  # largest incidence at which bands and curves are drawn
_SEARCH, _NEAREST = "law of the search", "law nearest to the median"
_CONTEXT_DEG = 5.0  # smallest margin of the angle axis on each side of the incidence seen


def _runs(axes: Axes, case: Archive, material: MaterialResult, shown: Array) -> None:
    """Draw one value for each run, marked by the kind of run, and the smallest value up to each run."""
    runs = np.arange(shown.size)
    counted = np.isfinite(material.parameters).all(axis=1)  # a run of another law is never the best
    best = np.minimum.accumulate(shown[counted])
    axes.step(runs[counted], best, where="post", color="black", linewidth=1.6, label="best so far")
    for label, which, style in kinds(case, material):
        axes.scatter(
            runs[which], shown[which], label=label, edgecolors="black", linewidths=0.4, zorder=3, clip_on=False, **style
        )
    axes.set_yscale("log")


def kinds(case: Archive, material: MaterialResult) -> list[tuple[str, NDArray[np.intp], dict[str, Any]]]:
    """Label, numbers and style of the runs of each kind; those after the end of a material's search are a kind."""
    after = _ended(case, material)
    found = [(label, np.flatnonzero((case.runs.kind == kind) & ~after), style) for kind, (label, style) in RUNS.items()]
    late = ("infill after it ended", np.flatnonzero(after), {"color": PALE, "marker": "^", "s": 26})
    return [one for one in (*found, late) if one[1].size]


def _ended(case: Archive, material: MaterialResult) -> NDArray[np.bool_]:
    """Mask of the infill runs after the end of a material's search, which repeat its best X for other materials."""
    found = np.zeros(case.runs.kind.size, dtype=bool)
    if material.fidelity is not None:
        found[case.runs.kind == "infill"] = [mode == "ended" for mode in material.fidelity.mode]
    return found


def _run_words(case: Archive, material: MaterialResult) -> tuple[str, str]:
    """Remark for the title on the last run of a material's search, and sentences on the numbers of the runs."""
    kinds, after = case.runs.kind, _ended(case, material)
    reused, design = np.flatnonzero(kinds == "reused"), np.flatnonzero(kinds == "design")
    text = "Run 0 is the reference run"
    if (again := np.flatnonzero(kinds == "registration")).size:
        text += f", run {again[0]} the registration run"
    if reused.size:
        which = f"runs {reused[0]} to {reused[-1]} are" if reused.size > 1 else f"run {reused[0]} is"
        text += f", {which} from an earlier case"
    if design.size:
        text += f", run {design[0]} the first of the design"
    text = f" {text}."
    if not after.any():
        return "", text
    last = int(np.flatnonzero(after)[0]) - 1
    count = int(np.isin(kinds[: last + 1], ("design", "infill")).sum())
    text += (
        f" The search of this material ended after run {last} (runs of design and infill until then: {count}); the "
        "runs after it (grey) were made for other materials and repeat its best X."
    )
    return f", search ended after run {last}", text


def _number_runs(axes: Axes, number: int) -> None:
    """Label the axis of the runs."""
    from matplotlib.ticker import MaxNLocator

    axes.set_xlim(-0.5, max(number - 0.5, 1.0))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("run (0: reference)")


def cost(case: Archive, name: str) -> Drawn:
    """Figure of each run's misfit to the target (its cost)."""
    return _law_cost(case, name) if case.bins else _density_cost(case, name)


def _law_cost(case: Archive, name: str) -> Drawn:
    """Draw, for each run, the misfit of the incidence-angle bins and the rms difference from the target density."""
    material = case.materials[name]
    canvas = new_canvas(6.2, 6.2)
    upper, lower = canvas.subplots(2, 1, sharex=True)
    squares = np.maximum(2.0 * material.cost, 1e-3)
    remark, _ = _run_words(case, material)
    _runs(upper, case, material, squares)
    upper.set_ylabel("squared residuals,\npriors included")
    head(upper, case, name, f"best misfit {short(squares[material.best])} in run {material.best}{remark}")
    rms = material.rms
    _runs(lower, case, material, np.where(rms > 0, rms, rms[rms > 0].min() / 3.0 if (rms > 0).any() else 1.0))
    if material.target.rms_sampling > 0:
        lower.axhline(
            material.target.rms_sampling,
            label=f"sampling error of {material.target.values_db.size:,} pixels",
            **SAMPLING,
        )
    lower.set_ylabel(f"densities, rms [1/{case.levels.unit}]")
    _number_runs(lower, rms.size)
    entries: dict[str, Any] = {}
    for axes in (upper, lower):
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    add_legend(canvas, (list(entries.values()), list(entries)), 3)
    alt = f"Misfit of each run of {name} on logarithmic axes: incidence-angle bins, density."
    return canvas, cost_caption(case, name), alt


def _density_cost(case: Archive, name: str) -> Drawn:
    """Draw the rms difference between each run's density and the target density."""
    material = case.materials[name]
    canvas = new_canvas(6.2, 4.8)
    axes = canvas.subplots()
    rms = material.rms
    runs = np.arange(rms.size)
    tolerance = case.configured.stop.rms
    positive = np.concatenate([rms[rms > 0], [tolerance, material.target.rms_sampling]])
    positive = positive[np.isfinite(positive) & (positive > 0)]
    # a cost of exactly 0 is drawn on the lower edge of the logarithmic axis
    bottom = float(positive.min()) / 3.0
    shown = np.where(rms > 0, rms, bottom)
    _runs(axes, case, material, shown)
    axes.axhline(tolerance, label=f"tolerance {short(tolerance)}", **TOLERANCE)
    pixels = material.target.values_db.size
    if material.target.rms_sampling > 0:
        axes.axhline(material.target.rms_sampling, label=f"sampling error of {pixels:,} pixels", **SAMPLING)
    floor = floors(case, material)
    known = floor > 0.0
    if known.any():
        axes.plot(runs[known], np.maximum(floor[known], bottom), color=MUTED, linestyle="none", marker="_",
                  markersize=9, markeredgewidth=1.8, label="lower bound by the surrogate")  # fmt: skip
    top = max(float(shown.max()), float(positive.max()))
    axes.set_ylim(bottom, 2.0 * top)
    _number_runs(axes, rms.size)
    remark, _ = _run_words(case, material)
    head(axes, case, name, f"best rms {short(rms[material.best])} 1/{case.levels.unit} in run {material.best}{remark}")
    axes.set_ylabel(f"difference of the densities, rms [1/{case.levels.unit}]")
    add_legend(canvas, axes.get_legend_handles_labels(), 3)
    return canvas, cost_caption(case, name), f"Cost of each run of {name} on a logarithmic axis, with the tolerance."


def cost_caption(case: Archive, name: str) -> str:
    """Caption of the figure of each run's misfit to the target."""
    material, unit = case.materials[name], case.levels.unit
    pixels, sampling = material.target.values_db.size, short(material.target.rms_sampling)
    _, numbered = _run_words(case, material)
    if case.bins:
        return (
            "Above: sum of the squared residuals of the incidence-angle bins, in standard deviations, at the effective "
            "looks that suit each run best, with the squares of the priors' residuals. "
            "Below: root mean square difference of the simulated and the target density, which the search does not "
            f"minimise; another sample of {pixels:,} pixels would move the target itself by about {sampling} 1/{unit} "
            f"(dotted).{numbered}"
        )
    caption = (
        "Root mean square difference between the simulated and the target density, run by run; the line is the best so "
        f"far. Below the dotted line ({sampling} 1/{unit}) a smaller cost is numerical convergence: another sample of "
        f"{pixels:,} pixels would move the target itself by about that much.{numbered}"
    )
    if (floors(case, material) > 0.0).any():
        caption += " Short bars: lower bound of the rms inside the bounds, by the surrogate and two standard errors."
    if not np.all(material.rms > 0):
        caption += " Runs on the lower edge have a cost of 0."
    return caption


def floors(case: Archive, material: MaterialResult) -> Array:
    """Smallest cost that the surrogate allows inside the bounds, by run, shape (n,); NaN where it is unknown."""
    found = np.full(material.rms.size, np.nan)
    if material.fidelity is not None:
        found[case.runs.kind == "infill"] = material.fidelity.floor
    return found


def law(case: Archive, name: str) -> Drawn | None:
    """Figure of the band of sigma0 and of the laws over the incidence angle; None for laws without a curve."""
    material, searched = case.materials[name], case.configured.laws[name]
    if not searched.has_curve:
        return None
    shares = (4.0, 1.0) if material.hidden is None else (4.0, 1.6, 1.0)
    canvas = new_canvas(6.2, 4.6 + 0.4 * sum(shares[1:]))
    panels = canvas.subplots(len(shares), 1, sharex=True, height_ratios=shares)
    each_seen, edges = angle_axis(case, name)
    seen, angles = [np.linspace(low, high, 101) for low, high in each_seen], np.linspace(edges[0], edges[-1], 361)
    for axes in panels:
        for low, high in each_seen:
            axes.axvspan(low, high, color="#EFEFEF", zorder=0, linewidth=0)
    laws = laws_of(case, name)
    _curves(panels[0], material, laws, seen, angles)
    head(panels[0], case, name, state(name, case.findings) or "law of the search")
    panels[0].set_ylabel(SIGMA0)
    if material.hidden is not None:
        _truth(panels[1], material, searched, laws, seen, angles)
    panels[-1].hist(material.target.incidence_deg.astype(np.float64), bins=edges.tolist(), color=MUTED)
    panels[-1].set(xlabel="local incidence [deg]", ylabel="pixels", xlim=(edges[0], edges[-1]))
    add_legend(canvas, panels[0].get_legend_handles_labels(), 2)
    return canvas, law_caption(case, name), f"Backscatter laws of {name} in dB against local incidence in degrees."


def angle_axis(case: Archive, name: str) -> tuple[Array, Array]:
    """Intervals of incidence seen in the passes, (p, 2), and edges of a histogram over the whole angle axis [deg]."""
    seen = case.materials[name].posterior.seen_deg
    # each margin of the angle axis is as wide as the incidence interval seen
    margin = max(_CONTEXT_DEG, float(np.ptp(seen)))
    low, high = max(0.0, np.floor(seen.min() - margin)), min(_LAST_DEG, np.ceil(seen.max() + margin))
    return seen, np.linspace(low, high, 86)


def law_caption(case: Archive, name: str) -> str:
    """Caption of the figure of the laws over the incidence angle."""
    material, curve = case.materials[name], case.configured.laws[name]
    several = len(case.passes) > 1
    shaded = " and ".join(f"{low:.1f} to {high:.1f}" for low, high in angle_axis(case, name)[0])
    histogram = "in each pass (histogram of pass 1 below)" if several else "(histogram below)"
    caption = (
        f"Backscatter against local incidence. Shaded, thick: {shaded} deg, where 90 % of the material's pixels lie "
        f"{histogram}; outside, every law is an extrapolation.{_of_band(case, name)}"
    )
    if material.hidden is not None:
        shown = [(words, x) for words, _, x, _ in laws_of(case, name) if words in (_SEARCH, _NEAREST)]
        angles = material.target.incidence_deg
        each = [(words, curve.largest_difference_db(x, material.hidden, angles)) for words, x in shown]
        found = [f"{words} by at most {largest:.2g} dB" for words, largest in each]
        where = "the incidence of pass 1" if several else "the incidence seen"
        caption += f" Over {where} the hidden truth differs from the {' and from the '.join(found)}."
    if material.posterior.points is not None:
        caption += (
            f" Dots, with bars of 95 %: mean level of the measured cells in each {STEP_DEG:g} deg of incidence, less "
            "the level of the image and what the simulator adds to its law (area of the ground, noise, other ground); "
            "the bars hold speckle and the effects of fields and cells."
        )
    return caption


def _of_band(case: Archive, name: str) -> str:
    """Part of the caption that describes the bands; empty without a band."""
    if case.materials[name].posterior.curve is None:
        return ""
    text = (
        " Violet: 90 % band of the mean power of the ground, pale for the material and darker for its fields in this "
        "image, and its median (dotted)."
    )
    if width := widths(name, case.findings):
        text += f" Half-widths where sigma0 is determined (bar): {width}."
    return text


def laws_of(case: Archive, name: str) -> Styled:
    """Label, law, X and style of the laws to draw: start, search, nearest to the median, and hidden truth."""
    material, configured, curve = case.materials[name], case.configured.materials[name], case.configured.laws[name]
    posterior, start = material.posterior, case.configured.at_start.laws[name]
    begun = f"start ({configured.at_start.law})" if configured.starts_with_another_law else "start"
    laws = [
        (begun, start, np.array(configured.start_parameters), START),
        (_SEARCH, curve, material.parameters[material.best], FOUND),
    ]
    if posterior.parameters_model is not None:
        laws.append((_NEAREST, curve, posterior.parameters_model, MODEL))
    if material.hidden is not None:
        laws.append(("hidden truth", curve, material.hidden, HIDDEN))
    return laws


def _curves(
    axes: Axes,
    material: MaterialResult,
    laws: Styled,
    seen: Sequence[Array],
    angles: Array,
) -> None:
    """Draw bands and laws, with thick lines at each pass's angles [deg], and the measured levels."""
    posterior = material.posterior
    if posterior.curve is not None:
        _bands(axes, posterior.curve, angles)
        if (known := posterior.known_between_deg) is not None:
            axes.plot(
                known, [0.015, 0.015], transform=axes.get_xaxis_transform(), color=BAND["color"], linewidth=5.0,
                solid_capstyle="butt", label="determined",
            )  # fmt: skip
    for label, curve, x, style in laws:
        axes.plot(angles, curve(np.radians(angles), x), **style | {"linewidth": 0.8})
        for k, there in enumerate(seen):
            named = label if k == 0 else None
            axes.plot(there, curve(np.radians(there), x), label=named, **style | {"linewidth": 2.6})
    if (points := posterior.points) is not None:
        axes.errorbar(
            points.incidence_deg, points.level_db, 1.96 * points.error_db, color="black", linestyle="none",
            marker="o", markersize=4.5, elinewidth=1.2, zorder=4, label="measured levels, 95 %",
        )  # fmt: skip
    axes.margins(x=0)
    axes.set_ylim(*(limits(laws, np.concatenate(seen), axes.get_ylim()[0]) or axes.get_ylim()))


def limits(laws: Styled, seen: Array, lowest: float) -> tuple[float, float] | None:
    """Limits of an axis of sigma0 [dB] that holds the laws at angles [deg]; None if all curves are above -60 dB."""
    if lowest >= _GRAZING_DB:  # a law that falls steeply at grazing incidence would flatten all other curves
        return None
    values = np.concatenate([curve(np.radians(seen), x) for _, curve, x, _ in laws])
    return float(values.min()) - 3.0, float(values.max()) + 3.0


def _bands(axes: Axes, curve: Curve, angles: Array, less: Array | float = 0.0) -> None:
    """Draw the 90 % bands of the material and of its fields, and the median, minus ``less`` [dB] at each angle."""
    for low, high, alpha, label in (
        (curve.p05_db, curve.p95_db, 0.15, "90 % band of the material"),
        (curve.field_p05_db, curve.field_p95_db, 0.3, "its fields in this image"),
    ):
        lower, upper = (np.interp(angles, curve.incidence_deg, edge) - less for edge in (low, high))
        axes.fill_between(angles, lower, upper, color=BAND["color"], alpha=alpha, linewidth=0, label=label)
    axes.plot(angles, np.interp(angles, curve.incidence_deg, curve.median_db) - less, label="median", **BAND)


def _truth(
    axes: Axes,
    material: MaterialResult,
    curve: Law,
    laws: Styled,
    seen: Sequence[Array],
    angles: Array,
) -> None:
    """Draw bands and laws minus the hidden law, thin at all ``angles`` of the axis [deg] and thick at those seen."""
    hidden = material.hidden
    assert hidden is not None  # noqa: S101
    largest = [0.05]
    for label, _, x, style in laws:
        if label not in (_SEARCH, _NEAREST):
            continue
        for there, width in ((angles, 0.8), *((one, 2.6) for one in seen)):
            gap = curve(np.radians(there), x) - curve(np.radians(there), hidden)
            axes.plot(there, gap, **style | {"linewidth": width})
            largest.append(float(np.abs(gap).max()) if width > 1.0 else 0.0)
    if (band := material.posterior.curve) is not None:
        _bands(axes, band, angles, curve(np.radians(angles), hidden))
        at = np.concatenate(seen)
        truth = curve(np.radians(at), hidden)
        largest += [
            float(np.abs(np.interp(at, band.incidence_deg, edge) - truth).max()) for edge in (band.p05_db, band.p95_db)
        ]
    axes.axhline(0.0, **HIDDEN)
    axes.set(ylim=(-1.2 * max(largest), 1.2 * max(largest)), ylabel="minus\ntruth [dB]")
