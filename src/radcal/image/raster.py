"""Measured images in arrays and rasters: in slant range, or on the map by the header of a GeoTIFF or other raster."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar
from radcal.config.loading import vrt_folders
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.base import Facts, Grid, Reader, ReadImage, image_file
from radcal.reading.arrays import is_raster, raster_band, read_array
from radcal.reading.images import reading
from radcal.reading.intake import open_raster
from radcal.scene.crs import crs_of, horizontal, pixel_size_m, transformer

if TYPE_CHECKING:
    from pyproj import CRS

    from radcal.scene.model import Scene

# tag of OPERA RTC-S1 images, whose processor writes gamma0, sigma0 or beta0 into it
_NORMALISATION = "PROCESSING_INFORMATION_OUTPUT_BACKSCATTER_NORMALIZATION_CONVENTION"
# band names of Earth Engine ("VV") and of SNAP ("Sigma0_VV", "Sigma0_VV_db")
_BAND = re.compile(r"(?:(?:Sigma|Gamma|Beta)0_)?(?P<pol>HH|HV|VH|VV)(?P<db>_db)?", re.IGNORECASE)
# names of bands of incidence angles [deg] of Earth Engine and of SNAP, and whether the angles are those of slopes
_INCIDENCE = {"angle": False, "incidenceanglefromellipsoid": False, "localincidenceangle": True}
_INCIDENCE_DEG = 2.0  # largest difference from the incidences that a file gives; their definitions differ by far less
_SAME_RELIEF = 0.3  # largest ratio of differences to the relief (rms) at which an image counts as heights
Place = tuple[str, Sequence[float]]  # CRS and transform of the scene
_FAR_OFF = 5.0  # largest ratio of pixel spacing to pixel size, or of pixel size to pixel spacing


def check_spacing(path: Path, pixel_m: tuple[float, float], radar: Radar) -> None:
    """Refuse pixel spacings that are much larger or smaller than the pixels of a georeferenced image.

    If the pixels of the image were much larger than the spacings, each pixel would be used many times, as if its copies
    were independent. If the pixels of the image were much smaller, most pixels would not be used.

    Parameters
    ----------
    path : path
        File of the image, for messages.
    pixel_m : (float, float)
        Sides of the image's pixels on the ground [m].
    radar : Radar
        Pixel spacings.

    Raises
    ------
    MeasurementError
        A spacing on the ground is more than five times the mean side of the image's pixels, or less than a fifth of it.
    """
    side = float(np.sqrt(pixel_m[0] * pixel_m[1]))
    for way, per_ground in (("range", radar.slant_per_ground), ("azimuth", 1.0)):
        spacing = getattr(radar, f"{way}_spacing_m")
        if not 1.0 / _FAR_OFF <= spacing / per_ground / side <= _FAR_OFF:
            ground = f" ({spacing / per_ground:.3g} m on the ground)" if way == "range" else ""
            raise MeasurementError(
                f"radar.{way}_spacing_m is {spacing:g}{ground}, the pixels of {path} are {pixel_m[0]:.3g} x "
                f"{pixel_m[1]:.3g} m: expected about {per_ground * side:.3g}, at most {_FAR_OFF:g} times more or less."
            )


def map_pixel_m(pixel_m: tuple[float, float], radar: Radar) -> tuple[float, float]:
    """Sides of a georeferenced image's pixels along slant range and azimuth [m], as the root of their mean square.

    Parameters
    ----------
    pixel_m : (float, float)
        Sides of the pixels on the ground, to the east and to the north [m].
    radar : Radar
        Heading and angle of the pass.
    """
    east, north = pixel_m
    heading = np.radians(radar.heading_deg)
    across = float(np.hypot(east * np.cos(heading), north * np.sin(heading)))
    return across * radar.slant_per_ground, float(np.hypot(east * np.sin(heading), north * np.cos(heading)))


def read_at_ground(path: Path, config: FileMeasurement, place: Place, ground: NDArray[np.float32]) -> NDArray[Any]:
    """Numbers of a measured image on the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    path : path
        Terrain-corrected image, in which every pixel shows the ground at the pixel's map coordinates.
    config : FileMeasurement
        Band.
    place : (str, sequence of 6 float)
        The scene's CRS, and coefficients a, b, c, d, e, f of its affine transform from (column, row) of cell corners to
        coordinates.
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel of the scene's image shows, with cell centres at whole numbers; NaN where a
        pixel shows no ground.

    Returns
    -------
    ndarray, shape (rows, columns)
        Numbers of the nearest pixels; NaN outside the image, where it has no data, and where a pixel shows no ground.

    Raises
    ------
    MeasurementError
        The file cannot be read, does not hold the band, has no CRS or transform, or does not cover the scene's image.
    """
    file = image_file(path, config)
    with reading(file, "a raster"), open_raster(path, file.folders) as raster:
        crs = crs_of(raster)
        if crs is None or raster.transform.is_identity:
            raise file.refused(
                f"{path} has no coordinate reference system or no transform to one, expected a georeferenced image."
            )
        plane = horizontal(crs)
        x, y = places_on_ground(*place, ground, plane)
        window = window_around(raster.transform, raster.shape, x, y)
        values, inverse = raster_band(raster, file, window), ~raster.window_transform(window)
    # nearest pixels: a mean of n neighbours would have only 1/n of the speckle variance that the target must keep
    at_column = np.floor(inverse.a * x + inverse.b * y + inverse.c)
    at_row = np.floor(inverse.d * x + inverse.e * y + inverse.f)
    rows, columns = values.shape
    # places outside the domain of the image's projection are infinite and thus outside all bounds
    inside = (at_row >= 0) & (at_row < rows) & (at_column >= 0) & (at_column < columns)
    if not inside.any():
        raise MeasurementError(
            f"measurement.path: {path} ({plane.name}) covers no place of the scene's image, which lies {_span(x, y)} "
            "in its coordinates: expected an image of the same area."
        )
    found = np.full(inside.shape, np.nan, dtype=values.dtype)
    found[inside] = values[at_row[inside].astype(np.int64), at_column[inside].astype(np.int64)]
    shown = np.isfinite(ground).all(axis=0)
    result = np.full(shown.shape, np.nan, dtype=values.dtype)
    result[shown] = found
    return result


def window_around(transform: Any, shape: tuple[int, int], x: NDArray[np.float64], y: NDArray[np.float64]) -> Any:
    """Rectangle of a raster's pixels around coordinates; one pixel if all coordinates lie outside the raster."""
    from rasterio.windows import Window

    inverse, around = ~transform, []
    for at, size in (
        (inverse.a * x + inverse.b * y + inverse.c, shape[1]),
        (inverse.d * x + inverse.e * y + inverse.f, shape[0]),
    ):
        known = at[np.isfinite(at)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
        first = int(np.clip(np.floor(low), 0, size - 1))
        around.append((first, int(np.clip(np.floor(high) + 1, first + 1, size)) - first))
    (left, width), (top, height) = around
    return Window(left, top, width, height)


def places_on_ground(
    crs: str, transform: Sequence[float], ground: NDArray[np.float32], other: CRS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates, in another CRS, of the ground that each pixel of the scene's image shows.

    Parameters
    ----------
    crs, transform, ground
        Parts of ``place`` of :func:`read_at_ground`, and its ``ground``.
    other : pyproj.CRS
        CRS of the coordinates.

    Returns
    -------
    x, y : ndarray, shape (pixels that show a place,)
        Coordinates; infinite outside the domain of the CRS ``other``.
    """
    from pyproj import CRS

    row, column = (ground[k][np.isfinite(ground).all(axis=0)].astype(np.float64) + 0.5 for k in range(2))
    a, b, c, d, e, f = transform
    to_other = transformer(CRS.from_user_input(crs), other)
    x, y = to_other.transform(a * column + b * row + c, d * column + e * row + f)
    return np.asarray(x), np.asarray(y)


def _span(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return "nowhere"
    x, y = x[known], y[known]
    return f"from ({x.min():.6g}, {y.min():.6g}) to ({x.max():.6g}, {y.max():.6g})"


@dataclass(frozen=True)
class Header(Facts):
    """What the header, tags and band names of a raster say.

    Attributes
    ----------
    normalisation : str or None
        ``gamma0``, ``sigma0`` or ``beta0`` after radiometric terrain correction.
    decibels : bool
        Whether the name of the band says dB.
    incidence : (int, str, bool) or None
        Band of incidence angles, recognised by its name: number, from 1, name, and whether the angles are local ones,
        on the slopes of the ground.
    """

    normalisation: str | None = None
    decibels: bool = False
    incidence: tuple[int, str, bool] | None = None


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
        values = read_array(image_file(self.path, self.config, grid.shape, resized))
        return ReadImage(*self.in_db(values, self.config.scale, grid.shape))


def _off_the_map(scene: str, crs: CRS | None) -> str:
    """End of the message about an image of another size that has no place on the map; ``scene`` is the scene's CRS."""
    from pyproj import CRS

    lacks = "CRS" if crs is None else "transform from its pixels to the map"
    return (
        f", and the file has no {lacks}, expected a georeferenced image, as the scene in "
        f"{CRS.from_user_input(scene).name} is, or one in slant range on the grid of the scene's image"
    )


class RasterReader(ArrayReader):
    """Reader of a raster; a georeferenced one is read where the scene's image shows the same ground."""

    called = "a raster"

    @classmethod
    def matches(cls, path: Path) -> bool:
        """Whether no reader of arrays reads the file."""
        return is_raster(path)

    @cached_property
    def header(self) -> Header:
        """Header; empty for a file that cannot be read."""
        try:
            with open_raster(self.path, vrt_folders(self.config)) as raster:
                crs, normalisation = crs_of(raster), raster.tags().get(_NORMALISATION)
                names = [(name or "").strip() for name in raster.descriptions]
                plane, place = horizontal(crs) if crs is not None else None, raster.transform
                pixel_m = pixel_size_m(raster, plane) if plane is not None and not place.is_identity else None
        except Exception:  # the libraries' exceptions for damaged files have no common base class
            return Header()
        band = _BAND.fullmatch("".join(names[(self.config.band or 1) - 1 :][:1]))
        angles = ((k, name, _INCIDENCE[name.lower()]) for k, name in enumerate(names, 1) if name.lower() in _INCIDENCE)
        return Header(
            polarisation=band["pol"].upper() if band else None,
            crs=plane,
            pixel_m=pixel_m,
            on_map=pixel_m is not None,
            normalisation=normalisation.strip().lower() if normalisation else None,
            decibels=bool(band and band["db"]),
            incidence=next(angles, None),
        )

    def facts(self, scene: Scene | None = None) -> Facts:
        """Header of the file."""
        del scene
        return self.header

    def read(self, grid: Grid) -> ReadImage:
        """Image in slant range, or from the nearest pixels of an image on the map."""
        place, pixel_m = grid.on_map, self.header.pixel_m
        read = super().read(grid) if place is None or pixel_m is None else self._on_map(grid, place, pixel_m)
        config, header = self.config, self.header
        if header.decibels and config.scale != "db":
            raise MeasurementError(
                f"measurement.scale is {config.scale}, the name of the band of {self.path} says dB: set "
                "measurement.scale: db."
            )
        if header.normalisation is not None and header.normalisation != (config.radiometry or "").partition("_")[0]:
            raise MeasurementError(
                f"measurement.radiometry is {config.radiometry}, the tags of {self.path} say {header.normalisation} "
                "after terrain correction: set measurement.radiometry and radar.radiometry to it (gamma0_rtc for "
                "gamma0)."
            )
        return read

    def _on_map(self, grid: Grid, place: Place, pixel_m: tuple[float, float]) -> ReadImage:
        """Image from the nearest pixels of the file, whose pixels have the sides ``pixel_m``."""
        check_spacing(self.path, pixel_m, self.radar)
        values = read_at_ground(self.path, self.config, place, grid.geometry.ground)
        self._check_no_heights(values, grid)
        read = self.in_db(values, self.config.scale, grid.shape)
        findings = (self._angle(grid, place),)
        return ReadImage(*read, findings, resampled=True, pixel_m=map_pixel_m(pixel_m, self.radar))

    def _check_no_heights(self, values: NDArray[Any], grid: Grid) -> None:
        """Refuse values that are the scene's own heights: a copy of the elevation in place of the measured image."""
        heights, ground = None if grid.scene is None else grid.scene.elevation_m, grid.geometry.ground
        if heights is None or values.dtype.kind == "c":
            return
        known = np.isfinite(values) & np.isfinite(ground).all(axis=0)
        height = scipy.ndimage.map_coordinates(heights, ground[:, known].astype(np.float64), order=0, mode="nearest")
        if height.size and np.sqrt(np.mean((values[known] - height) ** 2)) < _SAME_RELIEF * height.std():
            raise MeasurementError(
                f"measurement.path: the values of {self.path}, {values[known].min():.4g} to {values[known].max():.4g}, "
                "are the heights of scene.elevation in metres, expected backscatter: give the file of the measured "
                "image."
            )

    def _angle(self, grid: Grid, place: Place) -> Finding:
        """Finding on the incidence of an image on the map, in which the map and not the angle places the pixels.

        Raises
        ------
        MeasurementError
            The file has a band of incidence angles, and these differ from those of ``radar``.
        """
        radar, geometry = self.radar, grid.geometry
        key = "depression_deg" if radar.incidence_deg is None else "incidence_deg"
        value = getattr(radar, key)
        low, high = geometry.flat_incidence_deg.min(), geometry.flat_incidence_deg.max()
        numbers = {"key": f"radar.{key}", "declared_deg": value, "from_deg": float(low), "to_deg": float(high)}
        by_map = Finding("incidence_by_map", "note", self.name, numbers)
        if self.header.incidence is None:
            return by_map
        number, name, local = self.header.incidence
        angle = read_at_ground(self.path, self.config.model_copy(update={"band": number}), place, geometry.ground)
        off = (geometry.incidence_deg if local else geometry.flat_incidence_deg[:, None]) - angle
        if not np.isfinite(off).any():
            return by_map
        off_deg = float(np.nanmedian(off))
        if abs(off_deg) > _INCIDENCE_DEG:
            right = value + off_deg * (1.0 if key == "depression_deg" else -1.0)
            raise MeasurementError(
                f"radar.{key} is {value:g}, whose incidences differ by {off_deg:+.1f} degrees (median) from band "
                f"{number} ({name}) of {self.path}, expected about {right:.1f}."
            )
        numbers |= {"band": number, "name": name, "off_deg": off_deg}
        return Finding("incidence_of_band", "note", self.name, numbers)
