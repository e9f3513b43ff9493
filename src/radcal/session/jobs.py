"""Context manager for every workflow job: it opens the log file and prints a one-line error message after a failure."""

from __future__ import annotations

import gc
import logging
import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from radcal.config.stages import STAGES
from radcal.errors import RadcalError
from radcal.processes import die_with_parent
from radcal.session.terminal import Repeated, guard
from radcal.storage.files import alive
from radcal.storage.records import provenance

# environment variables that the session sets for its jobs
CASE = "RADCAL_CASE"  # name of the case
COMMAND = "RADCAL_COMMAND"  # command line of the Snakemake process that plans the jobs
STARTED = "RADCAL_STARTED"  # time when this invocation began [s since 1970]
OWNER = "RADCAL_OWNER"  # process number of the Snakemake process that starts the jobs on this machine
PASSES = "RADCAL_PASSES"  # number of passes of the case
FAILURE = "RADCAL_FAILURE"  # file to which a failed job writes its error message
PROGRESS = "RADCAL_PROGRESS"  # file for the progress lines of jobs on other machines, which have no terminal

# environment variable that the command radcal sets for the session
RESULTS = "RADCAL_RESULTS"  # folder that contains the results folders of all cases; results if missing


_pass = [""]  # name of the pass that this job works on, with which its lines begin; empty for a job of all passes
_latest: list[Path] = []  # file beside the log of this job that holds the job's last line of progress, for radcal show


@contextmanager
def job(snakemake: Any) -> Iterator[Any]:
    """Context of a script, which gives the configuration sections that the stage reads (:func:`logged`).

    Parameters
    ----------
    snakemake : snakemake.script.Snakemake
        Job of a stage. If it has the parameter ``case``, the sections are restored from it. The number of its pass is
        the wildcard ``p``, or the first number of the parameter ``part``.
    """
    sections = snakemake.params.get("case")
    p, _ = snakemake.params.get("part", (snakemake.wildcards.get("p"), None))
    with logged(snakemake.log[0], sections, p):
        yield STAGES[snakemake.rule].model.model_validate(sections or {})


@contextmanager
def logged(
    path: str | Path, config: Mapping[str, Any] | None = None, number: int | str | None = None
) -> Iterator[None]:
    """Context that logs to a file; after an exception it prints a one-line error message and exits.

    The message of a :class:`RadcalError` is printed unchanged. After a lack of memory, the printed message names ways
    to need less memory. For every other exception, the printed message names the log file, which contains the
    traceback.

    Parameters
    ----------
    path : path
        Log file of the job.
    config : mapping, optional
        Sections of the configuration that the job reads; every file that the job writes records these sections.
    number : int or str, optional
        Number of the pass, for a job of a single pass. If the case has several passes, the lines and the error message
        of the job begin with the name of the pass.
    """
    guard()
    several = int(os.environ.get(PASSES, "1")) > 1
    _pass[0] = "" if number is None or not several else f"pass {number}: "
    gc.freeze()  # the garbage collector need not search the imported objects, which exist until the job ends
    gc.enable()
    if OWNER in os.environ:
        die_with_parent()
        if not alive(int(os.environ[OWNER])):  # the parent ended before die_with_parent() took effect
            sys.exit("radcal: the snakemake that started this job has ended.")
    # on a full disk only the failed write of a result reports an error, not every log line
    logging.raiseExceptions = False
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
    _latest[:] = [Path(path).with_suffix(".progress")]
    try:
        with provenance(os.environ.get(CASE), config):
            yield
    except RadcalError as error:
        _fail(f"radcal: {_pass[0]}{error}")
    except MemoryError as error:
        _fail(
            f"radcal: not enough memory ({str(error) or 'no more was given'}): use fewer --cores, larger pixels or a "
            "smaller scene, or a larger machine (finished runs are kept)."
        )
    except Exception as error:
        _fail(f"radcal: internal error, {type(error).__name__}: {error} (the traceback is in {path}).")
    finally:
        # otherwise Python would search all modules for garbage at exit, which takes a tenth of a small job's time
        gc.freeze()


def _fail(sentence: str) -> NoReturn:
    """Write the traceback to the log, save the error message for the session, and exit with this message."""
    logging.getLogger("radcal").exception("failed")
    if FAILURE in os.environ:
        with suppress(OSError):  # the disk may be full, which may be the reason for the failure
            Path(os.environ[FAILURE]).write_text(sentence + "\n", encoding="utf-8")
    if PROGRESS in os.environ:
        _say(sentence)
    sys.exit(sentence)


def elapsed() -> str:
    """Time since the start of the Snakemake command, as minutes and seconds."""
    return clock(time.time() - float(os.environ.get(STARTED, time.time())))


def clock(seconds: float) -> str:
    """Text that gives a time [s] in minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def progress(line: str) -> None:
    """Print one line with the elapsed time on the terminal, and write it to the job's log and to a file beside the log.

    In a case of several passes, the line of a job of a single pass begins with the name of the pass.
    """
    line = f"{_pass[0]}{line}"
    logging.getLogger("radcal").info(line)
    for path in _latest:
        with suppress(OSError):  # the disk may be full
            path.write_text(line, encoding="utf-8")
    _say(f"[{elapsed():>6}] {line}")


def _say(text: str) -> None:
    """Print a line on the terminal, or, in a job on another machine, write the line to the progress file."""
    if PROGRESS in os.environ:
        # one write for each line, because several jobs share the file; a job continues if the write fails (full disk)
        with suppress(OSError), Path(os.environ[PROGRESS]).open("ab", buffering=0) as file:
            file.write(f"{text}\n".encode())
    else:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


class Follower(Repeated):
    """Printer of the lines of the progress file on the terminal; jobs on other machines write this file.

    Parameters
    ----------
    path : path
        Progress file, whose path the jobs get from the environment variable :data:`PROGRESS`. The constructor empties
        the file.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._path.write_bytes(b"")
        self._shown = 0
        super().__init__(self._show)

    def stop(self) -> None:
        """Print the remaining lines of the progress file, and end the thread."""
        super().stop()
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
