"""Execution of one external program with a time limit; afterwards its whole process group is killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from radcal.errors import SimulatorError
from radcal.programs import guard

STDOUT, STDERR = "radcal.stdout", "radcal.stderr"
_MOST_BYTES = 100_000_000  # largest size of what a program prints on standard output, and on standard error
_LOOK_S = 0.2  # time between two looks at the size of what a program has printed [s]
_TAIL_BYTES = 4000
_QUOTED = 300


@dataclass(frozen=True)
class Ended:
    """Result of a program's execution: exit code or signal, and duration.

    Attributes
    ----------
    code : int or None
        Exit code; minus the signal number if a signal ended the program; None if the time limit was exceeded.
    seconds : float
        Wall time [s].
    """

    code: int | None
    seconds: float

    def __str__(self) -> str:
        if self.code is None:
            return f"was not done after {self.seconds:.3g} s and was killed"
        if self.code >= 0:
            return f"ended with exit code {self.code}"
        with contextlib.suppress(ValueError):
            return f"was ended by signal {-self.code} ({signal.Signals(-self.code).name})"
        return f"was ended by signal {-self.code}"


def run_program(arguments: Sequence[str], folder: Path, environment: Mapping[str, str], timeout_s: float) -> Ended:
    """Run a program in a folder, without a shell; the output of the program goes to files in this folder.

    Parameters
    ----------
    arguments : sequence of str
        Absolute path of the program and its arguments.
    folder : path
        Working directory of the program, into which the files ``radcal.stdout`` and ``radcal.stderr`` are written.
    environment : mapping
        Environment variables for the program, in addition to the variables of this process.
    timeout_s : float
        Time after which the program is killed [s].

    Returns
    -------
    Ended
        Exit code and duration. All processes of the program's process group have ended.

    Raises
    ------
    SimulatorError
        The operating system refuses the arguments, or the program prints more than 100 MB.
    """
    command = [sys.executable, "-I", "-S", guard.__file__, *arguments]
    started = time.perf_counter()
    with (folder / STDOUT).open("wb") as out, (folder / STDERR).open("wb") as err:
        try:
            process = subprocess.Popen(  # noqa: S603 - a list of arguments, never a shell
                command,
                cwd=folder,
                env={**os.environ, **environment},
                stdin=subprocess.PIPE,  # when this process ends, this pipe closes, and the guard kills the program
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
        except OSError as error:
            raise SimulatorError(f"{Path(arguments[0]).name} cannot be started ({error.strerror}).") from None
        code: int | None = None
        flood: str | None = None
        try:
            while code is None and flood is None and (left := started + timeout_s - time.perf_counter()) > 0:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    code = process.wait(min(left, _LOOK_S))
                sizes = {name: os.fstat(file.fileno()).st_size for name, file in ((STDOUT, out), (STDERR, err))}
                flood = next((name for name, size in sizes.items() if size > _MOST_BYTES), None)
        finally:
            # this also kills processes that the program has started in the background
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            if process.stdin is not None:
                process.stdin.close()
        if flood is not None:
            (out if flood == STDOUT else err).truncate(_MOST_BYTES)
            raise SimulatorError(
                f"{Path(arguments[0]).name} was killed, because {flood} has {sizes[flood]} bytes, expected at most "
                f"{_MOST_BYTES}, {output_tail(folder)}."
            )
    return Ended(code, time.perf_counter() - started)


def output_tail(folder: Path) -> str:
    """Quotation of the last lines that a program wrote to standard error and standard output.

    Parameters
    ----------
    folder : path
        Folder in which the program ran.

    Returns
    -------
    str
        Text of one line, such as ``its last output on stderr: "no licence"``.
    """
    quotes = []
    for name, file in (("stderr", STDERR), ("stdout", STDOUT)):
        with contextlib.suppress(OSError), (folder / file).open("rb") as handle:
            handle.seek(max(0, handle.seek(0, os.SEEK_END) - _TAIL_BYTES))
            lines = handle.read().decode("utf-8", "replace").split("\n")
            kept = [clean for line in lines if (clean := "".join(c if c.isprintable() else " " for c in line).strip())]
            text = " / ".join(kept[-3:])
            if text:
                quotes.append(f'on {name}: "{text if len(text) <= _QUOTED else "... " + text[-_QUOTED:]}"')
    return f"its last output {', '.join(quotes)}" if quotes else "it printed nothing"
