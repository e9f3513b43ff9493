"""Lines for people when nobody reads them, and which of Snakemake's are shown."""

import atexit
import contextlib
import errno
import logging
import os
import re
import subprocess
import sys
import threading

import pytest

from radcal.session.terminal import BAR, Bar, Guarded, Messages, can_draw

PRINTS = """
import logging, os, sys
from radcal.session.terminal import guard
logger = logging.getLogger("snakemake")
logger.addHandler(logging.StreamHandler(sys.stderr))
guard(logger)
guard(logger)
for k in range(3000):
    logger.warning("line %d", k)
    print("line", k, flush=True)
    sys.stderr.write(f"line {k}\\n")
    sys.stderr.flush()
CHILD = "import sys; from radcal.session.terminal import guard; guard(); sys.stderr.write('child'); sys.stderr.flush()"
child = os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", CHILD])
open("done.txt", "w").write(f"{child} {sorted(number for number in range(3) if os.fstat(number))}")
"""


@pytest.mark.parametrize("ending", ["2>&1 | head -1", ">&-", "<&- >&- 2>&-", ">/dev/full 2>&1"])
def test_whoever_prints_goes_on_without_a_reader(tmp_path, ending):
    (tmp_path / "prints.py").write_text(PRINTS)
    script = f"({sys.executable} prints.py; echo $? > code.txt) {ending}; while [ ! -s code.txt ]; do sleep 0.05; done"
    subprocess.run(["bash", "-c", script], cwd=tmp_path, check=False, timeout=60, capture_output=True)
    assert (tmp_path / "code.txt").read_text() == "0\n"
    assert (tmp_path / "done.txt").read_text() == "0 [0, 1, 2]"


