"""Objectives: classes with a common interface that compare runs with the target."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radcal.config.part import Part
from radcal.ground.patches import pooled
from radcal.objectives.base import CalibratedMaterial, Comparison, Objective
from radcal.objectives.joint import Joint
from radcal.sections.objectives import OBJECTIVES
from radcal.targets.target import Target, Targets

__all__ = ["Comparison", "Objective", "make_objectives", "objective_class"]


def objective_class(name: str) -> type[Objective]:
    """Class of an objective, by its name in the configuration."""
    found: type[Objective] = pkgutil.resolve_name(OBJECTIVES[name].place)
    return found


def make_objectives(case: Part, targets: Sequence[Targets]) -> Mapping[str, Comparison]:
    """Objective of every calibrated material, in all passes of the case.

    Parameters
    ----------
    case : Part
        Name of the objective, laws, bounds and looks.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.

    Returns
    -------
    mapping
        Objective by material, in the order of the targets.
    """
    if len(targets) == 1:
        return _of_pass(case, targets[0])
    each = [
        _of_pass(one, found, priors=number == 0)
        for number, (one, found) in enumerate(zip(case.passes, _of_common_spread(targets), strict=True))
    ]
    return {name: Joint([objectives.get(name) for objectives in each]) for name in targets[0]}


def _of_common_spread(targets: Sequence[Targets]) -> list[Targets]:
    """Targets of all passes, with one spread of fields for each material: all passes show the same fields."""

    def common(name: str, target: Target) -> Target:
        if target.classes is None:
            return target
        each = [one[name].classes for one in targets if name in one]
        spread = pooled([bins.spread for bins in each if bins is not None])
        return replace(target, classes=replace(target.classes, spread=spread))

    each = ({name: common(name, target) for name, target in one.items()} for one in targets)
    return [Targets(found, one.levels, one.looks) for found, one in zip(each, targets, strict=True)]


def _of_pass(case: Part, targets: Targets, priors: bool = True) -> dict[str, Objective]:
    """Objective of each material in one pass; ``priors`` tells whether the priors enter."""
    laws, kind = case.laws, objective_class(case.objective)
    return {
        name: kind(
            CalibratedMaterial(
                name=name,
                target=target,
                law=laws[name],
                box=np.array(case.materials[name].box, dtype=np.float64),
                integer=np.array(case.materials[name].integers, dtype=np.bool_),
                looks=float(case.radar.looks),
                decibels=targets.levels.normalisation != "image",
                priors=priors,
            )
        )
        for name, target in targets.items()
    }
