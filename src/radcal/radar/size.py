"""How many facets and pixels a pass over a scene has: known before its geometry is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from radcal.config import Radar
from radcal.scene.size import SceneSize

__all__ = ["ImageSize", "image_size", "refinement"]


@dataclass(frozen=True)
class ImageSize:
    """Numbers that say how large the image of a scene is.

    Attributes
    ----------
    facets : int
        Facets that the scene is cut into.
    pixels : int
        Pixels of the image, on level ground.
    """

    facets: int
    pixels: int


def refinement(cell_m: float, radar: Radar) -> int:
    """Into how many facets a cell's side is cut: none is larger than the pixels on level ground.

    Parameters
    ----------
    cell_m : float
        Cell size [m].
    radar : Radar
        Pixel spacings and depression angle.
    """
    pixel_m = min(radar.range_spacing_m / math.cos(math.radians(radar.depression_deg)), radar.azimuth_spacing_m)
    return max(1, math.ceil(cell_m / pixel_m - 1e-9))


def image_size(scene: SceneSize, radar: Radar) -> ImageSize:
    """Facets and pixels of a scene in one pass.

    Parameters
    ----------
    scene : SceneSize
        Size of the scene.
    radar : Radar
        Pixel spacings and depression angle.

    Returns
    -------
    ImageSize
        On level ground far from the track, where a ground distance d takes d cos(depression) of slant
        range; an image leaves out what not every azimuth line reaches, and has fewer pixels.
    """
    if scene.cell_m is None:
        return ImageSize(scene.cells, scene.cells)
    pixel_m2 = radar.range_spacing_m * radar.azimuth_spacing_m
    area_m2 = scene.cells * scene.cell_m**2 * math.cos(math.radians(radar.depression_deg))
    return ImageSize(scene.cells * refinement(scene.cell_m, radar) ** 2, math.ceil(area_m2 / pixel_m2))
