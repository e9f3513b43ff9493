"""Number of simulator runs until the densities agree, for random reachable targets of the published dyke.

    python benchmarks/runs_to_tolerance.py [--quick] [--methods radcal] [--workflow 5] [--cases FOLDER]

Each measured image is the simulator's run with a hidden X, which is drawn uniformly in the bounds, and with the speckle
of all runs, so that the target can be reached. The result is the number of design and infill runs until the density rms
is below 1e-5 per dB. The calibrations run in this process.

The first targets (``--workflow``) are also calibrated by the workflow, from the same case file, whose results lie in
results/<case> of this project. ``--cases`` keeps case files and images, for ``snakemake --configfile``.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from dyke_cases import Bench, hidden_laws, workflow_runs
from threadpoolctl import threadpool_limits

from radcal.calibration.loop import calibrate
from radcal.config import load

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
    parser.add_argument("--workflow", type=int, default=0, help="number of targets that the workflow calibrates, too")
    parser.add_argument("--cases", type=Path, help="folder for case files and images; by default a temporary one")
    arguments = parser.parse_args()
    methods = arguments.methods.split(",")
    if unknown := set(methods) - set(METHODS):
        parser.error(f"unknown method {unknown.pop()!r}, expected some of {', '.join(METHODS)}")

    with tempfile.TemporaryDirectory() as folder:
        cases = arguments.cases or Path(folder)
        cases.mkdir(parents=True, exist_ok=True)
        bench, count = Bench(cases), 2 if arguments.quick else 20
        found = {method: measured(bench, method, count, arguments.workflow) for method in methods}
    print(json.dumps(found))


def measured(bench: Bench, method: str, count: int, workflow: int) -> dict[str, Any]:
    """Runs that one method needs for each target, and the number of targets for which the workflow needs as many."""
    used, same = [], []
    print(f"{method}\n{'hidden X':40} {'ended':12} {'runs':>5} {'rms':>9} {'workflow':>9}")
    for number, truth in enumerate(hidden_laws(count).tolist()):
        path = bench.reachable(f"{method}_{number}", truth, {"objective": "density", **METHODS[method]})
        case = load([path])
        with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
            runner = bench.runner(case, Path(folder))
            history, decision = calibrate(case, runner, bench.targets(case, runner))
        runs, rms = history.count("design") + history.count("infill"), history.best("dyke").rms
        used.append(runs if decision.converged else None)
        again = workflow_runs(path) if number < workflow else None
        same += [] if again is None else [again == runs]
        line = f"{np.round(truth, 1)!s:40} {decision.reason:12} {runs:5d} {rms:9.1e}"
        print(line if again is None else f"{line} {again:9d}", flush=True)
    reached = [runs for runs in used if runs is not None]
    return {
        "success": len(reached),
        "n": len(used),
        "median": float(np.median(reached)) if reached else None,
        "worst": max(reached, default=None),
        "workflow": {"n": len(same), "same": sum(same)},
    }


if __name__ == "__main__":
    main()
