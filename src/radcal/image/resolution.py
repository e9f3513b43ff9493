"""Resolutions that no image can have, and findings on resolutions that the speckle could not check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.small_areas import LEAST_LAGS, LEAST_PAIRS

__all__ = ["check_resolutions", "unchecked_resolutions"]

# Largest usual number of pixels in a resolution: twice that at which the power of a detected image, with twice the
# bandwidth of the amplitude, is sampled without loss.
_OVERSAMPLED = 2.0 * 2.0 * WIDTH_FACTOR
_WAYS = (("range", "slant range"), ("azimuth", "azimuth"))


def check_resolutions(material: NDArray[np.uint8], radar: Radar) -> None:
    """Refuse resolutions coarser than the widest area of a single material.

    With such a resolution, every pixel shows several materials. For a scene of one material, the limit is the extent of
    the image.

    Parameters
    ----------
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several; such pixels do not end an area.
    radar : Radar
        Pass with its resolutions and pixel spacings.

    Raises
    ------
    MeasurementError
        A resolution is larger than the longest part of a row or column that holds a single material.
    """
    for (way, called), labels in zip(_WAYS, (material, material.T), strict=True):
        spacing, resolution = getattr(radar, f"{way}_spacing_m"), getattr(radar, f"{way}_resolution_m")
        widest_m = _longest(labels) * spacing
        if 0.0 < widest_m < resolution:
            raise MeasurementError(
                f"radar.{way}_resolution_m is {resolution:g}: no area of a single material in the image is wider than "
                f"{widest_m:.3g} m in {called}, so that no pixel would show one material, expected at most "
                f"{widest_m:.3g} (radar.{way}_spacing_m is {spacing:g})."
            )


def _longest(material: NDArray[np.uint8]) -> int:
    """Largest distance along axis 0 from a pixel to another with the same material and no other one between [pixels].

    Both pixels count; 0 if no pixel holds a material.
    """
    rows = np.arange(len(material))[:, None]
    last = np.maximum.accumulate(np.where(material > 0, rows, 0), axis=0)  # row of the last pixel with a material
    held = np.take_along_axis(material, last, axis=0)
    first = np.ones_like(held, dtype=np.bool_)
    first[1:] = held[1:] != held[:-1]
    start = np.maximum.accumulate(np.where(first, rows, 0), axis=0)
    return int(np.where(material > 0, rows - start + 1, 0).max())


def unchecked_resolutions(radar: Radar, source: str) -> list[Finding]:
    """Findings on an image whose speckle did not suffice for an estimate of the point spread.

    A resolution above 4.7 pixel spacings is a warning. The power of a detected image is sampled without loss at 2.37
    pixels in a resolution, and a product with twice as many is unusual.

    Parameters
    ----------
    radar : Radar
        Pass with its resolutions and pixel spacings.
    source : str
        Name of the image.
    """
    limits = {"pairs": LEAST_PAIRS, "apart_px": LEAST_LAGS}
    found = [Finding("resolutions_unknown", "note", source, limits)]
    for way, _ in _WAYS:
        key = f"radar.{way}_resolution_m"
        spacing, resolution = getattr(radar, f"{way}_spacing_m"), getattr(radar, f"{way}_resolution_m")
        if resolution > _OVERSAMPLED * spacing:
            numbers = {"resolution_m": resolution, "spacings": resolution / spacing, "most_spacings": _OVERSAMPLED}
            found.append(Finding("resolution_unusual", "warning", key, numbers))
    return found
