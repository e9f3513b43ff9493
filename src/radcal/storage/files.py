"""Atomic writes (temporary name, flush, rename), removal of killed processes' files, and digests of plain data.

Locks on cases and on runs are advisory; the operating system releases a lock when the locking process ends.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import logging
import os
import shutil
import socket
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TextIO

from radcal.errors import StoreError

_PARTIAL = ".partial-"
logger = logging.getLogger(__name__)


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path; after the ``with`` block, flush the file there and rename it to ``path``.

    If the block raises an exception, the temporary file is removed.

    Raises
    ------
    StoreError
        The file cannot be written.
    """
    path = Path(path)
    partial = path.with_name(f"{_PARTIAL}{socket.gethostname()}-{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        with partial.open("rb") as handle:
            os.fsync(handle.fileno())
        partial.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror or error}).") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()


def first_difference(theirs: Any, ours: Any, key: str = "") -> str:
    """Text that states the first difference between two sets of plain data: the key and both values."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for name in [*ours, *(name for name in theirs if name not in ours)]:
            if theirs.get(name) != ours.get(name):
                return first_difference(theirs.get(name), ours.get(name), f"{key}.{name}" if key else name)
    return f"{key} is {theirs!r} there, {ours!r} here"


def digest(data: Any) -> str:
    """Hash of plain data, as twenty hex digits; the order of keys does not change the hash."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def file_sha256(path: Path) -> str:
    """SHA-256 of the bytes of a file, in hexadecimal digits."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def working_folder(parent: str | Path) -> Path:
    """Create an empty folder that :func:`sweep` removes after the end of this process.

    Parameters
    ----------
    parent : path
        Folder in which the new folder is created. A missing ``parent`` is created first.

    Raises
    ------
    StoreError
        The folder cannot be created.
    """
    try:
        Path(parent).mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"{_PARTIAL}{socket.gethostname()}-{os.getpid()}-", dir=parent))
    except OSError as error:
        raise StoreError(f"{parent}: no folder can be made there ({error.strerror or error}).") from error


def sweep(folder: str | Path) -> int:
    """Remove temporary files and folders of processes that have ended on this machine; return the number removed."""
    removed = 0
    host = socket.gethostname()
    for partial in list(Path(folder).rglob(f"{_PARTIAL}{host}-*")):
        pid = partial.name.removeprefix(f"{_PARTIAL}{host}-").split("-", 1)[0]
        if not pid.isdigit() or not alive(int(pid)):
            if partial.is_dir() and not partial.is_symlink():
                shutil.rmtree(partial, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):  # the file belongs to another user, in a folder that is not writable
                    partial.unlink()
            removed += 1
    return removed


def case_folder(path: str | Path) -> Path:
    """Results folder ``results/<case>`` of a file that lies there, or in the folder ``passes/<p>`` of its pass."""
    folder = Path(path).parent
    return folder.parent.parent if folder.parent.name == "passes" else folder


def unwritable(folder: str | Path) -> Path | None:
    """First folder, among ``folder`` and its subfolders, in which this process may not create files, or None.

    Parameters
    ----------
    folder : path
        ``results/<case>``, whose subfolder ``external`` is not checked.
    """
    for path, folders, _ in os.walk(folder):
        if not os.access(path, os.W_OK | os.X_OK):
            return Path(path)
        if Path(path) == Path(folder) and "external" in folders:
            folders.remove("external")
    return None


def clamp_future_mtimes(folder: str | Path) -> int:
    """Set modification times in the future to the present, without changing their order; return the number changed.

    Modification times in the future remain after the computer's clock was set back. With such files, Snakemake would
    fail every job whose output is older than its input. Run records, which Snakemake does not use, and the targets of
    links are not changed.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    """
    now = time.time_ns()
    dated = []
    # os.walk() does not follow links to folders
    for place, _, names in os.walk(folder):
        if Path(place).name == "runs":
            continue
        for path in (Path(place, name) for name in ("", *names)):
            with contextlib.suppress(OSError):  # another process has removed the file
                status = path.lstat()
                # a file with a further hard link may also be a user's file outside the results
                if stat.S_ISDIR(status.st_mode) or (stat.S_ISREG(status.st_mode) and status.st_nlink == 1):
                    dated.append((status.st_mtime_ns, path))
    future = sorted(item for item in dated if item[0] > now)
    for k, (_, path) in enumerate(reversed(future)):
        with contextlib.suppress(OSError):
            os.utime(path, ns=(now - k * 1000, now - k * 1000), follow_symlinks=False)
    return len(future)


def alive(pid: int) -> bool:
    """Whether the process with this number runs on this machine; a killed process that nobody waits for does not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _zombie(pid)


