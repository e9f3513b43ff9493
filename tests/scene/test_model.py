"""File of a scene, also beside a finished calibration."""

from dataclasses import replace

import numpy as np
import pytest

from radcal.findings import Finding
from radcal.scene.model import Scene
from radcal.scene.object_generator import generate_objects
from radcal.storage.dataclass_groups import same

OBJECTS = replace(
    generate_objects((70.0, 50.0), 1, trees=1, buildings=1),
    rcs_dbsm=np.array([3.0, np.nan]), aspect=np.array([-1, 1], dtype=np.int16),
    curves={"z": np.array([[0.0, 1.0], [90.0, 2.5]]), "a": np.array([[10.0, -3.0], [200.0, 4.0], [300.0, 7.0]])},
)  # fmt: skip
FINDINGS = (
    Finding("no_elevation", "note", "scene", {"cells": 2, "of": 35}),
    Finding("vertical_datum", "note", "scene", {"datum": "Höhe"}),
)
LABELS, HEIGHTS = np.arange(35, dtype=np.uint8).reshape(5, 7) % 4, np.sqrt(np.arange(35.0).reshape(5, 7))
NAMES = ("Wald", "Gras", "Straße")
SCENES = {
    "terrain": Scene(
        "0123456789abcdef0123", NAMES, LABELS, HEIGHTS, 2.5, crs="EPSG:32631", vertical_datum="EGM2008",
        transform=(2.5, 0.0, 700000.5, 0.0, 2.5, 5800000.25), findings=FINDINGS, objects=OBJECTS, slope_error_deg=0.75,
    ),
    "slant": Scene("0123456789abcdef0124", NAMES, LABELS, None, 1.0, incidence_deg=np.linspace(20.0, 50.1, 5)),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_round_trip_is_exact(name, tmp_path):
    path, scene = tmp_path / "scene.h5", SCENES[name]
    scene.write(path)
    assert same(Scene.read(path), scene)
