"""What every workflow job does around its work: log, progress line, one sentence on failure."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from radcal.errors import RadcalError

__all__ = ["FAILURE", "PROGRESS", "STARTED", "Follower", "elapsed", "logged", "progress"]

# environment variables that the Snakefile sets for its jobs
STARTED = "RADCAL_STARTED"  # when this invocation began [s since 1970]
FAILURE = "RADCAL_FAILURE"  # file that takes a failed job's sentence
PROGRESS = "RADCAL_PROGRESS"  # file that takes the lines of jobs on other machines, which have no terminal


@contextmanager
def logged(path: str | Path) -> Iterator[None]:
    """Log to a file; end a :class:`RadcalError` with its sentence, anything else with where to look.

    Parameters
    ----------
    path : path
        The job's log file.
    """
    logging.basicConfig(
        filename=path,
        filemode="w",
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
        force=True,
    )
    logging.captureWarnings(True)
    try:
        yield
    except RadcalError as error:
        _fail(f"radcal: {error}")
    except Exception as error:
        _fail(f"radcal: internal error, {type(error).__name__}: {error} (the traceback is in {path}).")


def _fail(sentence: str) -> NoReturn:
    """Leave with a sentence; the traceback goes to the log, and the workflow is told not to add its own words."""
    logging.getLogger("radcal").exception("failed")
    if FAILURE in os.environ:
        Path(os.environ[FAILURE]).write_text(sentence + "\n", encoding="utf-8")
    if PROGRESS in os.environ:
        _say(sentence)
    sys.exit(sentence)


def elapsed() -> str:
    """Time since the invocation began, as minutes and seconds."""
    seconds = int(time.time() - float(os.environ.get(STARTED, time.time())))
    return f"{seconds // 60}:{seconds % 60:02d}"


def progress(line: str) -> None:
    """Print one line for the person at the terminal, and log it."""
    logging.getLogger("radcal").info(line)
    _say(f"[{elapsed():>6}] {line}")


def _say(text: str) -> None:
    """Write a line for people, where they will see it."""
    if PROGRESS in os.environ:
        # in one piece: lines of several jobs meet in the file
        with Path(os.environ[PROGRESS]).open("ab", buffering=0) as file:
            file.write(f"{text}\n".encode())
    else:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


class Follower:
    """Shows at the terminal what jobs on other machines write to a file.

    Parameters
    ----------
    path : path
        The file that :data:`PROGRESS` names in the jobs; emptied.
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
        """Show what is still to be shown, and end."""
        self._ended.set()
        self._thread.join()
        self._show()

    def _follow(self) -> None:
        while not self._ended.wait(1.0):
            self._show()

    def _show(self) -> None:
        with self._path.open("rb") as file:
            file.seek(self._shown)
            whole, newline, _ = file.read().rpartition(b"\n")
        self._shown += len(whole + newline)
        sys.stderr.write((whole + newline).decode(errors="replace"))
        sys.stderr.flush()
