"""What people rely on when they type a command again: which jobs and which runs it makes (docs/reruns.md)."""

import csv
import json
import os
import re
import shutil
import signal
from pathlib import Path

import h5py
import pytest
import yaml
from sealed import changed
from waiting import wait_until
from workflow_project import ROOT, Project, make_project, tiny_case

from radcal.config import case_from
from radcal.config.stages import SCHEMAS, STAGES
from radcal.objectives.history import read_runs

CASE = ("--configfile", "tiny.yaml")
# what Snakemake calls a job of each rule
MESSAGES = {
    stage.words.format(chunk=number, k=number): rule
    for rule, stage in STAGES.items()
    for number in range(20)
    if stage.reads and stage.is_needed(case_from(tiny_case()))
}
# of no rule's outputs: the treasure, and how long jobs took
NOT_MADE = ("runs/", "benchmarks/", "posterior/draws/")
# planned only once the scores of the design are known
LOOP = {"train", "propose", "verify"}
# one other value of every section that the tiny case's rules read
CHANGES = {
    "seed": 2,
    "scene": {**tiny_case()["scene"], "near_incidence_deg": 16.0},
    "radar": {"looks": 3},
    "simulator": {"kind": "builtin", "keep_images": True},
    "materials": {"lake": {"law": "mangia", "parameters": [6, 5, 5, 5]}},
    "measurement": {"synthetic": {**tiny_case()["measurement"]["synthetic"], "seed": 2}},
    "registration": {"method": "gefolki"},
    "objective": "classes",
    "target": {"pixels": 300},
    "validation": {"rows": 20, "means": 10, "keep": "even"},
    "design": {"sampler": "latin_hypercube"},
    "surrogate": {"baseline": False},
    "optimiser": {"evaluations": 900},
    "infill": {"batch": 2},
    "uncertainty": {"known_db": 2.5},
    "stop": {"rms": 2e-3},
}


def sections(stage):
    """Keys of a case file that a stage reads."""
    return [one.alias or name for name, one in stage.model.model_fields.items()]


def test_the_table_in_the_documents_has_every_key_that_a_calibration_reads():
    page = (ROOT / "docs" / "reruns.md").read_text()
    rows = re.findall(r"^\| (`.*?`) \|", page, flags=re.MULTILINE)
    keys = {key for rule, stage in STAGES.items() if rule != "products" for key in sections(stage)}
    assert {"colours", *re.findall(r"\w+", " ".join(rows))} == keys | {"replace"}
    assert set(CHANGES) | {"case", "colours"} == keys  # colours are made from those of the materials


def test_a_colour_of_a_material_is_taken_by_the_archive_alone():
    old, new = tiny_case(), tiny_case()
    new["materials"]["field"]["colour"] = "#123456"
    old, new = case_from(old), case_from(new)
    assert {rule for rule, stage in STAGES.items() if stage.params(old) != stage.params(new)} == {"archive"}


@pytest.mark.parametrize("section", CHANGES)
def test_a_changed_section_changes_what_those_rules_take(section):
    # the default number of draws depends on the objective
    drawn = {} if section == "simulator" else {"simulator": {"draws": 1}}
    old, new = case_from(tiny_case(**drawn)), case_from(tiny_case(**drawn, **{section: CHANGES[section]}))
    changed = {rule for rule, stage in STAGES.items() if stage.params(old) != stage.params(new)}
    assert changed == {rule for rule, stage in STAGES.items() if section in sections(stage)}


@pytest.mark.parametrize("section", ["target", "optimiser"])
def test_a_changed_section_makes_again_what_the_table_says(finished, section):
    """A dry run plans every rule that reads the section, and starts at no other."""
    finished.write("changed.yaml", **{section: CHANGES[section]})
    planned = finished.ended("-n", "--quiet", "host", "--configfile", "changed.yaml")
    rules = set(re.findall(r"(?m)^(\w+) +\d+$", planned))
    jobs = re.findall(
        r"^(?:Local job|Job|Checkpoint)[^:]*: (.+)\nReason: Params have changed", planned, flags=re.MULTILINE
    )
    expected = {rule for rule, stage in STAGES.items() if section in sections(stage)} & set(MESSAGES.values())
    assert jobs, planned
    assert {MESSAGES.get(job, job) for job in jobs} <= expected
    assert expected - rules <= (LOOP if "scores" in rules else set())


