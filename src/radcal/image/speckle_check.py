"""Findings on what a measured image's speckle says of looks, scale, resolutions and pixels that are repeated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.looks import check_looks, estimate_looks
from radcal.image.point_spread import estimate_point_spread, is_filtered, point_spread_findings
from radcal.image.small_areas import LEAST_LAGS, LEAST_PAIRS

# Largest usual number of pixels in a resolution: twice that at which the power of a detected image, with twice the
# bandwidth of the amplitude, is sampled without loss.
_OVERSAMPLED = 2.0 * 2.0 * WIDTH_FACTOR
_WAYS = (("range", "slant range"), ("azimuth", "azimuth"))

_LEAST_SHARE = 0.01  # of equal adjacent pixels
_APART = 8
# largest share of all pairs of pixels with equal values at which adjacent pixels are not equal by chance
_BY_CHANCE = 2e-4


def check_speckle(
    image_db: NDArray[np.float32],
    material: NDArray[np.uint8],
    radar: Radar,
    source: str,
    scale: str | None,
    pixel_m: tuple[float, float] | None = None,
) -> list[Finding]:
    """Findings on repeated pixels, looks and point spread; a check that was not possible is a finding, too.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several.
    radar : Radar
        Pass with its resolutions, pixel spacings and looks.
    source : str
        Name of the image.
    scale : {'db', 'power', 'amplitude', 'complex'} or None
        Configured scale of the file's numbers; None for a product that defines its scale.
    pixel_m : (float, float), optional
        Sides of the pixels of a georeferenced image along slant range and azimuth [m].

    Raises
    ------
    MeasurementError
        The looks show that scale or looks are wrong, or that the image is filtered.
    """
    found = []
    looks = estimate_looks(image_db, material, radar)
    spread = estimate_point_spread(image_db, material, radar)
    if (repeated := repeated_pixels(image_db)) is not None:
        shares = {f"{way}_percent": 100.0 * share for (way, _), share in zip(_WAYS, repeated, strict=True)}
        found.append(Finding("pixels_repeated", "note", source, shares))
        pixel_m = pixel_m or sides_m(repeated, radar)
    if looks is not None:
        found.append(check_looks(looks, radar.looks, scale, source, is_filtered(spread, looks, radar)))
    elif scale == "complex" and radar.looks != 1:
        found.append(Finding("looks_single", "note", source, {"declared": radar.looks}))
    else:
        found.append(Finding("looks_unknown", "note", source))
    if spread is None:
        return [*found, *unchecked_resolutions(radar, source)]
    return [*found, *point_spread_findings(spread, looks, radar, source, pixel_m)]


def sides_m(repeated: Sequence[float], radar: Radar) -> tuple[float, float]:
    """Sides of the pixels before the resampling along slant range and azimuth [m]; 0 where none is repeated.

    If a pixel has n copies in a row, the share 1 - 1/n of the adjacent pixels is equal.
    """
    ways = zip(repeated, (radar.range_spacing_m, radar.azimuth_spacing_m), strict=True)
    along = [spacing / (1.0 - share) if share >= _LEAST_SHARE else 0.0 for share, spacing in ways]
    return along[0], along[1]


def repeated_pixels(image_db: NDArray[np.float32]) -> list[float] | None:
    """Shares of adjacent pixels that are repetitions.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.

    Returns
    -------
    list of float or None
        Shares along slant range and azimuth; None if fewer than 1 % of the adjacent pixels are equal, all of them, or
        if the values are so coarsely rounded that equal neighbours can be a chance.
    """
    shares = [_equal_share(image_db), _equal_share(image_db.T)]
    if not _LEAST_SHARE <= max(shares) < 1.0:
        return None
    apart = image_db[::_APART, ::_APART]  # repetitions of a pixel lie nearer to each other
    counts = np.unique(apart[np.isfinite(apart)], return_counts=True)[1].astype(np.float64)
    by_chance = float((counts * (counts - 1.0)).sum() / max(counts.sum() * (counts.sum() - 1.0), 1.0))
    return shares if by_chance < _BY_CHANCE else None


def _equal_share(image_db: NDArray[np.float32]) -> float:
    """Share of the pairs of adjacent pixels along axis 0 that are equal, of those with values; 0 if there are none."""
    pairs = np.isfinite(image_db[1:]) & np.isfinite(image_db[:-1])
    return float(np.mean((image_db[1:] == image_db[:-1])[pairs])) if pairs.any() else 0.0


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
