"""Memory and time that the jobs of each stage request from a cluster, as linear functions of the scene size.

The scene size is the largest of the numbers of cells, facets and pixels. The coefficients of the linear functions
exceed the coefficients measured on scenes of 2 to 56 million cells (docs/cluster.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from radcal.config import Case
from radcal.radar.size import image_size
from radcal.scene.base import scene_size

__all__ = ["Stage", "memory_mb", "runtime_minutes", "values_of"]

Stage = Literal["light", "scene", "geometry", "measurement", "run", "registration", "target", "report"]


@dataclass(frozen=True)
class _Demand:
    """Resources for a stage: constant memory [MB], memory per array value [byte], time per million values [s]."""

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
    """Number of values in the largest arrays of a scene and of its image.

    Parameters
    ----------
    case : Case
        The configuration.

    Returns
    -------
    dict of str to int
        ``scene``: the larger of the number of scene cells and the number of values that are resampled to make the
        scene; ``image``: the largest of the numbers of cells, facets and pixels.

    Raises
    ------
    ConfigError, SceneError
        The scene's files do not determine the size of the scene.
    """
    scene = scene_size(case.scene)
    images = [image_size(scene, one.radar) for one in case.passes]
    most = max(max(image.facets, image.pixels) for image in images)
    return {"scene": max(scene.cells, scene.resampled), "image": max(scene.cells, most)}


def memory_mb(stage: Stage, values: int, attempt: int = 1) -> int:
    """Memory that a job requests [MB], a multiple of 100.

    Parameters
    ----------
    stage : Stage
        Name of the job's stage.
    values : int
        Number of values from :func:`values_of`: entry ``scene`` for stage ``scene``, entry ``image`` for other stages.
    attempt : int
        Number of the attempt, from 1; each further attempt requests twice the memory of the previous attempt.
    """
    demand = _DEMANDS[stage]
    hundreds = math.ceil((demand.base_mb + demand.value_bytes * values / 1e6) / 100)
    return (100 * hundreds) << (attempt - 1)


def runtime_minutes(stage: Stage, values: int, simulation_s: float = 0.0) -> int:
    """Time that a job requests [min].

    Parameters
    ----------
    stage : Stage
        Name of the job's stage.
    values : int
        Number of values from :func:`values_of`, chosen by stage as in :func:`memory_mb`.
    simulation_s : float
        Upper limit of the total time of all simulator runs in the job [s].
    """
    return _LEAST_MINUTES + math.ceil((_DEMANDS[stage].million_s * values / 1e6 + simulation_s) / 60)