def test_commands_of_snakemake_behave(finished):
    before, listing = finished.contents(), finished.listing()
    assert "Nothing to be done" in finished.ended("-n", *CASE)
    changed = finished.ended("-n", *CASE, "--config", "target={pixels: 300}")
    assert "target" in changed
    assert "radcal: no simulator run would be made." in finished.ended("-n", *CASE)
    longer = finished.ended("-n", *CASE, "--config", 'stop={"rms": 1e-9, "max_runs": 40}')
    assert re.search(r"at most \d+ simulator runs would be made \(at most \d+ infill, at most 2 final\); a", longer)
    assert finished.listing() == listing, "a dry run changed something"
    # what a finished case holds is what the rules make, runs and times aside: what is missing of it is made again
    made = set(re.findall(r"(?m)^results/tiny/(\S+)\t", finished.ended("--summary", *CASE)))
    assert made == {re.sub("^(figures|export)/.*", r"\1", name) for name in listing if not name.startswith(NOT_MADE)}
    finished.ended("--report", "snakemake.html", *CASE)
    page = (finished.folder / "snakemake.html").read_text(encoding="utf-8")
    listed = json.loads(re.findall(r"var categories = (.*);\n", page)[0])
    found = {name: {Path(path).name for path in files["Other"]} for name, files in listed.items()}
    figures = {path.name for path in (finished.out() / "figures").glob("*.png")}
    assert found["Report"] == {"report.html"}
    assert found["Tables"] == {"runs.csv", "laws.csv", "parameters.csv"}
    assert found["field"] == {name for name in figures if name.endswith("_field.png")}
    assert found["Whole case"] == figures - found["field"]
    shown = json.loads(re.findall(r"var results = ({.*});\n", page)[0])
    assert len({shown[f"results/tiny/figures/{name}"]["caption"] for name in figures} - {""}) == len(figures)
    assert finished.listing() == listing
    # a single file, and nothing else, from what is there
    report, archive = finished.out() / "report.html", (finished.out() / "calibration.h5").read_bytes()
    report.unlink()
    shutil.rmtree(finished.out() / "figures")
    finished.ended("results/tiny/report.html", *CASE)
    assert report.is_file()
    assert (finished.out() / "calibration.h5").read_bytes() == archive
    # a stage by name: made again, its runs found
    finished.ended("--forcerun", "design_chunk", "--until", "scores", *CASE)
    assert finished.contents() == before
    summary = finished.summary()
    finished.ended("all", *CASE, cores=1)
    assert finished.contents() == before
    assert finished.summary()["materials"] == summary["materials"]


def test_runs_of_an_iteration_are_jobs_that_keep_what_they_made(project):
    """Two proposals at once, of which a first command makes only the second; three runs are left of the maximum."""
    project.write(design={"size": 6}, infill={"batch": 2}, stop={"rms": 1e-9, "max_runs": 9})
    project.ended("results/tiny/iterations/0/runs/1.json", *CASE)
    first = project.records()
    assert len(first) == 1 + 6 + 1
    said = project.ended("results/tiny/final.json", *CASE)
    assert re.findall(r"after +(\d+) runs \(iteration (\d+)\)", said) == [("8", "1"), ("9", "2")]
    after = project.records()
    assert {name: after[name] for name in first} == first
    infill = read_runs([project.out() / f"iterations/{k}/verified.json" for k in (0, 1)]).infill
    assert [run.index for run in infill] == [0, 0, 1]
    assert len({run.keys[0] for run in infill}) == 3
    assert f"{infill[1].keys[0]}.h5" in first
    lists = [json.loads((project.out() / f"iterations/1/runs/{j}.json").read_text())["data"] for j in (0, 1)]
    assert [len(one) for one in lists] == [1, 0]


