"""Readers of arrays, one for each file format; each reader checks the file header before it allocates memory."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
import scipy

from radcal.processes import apart
from radcal.reading.images import ImageFile, Values, check_header, reading
from radcal.reading.intake import elsewhere
from radcal.reading.rasters import check_blocks, open_raster

_HDF5_SPARE_BYTES = 64 << 20  # number of bytes by which a chunk may be larger than its dataset
# filters of the HDF5 library: deflate, shuffle, Fletcher-32, szip, n-bit, scale-offset
_HDF5_FILTERS = frozenset(range(1, 7))
_LZF = 32000  # number of h5py's filter LZF
_LONGEST_S = 600  # longest CPU time of a reader that a damaged file can crash [s]


def read_array(file: ImageFile, kind: str | None = None) -> Values:
    """Read the numbers of a file without conversion to dB; no-data values that the format marks become NaN.

    Parameters
    ----------
    file : ImageFile
        File with its configured options, such as dataset and band.
    kind : {'npy', 'npz', 'mat', 'hdf5', 'raster'}, optional
        Format of the file; by default derived from the file's ending.

    Raises
    ------
    RadcalError
        The file cannot be read, or lacks the dataset or band. The class of the exception is ``file.error``.
    """
    reader, called = _READERS[kind or _ENDINGS.get(file.path.suffix.lower(), "raster")]
    with reading(file, called):
        return reader(file)


def is_raster(path: Path) -> bool:
    """Whether a file is read as a raster; the ending of the file name decides."""
    return path.suffix.lower() not in _ENDINGS


def raster_band(raster: Any, file: ImageFile, window: Any = None) -> Values:
    """Read the numbers of one band of an open raster.

    Parameters
    ----------
    raster : rasterio.DatasetReader
        Open raster.
    file : ImageFile
        File of the raster, with the configured band.
    window : rasterio.windows.Window, optional
        Part of the raster that is read; by default the whole raster.

    Returns
    -------
    ndarray, shape (rows, columns)
        Numbers of the band (float64 or complex128); pixels that the file masks are NaN. If the band has a scale and an
        offset (GDAL's raster data model), both are applied.

    Raises
    ------
    RadcalError
        The raster lacks the configured band, has several bands and none is configured, or has no usable numbers.
    """
    band = file.options.band
    if file.options.dataset is not None:
        raise file.asked(
            "dataset",
            f"{file.options.dataset!r}, {file.path} is a raster, which has bands and no datasets: remove the key.",
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
    """Name of the configured array, or of the only array in a file."""
    listed = ", ".join(names) or "no array"
    chosen: str | None = file.options.dataset
    if chosen is None:
        if len(names) == 1:
            return names[0]
        raise file.refused(f"{file.path} holds {listed}: say which with {file.section}.dataset.")
    if chosen not in names:
        raise file.asked("dataset", f"{chosen!r}, {file.path} holds {listed}, expected one in the file.")
    return chosen


def _npy(file: ImageFile) -> Values:
    if file.options.dataset is not None:
        raise file.asked("dataset", f"{file.options.dataset!r}, {file.path} holds one array without a name.")
    with file.path.open("rb") as content:
        check_header(file, *_numpy_header(content))
    return np.asarray(np.load(file.path, allow_pickle=False))


def _numpy_header(content: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of a numpy array, from the header in an open file."""
    read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(content)
    if version not in read:
        raise ValueError(f"its format has version {version}, expected 1.0 or 2.0")
    shape, _, dtype = read[version](content)
    return shape, dtype


def _npz(file: ImageFile) -> Values:
    with zipfile.ZipFile(file.path) as archive:
        members = {member.removesuffix(".npy"): member for member in archive.namelist()}
        member = members[_chosen(list(members), file)]
        with archive.open(member) as content:
            check_header(file, *_numpy_header(content))
        with archive.open(member) as content:
            return np.asarray(np.lib.format.read_array(content, allow_pickle=False))


def _hdf5(file: ImageFile, transposed: bool = False) -> Values:
    """Read the numbers of a dataset in an HDF5 file, with reversed axes if ``transposed`` is true."""
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
    """Refuse an HDF5 dataset whose chunks or filters could make a small dataset need much memory."""
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
    def survived(call: Callable[[], Any]) -> Any:
        try:
            return apart(call, _LONGEST_S)
        except BrokenProcessPool:
            raise ValueError("it is damaged: reading it crashes") from None

    try:
        found = {
            name: shape
            for name, shape, kind in survived(partial(scipy.io.whosmat, file.path))
            if kind in _MATLAB_NUMBERS
        }
    except NotImplementedError:  # version 7.3 is HDF5, with reversed axes
        return _hdf5(file, transposed=True)
    name = _chosen(list(found), file)
    # the header does not state whether the numbers are complex
    check_header(file, found[name], np.dtype(np.complex128 if file.options.scale == "complex" else np.float64))
    return np.asarray(survived(partial(scipy.io.loadmat, file.path, variable_names=[name]))[name])


_MATLAB_NUMBERS = ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_READERS: dict[str, tuple[Callable[[ImageFile], Values], str]] = {
    "npy": (_npy, "a numpy array"),
    "npz": (_npz, "numpy arrays"),
    "mat": (_mat, "a MATLAB file"),
    "hdf5": (_hdf5, "HDF5"),
    "raster": (_raster, "a raster"),
}
_ENDINGS = {".npy": "npy", ".npz": "npz", ".mat": "mat", ".h5": "hdf5", ".hdf5": "hdf5"}
