"""Two commands on one case, and a record that is damaged between two; kills are in tests/faults."""

import contextlib
import os
import signal
import time


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
