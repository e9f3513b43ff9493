"""Measured images from files: SICD, GeoTIFF and other rasters, numpy, MATLAB and HDF5 arrays, to dB."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement
from radcal.errors import MeasurementError
from radcal.measurement.sicd import is_sicd, read_sicd
from radcal.scene.crs import crs_of, horizontal

__all__ = [
    "Counts",
    "ReadImage",
    "image_of",
    "is_raster",
    "open_raster",
    "read_image",
    "read_raster",
    "read_values",
    "to_db",
]

Values = NDArray[Any]
_Read = TypeVar("_Read")
_SICD_ENDINGS = (".nitf", ".ntf", ".sicd")
_NEGATIVE_SHARE = 0.01  # of a power image: noise subtraction leaves a few


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
        read = image_of(sicd.power, path, "power", shape)
        return replace(read, notes=sicd.notes, polarisation=sicd.polarisation, frequency_hz=sicd.frequency_hz)
    return image_of(read_values(path, config), path, config.scale, shape)


def image_of(values: Values, path: Path, scale: str, shape: tuple[int, int] | None = None) -> ReadImage:
    """Check the numbers of an image and bring them to dB.

    Parameters
    ----------
    values : ndarray
        As read.
    path : path
        For messages.
    scale : {'db', 'power', 'amplitude', 'complex'}
        What the numbers are.
    shape : (int, int), optional
        Size that the image must have.

    Raises
    ------
    MeasurementError
        The numbers are no image of this shape or contradict the scale.
    """
    if values.ndim != 2:
        raise MeasurementError(f"measurement.path: {path} holds an array of shape {values.shape}, expected an image.")
    if shape is not None and values.shape != shape:
        raise MeasurementError(
            f"measurement.path: {path} has {values.shape[0]} x {values.shape[1]} pixels, the scene's image "
            f"{shape[0]} x {shape[1]}: crop or resample it to the same grid."
        )
    kinds, wanted = ("c", "complex numbers") if scale == "complex" else ("fiu", "real numbers")
    if values.dtype.kind not in kinds:
        raise MeasurementError(
            f"measurement.path: {path} holds {values.dtype}, expected {wanted} for measurement.scale: {scale}."
        )
    return ReadImage(*to_db(values, scale, path))


def to_db(values: Values, scale: str, path: Path) -> tuple[NDArray[np.float32], Counts]:
    """Numbers of a declared scale to dB.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        dB, linear power, linear amplitude, or complex amplitude.
    scale : {'db', 'power', 'amplitude', 'complex'}
        Which of these.
    path : path
        For messages.

    Returns
    -------
    image_db : ndarray of float32, shape (rows, columns)
        10 log10 of the power [dB], NaN where it is not positive and finite.
    counts : Counts
        How many pixels are NaN, and why.

    Raises
    ------
    MeasurementError
        No number is finite or no power positive; too many negative numbers for power or
        amplitude, or none where dB must have some.
    """
    finite = np.isfinite(values)
    if not finite.any():
        raise MeasurementError(f"measurement.path: {path} holds no finite number.")
    if scale == "db":
        present = values[finite].astype(np.float64)
        # speckle spreads dB by 2 and more, so that an image with its median near 0 dB has negative values
        if present.min() >= 0 and np.median(present) < 3.0:
            raise MeasurementError(
                f"measurement.path: the values of {path} run from {present.min():.3g} to {present.max():.3g} with "
                f"median {np.median(present):.3g}, none negative, which looks like power: set measurement.scale: power."
            )
        zero, negative = values == -np.inf, 0  # the logarithm of no power
        image = np.where(finite, values, np.nan).astype(np.float32)
    else:
        size = np.abs(values) if scale == "complex" else values
        below = finite & (size < 0)
        negative = int(np.count_nonzero(below))
        if negative > (_NEGATIVE_SHARE * np.count_nonzero(finite) if scale == "power" else 0):
            raise MeasurementError(
                f"measurement.path: {negative} of {np.count_nonzero(finite)} values of {path} are negative, which "
                f"{scale} cannot be: if the file is in dB, set measurement.scale: db."
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
        raise MeasurementError(f"measurement.path: {path} holds no power: {counts.zero:,} of its pixels are 0.")
    return image, counts


def read_values(path: Path, config: FileMeasurement) -> Values:
    """Numbers of a file as they are; no-data as NaN where the format knows it.

    Raises
    ------
    MeasurementError
        The file cannot be read or does not hold the dataset or band.
    """
    return _read(_READERS.get(path.suffix.lower(), _raster), path, config)


def is_raster(path: Path) -> bool:
    """Whether a file is read as a raster, by its ending."""
    return path.suffix.lower() not in _READERS


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
    return _read(_raster_and_place, path, config)


def _read(reader: Callable[[Path, FileMeasurement], _Read], path: Path, config: FileMeasurement) -> _Read:
    try:
        return reader(path, config)
    except MeasurementError:
        raise
    except Exception as error:  # what the libraries raise on damaged files has no common base
        raise MeasurementError(f"measurement.path: {path} cannot be read as {_KINDS[reader]} ({error}).") from None


def _raster(path: Path, config: FileMeasurement) -> Values:
    with open_raster(path) as raster:
        return _band(raster, path, config)


def _raster_and_place(path: Path, config: FileMeasurement) -> tuple[Values, Any, Any]:
    with open_raster(path) as raster:
        crs = crs_of(raster)
        return _band(raster, path, config), raster.transform, horizontal(crs) if crs is not None else None


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


def _band(raster: Any, path: Path, config: FileMeasurement) -> Values:
    band = config.band
    if band is None:
        if raster.count != 1:
            raise MeasurementError(
                f"measurement.path: {path} has {raster.count} bands, expected one: say which with measurement.band."
            )
        band = 1
    if band > raster.count:
        raise MeasurementError(f"measurement.band is {band}, {path} has {raster.count}.")
    values = raster.read(band, masked=True)
    if values.dtype.kind not in "fiuc":
        raise MeasurementError(f"measurement.path: {path} holds {values.dtype}, expected real or complex numbers.")
    return np.asarray(values.astype(np.complex128 if values.dtype.kind == "c" else np.float64).filled(np.nan))


def _chosen(names: list[str], path: Path, config: FileMeasurement) -> str:
    """Name of the dataset to read."""
    if config.dataset is None:
        if len(names) == 1:
            return names[0]
        raise MeasurementError(
            f"measurement.path: {path} holds {', '.join(names) or 'no array'}: say which with measurement.dataset."
        )
    if config.dataset not in names:
        raise MeasurementError(
            f"measurement.dataset is {config.dataset!r}, {path} holds {', '.join(names) or 'no array'}."
        )
    return config.dataset


def _npy(path: Path, config: FileMeasurement) -> Values:  # noqa: ARG001 - one shape for all readers
    return np.asarray(np.load(path, allow_pickle=False))


def _npz(path: Path, config: FileMeasurement) -> Values:
    with np.load(path, allow_pickle=False) as archive:
        return np.asarray(archive[_chosen(list(archive.files), path, config)])


def _hdf5(path: Path, config: FileMeasurement) -> Values:
    import h5py

    with h5py.File(path, "r") as file:
        found: list[str] = []
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return np.asarray(file[_chosen(found, path, config)][()])


def _mat(path: Path, config: FileMeasurement) -> Values:
    from scipy.io import loadmat, whosmat

    try:
        names = [name for name, _, kind in whosmat(path) if kind in ("double", "single") or "int" in kind]
        return np.asarray(loadmat(path, variable_names=[name := _chosen(names, path, config)])[name])
    except NotImplementedError:  # version 7.3 is HDF5, with the axes the other way round
        values = _hdf5(path, config).T
        if values.dtype.names == ("real", "imag"):
            values = values["real"] + 1j * values["imag"]
        return values


_Reader = Callable[[Path, FileMeasurement], Values]
_READERS: dict[str, _Reader] = {".npy": _npy, ".npz": _npz, ".mat": _mat, ".h5": _hdf5, ".hdf5": _hdf5}
_KINDS: dict[Callable[[Path, FileMeasurement], Any], str] = {
    _raster: "a raster",
    _raster_and_place: "a raster",
    _npy: "a numpy array",
    _npz: "numpy arrays",
    _mat: "a MATLAB file",
    _hdf5: "HDF5",
}
