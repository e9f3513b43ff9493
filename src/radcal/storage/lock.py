"""Advisory locks on cases and on runs; the operating system releases a lock when the locking process ends."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, TextIO

from radcal.errors import StoreError
from radcal.storage.files import alive, sweep

logger = logging.getLogger(__name__)


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
