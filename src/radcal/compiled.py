"""Compilation by numba, with a cache folder that is named after a hash of the sources of compiled functions.

numba loads a function's machine code from its cache as long as the function's own source file is unchanged. numba does
not notice changes in other source files, even if the function uses constants or compiled functions of these files. The
cache folder is therefore named after a hash of all modules of the rooms that have compiled functions. Every module with
compiled functions imports ``njit`` or ``threaded`` from this module.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import itertools
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numba
from llvmlite import binding

ROOMS = ("radar", "signals", "speckle")
"""Rooms with compiled functions, which use no constants and compiled functions of other rooms."""

_config: Any = numba.config  # the names of numba.config are defined only at import, so that mypy does not know them
_PACKAGE = Path(__file__).resolve().parent
_KEPT, _IN_USE_S = 8, 24 * 3600.0  # other cache folders that are kept: number, and largest age [s]
_COMPILING = threading.RLock()  # a file lock belongs to a process, so that threads need a lock of their own
_PATIENCE_S = 60.0  # longest time for which a process waits while another one compiles the same function


def cache_folder(package: Path = _PACKAGE) -> str | None:
    """Path of the cache folder for machine code of a package's current source files; a missing folder is created.

    Parameters
    ----------
    package : path
        Folder of a package ``radcal``.

    Returns
    -------
    str or None
        Path of the folder ``radcal-<hash>`` in the first writable one of the following folders: ``NUMBA_CACHE_DIR`` if
        it is set; the package's ``__pycache__``; ``radcal`` below ``XDG_CACHE_HOME`` or, if this is not set, below
        ``~/.cache``. None if none of these folders is writable. The hash covers the source files, the versions of numba
        and llvmlite, ``NUMBA_BOUNDSCHECK``, and the processor. Nodes of a cluster with a common home directory
        therefore share a folder only if they run the same machine code. Cache folders that are named after other hashes
        are removed, except the eight used most recently and all used within the last day.
    """
    total = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {binding.get_host_cpu_name()}".encode())
    total.update(f"{binding.get_host_cpu_features().flatten()} {_config.BOUNDSCHECK}".encode())
    for path in (package / "compiled.py", *(path for room in ROOMS for path in sorted((package / room).glob("*.py")))):
        content = path.read_bytes()
        total.update(f"\n{path.relative_to(package)} {len(content)}\n".encode() + content)
    own = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else []
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for parent in (*own, package / "__pycache__", home / "radcal"):
        with contextlib.suppress(OSError, RuntimeError):  # the folder is not writable, or the user has no home
            folder = parent.expanduser().absolute() / f"radcal-{total.hexdigest()[:20]}"
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            _remove_others(folder)
            return str(folder)
    return None


def _remove_others(folder: Path) -> None:
    """Remove all cache folders beside ``folder``, except the eight used most recently and those used within a day."""
    used = {}
    for path in folder.parent.glob("radcal-" + "[0-9a-f]" * 20):
        with contextlib.suppress(OSError):  # another process has removed the folder
            used[path] = path.stat().st_mtime
    others = sorted((path for path in used if path != folder), key=used.__getitem__)
    for path in others[:-_KEPT]:
        if time.time() - used[path] > _IN_USE_S:
            shutil.rmtree(path, ignore_errors=True)


_FOLDER = cache_folder()


_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(**options: Any) -> Callable[[_Function], _Function]:
    """Decorator ``numba.njit`` that stores the machine code in the folder of :func:`cache_folder`.

    Of several processes that need a function at the same time, one compiles it, and the others wait and load its
    machine code. If no cache folder is writable, every process compiles the functions again.

    Parameters
    ----------
    **options
        Options of ``numba.njit``.
    """

    def compiled(function: _Function) -> _Function:
        # numba reads CACHE_DIR when it decorates a function; the old value is restored for other users of numba in this
        # process
        theirs, _config.CACHE_DIR = _config.CACHE_DIR, _FOLDER or ""
        try:
            dispatcher: Any = numba.njit(cache=_FOLDER is not None, **options)(function)
        finally:
            _config.CACHE_DIR = theirs
        if _FOLDER is not None:
            lock = Path(_FOLDER, f"{function.__module__}.{function.__qualname__}.lock")
            compile_or_load = dispatcher.compile

            def one_at_a_time(signature: Any) -> Any:
                with _COMPILING, _locked(lock):
                    return compile_or_load(signature)

            dispatcher.compile = one_at_a_time
        return cast("_Function", dispatcher)

    return compiled


def threaded(function: Callable[..., None]) -> Callable[..., None]:
    """Decorator that compiles a loop as :func:`njit` does and runs equal parts of the loop in parallel threads.

    Parameters
    ----------
    function : callable
        Function whose first argument is a part of the loop: the first index, and the index after the last. The values
        that the function writes for one index must not depend on other indices. Compiled functions cannot call the
        decorated function.

    Returns
    -------
    callable
        Function whose first argument is the number of indices of the whole loop. Each thread runs an equal part of the
        loop. The number of threads is ``NUMBA_NUM_THREADS``; in a workflow's job, it is the number of threads of the
        rule.

    Notes
    -----
    The decorator is used instead of ``numba.prange``, because a function with ``prange`` takes twice as long to
    compile.
    """
    one_part = njit(nogil=True)(function)

    @functools.wraps(one_part)
    def all_parts(count: int, *arguments: Any) -> None:
        threads = max(1, min(count, _config.NUMBA_NUM_THREADS))
        ends = [count * k // threads for k in range(threads + 1)]
        if threads == 1:
            one_part((0, count), *arguments)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda part: one_part(part, *arguments), itertools.pairwise(ends)))

    return all_parts


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Context manager that holds a lock on a file.

    After a minute, or on a file system without locks, the context is entered without the lock. No result depends on the
    lock.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            file = stack.enter_context(path.open("wb"))
            until = time.monotonic() + _PATIENCE_S
            while time.monotonic() < until:
                try:
                    fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except (BlockingIOError, PermissionError):  # another process holds the lock
                    time.sleep(0.05)
        yield
