"""How far the law found is from the hidden one when the densities agree: the default case, many measurements.

    python benchmarks/law_difference.py [--quick]

Each measurement is the default hidden law with its own speckle and noise, in place. Reported: the largest
difference [dB] of the two laws over the incidence seen (5-95 %), which a matched density does not bound.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from radcal.calibration.loop import calibrate
from radcal.config import Case, load
from radcal.measurement.sources import make_measurement
from radcal.measurement.target import Targets, make_target
from radcal.radar.geometry import make_geometry
from radcal.radar.laws import LAWS
from radcal.report.summary import law_difference_db
from radcal.scene.sources import make_scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.store import Runner, RunStore


def main() -> None:
    """Print a line per measurement and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 measurements in place of 10")
    seeds = range(1, 3 if parser.parse_args().quick else 11)

    default: Case = load([])
    scene = make_scene(default.scene, list(default.materials))
    geometry = make_geometry(scene, default.radar)
    simulator = BuiltinSimulator(geometry, default.radar, {name: m.law for name, m in default.materials.items()})
    differences = []
    print(f"{'measurement seed':>16} {'ended':12} {'runs':>5} {'rms':>9} {'law differs by':>15}")
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        runner = Runner(RunStore(Path(folder)), simulator, geometry, scene.identity, default)
        for seed in seeds:
            synthetic = default.measurement.synthetic.model_copy(update={"seed": seed, "warp_px": 0.0})
            case = default.model_copy(
                update={"measurement": default.measurement.model_copy(update={"synthetic": synthetic})}
            )
            measurement = make_measurement(case, geometry, simulator)
            target = make_target("dyke", geometry, measurement, case.target, case.seed)
            history, decision = calibrate(case, runner, Targets({"dyke": target}))
            best = history.best("dyke")
            hidden = measurement.hidden["dyke"]
            differences.append(law_difference_db(LAWS["mangia"], best.parameters["dyke"], hidden, target.incidence_deg))
            runs = history.count("design") + history.count("infill")
            print(
                f"{seed:16d} {decision.reason:12} {runs:5d} {best.rms['dyke']:9.1e} {differences[-1]:12.2f} dB",
                flush=True,
            )
    result = {"n": len(differences), "median": float(np.median(differences)), "worst": max(differences)}
    print(json.dumps({"law_difference_db": result}))


if __name__ == "__main__":
    main()
