"""Pictures of a turn: B-scope (range over azimuth), and plan-position indicator on the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.figures.drawing import TOLERANCE, new_canvas, styled
from radcal.ppi.scan import Sweep
from radcal.scene.model import Scene
from radcal.storage.files import atomic

_SCALE_DB = 50.0  # longest colour scale, from the brightest cells down


def write_pictures(
    path: str | Path, sweep: Sweep, reported: NDArray[np.bool_], scene: Scene, site_m: tuple[float, float]
) -> None:
    """Write B-scope and map of a turn as PNG; detections are dots.

    Parameters
    ----------
    path : path
        Path of the file.
    sweep : Sweep
        Picture of the turn.
    reported : ndarray of bool, shape (rays, gates)
        Detections.
    scene : Scene
        Scene, whose edge is drawn on the map.
    site_m : (float, float)
        Place of the mast, to the east and to the north of the corner of the scene's grid [m].
    """
    db = 10.0 * np.log10(sweep.snr)
    high = float(np.quantile(db, 0.999))
    low = max(-3.0, high - _SCALE_DB)
    scale = {"vmin": low, "vmax": high, "cmap": "viridis", "rasterized": True}
    gate, ray = sweep.range_m[1] - sweep.range_m[0], 360.0 / sweep.azimuth_deg.size
    ranges_km = np.append(sweep.range_m - gate / 2.0, sweep.range_m[-1] + gate / 2.0) / 1e3
    bearings = np.append(sweep.azimuth_deg - ray / 2.0, sweep.azimuth_deg[-1] + ray / 2.0)
    ny, nx = scene.material.shape
    edge = np.array([[0.0, 0.0], [nx, 0.0], [nx, ny], [0.0, ny], [0.0, 0.0]]) * scene.cell_m / 1e3
    rays, gates = np.nonzero(reported)
    dots = {"marker": ".", "s": 3.0, "linewidths": 0.0, "color": TOLERANCE["color"]}
    with styled():
        canvas = new_canvas(11.5, 5.2)
        scope, plan = canvas.subplots(1, 2, gridspec_kw={"width_ratios": [1.0, 1.15]})
        scope.pcolormesh(bearings, ranges_km, db.T, **scale)
        scope.scatter(sweep.azimuth_deg[rays], sweep.range_m[gates] / 1e3, **dots)
        scope.set(xlabel="azimuth [deg]", ylabel="slant range [km]", title="B-scope", xlim=(0, 360))
        east, north = (np.outer(ranges_km, turn(np.radians(bearings))) for turn in (np.sin, np.cos))
        x0, y0 = (each / 1e3 for each in site_m)
        drawn = plan.pcolormesh(x0 + east, y0 + north, db.T, **scale)
        turned = np.radians(sweep.azimuth_deg[rays])
        at = sweep.range_m[gates] / 1e3
        plan.scatter(x0 + at * np.sin(turned), y0 + at * np.cos(turned), label="detection", **dots)
        plan.plot(*edge.T, color="white", linewidth=0.9, label="scene")
        plan.plot([x0], [y0], "+", color="white", label="mast")
        plan.set(xlabel="east [km]", ylabel="north [km]", title="PPI", aspect="equal")
        plan.legend(loc="lower left", labelcolor="black", frameon=True, facecolor="#B0B0B0", markerscale=3.0)
        for panel in (scope, plan):
            panel.grid(visible=False)
        canvas.colorbar(drawn, ax=plan, extend="both", fraction=0.046, pad=0.02).set_label("signal-to-noise ratio [dB]")
        with atomic(path) as partial:
            canvas.savefig(partial, format="png", dpi=150, metadata={"Software": None}, facecolor="white")
