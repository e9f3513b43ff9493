"""Numbers of facets and pixels of a pass over a scene, estimated before the geometry of the pass is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.scene.base import SceneSize

_LARGEST = 1_000_000_000  # largest number of facets or pixels: about 140 GB of geometry


@dataclass(frozen=True)
class ImageSize:
    """Size of the image of a scene: numbers of facets and of pixels.

    Attributes
    ----------
    facets : int
        Number of facets of the scene.
    pixels : int
        Number of pixels of the image if the ground were level.
    """

    facets: int
    pixels: int


def refinement(cell_m: float, radar: Radar) -> int:
    """Smallest number of facets along each side of a cell for which no facet is larger than a pixel on level ground.

    Parameters
    ----------
    cell_m : float
        Cell size [m].
    radar : Radar
        Pass; its pixel spacings and its incidence angle at the scene's centre are used.
    """
    pixel_m = min(radar.range_spacing_m / radar.slant_per_ground, radar.azimuth_spacing_m)
    return max(1, math.ceil(cell_m / pixel_m - 1e-9))


def image_size(scene: SceneSize, radar: Radar) -> ImageSize:
    """Numbers of facets and pixels of a scene in one pass.

    Parameters
    ----------
    scene : SceneSize
        Size of the scene.
    radar : Radar
        Pass; its pixel spacings and its incidence angle at the scene's centre are used.

    Returns
    -------
    ImageSize
        Numbers of facets and pixels for level ground far from the track, where a distance d in ground range is a
        distance d sin(incidence) in slant range. The simulated image has fewer pixels, because it covers only the slant
        ranges at which every azimuth line has ground.
    """
    if scene.cell_m is None:
        return ImageSize(scene.cells, scene.cells)
    pixel_m2 = radar.range_spacing_m * radar.azimuth_spacing_m
    area_m2 = scene.cells * scene.cell_m**2 * radar.slant_per_ground
    return ImageSize(scene.cells * refinement(scene.cell_m, radar) ** 2, math.ceil(area_m2 / pixel_m2))


def check_size(scene: SceneSize, radar: Radar) -> None:
    """Raise an error if the image of the scene would have too many facets or pixels for the memory of a computer.

    Parameters
    ----------
    scene : SceneSize
        Size of the scene.
    radar : Radar
        Pass; its pixel spacings and its incidence angle at the scene's centre are used.

    Raises
    ------
    ConfigError
        The image would have more than 1,000,000,000 facets or pixels.
    """
    size = image_size(scene, radar)
    if max(size.facets, size.pixels) > _LARGEST:
        raise ConfigError(
            f"radar.range_spacing_m is {radar.range_spacing_m:g} and radar.azimuth_spacing_m "
            f"{radar.azimuth_spacing_m:g}: the scene's image would have {size.facets:,} facets and {size.pixels:,} "
            f"pixels, expected at most {_LARGEST:,}."
        )
