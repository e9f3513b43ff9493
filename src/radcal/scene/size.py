"""Number of cells of a scene, computed from the headers of the scene's files before the scene is made."""

from __future__ import annotations

from dataclasses import dataclass

from radcal.config import BuiltinScene, SceneConfig, SlantRangeScene, expand_path, vrt_folders
from radcal.errors import SceneError
from radcal.reading.intake import guarded
from radcal.reading.rasters import open_raster
from radcal.scene.grid import opened, scene_grid, subdivision

__all__ = ["SceneSize", "scene_size"]


@dataclass(frozen=True)
class SceneSize:
    """Size of a scene: number of cells, and size of a cell.

    Attributes
    ----------
    cells : int
        Number of cells of the scene; in a slant-range scene, number of pixels.
    cell_m : float or None
        Cell size [m]; None for a slant-range scene.
    resampled : int
        Number of values of the finer raster after its resampling; equal to ``cells`` if no raster is finer than the
        cells.
    """

    cells: int
    cell_m: float | None
    resampled: int


def scene_size(config: SceneConfig) -> SceneSize:
    """Size of the configured scene.

    Parameters
    ----------
    config : SceneConfig
        Section ``scene``.

    Raises
    ------
    ConfigError
        A file is missing.
    SceneError
        A file cannot be read as a raster, or no grid fits the rasters.
    """
    if isinstance(config, BuiltinScene):
        from radcal.scene.builtin import CELL_M, CELLS

        return SceneSize(CELLS, CELL_M, CELLS)
    if isinstance(config, SlantRangeScene):
        path = expand_path(config.labels, "scene.labels")
        with (
            guarded(path, lambda text: SceneError(f"scene.labels: {path} {text}"), "a raster"),
            open_raster(path, vrt_folders(config)) as raster,
        ):
            cells = int(raster.width) * int(raster.height)
        return SceneSize(cells, None, cells)
    with (
        opened("scene.elevation", config) as elevation,
        opened("scene.materials", config) as materials,
    ):
        grid = scene_grid(elevation, materials, config)
        cells = grid.rows * grid.columns
        parts = max(subdivision(source, grid) for source in (elevation, materials))
    return SceneSize(cells, grid.cell_m, cells * parts**2)
