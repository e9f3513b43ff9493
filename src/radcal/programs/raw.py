"""Reader of raw image files, which contain only numbers, row by row, after an optional header that is skipped."""

from __future__ import annotations

from typing import get_args

import numpy as np

from radcal.config import Output, RawType
from radcal.reading.images import ImageFile, Values

__all__ = ["read_raw"]

_RAW_TYPES: tuple[str, ...] = get_args(RawType)


def read_raw(file: ImageFile, config: Output, shape: tuple[int, int]) -> Values:
    """Read the numbers of a raw file; a file of unexpected length raises an error.

    Parameters
    ----------
    file : ImageFile
        Raw file.
    config : Output
        Section with the type of the numbers, the byte order and the length of the header.
    shape : (int, int)
        Numbers of rows and columns, in the order in which the file stores them.

    Raises
    ------
    SimulatorError
        The length of the file does not match type, shape and header.
    """
    dtype = np.dtype(str(config.dtype)).newbyteorder("<" if config.byte_order in (None, "little") else ">")
    header = config.header_bytes or 0
    expected = header + shape[0] * shape[1] * dtype.itemsize
    found = file.path.stat().st_size
    if found != expected:
        pixels = shape[0] * shape[1]
        others = [name for name in _RAW_TYPES if found == header + pixels * np.dtype(name).itemsize]
        as_many = f": as many as of {' or '.join(others)}" if others else ""
        raise file.refused(
            f"{file.path} has {found} bytes, expected {expected} for {shape[0]} x {shape[1]} numbers of {config.dtype}"
            f"{f' after a header of {header}' if header else ''}"
            f"{as_many}"
        )
    return np.fromfile(file.path, dtype=dtype, offset=header).reshape(shape)
