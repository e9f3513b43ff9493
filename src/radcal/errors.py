"""Exceptions whose message is written for the user.

Every message is one sentence that names the file or key, the value found, the expected value and the remedy. An
exception of any other class is a bug in radcal.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class MissingFile:
    """File that a key names and that does not exist."""

    key: str
    path: Path


@dataclass(frozen=True)
class MissingSign:
    """Level above 0 dB [dB] at a key, with the question whether a minus sign is missing."""

    key: str


@dataclass(frozen=True)
class WrongNumbers:
    """Numbers in a file that cannot be what the case says, and what they are; the same for a part of the file."""

    key: str
    path: Path
    what: str


@dataclass(frozen=True)
class UnreadFile:
    """File that cannot be read and may be left out, and the reason, without a full stop."""

    path: Path
    reason: str


@dataclass(frozen=True)
class RenamedFile:
    """Faulty file that was renamed: what is wrong with it, and its new name, without a full stop."""

    what: str


class RadcalError(Exception):
    """Base class of all exceptions whose message is written for the user.

    Parameters
    ----------
    text : str
        Message.
    about : hashable, optional
        What the message is about, for code that decides by it: one of the classes of this module.
    """

    def __init__(self, text: str = "", about: Hashable = None) -> None:
        super().__init__(text)
        self.about = about


class ConfigError(RadcalError):
    """The configuration has an unknown key, a value of the wrong type or an impossible value."""


class SceneError(RadcalError):
    """The scene cannot be built, or contradicts the configuration."""


class MeasurementError(RadcalError):
    """The measured image cannot be read, or does not match the scene."""


class FitError(RadcalError):
    """A density cannot be fitted to the pixel values."""


class SurrogateError(RadcalError):
    """A surrogate cannot be trained with the available runs."""


class SimulatorError(RadcalError):
    """A simulator run failed, or its output is not a usable image."""


class StoreError(RadcalError):
    """A file of the results folder cannot be written or read."""


class DamagedError(StoreError):
    """A file of the results folder is damaged, or another version of radcal or another case wrote it."""


class ClusterError(RadcalError):
    """A command of the cluster's scheduler failed."""
