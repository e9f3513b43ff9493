"""Interface that every simulator implements, as a Python protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Simulator"]


class Simulator(Protocol):
    """Simulator of a pass: it has an identity and turns one parameter vector per material into an image."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Plain data that identify the simulator; they differ between simulators that may give different images."""
        ...

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass.

        Parameters
        ----------
        parameters : mapping
            Law parameters X of every material of the scene, by name of the material.
        noise_seed : int
            Seed of speckle and thermal noise; runs with equal seeds use equal random numbers.

        Returns
        -------
        ndarray of float32, shape (slant range, azimuth)
            Multilooked intensity in the configured radiometry [dB].

        Raises
        ------
        SimulatorError
            The simulation failed.
        """
        ...
