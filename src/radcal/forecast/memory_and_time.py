"""Memory and time that the jobs of each stage request from a cluster, as linear functions of the scene size.

The scene size is the largest of the numbers of cells, facets and pixels. The coefficients of the linear functions are
those of the table of stages (:class:`radcal.config.stages.Demand`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from radcal.config import Case
from radcal.config.stages import STAGES
from radcal.radar.size import image_size
from radcal.scene.base import scene_size


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


def memory_mb(stage: str, values: Mapping[str, int], attempt: int = 1) -> int:
    """Memory that a job requests [MB], a multiple of 100.

    Parameters
    ----------
    stage : str
        Name of the stage.
    values : mapping
        Numbers of values from :func:`values_of`: ``scene`` is for stage ``scene``, ``image`` for all other stages.
    attempt : int
        Number of the attempt, from 1; each further attempt requests twice the memory of the previous attempt.
    """
    demand = STAGES[stage].demand
    hundreds = math.ceil((demand.base_mb + demand.value_bytes * _values(stage, values) / 1e6) / 100)
    return (100 * hundreds) << (attempt - 1)


def runtime_minutes(stage: str, values: Mapping[str, int], simulation_s: float = 0.0) -> int:
    """Time that a job requests [min].

    Parameters
    ----------
    stage, values : str, mapping
        As for :func:`memory_mb`.
    simulation_s : float
        Upper limit of the total time of all simulator runs in the job [s].
    """
    demand = STAGES[stage].demand
    return demand.least_min + math.ceil((demand.million_s * _values(stage, values) / 1e6 + simulation_s) / 60)


def _values(stage: str, values: Mapping[str, int]) -> int:
    return values["scene" if stage == "scene" else "image"]
