"""What the header, tags and band names of a measured raster say: its place on the map, and the kind of its numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from radcal.config import FileMeasurement, vrt_folders
from radcal.reading.arrays import is_raster
from radcal.reading.rasters import open_raster
from radcal.scene.crs import crs_of, horizontal, pixel_size_m

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = ["Header", "header_of"]

# tag of OPERA RTC-S1 images, whose processor writes gamma0, sigma0 or beta0 into it
_NORMALISATION = "PROCESSING_INFORMATION_OUTPUT_BACKSCATTER_NORMALIZATION_CONVENTION"
# band names of Earth Engine ("VV") and of SNAP ("Sigma0_VV", "Sigma0_VV_db")
_BAND = re.compile(r"(?:(?:Sigma|Gamma|Beta)0_)?(?P<pol>HH|HV|VH|VV)(?P<db>_db)?", re.IGNORECASE)
# names of bands of incidence angles [deg] of Earth Engine and of SNAP, and whether the angles are those of slopes
_INCIDENCE = {"angle": False, "incidenceanglefromellipsoid": False, "localincidenceangle": True}


@dataclass(frozen=True)
class Header:
    """Properties of a measured image, from the header of its file; None where the file does not give them.

    Attributes
    ----------
    crs : pyproj.CRS or None
        Horizontal CRS.
    pixel_m : (float, float) or None
        Sides of a pixel on the ground, along rows and columns [m]; None unless the file has a CRS and a transform from
        its pixels to coordinates in this CRS.
    polarisation : str or None
        Transmitted and received polarisation.
    normalisation : str or None
        ``gamma0``, ``sigma0`` or ``beta0`` after radiometric terrain correction.
    decibels : bool
        Whether the name of the band says dB.
    incidence : (int, str, bool) or None
        Band of incidence angles, recognised by its name: number, from 1, name, and whether the angles are local ones,
        on the slopes of the ground.
    """

    crs: CRS | None = None
    pixel_m: tuple[float, float] | None = None
    polarisation: str | None = None
    normalisation: str | None = None
    decibels: bool = False
    incidence: tuple[int, str, bool] | None = None


def header_of(path: Path, config: FileMeasurement) -> Header:
    """Header of a measured image of any format; empty for a file that is no raster or that cannot be read.

    Parameters
    ----------
    path : path
        Path of the file.
    config : FileMeasurement
        Number of the band, and folders of the source files of a VRT.
    """
    if not is_raster(path):
        return Header()
    try:
        with open_raster(path, vrt_folders(config)) as raster:
            crs, normalisation = crs_of(raster), raster.tags().get(_NORMALISATION)
            names = [(name or "").strip() for name in raster.descriptions]
            plane = horizontal(crs) if crs is not None else None
            pixel_m = pixel_size_m(raster, plane) if plane is not None and not raster.transform.is_identity else None
    except Exception:  # the libraries' exceptions for damaged files have no common base class
        return Header()
    band = _BAND.fullmatch("".join(names[(config.band or 1) - 1 :][:1]))
    angles = ((k, name, _INCIDENCE[name.lower()]) for k, name in enumerate(names, 1) if name.lower() in _INCIDENCE)
    return Header(
        plane,
        pixel_m,
        band["pol"].upper() if band else None,
        normalisation.strip().lower() if normalisation else None,
        bool(band and band["db"]),
        next(angles, None),
    )
