"""Overhead of the workflow: time of planning, time per run, memory, and speedup by a second core.

    python benchmarks/workflow_overhead.py [--quick]

The benchmark prints three tables, all for the design of a small case (96 x 80 pixels):

1. time of planning (dry runs) for designs of growing size with four runs per job, and peak memory of Snakemake
2. time and memory for runs of radcal's own simulator, which take some milliseconds each, with a hundred runs per job
3. time of a design of 8 runs of an external program that sleeps 60 s (6 s with ``--quick``), on one core and on two
   cores, and time per run beyond the sleep

The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import json
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
    print(json.dumps({key: round(value, 3) if isinstance(value, float) else value for key, value in found.items()}))


if __name__ == "__main__":
    main()
