"""Measured images from files: SICD, GeoTIFF and other rasters, numpy, MATLAB and HDF5 arrays, converted to dB."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, vrt_folders
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.sicd import is_sicd, read_sicd
from radcal.reading.arrays import raster_band, read_array
from radcal.reading.images import Counts, ImageFile, reading, to_db
from radcal.reading.rasters import open_raster
from radcal.scene.crs import crs_of, horizontal
from radcal.sections.measurement import SICD_ENDINGS

__all__ = ["ReadImage", "image_file", "image_of", "read_image", "read_raster"]

Values = NDArray[Any]
Places = Callable[[Any], tuple[NDArray[np.float64], NDArray[np.float64]]]
# smallest share of impossible values for which an image is refused. At this share, a target of 1,000 pixels loses one
# pixel. A sector of random bytes in a float32 image of 10^6 pixels gives half of this share. Single-look power with a
# mean of 29, read as dB, has this share of values above 200, because exp(-200 / 29) = 0.001.
_IMPOSSIBLE_SHARE = 1e-3


@dataclass(frozen=True)
class ReadImage:
    """Content of a measured image file.

    Attributes
    ----------
    image_db : ndarray of float32, shape (rows, columns)
        Backscatter [dB], NaN for pixels marked as no data and for zero or negative power.
    counts : Counts
        Number of NaN pixels for each reason.
    findings : tuple of Finding
        Findings on the levels of the image, from the metadata of the file.
    polarisation : str or None
        Transmitted and received polarisation, such as "VV", where the file gives it.
    frequency_hz : float or None
        Carrier frequency [Hz], where the file gives it.
    radiometry : str or None
        Radiometry of the image, where the file gives it.
    """

    image_db: NDArray[np.float32]
    counts: Counts
    findings: tuple[Finding, ...] = ()
    polarisation: str | None = None
    frequency_hz: float | None = None
    radiometry: str | None = None


def read_image(
    path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None, resized: str = ""
) -> ReadImage:
    """Read a measured image as backscatter in dB.

    Parameters
    ----------
    path : path
        Path of the file; its ending, and for NITF its header, decides how it is read.
    config : FileMeasurement
        Configuration with the scale of the numbers, and with the dataset or band.
    shape : (int, int), optional
        Size that the image must have.
    resized : str
        End of the message about an image of another size; by default the advice to crop or resample it.

    Raises
    ------
    MeasurementError
        The file cannot be read or holds no image, or its numbers contradict the scale.
    """
    if path.suffix.lower() in SICD_ENDINGS and is_sicd(path):
        sicd = read_sicd(path, config, image_file(path, config, shape))
        # complex pixels have been converted to power already, at the level that the file gives
        read = image_of(sicd.power, path, config.model_copy(update={"scale": "power"}), shape)
        return replace(
            read,
            findings=sicd.findings,
            polarisation=sicd.polarisation,
            frequency_hz=sicd.frequency_hz,
            radiometry=sicd.radiometry,
        )
    return image_of(read_array(image_file(path, config, shape, resized)), path, config, shape)


def image_of(values: Values, path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None) -> ReadImage:
    """Check the numbers of an image and convert them to dB.

    Parameters
    ----------
    values : ndarray
        Numbers as read from the file.
    path : path
        For messages.
    config : FileMeasurement
        Configuration with the scale of the numbers.
    shape : (int, int), optional
        Size that the image must have.

    Raises
    ------
    MeasurementError
        The numbers are not an image of this shape or contradict the scale.
    """
    image, counts = to_db(values, image_file(path, config, shape))
    present = image[np.isfinite(image)]
    # speckle has an sd of 2 dB or more, so that an image with its median near 0 dB has negative values
    if config.scale == "db" and present.min() >= 0 and np.median(present) < 3.0:
        raise MeasurementError(
            f"measurement.path: the values of {path} run from {present.min():.3g} to {present.max():.3g} with "
            f"median {np.median(present):.3g}, none negative, which looks like power: set measurement.scale: power."
        )
    return ReadImage(image, counts)


def read_raster(path: Path, config: FileMeasurement, places: Places | None = None) -> tuple[Values, Any, Any]:
    """Pixel values of a raster, with its transform and CRS.

    Parameters
    ----------
    path : path
        GeoTIFF or another raster.
    config : FileMeasurement
        Band.
    places : callable, optional
        Function that returns the coordinates of interest in a given CRS; only the rectangle around these coordinates is
        read.

    Returns
    -------
    values : ndarray, shape (rows, columns)
        Numbers without conversion; values that the file format marks as no data become NaN.
    transform : affine.Affine
        Affine transform from (column, row) of pixel corners to coordinates; identity where the file has none.
    crs : pyproj.CRS or None
        Horizontal CRS of the coordinates.

    Raises
    ------
    MeasurementError
        The file cannot be read or does not hold the band.
    """
    file = image_file(path, config)
    with reading(file, "a raster"), open_raster(path, vrt_folders(config)) as raster:
        crs = crs_of(raster)
        plane = horizontal(crs) if crs is not None else None
        if plane is None or places is None:
            return raster_band(raster, file), raster.transform, plane
        window = _window(raster, *places(plane))
        return raster_band(raster, file, window), raster.window_transform(window), plane


def _window(raster: Any, x: NDArray[np.float64], y: NDArray[np.float64]) -> Any:
    """Rectangle of a raster's pixels around coordinates; one pixel if all coordinates lie outside the raster."""
    from rasterio.windows import Window

    inverse = ~raster.transform
    around = []
    for at, size in (
        (inverse.a * x + inverse.b * y + inverse.c, raster.width),
        (inverse.d * x + inverse.e * y + inverse.f, raster.height),
    ):
        known = at[np.isfinite(at)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
        first = int(np.clip(np.floor(low), 0, size - 1))
        around.append((first, int(np.clip(np.floor(high) + 1, first + 1, size)) - first))
    (left, width), (top, height) = around
    return Window(left, top, width, height)


def image_file(
    path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None, resized: str = ""
) -> ImageFile:
    """File of a measured image, with the keys that error messages name; ``shape`` is the required size of the image."""
    return ImageFile(
        path,
        config,
        "measurement",
        "path",
        MeasurementError,
        shape=shape,
        resized=resized or ": crop or resample it to the same grid",
        impossible_share=_IMPOSSIBLE_SHARE,
        folders=vrt_folders(config),
    )
