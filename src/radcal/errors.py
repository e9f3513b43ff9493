"""Errors whose message is for the user.

Every message is one sentence with the file or key, the value found, the value expected, and what to do. Any other
exception is a bug of radcal.
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
    """Base of all errors meant for the person who runs radcal."""


class ConfigError(RadcalError):
    """The configuration is wrong: unknown key, wrong type, impossible value."""


class SceneError(RadcalError):
    """The scene cannot be built or does not fit the configuration."""


class MeasurementError(RadcalError):
    """The measured image cannot be read or does not fit the scene."""


class FitError(RadcalError):
    """A density cannot be fitted to the pixels."""


class SurrogateError(RadcalError):
    """A surrogate cannot be trained."""


class SimulatorError(RadcalError):
    """A simulator run failed or returned something unusable."""


class StoreError(RadcalError):
    """A file of the results folder cannot be written or read."""


class DamagedError(StoreError):
    """A file of the results folder is damaged, of another version or of another case."""


class ClusterError(RadcalError):
    """A command of a cluster's scheduler fails."""
