"""Objects that stand in a scene: point scatterers and boxes with a radar cross-section."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.standing.cross_sections import CrossSection, towards
from radcal.storage.files import digest


@dataclass(frozen=True)
class Walls:
    """Walls of the boxes: boxes whose walls and roof scatter apart, and boxes with double bounce.

    Attributes
    ----------
    roof : ndarray of int16, shape (n,)
        Index, in ``roofs``, of the roof's material; -1 for an object with a cross-section.
    sigma0_db : ndarray of float64, shape (n,)
        sigma0 of the walls, per area of wall [dB]; NaN for an object with a cross-section.
    bounce : ndarray of bool, shape (n,)
        Whether the double bounce along the foot of the walls is added.
    roofs : tuple of str
        Names of the roofs' materials.
    permittivity : tuple of float, or None
        Relative permittivity of walls and of the ground in front of them; None for walls that reflect all.
    """

    roof: NDArray[np.int16]
    sigma0_db: NDArray[np.float64]
    bounce: NDArray[np.bool_]
    roofs: tuple[str, ...] = ()
    permittivity: tuple[float, ...] | None = None

    @classmethod
    def of(
        cls, roofs: NDArray[np.str_], sigma0_db: NDArray[np.float64], bounce: NDArray[np.float64],
        permittivity: tuple[float, ...] | None,
    ) -> Walls | None:  # fmt: skip
        """Walls from the name of each object's roof, empty without one; ``bounce`` is NaN for the default: with a roof.

        Returns
        -------
        Walls or None
            None if no object has a roof or a double bounce.
        """
        apart = roofs != ""
        added = np.where(np.isnan(bounce), apart, bounce == 1.0)
        if not (apart | added).any():
            return None
        names, roof = np.unique(roofs, return_inverse=True)  # the empty name, if there is one, comes first
        first = int(names[0] == "")
        return cls((roof - first).astype(np.int16), sigma0_db, added, tuple(map(str, names[first:])), permittivity)


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
        Radar cross-section [dB relative to 1 m2]; NaN if the cross-section depends on the aspect, or if the object's
        walls and roof scatter apart.
    aspect : ndarray of int16, shape (n,)
        Index of the object's class, first those of ``curves``, then those of ``tables``; -1 for an object without one.
    curves : mapping of str to ndarray of float64, shape (k, 2)
        Curves of cross-section by aspect, in the order of the indices in ``aspect``: each row holds an aspect [deg] and
        the cross-section [dBsm].
    tables : mapping of str to CrossSection
        Tables of cross-sections; several tables may belong to one class.
    walls : Walls or None
        Walls of the boxes; None if no box has any apart from its cross-section.
    speed_mps : ndarray of float64, shape (n,), or None
        Speed along the heading [m/s]; None if no object moves. Only the product ``gmti`` shows motion.
    """

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    length_m: NDArray[np.float64]
    width_m: NDArray[np.float64]
    heading_deg: NDArray[np.float64]
    height_m: NDArray[np.float64]
    rcs_dbsm: NDArray[np.float64]
    aspect: NDArray[np.int16]
    curves: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    tables: Mapping[str, CrossSection] = field(default_factory=dict)
    walls: Walls | None = None
    speed_mps: NDArray[np.float64] | None = None

    @classmethod
    def of(
        cls, columns: Mapping[str, NDArray[np.float64]], classes: NDArray[np.str_], roofs: NDArray[np.str_],
        tables: Mapping[str, CrossSection], permittivity: tuple[float, ...] | None,
        curves: Mapping[str, ArrayLike] | None = None,
    ) -> Objects:  # fmt: skip
        """Objects from columns of a table.

        Parameters
        ----------
        columns : mapping of str to ndarray
            Arrays of :class:`Objects` but ``aspect``, and ``wall_sigma0_db`` and ``bounce`` as for :meth:`Walls.of`.
        classes, roofs : ndarray of str, shape (n,)
            Name of each object's class, and of its roof's material; empty without one.
        tables, permittivity, curves
            As in :class:`Objects` and :class:`Walls`.
        """
        import pandas as pd

        found = {name: np.asarray(curve, dtype=np.float64) for name, curve in (curves or {}).items()}
        names = dict.fromkeys([*found, *(table.name for table in tables.values())])
        return cls(
            **{name: columns[name] for name in _ARRAYS if name in columns},
            aspect=pd.Index(list(names), dtype=object).get_indexer(pd.Index(classes)).astype(np.int16),
            curves=found,
            tables=tables,
            walls=Walls.of(roofs, columns["wall_sigma0_db"], columns["bounce"], permittivity),
        )

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Mask of the objects that move, shape (n,)."""
        return np.zeros(len(self), dtype=np.bool_) if self.speed_mps is None else np.asarray(self.speed_mps > 0.0)

    def some(self, chosen: NDArray[np.bool_]) -> Objects:
        """Objects of a mask."""
        found: Objects = _chosen(self, chosen)
        return found if self.walls is None else replace(found, walls=_chosen(self.walls, chosen))

    @property
    def extended(self) -> NDArray[np.bool_]:
        """Mask of the objects with a footprint, shape (n,)."""
        return np.asarray(self.length_m > 0.0)

    @property
    def identity(self) -> str:
        """Hash of all properties of the objects, which all affect an image."""
        described = {
            "version": 1,
            "arrays": {name: _hash(held) for name in _ARRAYS if (held := getattr(self, name)) is not None},
            "curves": [[name, np.asarray(curve).tolist()] for name, curve in self.curves.items()],
        }
        if self.tables:
            described["tables"] = [_described(one) for one in self.tables.values()]
        if self.walls is not None:
            described["walls"] = _described(self.walls)
        return digest(described)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, in the order of the indices in ``aspect``."""
        return (*self.curves, *dict.fromkeys(table.name for table in self.tables.values()))

    def cross_section_m2(
        self, bearing_deg: ArrayLike, elevation_deg: NDArray[np.float64] | None = None, band: str = "",
        polarisation: str = "",
    ) -> NDArray[np.float64]:  # fmt: skip
        """Radar cross-section of each object towards a radar.

        Parameters
        ----------
        bearing_deg : array_like
            Direction from each object to the radar, clockwise from the grid's north [deg]: one for all objects where
            the plane of zero Doppler is across a straight track.
        elevation_deg : ndarray, shape (n,), optional
            Elevation angle of the radar above the horizon of each object [deg]; only tables depend on it.
        band, polarisation : str
            Frequency band and polarisation of the pass; only tables depend on them.

        Returns
        -------
        ndarray, shape (n,)
            Cross-section [m2]. Between the aspects of a curve, the cross-section is interpolated linearly in dB, with a
            period of 360 degrees.

        Raises
        ------
        SceneError
            A class of objects has no table of the band and polarisation, or a direction lies outside of the table.

        References
        ----------
        IEEE Std 686-2017, "Radar Definitions": aspect angle, radar cross section.
        """
        dbsm, bearing = self.rcs_dbsm.copy(), np.broadcast_to(bearing_deg, len(self))
        for k, curve in enumerate(self.curves.values()):
            own = self.aspect == k
            dbsm[own] = np.interp(bearing[own] - self.heading_deg[own], curve[:, 0], curve[:, 1], period=360.0)
        elevation = np.zeros(len(self)) if elevation_deg is None else elevation_deg
        for k, name in enumerate(self.classes[len(self.curves) :], start=len(self.curves)):
            if (own := self.aspect == k).any():
                tables = [table for table in self.tables.values() if table.name == name]
                aspect = bearing[own] - self.heading_deg[own]
                dbsm[own] = towards(tables, aspect, elevation[own], band, polarisation)
        return np.asarray(10.0 ** (dbsm / 10.0))


_ARRAYS = tuple(item.name for item in fields(Objects) if item.name not in ("curves", "tables", "walls"))


def _chosen(one: Any, chosen: NDArray[np.bool_]) -> Any:
    """Dataclass with the entries of its arrays that a mask chooses."""
    arrays = {item.name: getattr(one, item.name) for item in fields(one)}
    return replace(one, **{name: held[chosen] for name, held in arrays.items() if isinstance(held, np.ndarray)})


def _hash(array: NDArray[np.generic]) -> str:
    return hashlib.sha256(array.tobytes()).hexdigest()


def _described(one: CrossSection | Walls) -> dict[str, object]:
    """Fields of a dataclass, with hashes in place of arrays."""
    values = ((item.name, getattr(one, item.name)) for item in fields(one))
    return {name: _hash(value) if isinstance(value, np.ndarray) else value for name, value in values}


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
