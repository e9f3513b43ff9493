"""Forward run of one pass: what the products of a forward run are made from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.radar.geometry import Geometry
from radcal.scene.model import Scene

__all__ = ["Forward"]


@dataclass(frozen=True)
class Forward:
    """Simulated image of one pass of a forward run, and what it was made from.

    Attributes
    ----------
    case : Part
        Configuration of the pass, with the laws and parameters that were simulated.
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of the pass.
    image_db : ndarray of float32, shape (rows, columns)
        Simulated image [dB].
    key : str
        Hash of the run, which names its record.
    seed : int
        Noise seed of the run.
    kept : bool
        Whether the run store had the record already, so that nothing was simulated.
    looks : callable
        Function that simulates the complex looks of the image, shape (rows, columns) each.
    """

    case: Part
    scene: Scene
    geometry: Geometry
    image_db: NDArray[np.float32]
    key: str
    seed: int
    kept: bool
    looks: Callable[[], Iterator[NDArray[np.complex64]]]
