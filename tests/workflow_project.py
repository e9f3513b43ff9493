"""A copy of the workflow in an empty folder, with a tiny case that takes seconds: for tests of whole calibrations."""

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from raster_files import write_raster
from waiting import wait_until

ROOT = Path(__file__).resolve().parents[1]
ROWS, COLUMNS = 96, 80


# a program in Python, which gets its input as JSON and leaves raw numbers in dB
PROGRAM = """
import array, json, os, random, sys, time
run = json.load(open(sys.argv[1]))
a, seed = run["parameters"]["field"]["a"], run["noise_seed"]
time.sleep({seconds})
fault, where = open(os.environ["FAULT"]).read().split() if os.path.exists(os.environ["FAULT"]) else ("", "")
if fault == "exit" and where == repr(a):
    sys.exit("the licence server does not answer")
rows, columns = run["shape"]
if "{mode}" == "random":
    # other numbers whenever parameters come again, though the same in every run of this test
    seen = os.environ["FAULT"] + repr(a)
    seed = repr((seen.rpartition("/")[2], os.path.exists(seen)))
    open(seen, "w").close()
draw = random.Random(seed)
values = [a + draw.gauss(0, 2) for _ in range(rows * columns)]
if fault == "nan" and where == repr(a):
    values[::2] = [float("nan")] * len(values[::2])
array.array("d", values).tofile(open("image.raw", "wb"))
with open(os.environ["FAULT"] + ".done", "a") as log:
    log.write(repr((a, seed)) + "\\n")
"""


def sentences(text):
    """What radcal itself says in the output of a command that fails, without the remark on what is kept."""
    return [line for line in text.splitlines() if line.startswith("radcal: ") and "stopped." not in line]


def tiny_case(**changes):
    """Two materials over flat ground in slant range, one of them calibrated.

    The keys of a change are merged into its section, which they replace where they name a source; None removes it.
    """
    case = {
        "case": "tiny",
        "scene": {
            "source": "slant_range",
            "labels": "labels.tif",
            "names": "names.json",
            "near_incidence_deg": 15.0,
            "far_incidence_deg": 35.0,
        },
        "radar": {"nesz_db": -20.0},
        "materials": {
            "field": {"calibrate": True, "law": "mangia", "bounds": [[0, 15], [5, 25], [10, 35], [0, 10]]},
            "lake": {"law": "mangia", "parameters": [5, 5, 5, 5]},
        },
        "measurement": {
            "source": "synthetic",
            "synthetic": {"parameters": {"field": [6.1, 14.2, 21.5, 3.3]}, "seed": 1, "warp_px": 0},
        },
        "registration": {"method": "none"},
        "objective": "density",
        "target": {"pixels": 400},
        "design": {"sampler": "sobol", "size": 12, "chunk": 6},
        "optimiser": {"population": 40, "evaluations": 800},
        "stop": {"rms": 1e-3, "max_runs": 60, "stagnation_runs": 20},
        "uncertainty": {"walkers": 32, "steps": 100},  # too few to converge: the sampler has tests of its own
    }
    for key, value in changes.items():
        merged = isinstance(value, dict) and key in case and "source" not in value
        case[key] = {**case[key], **value} if merged else value
    return {key: value for key, value in case.items() if value is not None}


