"""Targets, materials and scores made from arrays, for tests of the calibration."""

import numpy as np

from radcal.ground.goodness import Goodness
from radcal.ground.levels import Levels
from radcal.laws import law_for
from radcal.objectives.base import CalibratedMaterial
from radcal.objectives.history import PassScore, Run, Score
from radcal.registration.registered import Registered
from radcal.skewnormal import fit
from radcal.targets import target_fit
from radcal.targets.target import Target

# hidden laws of the field and the lake in field_fixtures.py, and their bounds
TRUTH = {"field": [-30.0, 22.0, 6.0, 4.0], "lake": [-35.0, 12.0, 25.0, 6.0]}
BOUNDS = [[-60, 0], [0, 50], [0, 50], [0, 20]]


def make_target(values_db, incidence_deg, **changes):
    """Target of all pixels of a material, each of them independent."""
    values = np.asarray(values_db, dtype=np.float64)
    keys = {
        "pixels": np.arange(values.size),
        "order": np.arange(values.size),
        "values_db": values,
        "incidence_deg": np.asarray(incidence_deg, dtype=np.float32),
        "eligible": values.size,
        "at_boundary": False,
        "effective": float(values.size),
        "rms_sampling": 1e-3,
        "cp_error": np.zeros(3),
        "goodness": Goodness(0.0, 1.0),
        "patch": np.ones(values.size, dtype=np.int64),
        "block": np.arange(values.size) % 10,
        **changes,
    }
    return Target(**{"dp": fit(values).dp if "dp" not in changes else changes["dp"], **keys})


def drawn_target(case, name, geometry, measurement, flags=None):
    """Target of a material from an image that is not registered."""
    still = np.zeros(geometry.shape, np.float32)
    field = np.stack([still, still])
    registered = Registered(measurement, measurement.image_db, field, still, still, "none", False, "")
    return target_fit.make_target(case, name, geometry, registered, Levels(), flags or {}, None)


def make_material(target, box, law=None, integer=None, looks=4.0, **changes):
    """Material to calibrate; its law has no curve unless one is given."""
    bounds = np.asarray(box, dtype=np.float64)
    found = law or law_for("external", names=[f"p{k}" for k in range(len(bounds))])
    whole = np.array([False] * len(bounds) if integer is None else integer)
    return CalibratedMaterial("dyke", target, found, bounds, whole, looks, **changes)


def make_score(cost, x=(0.0,), rms=None, **changes):
    """Score of a run whose density has mean 0, variance nearly 1."""
    density = PassScore([0.0, 1.0, 0.1], cost if rms is None else rms)
    keys = {"densities": [density], "statistics": [[0.0, 0.0, 0.0]], "looks": 4.0, **changes}
    return Score(list(x), cost=cost, **keys)


def make_run(kind, index, cost, proposals=None, **scored):
    """Run in which each material's X is the run's number."""
    scores = {name: make_score(value, **{"x": [float(index)], **scored}) for name, value in cost.items()}
    return Run(kind, index, [f"{kind}{index}"], 0.5, scores, proposals or {})
