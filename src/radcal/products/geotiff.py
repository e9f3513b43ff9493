"""Images as GeoTIFF, on the map of a georeferenced scene, else in slant range; what map viewers show of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from lxml import etree
from numpy.typing import NDArray

from radcal.radar.geometry import Geometry
from radcal.scene.model import Scene
from radcal.storage.files import atomic

Classes = Mapping[int, tuple[str, str]]
"""Name and colour (``#RRGGBB``) of each class by its number, from 1."""

SLANT_RANGE = "slant range, not georeferenced"
_MAP = "map of the scene"
_REACH = 0.75  # share of a pixel's diagonal on the ground: one half is needed, the rest bridges uneven spacing


@dataclass(frozen=True)
class Layer:
    """One image of a pass.

    Attributes
    ----------
    values : ndarray, shape (rows, columns)
        Pixels in slant range (axis 0) and azimuth (axis 1); NaN, or 0 for whole numbers, where nothing is known.
    unit : str
        Unit of the values.
    description : str
        Meaning of the values.
    tags : mapping
        Further tags of the file.
    classes : mapping
        Name and colour of each number, for an image of classes.
    gray : (float, float) or None
        Values that a map viewer shows in black and in white.
    """

    values: NDArray[Any]
    unit: str
    description: str
    tags: Mapping[str, str]
    classes: Classes = field(default_factory=dict)
    gray: tuple[float, float] | None = None


@dataclass(frozen=True)
class MapGrid:
    """Grid of a georeferenced scene, with north up, and for each of its cells the image pixel that shows the cell.

    Attributes
    ----------
    crs : str
        CRS of the scene.
    transform : tuple of 6 float
        Coefficients a to f of the affine transform from (column, row) of cell corners, row 0 in the north.
    pixel : ndarray of int64, shape (ny, nx)
        Flat index of the image's pixel, -1 where no pixel shows the cell.
    """

    crs: str
    transform: tuple[float, ...]
    pixel: NDArray[np.int64]

    def on_map(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of a slant-range image on the map: NaN, or 0 for whole numbers, where no pixel shows a cell."""
        nothing = np.nan if values.dtype.kind == "f" else 0
        found = np.full(self.pixel.shape, nothing, dtype=values.dtype)
        shown = self.pixel >= 0
        found[shown] = values.ravel()[self.pixel[shown]]
        return found


def map_grid(scene: Scene, geometry: Geometry) -> MapGrid | None:
    """Grid of the scene's map, with the image pixel that shows each cell; None for a scene without a CRS."""
    if scene.crs is None or scene.transform is None:
        return None
    ny = scene.material.shape[0]
    a, b, c, d, e, f = scene.transform
    north_up = (a, -b, c + b * ny, d, -e, f + e * ny)  # row r of the scene is row ny - r of the file
    pixel = pixel_at_cell(geometry.ground, geometry.layover, scene.material.shape)
    return MapGrid(scene.crs, north_up, pixel[::-1])


def pixel_at_cell(ground: NDArray[np.float32], layover: NDArray[np.bool_], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Pixel of a slant-range image that shows each cell of the scene's grid: the pixel whose ground is nearest.

    The nearest pixel is taken instead of a mean, because a mean of n neighbours has only 1/n of the speckle variance.

    Parameters
    ----------
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel shows, with cell centres at whole numbers; NaN where it shows none.
    layover : ndarray of bool, shape (rows, columns)
        Mask of pixels that show several places; their ``ground`` is a mean, which may be none of these places.
    shape : (int, int)
        Cells of the scene, row 0 in the south.

    Returns
    -------
    ndarray of int64, shape ``shape``
        Flat index of the pixel; -1 if the nearest pixel is farther away than three quarters of its diagonal on the
        ground. This is so in shadow, in layover and outside of the image.
    """
    places = ground.astype(np.float64)
    usable = np.flatnonzero(np.isfinite(places).all(axis=0) & ~layover)
    if usable.size == 0:
        return np.full(shape, -1, dtype=np.int64)
    farthest = _REACH * np.hypot(_spacing(places, 1), _spacing(places, 2)).ravel()[usable]
    tree = scipy.spatial.KDTree(places.reshape(2, -1).T[usable])
    cells = np.stack(np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij"), axis=-1)
    distance, nearest = tree.query(cells.reshape(-1, 2).astype(np.float64))
    found = np.where(distance <= np.maximum(farthest[nearest], _REACH), usable[nearest], -1)
    return found.reshape(shape).astype(np.int64)


def _spacing(places: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Distance on the ground to the nearer of a pixel's two neighbours along an axis [cells]; 0 if both are unknown.

    At a shadow or a fold of the image, the nearer neighbour lies on the same side as the pixel.
    """
    step = np.sqrt((np.diff(places, axis=axis) ** 2).sum(axis=0))
    edge = [(0, 0), (0, 0)]
    edge[axis - 1] = (1, 1)
    padded = np.pad(step, edge, constant_values=np.nan)
    before, after = (padded[:-1], padded[1:]) if axis == 1 else (padded[:, :-1], padded[:, 1:])
    return np.asarray(np.nan_to_num(np.fmin(before, after), nan=0.0))


def write_layers(
    folder: Path, number: int, layers: Mapping[str, Layer], scene: Scene, geometry: Geometry
) -> list[Path]:
    """Write the images of the pass ``number`` (from 1) as ``<name>.tif``, from pass 2 on ``<name>_pass<number>.tif``.

    Beside an image of classes lies ``<name>.tif.aux.xml`` with their names, and beside an image with classes or ends of
    a gray scale lies its style for QGIS, ``<name>.qml``. Map viewers write into both files, so that they are in no list
    of checksums.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    number : int
        Number of the pass.
    layers : mapping
        Images by name.
    scene, geometry : Scene, Geometry
        Scene of the case, and geometry of the pass.

    Returns
    -------
    list of Path
        Paths of the GeoTIFFs.
    """
    grid = map_grid(scene, geometry)
    paths = [folder / f"{name}{of_pass(number)}.tif" for name in layers]
    for path, layer in zip(paths, layers.values(), strict=True):
        write_geotiff(path, layer, grid)
        beside = {}
        if layer.classes:
            beside[path.with_suffix(".tif.aux.xml")] = category_names(layer.classes)
            beside[path.with_suffix(".qml")] = class_style(layer.classes)
        elif layer.gray is not None:
            beside[path.with_suffix(".qml")] = gray_style(*layer.gray)
        for file, content in beside.items():
            with atomic(file) as partial:
                partial.write_bytes(content)
    return paths


def of_pass(number: int) -> str:
    """End of the name of a pass's files, before the extension."""
    return f"_pass{number}" if number > 1 else ""


def write_geotiff(path: str | Path, layer: Layer, grid: MapGrid | None) -> None:
    """Write an image, atomically: a cloud-optimised GeoTIFF on a map, or a plain GeoTIFF in slant range.

    Parameters
    ----------
    path : path
        Path of the file.
    layer : Layer
        The image.
    grid : MapGrid or None
        Map; None for slant range, which a tag of the file then states.

    Raises
    ------
    StoreError
        The file cannot be written.
    """
    import rasterio
    from rasterio.crs import CRS
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile
    from rasterio.shutil import copy
    from rasterio.transform import Affine

    values = layer.values if grid is None else grid.on_map(layer.values)
    profile: dict[str, Any] = {
        "driver": "GTiff", "height": values.shape[0], "width": values.shape[1], "count": 1, "dtype": values.dtype,
        "nodata": np.nan if values.dtype.kind == "f" else 0,
    }  # fmt: skip
    if grid is not None:
        profile |= {"crs": CRS.from_user_input(grid.crs), "transform": Affine(*grid.transform)}
    # an overview is made of single pixels, because a mean of values in dB is no level
    cloud = {"driver": "COG", "predictor": "yes", "overview_resampling": "nearest"}
    with warnings.catch_warnings(), atomic(path) as partial, MemoryFile() as memory:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with memory.open(**profile) as raster:
            raster.write(values, 1)
            raster.set_band_description(1, layer.description)
            raster.units = (layer.unit,)
            if layer.classes:
                colours = {value: tuple(bytes.fromhex(colour[1:])) for value, (_, colour) in layer.classes.items()}
                raster.write_colormap(1, {0: (255, 255, 255), **colours})
            raster.update_tags(
                unit=layer.unit, description=layer.description, grid=SLANT_RANGE if grid is None else _MAP, **layer.tags
            )
        with rasterio.Env(GDAL_PAM_ENABLED="NO"), memory.open() as raster:
            copy(raster, str(partial), compress="deflate", **({"driver": "GTiff"} if grid is None else cloud))


def category_names(classes: Classes) -> bytes:
    """Content of GDAL's file ``.aux.xml`` with the names of the classes, for which GeoTIFF itself has no place.

    Parameters
    ----------
    classes : mapping
        Classes by number.

    References
    ----------
    GDAL documentation, raster data model, category names; https://gdal.org/en/stable/user/raster_data_model.html
    """
    root = etree.Element("PAMDataset")
    names = etree.SubElement(etree.SubElement(root, "PAMRasterBand", band="1"), "CategoryNames")
    for value in range(max(classes) + 1):
        etree.SubElement(names, "Category").text = classes[value][0] if value in classes else None
    return bytes(etree.tostring(root, pretty_print=True))


def class_style(classes: Classes) -> bytes:
    """Style of an image of classes for QGIS, with the names and colours of the classes alone."""
    renderer = etree.Element("rasterrenderer", type="paletted", band="1", opacity="1", alphaBand="-1")
    palette = etree.SubElement(renderer, "colorPalette")
    for value, (name, colour) in classes.items():
        etree.SubElement(palette, "paletteEntry", value=str(value), color=colour, alpha="255", label=name)
    return _style(renderer)


def gray_style(black: float, white: float) -> bytes:
    """Style of an image for QGIS in shades of gray.

    Parameters
    ----------
    black, white : float
        Values that are shown in black and in white.
    """
    renderer = etree.Element(
        "rasterrenderer", type="singlebandgray", grayBand="1", gradient="BlackToWhite", opacity="1", alphaBand="-1"
    )
    contrast = etree.SubElement(renderer, "contrastEnhancement")
    etree.SubElement(contrast, "minValue").text = f"{black:g}"
    etree.SubElement(contrast, "maxValue").text = f"{white:g}"
    etree.SubElement(contrast, "algorithm").text = "StretchToMinimumMaximum"
    return _style(renderer)


def _style(renderer: etree._Element) -> bytes:
    """Content of a ``.qml`` file that has only a renderer."""
    root = etree.Element("qgis", styleCategories="Symbology")
    etree.SubElement(root, "pipe").append(renderer)
    return bytes(etree.tostring(root, pretty_print=True, doctype="<!DOCTYPE qgis>"))
