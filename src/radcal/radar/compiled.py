"""Functions that numba compiles when they are first called: importing their modules imports no numba."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

__all__ = ["njit", "prange"]

_Function = TypeVar("_Function", bound=Callable[..., Any])
_STAMPS: dict[str, int] = {}  # time stamps of the files of compiled functions [ns], as they were imported


def prange(*bounds: int) -> range:
    """``range`` of a loop that may run in parallel, numba's own once compiled."""
    return range(*bounds)


class _Compiled:
    """Function that is compiled when it is first called, with those that it calls."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self._function, self._options = function, options
        _STAMPS.setdefault(function.__code__.co_filename, _stamp(function.__code__.co_filename))

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @functools.cached_property
    def dispatcher(self) -> Callable[..., Any]:
        """Function of numba that takes this one's place."""
        from radcal.radar import machine_code

        known = self._function.__globals__
        for name in self._function.__code__.co_names:
            if isinstance(callee := known.get(name), _Compiled):
                known[name] = callee.dispatcher
            elif callee is prange:
                known[name] = machine_code.prange
        # the folder is named after the files as they are now, and this may be the machine code of earlier ones
        unchanged = all(_stamp(path) == stamp for path, stamp in _STAMPS.items())
        return machine_code.compiled(self._function, self._options, unchanged)


def _stamp(path: str) -> int:
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


def njit(**options: Any) -> Callable[[_Function], _Function]:
    """Decorator of functions that numba compiles, with their machine code kept (:mod:`radcal.radar.machine_code`).

    Parameters
    ----------
    **options
        Of ``numba.njit``.
    """

    def compiled(function: _Function) -> _Function:
        return cast("_Function", _Compiled(function, options))

    return compiled
