"""Grid of square cells over the area that the rasters of elevation and of materials have in common."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radcal.config import expand_path
from radcal.config.inputs import vrt_folders
from radcal.errors import SceneError
from radcal.reading.intake import LARGEST_VALUES, guarded
from radcal.reading.rasters import open_raster
from radcal.scene.crs import METRES, crs_from, crs_of, horizontal, same_place, transformer, turned, utm
from radcal.sections.scene import GridScene

if TYPE_CHECKING:
    from pyproj import CRS


LARGEST_CELLS = LARGEST_VALUES  # largest number of cells of the grid, and of pixels read from a raster
_SMALLEST_SIDE = 8  # smallest number of rows and of columns of the grid
_OFF_PIXELS = 1e-3  # largest displacement of a cell from its pixel that is one of rounding [pixels]
_SCALE_ERROR = 0.01  # largest relative error of lengths on the map

Box = tuple[float, float, float, float]  # west, south, east, north


@dataclass(frozen=True)
class Source:
    """Open raster with one band, a CRS, and rows and columns parallel to the axes of this CRS.

    Attributes
    ----------
    key : str
        Configuration key of the raster's path.
    path : path
        The file.
    raster : rasterio.DatasetReader
        The open dataset.
    crs : pyproj.CRS
        CRS of the file.
    plane : pyproj.CRS
        Horizontal part of ``crs``.
    """

    key: str
    path: Path
    raster: Any
    crs: CRS
    plane: CRS

    @property
    def box(self) -> Box:
        """West, south, east and north bounds of the raster in its horizontal CRS."""
        # the first row may be in the south and the first column in the east
        left, bottom, right, top = self.raster.bounds
        return min(left, right), min(bottom, top), max(left, right), max(bottom, top)

    def error(self, text: str, about: Hashable = None) -> SceneError:
        """Error whose message is the raster's configuration key and path, followed by ``text``."""
        return SceneError(f"{self.key}: {self.path} {text}", about)


@dataclass(frozen=True)
class Grid:
    """Grid of square cells in a projected CRS.

    Attributes
    ----------
    crs : pyproj.CRS
        Projected CRS with the unit metre.
    west, south : float
        Coordinates of the grid's south-west corner [m].
    cell_m : float
        Cell size [m].
    rows, columns : int
        Number of cells to the north and to the east.
    turned : bool
        Whether the second axis of the CRS points along a track; no raster has this CRS.
    """

    crs: CRS
    west: float
    south: float
    cell_m: float
    rows: int
    columns: int
    turned: bool = False

    @property
    def box(self) -> Box:
        """West, south, east and north bounds of the grid [m]."""
        return self.west, self.south, self.west + self.columns * self.cell_m, self.south + self.rows * self.cell_m

    def cut(self, parts: int) -> Grid:
        """Grid of the same area with smaller cells: each side of a cell is divided into ``parts`` equal parts."""
        return replace(self, cell_m=self.cell_m / parts, rows=self.rows * parts, columns=self.columns * parts)


@contextmanager
def opened(key: str, config: GridScene) -> Iterator[Source]:
    """Open the raster whose path a configuration key contains, and check the raster.

    Parameters
    ----------
    key : str
        Configuration key of the raster's path.
    config : GridScene
        Section ``scene``, which contains the path.

    Raises
    ------
    SceneError
        The file cannot be read, has several bands or no CRS, or its rows and columns are not parallel to the axes of
        the CRS.
    """
    path = expand_path(getattr(config, key.removeprefix("scene.")), key)

    def refused(text: str) -> SceneError:
        return SceneError(f"{key}: {path} {text}")

    with ExitStack() as stack:
        with guarded(path, refused, "a raster"):
            # without this option, GDAL drops the vertical part of the CRS of GeoTIFF 1.0
            raster = stack.enter_context(open_raster(path, vrt_folders(config), GTIFF_REPORT_COMPD_CS="YES"))
            crs, transform = crs_of(raster), raster.transform
        if raster.count != 1:
            raise refused(f"has {raster.count} bands, expected one.")
        if crs is None:
            raise refused(
                "has no geographic or projected coordinate reference system, expected one: give it one with gdal_edit "
                "-a_srs."
            )
        if transform.is_identity:
            raise refused(
                "has a coordinate reference system and no transform from pixels to it: warp it with gdalwarp."
            )
        if transform.b != 0 or transform.d != 0:
            raise refused("is rotated against its coordinate axes: warp it with gdalwarp.")
        yield Source(key, path, raster, crs, horizontal(crs))


