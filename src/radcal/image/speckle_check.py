"""Findings on what the speckle of a measured image says of looks, scale and resolutions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.findings import Finding
from radcal.image.looks import check_looks, estimate_looks
from radcal.image.point_spread import estimate_point_spread, is_filtered, point_spread_findings
from radcal.image.repeated import repeated_pixels
from radcal.image.resolution import unchecked_resolutions

__all__ = ["check_speckle"]


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
        found.append(repeated.finding(source))
        pixel_m = pixel_m or repeated.sides_m(radar)
    if looks is not None:
        found.append(check_looks(looks, radar.looks, scale, source, is_filtered(spread, looks, radar)))
    elif scale == "complex" and radar.looks != 1:
        found.append(Finding("looks_single", "note", source, {"declared": radar.looks}))
    else:
        found.append(Finding("looks_unknown", "note", source))
    if spread is None:
        return [*found, *unchecked_resolutions(radar, source)]
    return [*found, *point_spread_findings(spread, looks, radar, source, pixel_m)]
