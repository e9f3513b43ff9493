"""What a measurement is, and its HDF5 file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.files import write_hdf5

__all__ = ["Measurement", "read_measurement", "write_measurement"]


@dataclass(frozen=True)
class Measurement:
    """A measured image on the scene's image grid.

    Attributes
    ----------
    image_db : ndarray of float32, shape (slant range, azimuth)
        Backscatter in the configured radiometry [dB], NaN where there is none.
    source : str
        Where it came from, for the report.
    hidden : mapping
        Parameters by material behind a synthetic measurement, else empty.
    """

    image_db: NDArray[np.float32]
    source: str
    hidden: Mapping[str, list[float]] = field(default_factory=dict)


def write_measurement(path: str | Path, measurement: Measurement) -> None:
    """Write a measurement to HDF5, atomically."""
    with write_hdf5(path) as file:
        file.attrs["schema"] = 1
        file.attrs["source"] = measurement.source
        file.create_dataset("image_db", data=measurement.image_db, compression="gzip", compression_opts=1)
        hidden = file.create_group("hidden")
        for name, parameters in measurement.hidden.items():
            hidden.attrs[name] = parameters


def read_measurement(path: str | Path) -> Measurement:
    """Read a measurement that :func:`write_measurement` wrote."""
    with h5py.File(path, "r") as file:
        return Measurement(
            image_db=file["image_db"][()],
            source=str(file.attrs["source"]),
            hidden={name: [float(v) for v in values] for name, values in file["hidden"].attrs.items()},
        )
