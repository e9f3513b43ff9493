"""Number of simulator runs until the densities agree, by radcal and by other optimisers, for the published dyke.

    python benchmarks/runs_to_tolerance.py [--quick] [--methods radcal,cma_es] [--targets reachable,speckled]
        [--truths 20] [--first 0] [--results FILE] [--figure FILE]

Hidden X are drawn uniformly in the bounds. Of a ``reachable`` target, the measured image is the run with the hidden X
and with the speckle of all runs, so that an X with rms 0 exists; of a ``speckled`` one, the image has its own speckle,
and the rms may not get below the tolerance. Runs of the design and of the search count, the reference run does not.
The tolerance of 1e-5 per dB is read as a bound on the rms, and on the mean square.

Every finished search is one line of ``--results`` and is not made again, so that a killed program, typed again,
continues. The table holds all searches of the file. Other optimisers (``benchmarks/peers.py``) need the extra
``peers``. ``--figure`` draws the share of targets within the tolerance against the number of runs.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from peers import PEERS
from searches import READINGS, Results, Row, calibrated, quartiles, runs_to

RADCAL: dict[str, dict[str, Any]] = {
    "radcal": {},
    "radcal_2": {"infill": {"batch": 2}},
    "radcal_black_box": {"surrogate": {"baseline": False}},
    "radcal_black_box_2": {"surrogate": {"baseline": False}, "infill": {"batch": 2}},
    "paper": {
        "design": {"sampler": "monte_carlo", "size": 800},
        "surrogate": {"outputs": "direct", "training": "smt"},
        "optimiser": {"objective": "rms", "population": 100, "evaluations": 10000, "polish": False},
        "stop": {"max_runs": 1200, "stagnation_runs": 400},
    },
}
ITERATIONS = {
    "radcal": (0, 1),
    "radcal_2": (0, 2),
    "radcal_black_box": (8, 1),
    "radcal_black_box_2": (8, 2),
    "paper": (800, 1),
}
"""Runs of the design, which are all made before the search, and of each iteration, which are made together."""
TARGETS = ("reachable", "speckled")
_STYLES = {
    "radcal": "C0-",
    "radcal_2": "C0:",
    "radcal_black_box": "C1-",
    "radcal_black_box_2": "C1:",
    "paper": "k--",
    "cma_es": "C2-",
    "levenberg_marquardt": "C3-",
    "trf": "C3--",
    "dogbox": "C3:",
    "pestpp_glm": "C4-",
    "optuna": "C5-",
    "optuna_gp": "C5:",
    "ego": "C6-",
    "botorch": "C9-",
    "sbi": "C8-",
}
_HEADS = (
    *("reached, rms", "median (most of those reached)"),
    *("reached, mean square", "median (most of those reached)"),
    *("iterations, rms, median", "lowest rms, median (largest)", "own CPU time [s]"),
)


def main() -> None:
    """Print a line per search, then a table and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 reachable targets, and a results file of their own")
    parser.add_argument(
        "--methods",
        default="radcal,radcal_black_box",
        help="comma-separated, of: " + ", ".join([*RADCAL, *PEERS]),
    )
    parser.add_argument("--targets", default=",".join(TARGETS), help="comma-separated, of: " + ", ".join(TARGETS))
    parser.add_argument("--truths", type=int, default=20, help="number of hidden X")
    parser.add_argument("--first", type=int, default=0, help="number of the first hidden X")
    parser.add_argument("--results", type=Path, help="file of finished searches, results/runs_to_tolerance.jsonl")
    parser.add_argument("--figure", type=Path, help="file of the figure")
    arguments = parser.parse_args()
    methods, targets, count = arguments.methods.split(","), arguments.targets.split(","), arguments.truths
    first = arguments.first
    if unknown := {*methods, *targets} - {*RADCAL, *PEERS, *TARGETS}:
        parser.error(f"unknown method or target {unknown.pop()!r}, see --help")
    path = arguments.results or Path("results/runs_to_tolerance.jsonl")
    if arguments.quick:
        path, targets, count = path.with_stem(path.stem + "_quick"), ["reachable"], 2

    with tempfile.TemporaryDirectory() as cases:
        results = Results(path, Path(cases))
        for number in range(first, first + count):
            for target in targets:
                for method in methods:
                    searched(results, method, target, number)
    known = [method for method in (*RADCAL, *PEERS) if results.of({"method": method})]
    if arguments.figure:
        drawn(results, known, arguments.figure)
    print(json.dumps(tables(results, known)))


