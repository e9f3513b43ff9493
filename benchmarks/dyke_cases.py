"""Case files of the published dyke with hidden laws, for calibrations in this process and by the workflow."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from radcal.calibration.steps import all_parameters, noise_seed, reference_runs
from radcal.config import Case, load
from radcal.config.stages import STAGES
from radcal.config.yaml_file import merged, read_case_file
from radcal.measurement.sources import make_measurement
from radcal.objectives import objective_class
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng
from radcal.simulators.base import Simulator
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets
from radcal.targets.target_fit import make_targets

ROOT = Path(__file__).resolve().parents[1]
_PUBLISHED = ROOT / "config/dyke_published.yaml"


def hidden_laws(count: int) -> NDArray[np.float64]:
    """Hidden X of the dyke, drawn uniformly in its published bounds, shape (count, 4)."""
    case = load([_PUBLISHED])
    low, high = np.array(case.materials["dyke"].box).T
    return low + derived_rng(case.seed, "benchmark", "truths").random((count, len(low))) * (high - low)


class Bench:
    """Scene, geometry and simulator of the published dyke, and the folder of its case files.

    Parameters
    ----------
    folder : path
        Folder for case files and measured images; it must exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        case = load([_PUBLISHED])
        self.scene = make_scene(case.scene, list(case.materials))
        self.geometry = make_geometry(self.scene, case.radar)
        self.simulator: Simulator = BuiltinSimulator(self.geometry, case.radar, case.laws)

    def reachable(self, name: str, truth: Sequence[float], settings: Mapping[str, Any]) -> Path:
        """Case file whose measured image is the run with the hidden X, with the speckle of all runs of the case."""
        path = self._folder / f"{name}.npy"
        published = load([_PUBLISHED])
        image_db = self.simulator.run(
            all_parameters(published.materials, {"dyke": list(truth)}),
            noise_seed(STAGES["reference_run"].of(published)),
        )
        np.save(path, image_db)
        radiometry = published.radar.radiometry
        measured = {"source": "file", "path": str(path), "scale": "db", "radiometry": radiometry}
        return self._written(name, measured, settings)

    def speckled(self, name: str, truth: Sequence[float], seed: int, settings: Mapping[str, Any]) -> Path:
        """Case file whose measured image has the hidden X and its own speckle."""
        synthetic = {"parameters": {"dyke": list(truth)}, "seed": seed, "warp_px": 0}
        return self._written(name, {"source": "synthetic", "synthetic": synthetic}, settings)

    def _written(self, name: str, measured: Mapping[str, Any], settings: Mapping[str, Any]) -> Path:
        published = read_case_file(_PUBLISHED)
        del published["measurement"]  # its keys depend on the source
        # benchmarks/registration.py measures the registration
        own = {"case": name, "measurement": measured, "registration": {"method": "none"}, **settings}
        path = self._folder / f"{name}.yaml"
        path.write_text(yaml.safe_dump(merged(published, own)))
        return path

    def runner(self, case: Case, runs: Path) -> Runner:
        """Runner of a case with a folder of runs."""
        settings = STAGES["reference_run"].of(case)
        return Runner(RunStore(runs), self.simulator, self.geometry, self.scene.identity, settings)

    def targets(self, case: Case, runner: Runner) -> Targets:
        """Targets of a case, made as the workflow makes them."""
        measurement = make_measurement(STAGES["measurement"].of(case), self.geometry, self.simulator, self.scene)
        reference = reference_runs(STAGES["reference_run"].of(case), [runner])[0][0].image_db
        assert reference is not None  # the reference run keeps its image
        registered, stage = register(reference, measurement, case.registration), STAGES["target"].of(case)
        misfit = objective_class(stage.objective).misfit
        return make_targets(stage, self.geometry, registered, reference, misfit, scene=self.scene)


def workflow_runs(path: Path) -> int:
    """Design and infill runs of a case of :class:`Bench` by the workflow, whose results lie below results/ here."""
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--configfile", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{path.stem}: {done.stderr}")
    runs = json.loads((ROOT / "results" / path.stem / "summary.json").read_text())["runs"]
    return int(runs["design"] + runs["infill"])
