"""Context of every workflow job: log file, progress lines, one sentence on failure."""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from radcal.errors import RadcalError
from radcal.running.terminal import guard
from radcal.storage.files import alive
from radcal.storage.provenance import provenance

__all__ = [
    "CASE",
    "FAILURE",
    "OWNER",
    "PROGRESS",
    "STARTED",
    "Follower",
    "die_with_parent",
    "elapsed",
    "logged",
    "progress",
]

# environment variables that the session sets for its jobs
CASE = "RADCAL_CASE"  # name of the case
STARTED = "RADCAL_STARTED"  # time when this invocation began [s since 1970]
OWNER = "RADCAL_OWNER"  # process number of the Snakemake that starts jobs on this machine
FAILURE = "RADCAL_FAILURE"  # file to which a failed job writes its sentence
PROGRESS = "RADCAL_PROGRESS"  # file to which jobs on other machines, which have no terminal, write their lines

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def die_with_parent() -> None:
    """Ask the operating system to kill this process when its parent ends for any reason; Linux only.

    A job that outlives its Snakemake would write the same files as the jobs of the next command.

    References
    ----------
    prctl(2), PR_SET_PDEATHSIG. The parent is the thread that started the process, which waits for it.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def logged(path: str | Path, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Context that logs to a file and turns an exception into an exit with one sentence.

    The sentence is that of a :class:`RadcalError`; for other exceptions it names the log, which has the traceback.

    Parameters
    ----------
    path : path
        Log file of the job.
    config : mapping, optional
        Sections of the configuration that the job reads; they are recorded in the files that it writes.
    """
    guard()
    gc.freeze()  # what the imports made lasts to the end
    if OWNER in os.environ:
        die_with_parent()
        if not alive(int(os.environ[OWNER])):  # the parent ended before the system was told to watch it
            sys.exit("radcal: the snakemake that started this job has ended.")
    logging.raiseExceptions = False  # a full disk is reported once, by the write that failed
    try:
        logging.basicConfig(
            filename=path,
            filemode="w",
            level=logging.INFO,
            format="%(asctime)s %(levelname)s %(name)s: %(message)s",
            force=True,
        )
    except OSError as error:
        sys.exit(f"radcal: {path}: cannot be written ({error.strerror or error}).")
    logging.captureWarnings(True)
    try:
        with provenance(os.environ.get(CASE), config):
            yield
    except RadcalError as error:
        _fail(f"radcal: {error}")
    except MemoryError as error:
        _fail(
            f"radcal: not enough memory ({str(error) or 'no more was given'}): use fewer --cores, larger pixels or a "
            "smaller scene, or a larger machine (finished runs are kept)."
        )
    except Exception as error:
        _fail(f"radcal: internal error, {type(error).__name__}: {error} (the traceback is in {path}).")
    finally:
        # without it Python would search all modules for garbage at exit, which takes a tenth of a small job's time
        gc.freeze()


def _fail(sentence: str) -> NoReturn:
    """Exit with a sentence; the traceback goes to the log, and Snakemake's own message is suppressed."""
    logging.getLogger("radcal").exception("failed")
    if FAILURE in os.environ:
        with suppress(OSError):  # the job may have failed because the disk is full
            Path(os.environ[FAILURE]).write_text(sentence + "\n", encoding="utf-8")
    if PROGRESS in os.environ:
        _say(sentence)
    sys.exit(sentence)


def elapsed() -> str:
    """Time since the Snakemake command began, as minutes and seconds."""
    seconds = int(time.time() - float(os.environ.get(STARTED, time.time())))
    return f"{seconds // 60}:{seconds % 60:02d}"


def progress(line: str) -> None:
    """Print one line on the terminal, and write it to the job's log file."""
    logging.getLogger("radcal").info(line)
    _say(f"[{elapsed():>6}] {line}")


def _say(text: str) -> None:
    """Write a line to the terminal, or to the progress file of jobs on other machines."""
    if PROGRESS in os.environ:
        # one write for each line, because several jobs share the file; a failed write (full disk) fails no job
        with suppress(OSError), Path(os.environ[PROGRESS]).open("ab", buffering=0) as file:
            file.write(f"{text}\n".encode())
    else:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


class Follower:
    """Thread that prints on the terminal what jobs on other machines write to the progress file.

    Parameters
    ----------
    path : path
        File that :data:`PROGRESS` names in the jobs; it is emptied first.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._path.write_bytes(b"")
        self._shown = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Print the remaining lines of the progress file, and end the thread."""
        self._ended.set()
        self._thread.join()
        self._show()

    def _follow(self) -> None:
        while not self._ended.wait(1.0):
            self._show()

    def _show(self) -> None:
        try:
            with self._path.open("rb") as file:
                file.seek(self._shown)
                whole, newline, _ = file.read().rpartition(b"\n")
        except FileNotFoundError:  # the folder of the logs was deleted
            return
        self._shown += len(whole + newline)
        sys.stderr.write((whole + newline).decode(errors="replace"))
        sys.stderr.flush()
