"""Faults of disks, folders, memory, clocks and simulators: what the user sees, and what is kept."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import yaml
from faults.kills import Tally, Watch, campaign, result
from sealed import DAMAGES
from waiting import wait_until
from workflow_project import sentences

from radcal.radar.geometry import read_geometry
from radcal.session.salvage import salvage
from radcal.storage.dataclass_groups import same
from radcal.storage.records import read_json

SEALED = ("scene", "geometry", "measurement", "registered", "target", "calibration")


def goes_on(project, *arguments):
    """A command that ends well, and neither loses nor repeats a finished run."""
    watch, tally = Watch(project), Tally()
    watch.look(tally)
    project.ended(*arguments)
    watch.look(tally)
    assert not any(tally.problems.values())


def test_a_kill_of_each_kind_changes_nothing(finished, tmp_path):
    tally = campaign(
        tmp_path, kills=3, seed=5, longest_s=12.0, each=3, expected=result(finished), interpreter=finished.interpreter
    )
    assert tally.kills == {"group": 1, "snakemake": 1, "job": 1}
    assert not any(tally.problems.values()), tally


def test_strips_killed_in_between_are_the_whole_geometry(project):
    def arguments(case):
        return f"results/{case}/passes/1/geometry.h5", "--configfile", f"{case}.yaml"

    for case, strips in (("whole", 1), ("strips", 2)):
        text = yaml.safe_dump({"case": case, "simulator": {"strips": strips}})
        (project.folder / f"{case}.yaml").write_text(text)
    made = project.out("strips") / "passes/1/strips"
    project.killed_when(lambda: any(made.glob("[!.]*.h5")), *arguments("strips"))
    for case in ("whole", "strips"):
        project.ended(*arguments(case), cores=1)
    whole, joined = (read_geometry(project.folder / arguments(case)[0]) for case in ("whole", "strips"))
    assert same(joined, whole)
    assert not made.exists() or not any(made.iterdir())


def test_jobs_left_by_a_killed_snakemake_are_waited_for(project):
    project.write_external(seconds=1.5, simulator={"deterministic": True}, design={"size": 10, "chunk": 10})
    process = project.start("design", "--configfile", "tiny.yaml")
    wait_until(lambda: len(project.records()) >= 3, process)
    process.kill()
    process.wait()
    goes_on(project, "design", "--configfile", "tiny.yaml")
    # besides: the measurement is simulated, and a run in flight may be lost
    assert len((project.folder / "fault.done").read_text().splitlines()) <= len(project.records()) + 2


def in_a_namespace(script, folder):
    """Run a shell script that may mount file systems, seen by nobody else."""
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode:
        pytest.skip("no mount namespaces here (unshare -rm)")
    return subprocess.run(
        ["unshare", "-rm", "sh", "-c", script],
        cwd=folder, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip


def test_a_full_disk_is_a_sentence_and_finished_runs_are_kept(project):
    command = " ".join(project.command("design", "--configfile", "tiny.yaml"))
    done = in_a_namespace(
        f"mkdir results && mount -t tmpfs -o size=300k none results && {command} > full.txt 2>&1; echo $? > code.txt\n"
        "(cd results/tiny/runs && sha256sum *.h5) > before.txt\n"
        f"mount -o remount,size=100m results && {command} > roomy.txt 2>&1 || exit 1\n"
        "(cd results/tiny/runs && sha256sum *.h5) > after.txt; find results -name '.partial-*' > left.txt\n",
        project.folder,
    )
    text = {path.stem: path.read_text() for path in project.folder.glob("*.txt")}
    assert done.returncode == 0, (done.stderr, text)
    assert text["code"] != "0\n"
    assert any("No space left on device" in line for line in sentences(text["full"])), text["full"]
    assert "Traceback" not in text["full"]
    before, after = (set(text[name].splitlines()) for name in ("before", "after"))
    assert before <= after
    assert len(after) == 13
    assert text["left"] == ""


def test_a_read_only_results_folder_is_a_sentence(project):
    command = " ".join(project.command("--configfile", "tiny.yaml"))
    in_a_namespace(
        "mkdir -p results/tiny && mount --bind results results && mount -o remount,bind,ro results && "
        f"{command} > said.txt 2>&1",
        project.folder,
    )
    said = (project.folder / "said.txt").read_text()
    (sentence,) = sentences(said)
    assert "cannot be written (Read-only file system)" in sentence
    assert "Traceback" not in said


def without_rights(project, *arguments):
    """A command that may do what the files' modes allow, by root too; how it ended, and radcal's sentences."""
    command = project.command("--configfile", "tiny.yaml", *arguments)
    if os.geteuid() == 0:
        if subprocess.run(["unshare", "-U", "true"], capture_output=True, check=False).returncode:
            pytest.skip("no user namespaces here (unshare -U)")
        command = ["unshare", "-U", *command]
    done = subprocess.run(command, cwd=project.folder, capture_output=True, text=True, timeout=600, check=False)
    assert "Traceback" not in done.stderr
    return done.returncode, [line for line in done.stderr.splitlines() if line.startswith(("radcal: ", "Protected"))]


def test_results_that_may_not_be_written_are_a_sentence(finished):
    out, listing = finished.out(), finished.listing()
    (out / "runs").chmod(0o500)
    verdict, report = f"radcal: {finished.summary()['verdict']}", "radcal: report: results/tiny/report.html"
    assert without_rights(finished) == (0, [verdict, report]), "there is nothing to write"
    (out / "stop.json").unlink()
    # Snakemake finds the second while it plans, and the third would be met after the loop had gone on
    for name, mode, said in (
        ("runs", 0o700, "cannot be written (Permission denied); "),
        ("report.json", 0o600, "is write-protected, and is to be made again: "),
        ("iterations/0/proposal.json", 0o600, "is write-protected, and is to be made"),
    ):
        (out / name).chmod(mode - 0o200)
        code, (sentence,) = without_rights(finished)
        assert (code, sentence.startswith(f"radcal: results/tiny/{name} {said}")) == (1, True), sentence
        (out / name).chmod(mode)
    left = finished.listing()
    assert {**left, "stop.json": listing["stop.json"]} == listing


def test_a_job_that_fails_with_nobody_to_read_it_ends(project):
    """Snakemake's scheduler, left to itself, waits for ever after a callback could not print."""
    (project.folder / "labels.tif").write_text("nonsense")
    with subprocess.Popen(
        project.command("scene", "--configfile", "tiny.yaml"),
        cwd=project.folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    ) as process:
        assert process.stdout.readline()
        process.stdout.close()
        try:
            assert process.wait(120) == 1
        finally:
            process.kill()
    assert "labels.tif cannot be read" in (project.out() / "logs/failure.txt").read_text()


