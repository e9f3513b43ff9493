"""Number of runs until the densities agree against the size of the initial design, for the published dyke.

    python benchmarks/design_size.py [--quick] [--searches baseline,black_box,published] [--sizes 0,2,4]
        [--truths 20] [--results FILE] [--figure FILE]

The targets are the reachable ones of ``benchmarks/runs_to_tolerance.py``. ``published`` has the settings of the
published method: Monte Carlo points, kriging of (xi, omega, alpha) by smt, NSGA-II on the rms, no polish; its length
scales are estimated again every 20 runs. Each search ends at 400 runs (published, with 800 points: 1,200). A search
that did not reach the tolerance counts as more runs than any that did; the largest of their lowest rms stands beside
it. Finished searches are kept in ``--results`` as by ``benchmarks/runs_to_tolerance.py``.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from runs_to_tolerance import RADCAL
from searches import READINGS, Results, Row, calibrated, quartiles, runs_to

MOST = 400
SEARCHES: dict[str, tuple[dict[str, Any], tuple[int, ...], int]] = {
    "baseline": (RADCAL["radcal"], (0, 2, 4, 8, 16, 32, 64, 128, 256), 20),
    "black_box": (RADCAL["radcal_black_box"], (4, 8, 16, 32, 64, 128, 256), 20),
    "published": (RADCAL["paper"], (8, 32, 128, 256, 800), 5),
}


def main() -> None:
    """Print a line per search, then a table and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 hidden X, sizes 0, 4 and 16, a results file of its own")
    parser.add_argument("--searches", default="baseline,black_box", help="comma-separated, of: " + ", ".join(SEARCHES))
    parser.add_argument("--sizes", help="comma-separated sizes, instead of all")
    parser.add_argument("--truths", type=int, default=20, help="largest number of hidden X")
    parser.add_argument("--results", type=Path, default=Path("results/design_size.jsonl"))
    parser.add_argument("--figure", type=Path, help="file of the figure")
    arguments = parser.parse_args()
    names, path, truths = arguments.searches.split(","), arguments.results, arguments.truths
    sizes = None if arguments.sizes is None else {int(size) for size in arguments.sizes.split(",")}
    if unknown := set(names) - set(SEARCHES):
        parser.error(f"unknown search {unknown.pop()!r}, expected some of {', '.join(SEARCHES)}")
    if arguments.quick:
        path, truths, sizes = path.with_stem(path.stem + "_quick"), 2, sizes or {0, 4, 16}

    with tempfile.TemporaryDirectory() as cases:
        results = Results(path, Path(cases))
        for number in range(truths):
            for name in names:
                _, all_sizes, most_truths = SEARCHES[name]
                for size in all_sizes:
                    if (sizes is None or size in sizes) and number < (3 if size == 800 else most_truths):
                        searched(results, name, size, number)
    found = {name: table(results, name) for name in SEARCHES if results.of({"method": name})}
    if arguments.figure:
        drawn(found, arguments.figure)
    print(json.dumps(found))


def searched(results: Results, name: str, size: int, number: int) -> None:
    """Search with one size of the design for one target, unless the results hold it."""
    settings, _, _ = SEARCHES[name]
    stop = {"max_runs": max(MOST, 3 * size // 2), "stagnation_runs": MOST}
    keys = {"method": name, "target": "reachable", "number": number, "size": size}
    own = {**settings, "design": {**settings.get("design", {}), "size": size}, "stop": stop}
    results.search(keys, partial(calibrated, published=name == "published"), settings=own)


def table(results: Results, name: str) -> Sequence[Row]:
    """Print and return quartiles of the runs for each size of the design."""
    heads = (f"{name}: design", "reached", "quartiles of the runs", "most", "lowest rms of the others")
    print(f"\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    found: list[Row] = []
    for size in SEARCHES[name][1]:
        if not (rows := results.of({"method": name, "size": size})):
            continue
        runs = [runs_to(row, READINGS["rms"]) for row in rows]
        reached = [one for one in runs if np.isfinite(one)]
        others = [row["best"][-1][1] for row, one in zip(rows, runs, strict=True) if not np.isfinite(one)]
        most, lowest = max(reached, default=None), max(others, default=None)
        found.append(
            {"size": size, "n": len(runs), "success": len(reached), "quartiles": quartiles(runs), "worst": most}
        )
        low, middle, high = (f"{one:g}" if one is not None else "not reached" for one in found[-1]["quartiles"])
        last = "-" if lowest is None else f"{lowest:.1e}"
        print(f"| {size} | {len(reached)} of {len(runs)} | {low}, {middle}, {high} | {most or 0:g} | {last} |")
    return found


def drawn(found: Mapping[str, Sequence[Row]], path: Path) -> None:
    """Draw median and quartiles of the runs against the size of the design."""
    figure, axis = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for name, rows in found.items():
        sizes = [row["size"] for row in rows]
        low, middle, high = np.array([row["quartiles"] for row in rows], dtype=float).T  # None is drawn as a gap
        spread = np.array([middle - low, high - middle])
        label = f"{name.replace('_', ' ')} ({max(row['n'] for row in rows)} targets)"
        axis.errorbar(sizes, middle, spread, marker="o", capsize=4, label=label)
    alone = np.geomspace(2, max(row["size"] for rows in found.values() for row in rows))  # the axis is linear below 2
    axis.plot(alone, alone, "k:", linewidth=1, label="runs of the design alone")
    axis.set(
        xlabel="runs of the design", ylabel="runs to an rms of 1e-5", xscale="symlog", yscale="log", ylim=(1, None)
    )
    axis.legend()
    axis.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
