"""Independent calls in several processes, which end when their parent process ends."""

from __future__ import annotations

import ctypes
import faulthandler
import resource
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from importlib import import_module
from typing import Any, TypeVar

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_Result = TypeVar("_Result")


def die_with_parent() -> None:
    """Let the operating system kill this process when its parent process ends for any reason; Linux only.

    A job that continues after its Snakemake process has ended would write the same files as the next command's jobs.

    References
    ----------
    prctl(2), PR_SET_PDEATHSIG. For prctl, the parent is the thread that started this process. This thread
    lives until the process ends, because the thread waits for the process.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def each(work: Mapping[str, Callable[[], _Result]], processes: int) -> dict[str, _Result]:
    """Results of independent calls by name; they do not depend on the number of processes."""
    if min(processes, len(work)) <= 1:
        return {name: call() for name, call in work.items()}
    from concurrent.futures import ProcessPoolExecutor  # imported here, because every job imports this module
    from multiprocessing import get_context

    _WORK[:] = work.values()  # forked processes inherit the list; calls that hold functions cannot be pickled
    with ProcessPoolExecutor(
        min(processes, len(work)), mp_context=get_context("fork"), initializer=die_with_parent
    ) as pool:
        return dict(zip(work, pool.map(_call, range(len(work))), strict=True))


def apart(call: Callable[[], _Result], cpu_s: int) -> _Result:
    """Result of one call in a process of its own, for a library that a file could keep busy or bring down.

    Parameters
    ----------
    call : callable
        Function without arguments.
    cpu_s : int
        Longest CPU time of the call [s]; the operating system then ends the process.

    Raises
    ------
    concurrent.futures.process.BrokenProcessPool
        The process ended before the call did.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    _WORK[:] = [call]
    with ProcessPoolExecutor(1, mp_context=get_context("fork"), initializer=_limited, initargs=(cpu_s,)) as pool:
        result: _Result = pool.submit(_call, 0).result()
    return result


def _limited(cpu_s: int) -> None:
    faulthandler.disable()
    die_with_parent()
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))


_WORK: list[Callable[[], Any]] = []


def _call(number: int) -> Any:
    with one_thread():
        return _WORK[number]()


def one_thread() -> AbstractContextManager[object]:
    """Context in which linear algebra has one thread, so that sums have a fixed order."""
    from threadpoolctl import threadpool_limits

    import_module("scipy.linalg")  # SciPy has linear algebra of its own, which is limited only once it is loaded
    limited: AbstractContextManager[object] = threadpool_limits(1)
    return limited
