"""Objects that stand in a scene: point scatterers and boxes with a radar cross-section.

Random trees, cars and buildings are generated for tests and benchmarks.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import SceneError
from radcal.standing.cross_sections import CrossSection, towards
from radcal.storage.files import digest

Range = tuple[float, float]


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


@dataclass(frozen=True)
class Kind:
    """Sizes and cross-section of a kind of object; the sizes of each object are drawn from uniform distributions.

    Attributes
    ----------
    length_m, width_m, height_m : (float, float)
        Smallest and largest length, width and height [m].
    rcs_db_per_m2 : float
        Mean radar cross-section per square metre of the footprint [dB].
    spread_db : float
        Standard deviation of the cross-section between objects [dB].
    """

    length_m: Range
    width_m: Range
    height_m: Range
    rcs_db_per_m2: float
    spread_db: float


# round crowns, with a cross-section of the order of a forest's sigma0 at X band
TREE = Kind((3.0, 9.0), (3.0, 9.0), (4.0, 20.0), -6.0, 3.0)
# about 100 m2 for a footprint of 8 m2, as textbooks of radar give it (Skolnik, "Introduction to Radar Systems")
CAR = Kind((3.8, 5.0), (1.7, 1.95), (1.4, 1.9), 11.0, 5.0)
# the cross-section of a building depends on its walls and corners, and has no typical value; the value here exceeds
# that of the ground
BUILDING = Kind((8.0, 24.0), (7.0, 14.0), (3.0, 15.0), 3.0, 4.0)


def generate_objects(
    size_m: tuple[float, float], seed: int, *, trees: int = 0, cars: int = 0, buildings: int = 0
) -> Objects:
    """Random buildings, trees and cars, spread evenly over a scene; the same seed gives the same objects.

    Buildings do not overlap each other; the centres of trees and cars are outside buildings.

    Parameters
    ----------
    size_m : (float, float)
        East and north extent of the scene [m].
    seed : int
        Seed of all random numbers; each kind of object has its own random stream.
    trees, cars, buildings : int
        Number of objects of each kind.

    Returns
    -------
    Objects
        Objects in the order buildings, trees, cars.

    Raises
    ------
    SceneError
        The scene has no space for the buildings, or the buildings leave no space for trees and cars.
    """
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)]
    plot = float(np.hypot(BUILDING.length_m[1], BUILDING.width_m[1]))  # a plot is large enough for any building
    plots = (int(size_m[0] / plot), int(size_m[1] / plot))
    if buildings > plots[0] * plots[1]:
        raise SceneError(
            f"scene.objects.generate.buildings is {buildings}, expected at most {plots[0] * plots[1]}: one for each "
            f"{plot:.0f} m x {plot:.0f} m."
        )
    rng = streams[0]
    taken = np.sort(rng.choice(plots[0] * plots[1], buildings, replace=False)) if buildings else np.zeros(0, np.int64)
    houses = _sizes(BUILDING, buildings, rng, round_=False)
    room = 0.5 * (plot - np.hypot(houses["length_m"], houses["width_m"]))
    houses["x_m"] = (taken % max(plots[0], 1) + 0.5) * plot + room * rng.uniform(-1.0, 1.0, buildings)
    houses["y_m"] = (taken // max(plots[0], 1) + 0.5) * plot + room * rng.uniform(-1.0, 1.0, buildings)
    owner = np.full(plots[0] * plots[1] + 1, -1, dtype=np.int64)
    owner[taken] = np.arange(buildings)
    parts = [houses]
    for kind, count, rng, round_ in ((TREE, trees, streams[1], True), (CAR, cars, streams[2], False)):
        part = _sizes(kind, count, rng, round_)
        part["x_m"], part["y_m"] = _outside(count, size_m, rng, houses, owner, plot, plots)
        parts.append(part)
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in houses}
    return Objects(**columns, aspect=np.full(buildings + trees + cars, -1, dtype=np.int16))


def _sizes(kind: Kind, count: int, rng: np.random.Generator, round_: bool) -> dict[str, NDArray[np.float64]]:
    """Sizes, headings and cross-sections of objects of one kind; a round object (tree crown) is as wide as long."""
    length, width, height = (rng.uniform(*span, count) for span in (kind.length_m, kind.width_m, kind.height_m))
    width = length if round_ else np.minimum(width, length)
    spread = kind.spread_db * rng.standard_normal(count)
    return {
        "length_m": length,
        "width_m": width,
        "heading_deg": rng.uniform(0.0, 360.0, count),
        "height_m": height,
        "rcs_dbsm": 10.0 * np.log10(length * width) + kind.rcs_db_per_m2 + spread,
    }


def _outside(
    count: int, size_m: tuple[float, float], rng: np.random.Generator, houses: dict[str, NDArray[np.float64]],
    owner: NDArray[np.int64], plot: float, plots: tuple[int, int],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Random coordinates [m] of ``count`` places outside all buildings; each building stands on its own plot."""
    x, y = rng.uniform(0.0, size_m[0], count), rng.uniform(0.0, size_m[1], count)
    left = np.arange(count) if len(houses["x_m"]) else np.zeros(0, dtype=np.int64)
    for _ in range(100):
        if not left.size:
            return x, y
        column, row = (x[left] / plot).astype(np.int64), (y[left] / plot).astype(np.int64)
        inside = (column < plots[0]) & (row < plots[1])
        house = owner[np.where(inside, row * plots[0] + column, -1)]
        bearing = np.radians(houses["heading_deg"][house])
        east, north = x[left] - houses["x_m"][house], y[left] - houses["y_m"][house]
        along = np.abs(east * np.sin(bearing) + north * np.cos(bearing))
        across = np.abs(east * np.cos(bearing) - north * np.sin(bearing))
        within = (along < houses["length_m"][house] / 2) & (across < houses["width_m"][house] / 2)
        left = left[(house >= 0) & within]
        x[left], y[left] = rng.uniform(0.0, size_m[0], left.size), rng.uniform(0.0, size_m[1], left.size)
    raise SceneError("scene.objects.generate: the buildings leave no room for trees and cars, expected fewer of them.")