def content(path):
    """What a file holds, when it was made and how long that took aside."""
    if path.name == "report.html":
        return re.sub('(?s)<section id="provenance">.*?</section>', "", path.read_text(encoding="utf-8"))
    if path.name == "report.json":
        return {**json.loads(path.read_text())["data"]["checksums"], "report.html": None}
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return file.attrs["content"]
    if path.name == "summary.json":
        return {
            key: value for key, value in json.loads(path.read_text()).items() if key not in ("sha256", "wall_seconds")
        }
    return path.read_bytes()


def test_whatever_is_missing_comes_back_and_no_run_is_repeated(finished):
    out, records = finished.out(), finished.records()
    names = [name for name in finished.listing() if not name.startswith(NOT_MADE) and ".snakemake" not in name]
    before = {name: content(out / name) for name in names}
    # these alone bring back all that they rest on: without them the others must come back by themselves
    noticed = {"summary.json", "scores.json", *(name for name in names if name.endswith("/verified.json"))}
    (out / "iterations/7").mkdir()
    leftover = shutil.copy(out / "iterations/0/proposal.json", out / "iterations/7")
    for name in ["iterations/0/surrogate.h5", "iterations/0/verified/surrogate.h5", "stop.json"]:
        (out / name).rename(out / "aside")
        planned = finished.ended("-n", "--quiet", "host", *CASE)
        assert f"Missing output files: results/tiny/{name}" in planned
        assert not (out / name).exists(), "a dry run changed something"
        (out / "aside").rename(out / name)
    with changed(out / "passes/1/target.h5") as file:
        file.attrs["schema"] = SCHEMAS["target"] - 1  # as an earlier version wrote it
    for name in before.keys() - noticed - {"passes/1/target.h5"}:
        (out / name).unlink()
    shutil.rmtree(out / "figures")
    said = finished.ended(*CASE)
    assert (
        "radcal: results/tiny/passes/1/target.h5: is of an earlier version of radcal: it was written with schema "
        f"{SCHEMAS['target'] - 1}, this radcal reads {SCHEMAS['target']}; set aside as target.earlier; it is made "
        "again where needed (finished runs are kept)."
    ) in said
    assert {name: content(out / name) for name in before} == before
    assert finished.records() == records
    # what is no part of the answer stays as it is
    assert [path.name for path in Path(leftover).parent.iterdir()] == ["proposal.json"]


def test_another_seed_is_another_design_as_if_it_had_always_been(finished, tmp_path):
    """Target and design change at once: no job may be left as it was because one that it waits for runs too."""
    fresh = make_project(tmp_path / "fresh")
    for project in (finished, fresh):
        project.write(seed=2, target={"pixels": 300})
        project.ended("design", *CASE)
    scores = [
        [(run.keys, run.scores["field"]) for run in read_runs([project.out() / "scores.json"]).runs]
        for project in (finished, fresh)
    ]
    assert scores[0] == scores[1]


def test_another_scene_or_pass_leaves_finished_results_until_told(finished):
    listing, records = finished.listing(), finished.contents()
    finished.write(radar={"looks": 3})
    planned, refused = finished.run("-n", *CASE), finished.run(*CASE)
    assert planned.returncode != 0
    assert refused.returncode != 0
    assert planned.stdout == refused.stdout
    (said,) = [line for line in refused.stdout.splitlines() if "holds a finished calibration" in line]
    assert "radar.looks is 4 there, 3 here" in said
    assert "case: ..." in said
    assert "replace=true" in said
    finished.write()
    # nothing was planned with the refused values, by which Snakemake would know the file of the failed job
    assert "Nothing to be done" in finished.ended(*CASE)
    assert finished.listing() == listing
    # told to, the results give way; the runs stay
    finished.write(radar={"looks": 3})
    finished.ended("reference", *CASE, "--config", "replace=true")
    after = finished.contents()
    assert {name: after[name] for name in records} == records
    assert len(after) == len(records) + 1


