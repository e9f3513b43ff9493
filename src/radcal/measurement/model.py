"""Measured image with its source and notes, and its HDF5 file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.storage.records import read_hdf5, write_hdf5

__all__ = ["Measurement", "get_measurement", "put_measurement", "read_measurement", "write_measurement"]


@dataclass(frozen=True)
class Measurement:
    """A measured image of the size of the scene's image.

    Attributes
    ----------
    image_db : ndarray of float32, shape (slant range, azimuth)
        Backscatter in the configured radiometry [dB], NaN where there is none.
    source : str
        Source of the image, for the report.
    hidden : mapping
        Hidden parameters by material of a synthetic measurement, else empty.
    misregistration_px : ndarray of float32, shape (2, rows, columns), or None
        Displacement field of a synthetic measurement, that from pixels of the scene's image to its own [pixels].
    notes : tuple of str
        Sentences about a file: meaning of its levels, number of unusable pixels.
    """

    image_db: NDArray[np.float32]
    source: str
    hidden: Mapping[str, list[float]] = field(default_factory=dict)
    misregistration_px: NDArray[np.float32] | None = None
    notes: tuple[str, ...] = ()


def put_measurement(group: h5py.Group, measurement: Measurement) -> None:
    """Write a measurement into a group of an HDF5 file."""
    group.attrs["source"] = measurement.source
    if measurement.notes:
        group.attrs["notes"] = list(measurement.notes)
    group.create_dataset("image_db", data=measurement.image_db, compression="gzip", compression_opts=1)
    hidden = group.create_group("hidden")
    for name, parameters in measurement.hidden.items():
        hidden.attrs[name] = parameters
    if measurement.misregistration_px is not None:
        group.create_dataset(
            "misregistration_px", data=measurement.misregistration_px, compression="gzip", compression_opts=1
        )


def get_measurement(group: h5py.Group) -> Measurement:
    """Read a measurement that :func:`put_measurement` wrote."""
    return Measurement(
        image_db=group["image_db"][()],
        source=str(group.attrs["source"]),
        hidden={name: [float(v) for v in values] for name, values in group["hidden"].attrs.items()},
        misregistration_px=group["misregistration_px"][()] if "misregistration_px" in group else None,
        notes=tuple(str(note) for note in group.attrs.get("notes", ())),
    )


def write_measurement(path: str | Path, measurement: Measurement) -> None:
    """Write a measurement to HDF5, atomically."""
    with write_hdf5(path, "measurement") as file:
        put_measurement(file, measurement)


def read_measurement(path: str | Path) -> Measurement:
    """Read a measurement that :func:`write_measurement` wrote.

    Raises
    ------
    StoreError
        The file is missing, damaged, or of another version or case.
    """
    with read_hdf5(path, "measurement") as file:
        return get_measurement(file)
