"""External simulators through the whole workflow: the worked examples, and programs that fail on the way."""

import json
import re
import shutil
import subprocess
import sys

import h5py
import pytest
from workflow_project import ROOT, sentences

from radcal.config import load
from radcal.proposals.design import design_points
from radcal.storage.records import read_json


def example(project, name):
    shutil.copytree(ROOT / "examples" / name, project.folder / "examples" / name, ignore=shutil.ignore_patterns("data"))
    subprocess.run([sys.executable, f"examples/{name}/scene.py"], cwd=project.folder, check=True)
    return f"examples/{name}/case.yaml"


def compile_sim(folder):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: there is no cc on the PATH")
    subprocess.run(
        [compiler, "-O2", "-Wall", "-Wextra", "-Werror", "-o", "sim", "sim.c", "-lm"], cwd=folder, check=True
    )


def run_example(project, name):
    case = example(project, name)
    if name == "command_c":
        compile_sim(project.folder / "examples" / name)
    printed = project.ended("--configfile", case)
    assert "The simulator is deterministic: the reference run repeated gives the same pixels." in printed
    summary = project.summary(name)
    assert summary["converged"]
    # the repeated reference run is counted and kept like any other
    assert summary["runs"]["reference"] == 2
    assert summary["runs"]["infill"] > 0
    assert len(project.records(name)) == summary["runs"]["total"]
    assert not any((project.out(name) / "external").iterdir())
    reference = read_json(project.out(name) / "passes/1/reference.json")
    assert [entry.get("difference_db") for entry in reference] == [None, 0.0]
    return summary, (project.out(name) / "report.html").read_text()


def test_the_example_in_c(project):
    summary, page = run_example(project, "command_c")
    assert summary["simulator"]["version"] == "sim 1.0"
    assert set(summary["simulator"]["sha256"]["files"]) == {"labels.raw"}
    field = summary["materials"]["field"]
    assert field["rms"] <= 3e-3 < field["rms_start"]
    assert field["law_difference_db"] > 0
    assert (project.out("command_c") / "figures/law_field.png").exists()
    assert "simulator</dt><dd>sim sim 1.0" in page

    # another build is another simulator: its runs are made again, and nothing of the first is lost
    before = project.records("command_c")
    source = project.folder / "examples/command_c/sim.c"
    source.write_text(source.read_text().replace("sim 1.0", "sim 1.1"))
    compile_sim(source.parent)
    project.ended("reference", "--configfile", "examples/command_c/case.yaml")
    after = project.records("command_c")
    assert {name: after.get(name) for name in before} == before
    assert len(after) == len(before) + 2
    # and so it is with another setting
    case = project.folder / "examples/command_c/case.yaml"
    case.write_text(case.read_text().replace("  timeout_s: 60", "  timeout_s: 60\n  environment: {LOOKS: s3cr3t}"))
    project.ended("reference", "--configfile", "examples/command_c/case.yaml")
    assert len(project.records("command_c")) == len(after) + 2
    # of an environment, names are recorded and values are not
    written = (*project.out("command_c").rglob("*"), *(project.folder / ".snakemake").rglob("*"))
    assert not [path for path in written if path.is_file() and b"s3cr3t" in path.read_bytes()]


def test_the_example_in_python_with_parameters_of_its_own(project):
    summary, page = run_example(project, "command_python")
    soil = summary["materials"]["soil"]
    assert soil["rms"] <= 3e-3 < soil["rms_start"]
    assert list(soil["parameters"]) == ["mv", "s"]
    assert soil["hidden"] == {"mv": 0.22, "s": 0.9}
    # a law that only the simulator knows has no curve
    assert "law_difference_db" not in soil
    assert not list((project.out("command_python") / "figures").glob("law_*"))
    assert "X of the external simulator" in page
    assert '<th scope="row">mv <span class="unit">[m3/m3]</span></th>' in page
    assert soil["law"] == "external"
    # the input of the final check run is exported
    exported = project.out("command_python") / "export/simulator_input"
    assert (exported / "command.txt").is_file()
    given = json.loads((exported / "input.json").read_text())
    assert given["parameters"]["soil"] == soil["parameters"]


# a program that ends with an error, and one whose image is refused (tests/programs has the other ways to fail)
FAULTS = {
    "exit": ["ended with exit code 1", '"the licence server does not answer"'],
    "nan": ["simulator.output.file: ", "pixels of field", "in the run with field.a = -"],
}


def test_every_failure_in_the_middle_ends_in_its_sentence_and_keeps_all_finished_runs(project):
    project.write_external(design={"size": 6, "chunk": 3})
    case = load([project.folder / "tiny.yaml"])
    # the second run of the second chunk
    bad = design_points(case, case.design_size)[4]["field"][0]
    kept = {}
    for fault, words in FAULTS.items():
        (project.folder / "fault").write_text(f"{fault} {bad!r}")
        failed = set(folders(project))
        done = project.run("--configfile", "tiny.yaml")
        assert done.returncode != 0
        (said,) = sentences(done.stdout)
        for word in [
            *words,
            "radcal: design run 5 of 6: simulator.",
            "its folder is kept as results/tiny/external/failed-",
        ]:
            assert word in said
        assert "Traceback" not in done.stdout
        assert "the same command continues" in done.stdout
        # the folder of the failed run, and of no other
        (new,) = set(folders(project)) - failed
        assert f"results/tiny/external/{new}." in said
        # twice the reference, the first chunk and the first run of the second
        records = project.contents()
        assert len(records) == 6
        assert records == (kept or records)
        kept = records
    (project.folder / "fault").unlink()
    project.ended("--configfile", "tiny.yaml")
    records = project.contents()
    assert {name: records[name] for name in kept} == kept
    summary = project.summary()
    assert len(records) == summary["runs"]["total"]
    # every finished run was made once, the measured image too; the one in the middle was written in vain once
    made = (project.folder / "fault.done").read_text().splitlines()
    # seeds that a C int holds
    assert all(0 < int(line.strip("()").split(", ")[1]) < 2**31 for line in made)
    assert len(made) == summary["runs"]["total"] + 1 + len(["nan"])
    assert sum(line.startswith(f"({bad!r}, ") for line in made) == 1 + len(["nan"])


def folders(project):
    work = project.out() / "external"
    return [path.name for path in work.iterdir()] if work.exists() else []


def test_a_simulator_that_is_not_deterministic_is_found_out_and_smoothed_over(project):
    project.write_external("random", design={"size": 6, "chunk": 3})
    printed = project.ended("--configfile", "tiny.yaml", "--config", 'stop={"rms": 1e-9, "max_runs": 7}')
    assert "The simulator is not deterministic: the reference run repeated" in printed
    summary = project.summary()
    assert (summary["runs"]["reference"], summary["runs"]["infill"]) == (2, 1)
    assert any("the surrogate smooths over runs" in note for note in summary["notes"])
    # 2 dB over the square root of 400 pixels: found from the pixels of two runs
    (scatter,) = re.findall(r"field: .* mean scatters by ([\d.]+) dB", "\n".join(summary["notes"]))
    assert 0.07 < float(scatter) < 0.14
    assert f"mean scatters by {scatter} dB" in (project.out() / "report.html").read_text()
    with h5py.File(project.out() / "iterations/0/surrogate.h5") as file:
        # 2 dB over the square root of 4,000 pixels against 20 dB of level: above the jitter, below all else
        assert 1e-10 < file["materials/field/nugget"][0] < 1e-2