def box_in(box: Box, source: CRS, target: CRS) -> Box:
    """Bounding box, in the CRS ``target``, of a box in the CRS ``source``.

    Parameters
    ----------
    box : (float, float, float, float)
        West, south, east and north bounds in the CRS ``source``.
    source, target : pyproj.CRS
        CRS of the box, and CRS of the result.

    Raises
    ------
    SceneError
        The CRS ``target`` is not defined in the area of the box.
    """
    if same_place(source, target):
        return box
    west, south, east, north = transformer(source, target).transform_bounds(*box)
    if not np.isfinite([west, south, east, north]).all():
        raise SceneError(
            f"scene: the area {[float(f'{v:.6g}') for v in box]} in {source.name} cannot be expressed in "
            f"{target.name}: give another scene.crs, or rasters of a smaller area."
        )
    return west, south, east, north


def _in_degrees(box: Box, source: CRS) -> Box:
    """Bounding box in longitude and latitude of a box in a CRS."""
    from pyproj import CRS

    return box_in(box, source, CRS.from_user_input("OGC:CRS84"))


def _common(one: Box, other: Box) -> Box:
    return max(one[0], other[0]), max(one[1], other[1]), min(one[2], other[2]), min(one[3], other[3])


def _empty(box: Box) -> bool:
    return not (box[0] < box[2] and box[1] < box[3])


def overlap(elevation: Source, materials: Source) -> tuple[Box, Box]:
    """Bounding box of the area that both rasters cover, in the CRS of the elevation and in that of the materials.

    Raises
    ------
    SceneError
        The rasters do not overlap.
    """

    def area(source: Source) -> float:
        west, south, east, north = _in_degrees(source.box, source.plane)
        return (east - west) * (north - south)

    # the smaller box is transformed first, because the box of a continent may be undefined in the other raster's
    # projection
    small, large = sorted((elevation, materials), key=area)
    of_large = _common(large.box, box_in(small.box, small.plane, large.plane))
    of_small = of_large if _empty(of_large) else _common(small.box, box_in(of_large, large.plane, small.plane))
    if _empty(of_large) or _empty(of_small):
        raise SceneError(
            f"scene.materials: {materials.path} ({_degrees(materials)}) and scene.elevation: {elevation.path} "
            f"({_degrees(elevation)}) do not overlap.",
        )
    return (of_small, of_large) if small is elevation else (of_large, of_small)


def _degrees(source: Source) -> str:
    west, south, east, north = _in_degrees(source.box, source.plane)
    return f"longitude {west:.4g} to {east:.4g}, latitude {south:.4g} to {north:.4g}"


def _middle(box: Box) -> tuple[float, float]:
    return 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])


