"""Error of the law over the incidence of two passes, after calibration on one pass, or on both together.

    python benchmarks/passes.py [--quick] [--truths 10]

The passes have depression angles of 45 and 30 degrees; the single pass is that at 45 degrees. Each hidden law is drawn
uniformly in the bounds of the published dyke (config/dyke_published.yaml). The measured images have independent speckle
and no misregistration (``benchmarks/registration.py`` tests registration). The error of a law is the largest difference
[dB] between found and hidden law over the incidence of the material's pixels.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from radcal.calibration.loop import calibrate
from radcal.calibration.stopping import Decision
from radcal.config import Case, load
from radcal.config.stages import STAGES
from radcal.config.yaml_file import read_case_file
from radcal.measurement.sources import make_measurement
from radcal.objectives import objective_class
from radcal.objectives.history import History
from radcal.processes import one_thread
from radcal.radar.geometry import Geometry
from radcal.radar.projection import make_geometry
from radcal.registration.registered import Registered, register
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets
from radcal.targets.target_fit import make_targets

PUBLISHED = Path(__file__).resolve().parents[1] / "config/dyke_published.yaml"
DEPRESSIONS = (45.0, 30.0)


def main() -> None:
    """Print a line per truth and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 truths in place of 10")
    parser.add_argument("--truths", type=int, default=10, help="number of truths")
    arguments = parser.parse_args()
    count = 2 if arguments.quick else arguments.truths
    base = case_of([6.1, 14.2, 21.5, 3.3], 0, DEPRESSIONS[:1])
    scene = make_scene(base.scene, list(base.materials))
    geometries = [make_geometry(scene, one.radar) for one in case_of([6.1, 14.2, 21.5, 3.3], 0, DEPRESSIONS).passes]
    low, high = np.array(base.materials["dyke"].box).T
    truths = low + derived_rng(base.seed, "benchmark", "truths").random((count, len(low))) * (high - low)
    found: dict[str, list[dict[str, Any]]] = {"one": [], "both": []}
    print(f"{'hidden X':30} {'passes':>6} {'runs of X':>9} {'ended':>10} {'error at 45':>11} {'at 30':>6} {'both':>6}")
    for number, truth in enumerate(truths):
        for name, depressions in (("one", DEPRESSIONS[:1]), ("both", DEPRESSIONS)):
            with one_thread():
                row = calibrated(case_of(truth.tolist(), number, depressions), scene, geometries, truth)
            found[name].append(row)
            print(
                f"{np.round(truth, 1)!s:30} {len(depressions):6d} {row['runs']:9d} {row['ended']:>10} "
                f"{row['errors'][0]:11.2f} {row['errors'][1]:6.2f} {max(row['errors']):6.2f}",
                flush=True,
            )
    print(json.dumps({name: summary(rows) for name, rows in found.items()}))


def case_of(truth: list[float], number: int, depressions: tuple[float, ...]) -> Case:
    """Published dyke with a hidden law and passes of these depression angles [deg]."""
    images = [
        {"synthetic": {"parameters": {"dyke": truth}, "seed": 100 + 10 * number + k, "warp_px": 0}}
        for k in range(len(depressions))
    ]
    published = read_case_file(PUBLISHED)
    return load(
        [PUBLISHED],
        {
            # with the area term, which differs between the passes
            "radar": [
                {**published["radar"], "radiometry": "sigma0_ref", "depression_deg": angle} for angle in depressions
            ],
            "measurement": images,
            "registration": {"method": "none"},
        },
    )


def calibrated_passes(
    case: Case, scene: Scene, geometries: list[Geometry], folder: Path
) -> tuple[list[Targets], History, Decision, list[Registered]]:
    """Calibration of a case of one or several passes, with their runs in a folder, and their registered images."""
    runners: list[Runner] = []
    targets: list[Targets] = []
    images: list[Registered] = []
    for one, geometry in zip(case.passes, geometries, strict=False):
        simulator = BuiltinSimulator(geometry, one.radar, one.laws)
        settings, stage = STAGES["reference_run"].of(one), STAGES["target"].of(one)
        runners.append(Runner(RunStore(folder), simulator, geometry, scene.identity, settings))
        measurement = make_measurement(STAGES["measurement"].of(one), geometry, simulator, scene)
        start = simulator.run({name: m.start_parameters for name, m in one.materials.items()}, 1)
        registered = register(start, measurement, one.registration)
        images.append(registered)
        misfit = objective_class(stage.objective).misfit
        targets.append(make_targets(stage, geometry, registered, start, misfit, scene=scene))
    return targets, *calibrate(case, runners, targets), images


def calibrated(case: Case, scene: Scene, geometries: list[Geometry], truth: np.ndarray) -> dict[str, Any]:
    """Runs, end, and error of the law over the incidence of each pass [dB]."""
    with tempfile.TemporaryDirectory() as folder:
        _, history, decision, _ = calibrated_passes(case, scene, geometries, Path(folder))
    incidence = [geometry.incidence_deg.ravel()[geometry.pixels("dyke")].astype(np.float64) for geometry in geometries]
    x = history.best("dyke").parameters
    law = case.laws["dyke"]
    return {
        "runs": history.count("design") + history.count("infill"),
        "ended": str(decision.reason),
        "errors": [law.largest_difference_db(x, truth, angles) for angles in incidence],
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Median and worst error [dB] over each pass and both, and the median number of runs of X."""
    errors = np.array([row["errors"] for row in rows])
    each = {"45": errors[:, 0], "30": errors[:, 1], "both": errors.max(axis=1)}
    return {
        "n": len(rows),
        "median_runs": float(np.median([row["runs"] for row in rows])),
        "error_db": {name: {"median": float(np.median(v)), "worst": float(v.max())} for name, v in each.items()},
    }


if __name__ == "__main__":
    main()
