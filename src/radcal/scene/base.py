"""Source of scenes: what each source offers, and the size of a scene before the scene is made."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from radcal.scene.model import Scene
from radcal.sections.scene import SCENES, SceneSection


@dataclass(frozen=True)
class SceneSize:
    """Size of a scene: number of cells, and size of a cell.

    Attributes
    ----------
    cells : int
        Number of cells of the scene; in a slant-range scene, number of pixels.
    cell_m : float or None
        Cell size [m]; None for a slant-range scene.
    resampled : int
        Number of values of the finer raster after its resampling; equal to ``cells`` if no raster is finer than the
        cells.
    """

    cells: int
    cell_m: float | None
    resampled: int


class SceneSource(ABC):
    """Source of scenes, such as rasters on the map.

    Attributes
    ----------
    section : type of SceneSection
        Model of section ``scene``, whose key ``source`` has the name of the source as its only value.
    """

    section: type[SceneSection]

    @staticmethod
    @abstractmethod
    def size(config: Any) -> SceneSize:
        """Size of a scene, from the headers of its files.

        Raises
        ------
        ConfigError
            A file is missing.
        SceneError
            A file cannot be read, or no grid fits the files.
        """

    @staticmethod
    @abstractmethod
    def make(config: Any, heading_deg: float) -> Scene:
        """Scene whose grid is turned to the heading of the track [deg] if it is on the map.

        Its objects are those of the source; ``radcal.scene.sources.make_scene`` adds those of ``scene.objects``.

        Raises
        ------
        SceneError
            A file cannot be read, or contradicts the configuration.
        """


def source_of(config: SceneSection) -> type[SceneSource]:
    """Source of the scene that section ``scene`` describes."""
    found: Any = SCENES[config.source]
    kind: type[SceneSource] = found
    return kind


def scene_size(config: SceneSection) -> SceneSize:
    """Size of the configured scene; raises the errors of :meth:`SceneSource.size`."""
    return source_of(config).size(config)
