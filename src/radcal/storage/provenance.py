"""Provenance of the files that a job writes: its case, and the sections of the configuration it depends on."""

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
    """Case and configuration of what is being written, None where not known."""

    case: str | None = None
    config: Mapping[str, Any] | None = None


_UNKNOWN = Origin()
_origin: ContextVar[Origin] = ContextVar("origin", default=_UNKNOWN)


def origin() -> Origin:
    """Origin of files written here and now."""
    return _origin.get()


@contextlib.contextmanager
def provenance(case: str | None = None, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Every file written in the block says where it comes from; every file read must be of the same case.

    Parameters
    ----------
    case : str, optional
        Name of the case; without it files of any case are read.
    config : mapping, optional
        Sections of the configuration that the work depends on.
    """
    token = _origin.set(Origin(case, disclosed(config) if config is not None else None))
    try:
        yield
    finally:
        _origin.reset(token)
