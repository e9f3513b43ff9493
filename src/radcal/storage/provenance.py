"""Provenance of the files that a job writes: case name, and sections of the configuration that the job reads."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from radcal.config.disclosure import disclosed


@dataclass(frozen=True)
class Origin:
    """Case name and configuration that are recorded in every written file; None if unknown."""

    case: str | None = None
    config: Mapping[str, Any] | None = None


_UNKNOWN = Origin()
_origin: ContextVar[Origin] = ContextVar("origin", default=_UNKNOWN)


def origin() -> Origin:
    """Case name and configuration that are recorded in files written inside the present :func:`provenance` context."""
    return _origin.get()


@contextlib.contextmanager
def provenance(case: str | None = None, config: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Context in which every written file records case and configuration, and files of another case are refused.

    Parameters
    ----------
    case : str, optional
        Name of the case. Without a name, files of every case can be read.
    config : mapping, optional
        Sections of the configuration that determine the content of the files.
    """
    token = _origin.set(Origin(case, disclosed(config) if config is not None else None))
    try:
        yield
    finally:
        _origin.reset(token)
