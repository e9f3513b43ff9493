"""Sentences on what the speckle of a measured image says of looks, scale and resolutions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.image.looks import check_looks, estimate_looks
from radcal.image.point_spread import estimate_point_spread, is_filtered, point_spread_note
from radcal.image.repeated import repeated_pixels
from radcal.image.resolution import unchecked_note

__all__ = ["speckle_notes"]


def speckle_notes(
    image_db: NDArray[np.float32],
    material: NDArray[np.uint8],
    radar: Radar,
    source: str,
    scale: str | None,
    pixel_m: tuple[float, float] | None = None,
) -> list[str]:
    """Sentences on repeated pixels, looks and point spread; each check that was not possible has its sentence, too.

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
    notes = []
    looks = estimate_looks(image_db, material, radar)
    spread = estimate_point_spread(image_db, material, radar)
    if (repeated := repeated_pixels(image_db)) is not None:
        notes.append(repeated.note(source))
        pixel_m = pixel_m or repeated.sides_m(radar)
    if looks is not None:
        notes.append(check_looks(looks, radar.looks, scale, source, is_filtered(spread, looks, radar)))
    elif scale == "complex" and radar.looks != 1:
        notes.append(f"{source}: complex pixels have a single look, radar.looks is {radar.looks}.")
    else:
        notes.append(
            f"radar.looks and the scale of {source} could not be checked by the speckle: the areas of single materials "
            "are too small for these resolutions."
        )
    if spread is None:
        notes.append(unchecked_note(radar, source))
    elif (note := point_spread_note(spread, looks, radar, source, pixel_m)) is not None:
        notes.append(note)
    return notes
