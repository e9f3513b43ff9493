"""Number of runs with a baseline that does not match the simulator, against a search without a baseline.

    python benchmarks/other_baselines.py [--quick] [--objectives density,classes] [--truths 10]

The simulator applies ``mangia`` to the published dyke. In the case, the law of the dyke is ``mangia`` without a
baseline (``black_box``), or a formula of the same four parameters, whose curve is the baseline. ``other_family`` has
the form of Ulaby and Dobson's law (P5 = 1, P6 = 0), with the parameters in the roles that they have in ``mangia``. In
``other_roles``, three of the four parameters have other roles. ``unrelated`` varies with the parameters in another way
than the simulator. All searches start with the same design of 8 runs. Hidden X are drawn uniformly in the bounds.

With ``objective: density``, the measured image can be reached (``benchmarks/runs_to_tolerance.py``). With ``objective:
classes``, it has its own speckle, and ``target.priors`` is false, because the priors hold for the curve of the case's
law. The gap is the cost at the stop minus the lowest cost of the same target that is known: of all runs of the search,
of three more, of a run with the hidden X, and of the X that the other searches found. The black box of ``classes``
starts each search at X of the simulator's own law that fits the measured image, the others at X of a wrong law.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from classes_runs import continued, gaps, lowest
from dyke_cases import Bench, hidden_laws

from radcal.calibration.loop import calibrate
from radcal.calibration.scoring import score
from radcal.calibration.steps import all_parameters, run_all_draws
from radcal.config import Case, load
from radcal.config.stages import STAGES
from radcal.laws import LAWS
from radcal.objectives import make_objectives
from radcal.processes import one_thread
from radcal.simulators.runner import Runner
from radcal.targets.target import Targets

NAMES = ["X1", "X2", "X3", "X4"]
OTHER = "X1 + X2*cos(phi) + X3*exp(-X4*phi)"
OTHER_ROLES = "X1 + X2*exp(-X3*phi) + X4*cos(phi)"
UNRELATED = "20 + 10*sin(0.2*X1 + 0.3*X2) - 10*phi*cos(0.25*X3 - 0.15*X4)"
SEARCHES: dict[str, dict[str, Any]] = {
    "black_box": {"surrogate": {"baseline": False}},
    "other_family": {"materials": {"dyke": {"law": "formula", "formula": OTHER, "names": NAMES}}},
    "other_roles": {"materials": {"dyke": {"law": "formula", "formula": OTHER_ROLES, "names": NAMES}}},
    "unrelated": {"materials": {"dyke": {"law": "formula", "formula": UNRELATED, "names": NAMES}}},
}


def main() -> None:
    """Print a line per hidden X and search and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 hidden X")
    parser.add_argument("--objectives", default="density,classes", help="comma-separated objectives")
    parser.add_argument("--truths", type=int, default=10, help="number of hidden X")
    arguments = parser.parse_args()
    count = 2 if arguments.quick else arguments.truths
    found = {}
    with tempfile.TemporaryDirectory() as folder, one_thread():
        bench = Bench(Path(folder))
        for objective in arguments.objectives.split(","):
            print(f"{objective:36} {'search':12} {'ended':11} {'runs':>4} {'cost':>9} {'gap':>6} {'law error':>9}")
            rows = [
                searched(bench, objective, number, truth) for number, truth in enumerate(hidden_laws(count).tolist())
            ]
            found[objective] = {
                name: summary([row[name] for row in rows], [row["black_box"] for row in rows]) for name in SEARCHES
            }
    print(json.dumps(found))


def searched(bench: Bench, objective: str, number: int, truth: list[float]) -> dict[str, dict[str, Any]]:
    """Runs, end, cost, gap and law error of each search for one hidden X."""
    rows: dict[str, dict[str, Any]] = {}
    parts: dict[str, tuple[Case, Runner, Targets]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, settings in SEARCHES.items():
            case = case_of(bench, f"{objective}_{name}_{number}", objective, number, truth, settings)
            runner = bench.runner(case, Path(folder) / name)
            targets = bench.targets(case, runner)
            history, decision = calibrate(case, [runner], [targets])
            best = history.best("dyke")
            row = {
                "ended": str(decision.reason),
                "runs": history.count("design") + history.count("infill"),
                "cost": best.cost,
                "x": best.parameters,
                "law_error_db": LAWS["mangia"].largest_difference_db(
                    best.parameters, truth, targets["dyke"].incidence_deg
                ),
            }
            if objective != "density":
                row["lowest"] = lowest(continued(case, runner, targets, history))
            rows[name], parts[name] = row, (case, runner, targets)
        for name, row in rows.items():
            others = [truth, *(other["x"] for other in rows.values())] if objective != "density" else []
            known = [cost_at(*parts[name], x) for x in others]
            row["gap"] = row["cost"] - min([row["cost"], float(row.get("lowest", np.inf)), *known])
            print(
                f"{np.round(truth, 1)!s:36} {name:12} {row['ended']:11} {row['runs']:4d} {row['cost']:9.2e} "
                f"{row['gap']:6.3f} {row['law_error_db']:6.2f} dB",
                flush=True,
            )
    return rows


def case_of(
    bench: Bench, name: str, objective: str, number: int, truth: Sequence[float], settings: dict[str, Any]
) -> Case:
    """Case of one search, with a design of 8 runs."""
    settings = {"objective": objective, "design": {"size": 8}, **settings}
    if objective == "density":
        return load([bench.reachable(name, truth, settings)])
    return load([bench.speckled(name, truth, 100 + number, {"target": {"priors": False}, **settings})])


def cost_at(case: Case, runner: Runner, targets: Targets, x: Sequence[float]) -> float:
    """Cost of a run with the given X of the dyke."""
    parameters = all_parameters(case.materials, {"dyke": list(x)})
    records = run_all_draws(STAGES["verify"].of(case), [runner], parameters)
    objectives = make_objectives(STAGES["scores"].of(case), [targets])
    return score("infill", 0, records, parameters, [targets], objectives, case.seed).scores["dyke"].cost


def summary(rows: list[dict[str, Any]], black_box: list[dict[str, Any]]) -> dict[str, Any]:
    """Mean, median and largest number of runs, ratio of means, ends, gaps and law errors."""
    runs = [row["runs"] for row in rows]
    reasons = [row["ended"] for row in rows]
    return {
        "n": len(rows),
        "mean": float(np.mean(runs)),
        "ratio": float(np.mean(runs) / np.mean([row["runs"] for row in black_box])),
        "median": float(np.median(runs)),
        "worst": max(runs),
        "ended": {reason: reasons.count(reason) for reason in sorted(set(reasons))},
        "gaps": gaps([row["gap"] for row in rows]),
        "law_error_db": {
            "median": float(np.median([row["law_error_db"] for row in rows])),
            "worst": max(row["law_error_db"] for row in rows),
        },
    }


if __name__ == "__main__":
    main()
