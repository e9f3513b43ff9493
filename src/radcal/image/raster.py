"""Measured images in arrays and rasters: in slant range, or on the map by the header of a GeoTIFF or other raster."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config.inputs import vrt_folders
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.base import Facts, Grid, Reader, ReadImage, image_file
from radcal.image.georeference import Place, check_spacing, map_pixel_m, read_at_ground
from radcal.reading.arrays import is_raster, read_array
from radcal.reading.rasters import open_raster
from radcal.scene.crs import crs_of, horizontal, pixel_size_m

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
