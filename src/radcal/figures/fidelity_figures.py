"""Figure of the surrogate's predictions against the runs that verified them."""

from __future__ import annotations

import numpy as np

from radcal.figures.drawing import FOUND, MUTED, PALE, START, Array, Drawn, add_legend, head, new_canvas
from radcal.results.archive import Archive, Fidelity

_STATISTICS = (("mean", "#0072B2", "o"), ("log sd", "#D55E00", "s"), ("skewness", "#009E73", "^"))
_MOST = 6.0  # largest difference drawn [standard deviations]; larger differences are drawn at this value
_NARROW = 0.13


def differences(found: Fidelity) -> Array:
    """Verified minus predicted statistics of m runs and b bins, in kriging standard deviations, shape (m, b, 3).

    The difference is NaN for a statistic that was not predicted.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        values = (found.verified - found.predicted) / found.error
    return np.where(np.isfinite(values), values, np.nan)


def fidelity(case: Archive, name: str) -> Drawn | None:
    """Figure of predicted and verified cost of each infill run, and of verified minus predicted statistics.

    A surrogate of the parameters of the density (``surrogate.outputs: direct``) predicts no statistics.
    """
    material = case.materials[name]
    found = material.fidelity
    if found is None or not np.isfinite(found.cost).any():
        return None
    every, predicted_runs = np.flatnonzero(case.runs.kind == "infill"), np.isfinite(found.cost)
    runs, values = every[predicted_runs], differences(found)[predicted_runs]
    known = np.isfinite(values)
    canvas = new_canvas(6.2, 6.2 if known.any() else 3.9)
    axes = canvas.subplots(2 if known.any() else 1, 1, sharex=True, squeeze=False)[:, 0]
    upper, lower = axes[0], axes[-1]
    # same unit as in the figure of the misfits of all runs; the cost of bins is half the sum of squared residuals
    what = "squared residuals, priors included" if case.bins else f"densities, rms [1/{case.levels.unit}]"
    predicted, verified = (
        (2.0 if case.bins else 1.0) * cost[predicted_runs] for cost in (found.cost, material.cost[every])
    )
    positive = np.concatenate([predicted, verified])
    positive = positive[np.isfinite(positive) & (positive > 0)]
    bottom = float(positive.min()) if positive.size else 1e-6
    for costs, label, style in (
        (predicted, "predicted", {"color": START["color"], "marker": "D", "markerfacecolor": "none"}),
        (verified, "verified", {"color": FOUND["color"], "marker": "^"}),
    ):
        upper.plot(runs, np.maximum(costs, bottom), linestyle="none", markersize=7, label=label, **style)
    upper.set_yscale("log")
    if positive.size:  # at least a decade, so that equal costs are seen to be equal
        middle, half_length = np.log10(positive).mean(), max(0.5, 0.6 * float(np.ptp(np.log10(positive))))
        upper.set_ylim(10.0 ** (middle - half_length), 10.0 ** (middle + half_length))
    upper.set_ylabel(what.replace(", ", ",\n", 1))
    head(upper, case, name, "surrogate's predictions and verifying runs")
    caption = f"For each infill run, {what}, as predicted by the surrogate and as verified by the run."
    if known.any():
        lower.axhspan(-2.0, 2.0, color=PALE, alpha=0.6, linewidth=0, label="two standard deviations")
        lower.axhline(0.0, color=MUTED, linewidth=0.8)
        for k, (label, color, marker) in enumerate(_STATISTICS):
            at = np.repeat(runs + (k - 1) * _NARROW, values.shape[1])
            lower.plot(
                at, np.clip(values[..., k].ravel(), -_MOST, _MOST), color=color, marker=marker, linestyle="none",
                markersize=4, alpha=0.8, label=label,
            )  # fmt: skip
        lower.set(ylim=(-_MOST - 0.5, _MOST + 0.5), ylabel="verified - predicted\n[standard deviations]")
        inside = f"{int((np.abs(values[known]) <= 2.0).sum())} of {int(known.sum())}"
        caption = (
            f"Above: for{caption.removeprefix('For')} Below: each point is a statistic of a run"
            f"{', in one incidence-angle bin,' if values.shape[1] > 1 else ''} minus its prediction, in kriging "
            f"standard deviations; {inside} points lie within two. The kriging standard deviation is that of the "
            "surrogate's error and guides the search; it is not the uncertainty of the law."
        )
    lower.set_xlabel("run (0: reference)")
    lower.locator_params(axis="x", integer=True)
    lower.set_xlim(runs.min() - 0.6, runs.max() + 0.6)
    legends = [one.get_legend_handles_labels() for one in axes]
    handles, labels = ([entry for legend in legends for entry in legend[k]] for k in (0, 1))
    add_legend(canvas, (handles, labels), 3)
    left_out = [str(run) for run in every[~predicted_runs]]
    q2 = found.q2[np.isfinite(found.q2).all(axis=1)]
    if left_out:
        caption += f" Without prediction, and not drawn: run{'s' * (len(left_out) > 1)} {', '.join(left_out)}."
    if len(q2):
        direct = case.configured.surrogate.outputs == "direct"
        outputs = ("xi", "omega", "alpha") if direct else tuple(label for label, *_ in _STATISTICS)
        each = ", ".join(f"{label} {value:.2f}" for label, value in zip(outputs, q2[-1], strict=True))
        caption += f" Share of variance that the last surrogate predicts (leave-one-out Q2): {each}."
    return canvas, caption, f"Infill runs of {name}: cost and statistics, predicted by the surrogate and simulated."
