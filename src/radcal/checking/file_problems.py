"""Problems of single files of a case, for cases whose scene or image cannot be made because of other problems."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radcal.config import (
    BuiltinScene,
    Case,
    FileMeasurement,
    Loaded,
    RasterScene,
    SceneConfig,
    SlantRangeScene,
    expand_path,
    load_with_problems,
    vrt_folders,
)
from radcal.config.landcover import LANDCOVERS
from radcal.config.loading import listed_by, origin_of
from radcal.errors import ConfigError, MissingFile, NotInScene, RadcalError, SceneError, UnknownMaterial
from radcal.newcase.file_facts import code_counts
from radcal.reading.safe import is_safe_name

if TYPE_CHECKING:
    from radcal.scene.model import Scene

__all__ = ["is_on_map", "rightly_named", "scene_of", "scene_problems", "with_hints"]


def scene_of(case: Case, loaded: Loaded) -> tuple[Scene | None, list[RadcalError]]:
    """Scene made in memory, without a check of its names if that fails, and its problems; None if it cannot be made."""
    from radcal.scene.sources import make_scene

    # a material with a wrong law still is a material of the case, and one that is still to be decided may have any name
    of_file = any(key.startswith("materials") for key in loaded.wrong)
    known = loaded.materials or (None if of_file else case.materials)
    try:
        return make_scene(case.scene, None if known is None else list(known), case.radar.heading_deg), []
    except RadcalError as error:
        problems = [error, *scene_problems(case.scene, loaded.materials)]
    with contextlib.suppress(RadcalError):
        return make_scene(case.scene, None, case.radar.heading_deg), problems
    return None, problems


def scene_problems(scene: SceneConfig, materials: Collection[str] | None = None) -> list[RadcalError]:
    """One error for each problem that a single file or key of section ``scene`` has.

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
    return [error for check in checks for error in _said(check)]


def with_hints(error: RadcalError, paths: Iterable[str | Path]) -> str:
    """Message of a problem, with a hint on a file that lies where the case file is.

    Parameters
    ----------
    error : RadcalError
        Problem.
    paths : iterable of path
        Case files.
    """
    about = error.about
    if isinstance(about, MissingFile) and not about.path.is_absolute():
        for folder in {Path(path).parent.absolute() for path in paths} - {Path.cwd()}:
            if (folder / about.path).exists():
                return (
                    f"{str(error)[:-1]}; it is in {folder}, the folder of the case file, but paths are relative to the "
                    f"current folder: write {os.path.relpath(folder / about.path)}."
                )
    return str(error)


def is_on_map(config: FileMeasurement) -> bool:
    """Whether a measured image is georeferenced, so that its place does not depend on section ``radar``."""
    from radcal.image.georeference import is_georeferenced

    with contextlib.suppress(RadcalError):
        product = is_safe_name(config.path)
        path = expand_path(config.path, "measurement.path", folder=product)
        return product or is_georeferenced(path, vrt_folders(config))
    return False


def _said(check: Callable[[], Any]) -> list[RadcalError]:
    """Errors that a check returns, or the error that the check raises."""
    try:
        return list(check() or ())
    except RadcalError as error:
        return [error]


def _datum(scene: RasterScene) -> None:
    from radcal.scene.crs import named_datum

    if scene.vertical_datum is not None:
        named_datum(scene.vertical_datum)


def _heights(scene: RasterScene) -> None:
    from radcal.scene.raster import check_elevation

    check_elevation(scene)


def _names(scene: RasterScene, materials: Collection[str] | None) -> list[RadcalError]:
    """Problems of the raster of materials and of the names of its codes."""
    from radcal.scene.names import landcover_names, read_names

    found: list[RadcalError] = []
    codes: dict[int, int] = {}
    names: Collection[str]
    try:
        path = expand_path(scene.materials, "scene.materials")
        codes = code_counts(path)
    except RadcalError as error:
        found, path = [error], Path(scene.materials)
    try:
        own = expand_path(scene.names, "scene.names") if scene.names is not None else None
        names = _possible_names(scene)
        if scene.landcover is not None and codes:
            names = landcover_names(scene.landcover, own, codes, path).values()
        elif own is not None:
            read_names(own, codes, path)  # refuses a code without a name
        found += _unknown(names, materials)
    except RadcalError as error:
        found.append(error)
    return found


def _possible_names(scene: SceneConfig) -> list[str]:
    """Names of the materials that a scene can have, as far as they are known without its rasters."""
    from radcal.scene.builtin import MATERIALS
    from radcal.scene.names import read_names

    if isinstance(scene, BuiltinScene):
        return list(MATERIALS)
    preset = LANDCOVERS[scene.landcover] if isinstance(scene, RasterScene) and scene.landcover is not None else {}
    own = read_names(expand_path(scene.names, "scene.names"), (), Path()) if scene.names is not None else {}
    return list(({code: cover.name for code, cover in preset.items()} | own).values())


def rightly_named(
    error: ConfigError, paths: Sequence[str | Path], overrides: Mapping[str, Any] | None = None
) -> ConfigError:
    """Error about a misspelt name in section ``materials``, for an error about its right name in another section.

    Parameters
    ----------
    error : ConfigError
        Error that :func:`radcal.config.load` raised; it is returned if it is about anything else.
    paths, overrides
        Arguments of :func:`radcal.config.load`.
    """
    if isinstance(error.about, UnknownMaterial):
        with contextlib.suppress(RadcalError):  # no file of names
            loaded = load_with_problems(paths, overrides)
            scene = BuiltinScene() if loaded.case is None else loaded.case.scene
            for one in _unknown(_possible_names(scene), loaded.materials):
                if isinstance(one.about, NotInScene) and one.about.meant == error.about.name:
                    others = sum(other.about != error.about for other in loaded.found)
                    more = f" (and {others} more{listed_by(paths, overrides)})" if others else ""
                    said = f"materials.{one.about.name}: not in the scene (did you mean {one.about.meant!r}?)"
                    return ConfigError(f"{origin_of(paths)}: {said}{more}.", one.about)
    return error


def _slant_names(scene: SlantRangeScene, materials: Collection[str] | None) -> list[RadcalError]:
    """Problems of the raster of labels and of their names."""
    from radcal.scene.names import read_names
    from radcal.scene.slant_range import read_labels

    found: list[RadcalError] = []
    present: Collection[int] = ()
    try:
        present = read_labels(scene)[1]
    except RadcalError as error:
        found.append(error)
    try:
        names = read_names(expand_path(scene.names, "scene.names"), present, Path(scene.labels))
        found += _unknown(names.values(), materials)
    except RadcalError as error:
        found.append(error)
    return found


def _unknown(names: Collection[str], materials: Collection[str] | None) -> list[SceneError]:
    """One error for each material of the case that the scene lacks, as the scene raises it."""
    from radcal.scene.names import not_in_scene

    return [not_in_scene(name, names, materials or ()) for name in materials or () if name not in names]