def scene_grid(elevation: Source, materials: Source, config: GridScene, heading_deg: float = 0.0) -> Grid:
    """Grid of the scene's cells, on the configured bounds or, without bounds, on the area that both rasters cover.

    If the scene has the CRS of the elevation raster, the distance of the grid's south-west corner from the raster's
    south-west corner is a whole number of cells along each axis.

    Parameters
    ----------
    elevation, materials : Source
        Rasters of elevation and of material ids.
    config : GridScene
        Section ``scene``, with optional CRS, cell size and bounds.
    heading_deg : float
        Heading of the track [deg]. If the heading is not 0, the grid is turned so that axis 0 points along the track.
        The turned grid lies inside of the configured bounds or, without bounds, of the area that both rasters cover.

    Raises
    ------
    SceneError
        The rasters or bounds do not overlap, the CRS is not in metres at true scale, or the grid would have too few or
        too many cells.

    References
    ----------
    Snyder, "Map projections: a working manual", USGS Professional Paper 1395 (1987), p. 20:
    Tissot's indicatrix, whose axes are a map's largest and smallest scale.
    """
    boxes = overlap(elevation, materials)
    crs = _target(elevation, boxes[0], config)
    box = _common(box_in(boxes[0], elevation.plane, crs), box_in(boxes[1], materials.plane, crs))
    same = same_place(elevation.plane, crs)
    west, south = (elevation.box[:2]) if same else (0.0, 0.0)
    if config.bounds is not None:
        if _empty(_common(box, config.bounds)):
            raise SceneError(
                f"scene.bounds are {list(config.bounds)}, expected inside "
                f"{[round(float(v), 1) for v in box]} ({crs.name}), which both rasters cover."
            )
        box = config.bounds
        west, south = (west, south) if same else box[:2]
    if heading_deg:
        crs, box = _turned(crs, box, heading_deg)
        same, (west, south) = False, box[:2]
    pixel = float(np.sqrt(np.prod(pixel_m(elevation, crs, box))))
    # three digits are enough for the size of a pixel in another projection
    cell = config.cell_m or (pixel if same else float(f"{pixel:.3g}"))
    return _whole_cells(crs, box, (west, south), cell, bool(heading_deg))


def grid_of_degrees(
    bounds: Box, crs: str | None, cell_m: float | None, step_deg: tuple[float, float], heading_deg: float
) -> Grid:
    """Grid of the scene's cells inside of bounds in degrees: the largest box whose sides do not leave the bounds.

    Parameters
    ----------
    bounds : (float, float, float, float)
        West, south, east and north bounds on WGS 84 [deg].
    crs : str or None
        Projected CRS; by default the UTM zone of the middle.
    cell_m : float or None
        Cell size [m]; by default the geometric mean of the sides of a rectangle in degrees, in three digits.
    step_deg : (float, float)
        Sides of this rectangle along longitude and latitude [deg].
    heading_deg : float
        Heading of the track, as for :func:`scene_grid`.

    Raises
    ------
    SceneError
        The CRS is not in metres at true scale, or the grid would have too few or too many cells.
    """
    plane = _projected(crs, *_middle(bounds), f"scene.bounds {list(bounds)}")
    to_plane = transformer("EPSG:4326", plane).transform
    x, y = (np.linspace(low, high, 21) for low, high in zip(bounds[:2], bounds[2:], strict=True))
    west, east = (to_plane(np.full_like(y, side), y)[0] for side in bounds[::2])
    south, north = (to_plane(x, np.full_like(x, side))[1] for side in bounds[1::2])
    box = float(np.max(west)), float(np.max(south)), float(np.min(east)), float(np.min(north))
    if not np.isfinite(box).all():
        raise SceneError(f"scene.bounds are {list(bounds)}, which {plane.name} cannot express: give another scene.crs.")
    if heading_deg:
        plane, box = _turned(plane, box, heading_deg)
    if cell_m is None:
        sides = _sides_m("EPSG:4326", plane, step_deg, box)
        cell_m = float(f"{np.sqrt(np.prod(sides)):.3g}")
    return _whole_cells(plane, box, box[:2], cell_m, bool(heading_deg))