def test_out_of_memory_is_a_sentence(tmp_path):
    code = (
        "from radcal.session.jobs import logged\nimport resource\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31))\n"
        "import numpy as np\n"
        f"with logged({str(tmp_path / 'job.log')!r}):\n    np.ones(2**40)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("radcal: not enough memory")
    assert "Traceback" not in done.stderr


SLOW = """
import os, time
replace = os.replace
def slow(source, target, **options):
    time.sleep(0.3)
    replace(source, target, **options)
os.replace = os.rename = slow
"""


def test_a_slow_rename_shows_no_half_file(project, monkeypatch):
    (project.folder / "slow").mkdir()
    (project.folder / "slow" / "sitecustomize.py").write_text(SLOW)
    with monkeypatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(project.folder / "slow"), os.environ.get("PYTHONPATH", "")]))
        # in the middle of a renaming: its temporary file is there
        project.killed_when(
            lambda: len(project.records()) >= 4 and any((project.out() / "runs").glob(".partial-*")),
            "design", "--configfile", "tiny.yaml",
        )  # fmt: skip
    goes_on(project, "design", "--configfile", "tiny.yaml")
    assert len(project.records()) == 13
    assert not list(project.out().rglob(".partial-*"))
    assert not list(project.out().rglob("*.damaged"))


@pytest.mark.parametrize("hours", [-26, 26], ids=["backwards", "forwards"])
def test_a_clock_that_jumps(finished, hours):
    project, expected = finished, result(finished)
    shutil.rmtree(project.out() / "iterations")
    (project.out() / "calibration.h5").unlink()
    # a clock that goes back leaves files of the future behind
    for path in project.folder.rglob("*"):
        if path.is_file():
            stamp = path.stat().st_mtime_ns - hours * 3600 * 10**9
            os.utime(path, ns=(stamp, stamp))
    goes_on(project, "--configfile", "tiny.yaml")
    assert result(project) == expected


def test_a_hundred_damaged_stores_are_recognised(finished):
    out, random = finished.out(), np.random.default_rng(4)
    # the images of 32 looks are no outputs of rules: the store that reads one sets a damaged one aside, as with runs
    every = [path for path in sorted(out.rglob("*")) if path.parent.name != "draws" and path.is_file()]
    files = [path for path in every if path.suffix in (".h5", ".json")]
    assert {path.stem for path in files} >= set(SEALED)
    spare = finished.folder / "spare"
    shutil.copytree(out, spare)
    for _ in range(100):
        victims = [files[k] for k in random.choice(len(files), random.integers(1, 4), replace=False)]
        for path in victims:
            DAMAGES[random.integers(len(DAMAGES))](path, random)
        said = salvage(out, "tiny")
        for path in victims:
            assert not path.exists()
            assert path.with_suffix(".damaged").is_file()
            assert any(str(path) in sentence for sentence in said)
        # nothing else was touched, but indexes that list a run that is gone
        missing = {path for path in files if not path.exists()} - set(victims)
        assert all("list" in sentence for sentence in said if not any(str(path) in sentence for path in victims))
        assert bool(missing) <= any(path.parent.name == "runs" for path in victims)
        for path in {*victims, *missing}:
            shutil.copy2(spare / path.relative_to(out), path)
            path.with_suffix(".damaged").unlink(missing_ok=True)
    assert salvage(out, "tiny") == []


def test_the_same_command_mends_what_is_damaged(finished):
    random = np.random.default_rng(8)
    expected, before = result(finished), finished.records()
    listed = json.loads((finished.out() / "design/0.json").read_text())["data"][2]["key"]
    names = ("design/1.json", "iterations/0/proposal.json", "iterations/0/verified.json", f"runs/{listed}.h5")
    victims = [finished.out() / name for name in names]
    for path in victims:
        DAMAGES[random.integers(len(DAMAGES))](path, random)
    printed = finished.ended("--configfile", "tiny.yaml")
    assert "Traceback" not in printed
    for path in victims:
        assert f"{path.relative_to(finished.folder)}: is damaged" in printed
        assert path.is_file()
    after = finished.records()
    assert after.keys() == before.keys()
    assert {name for name in after if after[name] != before[name]} == {f"{listed}.h5"}
    assert result(finished) == expected
    again = finished.run("--configfile", "tiny.yaml")
    assert "Nothing to be done" in again.stdout


def test_files_of_another_case_are_made_again(finished):
    shutil.copytree(finished.out(), finished.out("other"))
    finished.write("other.yaml", case="other")
    before = finished.records("other")
    assert "belongs to the case 'tiny', expected 'other'" in finished.ended("design", "--configfile", "other.yaml")
    assert finished.records("other") == before
    scores = [read_json(finished.out(case) / "scores.json") for case in ("tiny", "other")]
    assert scores[0] == scores[1]
