"""Forward run of one pass: what the products of a forward run are made from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.radar.geometry import Geometry
from radcal.scene.model import Scene
from radcal.storage.records import plain_hdf5


@dataclass(frozen=True)
class Flown:
    """Pass over a scene.

    Attributes
    ----------
    case : Part
        Configuration of the pass, with the laws and parameters that are simulated.
    scene : Scene
        Scene of the case.
    geometry : Geometry
        Geometry of the pass.
    """

    case: Part
    scene: Scene
    geometry: Geometry


@dataclass(frozen=True)
class Forward(Flown):
    """Simulated image of one pass of a forward run, and what it was made from.

    Attributes
    ----------
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

    image_db: NDArray[np.float32]
    key: str
    seed: int
    kept: bool
    looks: Callable[[], Iterator[NDArray[np.complex64]]]


def write_complex(
    path: Path, made: Forward, product: str, looks: Iterable[NDArray[np.complex64]], count: int, phases: str
) -> None:
    """Write complex looks of a pass to an HDF5 file, whose attributes ``docs/predictions.md`` describes.

    Parameters
    ----------
    path : path
        Path of the file.
    made : Forward
        Forward run of the pass.
    product : str
        Name of the product.
    looks : iterable of ndarray of complex64, shape (rows, columns)
        Looks [square root of linear power].
    count : int
        Number of looks.
    phases : str
        What the phases mean.
    """
    with plain_hdf5(path) as file:
        written = file.create_dataset("looks", (count, *made.image_db.shape), np.complex64)
        for k, look in enumerate(looks):
            written[k] = look
        written.attrs["axes"] = "look, slant range, azimuth"
        written.attrs["unit"] = "square root of linear power"
        written.attrs["phases"] = phases
        known = {key: value for key, value in made.case.radar.described().items() if value is not None}
        file.attrs.update({"case": made.case.case, "run": made.key, "product": product, **known})