def test_what_somebody_reads_is_whole(tmp_path):
    (tmp_path / "prints.py").write_text(PRINTS)
    done = subprocess.run([sys.executable, "prints.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"line {k}" for k in range(3000)]
    assert done.stderr == "".join(f"line {k}\nline {k}\n" for k in range(3000)) + "child"


class FailsOnce:
    """A file whose first text meets an error of the system."""

    def __init__(self, file, number):
        self._file, self._number = file, number
        self.fileno, self.flush = file.fileno, file.flush

    def write(self, text):
        if self._number:
            self._number, number = 0, self._number
            raise OSError(number, "")
        self._file.write(text)


@pytest.mark.parametrize(("number", "left"), [(errno.ENOSPC, "later"), (errno.EPIPE, "")])
def test_a_full_disk_may_have_room_again_and_a_closed_pipe_stays_closed(tmp_path, number, left):
    with (tmp_path / "out.txt").open("w") as file:
        guarded = Guarded(FailsOnce(file, number))
        atexit.unregister(guarded._end)
        assert guarded.write("lost") == 4
        guarded.write("later")
        guarded.flush()
    assert (tmp_path / "out.txt").read_text() == left


def screen(text: str) -> list[str]:
    """Lines that a terminal shows, where a line may be erased before it is written again."""
    return [line.rpartition("\r\x1b[2K")[2].rstrip("\r") for line in text.split("\n")]


def test_a_bar_stays_below_the_lines_of_all_processes(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "12")
    ours, theirs = os.openpty()
    child = "from radcal.session.terminal import guard; import sys; guard(); print('of a job', file=sys.stderr)"
    with os.fdopen(theirs, "w") as terminal:
        stream = Guarded(terminal)
        atexit.unregister(stream._end)
        assert can_draw(stream)
        drawn = threading.Event()
        bar = Bar(stream, lambda: drawn.set() or "3 of about 11 runs")
        stream.write("first ")
        assert drawn.wait(10)
        stream.write("line\n")
        drawn.clear()
        subprocess.run([sys.executable, "-c", child], stderr=terminal, check=True)
        assert drawn.wait(10)
        bar.stop()
        stream.write("last\n")
    shown = ""
    with contextlib.suppress(OSError):  # when all is read
        while True:
            shown += os.read(ours, 10_000).decode()
    os.close(ours)
    assert "3 of about \x1b" not in shown  # a line of 12 columns holds 11 characters before it is broken
    assert "3 of about " in shown
    assert screen(shown) == ["first line", "of a job", "last", ""]
    assert BAR not in os.environ


def test_only_a_terminal_that_can_erase_has_a_bar(monkeypatch, tmp_path):
    ours, theirs = os.openpty()
    with os.fdopen(theirs, "w") as terminal:
        for term, expected in (("dumb", False), ("xterm", True)):
            monkeypatch.setenv("TERM", term)
            assert can_draw(terminal) is expected
        monkeypatch.delenv("TERM")
        assert not can_draw(terminal)
    os.close(ours)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv(BAR, "1")
    with (tmp_path / "out.txt").open("w") as file:
        assert not can_draw(file)
        redirected = Guarded(file)
        atexit.unregister(redirected._end)
        redirected.write("a line\n")
    assert (tmp_path / "out.txt").read_text() == "a line\n"  # also beside a bar of standard error


def shown(messages: Messages, text: str) -> str | None:
    record = logging.LogRecord("snakemake", logging.INFO, "", 0, text, None, None)
    if exception := re.match(r"\w+(Exception|Error)\b", text):
        record.exception = exception[0]  # as Snakemake's event ERROR has it
    return str(record.msg) if messages.filter(record) else None


AFTERMATH = [
    "Cannot restore results/tiny/scene.h5: no backup found.",
    "Restored previous version of results/tiny/scene.h5 (updating job failed).",
    "Removing output files of failed job scene since they might be corrupted:\nresults/tiny/scene.h5",
    "Exiting because a job execution failed. Look above for error messages",
    "WorkflowError:\nAt least one job did not complete successfully.",
]


@pytest.mark.parametrize("text", AFTERMATH)
def test_a_failure_in_its_own_sentence_is_not_explained_twice(text):
    assert shown(Messages(lambda: True), text) is None
    assert shown(Messages(lambda: False), text) == text


def test_the_routine_is_left_out_and_ctrl_c_explains_what_follows():
    messages = Messages(lambda: False)
    assert shown(messages, "Select jobs to execute...") is None
    assert shown(messages, "Nothing to be done.") == "Nothing to be done."
    assert not messages.interrupted
    assert shown(messages, "Terminating processes on user request, this might take some time.") is None
    assert messages.interrupted
    assert shown(messages, AFTERMATH[3]) is None


def test_sigterm_is_told_once_and_explains_the_end():
    messages = Messages(lambda: False)
    killed = "RuleException:\nCalledProcessError in file scene.smk:\nCommand 'x' died with <Signals.SIGTERM: 15>."
    assert shown(messages, killed) == killed
    will_exit = "Will exit after finishing currently running jobs (scheduler)."
    assert str(shown(messages, will_exit)).startswith("radcal: SIGTERM: the command ends as soon as the jobs that")
    assert shown(messages, will_exit) is None
    assert messages.terminated
    assert not messages.interrupted
    for text in ("Shutting down, this might take some time.", killed, *AFTERMATH[:3], AFTERMATH[4]):
        assert shown(messages, text) is None
    failed = killed.replace("died with <Signals.SIGTERM: 15>", "returned non-zero exit status 1")
    assert shown(messages, failed) == failed  # as a job may fail while Snakemake waits


def test_write_protected_outputs_become_a_sentence():
    path = "/data/my results/tiny/summary.json"
    text = (
        'ProtectedOutputException in rule report in file "/p/workflow/rules/report.smk", line 82:\n'
        f"Write-protected output files for rule report:\n    output: {path}\n    affected files:\n        {path}\n"
    )
    assert shown(Messages(lambda: False), text) == (
        f"radcal: {path} is write-protected, and is to be made again: make it writable (chmod u+w), "
        "or give the case another name (case: ...)."
    )


def test_progress_without_a_place_fails_no_job(tmp_path, monkeypatch):
    from radcal.session.jobs import PROGRESS, progress

    monkeypatch.setenv(PROGRESS, os.fspath(tmp_path / "gone" / "progress.txt"))
    progress("run 17")
