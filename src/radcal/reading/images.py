"""Conversion of arrays from files to images in dB, for measured and simulated images.

The packages for measurements and for simulators share this module, so that neither package imports the other. For both
packages the conversion is the same; only the configuration keys in error messages differ.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import RadcalError, WrongNumbers
from radcal.reading.intake import LARGEST_VALUES, guarded

Values = NDArray[Any]
_NEGATIVE_SHARE = 0.01  # largest share of negative pixels in a power image; noise subtraction can leave a few
LARGEST_DB = 200.0
"""Largest absolute value of plausible backscatter [dB]; a larger value indicates a wrong scale or a damaged file."""

NOT_FINITE = "not finite"  # what the numbers of a refused file are, if they should be finite


@dataclass(frozen=True)
class ImageFile:
    """Image file with its options, and the configuration keys that error messages name.

    Attributes
    ----------
    path : Path
        Path of the file.
    options : FileMeasurement or Output
        Section of the configuration with ``scale`` (db, power, amplitude or complex), ``band`` (number of the raster
        band, from 1, or None) and ``dataset`` (name of the array in an npz, mat or HDF5 file, or None).
    section, key : str
        Section of the configuration that contains the options, and the key in this section that contains the path.
    error : type of RadcalError
        Class of the exceptions that reading the file raises.
    shape : (int, int) or None
        Rows and columns that the image in the file must have; None if any size is allowed.
    resized, turned : str
        Advice in the error messages about an image of wrong size, and about an image with exchanged rows and columns.
    impossible_share : float
        Largest share of impossible values among the finite pixels. Up to this share impossible values are masked;
        beyond this share the image is refused.
    folders : tuple of Path
        Folders in which the source files of a VRT may lie, besides the folder of the VRT.
    """

    path: Path
    options: Any
    section: str
    key: str
    error: type[RadcalError]
    shape: tuple[int, int] | None = None
    resized: str = ""
    turned: str = ""
    impossible_share: float = 0.0
    folders: tuple[Path, ...] = ()

    def refused(self, text: str, what: str = "") -> RadcalError:
        """Exception about the content of the file; the message consists of the configuration key and ``text``.

        ``what`` says in a word what the numbers are, if the message has numbers that differ in parts of the file.
        """
        key = f"{self.section}.{self.key}"
        return self.error(f"{key}: {text}", WrongNumbers(key, self.path, what) if what else None)

    def asked(self, key: str, text: str) -> RadcalError:
        """Exception about an option ``key`` that does not match the file; ``text`` starts with the option's value."""
        return self.error(f"{self.section}.{key} is {text}")


@dataclass(frozen=True)
class Counts:
    """Numbers of pixels of an image: all pixels, and pixels without a usable value by reason.

    Attributes
    ----------
    pixels : int
        Number of all pixels.
    no_data : int
        Number of pixels that are NaN, infinite, or marked as no data in the file.
    zero : int
        Number of pixels with zero power.
    negative : int
        Number of pixels with negative power, which subtraction of noise can leave.
    impossible : int
        Number of pixels whose absolute value in dB exceeds :data:`LARGEST_DB`.
    """

    pixels: int
    no_data: int
    zero: int
    negative: int
    impossible: int = 0


