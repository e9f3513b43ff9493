"""Provenance of the files that a job writes: the case, and the sections of the configuration that the job reads."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from radcal.storage.disclosure import disclosed

__all__ = ["Origin", "origin", "provenance"]


@dataclass(frozen=True)
class Origin:
    """Case and configuration recorded in the files being written, None where not known."""

    case: str | None = None
    config: Mapping[str, Any] | None = None


_UNKNOWN = Origin()
_origin: ContextVar[Origin] = ContextVar("origin", default=_UNKNOWN)


def origin() -> Origin:
    """Origin recorded in files that are written in the present context."""
    return _origin.get()


@contextlib.contextmanager
def provenance(case: str | None = None, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Context in which files are written with their provenance, and only files of the same case are read.

    Parameters
    ----------
    case : str, optional
        Name of the case. Without a name, files of any case are read.
    config : mapping, optional
        Sections of the configuration that the files depend on.
    """
    token = _origin.set(Origin(case, disclosed(config) if config is not None else None))
    try:
        yield
    finally:
        _origin.reset(token)
