"""Objectives: what is compared between runs and target, one class each, behind one contract."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from radcal.calibration.objectives.bins import Bins, Likelihood
from radcal.calibration.objectives.density import Density
from radcal.calibration.objectives.objective import Material, Objective
from radcal.config import stages
from radcal.measurement.target import Targets

__all__ = ["OBJECTIVES", "Objective", "make_objectives"]

OBJECTIVES: dict[str, type[Objective]] = {"classes": Bins, "density": Density, "likelihood": Likelihood}
"""Class of each objective, by its name in the configuration (``radcal.config.objectives``)."""


def make_objectives(case: stages.Scores | stages.Archive, targets: Targets) -> Mapping[str, Objective]:
    """Objective of every calibrated material.

    Parameters
    ----------
    case : stages.Scores or stages.Archive
        Name of the objective, laws, bounds and looks.
    targets : Targets
        By calibrated material.

    Returns
    -------
    mapping
        By material, in the order of the targets.
    """
    laws, kind = case.laws, OBJECTIVES[case.objective]
    return {
        name: kind(
            Material(
                name=name,
                target=target,
                law=laws[name],
                box=np.array(case.materials[name].box, dtype=np.float64),
                integer=np.array(case.materials[name].integers, dtype=np.bool_),
                looks=float(case.radar.looks),
                decibels=targets.levels.normalisation != "image",
            )
        )
        for name, target in targets.items()
    }
