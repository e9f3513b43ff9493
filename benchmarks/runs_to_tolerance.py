"""Number of simulator runs until the densities agree, for random reachable targets of the published dyke.

    python benchmarks/runs_to_tolerance.py [--quick] [--methods radcal]

Each target is the density of the simulator's pixels at a hidden X*, which is drawn uniformly in the bounds, so that the
target can be reached. The result is the number of design and infill runs until the density rms is below 1e-5 per dB.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from radcal import skewnormal
from radcal.calibration.loop import calibrate
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.config import Case, load
from radcal.measurement.sources import make_measurement
from radcal.measurement.target import Targets
from radcal.measurement.target_fit import make_target
from radcal.radar.projection import make_geometry
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

PUBLISHED = Path(__file__).resolve().parents[1] / "config/dyke_published.yaml"
METHODS: dict[str, dict[str, Any]] = {
    "radcal": {"design": {"size": 0}},  # the fewest runs
    "radcal_default": {},
    "radcal_black_box": {"surrogate": {"baseline": False}},
    "radcal_black_box_smt": {"surrogate": {"baseline": False, "training": "smt"}},
}


def main() -> None:
    """Print a line per target and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 targets in place of 20")
    parser.add_argument(
        "--methods", default="radcal,radcal_default,radcal_black_box", help="comma-separated, of: " + ", ".join(METHODS)
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.methods.split(",")) - set(METHODS):
        parser.error(f"unknown method {unknown.pop()!r}, expected some of {', '.join(METHODS)}")

    methods = arguments.methods.split(",")
    print(json.dumps({method: measured(method, 2 if arguments.quick else 20) for method in methods}))


def measured(method: str, count: int) -> dict[str, Any]:
    """Runs that one method needs for each target."""
    # no misregistration: benchmarks/registration.py measures its correction
    settings = {
        "objective": "density",
        "measurement": {"source": "synthetic", "synthetic": {"warp_px": 0}},
    }
    case: Case = load([PUBLISHED], {**settings, **METHODS[method]})
    scene = make_scene(case.scene, list(case.materials))
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, {name: m.law for name, m in case.materials.items()})
    image = make_measurement(case, geometry, simulator)
    target = dataclasses.replace(
        make_target("dyke", geometry, image, case.target, case.seed),
        noise_db=float(case.radar.nesz_db),
    )
    low, high = np.array(case.materials["dyke"].box).T
    truths = low + derived_rng(case.seed, "benchmark", "truths").random((count, len(low))) * (high - low)
    used = []
    print(f"{method}, {case.design_size} runs of the design")
    print(f"{'hidden X':40} {'ended':12} {'runs':>5} {'rms':>9}")
    for truth in truths:
        with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
            runner = Runner(RunStore(Path(folder)), simulator, geometry, scene.identity, case)
            hidden = runner.run(all_parameters(case.materials, {"dyke": truth.tolist()}), noise_seed(case))
            dp = skewnormal.fit(hidden.pixels_db["dyke"][target.order]).dp
            history, decision = calibrate(case, runner, Targets({"dyke": dataclasses.replace(target, dp=dp)}))
        runs, rms = history.count("design") + history.count("infill"), history.best("dyke").scores["dyke"].rms
        used.append(runs if decision.converged else None)
        print(f"{np.round(truth, 1)!s:40} {decision.reason:12} {runs:5d} {rms:9.1e}", flush=True)
    reached = [runs for runs in used if runs is not None]
    return {
        "success": len(reached),
        "n": len(used),
        "median": float(np.median(reached)) if reached else None,
        "worst": max(reached, default=None),
    }


if __name__ == "__main__":
    main()
