"""Two commands on one case, and another version of radcal between two; kills are in tests/faults."""

import contextlib
import os
import shutil
import signal
import time

import pytest


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


@pytest.mark.parametrize("killed", [False, True])
def test_results_of_an_earlier_version_are_made_again_from_the_runs(finished, killed):
    records, summary, files = finished.records(), finished.summary(), finished.listing().keys()
    finished.lay_as_earlier()
    if killed:  # in the first iteration
        for name in ("iterations/0/verified.json", "final.json", "calibration.h5", "summary.json"):
            (finished.out() / name).unlink()
        for path in [*finished.out().glob("iterations/[1-9]*"), finished.out() / "posterior"]:
            shutil.rmtree(path)
    done = finished.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("the files of pass 1 lie in passes/1 now") == 1
    assert finished.records() == records
    assert finished.listing().keys() == files
    assert finished.summary()["materials"] == summary["materials"]
    assert "Nothing to be done" in finished.run("--configfile", "tiny.yaml").stdout
