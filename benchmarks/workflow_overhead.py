"""Overhead of the workflow: time of planning, time per run, memory, and speedup by a second core.

    python benchmarks/workflow_overhead.py [--quick]

The benchmark prints four tables, all for a small case (96 x 80 pixels), the first three for its design:

1. time of planning (dry runs) for designs of growing size with four runs per job, and peak memory of Snakemake
2. time and memory for runs of radcal's own simulator, which take some milliseconds each, with a hundred runs per job
3. time of a design of 8 runs of an external program that sleeps 60 s (6 s with ``--quick``), on one core and on two
   cores, and time per run beyond the sleep
4. CPU time of Snakemake itself for an iteration of a search of 300 iterations (60 with ``--quick``), whose jobs copy
   files of a finished search

The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from workflow_project import Project, make_project

from radcal.objectives.history import read_runs, write_runs
from radcal.storage.records import provenance

SLEEPER = """\
import json, sys, time
from pathlib import Path
import numpy as np
task = json.loads(Path("input.json").read_text())
rng = np.random.default_rng(task["noise_seed"] % 2**32)
level = sum(task["parameters"]["field"].values())
time.sleep(float(sys.argv[1]))
np.save("image.npy", (level + 4.0 * rng.standard_normal(task["shape"])).astype(np.float32))
"""


def timed(project: Project, *arguments: str, cores: int) -> tuple[float, float]:
    """Wall time [s] and peak memory of Snakemake's own process [MiB]."""
    started, peak = time.perf_counter(), 0
    process = project.start(*arguments, cores=cores)
    watched = psutil.Process(process.pid)
    while process.poll() is None:
        try:
            peak = max(peak, watched.memory_info().rss)
        except psutil.NoSuchProcess:
            break
        time.sleep(0.05)
    if process.wait() != 0:
        sys.exit(f"{' '.join(arguments)} failed in {project.folder}")
    return time.perf_counter() - started, peak / 2**20


def exponent(sizes: list[int], seconds: list[float]) -> float:
    """Slope of log time over log size, between the largest two sizes with the smallest's time, the start, taken off."""
    (n0, n1), (t0, t1) = sizes[-2:], (s - seconds[0] for s in seconds[-2:])
    return float(np.log(t1 / t0) / np.log((n1 - sizes[0]) / (n0 - sizes[0])))


def designs(folder: Path, sizes: list[int], chunk: int, *options: str) -> dict[str, float]:
    """Time [s] and memory [MiB] of the largest of several designs, and the growth of time with size."""
    print(f"\n{'runs':>7} {'jobs':>6} {'time [s]':>9} {'per run [s]':>12} {'memory [MiB]':>13}")
    seconds = []
    for size in sizes:
        project = make_project(folder / f"{size}-of-{chunk}")
        project.write(design={"size": size, "chunk": chunk}, stop={"max_runs": size + 10})
        wall, memory = timed(project, *options, "design", "--configfile", "tiny.yaml", cores=2)
        if "-n" not in options:
            assert len(project.records()) == size + 1  # and the reference run
        seconds.append(wall)
        print(f"{size:>7} {-(-size // chunk):>6} {wall:>9.1f} {wall / size:>12.4f} {memory:>13.0f}", flush=True)
        shutil.rmtree(project.folder)
    return {"seconds": seconds[-1], "exponent": exponent(sizes, seconds), "mib": memory}


def slow_runs(folder: Path, sleep_s: float, size: int = 8) -> dict[str, Any]:
    """Time of a design of runs that sleep, on one core and on two."""
    print(f"\n{'cores':>6} {'design [s]':>11} {'beyond the sleep, per run [s]':>30}")
    walls = {}
    for cores in (1, 2):
        project = make_project(folder / f"slow-{cores}")
        (project.folder / "sleeper.py").write_text(SLEEPER)
        project.write(
            simulator={
                "kind": "command",
                "command": ["{python}", "sleeper.py", str(sleep_s)],
                "input": {"format": "json"},
                "files": ["sleeper.py"],
                "output": {"file": "image.npy", "scale": "db"},
                "deterministic": True,
            },
            design={"size": size, "chunk": 1},
        )
        timed(project, "results/tiny/passes/1/target.h5", "--configfile", "tiny.yaml", cores=2)
        walls[cores], _ = timed(project, "design", "--configfile", "tiny.yaml", cores=cores)
        beyond = (walls[cores] - size * sleep_s / cores) / size
        print(f"{cores:>6} {walls[cores]:>11.1f} {beyond:>30.2f}", flush=True)
    return {
        "sleep_s": sleep_s,
        "seconds_per_run": (walls[1] - size * sleep_s) / size,
        "speedup_2_cores": walls[1] / walls[2],
    }


