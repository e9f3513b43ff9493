"""Protocol of a simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Simulator"]


class Simulator(Protocol):
    """Simulator of a pass: gives an image for one parameter vector per material, and has an identity."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Plain data that changes whenever the same parameters would give another image."""
        ...

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass.

        Parameters
        ----------
        parameters : mapping
            Parameters of the law of every material of the scene, by name.
        noise_seed : int
            Seed of speckle and thermal noise; equal seeds give equal random numbers.

        Returns
        -------
        ndarray of float32, shape (slant range, azimuth)
            Multilooked intensity in the configured radiometry [dB].

        Raises
        ------
        SimulatorError
            The run failed.
        """
        ...