def searched(results: Results, method: str, target: str, number: int) -> None:
    """Search for one target by one method, unless the results hold it."""
    keys = {"method": method, "target": target, "number": number}
    if method in RADCAL:
        search = partial(calibrated, published=method == "paper")
        results.search(keys, search, settings=RADCAL[method])
    else:
        peer = PEERS[method]
        results.search(keys, peer.search, settings={}, most=peer.most, most_s=peer.most_s)


def tables(results: Results, methods: Sequence[str]) -> dict[str, Any]:
    """Print a table for each kind of target; return figures of each method.

    Of reachable targets, the rms is read first: ``success``, ``n``, ``median`` and ``worst`` of the runs. In the
    median, a target that was not reached counts as more runs than any other; ``worst`` is of those reached.
    """
    found: dict[str, Any] = {method: {} for method in methods}
    for target in (target for target in TARGETS if results.of({"target": target})):
        heads = (target, *_HEADS)
        print(f"\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
        for method in methods:
            rows = results.of({"method": method, "target": target})
            if not rows:
                continue
            one = {reading: of_reading(rows, method, rms) for reading, rms in READINGS.items()}
            lowest = [row["best"][-1][1] for row in rows]
            own_s = float(np.median([row["own_s"] for row in rows]))
            cells = [cell for read in one.values() for cell in (f"{read['success']} of {read['n']}", in_words(read))]
            spread = f"{np.median(lowest):.1e} ({max(lowest):.1e})"
            iterations = iterations_to(rows, method)
            cells.append("-" if iterations is None else f"{iterations:g}")
            print(f"| `{method}` | {' | '.join(cells)} | {spread} | {own_s:.3g} |")
            mine = {**one["rms"], "mean_square": one["mean_square"], "own_s": own_s, "lowest_rms": max(lowest)}
            mine["iterations"] = iterations
            found[method].update(mine if target == "reachable" else {target: mine})
    return found


def made_to(row: Row, method: str, rms: float) -> float:
    """Number of runs made until the rms was within a bound: all of the design, and all of the last iteration."""
    runs, (design, batch) = runs_to(row, rms), ITERATIONS.get(method, (0, 1))
    return design + batch * np.ceil(max(runs - design, 0) / batch)


def of_reading(rows: Sequence[Row], method: str, rms: float) -> dict[str, Any]:
    """Number of searches that came within an rms, and the median and largest number of runs made until then."""
    runs = [made_to(row, method, rms) for row in rows]
    reached = [one for one in runs if np.isfinite(one)]
    return {"success": len(reached), "n": len(runs), "median": quartiles(runs)[1], "worst": max(reached, default=None)}


def iterations_to(rows: Sequence[Row], method: str) -> float | None:
    """Median number of iterations until the tolerance, read as a bound on the rms; None where they are not counted."""
    if method not in ITERATIONS:
        return None
    design, batch = ITERATIONS[method]
    return quartiles(np.ceil((runs_to(row, READINGS["rms"]) - design) / batch) for row in rows)[1]


def in_words(read: Row) -> str:
    """Median and largest number of runs."""
    if not read["success"]:
        return "-"
    median = "not reached" if read["median"] is None else f"{read['median']:g}"
    return f"{median} ({read['worst']:g})"


def drawn(results: Results, methods: Sequence[str], path: Path) -> None:
    """Draw the share of reachable targets within each reading of the tolerance against the number of runs.

    A dot marks the end of the longest search of a method.
    """
    figure, axes = plt.subplots(1, len(READINGS), figsize=(11, 4.2), sharey=True, layout="constrained")
    for axis, (reading, rms) in zip(axes, READINGS.items(), strict=True):
        for method in methods:
            rows = results.of({"method": method, "target": "reachable"})
            runs = sorted(made_to(row, method, rms) for row in rows)
            reached = [one for one in runs if np.isfinite(one)]
            share = np.arange(1, len(reached) + 1) / max(len(runs), 1)
            last = max((row["runs"] for row in rows), default=1)
            steps = [1.0, *reached, max(last, *reached, 1)], [0.0, *share, share[-1] if reached else 0.0]
            style = {"linewidth": 2.5 if method in RADCAL else 1.5, "marker": "o", "markevery": [-1], "markersize": 4}
            axis.step(*steps, _STYLES[method], where="post", label=f"{method} ({len(runs)})", **style)
        axis.set(xscale="log", xlabel="runs", title=f"{reading.replace('_', ' ')} of at most 1e-5", ylim=(-0.02, 1.02))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of targets")
    axes[-1].legend(fontsize=8, title="method (targets)", loc="center left", bbox_to_anchor=(1.0, 0.5))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
