"""Comparison of the places of the rasters of a case with mistakes, whose image is not put on the scene's ground."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

from radcal.config import FILL_IN, expand_path
from radcal.errors import MeasurementError, NoCommonPlace, RadcalError
from radcal.image.georeference import is_georeferenced
from radcal.reading.rasters import open_raster
from radcal.scene.crs import crs_of, horizontal
from radcal.scene.grid import box_in

__all__ = ["images_elsewhere"]

Box = tuple[float, float, float, float]


def images_elsewhere(problems: Sequence[RadcalError], data: Mapping[str, Any]) -> list[MeasurementError]:
    """One error for each measured image on the map that has no common area with a raster of the scene.

    The paths are those that the case file gives, whether or not other keys are wrong or still to be decided. Bounding
    boxes are compared, in longitude and latitude, so that no image is named that shows the scene.

    Parameters
    ----------
    problems : sequence of RadcalError
        Problems of the case found so far; nothing is said if there is none, because the measured image then was put on
        the ground of the scene, or if one of them says that two rasters do not overlap.
    data : mapping
        Contents of the case file.
    """
    if not problems or any(isinstance(error.about, NoCommonPlace) for error in problems):
        return []
    scene, images = data.get("scene", {}), data.get("measurement")
    places = dict[str, Box]()
    for key in ("elevation", "materials") if isinstance(scene, dict) else ():
        if (place := _place(scene.get(key), f"scene.{key}")) is not None:
            places[f"scene.{key}: {scene[key]}"] = place
    found = []
    for image in images if isinstance(images, list) else [images]:
        path = image.get("path") if isinstance(image, dict) else None
        if (place := _place(path, "measurement.path")) is None:
            continue
        if apart := [name for name, other in places.items() if not _common(place, other)]:
            text = f"{path} lies at {_words(place)}, and {apart[0]} at {_words(places[apart[0]])}"
            found.append(MeasurementError(f"measurement.path: {text}: expected an image of the same area."))
    return found


def _place(text: Any, key: str) -> Box | None:
    """West, south, east and north bounds of a raster on the map [deg]; None for other files, and if unknown."""
    from pyproj import CRS

    if not isinstance(text, str) or text == FILL_IN:
        return None
    with contextlib.suppress(RadcalError):
        path = expand_path(text, key)
        if not is_georeferenced(path):
            return None
        with open_raster(path) as raster:
            crs, bounds = crs_of(raster), raster.bounds
        x, y = sorted((bounds.left, bounds.right)), sorted((bounds.bottom, bounds.top))
        globe = CRS.from_user_input("OGC:CRS84")
        box = None if crs is None else box_in((x[0], y[0], x[1], y[1]), horizontal(crs), globe)
        return box if box is None or box[0] < box[2] else None  # not across the date line
    return None


def _common(one: Box, other: Box) -> bool:
    """Whether two boxes have a common area or border."""
    return one[0] <= other[2] and other[0] <= one[2] and one[1] <= other[3] and other[1] <= one[3]


def _words(box: Box) -> str:
    return f"longitude {box[0]:.5g} to {box[2]:.5g}, latitude {box[1]:.5g} to {box[3]:.5g}"
