"""kill -9 at any moment loses at most the run in flight; the same command ends in the same result."""

from __future__ import annotations

import contextlib
import os
import signal
import time

import h5py
import numpy as np
import pytest
from workflow_project import make_project


def kill_when(project, condition, *arguments):
    """Start the workflow and kill its whole process group once the condition holds."""
    process = project.start(*arguments)
    deadline = time.time() + 300
    while not condition():
        assert process.poll() is None, "the workflow ended before it could be killed"
        assert time.time() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def result(project):
    with h5py.File(project.out() / "calibration.h5") as file:
        return file["materials/field/parameters"][()], list(file["runs/key"].asstr()[()])


@pytest.mark.parametrize(
    ("records", "cores"),
    [(5, 2), (14, 1)],
    ids=["in the design, two cores", "in the loop, one core"],
)
def test_killed_and_continued_is_the_same_as_undisturbed(finished, tmp_path, records, cores):
    project = make_project(tmp_path / "killed")
    kill_when(project, lambda: len(project.records()) >= records, "--configfile", "tiny.yaml")
    before = project.records()
    assert len(before) >= records
    assert not (project.out() / "summary.json").exists()

    done = project.run("--configfile", "tiny.yaml", cores=cores)
    assert done.returncode == 0, done.stdout
    after = project.records()
    assert {name: after[name] for name in before} == before, "a finished run was made again"
    x, keys = result(project)
    expected_x, expected_keys = result(finished)
    np.testing.assert_array_equal(x, expected_x)
    assert keys == expected_keys
    mine, theirs = project.summary(), finished.summary()
    assert mine["materials"] == theirs["materials"]
    assert mine["runs"] == theirs["runs"]


def test_a_second_snakemake_on_the_case_says_so(project):
    process = project.start("--configfile", "tiny.yaml")
    try:
        deadline = time.time() + 60
        while not (project.out() / ".lock").is_file() or not (project.out() / ".lock").read_text():
            assert time.time() < deadline
            time.sleep(0.05)
        second = project.run("--configfile", "tiny.yaml")
        assert second.returncode != 0
        assert f"another snakemake (process {process.pid})" in second.stdout
        assert "Traceback" not in second.stdout
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_damaged_record_is_set_aside_and_made_again(project):
    assert project.run("design", "--configfile", "tiny.yaml").returncode == 0
    before = project.records()
    victim = sorted(project.out().glob("runs/*.h5"))[3]
    content = victim.read_bytes()
    victim.write_bytes(content[: len(content) // 2])
    done = project.run("design", "--forcerun", "reference_run", "design_chunk", "--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    after = project.records()
    assert after.keys() == before.keys()
    assert {name for name in after if after[name] != before[name]} == {victim.name}
    assert victim.with_suffix(".damaged").is_file()
