"""A program that radcal was not written for: a seed that is a C int, a parameter that it rounds, no noise."""

import json
import struct
import subprocess
import sys

import numpy as np
import yaml
from workflow_project import COLUMNS, ROWS, tiny_case, write_raster

OUTSIDER = """
import array, math, os, random, sys
words = open(sys.argv[1]).read().split()
seed = int(words[0])
if seed >= 2**31:  # what does not fit is passed over, and the default stays
    seed = 1
level, looks = float(words[1]), round(float(words[2]))
draw = random.Random(seed)
speckle = [draw.gammavariate(looks, 1 / looks) for _ in range(PIXELS)]
os.chdir("out")  # it is there, or this fails
array.array("f", [level + 0.4 * looks + 10 * math.log10(max(s, 1e-6)) for s in speckle]).tofile(open("image.raw", "wb"))
with open(os.environ["CALLS"], "a") as log:
    log.write(" ".join(words) + chr(10))
""".replace("PIXELS", str(ROWS * COLUMNS))
TRUTH = (-26.3, 4)
SPREAD_DB = 2.4  # of speckle of four looks


def outsider(project, **simulator):
    """A case of the program, its measured image in a file."""
    calls = project.folder / "calls"
    (project.folder / "sim.py").write_text(OUTSIDER)
    (project.folder / "sim.tpl").write_text("@noise_seed@\n@field.level@ @field.looks@\n")
    (project.folder / "out").mkdir(exist_ok=True)
    (project.folder / "truth").write_text("99 {} {}".format(*TRUTH))
    command = [sys.executable, "-S", "-E", "sim.py", "truth"]
    subprocess.run(command, cwd=project.folder, env={"CALLS": str(calls)}, check=True)
    values = np.fromfile(project.folder / "out/image.raw", dtype=np.float32).reshape(ROWS, COLUMNS)
    write_raster(project.folder / "measured.tif", values)
    calls.unlink()
    field = {"calibrate": True, "law": "external", "names": ["level", "looks"], "integer": ["looks"]}
    case = tiny_case() | {
        "simulator": {
            "kind": "command",
            "command": ["{python}", "-S", "-E", "sim.py", "sim.inp"],
            "templates": [{"template": "sim.tpl", "file": "sim.inp"}],
            "files": ["sim.py"],
            "output": {"file": "out/image.raw", "format": "raw", "dtype": "float32", "scale": "db"},
            "environment": {"CALLS": str(calls)},
            **simulator,
        },
        "materials": {"field": field | {"bounds": [[-40, -10], [1, 12]]}, "lake": {"law": "external"}},
        "measurement": {"source": "file", "path": "measured.tif", "scale": "db", "radiometry": "sigma0_ref"},
        "target": {"pixels": 1000},
        "radar": {"nesz_db": -60},
        "seed": 3,
        "design": {"size": 6, "chunk": 6},
        "optimiser": {"evaluations": 400},
    }
    del case["objective"]  # a law without a curve has the density
    del case["stop"]
    (project.folder / "tiny.yaml").write_text(yaml.safe_dump(case))
    return calls


def test_a_program_that_radcal_was_not_written_for(project):
    calls = outsider(project)
    done = project.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    summary = project.summary()
    field = summary["materials"]["field"]
    assert summary["stop_reason"] != "max_runs"
    assert summary["runs"]["total"] <= 15
    assert len(project.records()) == summary["runs"]["total"]
    made = calls.read_text().splitlines()
    assert len(made) == summary["runs"]["total"]
    # of the means of two independent samples
    assert field["parameters"]["looks"] == TRUTH[1]
    assert abs(field["parameters"]["level"] - TRUTH[0]) < 2 * np.sqrt(2) * SPREAD_DB / np.sqrt(1000)
    # whole numbers without a decimal point, as scanf reads them, and seeds that a C int holds
    seeds = {int(line.split()[0]) for line in made}
    assert len(seeds) == 2
    assert all(struct.pack("i", seed) for seed in seeds)
    assert all(line.split()[2].isdigit() for line in made)
    # no X was simulated twice, but for the reference run that shows whether runs repeat, and the fresh one
    assert len(set(made)) == len(made) - 1
    assert field["rms_fresh"] is not None
    assert field["rms_fresh"] != field["rms_final"]
    # the input of the final check run is exported, in the program's own format
    exported = project.out() / "export/simulator_input"
    assert (exported / "sim.inp").read_text().split() in [line.split() for line in made]
    assert (exported / "sim.inp").read_text().split()[1:] == [repr(field["parameters"]["level"]), "4"]
    assert (exported / "command.txt").read_text() == f"{sys.executable} -S -E sim.py sim.inp\n"
    assert json.loads((project.out() / "passes/1/simulator.json").read_text())["data"]["seed_bits"] == 31
