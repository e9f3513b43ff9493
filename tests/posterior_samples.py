"""Models of what is known of a law, from pixels made with a hidden law and a surrogate that is law and speckle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from calibration_samples import make_material, make_target

from radcal.assessment.unknowns import Model
from radcal.calibration.objectives import Comparison
from radcal.calibration.objectives.bins import Bins
from radcal.calibration.surrogate import Surrogate, Training
from radcal.config import Uncertainty
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.classes import make_classes
from radcal.measurement.levels import Levels
from radcal.measurement.patches import Spread
from radcal.radar.laws import Law, law_for

LINE = law_for("tabulated", angles_deg=(20.0, 60.0))
LINE_BOX = [[-30.0, 10.0], [-40.0, 0.0]]
LINE_X = np.array([-6.0, -16.0])
EXACT = {
    "level_db": 0.0,
    "noise_db": 0.0,
    "field_db": 0.0,
    "point_spread": 0.0,
    "incidence_error": 0.0,
    "incidence_floor_deg": 0.0,
}
# fewer steps than a case can ask for: enough where the sampler's convergence is not what is tested
BRIEF = Uncertainty(walkers=32).model_copy(update={"steps": 20})


def made_bins(
    law: Law = LINE,
    box: Any = LINE_BOX,
    x: Any = LINE_X,
    *,
    seed: int = 1,
    looks: float = 4.0,
    free_looks: bool = False,
    error_deg: float = 0.0,
    fields: int = 3,
    pixels: int = 1200,
    shift_db: float = 0.0,
    noise_db: float = float("-inf"),
) -> Bins:
    """Objective of pixels at 40 +- 7 degrees with independent speckle of some looks; the sensor has 4."""
    rng = np.random.default_rng(seed)
    angle = np.clip(rng.normal(40.0, 7.0, pixels), 21.0, 59.0)
    values = law(np.radians(angle), x) + shift_db + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, pixels))
    classes = make_classes(values, angle, 5)
    bins = ClassTarget(classes, Spread(0.5, 0.3), 1, free_looks, False, error_deg, np.asarray(x), looks)
    patch, block = rng.integers(1, fields + 1, pixels), rng.integers(0, 7, pixels)
    target = make_target(values, angle, classes=bins, patch=patch, block=block, noise_db=noise_db)
    return Bins(make_material(target, box, law, looks=4.0))


def made_model(
    objective: Comparison, levels: Sequence[Levels] = (Levels(),), others: Sequence[Any] = (), **budget: Any
) -> Model:
    """Model on a surrogate of one run without a difference from the baseline."""
    assert objective.baseline is not None
    x = objective.material.box.mean(axis=1)
    training = Training(
        parameters=x[None],
        statistics=objective.baseline(x)[None],
        scales=np.ones((3, x.size)),
        nugget=np.full(3, 1e-10),
        baseline=np.ones(3, dtype=np.bool_),
        q2=np.full(3, np.nan),
        status=("trained",) * 3,
    )
    return Model(objective, Surrogate(training, objective), levels, Uncertainty(**{**EXACT, **budget}), others)
