"""Scene from the source that the configuration names."""

from __future__ import annotations

from dataclasses import replace

from radcal.config import expand_path
from radcal.findings import Finding
from radcal.scene.base import source_of
from radcal.scene.model import Scene
from radcal.scene.object_generator import generate_objects
from radcal.scene.object_tables import Place, read_objects
from radcal.scene.objects import Objects
from radcal.sections.scene import SCENES, SceneConfig, SceneObjects
from radcal.standing.cross_sections import cross_sections
from radcal.storage.files import digest


def make_scene(config: SceneConfig, materials: list[str] | None, heading_deg: float = 0.0) -> Scene:
    """Build the configured scene, with its objects, and check that it contains the configured materials.

    Parameters
    ----------
    config : SceneConfig
        Section ``scene``.
    materials : list of str or None
        Names of the configured materials; None if these materials are not compared with the scene's materials.
    heading_deg : float
        Heading of the track, clockwise from north [deg], to which the grid of a raster scene is turned.

    Raises
    ------
    SceneError
        The files of the scene or of its objects cannot be read, or the scene's materials are not the configured ones.
    """
    scene = source_of(config).make(config, heading_deg)
    if origin := SCENES.origin(config.source):
        scene = replace(scene, identity=digest({"scene": scene.identity, **origin}))
    objects = scene.objects if config.on_ground is None else _objects(config.on_ground, scene)
    roofs = () if objects is None or objects.walls is None else objects.walls.roofs
    scene = replace(scene, names=(*scene.names, *(name for name in roofs if name not in scene.names)))
    if materials is not None:
        scene.require(materials, roofs)
    if objects is not None:
        numbers = {"objects": len(objects), "points": int((~objects.extended).sum())}
        scene = replace(
            scene,
            identity=digest({"scene": scene.identity, "objects": objects.identity}),
            findings=(*scene.findings, Finding("objects", "note", "scene", numbers), *_of_walls(objects)),
            objects=objects,
        )
    return scene


def _objects(config: SceneObjects, scene: Scene) -> Objects:
    """Objects of the scene, read from a table or generated at random."""
    ny, nx = scene.material.shape
    size = (nx * scene.cell_m, ny * scene.cell_m)
    if config.generate is not None:
        made = config.generate
        return generate_objects(size, made.seed, trees=made.trees, cars=made.cars, buildings=made.buildings)
    corner = (0.0, 0.0) if scene.transform is None else (scene.transform[2], scene.transform[5])
    path = expand_path(str(config.path), "scene.objects.path")
    tables = cross_sections(config.cross_sections, "scene.objects.cross_sections")
    permittivity = None if config.permittivity is None else config.permittivity.pair
    return read_objects(path, Place(size, corner, scene.crs), config.layer, config.aspect, tables, permittivity)


def _of_walls(objects: Objects) -> list[Finding]:
    """Note on boxes with walls of their own, and on their double bounce; else empty."""
    walls = objects.walls
    if walls is None:
        return []
    numbers = {"walls": int((walls.roof >= 0).sum()), "bounce": int(walls.bounce.sum())}
    return [Finding("walls" if walls.permittivity else "walls_reflect_all", "note", "scene", numbers)]
