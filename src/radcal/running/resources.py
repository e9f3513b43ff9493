"""Memory and time that the jobs of each stage request from a cluster, as linear functions of the scene's size.

The size is the number of cells, facets or pixels, whichever is the largest; the coefficients lie above
what was measured on scenes of 2 to 56 million cells (docs/cluster.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from radcal.config import Case
from radcal.radar.size import image_size
from radcal.scene.size import scene_size

__all__ = ["Stage", "memory_mb", "runtime_minutes", "values_of"]

Stage = Literal["light", "scene", "geometry", "measurement", "run", "registration", "target", "report"]


@dataclass(frozen=True)
class _Demand:
    """Memory besides the values [MB], memory per value [byte], time per million values [s]."""

    base_mb: float
    value_bytes: float
    million_s: float


_DEMANDS: dict[Stage, _Demand] = {
    "light": _Demand(1000, 0, 0),
    "scene": _Demand(600, 80, 10),
    "geometry": _Demand(800, 140, 30),
    "measurement": _Demand(900, 180, 60),
    "run": _Demand(1000, 100, 30),
    "registration": _Demand(1000, 350, 200),
    "target": _Demand(900, 180, 60),
    "report": _Demand(1000, 100, 20),
}
_LEAST_MINUTES = 10


def values_of(case: Case) -> dict[str, int]:
    """Number of values in a scene's largest arrays.

    Parameters
    ----------
    case : Case
        The configuration.

    Returns
    -------
    dict of str to int
        ``scene``: the most values that the scene is made from; ``image``: the largest number of its
        cells, its facets and the pixels of its image.

    Raises
    ------
    ConfigError, SceneError
        The scene's files do not tell.
    """
    scene = scene_size(case.scene)
    image = image_size(scene, case.radar)
    return {"scene": max(scene.cells, scene.resampled), "image": max(scene.cells, image.facets, image.pixels)}


def memory_mb(stage: Stage, values: int, attempt: int = 1) -> int:
    """Memory that a job is given [MB], in hundreds.

    Parameters
    ----------
    stage : Stage
        What the job does.
    values : int
        As :func:`values_of` says: ``scene`` of the stage of that name, else ``image``.
    attempt : int
        1, or more where a job is tried again: each time it gets twice as much.
    """
    demand = _DEMANDS[stage]
    hundreds = math.ceil((demand.base_mb + demand.value_bytes * values / 1e6) / 100)
    return (100 * hundreds) << (attempt - 1)


def runtime_minutes(stage: Stage, values: int, simulation_s: float = 0.0) -> int:
    """Time that a job is given [min].

    Parameters
    ----------
    stage : Stage
        What the job does.
    values : int
        As :func:`memory_mb` takes it.
    simulation_s : float
        What the simulator's runs in the job take at most [s].
    """
    return _LEAST_MINUTES + math.ceil((_DEMANDS[stage].million_s * values / 1e6 + simulation_s) / 60)
