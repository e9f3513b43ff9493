"""Exceptions whose message is written for the user.

Every message is one sentence that names the file or key, the value found, the expected value and the remedy. An
exception of any other class is a bug in radcal.
"""

from __future__ import annotations

__all__ = [
    "ClusterError",
    "ConfigError",
    "DamagedError",
    "FitError",
    "MeasurementError",
    "RadcalError",
    "SceneError",
    "SimulatorError",
    "StoreError",
    "SurrogateError",
]


class RadcalError(Exception):
    """Base class of all exceptions whose message is written for the user."""


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
