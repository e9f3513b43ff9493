import logging
import os
import socket
import subprocess
import sys
import time

import pytest
from waiting import wait_until

from radcal.errors import MeasurementError
from radcal.session.jobs import FAILURE, OWNER, PASSES, PROGRESS, STARTED, Follower, logged, progress
from radcal.storage.files import alive
from radcal.storage.lock import CaseLock, claimed


@pytest.fixture(autouse=True)
def _keep_logging():
    """``logged`` takes over the root logger, as a job of its own may."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    for handler in root.handlers:
        if handler not in handlers:
            handler.close()
    root.handlers[:] = handlers
    root.setLevel(level)
    logging.captureWarnings(False)


def test_an_error_for_people_ends_in_its_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv(FAILURE, str(tmp_path / "failure.txt"))
    with pytest.raises(SystemExit) as stopped, logged(tmp_path / "job.log"):
        raise MeasurementError("image.tif has 3 bands, expected one.")
    assert stopped.value.code == "radcal: image.tif has 3 bands, expected one."
    assert (tmp_path / "failure.txt").read_text() == "radcal: image.tif has 3 bands, expected one.\n"
    assert "Traceback" in (tmp_path / "job.log").read_text()


def test_a_bug_says_where_its_traceback_is(tmp_path):
    with pytest.raises(SystemExit, match=r"internal error, ZeroDivisionError.*job\.log"), logged(tmp_path / "job.log"):
        _ = 1 / 0
    assert "ZeroDivisionError" in (tmp_path / "job.log").read_text()


def test_progress_goes_to_the_terminal_and_the_log(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(STARTED, str(time.time() - 75.5))
    with logged(tmp_path / "job.log"):
        progress("run 17: best rms 1e-4")
    assert capsys.readouterr().err == "[  1:15] run 17: best rms 1e-4\n"
    assert "run 17: best rms 1e-4" in (tmp_path / "job.log").read_text()
    assert (tmp_path / "job.progress").read_text() == "run 17: best rms 1e-4"


def test_lines_of_one_of_several_passes_name_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(STARTED, str(time.time()))
    for passes, number, name in (("2", "1", "pass 1: "), ("2", 2, "pass 2: "), ("2", None, ""), ("1", "1", "")):
        monkeypatch.setenv(PASSES, passes)
        with pytest.raises(SystemExit) as stopped, logged(tmp_path / "job.log", number=number):
            progress("reference run: 3.0 s")
            raise MeasurementError("no image.")
        assert capsys.readouterr().err == f"[  0:00] {name}reference run: 3.0 s\n"
        assert f" {name}reference run" in (tmp_path / "job.log").read_text()
        assert stopped.value.code == f"radcal: {name}no image."


def test_taking_the_lock_sweeps_what_dead_processes_left(tmp_path):
    left = tmp_path / "runs" / f".partial-{socket.gethostname()}-999999999-x.h5"
    left.parent.mkdir()
    left.write_text("half")
    lock = CaseLock(tmp_path)
    lock.acquire()
    lock.release()
    assert not left.exists()


@pytest.mark.slow
def test_a_run_that_another_process_holds_is_waited_for(tmp_path):
    code = (
        "import sys, time; from radcal.storage.lock import claimed\n"
        f"with claimed({str(tmp_path)!r}, 'ab12'):\n"
        " print('held', flush=True); time.sleep(1.0); print('done', flush=True)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with claimed(tmp_path, "ab13"):  # another run is free
            assert other.poll() is None
        with claimed(tmp_path, "ab12"):
            assert other.stdout.readline() == "done\n"


def test_a_job_is_killed_with_what_started_it(tmp_path):
    job = (
        "from radcal.session.jobs import die_with_parent; import time\n"
        "die_with_parent(); print('on', flush=True); time.sleep(60)"
    )
    parent = (
        "import subprocess, sys\n"
        f"job = subprocess.Popen([sys.executable, '-c', {job!r}], stdout=subprocess.PIPE)\n"
        "job.stdout.readline(); print(job.pid, flush=True); job.wait()"
    )
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True) as process:
        pid = int(process.stdout.readline())
        assert alive(pid)
        process.kill()
    wait_until(lambda: not alive(pid), seconds=20)


def test_what_a_killed_snakemake_left_is_waited_for(tmp_path, capfd):
    # as a forked process does, it holds the lock of one that is dead
    code = (
        f"import fcntl, socket, time; file = open({str(tmp_path / '.lock')!r}, 'a+')\n"
        "fcntl.flock(file, fcntl.LOCK_EX); file.truncate(0)\n"
        "file.write('999999999 ' + socket.gethostname()); file.flush(); print('held', flush=True); time.sleep(1.0)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        lock = CaseLock(tmp_path)
        lock.acquire()
        assert other.wait(timeout=10) == 0
        lock.release()
    assert "waiting for jobs that the killed snakemake 999999999 left" in capfd.readouterr().err


def test_a_job_whose_snakemake_has_ended_does_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("radcal.session.jobs.die_with_parent", lambda: None)  # the tests go on where their shell ends
    monkeypatch.setenv(OWNER, "999999999")
    with pytest.raises(SystemExit, match="the snakemake that started this job has ended"), logged(tmp_path / "job.log"):
        pytest.fail("the block must not run")
    assert not (tmp_path / "job.log").exists()


def test_lines_of_a_job_elsewhere_are_shown_whole_and_once(tmp_path, monkeypatch, capsys):
    path = tmp_path / "logs" / "progress.txt"
    follower = Follower(path)
    monkeypatch.setenv(PROGRESS, str(path))
    monkeypatch.delenv(STARTED, raising=False)
    monkeypatch.delenv(FAILURE, raising=False)
    progress("run 1")
    follower._show()  # as its thread does every second
    with pytest.raises(SystemExit), logged(tmp_path / "job.log"):
        raise MeasurementError("image.tif has 3 bands, expected one.")
    with path.open("a") as file:
        file.write("half a li")
    follower.stop()
    assert capsys.readouterr().err == "[  0:00] run 1\nradcal: image.tif has 3 bands, expected one.\n"


@pytest.mark.parametrize(("first", "collects"), [("snakemake.script", "False"), ("radcal", "True")])
def test_imports_of_a_job_are_not_searched_for_garbage_and_programs_that_it_starts_collect_theirs(
    tmp_path, first, collects
):
    code = (
        f"import {first}\n"
        "import gc, sys, radcal\n"
        "from radcal.session.jobs import logged\n"
        "print(gc.isenabled())\n"
        "with logged(sys.argv[1]):\n"
        "    kept, own = gc.get_freeze_count(), [[k] for k in range(3000)]\n"
        "    print(gc.isenabled(), kept > 10_000)\n"
        "print(gc.get_freeze_count() > kept + 2000)\n"
    )
    environment = {**os.environ, OWNER: str(os.getpid())}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "job.log")], env=environment, capture_output=True, text=True
    )
    # an external program in Python that imports radcal inherits the environment, and never enters `logged`
    assert done.stdout.split() == [collects, "True", "True", "True"], done.stderr
