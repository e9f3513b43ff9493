"""Expected memory of the jobs of a case, from measured peaks.

The peak of a job is the peak memory of its process, VmHWM of proc(5). The expected peak is a constant for the libraries
plus a number of bytes for each value of certain arrays (docs/cluster.md lists the measurements). From a cluster, jobs
request more memory than the expected peak (:mod:`radcal.forecast.memory_and_time`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from radcal.config import Case, RasterScene
from radcal.radar.size import ImageSize, image_size
from radcal.scene.size import SceneSize, scene_size

__all__ = ["expected_mb", "peaks_mb"]


@dataclass(frozen=True)
class _Peak:
    """Peak memory of a job: constant [MB], bytes for each array value, and the arrays whose values are counted."""

    base_mb: float
    value_bytes: float
    values: Literal["resampled", "facets", "facets of all passes", "pixels", "pixels of all passes"]


# fits to five cases of 0.3 to 7 million pixels and 0.8 to 9 million facets
_PEAKS = {
    "scene": _Peak(150, 55, "resampled"),
    "geometry": _Peak(200, 88, "facets"),
    "measurement": _Peak(220, 118, "facets"),
    "run": _Peak(240, 56, "facets of all passes"),
    "registration": _Peak(100, 285, "pixels"),
    "target": _Peak(120, 156, "pixels"),
    "archive": _Peak(137, 118, "pixels of all passes"),
    "export": _Peak(100, 222, "pixels of all passes"),
    "report": _Peak(205, 151, "pixels of all passes"),
}
_IMAGE_OF_A_FILE = _Peak(165, 80, "facets")  # nothing is simulated
_REGISTRATION_NONE = _Peak(100, 130, "pixels")
_EXPORT_IN_SLANT_RANGE = _Peak(100, 140, "pixels of all passes")  # no image is brought to the map


def expected_mb(case: Case) -> dict[str, float]:
    """Expected memory of the largest job of each kind [MB].

    Parameters
    ----------
    case : Case
        The configuration.

    Returns
    -------
    dict
        Peak memory of the process by kind of job, without the unknown memory of an external simulator's own process.

    Raises
    ------
    ConfigError, SceneError
        The scene's files do not determine the size of the scene.
    """
    scene = scene_size(case.scene)
    images = [image_size(scene, one.radar) for one in case.passes]
    return peaks_mb(
        scene,
        images,
        registered=case.registration.method != "none",
        on_map=isinstance(case.scene, RasterScene),
        simulated=any(one.measurement.source == "synthetic" for one in case.passes),
    )


def peaks_mb(
    scene: SceneSize, images: Sequence[ImageSize], registered: bool, on_map: bool, simulated: bool
) -> dict[str, float]:
    """Expected memory of the largest job of each kind [MB].

    Parameters
    ----------
    scene : SceneSize
        Size of the scene.
    images : sequence of ImageSize
        Size of the image of each pass.
    registered : bool
        Whether the measured image is moved onto the simulated one.
    on_map : bool
        Whether images are exported in map coordinates.
    simulated : bool
        Whether the measured image of any pass is synthetic.
    """
    facets, pixels = [image.facets for image in images], [image.pixels for image in images]
    values = {
        "resampled": max(scene.cells, scene.resampled),
        "facets": max(facets),
        "facets of all passes": sum(facets),
        "pixels": max(pixels),
        "pixels of all passes": sum(pixels),
    }
    peaks = dict(_PEAKS)
    if not simulated:
        peaks["measurement"] = _IMAGE_OF_A_FILE
    if not registered:
        peaks["registration"] = _REGISTRATION_NONE
    if not on_map:
        peaks["export"] = _EXPORT_IN_SLANT_RANGE
    return {job: peak.base_mb + peak.value_bytes * values[peak.values] / 1e6 for job, peak in peaks.items()}
