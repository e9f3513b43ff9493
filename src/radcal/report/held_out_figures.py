"""Figure of held-out ground: measured and predicted means of its cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from radcal.report.archive import Archive
from radcal.report.colours import head
from radcal.report.drawing import BAND, MUTED, START, TARGET, add_legend, new_canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

__all__ = ["held_out"]

_BAND = "#E3D3EE"


def held_out(case: Archive, name: str) -> tuple[Canvas, str, str] | None:
    """Figure of held-out cells against the incidence, measured and predicted; None if none were held out."""
    posterior = case.materials[name].posterior
    if posterior is None or posterior.held is None:
        return None
    held, predicted = posterior.held, posterior.held.predicted
    canvas = new_canvas(6.2, 4.8)
    axes = canvas.subplots()
    axes.vlines(
        held.incidence_deg, predicted.p05_db, predicted.p95_db, color=_BAND, linewidth=2.5, label="predicted, 90 % band"
    )
    each = (
        ("law alone", held.law.mean_db, MUTED, "x"),
        ("constant alone", held.constant.mean_db, START["color"], "_"),
        ("predicted", predicted.mean_db, BAND["color"], "D"),
        ("measured", held.measured_db, TARGET["color"], "."),
    )
    for label, level_db, colour, marker in each:
        axes.plot(
            held.incidence_deg, level_db, color=colour, marker=marker, markersize=4.0, linestyle="none", label=label
        )
    errors = " and ".join(f"{held.rmse_db(by):.2f} dB" for by in (held.law, held.constant))
    head(axes, case, name, f"held-out cells, rms error {held.rmse_db(predicted):.2f} dB")
    axes.set_xlabel("local incidence [deg]")
    axes.set_ylabel("mean of the cell [dB]")
    add_legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        f"Mean power of {held.patch.size} cells of {held.fields} fields, less what the simulator adds to its law, as "
        "predicted from the other cells: the average (predicted) of the law's model and of one constant level, each "
        "with the effects of those fields that have other cells. The rms error is "
        f"{held.rmse_db(predicted):.2f} dB (by law and constant alone {errors}), and "
        f"{100.0 * held.coverage_90(predicted):.0f} % of the cells lie inside of the band."
    )
    return canvas, caption, f"Means of held-out cells of {name} against local incidence, measured and predicted, in dB."