COPIES = {
    "train": 'cp copies/surrogate.h5 "${snakemake_output[surrogate]}"',
    "propose": 'cp copies/proposal.json "${snakemake_output[proposal]}"',
    # user and system time of Snakemake, in ticks of 10 ms
    "verify": """\
k=${snakemake_wildcards[k]}
cp copies/verified.h5 "${snakemake_output[trained]}"
cp copies/$k.json "${snakemake_output[verified]}"
cut -d" " -f14,15 /proc/$RADCAL_OWNER/stat >> ticks.txt""",
}


def long_search(folder: Path, count: int) -> dict[str, float]:
    """CPU time of Snakemake for an iteration, in the middle of the first 20 and of the last 20 of a search [s]."""
    project = make_project(folder / "search")
    timed(project, "--configfile", "tiny.yaml", cores=1)
    first, copies = project.out() / "iterations" / "0", project.folder / "copies"
    copies.mkdir()
    for made, copy in (("surrogate.h5",) * 2, ("proposal.json",) * 2, ("verified/surrogate.h5", "verified.h5")):
        shutil.copy(first / made, copies / copy)
    run = read_runs([first / "verified.json"]).runs[0]
    for k in range(count):
        score = dataclasses.replace(run.scores["field"], cost=1.0 / (k + 1))  # never within the tolerance
        with provenance("tiny"):
            write_runs(copies / f"{k}.json", [dataclasses.replace(run, index=k, scores={"field": score})])
    shutil.rmtree(project.out() / "iterations")
    (project.out() / "final.json").unlink()
    rules = project.folder / "workflow/rules/loop.smk"
    for name, lines in COPIES.items():
        rules.write_text(rules.read_text().replace(f"{name}.py", f"{name}.sh"))
        (project.folder / f"workflow/scripts/{name}.sh").write_text(lines + "\n")
    stop = {"rms": 1e-9, "max_runs": project.summary()["runs"]["design"] + count, "stagnation_runs": 2 * count}
    project.write(stop=stop)
    timed(project, "results/tiny/final.json", "--configfile", "tiny.yaml", cores=1)
    spent = np.loadtxt(project.folder / "ticks.txt").sum(axis=1) / os.sysconf("SC_CLK_TCK")
    assert len(spent) == count
    found = {
        "iteration_10_s": (spent[19] - spent[0]) / 19,
        f"iteration_{count - 10}_s": (spent[-1] - spent[-20]) / 19,
        "search_s": spent[-1],
    }
    print("\n" + ", ".join(f"{name} {value:.3f}" for name, value in found.items()))
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smaller designs, a shorter sleep")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="radcal-overhead-") as name:
        folder = Path(name)
        sizes = [100, 400, 1600] if options.quick else [100, 2500, 10_000]
        print("\nplanning, four runs a job")
        planning = designs(folder, sizes, 4, "-n")
        print("\nruns of some milliseconds, a hundred a job")
        fast = designs(folder, [100, 300, 600] if options.quick else sizes, 100)
        found: dict[str, Any] = {"runs": sizes[-1]}
        found |= {f"plan_{key}": value for key, value in planning.items()}
        found |= {f"fast_{key}": value for key, value in fast.items()}
        found |= slow_runs(folder, 6.0 if options.quick else 60.0)
        print("\nCPU time of Snakemake in a long search")
        found |= long_search(folder, 60 if options.quick else 300)
    print(json.dumps({key: round(value, 3) if isinstance(value, float) else value for key, value in found.items()}))


if __name__ == "__main__":
    main()
