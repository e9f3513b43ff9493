"""Measured images from files: SICD, GeoTIFF and other rasters, numpy, MATLAB and HDF5 arrays, converted to dB."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, vrt_folders
from radcal.errors import MeasurementError
from radcal.image.model import ReadImage
from radcal.image.sicd import is_sicd, read_sicd
from radcal.reading.arrays import read_array
from radcal.reading.images import ImageFile, to_db
from radcal.sections.measurement import SICD_ENDINGS

__all__ = ["image_file", "image_of", "read_image"]

Values = NDArray[Any]
# smallest share of impossible values for which an image is refused. At this share, a target of 1,000 pixels loses one
# pixel. A sector of random bytes in a float32 image of 10^6 pixels gives half of this share. Single-look power with a
# mean of 29, read as dB, has this share of values above 200, because exp(-200 / 29) = 0.001.
_IMPOSSIBLE_SHARE = 1e-3


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
        return read_sicd(path, config, image_file(path, config, shape))
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