def to_db(values: Values, file: ImageFile) -> tuple[NDArray[np.float32], Counts]:
    """Check the numbers of an image against their declared scale and convert them to dB.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        Numbers in dB, linear power, linear amplitude, or complex amplitude.
    file : ImageFile
        File with the declared scale and the configuration keys for error messages.

    Returns
    -------
    image_db : ndarray of float32, shape (rows, columns)
        10 log10 of the power [dB]; NaN if the power is not positive, not finite, or beyond :data:`LARGEST_DB`.
    counts : Counts
        Number of all pixels, and numbers of NaN pixels by reason.

    Raises
    ------
    RadcalError
        The array is not an image, has no finite number or no positive power, or its type contradicts the declared
        scale. The exception is also raised if too many numbers are negative (power, amplitude) or beyond
        :data:`LARGEST_DB`.
    """
    scale, path = file.options.scale, file.path
    check_header(file, values.shape, values.dtype)
    finite = np.isfinite(values)
    if not finite.any():
        raise file.refused(f"{path} holds no finite number, expected an image.", NOT_FINITE)
    if scale == "db":
        zero, negative = values == -np.inf, 0  # the logarithm of zero power
        image = np.where(finite, values, np.nan).astype(np.float32)
    else:
        size = np.abs(values) if scale == "complex" else values
        below = finite & (size < 0)
        negative = int(np.count_nonzero(below))
        if negative > (_NEGATIVE_SHARE * np.count_nonzero(finite) if scale == "power" else 0):
            raise file.refused(
                f"{negative} of {np.count_nonzero(finite)} values of {path} are negative, which {scale} cannot be: if "
                f"the file is in dB, set {file.section}.scale: db.",
                "negative",
            )
        zero = size == 0
        factor = 10.0 if scale == "power" else 20.0
        with np.errstate(divide="ignore", invalid="ignore"):
            level = factor * np.log10(size, dtype=np.float64)
        image = np.where(finite & (size > 0), level, np.nan).astype(np.float32)
    impossible = _without_impossible(image, file)
    counts = Counts(
        pixels=values.size,
        no_data=int(np.count_nonzero(~finite & ~zero)),
        zero=int(np.count_nonzero(zero)),
        negative=negative,
        impossible=impossible,
    )
    if not np.isfinite(image).any():
        raise file.refused(f"{path} holds no power: {counts.zero:,} of its pixels are 0.", "zero")
    return image, counts


def _without_impossible(image: NDArray[np.float32], file: ImageFile) -> int:
    """Mask values beyond :data:`LARGEST_DB` and return their number; refuse the image if their share is too large."""
    wrong = np.abs(image) > LARGEST_DB  # false for NaN
    count, known = int(np.count_nonzero(wrong)), int(np.count_nonzero(np.isfinite(image)))
    if count > file.impossible_share * known:
        extreme = image[wrong][np.argmax(np.abs(image[wrong]))]
        raise file.refused(
            f"{file.path} holds {extreme:.4g} dB and {count:,} of {known:,} values like it, expected within "
            f"+-{LARGEST_DB:g} dB: most likely {file.section}.scale is not {file.options.scale}, or no-data is not "
            "declared as such.",
            "impossible",
        )
    image[wrong] = np.nan
    return count


def check_header(file: ImageFile, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Check the shape and type that a file's header gives for an array, before memory is allocated for the array.

    Parameters
    ----------
    file : ImageFile
        File with the declared scale and the required size of the image.
    shape : tuple of int
        Shape of the array in the file.
    dtype : dtype
        Type of the numbers; pairs ``real``, ``imag``, as MATLAB writes them, count as complex numbers.

    Raises
    ------
    RadcalError
        The array is not two-dimensional, has the wrong size or too many pixels, or its type contradicts the scale.
    """
    path, scale = file.path, file.options.scale
    if len(shape) != 2:
        raise file.refused(f"{path} holds an array of shape {shape}, expected an image.")
    kinds, wanted = ("c", "complex numbers") if scale == "complex" else ("fiu", "real numbers")
    kind = "c" if dtype.names == ("real", "imag") else dtype.kind
    if kind not in kinds:
        raise file.refused(f"{path} holds {dtype}, expected {wanted} for {file.section}.scale: {scale}.")
    if file.shape is not None and shape != file.shape:
        raise file.refused(
            f"{path} has {shape[0]} x {shape[1]} pixels, the scene's image {file.shape[0]} x {file.shape[1]}"
            f"{file.turned if shape == file.shape[::-1] and file.turned else file.resized}."
        )
    if file.shape is None and shape[0] * shape[1] > LARGEST_VALUES:
        raise file.refused(
            f"{path} has {shape[0]} x {shape[1]} pixels, expected at most {LARGEST_VALUES:.0e}: cut out the scene's "
            "area."
        )


def reading(file: ImageFile, called: str) -> AbstractContextManager[None]:
    """Context that reads a file as :func:`.guarded` does; its errors are ``file.error``.

    Parameters
    ----------
    file : ImageFile
        File that the ``with`` block reads.
    called : str
        Name of the file's format in error messages, such as "a raster".
    """
    pixels = LARGEST_VALUES if file.shape is None else file.shape[0] * file.shape[1]
    return guarded(file.path, lambda text: file.refused(f"{file.path} {text}"), called, pixels)
