"""Protocol of a simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Simulator"]


class Simulator(Protocol):
    """Function from one parameter vector per material to the image of a pass, with an identity."""

    @property
    def identity(self) -> Mapping[str, Any]:
        """Plain data that changes whenever the same parameters would give another image."""
        ...

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Simulate one pass.

        Parameters
        ----------
        parameters : mapping
            Material name to its law's parameters, for every material of the scene.
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
