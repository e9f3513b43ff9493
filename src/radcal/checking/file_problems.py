"""Problems of single files of a case, for cases whose scene or image cannot be made because of other problems."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import Any

from radcal.config import FileMeasurement, Radar, RasterScene, SceneConfig, SlantRangeScene, expand_path, vrt_folders
from radcal.config.landcover import LANDCOVERS
from radcal.errors import RadcalError
from radcal.reading.safe import is_safe_name
from radcal.running import file_facts
from radcal.running.file_facts import code_counts

__all__ = ["image_problems", "is_on_map", "scene_problems", "swapped_hint"]


def scene_problems(scene: SceneConfig, materials: Collection[str] | None = None) -> list[str]:
    """One sentence for each problem that a single file or key of section ``scene`` has.

    Parameters
    ----------
    scene : SceneConfig
        Section ``scene``.
    materials : collection of str, optional
        Names of the materials of the case; the scene must have all of them.
    """
    checks: list[Callable[[], Any]] = []  # the built-in scene has no files
    if isinstance(scene, RasterScene):
        checks = [
            partial(_datum, scene),
            partial(_heights, scene),
            partial(_names, scene, materials),
        ]
    elif isinstance(scene, SlantRangeScene):
        checks = [partial(_slant_names, scene, materials)]
    return [text for check in checks for text in _said(check)]


def swapped_hint(scene: SceneConfig, text: str) -> str:
    """Question whether heights and land cover are swapped, for a problem of the land cover; otherwise empty.

    Parameters
    ----------
    scene : SceneConfig
        Section ``scene``.
    text : str
        Problem.
    """
    if isinstance(scene, RasterScene):
        with contextlib.suppress(RadcalError):
            return file_facts.swapped_hint(expand_path(scene.elevation, "scene.elevation"), text)
    return ""


def image_problems(config: FileMeasurement, radar: Radar, on_map: bool = True) -> list[str]:
    """One sentence for each problem of a measured image that can be found without the scene.

    Parameters
    ----------
    config, radar, on_map
        Arguments of :func:`radcal.measurement.sources.check_image`.
    """
    from radcal.measurement.sources import check_image

    return [str(error) for error in check_image(config, radar, on_map)]


def is_on_map(config: FileMeasurement) -> bool:
    """Whether a measured image is georeferenced, so that its place does not depend on section ``radar``."""
    from radcal.measurement.georeference import is_georeferenced

    with contextlib.suppress(RadcalError):
        product = is_safe_name(config.path)
        path = expand_path(config.path, "measurement.path", folder=product)
        return product or is_georeferenced(path, vrt_folders(config))
    return False


def _said(check: Callable[[], Any]) -> list[str]:
    """Sentences that a check returns, or the message of the error that the check raises."""
    try:
        return list(check() or ())
    except RadcalError as error:
        return [str(error)]


def _datum(scene: RasterScene) -> None:
    from radcal.scene.crs import named_datum

    if scene.vertical_datum is not None:
        named_datum(scene.vertical_datum)


def _heights(scene: RasterScene) -> None:
    from radcal.scene.raster import check_elevation

    check_elevation(scene)


def _names(scene: RasterScene, materials: Collection[str] | None) -> list[str]:
    """Problems of the raster of materials and of the names of its codes."""
    from radcal.scene.names import landcover_names, read_names

    found: list[str] = []
    codes: dict[int, int] = {}
    try:
        path = expand_path(scene.materials, "scene.materials")
        codes = code_counts(path)
    except RadcalError as error:
        found, path = [str(error)], Path(scene.materials)
    try:
        own = expand_path(scene.names, "scene.names") if scene.names is not None else None
        if scene.landcover is not None:
            known = landcover_names(scene.landcover, own, codes, path)
            if not codes:  # the file's codes are unknown, so that any class of the land cover may occur
                known = {code: cover.name for code, cover in LANDCOVERS[scene.landcover].items()} | (
                    read_names(own, (), path) if own is not None else {}
                )
        elif own is not None:
            known = read_names(own, codes, path)
        found += _unknown(known.values(), materials)
    except RadcalError as error:
        found.append(str(error))
    return found


def _slant_names(scene: SlantRangeScene, materials: Collection[str] | None) -> list[str]:
    """Problems of the raster of labels and of their names."""
    from radcal.scene.names import read_names
    from radcal.scene.slant_range import read_labels

    found: list[str] = []
    present: Collection[int] = ()
    try:
        present = read_labels(scene)[1]
    except RadcalError as error:
        found.append(str(error))
    try:
        names = read_names(expand_path(scene.names, "scene.names"), present, Path(scene.labels))
        found += _unknown(names.values(), materials)
    except RadcalError as error:
        found.append(str(error))
    return found


def _unknown(names: Collection[str], materials: Collection[str] | None) -> list[str]:
    """One sentence for each material of the case that the scene lacks, worded as the error that the scene raises."""
    from radcal.scene.names import not_in_scene

    return [not_in_scene(name, names, materials or ()) for name in materials or () if name not in names]
