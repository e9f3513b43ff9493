"""Geometry of two materials side by side, whose incidence angle rises from row to row."""

from __future__ import annotations

import numpy as np

from radcal.radar.geometry import Geometry

ROWS, COLUMNS = 60, 80
X = [-28.0, 20.0, 6.0, 4.0]


def geometry() -> Geometry:
    """Fifty columns of one material, thirty of another one, each pixel a facet."""
    material = np.where(np.arange(COLUMNS) < 50, 1, 2).astype(np.uint8) * np.ones((ROWS, 1), dtype=np.uint8)
    n, nothing = material.size, np.zeros(material.shape, dtype=bool)
    flat = np.linspace(25.0, 50.0, ROWS)
    return Geometry(
        shape=material.shape, names=("area", "rest"), cell_start=np.arange(n + 1, dtype=np.int32),
        cell_material=material.ravel(), facet_start=np.arange(n + 1, dtype=np.int32),
        facet_incidence=np.zeros(n, dtype=np.uint16), facet_weight=np.ones(n, dtype=np.float32), material=material,
        incidence_deg=np.repeat(flat[:, None], COLUMNS, axis=1).astype(np.float32), layover=nothing, shadow=nothing,
        flat_incidence_deg=flat, ground=np.full((2, *material.shape), np.nan, dtype=np.float32),
    )  # fmt: skip
