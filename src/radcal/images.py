"""Arrays in files to images in dB, whoever wrote them: a sensor's processor or a simulator.

Apart from both, so that the measurement and the simulators read with the same code without
importing each other; what differs is the section of the configuration that messages name.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radcal.errors import RadcalError

__all__ = [
    "Counts",
    "ImageFile",
    "Options",
    "Values",
    "is_raster",
    "open_raster",
    "raster_band",
    "read_array",
    "reading",
    "to_db",
]

Values = NDArray[Any]
_NEGATIVE_SHARE = 0.01  # of a power image: noise subtraction leaves a few


class Options(Protocol):
    """What a configuration tells about an image file."""

    @property
    def scale(self) -> str:
        """What the numbers are: db, power, amplitude or complex."""
        ...

    @property
    def band(self) -> int | None:
        """Band of a raster, from 1."""
        ...

    @property
    def dataset(self) -> str | None:
        """Name in npz, mat or HDF5."""
        ...


@dataclass(frozen=True)
class ImageFile:
    """A file that holds an image, and how messages speak of it.

    Attributes
    ----------
    path : Path
        The file.
    options : Options
        Scale, and dataset or band.
    section, key : str
        Section of the configuration with the options, and its key of the path.
    error : type of RadcalError
        What is raised.
    """

    path: Path
    options: Options
    section: str
    key: str
    error: type[RadcalError]

    def refused(self, text: str) -> RadcalError:
        """Return the error of a file that is not what it should be; ``text`` goes on after the key."""
        return self.error(f"{self.section}.{self.key}: {text}")

    def asked(self, key: str, text: str) -> RadcalError:
        """Return the error of an option that does not fit the file."""
        return self.error(f"{self.section}.{key} is {text}")


@dataclass(frozen=True)
class Counts:
    """Pixels of an image, and those of them that have no level.

    Attributes
    ----------
    pixels : int
        All.
    no_data : int
        Not a number, infinite, or masked by the file.
    zero : int
        No power at all.
    negative : int
        Negative power, as the subtraction of noise leaves it.
    """

    pixels: int
    no_data: int
    zero: int
    negative: int

    def __str__(self) -> str:
        return (
            f"{self.pixels:,} pixels, {self.no_data:,} without data, {self.zero:,} zero, {self.negative:,} negative: "
            "NaN in the image"
        )


def to_db(values: Values, file: ImageFile) -> tuple[NDArray[np.float32], Counts]:
    """Check the numbers of an image against their declared scale and bring them to dB.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        dB, linear power, linear amplitude, or complex amplitude.
    file : ImageFile
        Scale, and words for messages.

    Returns
    -------
    image_db : ndarray of float32, shape (rows, columns)
        10 log10 of the power [dB], NaN where it is not positive and finite.
    counts : Counts
        How many pixels are NaN, and why.

    Raises
    ------
    RadcalError
        The file's error: no image, or no number of it is finite, or no power positive, or real
        numbers for complex ones; too many negative numbers for power or amplitude.
    """
    scale, path = file.options.scale, file.path
    if values.ndim != 2:
        raise file.refused(f"{path} holds an array of shape {values.shape}, expected an image.")
    kinds, wanted = ("c", "complex numbers") if scale == "complex" else ("fiu", "real numbers")
    if values.dtype.kind not in kinds:
        raise file.refused(f"{path} holds {values.dtype}, expected {wanted} for {file.section}.scale: {scale}.")
    finite = np.isfinite(values)
    if not finite.any():
        raise file.refused(f"{path} holds no finite number.")
    if scale == "db":
        zero, negative = values == -np.inf, 0  # the logarithm of no power
        image = np.where(finite, values, np.nan).astype(np.float32)
    else:
        size = np.abs(values) if scale == "complex" else values
        below = finite & (size < 0)
        negative = int(np.count_nonzero(below))
        if negative > (_NEGATIVE_SHARE * np.count_nonzero(finite) if scale == "power" else 0):
            raise file.refused(
                f"{negative} of {np.count_nonzero(finite)} values of {path} are negative, which {scale} cannot be: if "
                f"the file is in dB, set {file.section}.scale: db."
            )
        zero = size == 0
        factor = 10.0 if scale == "power" else 20.0
        with np.errstate(divide="ignore", invalid="ignore"):
            level = factor * np.log10(size, dtype=np.float64)
        image = np.where(finite & (size > 0), level, np.nan).astype(np.float32)
    counts = Counts(
        pixels=values.size,
        no_data=int(np.count_nonzero(~finite & ~zero)),
        zero=int(np.count_nonzero(zero)),
        negative=negative,
    )
    if not np.isfinite(image).any():
        raise file.refused(f"{path} holds no power: {counts.zero:,} of its pixels are 0.")
    return image, counts


def read_array(file: ImageFile, kind: str | None = None) -> Values:
    """Numbers of a file as they are; no-data as NaN where the format knows it.

    Parameters
    ----------
    file : ImageFile
        The file, and the dataset or band of it.
    kind : {'npy', 'npz', 'mat', 'hdf5', 'raster'}, optional
        Its format; without it, its ending says that.

    Raises
    ------
    RadcalError
        The file's error: it cannot be read or does not hold the dataset or band.
    """
    reader, called = _READERS[kind or _ENDINGS.get(file.path.suffix.lower(), "raster")]
    with reading(file, called):
        return reader(file)


def is_raster(path: Path) -> bool:
    """Whether a file is read as a raster, by its ending."""
    return path.suffix.lower() not in _ENDINGS


@contextmanager
def reading(file: ImageFile, called: str) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file into the file's error.

    Parameters
    ----------
    file : ImageFile
        The file.
    called : str
        What it is read as, such as "a raster".
    """
    try:
        yield
    except RadcalError:
        raise
    except Exception as error:  # what the libraries raise on damaged files has no common base
        raise file.refused(f"{file.path} cannot be read as {called} ({error}).") from None


