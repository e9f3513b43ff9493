"""Claims of runs and of folders among processes."""

import contextlib
import fcntl
import logging
import multiprocessing
import os
import signal
import socket

import pytest

from radcal.storage import lock
from radcal.storage.lock import CaseLock, claimed, holder


@pytest.fixture(autouse=True)
def _no_endless_wait():
    """A test that waits for a lock fails."""

    def late(*_):
        raise AssertionError("waited for a lock")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


KEY, OTHER = f"{5:020x}", f"{5 + 2**40:020x}"


@contextlib.contextmanager
def another_process(act):
    """A child that holds what ``act`` acquires for the length of the block."""
    fork = multiprocessing.get_context("fork")
    held, release = fork.Event(), fork.Event()

    def hold():
        with act:
            held.set()
            release.wait()

    child = fork.Process(target=hold)
    child.start()
    try:
        assert held.wait(10)
        yield
    finally:
        release.set()
        child.join()


def test_a_claim_is_of_one_run(tmp_path, caplog):
    with another_process(claimed(tmp_path, KEY)), (tmp_path / ".claims").open("r+b") as file:
        with pytest.raises(BlockingIOError):
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, 5)
        with caplog.at_level(logging.WARNING), claimed(tmp_path, OTHER):
            pass  # does not wait
        assert not caplog.records
    with claimed(tmp_path, KEY):  # free again
        assert not caplog.records


@contextlib.contextmanager
def working(folder, said=None):
    mine = CaseLock(folder)
    mine.acquire()
    if said is not None:
        (folder / ".lock").write_text(said)
    yield


@pytest.mark.parametrize("said", [None, "1 elsewhere", "unknown"])
def test_a_folder_in_use_is_left_alone(tmp_path, monkeypatch, said):
    """Process number and host are told; a process of another host may be alive whatever its number says here."""
    sentences = []

    def leave(sentence):
        sentences.append(sentence)
        raise SystemExit(1)

    monkeypatch.setattr(lock, "leave", leave)
    monkeypatch.setattr(lock, "alive", lambda pid: said is None)
    with another_process(working(tmp_path, said)), pytest.raises(SystemExit):
        CaseLock(tmp_path).acquire()
    place = " on elsewhere" if said == "1 elsewhere" else ""
    assert f"is working on {tmp_path}" in sentences[0]
    assert sentences[0].count(" on ") == (2 if place else 1)
    assert place in sentences[0]


def test_the_holder_of_a_folder_is_the_command_that_works_on_it(tmp_path):
    assert holder(tmp_path) is None
    mine = CaseLock(tmp_path)
    mine.acquire()
    found = holder(tmp_path)
    assert (found.process, found.host) == (os.getpid(), socket.gethostname())
    assert found.since == (tmp_path / ".lock").stat().st_mtime
    mine.release()
    assert holder(tmp_path) is None
    # jobs of a command that has ended may hold its lock, which is no command at work
    with (tmp_path / ".lock").open("r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write(f"{2**22 + 1} {socket.gethostname()}")
        file.flush()
        assert holder(tmp_path) is None
