"""Scenes from two GIS rasters, elevation and material ids, resampled to one grid."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import RasterScene, expand_path
from radcal.errors import SceneError
from radcal.findings import Finding, Severity
from radcal.reading.intake import guarded
from radcal.reading.rasters import check_blocks, in_memory
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.crs import (
    METRES,
    label,
    named_datum,
    same_datum,
    same_place,
    transformation_findings,
    unit_in_metadata,
    vertical_datum,
    vertical_unit,
)
from radcal.scene.grid import LARGEST_CELLS, Grid, Source, box_in, on_pixels, opened, pixel_m, scene_grid, subdivision
from radcal.scene.model import Scene
from radcal.scene.names import by_id, landcover_names, read_names
from radcal.sections.scene import GridScene
from radcal.storage.files import digest

if TYPE_CHECKING:
    from pyproj import CRS


LOWEST_M, HIGHEST_M = -1000.0, 9000.0  # lowest and highest land, with a margin for mines and ellipsoidal heights
_MISSING_SHARE = 0.5
_NEAR_CELLS = 100  # distance [cells] up to which gaps are interpolated; beyond, they take the nearest height
# tolerance of GDAL's approximate coordinate transformation [pixels]; with the default, 1/8, heights on a slope in SRTM
# data have errors of a metre
_TOLERANCE_PX = 0.001
_MARGIN_PX = 3  # margin [pixels] that is read around the scene: cubic convolution reaches 2 pixels
_FINEST_M = 1e-3  # smallest step that is detected; single precision itself has steps of 0.0005 m at 8 km of height
_STEP_TOLERANCE = 0.01  # tolerance of multiples [steps]; most decimal fractions have no exact binary number
_SAMPLE = 2_000_000  # number of heights in which the step is sought; all heights are then checked


def raster_scene(config: RasterScene, heading_deg: float = 0.0) -> Scene:
    """Scene from a raster of elevation and a raster of material ids, both resampled to one grid.

    Elevation is interpolated by cubic convolution, and a cell has the material of the nearest pixel. A cell larger than
    the pixels of a raster is divided into parts no larger than a pixel. The divided cell has the mean elevation or the
    most frequent material of its parts. A cell without elevation data has no material; its elevation is filled in from
    neighbouring cells.

    Parameters
    ----------
    config : RasterScene
        Section ``scene``: files, CRS, cell size, bounds and vertical datum.
    heading_deg : float
        Heading of the track, clockwise from north [deg]; unless it is 0, the grid is turned so that axis 0 points along
        the track.

    Returns
    -------
    Scene
        Scene with ``crs``, ``transform``, ``vertical_datum``, ``findings`` and ``slope_error_deg``. The scene's
        ``identity`` depends on the materials, elevation and cell size, which affect the simulated image, but not on the
        position on the map.

    Raises
    ------
    SceneError
        A file cannot be read or does not hold elevation or material ids, the two rasters do not overlap, the CRS is not
        in metres at true scale, or the vertical datum is missing or contradictory.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing", IEEE TASSP 29 (1981).
    """
    with (
        opened("scene.elevation", config) as elevation,
        opened("scene.materials", config) as materials,
    ):
        datum = datum_of(elevation, config)
        grid = scene_grid(elevation, materials, config, heading_deg)
        cover = nearest_materials(materials, grid)
        ids, names = _named(cover.ids, materials, config)
        cover = replace(cover, ids=ids, names=names)
        return resampled(config.source, elevation, cover, grid, datum, heading_deg, config.elevation_error_m)


@dataclass(frozen=True)
class Cover:
    """Materials of the cells of a grid.

    Attributes
    ----------
    ids : ndarray of uint8, shape (rows, columns)
        Material id of each cell; 0 without a material.
    names : dict of int to str
        Name of each id.
    how : str
        Phrase for the method by which cells get their material.
    key : str
        Configuration key of the file of materials.
    path : path
        This file.
    crs : pyproj.CRS
        Horizontal CRS of the file.
    """

    ids: NDArray[np.uint8]
    names: dict[int, str]
    how: str
    key: str
    path: Path
    crs: CRS


def resampled(
    source: str, elevation: Source, cover: Cover, grid: Grid, datum: tuple[str, str], heading_deg: float = 0.0,
    elevation_error_m: float = 0.0, most_bare: float = 1.0,
) -> Scene:  # fmt: skip
    """Scene of a raster of elevation, resampled as :func:`raster_scene` describes, and of the materials of its cells.

    Parameters
    ----------
    source : str
        Name of the source of the scene, for its identity.
    elevation : Source
        The open raster.
    cover : Cover
        Materials of the cells.
    grid : Grid
        Grid of the cells.
    datum : (str, str)
        Vertical datum of the heights, and a phrase that says where it is given.
    heading_deg : float
        Heading of the track to which the grid is turned [deg].
    elevation_error_m : float
        Standard error of a height relative to its neighbours [m].
    most_bare : float
        Share of the cells without elevation or material from which this is a warning.

    Raises
    ------
    SceneError
        The raster covers too little of the grid, or holds impossible values; or no material is where it has heights.
    """
    heights, filled, how_heights, step = _heights(elevation, grid)
    # slopes of interpolated heights are no steeper than slopes between the raster's own pixels
    posting = max(grid.cell_m, *pixel_m(elevation, grid.crs, grid.box))
    slope_error, steps = _slope_error_deg(elevation_error_m, step, posting)
    findings = [
        _found("cells", cell_m=grid.cell_m, crs=grid.crs.name),
        _found("resampled", elevation=how_heights, materials=cover.how),
        _found("vertical_datum", datum=datum[0], origin=datum[1]),
        *steps,
    ]
    for crs, key in ((elevation.plane, elevation.key), (cover.crs, cover.key)):
        if not same_place(crs, grid.crs):
            findings += transformation_findings(crs, grid.crs, key)
    ids = np.where(filled, np.uint8(0), cover.ids)
    if not ids.any():
        raise SceneError(f"{cover.key}: {cover.path} has no material where the elevation is.")
    for code, bare in (("no_elevation", filled), ("no_material", ids == 0)):
        if count := int(np.count_nonzero(bare)):
            severity: Severity = "warning" if count > most_bare * bare.size else "note"
            findings.append(Finding(code, severity, "scene", {"cells": count, "of": bare.size}))
    return Scene(
        identity=digest(
            {
                "source": source,
                "shape": list(ids.shape),
                "cell_m": grid.cell_m,
                "elevation": hashlib.sha256(heights.tobytes()).hexdigest(),
                "material": hashlib.sha256(ids.tobytes()).hexdigest(),
                "names": {str(k): v for k, v in cover.names.items()},
                "version": 1,
            }
        ),
        names=by_id(cover.names),
        material=ids,
        elevation_m=heights,
        cell_m=grid.cell_m,
        crs=label(grid.crs),
        transform=(grid.cell_m, 0.0, grid.west, 0.0, grid.cell_m, grid.south),
        vertical_datum=datum[0],
        findings=tuple(findings),
        heading_deg=heading_deg or None,
        slope_error_deg=slope_error,
    )


def _named(ids: NDArray[np.uint8], materials: Source, config: RasterScene) -> tuple[NDArray[np.uint8], dict[int, str]]:
    """Material ids with their names; the codes of a land-cover map become ids from 1, in the order of the codes."""
    path = expand_path(config.names, "scene.names") if config.names is not None else None
    present = [int(k) for k in np.unique(ids)]
    if config.landcover is not None:
        covers = landcover_names(config.landcover, path, present, materials.path)
        return np.searchsorted([0, *covers], ids).astype(np.uint8), dict(enumerate(covers.values(), start=1))
    if path is None:
        raise TypeError("scene.names is missing without scene.landcover")  # the configuration refuses this
    return ids, read_names(path, present, materials.path)


def _slope_error_deg(error_m: float, step_m: float, posting_m: float) -> tuple[float, list[Finding]]:
    """Standard error of slopes [deg], from the error and the rounding step of heights, and a finding on the step."""
    rounding_m = rounding_error_m(step_m)
    total_m = float(np.hypot(error_m, rounding_m))
    slope_deg = float(np.degrees(np.arctan(np.sqrt(2.0) * total_m / posting_m)))
    if not step_m:
        return slope_deg, []
    return slope_deg, [
        _found("height_steps", step_m=step_m, rounding_m=rounding_m, error_m=total_m, slope_error_deg=slope_deg)
    ]


def _found(code: str, **numbers: float | str) -> Finding:
    """Note on the scene."""
    return Finding(code, "note", "scene", numbers)


def _check_heights(elevation: Source) -> None:
    """Raise an error if data type or unit of the raster show that its values are not heights in metres."""
    dtype = np.dtype(elevation.raster.dtypes[0])
    if dtype.kind not in "fiu":
        raise elevation.error(f"holds {dtype}, expected heights as real numbers.")
    raster = elevation.raster
    units = (vertical_unit(elevation.crs), raster.units[0])
    in_metadata = unit_in_metadata({**raster.tags(), **raster.tags(1)}, raster.descriptions[0])
    other = [*(unit for unit in units if unit and unit.lower() not in METRES), *filter(None, [in_metadata])]
    if other:
        raise elevation.error(f"has heights in {other[0]}, expected metres: convert it, for example with gdal_calc.")


def datum_of(elevation: Source, config: GridScene) -> tuple[str, str]:
    """Vertical datum of heights in metres, and a phrase that says whether the file or the configuration gives it.

    Raises
    ------
    SceneError
        The raster does not hold heights in metres, or its datum is missing or contradictory.
    """
    _check_heights(elevation)
    of_file = vertical_datum(elevation.crs)
    given = named_datum(config.vertical_datum) if config.vertical_datum is not None else None
    if of_file is not None and given is not None and not same_datum(of_file, given):
        raise SceneError(
            f"scene.vertical_datum is {given!r} and the CRS of scene.elevation ({elevation.path}) says {of_file!r}: "
            "leave the key out, or correct the file with gdal_edit -a_srs."
        )
    if of_file is not None:
        return of_file, "from the CRS of the elevation"
    if given is not None:
        return given, "from scene.vertical_datum"
    raise SceneError(
        f"scene.vertical_datum is missing and the CRS of scene.elevation ({elevation.path}, {elevation.crs.name}) does "
        "not say what heights refer to: give it, for example vertical_datum: EGM96, EGM2008 or WGS84 ellipsoid."
    )


def _window(source: Source, grid: Grid) -> tuple[np.ma.MaskedArray[Any, Any], Any]:
    """Raster values in a window around a grid, with no-data pixels masked, and the affine transform of the window."""
    from rasterio import windows

    west, south, east, north = box_in(grid.box, grid.crs, source.plane)
    t = source.raster.transform
    left, right = sorted([(west - t.c) / t.a, (east - t.c) / t.a])
    top, bottom = sorted([(south - t.f) / t.e, (north - t.f) / t.e])  # e > 0 where the first row is in the south
    left, top = (max(0, int(np.floor(v)) - _MARGIN_PX) for v in (left, top))
    right = min(source.raster.width, int(np.ceil(right)) + _MARGIN_PX)
    bottom = min(source.raster.height, int(np.ceil(bottom)) + _MARGIN_PX)
    if (right - left) * (bottom - top) > LARGEST_CELLS:
        raise source.error(
            f"has {right - left} x {bottom - top} pixels in the scene's area, expected at most {LARGEST_CELLS:.0e}: "
            "give smaller scene.bounds or a coarser raster."
        )
    window = windows.Window(left, top, right - left, bottom - top)
    with guarded(source.path, source.error, "a raster"):
        check_blocks(source.raster)
        return source.raster.read(1, window=window, masked=True), windows.transform(window, t)


def _warped(
    source: Source, values: NDArray[Any], transform: Any, grid: Grid, method: str, empty: float
) -> NDArray[Any]:
    """Raster values resampled to the grid, with row 0 in the south; cells without data have the value ``empty``."""
    import rasterio

    if grid.rows * grid.columns > LARGEST_CELLS:
        raise source.error(
            f"has pixels so much smaller than scene.cell_m that the scene takes {grid.columns} x {grid.rows} of them, "
            f"expected at most {LARGEST_CELLS:.0e}: give smaller scene.bounds or a coarser raster."
        )
    west, _, _, north = grid.box
    # For a turned grid, GDAL overestimates the ratio of cell size to pixel size, and smooths too much. Here cells are
    # no larger than pixels, so that the ratio is set to 1.
    extras = {"XSCALE": 1, "YSCALE": 1} if grid.turned else {}
    # Env gives GDAL the path of PROJ's database; without this database, GDAL treats all datums as equal. A WarpedVRT,
    # which needs a file, is used because rasterio.warp.reproject() ignores the tolerance.
    with (
        rasterio.Env(),
        in_memory(values, source.plane.to_wkt(), transform) as raster,
        rasterio.vrt.WarpedVRT(
            raster,
            crs=rasterio.crs.CRS.from_wkt(grid.crs.to_wkt()),
            transform=rasterio.transform.from_origin(west, north, grid.cell_m, grid.cell_m),
            height=grid.rows,
            width=grid.columns,
            resampling=rasterio.enums.Resampling[method],
            tolerance=_TOLERANCE_PX,
            nodata=empty,
            src_nodata=empty,
            **extras,
        ) as warped,
    ):
        return np.asarray(warped.read(1))[::-1]


def _blocks(fine: NDArray[Any], parts: int) -> NDArray[Any]:
    """Values of a grid whose cells are divided into parts, reshaped to (rows, columns, parts of a cell)."""
    rows, columns = fine.shape[0] // parts, fine.shape[1] // parts
    return fine.reshape(rows, parts, columns, parts).swapaxes(1, 2).reshape(rows, columns, parts**2)


def _heights(elevation: Source, grid: Grid) -> tuple[NDArray[np.float64], NDArray[np.bool_], str, float]:
    """Elevation with gaps filled, mask of the gaps, name of the resampling method, and step of rounded heights [m]."""
    from rasterio.fill import fillnodata

    values, transform = _window(elevation, grid)
    scaled = (values.astype(np.float64) * elevation.raster.scales[0] + elevation.raster.offsets[0]).filled(np.nan)
    scaled[~np.isfinite(scaled)] = np.nan
    if np.isnan(scaled).all():
        raise elevation.error("holds no elevation in the scene's area, only no-data.")
    low, high = np.nanmin(scaled), np.nanmax(scaled)
    if low < LOWEST_M or high > HIGHEST_M:
        raise elevation.error(
            f"holds heights from {low:g} to {high:g} m, expected {LOWEST_M:g} to {HIGHEST_M:g}: if that is its "
            "no-data value, declare it with gdal_edit -a_nodata."
        )
    parts = subdivision(elevation, grid)
    # GDAL's own averages of a plane have errors of some hundredths of a pixel times the plane's slope, which change the
    # incidence angle by half a degree. Means of interpolated parts do not have these errors.
    fine = _warped(elevation, scaled, transform, grid.cut(parts), "cubic", np.nan)
    blocks = _blocks(fine, parts)
    known = np.isfinite(blocks).sum(axis=-1)
    gaps = known < 0.5 * parts**2
    heights = np.where(gaps, np.nan, np.nansum(blocks, axis=-1) / np.maximum(known, 1))
    if np.mean(gaps) > _MISSING_SHARE:
        raise elevation.error(
            f"has no elevation in {np.count_nonzero(gaps)} of {gaps.size} cells, expected in at most half."
        )
    if gaps.any():
        # fillnodata() computes in single precision, so that only the values of gaps are taken from its result
        heights = np.where(gaps, fillnodata(heights.copy(), mask=~gaps, max_search_distance=_NEAR_CELLS), heights)
        nearest = scipy.ndimage.distance_transform_edt(np.isnan(heights), return_distances=False, return_indices=True)
        heights = heights[tuple(nearest)]
    how = "averaged" if parts > 1 else "as in the file" if on_pixels(elevation, grid) else "interpolated"
    return np.ascontiguousarray(heights), gaps, how, height_step_m(scaled)


def nearest_materials(materials: Source, grid: Grid) -> Cover:
    """Materials of cells from a raster of material ids, without names.

    Raises
    ------
    SceneError
        The raster covers too little of the grid, or holds no material ids.
    """
    values, transform = _window(materials, grid)
    held = values.compressed()
    if held.size == 0:
        raise materials.error("holds no material in the scene's area, only no-data.")
    if held.dtype.kind not in "ui" or held.min() < 0 or held.max() > 255:
        raise materials.error(
            f"holds {held.dtype} from {held.min():g} to {held.max():g}, expected whole material ids from 0 to 255."
        )
    missing = -1
    parts = subdivision(materials, grid)
    codes = np.where(np.ma.getmaskarray(values), missing, values.data.astype(np.int16))
    blocks = _blocks(_warped(materials, codes, transform, grid.cut(parts), "nearest", missing), parts)
    found = blocks[..., 0].copy()
    most = np.zeros(found.shape, dtype=np.int64)
    for code in np.unique(blocks) if parts > 1 else ():
        count = np.count_nonzero(blocks == code, axis=-1)
        found[count > most] = code
        most = np.maximum(most, count)
    without = np.count_nonzero(found == missing)
    if without > _MISSING_SHARE * found.size:
        raise materials.error(f"covers {found.size - without} of {found.size} cells, expected at least half.")
    how = "of the nearest pixel" if parts == 1 else "of the majority of pixels"
    return Cover(np.maximum(found, 0).astype(np.uint8), {}, how, materials.key, materials.path, materials.plane)


def height_step_m(heights_m: NDArray[np.float64]) -> float:
    """Step of which the rounded heights of an elevation model are multiples.

    The step is the smallest difference between two heights, if all differences between heights are multiples of it. The
    heights of a plane (an artificial elevation model, or a constant) may be multiples of a step without being rounded;
    the step of a plane is therefore 0.

    Parameters
    ----------
    heights_m : ndarray, shape (rows, columns)
        Heights of the raster's own pixels, before any interpolation [m]; NaN for a pixel without height.

    Returns
    -------
    float
        Step [m]; 0 if the heights are not rounded, or if the step is below 1 mm.
    """
    known = heights_m[np.isfinite(heights_m)]
    if known.size == 0:
        return 0.0
    distinct = np.unique(known[:: max(1, known.size // _SAMPLE)])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 0.5 * _FINEST_M]  # smaller gaps are errors of decimal fractions in binary numbers
    if gaps.size == 0:
        return 0.0
    span = float(distinct[-1] - distinct[0])
    single = float(gaps[gaps < 1.5 * gaps.min()].mean())  # a mean, in which errors of single precision cancel
    step = span / round(span / single)  # the span of all heights gives more digits than one difference
    ratio = (known - distinct[0]) / step
    if step < _FINEST_M or not np.max(np.abs(ratio - np.round(ratio))) < _STEP_TOLERANCE:  # not all are multiples
        return 0.0
    curved = (np.diff(heights_m, 2, axis=0), np.diff(heights_m, 2, axis=1))
    return step if any(np.nanmax(np.abs(c), initial=0.0) > 0.5 * step for c in curved) else 0.0


def rounding_error_m(step_m: float) -> float:
    """Standard error of heights [m] that are rounded to multiples of a step.

    Parameters
    ----------
    step_m : float
        Step [m].

    Returns
    -------
    float
        Standard deviation of a uniform distribution as wide as the step: step / sqrt(12), 0.29 m for whole metres. The
        difference of two neighbouring heights with independent errors has a standard error of step / sqrt(6). On gentle
        slopes, heights form terraces, and the errors of neighbouring heights are nearly equal. On a slope of f steps
        per pixel, with f from 0 to 1, the standard error of the difference of two neighbouring heights is step sqrt(f
        (1 - f)); the mean square of this error over f is also step^2 / 6.

    References
    ----------
    Widrow, Kollar and Liu, "Statistical theory of quantization", IEEE Transactions on Instrumentation and Measurement
    45 (1996). Carter, "The effect of data precision on the calculation of slope and aspect using gridded DEMs",
    Cartographica 29 (1992).
    """
    return step_m / float(np.sqrt(12.0))


class RasterSource(SceneSource):
    """Source ``raster``."""

    section = RasterScene

    @staticmethod
    def size(config: RasterScene) -> SceneSize:
        """Size of the grid that both rasters give."""
        with opened("scene.elevation", config) as elevation, opened("scene.materials", config) as materials:
            grid = scene_grid(elevation, materials, config)
            cells = grid.rows * grid.columns
            parts = max(subdivision(source, grid) for source in (elevation, materials))
        return SceneSize(cells, grid.cell_m, cells * parts**2)

    make = staticmethod(raster_scene)
