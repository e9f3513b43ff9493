"""Replacement of environment variables' values, which may be secrets, by hashes in all files that radcal writes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any


def hashed(environment: Mapping[str, str]) -> dict[str, str]:
    """SHA-256 of the value of each environment variable, by the name of the variable.

    Parameters
    ----------
    environment : mapping
        Values of environment variables by name.
    """
    return {name: hashlib.sha256(value.encode()).hexdigest() for name, value in environment.items()}


class Undisclosed(dict[str, str]):
    """Environment variables whose ``repr`` shows hashes, since Snakemake stores the ``repr`` of a rule's ``params``."""

    def __repr__(self) -> str:
        return repr(hashed(self))


def disclosed(data: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of plain data with ``environment_sha256`` in place of a simulator's ``environment``.

    Parameters
    ----------
    data : mapping
        Section ``simulator``, identity of a simulator, or data that contain one of the two under the key ``simulator``.
        An empty environment is copied unchanged.
    """
    copy = dict(data)
    if isinstance(inner := copy.get("simulator"), Mapping):
        copy["simulator"] = disclosed(inner)
    if isinstance(environment := copy.get("environment"), Mapping) and environment:
        del copy["environment"]
        copy["environment_sha256"] = hashed(environment)
    return copy
