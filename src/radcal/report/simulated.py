"""Forward run of a case with given materials, without a measurement: simulated images, incidence and masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.config import stages
from radcal.radar.geometry import Geometry, write_geometry
from radcal.radar.projection import make_geometry
from radcal.report.export import ground_layers
from radcal.report.geotiff import Layer, map_grid, write_geotiff
from radcal.scene.model import Scene, write_scene
from radcal.scene.sources import make_scene
from radcal.seeds import noise_seed
from radcal.simulators.sources import make_runner
from radcal.storage.files import digest
from radcal.storage.provenance import provenance
from radcal.storage.runs import RunStore

__all__ = ["Forward", "forward", "simulate"]


@dataclass(frozen=True)
class Forward:
    """Geometry and simulated image of one pass of a forward run.

    Attributes
    ----------
    geometry : Geometry
        Geometry of the pass.
    image_db : ndarray of float32, shape (rows, columns)
        Simulated image [dB].
    key : str
        Hash of the run, which names its record.
    kept : bool
        Whether the run store had the record already, so that nothing was simulated.
    """

    geometry: Geometry
    image_db: NDArray[np.float32]
    key: str
    kept: bool


def forward(case: stages.Forward, folder: str | Path, runs: str | Path) -> tuple[Scene, list[Forward]]:
    """Simulate all passes of a case at the parameters of its materials, with the noise seed of the final check run.

    Parameters
    ----------
    case : stages.Forward
        Scene, passes, simulator and materials. A material to be calibrated has its starting parameters.
    folder : path
        Folder of ``scene.h5`` and ``geometry.h5``. From pass 2 on, ``geometry.h5`` of pass p lies in ``passes/<p>/``.
    runs : path
        Folder of the run store; a run that has a record there is not simulated.

    Returns
    -------
    scene : Scene
        Scene of the case.
    passes : list of Forward
        Passes in their order.

    Raises
    ------
    RadcalError
        The scene cannot be made, the simulator fails, or a file cannot be written.
    """
    folder, started = Path(folder), case.at_start
    with provenance(case.case, case.sections(*type(case).model_fields)):
        scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
        write_scene(folder / "scene.h5", scene)
        geometries, paths = [], []
        for number, one in enumerate(case.passes, start=1):
            geometries.append(make_geometry(scene, one.radar))
            paths.append((folder / f"passes/{number}" if number > 1 else folder) / "geometry.h5")
            write_geometry(paths[-1], geometries[-1], one.radar)
        runner = make_runner(started, folder / "scene.h5", paths, runs)
        seed, store = noise_seed(case, fresh=True), RunStore(runs)
        found = []
        for each, geometry in zip((runner, *runner.further), geometries, strict=True):
            key = digest(each.description(case.start_parameters, seed))
            kept = store.get(key, case.calibrated, image=True) is not None
            record = each.run(case.start_parameters, seed, image=True)
            assert record.image_db is not None  # noqa: S101 - asked for
            found.append(Forward(geometry, record.image_db, record.key, kept))
    return scene, found


def simulate(case: stages.Forward, folder: str | Path, runs: str | Path) -> list[str]:
    """Simulate all passes of a case, and write the images as GeoTIFF.

    Parameters
    ----------
    case, folder, runs
        As for :func:`forward`. ``folder`` receives ``simulated.tif``, ``incidence.tif``, ``material.tif`` and
        ``mask.tif``; from pass 2 on, the file names of pass p end in ``_pass<p>``.

    Returns
    -------
    list of str
        Lines on the simulated passes, and the paths of the images.
    """
    folder = Path(folder)
    scene, passes = forward(case, folder, runs)
    lines = [f"scene: {note}" for note in scene.notes]
    for number, (one, made) in enumerate(zip(case.passes, passes, strict=True), start=1):
        ending = f"_pass{number}" if number > 1 else ""
        tags = {"case": case.case, "radiometry": one.radar.radiometry, "run": made.key}
        layers = {
            "simulated": Layer(made.image_db, "dB", "simulated image", tags),
            **ground_layers(made.geometry, tags),
        }
        written = _written(folder, ending, layers, scene, made.geometry)
        how = "was in the run store" if made.kept else "simulated"
        lines.append(f"pass {number}: {made.image_db.shape[0]} x {made.image_db.shape[1]} pixels, run {made.key} {how}")
        lines += [f"  {path}" for path in written]
    return lines


def _written(folder: Path, ending: str, layers: dict[str, Layer], scene: Scene, geometry: Geometry) -> Sequence[Path]:
    grid = map_grid(scene, geometry)
    paths = []
    for name, layer in layers.items():
        paths.append(folder / f"{name}{ending}.tif")
        write_geotiff(paths[-1], layer, grid)
    return paths
