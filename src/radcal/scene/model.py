"""Scene (materials, elevation or incidence angles, objects), and its HDF5 file."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SceneError
from radcal.findings import Finding
from radcal.scene.objects import Objects
from radcal.storage.dataclass_groups import take
from radcal.storage.records import Stored, read_hdf5

_LARGEST_PICTURE = 1200  # largest number of cells per side


def picture_step(shape: tuple[int, ...]) -> int:
    """Step in rows and columns between the cells of a scene that a picture of it shows."""
    return -(-max(shape) // _LARGEST_PICTURE)


@dataclass(frozen=True)
class Scene(Stored, kind="scene"):
    """Surface materials on a grid, with the elevation of each cell or the incidence angle of each row.

    Attributes
    ----------
    identity : str
        Hash of the data from which the scene is made; it is a part of the key of every run.
    names : tuple of str
        Material names: ``names[k - 1]`` is the name of material id k. Id 0 means no material.
    material : ndarray of uint8, shape (ny, nx)
        Material id of each cell. Axis 0 points north (row 0 is in the south) and axis 1 east, unless the grid is
        turned. In a slant-range scene, axis 0 is slant range and axis 1 is azimuth.
    elevation_m : ndarray of float64, shape (ny, nx), or None
        Elevation of the cell centres [m]; None for a slant-range scene.
    cell_m : float
        Cell size [m]; without meaning in a slant-range scene.
    incidence_deg : ndarray of float64, shape (ny,), or None
        Local incidence angle of each row of a slant-range scene [deg].
    crs : str or None
        Projected coordinate reference system of a georeferenced scene, as EPSG code or WKT.
    transform : tuple of 6 float, or None
        Coefficients a, b, c, d, e, f of the affine transform from the (column, row) of a cell *corner* to x = a column
        + b row + c and y = d column + e row + f in the CRS [m]. Row 0 is in the south, so that e > 0.
    vertical_datum : str or None
        Name of the vertical datum of the elevation.
    findings : tuple of Finding
        How the source files were processed: resampling, vertical datum, gaps.
    objects : Objects or None
        Objects on the ground; None in a scene without objects, such as every slant-range scene.
    heading_deg : float or None
        Heading of the track for which the grid is turned, clockwise from north [deg]: axis 0 points along the track,
        and axis 1 to its right. None for axes that point to the north and to the east of the CRS.
    slope_error_deg : float
        Standard error of the ground's slope in any one direction [deg]; 0 if it is unknown.
    mixed : ndarray of bool, shape (ny, nx), or None
        Cells of a mixture of materials, whose pixels belong to no material's target; None without such cells.
    imagery : ndarray of uint8, shape (y, x, 3), or None
        Colour of the cells of a picture of the scene (:func:`picture_step`); None without visible imagery.
    """

    identity: str
    names: tuple[str, ...]
    material: NDArray[np.uint8]
    elevation_m: NDArray[np.float64] | None
    cell_m: float
    incidence_deg: NDArray[np.float64] | None = None
    crs: str | None = None
    transform: tuple[float, ...] | None = None
    vertical_datum: str | None = None
    findings: tuple[Finding, ...] = ()
    objects: Objects | None = None
    heading_deg: float | None = None
    slope_error_deg: float = 0.0
    mixed: NDArray[np.bool_] | None = None
    imagery: NDArray[np.uint8] | None = None

    def require(self, materials: list[str], roofs: tuple[str, ...] = ()) -> None:
        """Check that the scene contains every configured material, and no material without a configured law.

        Parameters
        ----------
        materials : list of str
            Names of the configured materials.
        roofs : tuple of str
            Names of the materials of roofs, which the scene contains beside those of its cells.

        Raises
        ------
        SceneError
            A configured material covers no cell of the scene, or a material in the scene is not configured.
        """
        present = {self.names[k - 1] for k in np.unique(self.material) if k > 0} | set(roofs)
        for name in materials:
            if name not in self.names:
                others = [one for one in self.names if one not in materials]
                near = difflib.get_close_matches(name, others, n=1, cutoff=0.5)
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise SceneError(f"materials.{name}: not in the scene, which has {', '.join(self.names)}{hint}.")
            if name not in present:
                raise SceneError(f"materials.{name}: covers no cell of the scene.")
        lawless = sorted(present - set(materials))
        if lawless:
            several = ", ".join(repr(name) for name in lawless)
            keys = ", ".join(f"materials.{name}" for name in lawless)
            has = "has no law" if len(lawless) == 1 else "have no law"
            raise SceneError(
                f"materials: the scene's {several} {has}; add {keys} with parameters (with scene.landcover, the names "
                "alone, as in water: {})."
            )


@contextmanager
def scene_on_disk(path: str | Path) -> Iterator[Scene]:
    """Scene whose elevation is a dataset of the open file, read by rows; raises the errors of :func:`.read_hdf5`."""
    with read_hdf5(path, "scene") as file:
        yield replace(take(file, Scene, without=("elevation_m",)), elevation_m=file.get("elevation_m"))