def _whole_cells(crs: CRS, box: Box, corner: tuple[float, float], cell: float, turned_to_track: bool) -> Grid:
    """Grid of whole cells inside of a box; its corner lies a whole number of cells away from ``corner``."""
    west, south = (at + np.ceil((low - at) / cell - 1e-6) * cell for at, low in zip(corner, box[:2], strict=True))
    columns, rows = (int((high - low) / cell + 1e-6) for low, high in ((west, box[2]), (south, box[3])))
    if min(rows, columns) < _SMALLEST_SIDE:
        raise SceneError(
            f"scene.cell_m is {cell:g}, which makes {max(columns, 0)} x {max(rows, 0)} cells of the area that the "
            f"files and scene.bounds share, expected at least {_SMALLEST_SIDE} x {_SMALLEST_SIDE}."
        )
    if rows * columns > LARGEST_CELLS:
        raise SceneError(
            f"scene.cell_m is {cell:g}, which makes {columns} x {rows} cells, expected at most {LARGEST_CELLS:.0e}: "
            "give smaller scene.bounds or a larger scene.cell_m."
        )
    return Grid(crs, float(west), float(south), float(cell), rows, columns, turned_to_track)


def _turned(crs: CRS, box: Box, heading_deg: float) -> tuple[CRS, Box]:
    """CRS turned to the heading of a track, and the largest box in this CRS that lies inside of a box in ``crs``."""
    middle = _middle(box)
    turned_crs = turned(crs, middle, heading_deg)
    to_map = transformer(turned_crs, crs)
    x, y = transformer(crs, turned_crs).transform(*middle)
    # the angle is taken between the axes of the two CRSs, because the map's north differs from true north
    (left, right), (below, above) = to_map.transform([x, x], [y - 1.0, y + 1.0])
    wide, high = _inscribed(box[2] - box[0], box[3] - box[1], float(np.arctan2(right - left, above - below)))
    # a line that is straight in one CRS is curved in the other; the box is therefore reduced until its border is inside
    along = np.linspace(-0.5, 0.5, 21)
    side = np.full_like(along, 0.5)
    across, up = np.concatenate([along, along, side, -side]) * wide, np.concatenate([side, -side, along, along]) * high
    east, north = to_map.transform(x + across, y + up)
    beyond = max(
        np.max(np.abs(east - middle[0])) / (0.5 * (box[2] - box[0])),
        np.max(np.abs(north - middle[1])) / (0.5 * (box[3] - box[1])),
    )
    wide, high = wide / max(beyond, 1.0), high / max(beyond, 1.0)
    return turned_crs, (x - 0.5 * wide, y - 0.5 * high, x + 0.5 * wide, y + 0.5 * high)


def _inscribed(width: float, height: float, angle: float) -> tuple[float, float]:
    """Width and height of the largest rectangle, turned by ``angle`` [rad], that lies inside of a given rectangle."""
    sine, cosine = abs(float(np.sin(angle))), abs(float(np.cos(angle)))
    short, long = min(width, height), max(width, height)
    if short <= 2.0 * sine * cosine * long or abs(sine - cosine) < 1e-9:
        # two corners touch the long sides, and the area is largest if the other two corners lie half-way between these
        # sides
        first, second = 0.5 * short / sine, 0.5 * short / cosine
        return (first, second) if width >= height else (second, first)
    double = cosine**2 - sine**2
    return (width * cosine - height * sine) / double, (height * cosine - width * sine) / double


def _target(elevation: Source, box: Box, config: GridScene) -> CRS:
    """CRS of the scene: a projected CRS in metres, with a scale of about 1."""
    longitude, latitude = _middle(_in_degrees(box, elevation.plane))
    if config.crs is None and _unfit(elevation.plane, longitude, latitude) is None:
        return elevation.plane
    return _projected(config.crs, longitude, latitude, str(elevation.path))


