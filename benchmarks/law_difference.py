"""Error of the law found, and number of runs, for the published dyke with several measured images.

    python benchmarks/law_difference.py [--quick] [--objectives density,classes] [--design 2,2]

Each measured image is made from the same hidden law with speckle and noise of its own, and needs no registration. The
table gives the largest difference [dB] between hidden and found law over the incidence seen (5-95 %). A matched density
does not limit the difference of the laws. The table also tells whether the law is reported as identified, and gives the
number of design and infill runs.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from radcal.calibration.loop import calibrate
from radcal.config import load
from radcal.laws import LAWS
from radcal.measurement.sources import make_measurement
from radcal.objectives import OBJECTIVES
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.sources import make_scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets

PUBLISHED = Path(__file__).resolve().parents[1] / "config/dyke_published.yaml"


def main() -> None:
    """Print a line per measurement and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 measurements in place of 10")
    parser.add_argument("--objectives", default="density,classes", help="which, with commas")
    parser.add_argument("--design", default="2,2", help="size of the design of each")
    arguments = parser.parse_args()
    seeds = range(1, 3 if arguments.quick else 11)

    default = load([PUBLISHED])
    scene = make_scene(default.scene, list(default.materials))
    geometry = make_geometry(scene, default.radar)
    simulator = BuiltinSimulator(geometry, default.radar, {name: m.law for name, m in default.materials.items()})
    result: dict[str, Any] = {}
    print(f"{'objective':10} {'seed':>4} {'ended':12} {'runs':>5} {'rms':>9} {'law differs by':>15}  looks")
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        runner = Runner(RunStore(Path(folder)), simulator, geometry, scene.identity, default)
        for objective, size in zip(arguments.objectives.split(","), arguments.design.split(","), strict=True):
            rows = []
            for seed in seeds:
                synthetic = default.measurement.synthetic.model_copy(update={"seed": seed, "warp_px": 0.0})
                case = default.model_copy(
                    update={
                        "measurement": default.measurement.model_copy(update={"synthetic": synthetic}),
                        "objective": objective,
                        "registration": default.registration.model_copy(update={"method": "none"}),
                        "design": default.design.model_copy(update={"size": int(size)}),
                    }
                )
                measurement = make_measurement(case, geometry, simulator)
                registered = register(measurement.image_db, measurement, case.registration)
                targets = make_targets(case, geometry, registered, measurement.image_db, OBJECTIVES[objective].misfit)
                history, decision = calibrate(case, runner, targets)
                best, hidden = history.best("dyke"), measurement.hidden["dyke"]
                difference = LAWS["mangia"].largest_difference_db(
                    best.parameters, hidden, targets["dyke"].incidence_deg
                )
                runs = history.count("design") + history.count("infill")
                rows.append((difference, runs, decision.converged))
                print(
                    f"{objective:10} {seed:4d} {decision.reason:12} {runs:5d} {best.rms:9.1e} "
                    f"{difference:12.2f} dB  {best.looks:.2f}",
                    flush=True,
                )
            errors, runs_used, converged = (np.array(column) for column in zip(*rows, strict=True))
            result[objective] = {
                "n": len(rows),
                "median": float(np.median(errors)),
                "worst": float(errors.max()),
                "runs_median": float(np.median(runs_used)),
                "runs_worst": int(runs_used.max()),
                "converged": int(converged.sum()),
            }
    print(json.dumps({"law_difference_db": result}))


if __name__ == "__main__":
    main()
