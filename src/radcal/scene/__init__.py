"""Scenes: the digital twin of an area, from the sources that radcal knows."""

from radcal.scene.model import Scene, read_scene, write_scene
from radcal.scene.sources import make_scene

__all__ = ["Scene", "make_scene", "read_scene", "write_scene"]
