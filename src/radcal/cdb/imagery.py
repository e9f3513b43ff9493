"""Visible imagery of a database, for the picture of the scene alone.

References
----------
OGC 15-113r6, section 5.6.2 (imagery): three bands of eight bits in JPEG 2000; T001 is the representation of the year.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radcal.cdb.mosaic import Log, band
from radcal.reading.cdb import CdbFile
from radcal.scene.crs import transformer
from radcal.scene.grid import Grid

_GREY = 128  # where there is no imagery


def imagery(
    tiles: Sequence[CdbFile], grid: Grid, step: int, log: Log
) -> tuple[NDArray[np.uint8] | None, NDArray[np.int8]]:
    """Red, green and blue at the centres of every ``step``-th row and column of a grid, and the level of each.

    Returns
    -------
    ndarray of uint8, shape (y, x, 3), or None
        Colours, grey where no tile can be read; None if no tile at all can be read.
    ndarray of int8, shape (y, x)
        Levels.
    """
    east, north = (np.arange(0, count, step) + 0.5 for count in (grid.columns, grid.rows))
    x, y = np.meshgrid(grid.west + east * grid.cell_m, grid.south + north * grid.cell_m)
    longitude, latitude = transformer("EPSG:4326", grid.crs).transform(x, y, direction="INVERSE")
    found = np.full((*x.shape, 3), _GREY, dtype=np.uint8)
    levels = np.full(x.shape, -99, dtype=np.int8)
    for tile in sorted(tiles, key=lambda one: one.level):
        row = np.floor((latitude - tile.box[1]) / tile.step[1]).astype(np.int64)
        column = np.floor((longitude - tile.box[0]) / tile.step[0]).astype(np.int64)
        inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < tile.cells)
        # without reading tags, because the library that reads those of JPEG 2000 writes to the terminal
        if not inside.any() or (read := band(tile, log, None, GDAL_GEOREF_SOURCES="NONE")) is None:
            continue
        colours = np.moveaxis(read[0], 0, -1)
        if colours.shape[-1] != 3 or colours.dtype != np.uint8:
            log.left_out(tile.path, f"it has {colours.shape[-1]} bands of {colours.dtype}, expected 3 of uint8")
            continue
        found[inside], levels[inside] = colours[row[inside], column[inside]], tile.level
    return (found if (levels > -99).any() else None), levels
