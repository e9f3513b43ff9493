"""Check, before Snakemake plans jobs, that a command would not replace a finished calibration of another scene or pass.

A refusal by a job would be too late: Snakemake records the parameters of a failed job as those of its earlier output,
so that the original command would make everything from this output on again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import h5py
from pydantic import ValidationError

from radcal.config import Case
from radcal.config.part import Part
from radcal.config.stages import STAGES
from radcal.errors import StoreError
from radcal.storage.inspection import inspect_file
from radcal.storage.provenance import provenance
from radcal.storage.records import keep_finished
from radcal.storage.sealing import Fault

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
        _check_geometry(case.passes[0], folder / "geometry.h5")  # of an earlier version of radcal
        for number, one in enumerate(case.passes, start=1):
            _check_geometry(one, folder / f"passes/{number}/geometry.h5")
        _check_scene(case, folder / "scene.h5", [path for key, path in inputs.items() if key.startswith("scene.")])


def _check_geometry(case: Case, path: Path) -> None:
    recorded = _recorded(path, "geometry")
    radar, immaterial = case.radar, case.simulator.not_told
    if recorded is None or recorded.radar == radar:
        return
    from radcal.radar.geometry import is_of_pass  # imported here, because every job imports this module

    keep_finished(path, "geometry", STAGES["geometry"].params(case), lambda _: is_of_pass(path, radar, immaterial))


def _check_scene(case: Case, path: Path, files: list[Path]) -> None:
    recorded = _recorded(path, "scene")
    # the scene itself does not depend on the materials, which are the other section that its rule reads
    if recorded is None or (
        recorded.scene == case.scene and all(file.stat().st_mtime <= path.stat().st_mtime for file in files)
    ):
        return
    from radcal.scene.model import Scene
    from radcal.scene.sources import make_scene
    from radcal.storage.dataclass_groups import same, take

    scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
    ours = STAGES["scene"].params(case)
    keep_finished(path, "scene", ours, lambda file: same(take(file, Scene), scene))


def _recorded(path: Path, kind: str) -> Part | None:
    """Sections from which an undamaged file was made; None if they are unknown, so that the job decides."""
    try:
        inspect_file(path, kind, _MOST_BYTES)
        with h5py.File(path, "r", locking=False) as file:
            return STAGES[kind].model.model_validate(json.loads(file["config"].asstr()[()]))
    except (Fault, OSError, StoreError, KeyError, ValueError, ValidationError):
        return None
