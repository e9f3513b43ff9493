"""Arrays in files to images in dB, whoever wrote them: a sensor's processor or a simulator.

Apart from both, so that the measurement and the simulators read with the same code without
importing each other; what differs is the section of the configuration that messages name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from radcal.errors import RadcalError
from radcal.intake import LARGEST_VALUES, bounded_memory, elsewhere, unchanged
from radcal.rasters import check_blocks, open_raster

__all__ = [
    "LARGEST_DB",
    "Counts",
    "ImageFile",
    "Options",
    "Values",
    "check_header",
    "is_raster",
    "raster_band",
    "read_array",
    "reading",
    "to_db",
]

Values = NDArray[Any]
_NEGATIVE_SHARE = 0.01  # of a power image: noise subtraction leaves a few
LARGEST_DB = 200.0
"""No backscatter, however calibrated, is further from 0 dB: a scale mix-up, or damage."""
_HDF5_SPARE_BYTES = 64 << 20  # by which a chunk may be larger than its dataset
_HDF5_FILTERS = frozenset(range(1, 7))  # those of the library itself: deflate, shuffle, Fletcher-32, szip, n-bit, scale
_LZF = 32000  # h5py's own


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
    shape : (int, int) or None
        Size that the image must have as it stands in the file; None where any will do.
    resized, turned : str
        What to do with an image of another size, and with one whose rows are columns.
    impossible_share : float
        Share of the finite pixels up to which impossible values are masked rather than refused.
    folders : tuple of Path
        Where the sources of a VRT may lie besides its own folder.
    """

    path: Path
    options: Options
    section: str
    key: str
    error: type[RadcalError]
    shape: tuple[int, int] | None = None
    resized: str = ""
    turned: str = ""
    impossible_share: float = 0.0
    folders: tuple[Path, ...] = ()

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
    impossible : int
        Further than :data:`LARGEST_DB` from 0 dB.
    """

    pixels: int
    no_data: int
    zero: int
    negative: int
    impossible: int = 0

    def __str__(self) -> str:
        impossible = f", {self.impossible:,} impossible (beyond +-{LARGEST_DB:g} dB)" * (self.impossible > 0)
        return (
            f"{self.pixels:,} pixels, {self.no_data:,} without data, {self.zero:,} zero, {self.negative:,} negative"
            f"{impossible}: NaN in the image"
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
        10 log10 of the power [dB], NaN where it is not positive and finite, or impossible.
    counts : Counts
        How many pixels are NaN, and why.

    Raises
    ------
    RadcalError
        The file's error: no image, or no number of it is finite, or no power positive, or real
        numbers for complex ones; too many negative numbers for power or amplitude, or impossible
        levels for any scale.
    """
    scale, path = file.options.scale, file.path
    check_header(file, values.shape, values.dtype)
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
    impossible = _without_impossible(image, file)
    counts = Counts(
        pixels=values.size,
        no_data=int(np.count_nonzero(~finite & ~zero)),
        zero=int(np.count_nonzero(zero)),
        negative=negative,
        impossible=impossible,
    )
    if not np.isfinite(image).any():
        raise file.refused(f"{path} holds no power: {counts.zero:,} of its pixels are 0.")
    return image, counts


def _without_impossible(image: NDArray[np.float32], file: ImageFile) -> int:
    """Mask what no backscatter can be and return how many pixels that were; refuse many."""
    wrong = np.abs(image) > LARGEST_DB  # never true of NaN
    count, known = int(np.count_nonzero(wrong)), int(np.count_nonzero(np.isfinite(image)))
    if count > file.impossible_share * known:
        extreme = image[wrong][np.argmax(np.abs(image[wrong]))]
        raise file.refused(
            f"{file.path} holds {extreme:.4g} dB, expected within +-{LARGEST_DB:g} dB, which {count:,} of {known:,} values "
            f"are not: most likely {file.section}.scale is not {file.options.scale}, or no-data is not declared as such."
        )
    image[wrong] = np.nan
    return count


