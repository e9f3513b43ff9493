"""What every workflow job does around its work: log, progress line, one sentence on failure."""

from __future__ import annotations

import ctypes
import logging
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from radcal.errors import RadcalError
from radcal.files import alive
from radcal.records import provenance

__all__ = ["CASE", "FAILURE", "OWNER", "STARTED", "die_with_parent", "elapsed", "logged", "progress"]

# environment variables that the Snakefile sets for its jobs
CASE = "RADCAL_CASE"  # name of the case
STARTED = "RADCAL_STARTED"  # when this invocation began [s since 1970]
OWNER = "RADCAL_OWNER"  # process of the Snakemake that starts jobs here
FAILURE = "RADCAL_FAILURE"  # file that takes a failed job's sentence

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def die_with_parent() -> None:
    """Have this process killed when the one that started it ends, however that ends; Linux only.

    A job that outlives its Snakemake would write what the same command, typed again, is making.

    References
    ----------
    prctl(2), PR_SET_PDEATHSIG. The parent is the thread that started the process, which waits for it.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def logged(path: str | Path, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Log to a file; end a :class:`RadcalError` with its sentence, anything else with where to look.

    Parameters
    ----------
    path : path
        The job's log file.
    config : mapping, optional
        Sections of the configuration that the job depends on, for the files that it writes.
    """
    if OWNER in os.environ:
        die_with_parent()
        if not alive(int(os.environ[OWNER])):  # it ended before that was asked for
            sys.exit("radcal: the snakemake that started this job has ended.")
    logging.raiseExceptions = False  # a full disk is told once, by what needed it
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


def _fail(sentence: str) -> NoReturn:
    """Leave with a sentence; the traceback goes to the log, and the workflow is told not to add its own words."""
    logging.getLogger("radcal").exception("failed")
    if FAILURE in os.environ:
        with suppress(OSError):  # a full disk, which the sentence may be about
            Path(os.environ[FAILURE]).write_text(sentence + "\n", encoding="utf-8")
    sys.exit(sentence)


def elapsed() -> str:
    """Time since the invocation began, as minutes and seconds."""
    seconds = int(time.time() - float(os.environ.get(STARTED, time.time())))
    return f"{seconds // 60}:{seconds % 60:02d}"


def progress(line: str) -> None:
    """Print one line for the person at the terminal, and log it."""
    logging.getLogger("radcal").info(line)
    sys.stderr.write(f"[{elapsed():>6}] {line}\n")
    sys.stderr.flush()
