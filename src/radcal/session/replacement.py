"""Check, before Snakemake plans jobs, that a command would not replace a finished calibration of another scene or pass.

A refusal by a job would be too late: Snakemake records the parameters of a failed job as those of its earlier output,
so that the original command would make everything from this output on again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import h5py
from pydantic import ValidationError

from radcal.config import Case
from radcal.config.part import Part
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, StoreError
from radcal.storage.files import case_folder, first_difference
from radcal.storage.records import Fault, inspect_file, provenance, understood

_MOST_BYTES = 16 * 2**20  # of a larger file only header and size are inspected, unless its values are compared


def check_replacement(case: Case, folder: str | Path, inputs: Mapping[str, Path]) -> None:
    """Raise an error if a command would replace scene or geometry of a finished calibration by another.

    The scene is built for a comparison only if section ``scene`` has changed or one of its files is newer.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    folder : path
        Results folder of the case, ``results/<case>``.
    inputs : mapping
        Input files of the case by configuration key.

    Raises
    ------
    ConfigError
        The command would replace results, and ``replace`` is false.
    SceneError
        The changed scene cannot be built.
    """
    folder = Path(folder)
    if case.replace or not (folder / "calibration.h5").is_file():
        return
    with provenance(case.case):
        for number, one in enumerate(case.passes, start=1):
            _check_geometry(one, folder / f"passes/{number}/geometry.h5")
        _check_scene(case, folder / "scene.h5", [path for key, path in inputs.items() if key.startswith("scene.")])


def _check_geometry(case: Case, path: Path) -> None:
    def alike() -> bool:
        from radcal.radar.geometry import is_of_pass  # imported here, because every job imports this module

        return is_of_pass(path, case.radar, case.simulator.not_told)

    _check(case, path, "geometry", lambda recorded: recorded.radar == case.radar, alike)


def _check_scene(case: Case, path: Path, files: list[Path]) -> None:
    def unchanged(recorded: Part) -> bool:
        # the scene itself does not depend on the materials, which are the other section that its rule reads
        return recorded.scene == case.scene and all(file.stat().st_mtime <= path.stat().st_mtime for file in files)

    def alike() -> bool:
        from radcal.scene.model import Scene
        from radcal.scene.sources import make_scene
        from radcal.storage.dataclass_groups import same, take

        made = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
        with understood(path), h5py.File(path, "r", locking=False) as file:
            kept = take(file, Scene, without=("findings", "imagery"))  # which affect no result
        return same(kept, replace(made, findings=(), imagery=None))

    _check(case, path, "scene", unchanged, alike)


def _check(case: Case, path: Path, kind: str, unchanged: Callable[[Part], bool], alike: Callable[[], bool]) -> None:
    """Raise an error if a file is undamaged, and neither its sections nor its values are those of the case."""
    try:
        inspect_file(path, kind, _MOST_BYTES)
        with h5py.File(path, "r", locking=False) as file:
            theirs = json.loads(file["config"].asstr()[()])
        if unchanged(STAGES[kind].model.model_validate(theirs)):
            return
        if path.stat().st_size > _MOST_BYTES:
            inspect_file(path, kind)
    except (Fault, OSError, StoreError, KeyError, ValueError, ValidationError):
        return  # a missing or damaged file need not be kept
    if alike():
        return
    ours = json.loads(json.dumps(STAGES[kind].params(case), default=str))
    why = first_difference(theirs, ours) if theirs != ours else "the files that it is made from are others"
    raise ConfigError(
        f"{case_folder(path)} holds a finished calibration of another {kind} ({why}), which stays as it is: give this "
        "one a name of its own (case: ...), or add --config replace=true (to radcal run: --set replace=true) to have "
        "those results replaced (runs are kept)."
    )
