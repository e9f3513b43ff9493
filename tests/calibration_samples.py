"""Targets, materials and scores made from arrays, for tests of the calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.ground.goodness import Goodness
from radcal.laws import Law, external_law
from radcal.objectives.base import CalibratedMaterial
from radcal.objectives.history import PassScore, Proposal, Run, Score
from radcal.skewnormal import fit
from radcal.targets.target import Target

# hidden laws of the field and the lake in calibration/conftest.py, and their bounds
TRUTH = {"field": [-30.0, 22.0, 6.0, 4.0], "lake": [-35.0, 12.0, 25.0, 6.0]}
BOUNDS = [[-60, 0], [0, 50], [0, 50], [0, 20]]


def make_target(values_db: ArrayLike, incidence_deg: ArrayLike, **changes: Any) -> Target:
    """Target of all pixels of a material, each of them independent."""
    values = np.asarray(values_db, dtype=np.float64)
    keys: dict[str, Any] = {
        "pixels": np.arange(values.size),
        "order": np.arange(values.size),
        "values_db": values,
        "incidence_deg": np.asarray(incidence_deg, dtype=np.float32),
        "eligible": values.size,
        "at_boundary": False,
        "effective": float(values.size),
        "rms_sampling": 1e-3,
        "cp_error": np.zeros(3),
        "cp_interval": np.zeros((3, 2)),
        "goodness": Goodness(0.0, 1.0, 0.0, 1.0),
        "patch": np.ones(values.size, dtype=np.int64),
        "block": np.arange(values.size) % 10,
        **changes,
    }
    return Target(**{"dp": fit(values).dp if "dp" not in changes else changes["dp"], **keys})


def make_material(
    target: Target,
    box: ArrayLike,
    law: Law | None = None,
    integer: Sequence[bool] | None = None,
    looks: float = 4.0,
    **changes: Any,
) -> CalibratedMaterial:
    """Material to calibrate; its law has no curve unless one is given."""
    bounds = np.asarray(box, dtype=np.float64)
    found = law or external_law([f"p{k}" for k in range(len(bounds))])
    whole: NDArray[np.bool_] = np.array([False] * len(bounds) if integer is None else integer)
    return CalibratedMaterial("dyke", target, found, bounds, whole, looks, **changes)


def make_score(cost: float, x: Sequence[float] = (0.0,), rms: float | None = None, **changes: Any) -> Score:
    """Score of a run whose density has mean 0, variance nearly 1."""
    density = PassScore([0.0, 1.0, 0.1], cost if rms is None else rms)
    return Score(list(x), [density], cost=cost, **{"statistics": [[0.0, 0.0, 0.0]], "looks": 4.0, **changes})


def make_run(
    kind: str, index: int, cost: dict[str, float], proposals: dict[str, Proposal] | None = None, **scored: Any
) -> Run:
    """Run in which each material's X is the run's number."""
    scores = {name: make_score(value, **{"x": [float(index)], **scored}) for name, value in cost.items()}
    return Run(kind, index, [f"{kind}{index}"], 0.5, scores, proposals or {})  # type: ignore[arg-type]
