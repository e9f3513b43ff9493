"""SIGKILL at random moments of full calibrations: what is lost, what is repeated, what comes out.

    python tests/faults/kills.py --kills 200

The same command is typed again after each kill, until the calibration has ended; then another one is begun.
Killed are, in turn, Snakemake's main process (its jobs go on without it), one of its jobs' processes, or the
whole process group. The last line printed is one JSON object.
"""

import argparse
import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from workflow_project import Project, make_project

KINDS = ("group", "snakemake", "job")
COMMAND = ("--configfile", "tiny.yaml")


PROBLEMS = (
    "finished_runs_lost", "finished_runs_repeated", "different_results", "tracebacks", "partial_files_left",
    "files_set_aside",
)  # fmt: skip


@dataclass
class Tally:
    """What the kills did."""

    kills: Counter[str] = field(default_factory=Counter)
    calibrations: int = 0
    problems: dict[str, list[str]] = field(default_factory=lambda: {name: [] for name in PROBLEMS})

    def as_json(self):
        counts = {name: len(found) for name, found in self.problems.items()}
        return {"kills": self.kills.total(), "by": dict(self.kills), "calibrations": self.calibrations, **counts}


@dataclass
class Watch:
    """The finished runs of a project, and what became of them."""

    project: Project
    known: dict[str, tuple[int, str]] = field(default_factory=dict)

    def look(self, tally):
        runs = self.project.out() / "runs"
        for name, (stamp, content) in self.known.items():
            path = runs / name
            if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != content:
                tally.problems["finished_runs_lost"].append(name)
            elif path.stat().st_mtime_ns != stamp:
                tally.problems["finished_runs_repeated"].append(name)
        self.known = {
            path.name: (path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).hexdigest())
            for path in runs.glob("[!.]*.h5")
        }


def result(project):
    """What must be the same: X, runs in their order, summary; times and the checksum over them aside."""
    summary = {key: value for key, value in project.summary().items() if key not in ("wall_seconds", "sha256")}
    with h5py.File(project.out() / "calibration.h5") as file:
        return {
            "x": file["materials/field/parameters"][()].tolist(),
            "keys": file["passes/1/keys"].asstr()[()].tolist(),
            "summary": summary,
        }


def descendants(pid):
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def start(project, log, cores=2):
    with log.open("ab") as handle:
        return project.start(*COMMAND, cores=cores, out=handle)


def kill(process, kind, draw):
    """Kill; return what was killed, and the processes that go on."""
    below = descendants(process.pid)
    if kind == "job":
        while not below and process.poll() is None:  # no job yet
            time.sleep(0.02)
            below = descendants(process.pid)
        if below:
            with contextlib.suppress(psutil.NoSuchProcess):
                draw.choice(below).kill()
                process.wait(timeout=900)  # Snakemake sees it and ends, or has just ended
                return "job", []
        kind = "group"  # the calibration has ended
    if kind == "group":
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()
    return kind, below if kind == "snakemake" else []


def calibrate(project, tally, most, draw, longest_s):
    """One calibration, killed at most so many times, then left to end."""
    log, watch, orphans = project.folder / "output.txt", Watch(project), []
    killed = 0
    while killed < most:
        process = start(project, log)
        try:
            process.wait(timeout=draw.uniform(0.5, longest_s))
            if process.returncode == 0:
                break
        except subprocess.TimeoutExpired:
            kind = KINDS[tally.kills.total() % len(KINDS)]
            kind, left = kill(process, kind, draw)
            orphans += left
            tally.kills[kind] += 1
            killed += 1
        watch.look(tally)
    # on one core: results do not depend on that either
    ended = project.run(*COMMAND, cores=1)
    psutil.wait_procs(orphans, timeout=60)
    watch.look(tally)
    output = log.read_text(errors="replace") + ended.stdout
    if ended.returncode != 0 or "Traceback" in output:
        tally.problems["tracebacks"].append(f"{project.folder}: exit code {ended.returncode}\n{output[-3000:]}")
    tally.problems["partial_files_left"] += map(str, project.out().rglob(".partial-*"))
    tally.problems["files_set_aside"] += map(str, project.out().rglob("*.damaged"))
    tally.calibrations += 1


def campaign(folder, kills, seed, longest_s, each, expected, interpreter=(sys.executable,)):
    """So many kills over as many calibrations as they take.

    The interpreter is that of the command after the last kill of each calibration.
    """
    tally, draw = Tally(), random.Random(seed)
    while tally.kills.total() < kills:
        project = make_project(folder / f"killed-{tally.calibrations}")
        project.interpreter = list(interpreter)
        calibrate(project, tally, min(each, kills - tally.kills.total()), draw, longest_s)
        if not (project.out() / "summary.json").is_file() or result(project) != expected:
            tally.problems["different_results"].append(str(project.folder))
        print(json.dumps(tally.as_json()), flush=True)
    return tally


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--each", type=int, default=20, help="most kills of one calibration")
    parser.add_argument("--longest", type=float, default=15.0, help="longest time to a kill [s]")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="radcal-kills-"))
    undisturbed = make_project(folder / "undisturbed")
    undisturbed.ended(*COMMAND)
    tally = campaign(folder, options.kills, options.seed, options.longest, options.each, result(undisturbed))
    print("\n".join(text for found in tally.problems.values() for text in found))
    print(json.dumps(tally.as_json()))
    return int(any(tally.problems.values()))


if __name__ == "__main__":
    sys.exit(main())
