"""Geometries whose pixels are one facet each."""

import numpy as np

from radcal.radar.geometry import Geometry
from radcal.scene.objects import Objects

ROWS, COLUMNS = 60, 80
# spacings and resolutions of a pass whose pixels are 1 m
METRE = {"range_spacing_m": 1.0, "azimuth_spacing_m": 1.0, "range_resolution_m": 2.0, "azimuth_resolution_m": 2.0}
X = [-28.0, 20.0, 6.0, 4.0]


def of_pixels(names, material, incidence_deg, **changes):
    """Geometry of materials and incidence angles by pixel, all of them seen and none in layover."""
    shape, n, nothing = material.shape, material.size, np.zeros(material.shape, dtype=bool)
    incidence = np.broadcast_to(incidence_deg, shape)
    keys = {
        "facet_weight": np.ones(n, dtype=np.float32), "layover": nothing, "shadow": nothing,
        "flat_incidence_deg": incidence[:, 0].astype(np.float64), **changes,
    }  # fmt: skip
    return Geometry(
        shape=shape, names=names, cell_start=np.arange(n + 1, dtype=np.int32),
        cell_material=material.ravel(), facet_start=np.arange(n + 1, dtype=np.int32),
        facet_incidence=(incidence.ravel() / 90.0 * 65535.0).astype(np.uint16), material=material,
        incidence_deg=incidence.astype(np.float32), ground=np.full((2, *shape), np.nan, dtype=np.float32), **keys,
    )  # fmt: skip


def objects_of(walls=None, **columns):
    """Objects of some columns of a table; the others are 0, and no object has a class."""
    n = np.broadcast(*columns.values()).size
    names = ("x_m", "y_m", "length_m", "width_m", "heading_deg", "height_m", "rcs_dbsm")
    values = {name: np.array(np.broadcast_to(columns.get(name, 0.0), n), dtype=float) for name in names}
    return Objects(**values, aspect=np.full(n, -1, np.int16), walls=walls)


def two_materials():
    """Fifty columns of one material, thirty of another one; the incidence angle rises from row to row."""
    material = np.where(np.arange(COLUMNS) < 50, 1, 2).astype(np.uint8) * np.ones((ROWS, 1), dtype=np.uint8)
    return of_pixels(("area", "rest"), material, np.linspace(25.0, 50.0, ROWS)[:, None])
