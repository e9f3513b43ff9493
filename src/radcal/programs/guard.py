"""Supervisor script: it starts an external program, returns its exit status, and kills it when radcal ends.

This script uses only the standard library. The process of the script leads a new process group, to which the external
program also belongs. The standard input of the script is a pipe from radcal. When radcal ends, even by SIGKILL, the
operating system closes the pipe, and the script kills the whole process group.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import threading
import time


def main(arguments: list[str]) -> int:
    """Start a program and wait until it ends.

    Parameters
    ----------
    arguments : list of str
        Absolute path of the program and its arguments.

    Returns
    -------
    int
        Exit code of the program. If a signal ended the program, the same signal ends this process.
    """
    try:
        program = os.posix_spawn(
            arguments[0], arguments, os.environ, file_actions=[(os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0)]
        )
    except OSError as error:
        # the first line of a script with Windows line ends names an interpreter that does not exist
        there = isinstance(error, FileNotFoundError) and os.path.exists(arguments[0])
        reason = "the interpreter of its first line is missing" if there else error.strerror
        sys.stderr.write(f"{arguments[0]} cannot be started: {reason}\n")
        return 126
    threading.Thread(target=_kill_all_when_orphaned, daemon=True).start()
    _, status = os.waitpid(program, 0)
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return code
    resource.setrlimit(
        resource.RLIMIT_CORE, (0, 0)
    )  # this process writes no core dump, because the program has already written its own if enabled
    if -code != signal.SIGKILL:
        signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
    time.sleep(10.0)
    return 128 - code


def _kill_all_when_orphaned() -> None:
    os.read(0, 1)
    os.killpg(os.getpgrp(), signal.SIGKILL)


if __name__ == "__main__":
    ended = main(sys.argv[1:])
    sys.stderr.flush()
    # sys.exit would wait for the thread that reads the pipe
    os._exit(ended)
