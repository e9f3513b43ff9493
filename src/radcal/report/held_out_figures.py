"""Figure of held-out ground: measured and predicted block means."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radcal.assessment.budget import NORMAL_90
from radcal.report.archive import Archive
from radcal.report.colours import head
from radcal.report.drawing import FOUND, MUTED, START, TARGET, add_legend, new_canvas
from radcal.report.held_out_blocks import refitted

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

__all__ = ["held_out"]


def held_out(case: Archive, name: str) -> tuple[Canvas, str, str] | None:
    """Figure of the held-out blocks' means against their predictions; None if no ground was held out."""
    from matplotlib.ticker import MaxNLocator

    check = case.materials[name].check
    held = check.held
    if held is None:
        return None
    order = np.argsort(held.predicted_db, kind="stable")
    mean, predicted, law, sd = (values[order] for values in (held.mean_db, held.predicted_db, held.law_db, held.sd_db))
    place, edges = np.arange(mean.size) + 1, np.arange(mean.size + 1) + 0.5
    canvas = new_canvas(6.2, 4.6)
    axes = canvas.subplots()
    low, high = predicted - NORMAL_90 * sd, predicted + NORMAL_90 * sd
    axes.stairs(high, edges, baseline=low, fill=True, color="#CFE3F1", label="90 % band")
    axes.axhline(check.constant_db, color=START["color"], linestyle=START["linestyle"], linewidth=2.0,
                 label="constant")  # fmt: skip
    axes.stairs(law, edges, baseline=None, color=MUTED, linewidth=1.4, linestyle=":", label="law alone")
    axes.stairs(predicted, edges, baseline=None, color=FOUND["color"], linewidth=2.0, label="law and fields")
    axes.plot(place, mean, color=TARGET["color"], linestyle="none", marker="o", markersize=4.5, label="measured")
    axes.use_sticky_edges = False
    axes.margins(x=0.01, y=0.06)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    # law and constant are compared with equal knowledge: both have the effects of fields
    errors = f"{held.rmse_law_patch_db:.2f} dB off, a constant {held.rmse_constant_patch_db:.2f} dB"
    head(axes, case, name, f"held-out ground {errors}")
    axes.set_xlabel("block, in the order of its prediction")
    axes.set_ylabel("mean level [dB]")
    add_legend(canvas, axes.get_legend_handles_labels(), 5)
    if refitted(case.config):
        how = (
            "(dots), as laws fitted anew without them predict them (the law found has seen them) with random effects "
            "of those fields that hold other ground, too (blue), and alone (dotted). Orange, dashed: the generalised "
            "least squares mean of all calibrated ground; its errors below are of means fitted anew. "
        )
    else:
        how = (
            "that no law has seen (dots), as the law found predicts them with random effects of those fields that hold "
            "calibrated ground, too (blue), alone (dotted), and as a constant does (orange, dashed: the generalised "
            "least squares mean of the calibrated ground). "
        )
    caption = (
        f"Mean levels of {mean.size} blocks {how}"
        f"{100.0 * held.coverage_90:.0f} % lie inside of the 90 % band. Root mean square errors: constant "
        f"{held.rmse_constant_db:.2f} dB, constant and fields {held.rmse_constant_patch_db:.2f} dB, law "
        f"{held.rmse_law_db:.2f} dB, law and fields {held.rmse_law_patch_db:.2f} dB; the same law fitted to these "
        f"means themselves leaves {held.rmse_best_db:.2f} dB."
    )
    return canvas, caption, f"Mean levels of held-out blocks of {name}, measured and predicted, in dB."
