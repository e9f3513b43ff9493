"""Forward runs of a small scene, without a run store."""

from dataclasses import replace

import numpy as np
import pytest

from radcal.config import case_from
from radcal.radar.projection import make_geometry
from radcal.scene.objects import Objects
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.forward import Forward

MATERIALS = {
    "dyke": {"calibrate": True, "law": "constant_gamma", "bounds": [[-30, 0]], "start": [-8.0]},
    "grass": {"law": "constant_gamma", "parameters": [-14.0]},
}
HIDDEN = {"synthetic": {"parameters": {"dyke": [-8.0]}}}


def point(x_m, y_m, rcs_dbsm, height_m=0.0):
    """One object without a footprint."""
    zero, first = np.zeros(1), np.zeros(1, np.int16)
    values = (np.array([float(value)]) for value in (x_m, y_m))
    return Objects(*values, zero, zero, zero, zero + height_m, zero + rcs_dbsm, first - 1)


@pytest.fixture
def forward_of(scene):
    """Forward run of the rough scene of ``tests/conftest.py``, or of another scene, with other sections."""

    def made(other=None, seed=5, **sections):
        radar = {"altitude_m": 3000.0, **sections.pop("radar", {})}
        case = case_from({"radar": radar, "materials": MATERIALS, "measurement": HIDDEN, **sections})
        found = other or scene
        geometry = make_geometry(found, case.radar)
        image = BuiltinSimulator(geometry, case.radar, case.laws).run(case.start_parameters, seed)
        return Forward(case, found, geometry, image, "0" * 20, seed, False, lambda: iter(()))

    return made


@pytest.fixture
def with_point(scene):
    return lambda *values: replace(scene, objects=point(*values))
