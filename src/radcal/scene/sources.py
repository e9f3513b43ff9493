"""From a configured source to a scene."""

from __future__ import annotations

from radcal.config import BuiltinScene, RasterScene
from radcal.config import Scene as SceneConfig
from radcal.scene.builtin import builtin_scene
from radcal.scene.model import Scene
from radcal.scene.raster import raster_scene
from radcal.scene.slant_range import slant_range_scene

__all__ = ["make_scene"]


def make_scene(config: SceneConfig, materials: list[str]) -> Scene:
    """Build the configured scene and check that it has the configured materials.

    Raises
    ------
    SceneError
        The source cannot be read or does not have the materials.
    """
    if isinstance(config, BuiltinScene):
        scene = builtin_scene(config.seed)
    elif isinstance(config, RasterScene):
        scene = raster_scene(config)
    else:
        scene = slant_range_scene(config)
    scene.require(materials)
    return scene