def _zombie(pid: int) -> bool:
    """Whether a process has ended and only its entry in the table of processes is left; false without /proc."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] == "Z"  # after the name of the program, see proc(5)


@dataclass(frozen=True)
class Holder:
    """Snakemake command that works on a case at this moment.

    Attributes
    ----------
    process : int
        Number of the command's process on ``host``.
    host : str
        Name of the machine on which the command runs.
    since : float
        Time at which the command began [s since 1970].
    """

    process: int
    host: str
    since: float


def holder(folder: str | Path) -> Holder | None:
    """Command that has locked a case's results folder; None if the folder is not locked.

    Parameters
    ----------
    folder : path
        ``results/<case>``; the function changes no file in it.
    """
    path = Path(folder) / ".lock"
    with contextlib.suppress(OSError, ValueError), path.open(encoding="ascii") as file:
        process, _, host = file.read().strip().partition(" ")
        # after the command's process has ended, its jobs may hold the lock for a moment
        if host == socket.gethostname() and not alive(int(process)):
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return Holder(int(process), host, path.stat().st_mtime)
    return None


class CaseLock:
    """Exclusive lock on a case's results folder.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    """

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder)
        self._file: TextIO | None = None

    def acquire(self) -> None:
        """Lock the folder and remove temporary files of killed processes there.

        If another Snakemake has locked the folder, this process exits with a one-line error message. If only jobs of a
        killed Snakemake hold the lock, this process waits until they end.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = (self._folder / ".lock").open("a+", encoding="ascii")
        except OSError as error:
            leave(f"{self._folder} cannot be written ({error.strerror}); results go there, so make it writable.")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            process, _, host = (file.read().strip() or "unknown").partition(" ")
            # this machine cannot check whether a process on another machine is alive
            if not process.isdigit() or host != socket.gethostname() or alive(int(process)):
                file.close()
                place = f" on {host}" if host and host != socket.gethostname() else ""
                leave(
                    f"another snakemake (process {process}{place}) is working on {self._folder}; wait for it, or stop "
                    "it and type the same command again."
                )
            # after Snakemake was killed, its child processes hold the lock until they end
            sys.stderr.write(f"radcal: waiting for jobs that the killed snakemake {process} left in {self._folder}.\n")
            fcntl.flock(file, fcntl.LOCK_EX)
        file.truncate(0)
        file.write(f"{os.getpid()} {socket.gethostname()}")
        file.flush()
        self._file = file
        sweep(self._folder)

    def release(self) -> None:
        """Release the lock."""
        if self._file is not None:
            self._file.close()
            self._file = None


@contextlib.contextmanager
def claimed(folder: str | Path, key: str) -> Iterator[None]:
    """Context that locks one run; this process first waits until no process on any machine holds the run's lock.

    Jobs of a killed workflow may still run, especially on a cluster. If a job of a killed workflow is simulating a run,
    the next command waits for the result instead of simulating the run again.

    Parameters
    ----------
    folder : path
        Folder of the run store.
    key : str
        Key of the run, in hexadecimal digits.

    Raises
    ------
    StoreError
        The folder cannot be written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / ".claims").open("a+b")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written ({error.strerror or error}).") from error
    with file:
        # Each run locks one byte of a single file, far beyond its end: a killed process leaves no lock file behind.
        place = int(key, 16) % 2**62
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
        except (BlockingIOError, PermissionError):
            logger.warning("run %s is being made by another process: waiting for it.", key)
            fcntl.lockf(file, fcntl.LOCK_EX, 1, place)
        except OSError as error:  # some network file systems support no locks; results do not depend on the lock
            logger.warning("%s: no locks there (%s).", folder, error)
        yield


def leave(sentence: str) -> NoReturn:
    """Print a one-line error message and exit at once, without an exception, to which Snakemake would add text."""
    sys.stderr.write(f"radcal: {sentence}\n")
    sys.stderr.flush()
    os._exit(1)
