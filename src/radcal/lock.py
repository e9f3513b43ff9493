"""One workflow per case: an advisory lock that dies with its process."""

from __future__ import annotations

import fcntl
import os
import sys
from pathlib import Path
from typing import NoReturn, TextIO

from radcal.files import sweep

__all__ = ["CaseLock"]


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
        """Take the lock or leave with a sentence; sweep what killed processes left behind."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = (self._folder / ".lock").open("a+", encoding="ascii")
        except OSError as error:
            _leave(f"{self._folder} cannot be written ({error.strerror}); results go there, so make it writable.")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            owner = file.read().strip() or "unknown"
            file.close()
            _leave(
                f"another snakemake (process {owner}) is working on {self._folder}; wait for it, or stop it and type "
                "the same command again."
            )
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        self._file = file
        sweep(self._folder)

    def release(self) -> None:
        """Give the lock back."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _leave(sentence: str) -> NoReturn:
    """End the process at once: Snakemake would wrap an exception in its own words, and no job has started."""
    sys.stderr.write(f"radcal: {sentence}\n")
    sys.stderr.flush()
    os._exit(1)
