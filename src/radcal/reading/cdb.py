"""Names of the files of an OGC CDB 1.x database, and the ground that the tile of each name covers.

References
----------
OGC 15-113r6, "Volume 1: OGC CDB Core Standard: Model and Physical Data Store Structure", sections 2.1.2 (geocells),
3.6.2 (folders, table 3-29: widths of geocells) and 3.6.3 (names of files).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

CELLS = 1024  # grid elements along a side of a tile of level 0 or finer
DATASETS = (1, 5, 6, 100, 101, 201, 204)
"""Datasets that are read: elevation, raster material and its tables, features, roads, waters."""

BASE_MATERIALS = "Metadata/Materials.xml"

_ZONES = ((89, 12), (80, 6), (75, 4), (70, 3), (50, 2), (0, 1))  # latitude from which a geocell has a width [deg]
_PICTURE = 1000  # elements along a picture
_NAME = re.compile(r"([NS]\d{2})([EW]\d{3})_D(\d{3})_S(\d{3})_T(\d{3})_(LC|L)(\d{2})_U(\d{1,7})_R(\d{1,7})\.(\w+)")
_BESIDE = re.compile(_NAME.pattern + r"\.\w[\w.]*")  # what other programs write beside a file, such as .tif.aux.xml

Box = tuple[float, float, float, float]  # west, south, east, north [deg]


@dataclass(frozen=True)
class CdbFile:
    """File of a tile.

    Attributes
    ----------
    path : path
        The file.
    dataset, first, second : int
        Code of the dataset, and its two component selectors (S and T of the name).
    level : int
        Level of detail; negative for the coarse levels of the folder ``LC``.
    box : (float, float, float, float)
        West, south, east and north bounds of the tile [deg].
    width : int
        Width of its geocell [deg].
    fault : str
        Reason why the file cannot be read as that of a tile; empty without one.
    """

    path: Path
    dataset: int = 0
    first: int = 0
    second: int = 0
    level: int = 0
    box: Box = (0.0, 0.0, 0.0, 0.0)
    width: int = 1
    fault: str = ""

    @property
    def cells(self) -> int:
        """Number of grid elements along a side of the tile."""
        return CELLS >> max(-self.level, 0)

    @property
    def step(self) -> tuple[float, float]:
        """Distance of these elements along longitude and latitude [deg]."""
        return step_deg(self.level, self.width)


def cell_width_deg(south: int) -> int:
    """Width of a geocell [deg] whose southern edge has a latitude [deg]; the zones are symmetric to the equator."""
    return next(width for least, width in _ZONES if (south if south >= 0 else -south - 1) >= least)


def step_deg(level: int, width: int) -> tuple[float, float]:
    """Distance of the grid elements of a level along longitude and latitude [deg], in geocells of a width [deg]."""
    step = 2.0**-level / CELLS
    return width * step, step


def cdb_files(root: Path, bounds: Box, datasets: Sequence[int] = DATASETS) -> list[CdbFile]:
    """Files of the datasets whose tiles overlap an area, sorted by path.

    Parameters
    ----------
    root : path
        Folder of the database, which contains the folder ``Tiles``.
    bounds : (float, float, float, float)
        West, south, east and north bounds of the area [deg].
    datasets : sequence of int
        Codes of the datasets.

    Returns
    -------
    list of CdbFile
        Files, among them misplaced ones, whose ``fault`` says why.
    """
    found = []
    for folder in sorted((root / "Tiles").glob("[NS][0-9][0-9]/[EW][0-9][0-9][0-9]")):
        south, west = (int(name[1:]) * (-1 if name[0] in "SW" else 1) for name in (folder.parent.name, folder.name))
        width = cell_width_deg(south)
        if not _overlap((west, south, west + width, south + 1), bounds):
            continue
        if west % width:
            fault = f"a geocell of this latitude is {width} degrees wide, its west a multiple of that"
            found.append(CdbFile(folder, fault=fault))
            continue
        for dataset in datasets:
            for path in folder.glob(f"{dataset:03d}_*/*/*/[!.]*"):
                if _BESIDE.fullmatch(path.name):
                    continue
                one = _parsed(path, south, west, width)
                if one.fault or _overlap(one.box, bounds):
                    found.append(one)
    return sorted(found, key=lambda one: one.path)


def imagery_files(root: Path, bounds: Box) -> list[CdbFile]:
    """Tiles of visible imagery (dataset 004) of the levels that a picture of an area needs, and misplaced files.

    These are the levels up to the first one with 1000 elements along the area; if all are finer, the coarsest.
    """
    kind = (1, 1, ".jp2")
    found = [
        one for one in cdb_files(root, bounds, (4,)) if one.fault or (one.first, one.second, one.path.suffix) == kind
    ]
    west, south, east, north = bounds
    enough = math.ceil(math.log2(_PICTURE / CELLS / max(east - west, north - south)))
    finest = max(enough, min((one.level for one in found if not one.fault), default=enough))
    return [one for one in found if one.fault or one.level <= finest]


def _parsed(path: Path, south: int, west: int, width: int) -> CdbFile:
    """File of a tile by its name, compared with the folders in which it lies."""
    match = _NAME.fullmatch(path.name)
    if match is None:
        return CdbFile(path, fault="its name is not one of a tile")
    ns, ew, code, first, second, coarse, digits, up, right, ending = match.groups()
    own = (f"U{up}", "LC" if coarse == "LC" else f"L{digits}", ew, ns)
    row, level, dataset, longitude, latitude = (folder.name for folder in path.parents[:5])
    if (*own, code) != (row, level, longitude, latitude, dataset[:3]):
        return CdbFile(path, fault="its name contradicts its folders")
    number = -int(digits) if coarse == "LC" else int(digits)
    tiles = 2 ** max(number, 0)
    if not -10 <= number <= 23 or max(int(up), int(right)) >= tiles:
        return CdbFile(path, fault=f"a geocell has no row {up} and column {right} of level {number}")
    if ending != ending.lower():  # names are case-sensitive (requirement 5)
        return CdbFile(path, fault=f"its name ends with .{ending}, expected .{ending.lower()}")
    left, low = west + width * int(right) / tiles, south + int(up) / tiles
    box = (left, low, left + width / tiles, low + 1.0 / tiles)
    return CdbFile(path, int(code), int(first), int(second), number, box, width)


def _overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and one[2] > other[0] and one[1] < other[3] and one[3] > other[1]