@dataclass
class Project:
    """A folder with the workflow in it."""

    folder: Path
    # what `run` starts Snakemake with; long tests have a quicker one (workflow_fixtures.py)
    interpreter: list[str] = field(default_factory=lambda: [sys.executable])

    def write(self, name="tiny.yaml", **changes):
        (self.folder / name).write_text(yaml.safe_dump(tiny_case(**changes)))
        return name

    def write_external(self, mode="", seconds=0.0, simulator=None, **changes):
        """The tiny case with a program of these seconds a run, which fails where the file ``fault`` says so.

        The file ``fault.done`` has a line for each run that it has made.
        """
        (self.folder / "sim.py").write_text(PROGRAM.format(mode=mode, seconds=seconds))
        program = {
            "kind": "command",
            "command": ["{python}", "-S", "-E", "sim.py", "{input}"],
            "input": {},
            "files": ["sim.py"],
            "output": {"file": "image.raw", "format": "raw", "dtype": "float64", "scale": "db"},
            # outside of what a run is known by: mending it makes no other simulator
            "environment": {"FAULT": str(self.folder / "fault")},
        }
        hidden = {"synthetic": {"parameters": {"field": [-12.0]}}}
        case = tiny_case(simulator=program | (simulator or {}), measurement=hidden, stop={"rms": 2e-2}, **changes)
        law = {"law": "external", "names": ["a"], "bounds": [[-20, 0]], "start": [-15]}
        case["materials"] = {"field": {"calibrate": True, **law}, "lake": {"law": "external"}}
        (self.folder / "tiny.yaml").write_text(yaml.safe_dump(case))

    def command(self, *arguments, cores=2):
        return [sys.executable, "-m", "snakemake", "--cores", str(cores), *arguments]

    def _done(self, command, seconds, **options):
        printed = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        return subprocess.run(command, cwd=self.folder, timeout=seconds, check=False, **printed, **options)

    def run(self, *arguments, cores=2):
        return self._done([*self.interpreter, *self.command(*arguments, cores=cores)[1:]], 1800)

    def ended(self, *arguments, cores=2):
        """Output of a command that must succeed."""
        done = self.run(*arguments, cores=cores)
        assert done.returncode == 0, done.stdout
        return done.stdout

    def radcal(self, *arguments):
        """Run the command ``radcal run``, which no activated environment helps to find Python."""
        program = str(Path(sys.executable).with_name("radcal"))
        return self._done([program, "run", *arguments], 600, env={**os.environ, "PATH": "/usr/bin:/bin"})

    def start(self, *arguments, cores=2, out=subprocess.DEVNULL, **options):
        command, printed = self.command(*arguments, cores=cores), {"stdout": out, "stderr": out}
        return subprocess.Popen(command, cwd=self.folder, start_new_session=True, **printed, **options)

    def killed_when(self, condition, *arguments):
        """Begin a command, and kill it with its jobs once a condition is met."""
        process = self.start(*arguments)
        wait_until(condition, process)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def out(self, case="tiny"):
        return self.folder / "results" / case

    def summary(self, case="tiny"):
        return dict(json.loads((self.out(case) / "summary.json").read_text()))

    def records(self, case="tiny"):
        """Time stamp of every finished run record [ns]; what is being written has a name with a dot first."""
        return {path.name: path.stat().st_mtime_ns for path in (self.out(case) / "runs").glob("[!.]*.h5")}

    def contents(self, case="tiny"):
        """Every finished run record, byte for byte."""
        return {name: (self.out(case) / "runs" / name).read_bytes() for name in self.records(case)}

    def listing(self, case="tiny"):
        """Size and time stamp of every result, logs and lock aside."""
        return {
            str(path.relative_to(self.out(case))): (path.stat().st_size, path.stat().st_mtime_ns)
            for path in sorted(self.out(case).rglob("*"))
            if path.is_file() and "logs" not in path.parts and path.name != ".lock"
        }


def make_project(folder):
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "Snakefile", folder)
    for name in ("workflow", "config", "profiles"):
        shutil.copytree(ROOT / name, folder / name)
    return make_case(folder)


def make_case(folder, **changes):
    """The tiny case alone, in a folder without the workflow."""
    labels = np.ones((ROWS, COLUMNS), dtype=np.uint8)
    labels[:, 60:] = 2
    write_raster(folder / "labels.tif", labels)
    (folder / "names.json").write_text(json.dumps({"1": "field", "2": "lake"}))
    project = Project(folder)
    project.write(**changes)
    return project