@contextmanager
def open_raster(path: Path) -> Iterator[Any]:
    """Open a raster, without a warning where it has no place on the map.

    Parameters
    ----------
    path : path
        Any raster that GDAL reads.

    Yields
    ------
    rasterio.DatasetReader
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path) as raster:
            yield raster


def raster_band(raster: Any, file: ImageFile) -> Values:
    """Band of an open raster.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        An open raster.
    file : ImageFile
        Which band.

    Returns
    -------
    ndarray, shape (rows, columns)
        float64 or complex128, NaN where the file masks it. Where the band has a scale and an offset (GDAL's raster
        data model), the file's numbers times the scale plus the offset.

    Raises
    ------
    RadcalError
        The file's error: no such band, several to choose from, or not numbers.
    """
    band = file.options.band
    if band is None:
        if raster.count != 1:
            raise file.refused(
                f"{file.path} has {raster.count} bands, expected one: say which with {file.section}.band."
            )
        band = 1
    if band > raster.count:
        raise file.asked("band", f"{band}, {file.path} has {raster.count}.")
    values = raster.read(band, masked=True)
    if values.dtype.kind not in "fiuc":
        raise file.refused(f"{file.path} holds {values.dtype}, expected real or complex numbers.")
    numbers = values.astype(np.complex128 if values.dtype.kind == "c" else np.float64).filled(np.nan)
    scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
    if (scale, offset) != (1.0, 0.0):
        numbers = numbers * scale + offset
    return np.asarray(numbers)


def _raster(file: ImageFile) -> Values:
    with open_raster(file.path) as raster:
        return raster_band(raster, file)


def _chosen(names: list[str], file: ImageFile) -> str:
    """Name of the dataset to read."""
    listed, chosen = ", ".join(names) or "no array", file.options.dataset
    if chosen is None:
        if len(names) == 1:
            return names[0]
        raise file.refused(f"{file.path} holds {listed}: say which with {file.section}.dataset.")
    if chosen not in names:
        raise file.asked("dataset", f"{chosen!r}, {file.path} holds {listed}.")
    return chosen


def _npy(file: ImageFile) -> Values:
    return np.asarray(np.load(file.path, allow_pickle=False))


def _npz(file: ImageFile) -> Values:
    with np.load(file.path, allow_pickle=False) as archive:
        return np.asarray(archive[_chosen(list(archive.files), file)])


def _hdf5(file: ImageFile) -> Values:
    import h5py

    with h5py.File(file.path, "r") as content:
        found: list[str] = []
        content.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return np.asarray(content[_chosen(found, file)][()])


def _mat(file: ImageFile) -> Values:
    from scipy.io import loadmat, whosmat

    try:
        names = [name for name, _, kind in whosmat(file.path) if kind in ("double", "single") or "int" in kind]
        return np.asarray(loadmat(file.path, variable_names=[name := _chosen(names, file)])[name])
    except NotImplementedError:  # version 7.3 is HDF5, with the axes the other way round
        values = _hdf5(file).T
        if values.dtype.names == ("real", "imag"):
            values = values["real"] + 1j * values["imag"]
        return values


_READERS: dict[str, tuple[Callable[[ImageFile], Values], str]] = {
    "npy": (_npy, "a numpy array"),
    "npz": (_npz, "numpy arrays"),
    "mat": (_mat, "a MATLAB file"),
    "hdf5": (_hdf5, "HDF5"),
    "raster": (_raster, "a raster"),
}
_ENDINGS = {".npy": "npy", ".npz": "npz", ".mat": "mat", ".h5": "hdf5", ".hdf5": "hdf5"}
