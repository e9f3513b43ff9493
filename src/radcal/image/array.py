"""Measured images in numpy, MATLAB and HDF5 arrays, which lie in slant range on the pixels of the scene's image."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from radcal.image.base import Grid, Reader, ReadImage
from radcal.reading.arrays import is_raster, read_array

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = ["ArrayReader"]


class ArrayReader(Reader):
    """Reader of an array without a place on the map."""

    called = "an array"

    @classmethod
    def matches(cls, path: Path) -> bool:
        """Whether the ending is that of an array format."""
        return not is_raster(path)

    def read(self, grid: Grid) -> ReadImage:
        """Image in slant range, of the size of the scene's image."""
        resized = "" if grid.on_map is None else _off_the_map(grid.on_map[0], self.facts().crs)
        values = read_array(self.file(grid.shape, resized))
        return ReadImage(*self.in_db(values, self.config.scale, grid.shape))


def _off_the_map(scene: str, crs: CRS | None) -> str:
    """End of the message about an image of another size that has no place on the map; ``scene`` is the scene's CRS."""
    from pyproj import CRS

    lacks = "CRS" if crs is None else "transform from its pixels to the map"
    return (
        f", and the file has no {lacks}, expected a georeferenced image, as the scene in "
        f"{CRS.from_user_input(scene).name} is, or one in slant range on the grid of the scene's image"
    )