def test_copied_touched_and_commented_it_simulates_nothing(finished, tmp_path):
    summary = finished.summary()
    # as cp -r does: every file is as new as its copying
    copy = Project(Path(shutil.copytree(finished.folder, tmp_path / "elsewhere", copy_function=shutil.copyfile)))
    before = copy.records()
    shutil.rmtree(finished.folder)
    for name in ("labels.tif", "names.json", "tiny.yaml"):
        os.utime(copy.folder / name)
    for script in (copy.folder / "workflow" / "scripts").glob("*.py"):
        script.write_text(script.read_text() + "# a remark\n")
    copy.ended(*CASE)
    assert copy.records() == before
    assert copy.summary()["materials"] == summary["materials"]
    assert copy.summary()["runs"] == summary["runs"]


@pytest.mark.parametrize(("number", "by"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_a_stopped_command_says_what_is_kept_and_how_to_go_on(project, number, by):
    log = project.folder / "said.txt"
    with log.open("w") as file:
        # a test run that a shell has put into the background ignores Ctrl-C, and so would this one
        heed = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.default_int_handler)}
        process = project.start(*CASE, out=file, **heed)
    wait_until(lambda: len(project.records()) >= 5, process)
    second = project.run(*CASE)
    assert second.returncode != 0
    assert f"another snakemake (process {process.pid})" in second.stdout
    assert "Traceback" not in second.stdout
    # what a terminal and a service manager do: to the whole group
    os.killpg(process.pid, number)
    assert process.wait(120) != 0
    (said,) = re.findall(
        rf"radcal: stopped by {by}\. (\d+) finished runs are kept in results/tiny/runs; (.*)", log.read_text()
    )
    assert "WorkflowError" not in log.read_text()
    assert "RuleException" not in log.read_text()
    assert int(said[0]) == len(project.records()) >= 5
    assert said[1] == "the same command goes on from there."
    before = project.contents()
    project.ended("design", *CASE)
    after = project.contents()
    assert {name: after[name] for name in before} == before


def test_killed_products_keep_what_they_made(finished):
    """Runs of the draws before the kill are not simulated again; images and table have those of all draws."""
    asked = ("products", *CASE, "--config", 'products={"make": ["complex"], "draws": 12}')
    made, before = finished.out() / "products/complex", finished.records()
    finished.killed_when((made / "draws/4").exists, *asked)
    kept = finished.records()
    assert len(before) + 3 <= len(kept) < len(before) + 12
    assert not (finished.out() / "products.json").exists()
    finished.ended(*asked)
    records = finished.records()
    assert kept.items() <= records.items()
    assert len(records) == len(before) + 12  # the calibrated law has its run already
    with (made / "draws.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["member"]) for row in rows] == list(range(1, 13))
    assert {f"{row['run']}.h5" for row in rows} <= records.keys()
    assert all((made / f"draws/{k}/complex.h5").exists() for k in range(1, 13))


def test_runs_of_an_earlier_case_are_reused(finished):
    earlier = finished.contents()
    # other bounds, another target: none of the design's points would be the same
    other = tiny_case(
        case="second",
        materials={"field": {"calibrate": True, "law": "mangia", "bounds": [[0, 16], [5, 25], [10, 35], [0, 10]]}},
        target={"pixels": 300},
        design={"size": 14, "reuse": "tiny"},
        stop={"rms": 2e-3},
    )
    other["materials"]["lake"] = tiny_case()["materials"]["lake"]
    (finished.folder / "second.yaml").write_text(yaml.safe_dump(other))
    finished.ended("--configfile", "second.yaml")
    runs = finished.summary("second")["runs"]
    first = finished.summary()["runs"]
    # its reference run too: with other bounds the start is another
    assert runs["reused"] == first["reference"] + first["design"] + first["infill"]
    assert runs["design"] == max(14 - runs["reused"], 0)
    assert finished.contents() == earlier
    shared = set(finished.contents("second")) & set(earlier)
    assert len(shared) >= runs["reused"]
    counted = f'<td>{runs["reused"]}</td><td class="words">runs of an earlier case'
    assert counted in (finished.out("second") / "report.html").read_text()
    assert len(finished.contents("second")) - len(shared) <= runs["reference"] + runs["design"] + runs["infill"] + 1
