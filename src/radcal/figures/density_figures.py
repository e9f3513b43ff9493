"""Figures of backscatter densities: of the target, of design runs, and of the runs before and after calibration."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from radcal import skewnormal
from radcal.figures import drawing
from radcal.figures.drawing import Array, Drawn, add_legend, colour_of, head, mark, new_canvas, short, shortened
from radcal.results.archive import Archive, MaterialResult
from radcal.words import ENDINGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SEED = 4  # seed of the choice of ten design runs
_TEXTURED = (
    " Each simulated density includes the texture that makes its run fit best, so that it can be wider than the "
    "density of the simulated pixels, whose looks are those of the sensor."
)


def _reach(dp: Array) -> tuple[float, float]:
    mean, sd, _ = skewnormal.centred(dp)
    return float(mean), float(sd)


def _draw(axes: Axes, material: MaterialResult, curves: Sequence[tuple[Array, str | None, Mapping[str, Any]]]) -> None:
    """Draw the histogram of the measured pixels, and densities of given label and style.

    The limits of the axes lie near the target density, so that densities may leave the axes.
    """
    mean, sd = _reach(material.target.dp)
    low, high = mean - 14.0 * sd, mean + 14.0 * sd
    values = material.target.values_db[np.isfinite(material.target.values_db)].astype(np.float64)
    inside = values[(values > low) & (values < high)]
    peak, ends = float(_density(material.target.dp)[1].max()), [mean - 4.0 * sd, mean + 4.0 * sd]
    if inside.size:
        bins = int(np.clip(np.sqrt(inside.size), 8, 36))
        heights, edges = np.histogram(inside, bins=bins, density=True)
        axes.stairs(heights, edges, fill=True, color=drawing.PALE, label="measured pixels")
        peak = max(peak, float(heights.max()))
        ends += [inside.min(), inside.max()]
    cap, tops = 2.2 * peak, [peak]
    for dp, label, style in curves:
        middle, width = _reach(dp)
        grid, density = _density(dp)
        top, there = float(density.max()), low - width <= middle <= high + width
        shown = (density > 2e-4 * top) & there
        axes.plot(grid[shown], density[shown], label=label, **style)
        if there:
            ends += [middle - 3.0 * width, middle + 3.0 * width]
            tops.append(min(top, cap))
    axes.set(xlim=(max(low, min(ends)), min(high, max(ends))), ylim=(0.0, 1.06 * max(tops)))


def _density(dp: Array) -> tuple[Array, Array]:
    """Values and density over six standard deviations on both sides of the mean."""
    mean, sd = _reach(dp)
    grid = np.linspace(mean - 6.0 * sd, mean + 6.0 * sd, 601)
    return grid, skewnormal.density(grid, dp)


def histogram(case: Archive, name: str) -> Drawn | None:
    """Histogram of the measured pixels, target density, and densities of some design runs; None without a design."""
    material, design = case.materials[name], np.flatnonzero(case.runs.kind == "design")
    if not design.size:
        return None
    canvas = new_canvas(6.2, 4.2)
    axes = canvas.subplots()
    chosen = np.sort(np.random.default_rng(_SEED).choice(design, size=min(10, design.size), replace=False))
    thin = {"color": drawing.DESIGN, "linewidth": 1.1, "alpha": 0.9}
    labels = [f"{chosen.size} runs of the design", *[None] * 9]
    curves = [(material.dp[run], label, thin) for run, label in zip(chosen, labels, strict=False)]
    target = (material.target.dp, "target: fitted skew normal", drawing.TARGET | {"linewidth": 3.2})
    _draw(axes, material, [*curves, target])
    head(axes, case, name)
    axes.set(xlabel=f"backscatter [{case.levels.unit}]", ylabel=f"density [1/{case.levels.unit}]")
    add_legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        f"Grey: the {material.target.values_db.size:,} measured pixels of {name}. Black: the skew normal fitted to "
        f"them, which is the target. Thin: simulated densities of {chosen.size} of the {design.size} runs of the "
        f"design, chosen at random (seed {_SEED}).{_TEXTURED * case.bins}"
    )
    alt = f"Histogram of {name}'s measured backscatter, its fitted density and those of some runs."
    return canvas, caption, alt


def densities(case: Archive, name: str) -> Drawn:
    """Figure of three densities: of the target, of the run at the start, and of the calibrated run."""
    material = case.materials[name]
    canvas = new_canvas(6.2, 4.2)
    axes = canvas.subplots()
    _before_after(axes, material)
    head(axes, case, name, f"rms {short(material.rms[material.best])} 1/{case.levels.unit}")
    axes.set(xlabel=f"backscatter [{case.levels.unit}]", ylabel=f"density [1/{case.levels.unit}]")
    add_legend(canvas, axes.get_legend_handles_labels(), 4)
    caption = (
        "Density of the backscatter: simulated with the starting parameters (orange, dashed), simulated with the law "
        "of the search (blue), and measured (grey: histogram of the pixels; black: skew normal fitted to them, the "
        "target). Where blue lies on black, simulated and measured density agree." + _TEXTURED * case.bins
    )
    alt = f"Densities of {name}'s backscatter: target, start and calibrated."
    return canvas, caption, alt


def _before_after(axes: Axes, material: MaterialResult) -> None:
    """Draw the densities of target, start and calibrated run."""
    target = (material.target.dp, "target", drawing.TARGET | {"linewidth": 4.5})
    found = (material.dp[material.best], "calibrated", drawing.FOUND)
    _draw(axes, material, [target, (material.dp[0], "start", drawing.START), found])


def overview(case: Archive) -> Drawn:
    """Figure of the densities of all materials, with one small panel for each material."""
    n = len(case.materials)
    columns = 2 if n <= 4 else 3 if n <= 9 else 4
    rows = -(-n // columns)
    canvas = new_canvas(9.5, 2.2 * rows + 1.0)
    grid = canvas.subplots(rows, columns, squeeze=False).ravel()
    for axes, (name, material) in zip(grid, case.materials.items(), strict=False):
        _before_after(axes, material)
        reason = case.decision.materials[name].reason or "running"
        width = 88 // columns
        lines = textwrap.wrap(shortened(name, 2 * width - 4), width)
        lines += textwrap.wrap(f"rms {short(material.rms[material.best])}: {ENDINGS[reason]}", 100 // columns)
        axes.set_title("\n".join(line.replace("$", r"\$") for line in lines), fontsize=10.0)
        mark(axes, colour_of(case, name))
        axes.tick_params(labelsize=9.5)
    for axes in grid[n:]:
        axes.set_axis_off()
    for axes in grid[:n]:  # each panel has limits of its own
        axes.set_xlabel(f"backscatter [{case.levels.unit}]")
    for axes in grid[:n:columns]:
        axes.set_ylabel(f"density [1/{case.levels.unit}]")
    add_legend(canvas, grid[0].get_legend_handles_labels(), 4)
    caption = (
        "Density of the backscatter of each material: simulated with the starting parameters (orange, dashed), "
        "simulated with the laws of the search (blue), and measured (grey: histogram of the pixels; black: skew normal "
        "fitted to them, the target). Titles give the rms difference between blue and black in "
        f"1/{case.levels.unit}, and how the search ended." + (_TEXTURED if case.bins else "")
    )
    return canvas, caption, f"Small densities of {n} materials: target, start and calibrated."


def quality(case: Archive, name: str) -> Drawn:
    """Quantile-quantile figure of the measured pixels and the skew-normal density fitted to them."""
    material = case.materials[name]
    canvas = new_canvas(6.2, 4.4)
    axes = canvas.subplots()
    values = np.sort(material.target.values_db.astype(np.float64))
    n = values.size
    dp = material.target.dp
    mean, sd = _reach(dp)
    grid = np.linspace(mean - 10.0 * sd, mean + 10.0 * sd, 8001)
    below = skewnormal.cdf(grid, dp)
    rising = np.concatenate([[True], np.diff(below) > 0.0])

    def quantile(share: Array) -> Array:
        return np.asarray(np.interp(share, below[rising], grid[rising]))

    expected = quantile((np.arange(n) + 0.5) / n)
    # order statistics of as many independent values as the effective sample size (David and Nagaraja, "Order
    # Statistics", section 2.1)
    m = max(8, round(material.target.effective))
    rank = np.arange(1, m + 1)
    shares = np.stack([scipy.special.betaincinv(rank, m + 1 - rank, tail) for tail in (0.025, 0.975)])
    axes.fill_between(
        quantile((rank - 0.5) / m),
        *quantile(shares),
        color=drawing.DESIGN,
        alpha=0.35,
        linewidth=0,
        label="95 % of samples",
    )
    ends = np.array([expected[0], expected[-1]])
    axes.plot(ends, ends, label="fitted skew normal", **drawing.TARGET | {"linewidth": 1.6})
    axes.plot(
        expected,
        values,
        color=drawing.FOUND["color"],
        marker=".",
        markersize=4,
        linestyle="none",
        label="measured pixels",
    )
    head(axes, case, name, f"distance {short(material.target.goodness.ks)}, p = {short(material.target.goodness.ad_p)}")
    unit = case.levels.unit
    axes.set(xlabel=f"quantile of the skew normal [{unit}]", ylabel=f"measured quantile [{unit}]")
    add_legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        f"Quantiles of the {n:,} measured pixels against those of the skew normal fitted to them; where the points lie "
        f"on the line, the skew normal describes the pixels. Shaded: interval of each quantile in 95 % of random "
        f"samples of the skew normal, each of {m:,} independent values (the effective sample size of the pixels). In "
        "the title: the Kolmogorov-Smirnov distance of the pixels from the skew normal, and the share p of random "
        "samples that lie further from their own fit (Anderson-Darling)."
    )
    return canvas, caption, f"Quantiles of {name}'s measured backscatter against those of the fitted density."
