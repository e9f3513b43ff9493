"""Tiles of several levels joined to one raster: the finest level that is there, coarser levels in its gaps.

Two registrations occur in a database. Elements of elevation are posts, the first of which lies on the south-west corner
of the tile; elements of other rasters are areas. A tile lies where its name says, not where the tags of the file say.
Visible imagery is for the picture of the scene alone.

References
----------
OGC 15-113r6, section 5.6.2 (imagery): three bands of eight bits in JPEG 2000; T001 is the representation of the year.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from radcal.errors import RadcalError, SceneError, UnreadFile
from radcal.findings import Finding
from radcal.reading.cdb import CdbFile
from radcal.reading.intake import guarded
from radcal.reading.rasters import check_blocks, in_memory, open_raster
from radcal.scene.crs import transformer
from radcal.scene.grid import LARGEST_CELLS, Grid, Source
from radcal.scene.raster import HIGHEST_M, LOWEST_M

T = TypeVar("T")
POST, AREA = 0.0, 0.5  # place of an element, from the south-west corner of its area [elements]
_MARGIN = 4  # elements around the bounds: cubic convolution reaches 2
_RESOLUTION = attrgetter("level", "step")
_SHOWN = 3  # largest number of files named in an error
_OFF = 0.1  # largest distance of a file's tags from the place of its name without a finding [elements]
_GREY = 128  # where there is no imagery


class Log(list[Finding]):
    """Findings on a database; files are named by their path from its root.

    Parameters
    ----------
    root : path
        Folder of the database.
    """

    def __init__(self, root: Path) -> None:
        super().__init__()
        self.root = root

    def left_out(self, path: Path, reason: str) -> None:
        """Add a warning on a file that is left out."""
        self.append(Finding("cdb_left_out", "warning", str(path.relative_to(self.root)), {"reason": reason}))

    def left_out_by(self, error: RadcalError) -> None:
        """Add a warning on the file of an error of :meth:`refused`; raise any other error."""
        if not isinstance(error.about, UnreadFile):
            raise error
        self.left_out(error.about.path, error.about.reason)

    def read(self, path: Path, called: str, read: Callable[[], T]) -> T | None:
        """What a function reads from a file in a format, as :func:`.guarded`; None for a file that is left out."""
        try:
            with guarded(path, partial(self.refused, path), called):
                return read()
        except SceneError as error:
            self.left_out_by(error)
            return None

    @contextmanager
    def causes(self) -> Iterator[None]:
        """Context whose error also says which files were left out, because they may be its cause."""
        try:
            yield
        except SceneError as error:
            files = [f"{one.about} ({one.numbers['reason']})" for one in self if one.code == "cdb_left_out"]
            if not files:
                raise
            more = f"; and {len(files) - _SHOWN} more" * (len(files) > _SHOWN)
            raise SceneError(f"{str(error).rstrip('.')}; left out: {'; '.join(files[:_SHOWN])}{more}.") from None

    def refused(self, path: Path, text: str) -> SceneError:
        """Error on a file, from the end of a sentence."""
        return SceneError(f"scene.root: {path} {text}", UnreadFile(path, text.rstrip(".")))


@dataclass(frozen=True)
class Lattice:
    """Elements of a raster in degrees.

    Attributes
    ----------
    step : (float, float)
        Distance of elements along longitude and latitude [deg].
    west, south : int
        Number of steps from the meridian of Greenwich and the equator to the south-west element.
    columns, rows : int
        Number of elements.
    at : float
        :data:`POST` or :data:`AREA`.
    """

    step: tuple[float, float]
    west: int
    south: int
    columns: int
    rows: int
    at: float

    @classmethod
    def around(cls, bounds: Sequence[float], step: tuple[float, float], at: float) -> Lattice:
        """Lattice of the elements inside of bounds [deg], and a margin."""
        west, south = (int(np.floor(low / one)) - _MARGIN for low, one in zip(bounds[:2], step, strict=True))
        east, north = (int(np.ceil(high / one)) + _MARGIN for high, one in zip(bounds[2:], step, strict=True))
        return cls(step, west, south, east - west, north - south, at)

    @classmethod
    def sampled(cls, bounds: Sequence[float], step: tuple[float, float], at: float) -> Lattice:
        """Lattice of every element or, where there are more than 1e8, of every second, fourth, and so on."""
        found = cls.around(bounds, step, at)
        too_many = found.rows * found.columns > LARGEST_CELLS
        return cls.sampled(bounds, (2.0 * step[0], 2.0 * step[1]), at) if too_many else found

    @property
    def box(self) -> tuple[float, float, float, float]:
        """West, south, east and north bounds of the areas of the elements, which begin at the elements of posts."""
        (dx, dy), east, north = self.step, self.west + self.columns, self.south + self.rows
        return self.west * dx, self.south * dy, east * dx, north * dy

    @property
    def longitude(self) -> NDArray[np.float64]:
        """Longitude of each column [deg]."""
        return np.asarray((self.west + np.arange(self.columns) + self.at) * self.step[0])

    @property
    def latitude(self) -> NDArray[np.float64]:
        """Latitude of each row, the first in the south [deg]."""
        return np.asarray((self.south + np.arange(self.rows) + self.at) * self.step[1])

    def within(self, tile: CdbFile) -> tuple[Any, Any]:
        """Indices of the elements inside of a tile, and those of the tile's elements that contain them."""
        ours, theirs = [], []
        for places, low, step in zip((self.latitude, self.longitude), tile.box[1::-1], tile.step[::-1], strict=True):
            element = np.floor((places - low) / step + 1e-6).astype(np.int64)  # posts lie on borders of elements
            ours.append(np.flatnonzero((element >= 0) & (element < tile.cells)))
            theirs.append(element[ours[-1]])
        return np.ix_(*ours), np.ix_(*theirs)

    @contextmanager
    def source(self, root: Path, values: NDArray[Any], nodata: float) -> Iterator[Source]:
        """Raster of values in memory, whose pixels have their centres at the elements; row 0 is in the south."""
        from pyproj import CRS
        from rasterio.transform import from_origin

        (dx, dy), crs = self.step, CRS.from_epsg(4326)
        transform = from_origin((self.west + self.at - 0.5) * dx, (self.south + self.at - 0.5) * dy, dx, -dy)
        with in_memory(values, "EPSG:4326", transform, nodata) as raster:
            yield Source("scene.root", root, raster, crs, crs)


