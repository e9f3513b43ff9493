"""Figure of held-out ground: measured and predicted means of its cells."""

from __future__ import annotations

from typing import Any

from radcal.figures.drawing import BAND, MUTED, START, TARGET, Drawn, add_legend, head, new_canvas
from radcal.results.archive import Archive


def held_out(case: Archive, name: str) -> Drawn | None:
    """Figure of held-out cells against the incidence, measured and predicted; None if none were held out."""
    held = case.materials[name].posterior.held
    if held is None:
        return None
    predicted = held.predicted
    canvas = new_canvas(6.2, 4.8)
    axes = canvas.subplots()
    band: dict[str, Any] = {"color": "#E3D3EE", "linewidth": 2.5, "label": "predicted, 90 % band"}
    axes.vlines(held.incidence_deg, predicted.p05_db, predicted.p95_db, **band)
    each = (
        ("law alone", held.law.mean_db, MUTED, "x"),
        ("constant alone", held.constant.mean_db, START["color"], "_"),
        ("predicted", predicted.mean_db, BAND["color"], "D"),
        ("measured", held.measured_db, TARGET["color"], "."),
    )
    for label, level_db, colour, marker in each:
        axes.plot(held.incidence_deg, level_db, marker, color=colour, markersize=4.0, label=label)
    rmse, by_law, by_constant = (f"{held.rmse_db(by):.2f} dB" for by in (predicted, held.law, held.constant))
    head(axes, case, name, f"held-out cells, rms error {rmse}")
    axes.set(xlabel="local incidence [deg]", ylabel="mean of the cell [dB]")
    add_legend(canvas, axes.get_legend_handles_labels(), 3)
    caption = (
        f"Mean power of {held.patch.size} held-out cells (parts of fields), without what the simulator adds to a law "
        "(area of the ground in a pixel, noise, neighbouring ground). “Predicted” is the average of two predictions "
        "from the other cells: by the law, and by one constant sigma0. Both include the offset of a field that has "
        f"other cells. The rms error is {rmse} ({by_law} and {by_constant} by law and constant alone), and "
        f"{100.0 * held.coverage_90(predicted):.0f} % of the held-out cells lie inside of the predicted band."
    )
    return canvas, caption, f"Means of held-out cells of {name} against local incidence, measured and predicted, in dB."
