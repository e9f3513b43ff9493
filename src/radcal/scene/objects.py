"""Objects that stand in a scene: point scatterers and boxes with a radar cross-section."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.storage.files import digest

__all__ = ["Objects", "rectangles"]


@dataclass(frozen=True)
class Objects:
    """Objects of a scene; each array has one entry for each object.

    Attributes
    ----------
    x_m, y_m : ndarray of float64, shape (n,)
        Distance of the centre to the east and to the north of the scene's south-west corner [m].
    length_m, width_m : ndarray of float64, shape (n,)
        Sides of the footprint, along and across the heading [m]; both 0 for a point scatterer.
    heading_deg : ndarray of float64, shape (n,)
        Bearing of the front, clockwise from the grid's north [deg].
    height_m : ndarray of float64, shape (n,)
        Height above the ground of a box's roof or of a point scatterer [m].
    rcs_dbsm : ndarray of float64, shape (n,)
        Radar cross-section [dB relative to 1 m2]; NaN if the cross-section depends on the aspect.
    aspect : ndarray of int16, shape (n,)
        Index, in ``curves``, of the object's curve of cross-section by aspect; -1 if the cross-section is constant.
    kind : ndarray of int16, shape (n,)
        Index, in ``kinds``, of the object's kind.
    kinds : tuple of str
        Names of the kinds of objects, such as "car".
    curves : mapping of str to ndarray of float64, shape (k, 2)
        Curves of cross-section by aspect, in the order of the indices in ``aspect``: each row holds an aspect [deg] and
        the cross-section [dBsm].
    """

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    length_m: NDArray[np.float64]
    width_m: NDArray[np.float64]
    heading_deg: NDArray[np.float64]
    height_m: NDArray[np.float64]
    rcs_dbsm: NDArray[np.float64]
    aspect: NDArray[np.int16]
    kind: NDArray[np.int16]
    kinds: tuple[str, ...] = ("",)
    curves: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def extended(self) -> NDArray[np.bool_]:
        """Mask of the objects with a footprint, shape (n,)."""
        return np.asarray(self.length_m > 0.0)

    @property
    def identity(self) -> str:
        """Hash of all properties of the objects that affect an image: all except the kind."""
        arrays = {name: hashlib.sha256(getattr(self, name).tobytes()).hexdigest() for name in _ARRAYS if name != "kind"}
        curves = [[name, np.asarray(curve).tolist()] for name, curve in self.curves.items()]
        return digest({"version": 1, "arrays": arrays, "curves": curves})

    def cross_section_m2(self, bearing_deg: ArrayLike) -> NDArray[np.float64]:
        """Radar cross-section of each object towards a radar.

        Parameters
        ----------
        bearing_deg : array_like
            Direction from each object to the radar, clockwise from the grid's north [deg]: one for all objects where
            the plane of zero Doppler is across a straight track.

        Returns
        -------
        ndarray, shape (n,)
            Cross-section [m2]. Between the aspects of a curve, the cross-section is interpolated linearly in dB, with a
            period of 360 degrees.

        References
        ----------
        IEEE Std 686-2017, "Radar Definitions": aspect angle, radar cross section.
        """
        dbsm, bearing = self.rcs_dbsm.copy(), np.broadcast_to(bearing_deg, len(self))
        for k, curve in enumerate(self.curves.values()):
            own = self.aspect == k
            dbsm[own] = np.interp(bearing[own] - self.heading_deg[own], curve[:, 0], curve[:, 1], period=360.0)
        return np.asarray(10.0 ** (dbsm / 10.0))


_ARRAYS = tuple(item.name for item in fields(Objects) if item.name not in ("kinds", "curves"))


def rectangles(polygons: NDArray[Any]) -> NDArray[np.float64]:
    """Smallest rectangles around polygons.

    Parameters
    ----------
    polygons : ndarray of shapely.Geometry, shape (n,)
        Polygons with an area.

    Returns
    -------
    ndarray, shape (5, n)
        East and north coordinate of the centres, longer and shorter side, all in the unit of the coordinates, and
        bearing of one end of the longer axis, clockwise from north [deg].
    """
    import shapely

    corners = shapely.get_coordinates(shapely.oriented_envelope(polygons)).reshape(-1, 5, 2)
    centres = corners[:, :4].mean(axis=1)
    sides = np.diff(corners[:, :3], axis=1)
    size = np.linalg.norm(sides, axis=2)
    longer, every = np.argmax(size, axis=1), np.arange(len(sides))
    along = sides[every, longer]
    bearing = np.degrees(np.arctan2(along[:, 0], along[:, 1]))
    return np.stack([*centres.T, size[every, longer], size[every, 1 - longer], bearing])
