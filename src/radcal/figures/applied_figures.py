"""Predicted and measured level of a material in one incidence-angle bin of another image, and a figure of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radcal.figures.drawing import DESIGN, FOUND, law_panels

KNOWN, SEEN, OUTSIDE = "known", "not known", "not seen"

# markers at the predicted median, of different shapes, and bars of its 90 % interval
_BARS: dict[str, Any] = {"color": FOUND["color"], "linestyle": "none", "elinewidth": 1.8, "capsize": 4.0}
_STYLES: dict[str, dict[str, Any]] = {
    KNOWN: {**_BARS, "marker": "s", "markersize": 9.0, "markerfacecolor": DESIGN},
    SEEN: {**_BARS, "marker": "D", "markersize": 9.0, "markerfacecolor": "white"},
    OUTSIDE: {**_BARS, "marker": "v", "markersize": 10.0, "markerfacecolor": "white"},
}


@dataclass(frozen=True)
class Prediction:
    """Level of one material in one incidence-angle bin of a pass, predicted and measured.

    Attributes
    ----------
    material : str
        Calibrated material.
    edges_deg : (float, float)
        Edges of the bin [deg].
    incidence_deg : float
        Mean local incidence of the bin's pixels [deg].
    pixels : int
        Number of usable pixels of the bin.
    known : str
        ``known`` if sigma0 is determined at the bin's mean incidence; ``not known`` if the calibration has seen this
        incidence, but sigma0 is not determined there; or ``not seen`` by the calibration.
    predicted_db, p05_db, p95_db : float
        Mean and 90 % interval of the predicted level [dB]: mean power of cells, averaged in dB.
    measured_db : float
        The same of the measured pixels [dB]; NaN without measured pixels.
    """

    material: str
    edges_deg: tuple[float, float]
    incidence_deg: float
    pixels: int
    known: str
    predicted_db: float
    p05_db: float
    p95_db: float
    measured_db: float = float("nan")

    @property
    def inside(self) -> bool | None:
        """Whether the measured mean lies inside the predicted 90 % interval; None without measured pixels."""
        return None if np.isnan(self.measured_db) else self.p05_db <= self.measured_db <= self.p95_db


def draw_predictions(path: str | Path, rows: Sequence[Prediction], source: str, other: str) -> None:
    """Draw one panel for each material: predicted band and measured means over the incidence, as a PNG file.

    Parameters
    ----------
    path : path
        The file, written atomically.
    rows : sequence of Prediction
        Bins of all materials and passes.
    source, other : str
        Name of the case that predicts, and of the case that gives the image.
    """
    names = list(dict.fromkeys(row.material for row in rows))
    # the legend is that of the first panel, so every panel names what any panel shows, and nothing else
    styles = {known: style for known, style in _STYLES.items() if any(row.known == known for row in rows)}
    with law_panels(path, names, "mean of the cells [dB]") as panels:
        for axes, name in panels:
            own = [row for row in rows if row.material == name]
            for known, style in styles.items():
                some = [row for row in own if row.known == known]
                middle = np.array([row.predicted_db for row in some])
                error = np.abs(np.array([[row.p05_db, row.p95_db] for row in some]).reshape(-1, 2).T - middle)
                label = f"predicted ({source}), 90 %: sigma0 {known}"
                x = [row.incidence_deg for row in some]
                axes.errorbar(x, middle, error, label=label, **style)
            compared = [row for row in own if row.inside is not None]
            x, y = [row.incidence_deg for row in compared], [row.measured_db for row in compared]
            axes.plot(x, y, "k.", markersize=6, zorder=4, label=f"measured, {other}")
