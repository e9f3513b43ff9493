"""Construction of the configured simulator, and of its runners with the run store of the case."""

from __future__ import annotations

import pkgutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from radcal.config.part import Part
from radcal.radar.geometry import Geometry, read_geometry
from radcal.scene.model import Scene, read_scene
from radcal.sections.simulator import FOCUSED, SIMULATORS
from radcal.simulators.base import Simulator, SimulatorKind
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore


def make_simulator(case: Part, geometry: Geometry, geometry_path: str | Path, scene: Scene | None = None) -> Simulator:
    """Create the configured simulator for the geometry of a pass.

    Parameters
    ----------
    case : Part
        Configuration of simulator, pass and materials.
    geometry : Geometry
        Geometry of the pass.
    geometry_path : path
        Path of the geometry file, which an external simulator may read, and beside which one of focused images keeps
        what its runs share; empty for none.
    scene : Scene, optional
        Scene of the geometry, which a simulator of focused images needs.

    Raises
    ------
    ConfigError
        The configuration of an external simulator is wrong (:class:`~radcal.programs.command.CommandPlan`), or a
        law without a curve is configured for the built-in simulator, or radar or scene do not suit focused images.
    """
    if case.simulator.focused:
        folder = Path(geometry_path).parent / "focused" if geometry_path else None
        focused: Simulator = pkgutil.resolve_name(FOCUSED)(case, scene, geometry, folder)
        return focused
    found: Any = SIMULATORS[case.simulator.kind]
    kind: type[SimulatorKind] = found
    return kind.of(case, geometry, geometry_path)


def make_runners(
    case: Part, scene_path: str | Path, geometry_paths: Sequence[str | Path], runs: str | Path
) -> list[Runner]:
    """Runner of each pass, which reads runs from the case's run store, and simulates new ones as configured."""
    scene, geometries = read_scene(scene_path), [read_geometry(path) for path in geometry_paths]
    return runners_of(case, scene, geometries, geometry_paths, runs)


def runners_of(
    case: Part, scene: Scene, geometries: Sequence[Geometry], paths: Sequence[str | Path], runs: str | Path
) -> list[Runner]:
    """Runners as of :func:`make_runners`, from the scene and the geometry of each pass.

    The files ``paths`` need not exist before the first run.
    """
    each, identity = case.passes, scene.identity
    return [
        Runner(RunStore(runs), make_simulator(one, geometry, path, scene), geometry, identity, one, each[0].radar)
        for one, geometry, path in zip(each, geometries, paths, strict=True)
    ]