def check_header(file: ImageFile, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Refuse an array by what its file tells of it, before memory is taken for it.

    Parameters
    ----------
    file : ImageFile
        Its scale, and the size that the image must have.
    shape : tuple of int
        Of the array in the file.
    dtype : dtype
        Of its numbers; complex ones may stand as a pair ``real``, ``imag``, as MATLAB writes them.

    Raises
    ------
    RadcalError
        The file's error: no image, one of another size, of too many pixels, or not numbers of the scale.
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
    """Turn whatever a library raises on a damaged file into the file's error, and bound what it takes.

    Parameters
    ----------
    file : ImageFile
        The file.
    called : str
        What it is read as, such as "a raster".
    """
    pixels = LARGEST_VALUES if file.shape is None else file.shape[0] * file.shape[1]
    try:
        with unchanged(file.path), bounded_memory(pixels):
            yield
    except RadcalError:
        raise
    except MemoryError:
        raise file.refused(
            f"{file.path} cannot be read as {called} (it takes far more memory than {pixels:,} pixels do)."
        ) from None
    except Exception as error:  # what the libraries raise on damaged files has no common base
        raise file.refused(f"{file.path} cannot be read as {called} ({' '.join(str(error).split())}).") from None


def raster_band(raster: Any, file: ImageFile, window: Any = None) -> Values:
    """Band of an open raster.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        An open raster.
    file : ImageFile
        Which band.
    window : rasterio.windows.Window, optional
        Part of it.

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
    if file.options.dataset is not None:
        raise file.asked(
            "dataset",
            f"{file.options.dataset!r}, {file.path} is a raster, which has bands and no datasets: take it out.",
        )
    if band is None:
        if raster.count != 1:
            raise file.refused(
                f"{file.path} has {raster.count} bands, expected one: say which with {file.section}.band."
            )
        band = 1
    if band > raster.count:
        raise file.asked("band", f"{band}, {file.path} has {raster.count}.")
    dtype = np.dtype(raster.dtypes[band - 1].replace("complex_int16", "complex64"))
    check_header(file, raster.shape if window is None else (window.height, window.width), dtype)
    check_blocks(raster)
    values = raster.read(band, masked=True, window=window)
    numbers = values.astype(np.complex128 if values.dtype.kind == "c" else np.float64).filled(np.nan)
    scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
    if (scale, offset) != (1.0, 0.0):
        numbers = numbers * scale + offset
    return np.asarray(numbers)


def _raster(file: ImageFile) -> Values:
    with open_raster(file.path, file.folders) as raster:
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
    if file.options.dataset is not None:
        raise file.asked("dataset", f"{file.options.dataset!r}, {file.path} holds one array without a name.")
    mapped = np.load(file.path, mmap_mode="r", allow_pickle=False)  # no more than its header
    check_header(file, mapped.shape, mapped.dtype)
    return np.asarray(np.load(file.path, allow_pickle=False))


def _npz(file: ImageFile) -> Values:
    with np.load(file.path, allow_pickle=False) as archive:
        name = _chosen(list(archive.files), file)
        member = name if name in archive.zip.namelist() else f"{name}.npy"
        with archive.zip.open(member) as content:
            read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            shape, _, dtype = read[np.lib.format.read_magic(content)](content)
        check_header(file, shape, dtype)
        return np.asarray(archive[name])


def _hdf5(file: ImageFile, transposed: bool = False) -> Values:
    """Dataset of an HDF5 file; ``transposed``: with the axes the other way round."""
    import h5py

    with h5py.File(file.path, "r") as content:
        found: list[str] = []
        content.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        if (what := elsewhere(content)) is not None:
            raise file.refused(f"in {file.path} {what}, which is not followed.")
        data = content[_chosen(found, file)]
        check_header(file, data.shape[::-1] if transposed else data.shape, data.dtype)
        _check_storage(data, file)
        values = np.asarray(data[()])
    values = values.T if transposed else values
    return values["real"] + 1j * values["imag"] if values.dtype.names == ("real", "imag") else values


def _check_storage(data: Any, file: ImageFile) -> None:
    """Refuse chunks and filters with which a small dataset takes a large memory."""
    chunk = data.dtype.itemsize * int(np.prod(data.chunks, dtype=np.int64)) if data.chunks else 0
    if chunk > data.nbytes + _HDF5_SPARE_BYTES:
        raise file.refused(
            f"{file.path} keeps {data.nbytes:,} bytes in chunks of {chunk:,}, expected none larger than its numbers."
        )
    pipeline = data.id.get_create_plist()
    filters = [pipeline.get_filter(k)[0] for k in range(pipeline.get_nfilters())]
    other = [number for number in filters if number not in _HDF5_FILTERS | {_LZF}]
    if other or len(set(filters)) < len(filters):
        raise file.refused(
            f"{file.path} is compressed by the HDF5 filters {filters}, expected those of the library itself, each "
            "once: repack it, for example with h5repack -f GZIP=4."
        )


def _mat(file: ImageFile) -> Values:
    from scipy.io import loadmat, whosmat

    try:
        found = {name: shape for name, shape, kind in whosmat(file.path) if kind in _MATLAB_NUMBERS}
    except NotImplementedError:  # version 7.3 is HDF5, with the axes the other way round
        return _hdf5(file, transposed=True)
    name = _chosen(list(found), file)
    # whether its numbers are complex is told with them
    check_header(file, found[name], np.dtype(np.complex128 if file.options.scale == "complex" else np.float64))
    return np.asarray(loadmat(file.path, variable_names=[name])[name])


_MATLAB_NUMBERS = ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_READERS: dict[str, tuple[Callable[[ImageFile], Values], str]] = {
    "npy": (_npy, "a numpy array"),
    "npz": (_npz, "numpy arrays"),
    "mat": (_mat, "a MATLAB file"),
    "hdf5": (_hdf5, "HDF5"),
    "raster": (_raster, "a raster"),
}
_ENDINGS = {".npy": "npy", ".npz": "npz", ".mat": "mat", ".h5": "hdf5", ".hdf5": "hdf5"}
