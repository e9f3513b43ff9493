"""Number of simulator runs until the densities agree, for random reachable targets of the default case.

    python benchmarks/runs_to_tolerance.py [--quick] [--methods radcal]

Each target is the density theta(X*) of the simulator at a hidden X*, uniform in the bounds, so that at least one X
reaches it. The result is the number of design and infill runs until rms < 1e-5 per dB.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import tempfile
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from radcal import skewnormal
from radcal.calibration.loop import calibrate
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.config import Case, case_from
from radcal.measurement.sources import make_measurement
from radcal.measurement.target_fit import make_target
from radcal.radar.projection import make_geometry
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

METHODS = ("radcal",)


def main() -> None:
    """Print a line per target and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 targets in place of 10")
    parser.add_argument("--methods", default="radcal", help="comma-separated, of: " + ", ".join(METHODS))
    arguments = parser.parse_args()
    if unknown := set(arguments.methods.split(",")) - set(METHODS):
        parser.error(f"unknown method {unknown.pop()!r}, expected some of {', '.join(METHODS)}")

    # no misregistration: benchmarks/registration.py measures its correction
    case: Case = case_from(
        {
            "radar": {"radiometry": "sigma0_local"},
            "objective": "density",
            "measurement": {"source": "synthetic", "synthetic": {"warp_px": 0}},
        }
    )
    scene = make_scene(case.scene, list(case.materials))
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, {name: m.law for name, m in case.materials.items()})
    target = make_target("dyke", geometry, make_measurement(case, geometry, simulator), case.target, case.seed)
    low, high = np.array(case.materials["dyke"].box).T
    unit = derived_rng(case.seed, "benchmark", "truths").random((2 if arguments.quick else 10, len(low)))
    truths = low + unit * (high - low)
    used = []
    print(f"{'hidden X':40} {'ended':12} {'runs':>5} {'rms':>9}")
    for truth in truths:
        with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
            runner = Runner(RunStore(Path(folder)), simulator, geometry, scene.identity, case)
            hidden = runner.run(all_parameters(case.materials, {"dyke": truth.tolist()}), noise_seed(case))
            dp = skewnormal.fit(hidden.pixels_db["dyke"][target.order]).dp
            history, decision = calibrate(case, runner, {"dyke": dataclasses.replace(target, dp=dp)})
        runs = history.count("design") + history.count("infill")
        used.append(runs if decision.converged else None)
        print(
            f"{np.round(truth, 1)!s:40} {decision.reason:12} {runs:5d} {history.best('dyke').rms['dyke']:9.1e}",
            flush=True,
        )
    reached = [runs for runs in used if runs is not None]
    result = {
        "success": len(reached),
        "n": len(used),
        "median": float(np.median(reached)) if reached else None,
        "worst": max(reached, default=None),
    }
    print(json.dumps({"radcal": result}))


if __name__ == "__main__":
    main()
