"""Measured images from files: SICD, GeoTIFF and other rasters, numpy, MATLAB and HDF5 arrays, to dB."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement
from radcal.errors import MeasurementError
from radcal.images import Counts, ImageFile, open_raster, raster_band, read_array, reading, to_db
from radcal.measurement.sicd import is_sicd, read_sicd
from radcal.scene.crs import crs_of, horizontal

__all__ = ["ReadImage", "image_of", "read_image", "read_raster", "read_values"]

Values = NDArray[Any]
_SICD_ENDINGS = (".nitf", ".ntf", ".sicd")


@dataclass(frozen=True)
class ReadImage:
    """What a file holds.

    Attributes
    ----------
    image_db : ndarray of float32, shape (rows, columns)
        Backscatter [dB], NaN where there is none: no-data, zero or negative power.
    counts : Counts
        How many pixels are NaN, and why.
    notes : tuple of str
        What the file itself tells about its levels.
    polarisation : str or None
        Transmitted and received, such as "VV", where the file tells it.
    frequency_hz : float or None
        Carrier frequency [Hz], where the file tells it.
    """

    image_db: NDArray[np.float32]
    counts: Counts
    notes: tuple[str, ...] = ()
    polarisation: str | None = None
    frequency_hz: float | None = None


def read_image(path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None) -> ReadImage:
    """Read a measured image as backscatter in dB.

    Parameters
    ----------
    path : path
        The file; its ending, and for NITF its header, says how it is read.
    config : FileMeasurement
        Scale, and dataset or band.
    shape : (int, int), optional
        Size that the image must have.

    Raises
    ------
    MeasurementError
        The file cannot be read, holds something else, or its numbers contradict the scale.
    """
    if path.suffix.lower() in _SICD_ENDINGS and is_sicd(path):
        sicd = read_sicd(path, config)
        # complex pixels come back as power already, with the level that the file gives them
        read = image_of(sicd.power, path, config.model_copy(update={"scale": "power"}), shape)
        return replace(read, notes=sicd.notes, polarisation=sicd.polarisation, frequency_hz=sicd.frequency_hz)
    return image_of(read_values(path, config), path, config, shape)


def image_of(values: Values, path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None) -> ReadImage:
    """Check the numbers of an image and bring them to dB.

    Parameters
    ----------
    values : ndarray
        As read.
    path : path
        For messages.
    config : FileMeasurement
        Scale: what the numbers are.
    shape : (int, int), optional
        Size that the image must have.

    Raises
    ------
    MeasurementError
        The numbers are no image of this shape or contradict the scale.
    """
    if values.ndim == 2 and shape is not None and values.shape != shape:
        raise MeasurementError(
            f"measurement.path: {path} has {values.shape[0]} x {values.shape[1]} pixels, the scene's image "
            f"{shape[0]} x {shape[1]}: crop or resample it to the same grid."
        )
    image, counts = to_db(values, _file(path, config))
    present = image[np.isfinite(image)]
    # speckle spreads dB by 2 and more, so that an image with its median near 0 dB has negative values
    if config.scale == "db" and present.min() >= 0 and np.median(present) < 3.0:
        raise MeasurementError(
            f"measurement.path: the values of {path} run from {present.min():.3g} to {present.max():.3g} with "
            f"median {np.median(present):.3g}, none negative, which looks like power: set measurement.scale: power."
        )
    return ReadImage(image, counts)


def read_values(path: Path, config: FileMeasurement) -> Values:
    """Numbers of a file as they are; no-data as NaN where the format knows it.

    Raises
    ------
    MeasurementError
        The file cannot be read or does not hold the dataset or band.
    """
    return read_array(_file(path, config))


def read_raster(path: Path, config: FileMeasurement) -> tuple[Values, Any, Any]:
    """Numbers of a raster with where they lie.

    Parameters
    ----------
    path : path
        GeoTIFF or any other raster that GDAL reads.
    config : FileMeasurement
        Band.

    Returns
    -------
    values : ndarray, shape (rows, columns)
        As :func:`read_values` gives them.
    transform : affine.Affine
        From (column, row) of pixel corners to coordinates; identity where the file has none.
    crs : pyproj.CRS or None
        Horizontal CRS of the coordinates.

    Raises
    ------
    MeasurementError
        The file cannot be read or does not hold the band.
    """
    file = _file(path, config)
    with reading(file, "a raster"), open_raster(path) as raster:
        crs = crs_of(raster)
        return raster_band(raster, file), raster.transform, horizontal(crs) if crs is not None else None


def _file(path: Path, config: FileMeasurement) -> ImageFile:
    return ImageFile(path, config, "measurement", "path", MeasurementError)
