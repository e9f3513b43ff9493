"""Polarisation, normalisation and unit of a raster's numbers, from the raster's tags and band names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from radcal.reading.arrays import is_raster
from radcal.reading.rasters import open_raster

__all__ = ["Tags", "incidence_band", "tags_of"]

# tag of OPERA RTC-S1 images, whose processor writes gamma0, sigma0 or beta0 into it
_NORMALISATION = "PROCESSING_INFORMATION_OUTPUT_BACKSCATTER_NORMALIZATION_CONVENTION"
# band names of Earth Engine ("VV") and of SNAP ("Sigma0_VV", "Sigma0_VV_db")
_BAND = re.compile(r"(?:(?:Sigma|Gamma|Beta)0_)?(?P<pol>HH|HV|VH|VV)(?P<db>_db)?", re.IGNORECASE)
# names of bands of incidence angles [deg] of Earth Engine and of SNAP, and whether the angles are those of slopes
_INCIDENCE = {"angle": False, "incidenceanglefromellipsoid": False, "localincidenceangle": True}


@dataclass(frozen=True)
class Tags:
    """Properties of one band of a raster, from tags and band name; None where the raster does not give them.

    Attributes
    ----------
    polarisation : str or None
        Transmitted and received polarisation.
    normalisation : str or None
        ``gamma0``, ``sigma0`` or ``beta0`` after radiometric terrain correction.
    decibels : bool
        Whether the name of the band says dB.
    """

    polarisation: str | None = None
    normalisation: str | None = None
    decibels: bool = False


def tags_of(path: Path, band: int | None, folders: Sequence[Path] = ()) -> Tags:
    """Tags of a measured image; empty for a file that is no raster or that cannot be read.

    Parameters
    ----------
    path : path
        Path of a measured image of any format.
    band : int, optional
        Number of the band, from 1.
    folders : sequence of path
        Folders that may contain the source files of a VRT, besides the folder of the VRT.
    """
    if not is_raster(path):
        return Tags()
    try:
        with open_raster(path, folders) as raster:
            normalisation, names = raster.tags().get(_NORMALISATION), raster.descriptions
    except Exception:  # the libraries' exceptions for damaged files have no common base class
        return Tags()
    name = names[(band or 1) - 1] if (band or 1) <= len(names) else None
    found = _BAND.fullmatch((name or "").strip())
    return Tags(
        found["pol"].upper() if found else None,
        normalisation.strip().lower() if normalisation else None,
        bool(found and found["db"]),
    )


def incidence_band(path: Path, folders: Sequence[Path] = ()) -> tuple[int, str, bool] | None:
    """Band of incidence angles in a measured image, recognised by its name.

    Parameters
    ----------
    path, folders
        Arguments of :func:`tags_of`.

    Returns
    -------
    (int, str, bool) or None
        Number of the band, from 1, its name, and whether the angles are local ones, on the slopes of the ground; None
        without such a band.
    """
    try:
        with open_raster(path, folders) as raster:
            names = raster.descriptions
    except Exception:  # the libraries' exceptions for damaged files have no common base class
        return None
    for number, name in enumerate(names, start=1):
        local = _INCIDENCE.get((name or "").strip().lower())
        if local is not None:
            return number, str(name).strip(), local
    return None
