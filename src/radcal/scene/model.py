"""Scene with materials, elevation or incidence angles, and objects, and the HDF5 file that stores the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SceneError
from radcal.scene.objects import Objects
from radcal.storage.layout import put, same, take
from radcal.storage.records import read_hdf5, write_hdf5

__all__ = ["Scene", "read_scene", "write_scene"]


@dataclass(frozen=True)
class Scene:
    """Surface materials on a grid, with elevation, or with the incidence of each row.

    Attributes
    ----------
    identity : str
        Digest of the scene's sources; part of every run's key.
    names : tuple of str
        Material names; material id k is ``names[k - 1]``, id 0 is no material.
    material : ndarray of uint8, shape (ny, nx)
        Material id per cell. Axis 0 is north (row 0 in the south), axis 1 is east; for a
        slant-range scene axis 0 is slant range and axis 1 is azimuth.
    elevation_m : ndarray of float64, shape (ny, nx), or None
        Elevation of the cell centres [m]; None for a slant-range scene.
    cell_m : float
        Cell size [m].
    incidence_deg : ndarray of float64, shape (ny,), or None
        Local incidence angle of each row of a slant-range scene [deg].
    crs : str or None
        Projected coordinate reference system of a georeferenced scene, as EPSG code or WKT.
    transform : tuple of 6 float, or None
        Affine a, b, c, d, e, f from (column, row) of cell *corners* to x = a column + b row + c,
        y = d column + e row + f in the CRS [m]; row 0 is in the south, so e > 0.
    vertical_datum : str or None
        Vertical datum of the elevation.
    notes : tuple of str
        Sentences on the processing of the sources: resampling, datum, gaps.
    objects : Objects or None
        Objects on the ground; None without objects, as in every slant-range scene.
    slope_error_deg : float
        Standard error of the ground's slope in any one direction [deg]; 0 where it is not known.
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
    notes: tuple[str, ...] = ()
    objects: Objects | None = None
    slope_error_deg: float = 0.0

    def require(self, materials: list[str]) -> None:
        """Check that configuration and scene name the same materials.

        Raises
        ------
        SceneError
            A configured material is not in the scene, or a material of the scene has no law.
        """
        present = {self.names[k - 1] for k in np.unique(self.material) if k > 0}
        for name in materials:
            if name not in self.names:
                raise SceneError(f"materials.{name}: not in the scene, which has {', '.join(self.names)}.")
            if name not in present:
                raise SceneError(f"materials.{name}: covers no cell of the scene.")
        lawless = sorted(present - set(materials))
        if lawless:
            raise SceneError(
                f"materials: the scene's {lawless[0]!r} has no law; add materials.{lawless[0]} with parameters."
            )


def write_scene(path: str | Path, scene: Scene) -> None:
    """Write a scene to HDF5, atomically.

    Raises
    ------
    ConfigError
        A finished calibration beside it rests on another scene.
    """
    with write_hdf5(path, "scene", protected=True, alike=lambda file: same(take(file, Scene), scene)) as file:
        put(file, scene)


def read_scene(path: str | Path) -> Scene:
    """Read a scene that :func:`write_scene` wrote; errors are those of :func:`.read_hdf5`."""
    with read_hdf5(path, "scene") as file:
        return take(file, Scene)
