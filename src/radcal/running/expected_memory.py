"""Memory that the jobs of a case will probably take, from measured peaks.

A job's peak is that of its process, VmHWM of proc(5): a constant for the libraries, and a number of bytes for each
value of the arrays that it grows with (docs/cluster.md lists what was measured). What a cluster is asked for is larger
(:mod:`radcal.running.memory_and_time`).
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
    """Peak of a job: constant [MB], bytes for each value, and the arrays whose values count."""

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
_REGISTRATION_NONE = _Peak(100, 65, "pixels")
_EXPORT_IN_SLANT_RANGE = _Peak(100, 140, "pixels of all passes")  # no image is brought to the map


def expected_mb(case: Case) -> dict[str, float]:
    """Memory that the largest job of each kind will probably take [MB].

    Parameters
    ----------
    case : Case
        The configuration.

    Returns
    -------
    dict
        Peak of the process by kind of job; of an external simulator's own process nothing is known.

    Raises
    ------
    ConfigError, SceneError
        The scene's files do not determine the size.
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
    """Memory that the largest job of each kind will probably take [MB].

    Parameters
    ----------
    scene : SceneSize
        Size of the scene.
    images : sequence of ImageSize
        Size of the image of each pass.
    registered : bool
        Whether the measured image is moved onto the simulated one.
    on_map : bool
        Whether images are exported on the map.
    simulated : bool
        Whether a measured image is synthetic.
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
