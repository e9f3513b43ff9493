import json
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from radcal.errors import StoreError
from radcal.storage.files import (
    alive,
    atomic,
    clamp_future_mtimes,
    digest,
    first_difference,
    sweep,
    unwritable,
    working_folder,
)


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_what_is_dated_in_the_future_is_dated_now_in_its_order(tmp_path):
    now = time.time_ns()
    ages = {"old.h5": -50, "first.h5": 10, "second.json": 20, "iterations/third.h5": 30, "runs/a.h5": 40}
    for name, seconds in ages.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
        os.utime(path, ns=(now, now + seconds * 10**9))
    old, record = (tmp_path / name for name in ("old.h5", "runs/a.h5"))
    kept = old.stat().st_mtime_ns, record.stat().st_mtime_ns
    assert clamp_future_mtimes(tmp_path) >= 3
    assert (old.stat().st_mtime_ns, record.stat().st_mtime_ns) == kept
    stamps = [(tmp_path / name).stat().st_mtime_ns for name in ages if name != "runs/a.h5"]
    assert stamps == sorted(set(stamps))
    assert stamps[-1] <= time.time_ns()


def test_files_behind_links_keep_their_dates(tmp_path):
    later = time.time_ns() + 60 * 10**9
    mine = tmp_path / "mine"
    results = tmp_path / "results" / "case"
    for name in ("data/a.tif", "b.tif", "c.tif"):
        (mine / name).parent.mkdir(parents=True, exist_ok=True)
        (mine / name).write_text("")
        os.utime(mine / name, ns=(later, later))
    (results / "work").mkdir(parents=True)
    (results / "work" / "data").symlink_to(mine / "data")
    (results / "work" / "b.tif").symlink_to(mine / "b.tif")
    os.link(mine / "c.tif", results / "work" / "c.tif")
    (results / "own.json").write_text("")
    os.utime(results / "own.json", ns=(later, later))
    assert clamp_future_mtimes(results) == 1
    assert (results / "own.json").stat().st_mtime_ns <= time.time_ns()
    assert {path.stat().st_mtime_ns for path in mine.rglob("*.tif")} == {later}


def test_the_first_difference_is_named_with_both_values():
    theirs = {"pass": {"looks": 4, "band": "X"}, "seed": 1}
    assert first_difference(theirs, {"pass": {"looks": 8, "band": "X"}, "seed": 2}) == "pass.looks is 4 there, 8 here"
    assert first_difference(theirs, {"pass": {"looks": 4}, "seed": 1}) == "pass.band is 'X' there, None here"


def test_atomic_shows_the_file_only_when_complete(tmp_path):
    path = tmp_path / "deep" / "er" / "a.txt"
    with atomic(path) as partial:
        partial.write_text("whole")
        assert not path.exists()
        assert partial.parent == path.parent
    assert path.read_text() == "whole"
    assert left_in(path.parent) == ["a.txt"]


def test_atomic_failure_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), atomic(path) as partial:
        partial.write_text("half of new")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert left_in(tmp_path) == ["a.txt"]


def test_folder_in_the_way_is_a_store_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be written"), atomic(tmp_path / "file" / "a.txt"):
        pytest.fail("the block must not run")
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(StoreError, match="cannot be written"), atomic(tmp_path / "a.txt") as partial:
        partial.write_text("")
    assert left_in(tmp_path) == ["a.txt", "file"]


def test_digest_is_of_the_data_not_of_its_order():
    assert digest({"a": 1, "b": [1, 2]}) == digest({"b": [1, 2], "a": 1})
    assert digest([1, 2]) != digest([2, 1])
    assert digest({"a": 1.0}) != digest({"a": 1.0 + 2**-52})
    assert re.fullmatch("[0-9a-f]{20}", digest({}))
    # the same in every session and on every machine
    assert digest({"a": 1}) == digest(json.loads('{"a": 1}')) == "015abd7f5cc57a2dd94b"


def test_digest_refuses_nan():
    with pytest.raises(ValueError, match="not JSON compliant"):
        digest({"x": float("nan")})


def test_sweep_removes_partials_of_dead_processes_only(tmp_path):
    host, gone = socket.gethostname(), 999999999
    dead = tmp_path / "runs" / f".partial-{host}-{gone}-a-b.h5"
    kept = [
        tmp_path / f".partial-{host}-{os.getpid()}-a.h5",
        tmp_path / f".partial-{host}-{os.getppid()}-a.h5",
        tmp_path / f".partial-elsewhere.{host}-{gone}-a.h5",
        tmp_path / "a.h5",
        tmp_path / f"partial-{host}-{gone}-a.h5",
    ]
    dead.parent.mkdir()
    for path in [dead, *kept]:
        path.write_text("")
    assert sweep(tmp_path) == 1
    assert not dead.exists()
    assert all(path.exists() for path in kept)
    assert sweep(tmp_path) == 0


def test_the_partial_file_of_another_user_is_kept(tmp_path, monkeypatch):
    """The system refuses to signal a process of another user, which lives."""
    partial = tmp_path / f".partial-{socket.gethostname()}-4242-a.h5"
    partial.write_text("")

    def refuse(pid, signal):
        raise {4242: PermissionError, 4243: ProcessLookupError}[pid]

    monkeypatch.setattr(os, "kill", refuse)
    assert (alive(4242), alive(4243)) == (True, False)
    assert sweep(tmp_path) == 0
    assert partial.exists()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system has no /proc")
def test_a_process_that_nobody_has_waited_for_is_dead(tmp_path):
    """Until its parent asks for its status, an ended process has its number, and signals can be sent to it."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        left = tmp_path / f".partial-{socket.gethostname()}-{process.pid}-run.h5"
        left.touch()
        assert alive(process.pid)
        assert sweep(tmp_path) == 0
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and stays in the table
        os.kill(process.pid, 0)
        assert not alive(process.pid)
        assert sweep(tmp_path) == 1
    assert not left.exists()


def test_a_folder_that_cannot_be_written_is_found(tmp_path, monkeypatch):
    """What stands in the case's own ``external`` is somebody else's, but not in a folder of that name further down."""
    for name in ("external/inner", "iterations/external"):
        (tmp_path / name).mkdir(parents=True)
    refused = {tmp_path / "external" / "inner"}
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in refused)
    assert unwritable(tmp_path) is None
    refused.add(tmp_path / "iterations" / "external")
    assert unwritable(tmp_path) == tmp_path / "iterations" / "external"


def test_working_folders_of_dead_processes_are_swept(tmp_path):
    mine = working_folder(tmp_path / "work")
    (mine / "file").write_text("kept")
    name = mine.name.replace(f"-{os.getpid()}-", "-999999999-")
    dead = mine.with_name(name)
    dead.mkdir()
    (dead / "inner").mkdir()
    (dead / "inner/file").write_text("gone")
    assert sweep(tmp_path) == 1
    assert (mine / "file").read_text() == "kept"
    assert not dead.exists()
