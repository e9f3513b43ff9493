"""Terminal output that does not fail after the terminal or pipe was closed, a bar, and a filter of Snakemake's log.

``snakemake ... | head -1`` closes the pipe after one line. Without :func:`guard`, a job that prints a second line would
fail, and Snakemake's scheduler would wait for ever after one of its callbacks printed a line.
"""

from __future__ import annotations

import atexit
import errno
import logging
import os
import re
import shutil
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TextIO

BAR = "RADCAL_BAR"  # environment variable of a command that shows a bar, and of its jobs
_ERASE = "\r\x1b[2K"  # back to the start of the line, which is cleared


class Guarded:
    """Text stream that discards text if the reader of the stream has ended or the disk is full.

    Parameters
    ----------
    stream : text stream
        Standard output or standard error.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._new_line = True
        atexit.register(self._end)

    def write(self, text: str) -> int:
        """Write the text, ignore any error, and return the length of the text; a new line erases the bar."""
        first, self._new_line = self._new_line, text.endswith("\n") if text else self._new_line
        bar = bool(text) and first and BAR in os.environ
        self._try(lambda: self._stream.write(_ERASE * (bar and self._stream.isatty()) + text))
        return len(text)

    def draw(self, bar: str) -> None:
        """Show a bar at the foot of the terminal in place of the earlier one, unless a line is not yet complete."""
        if self._new_line:
            self._try(lambda: self._stream.write(_ERASE + bar))
            self.flush()

    def flush(self) -> None:
        """Flush the stream and ignore any error."""
        self._try(self._stream.flush)

    def _try(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            # later lines are still written, because a full disk may have space again
            if error.errno != errno.ENOSPC:
                self._mute()
        except ValueError:  # closed
            pass

    def _mute(self) -> None:
        """Discard all further output to the stream, by this process and by the processes that it starts."""
        with suppress(OSError, ValueError):
            nobody = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nobody, self._stream.fileno())
            os.close(nobody)

    def _end(self) -> None:
        """Flush the stream at exit and ignore errors, because a failed flush by Python would change the exit status."""
        try:
            self._stream.flush()
        except (OSError, ValueError):
            self._mute()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class Repeated:
    """Thread that calls a function every second.

    Parameters
    ----------
    act : callable
        The function.
    """

    def __init__(self, act: Callable[[], None]) -> None:
        self._act = act
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._repeat, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join()

    def _repeat(self) -> None:
        while not self._ended.wait(1.0):
            self._act()


class Bar(Repeated):
    """One line at the foot of the terminal, of this process and of its jobs, which is renewed every second.

    Several processes write lines to the terminal, each of which erases the bar first (:data:`BAR`).

    Parameters
    ----------
    stream : Guarded
        Standard error of this process.
    text : callable
        Function that returns the line.
    """

    def __init__(self, stream: Guarded, text: Callable[[], str]) -> None:
        self._stream, self._text = stream, text
        os.environ[BAR] = "1"
        super().__init__(self._renew)

    def stop(self) -> None:
        """Erase the bar."""
        super().stop()
        self._stream.draw("")
        del os.environ[BAR]

    def _renew(self) -> None:
        with suppress(OSError):  # the results folder was deleted
            self._stream.draw(self._text()[: shutil.get_terminal_size().columns - 1])


def can_draw(stream: TextIO | Guarded) -> bool:
    """Whether a stream is a terminal that can erase a line."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def guard(logger: logging.Logger | None = None) -> None:
    """Replace the standard streams by :class:`Guarded` streams, so that a failed output makes no job fail.

    Parameters
    ----------
    logger : logging.Logger, optional
        Logger whose handlers get the guarded streams in place of the standard streams.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # otherwise the next opened file would get this number, and printed lines would go into that file
            nobody = os.open(os.devnull, os.O_RDWR)
            if nobody != number:
                os.dup2(nobody, number)
                os.close(nobody)
            os.set_inheritable(number, True)
    streams: dict[int, Guarded] = {}
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - for as long as the process lives
        if not isinstance(stream, Guarded):
            setattr(sys, name, streams.setdefault(id(stream), Guarded(stream)))
    for handler in logger.handlers if logger is not None else ():
        if isinstance(handler, logging.StreamHandler):
            if handler.stream is None:
                handler.setStream(sys.stderr)
            elif id(handler.stream) in streams:
                handler.setStream(streams[id(handler.stream)])


# first words of Snakemake's messages that carry no event: routine between the lines of progress; what follows a failure
# for which the job has printed an error message; the same after SIGTERM
_ROUTINE = ("Assuming unrestricted", "Select jobs to", "Execute ", "DAG of jobs will be", "Updating checkpoint")
_UNDONE = ("Cannot restore", "Restored previous version", "Removing output files of failed job")
_AFTERMATH = (*_UNDONE, "Shutting down", "Exiting because")
_ENDING = (*_UNDONE, "Shutting down", "WorkflowError:\nAt least one job did not complete")
_INTERRUPTED = "Terminating processes on user request"
_TERMINATED = "Will exit after finishing currently running jobs"  # after SIGTERM
_KILLED = "died with <Signals.SIGTERM"


class Messages:
    """Filter of Snakemake's log that suppresses routine messages, and repeated messages about one failure.

    Parameters
    ----------
    explained : callable
        Function that returns whether a failed job has already printed its own error message.

    Attributes
    ----------
    interrupted : bool
        Whether the user has stopped Snakemake with Ctrl-C.
    terminated : bool
        Whether SIGTERM has stopped Snakemake, which then waits for the jobs that are running.
    """

    def __init__(self, explained: Callable[[], bool]) -> None:
        self._explained = explained
        self.interrupted = self.terminated = False

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a log record is printed.

        One sentence replaces Snakemake's text about write-protected outputs, and one its text about SIGTERM.
        """
        text = str(record.msg)
        # class name of an exception, in records of Snakemake's event ERROR
        exception = getattr(record, "exception", "")
        if text.startswith(_INTERRUPTED):
            self.interrupted = True
            return False
        if text.startswith(_TERMINATED):
            record.msg = "radcal: SIGTERM: the command ends as soon as the jobs that are running have ended."
            before, self.terminated = self.terminated, True
            return not before
        if exception == "ProtectedOutputException":
            files = re.findall(r"(?m)^\s+(\S.*)$", text.partition("affected files:")[2])
            record.msg = f"radcal: {write_protected(files[0] if files else 'a result')}"
            return True
        failed = exception in ("RuleException", "WorkflowError") or text.startswith(_AFTERMATH)
        explained = failed and (self.interrupted or self._explained())
        # a job that fails for another reason is not explained by SIGTERM
        explained |= self.terminated and (text.startswith(_ENDING) or _KILLED in text)
        return not (text.startswith(_ROUTINE) or explained)


def write_protected(path: str | os.PathLike[str]) -> str:
    """Error message about a result that is to be made again and cannot be written."""
    return (
        f"{path} is write-protected, and is to be made again: make it writable (chmod u+w), or give the case another "
        "name (case: ...)."
    )