def _projected(named: str | None, longitude: float, latitude: float, about: str) -> CRS:
    """Projected CRS that ``scene.crs`` names, by default the UTM zone of a place."""
    from pyproj.exceptions import CRSError

    if named is None:
        found = utm(longitude, latitude)
        if found is None:
            raise SceneError(
                f"scene.crs is missing and {about} lies at latitude {latitude:.4g}, outside the UTM zones: "
                "give a projected CRS."
            )
        return found
    try:
        crs = crs_from(named)
    except CRSError:
        raise SceneError(
            f"scene.crs is {named!r}, expected a projected CRS such as EPSG:32631, without files of grids."
        ) from None
    if crs.is_compound or len(crs.axis_info) == 3:
        raise SceneError(
            f"scene.crs is {named!r}, which has a vertical axis: heights are not transformed; name the horizontal "
            "CRS alone."
        )
    if (unfit := _unfit(crs, longitude, latitude)) is not None:
        raise SceneError(f"scene.crs is {named!r} ({crs.name}), {unfit}.")
    return crs


def _unfit(crs: CRS, longitude: float, latitude: float) -> str | None:
    """Reason why a CRS is unsuitable for a grid of square cells in metres; None if it is suitable."""
    from pyproj import Proj

    if not crs.is_projected:
        return "expected a projected CRS such as EPSG:32631"
    axes = crs.source_crs.axis_info if crs.is_bound and crs.source_crs is not None else crs.axis_info
    if any(axis.unit_name not in METRES for axis in axes):
        return f"whose unit is {axes[0].unit_name}, expected metres"
    if any(axis.direction.lower() == "west" for axis in axes):
        return "whose coordinates grow to the west, expected to the east and north"
    factors = Proj(crs).get_factors(longitude, latitude)
    # the semi-axes of Tissot's indicatrix: the largest and the smallest scale in any direction
    scales = (factors.tissot_semimajor, factors.tissot_semiminor)
    worst = max(scales, key=lambda scale: abs(scale - 1.0))
    if not abs(worst - 1.0) <= _SCALE_ERROR:  # the scale is NaN outside the projection's domain
        return (
            f"whose metre is {worst:.4g} times one at longitude {longitude:.4g}, latitude {latitude:.4g}, expected "
            f"within {_SCALE_ERROR:.0%}, as in a UTM zone of the place"
        )
    return None


def pixel_m(source: Source, crs: CRS, box: Box) -> tuple[float, float]:
    """Side lengths [m] of a raster's pixel in the middle of ``box``, whose CRS is ``crs`` and has the unit metre."""
    sides = abs(source.raster.transform.a), abs(source.raster.transform.e)
    return sides if same_place(source.plane, crs) else _sides_m(source.plane, crs, sides, box)


def _sides_m(source: CRS | str, crs: CRS, sides: tuple[float, float], box: Box) -> tuple[float, float]:
    """Side lengths [m] of a rectangle in the middle of a box in ``crs``, from its sides in the CRS ``source``."""
    right, up = 0.5 * sides[0], 0.5 * sides[1]
    x, y = transformer(crs, source).transform(*_middle(box))
    to_target = transformer(source, crs)
    xs, ys = to_target.transform([x - right, x + right, x, x], [y, y, y - up, y + up])
    return float(np.hypot(xs[1] - xs[0], ys[1] - ys[0])), float(np.hypot(xs[3] - xs[2], ys[3] - ys[2]))


def subdivision(source: Source, grid: Grid) -> int:
    """Number of parts into which the side of a cell is divided so that no part is longer than a raster pixel's side."""
    # a cell whose size differs from the pixel's only by rounding is not divided
    return max(1, int(np.ceil(grid.cell_m / min(pixel_m(source, grid.crs, grid.box)) - 1e-3)))


def on_pixels(source: Source, grid: Grid) -> bool:
    """Whether the cells of a grid from :func:`scene_grid` are pixels of the raster of elevation."""
    if not same_place(source.plane, grid.crs):
        return False
    sides = abs(source.raster.transform.a), abs(source.raster.transform.e)
    return bool(max(grid.rows, grid.columns) * max(abs(grid.cell_m / side - 1.0) for side in sides) < _OFF_PIXELS)