def band(tile: CdbFile, log: Log, bands: int | None = 1, **settings: str) -> tuple[NDArray[Any], Any] | None:
    """First band of a tile with row 0 in the south, no-data as NaN or 0, and its transform; None if it is left out.

    With ``bands`` None, all bands, along axis 0; ``settings`` are configuration options of GDAL.
    """

    def read() -> tuple[NDArray[Any], Any]:
        with open_raster(tile.path, (), **settings) as raster:
            if raster.shape != (tile.cells, tile.cells):
                found = f"{raster.shape[0]} x {raster.shape[1]}"
                raise log.refused(tile.path, f"has {found} elements, expected {tile.cells} x {tile.cells}")
            check_blocks(raster)
            values = raster.read(bands, masked=True)
            return values.filled(np.nan if values.dtype.kind == "f" else 0)[..., ::-1, :], raster.transform

    return log.read(tile.path, "a raster", read)


def heights(tiles: Sequence[CdbFile], to: Lattice, log: Log) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Heights [m] at the posts of a lattice, and the level of each; NaN without a height.

    Posts of coarser levels are interpolated bilinearly. The finding ``cdb_tags`` says how far the tags of files are
    from the posts of the standard.
    """
    found = np.full((to.rows, to.columns), np.nan)
    levels = np.full(found.shape, -99, dtype=np.int8)
    off: list[tuple[int, float, float]] = []
    for (level, step), group in groupby(sorted(tiles, key=_RESOLUTION), _RESOLUTION):
        every = max(1, round(to.step[1] / step[1]))
        own = Lattice.around(to.box, (every * step[0], every * step[1]), POST)
        posts = np.full((own.rows, own.columns), np.nan)
        for tile in group:
            if (read := band(tile, log)) is None:
                continue
            values, transform = read[0].astype(np.float64), read[1]
            if read[0].dtype.kind == "i" and level > 0:
                values *= 2.0**-level  # requirement 89: integer heights are finer in finer levels
            no_land = (values < LOWEST_M) | (values > HIGHEST_M)  # such as a no-data value that is not declared
            if lost := np.count_nonzero(no_land):
                log.left_out(tile.path, f"{lost} of its heights, which are not from {LOWEST_M:g} to {HIGHEST_M:g} m")
                values[no_land] = np.nan
            at, elements = own.within(tile)
            posts[at] = values[elements]
            off.append((level, *_off(tile, step, transform)))
        value = _bilinear(posts, to.latitude / own.step[1] - own.south, to.longitude / own.step[0] - own.west)
        known = np.isfinite(value)
        found[known], levels[known] = value[known], level
    if wrong := [metres for level, posts_off, metres in off if posts_off > _OFF and level in levels]:
        numbers = {"tiles": len(wrong), "off_m": max(wrong)}
        log.append(Finding("cdb_tags", "warning", "scene.root", numbers))
    return found, levels


def _off(tile: CdbFile, step: tuple[float, float], transform: Any) -> tuple[float, float]:
    """Largest distance of a post's tags from its place by the standard, in posts and in metres; NaN without tags."""
    if transform.is_identity:
        return np.nan, np.nan
    from pyproj import Geod

    last = tile.cells - 1
    row, column = np.array([(0, 0), (0, last), (last, 0), (last, last)]).T
    x, y = tile.box[0] + column * step[0], tile.box[1] + (last - row) * step[1]
    tagged = transform.c + transform.a * (column + 0.5), transform.f + transform.e * (row + 0.5)
    posts = np.maximum(abs(tagged[0] - x) / step[0], abs(tagged[1] - y) / step[1])
    metres = Geod(ellps="WGS84").inv(x, y, tagged[0], np.clip(tagged[1], -90.0, 90.0))[2]
    return float(posts.max()), float(np.max(metres))


def _bilinear(posts: NDArray[np.float64], row: NDArray[Any], column: NDArray[Any]) -> NDArray[np.float64]:
    """Values between posts, at rows and columns of a grid; a post without weight may have no value."""
    i, j = np.floor(row + 1e-9).astype(int), np.floor(column + 1e-9).astype(int)
    p, q = np.maximum(row - i, 0.0)[:, None], np.maximum(column - j, 0.0)[None, :]
    total = np.zeros((len(row), len(column)))
    for k, weight in ((i, 1.0 - p), (i + 1, p)):
        for m, other in ((j, 1.0 - q), (j + 1, q)):
            both = np.broadcast_to(weight * other, total.shape)
            value = posts[np.ix_(np.clip(k, 0, posts.shape[0] - 1), np.clip(m, 0, posts.shape[1] - 1))]
            total += np.where(both > 1e-6, both * value, 0.0)
    return total


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
