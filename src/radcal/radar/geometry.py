"""Acquisition geometry (the part of a simulated image that does not depend on backscatter laws), and its HDF5 file.

In all images, axis 0 is slant range, with the nearest row first, and axis 1 is azimuth. The radiometry is the reference
area of a pixel (beta0, sigma0, gamma0); the noise floor is in the same radiometry.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.errors import StoreError
from radcal.radar import simulator_version
from radcal.storage.dataclass_groups import put, take
from radcal.storage.records import read_hdf5, write_hdf5


@dataclass(frozen=True)
class PointScatterers:
    """Visible point scatterers of a pass, sorted by image row.

    Attributes
    ----------
    row, column : ndarray of float64, shape (n,)
        Position in the image [pixels]; pixel centres are at whole numbers.
    amplitude : ndarray of float32, shape (n,)
        Square root of the ratio of cross-section to the reference area of a pixel in the configured radiometry.
    number : ndarray of uint32, shape (n,)
        Index of the point in the scene's list of objects; it determines the phase of the point's echo.
    """

    row: NDArray[np.float64]
    column: NDArray[np.float64]
    amplitude: NDArray[np.float32]
    number: NDArray[np.uint32]

    @classmethod
    def none(cls) -> PointScatterers:
        """Empty set of point scatterers."""
        return cls(np.empty(0), np.empty(0), np.empty(0, np.float32), np.empty(0, np.uint32))


@dataclass(frozen=True)
class Frame:
    """What all strips of an image share; it depends on the whole scene.

    Attributes
    ----------
    mean_m, highest_m : float
        Mean and largest elevation [m].
    near_m, far_m : float
        Slant ranges [m] between which every azimuth line has ground.
    """

    mean_m: float
    highest_m: float
    near_m: float
    far_m: float


@dataclass(frozen=True)
class Strip:
    """Strip of azimuth columns of an image; its arrays have a halo of columns that belong to neighbouring strips.

    Attributes
    ----------
    first, last : int
        First column of the image in the strip, and the column after the last.
    left, right : int
        First column of the image in the arrays, and the column after the last.
    columns : int
        Number of columns of the whole image.
    frame : Frame or None
        Frame of the whole image; None if the strip is the whole image.
    """

    first: int
    last: int
    left: int
    right: int
    columns: int
    frame: Frame | None = None

    @classmethod
    def whole(cls, columns: int) -> Strip:
        """Whole image as a single strip."""
        return cls(0, columns, 0, columns, columns)

    def cut(self, image: NDArray[Any]) -> NDArray[Any]:
        """Columns of an array without the halo; azimuth is the last axis."""
        return image[..., self.first - self.left : self.last - self.left]

    def own(self, column: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask of the columns of the arrays [pixels] in the strip; the outer strips have those beyond the image."""
        at = np.floor(column + 0.5) + self.left
        return ((at >= self.first) | (self.first == 0)) & ((at < self.last) | (self.last == self.columns))


@dataclass(frozen=True)
class Geometry:
    """Facets of the scene, assigned to the pixels of one pass's image.

    A *cell* is the contribution of one material to one pixel. Cells are sorted by pixel, and within a pixel by
    material; the facets of a cell are consecutive.

    Attributes
    ----------
    shape : (int, int)
        Image size: slant-range rows, azimuth columns.
    names : tuple of str
        Material names; id k is ``names[k - 1]``.
    cell_start : ndarray of int32, shape (pixels + 1,)
        First cell of each pixel, by flat image index.
    cell_material : ndarray of uint8, shape (cells,)
        Material id of each cell. Objects have the id that follows the last material's id, and a sigma0 of 1.
    facet_start : ndarray of int32, shape (cells + 1,)
        First facet of each cell. A facet is listed in every pixel that it reaches.
    facet_incidence : ndarray of uint16, shape (facets,)
        Local incidence angle in units of 90 degrees / 65535.
    facet_weight : ndarray of float32, shape (facets,)
        Weight of the facet's sigma0 in the sum over facets that gives the pixel's value. For ``sigma0_local`` the
        weight is the share of the pixel's slant range that the facet covers; the weights of a pixel add up to 1, to
        more in layover, and to less beside shadow. For other radiometries the weight is the ratio of the facet's area
        in the pixel to the pixel's reference area. For an object's facet the weight is the ratio of the facet's part of
        the object's cross-section to the pixel's reference area.
    material : ndarray of uint8, shape ``shape``
        Material id of a pixel if all its visible facets have this material, else 0. Pixels with a part of a box, or in
        the main lobe of a point scatterer, have the id 0, too.
    incidence_deg : ndarray of float32, shape ``shape``
        Mean local incidence angle over the pixel's visible ground [deg]; NaN for a pixel without visible ground.
    layover : ndarray of bool, shape ``shape``
        Whether the pixel contains a facet in layover: another visible facet is further away along ground range, but
        nearer in slant range by more than a pixel, or the reverse.
    shadow : ndarray of bool, shape ``shape``
        Whether at least a part of the pixel's ground is in shadow or faces away from the radar.
    flat_incidence_deg : ndarray of float64, shape (rows,)
        Incidence on flat ground at each row's slant range [deg].
    earth_radius_m : float or None
        Radius of the curved earth under the scene [m]; None for a flat earth.
    ground : ndarray of float32, shape (2, rows, columns)
        Mean row and column, in the scene's grid, of the pixel's visible facets; cell centres are at whole numbers. NaN
        for a pixel without visible facets, and in a slant-range scene.
    point_row, point_column : ndarray of float64, shape (points,)
        Position of the visible point scatterers in the image [pixels], sorted by row; pixel centres are at whole
        numbers.
    point_amplitude : ndarray of float32, shape (points,)
        Square root of the ratio of cross-section to the pixel's reference area.
    point_number : ndarray of uint32, shape (points,)
        Index of the point in the scene's list of objects.
    strip : Strip or None
        Position in the whole image, for the geometry of a strip with its halo.
    bounces : ndarray of float64, shape (3, bounces)
        Of each box with a double bounce in the image: index in the scene's list of objects, material id of the ground
        in front of the wall, and incidence at which the law of the ground is used, in whole degrees [deg]. A box whose
        walls differ in the last two has several columns.
    """

    shape: tuple[int, int]
    names: tuple[str, ...]
    cell_start: NDArray[np.int32]
    cell_material: NDArray[np.uint8]
    facet_start: NDArray[np.int32]
    facet_incidence: NDArray[np.uint16]
    facet_weight: NDArray[np.float32]
    material: NDArray[np.uint8]
    incidence_deg: NDArray[np.float32]
    layover: NDArray[np.bool_]
    shadow: NDArray[np.bool_]
    flat_incidence_deg: NDArray[np.float64]
    ground: NDArray[np.float32]
    earth_radius_m: float | None = None
    point_row: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    point_column: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    point_amplitude: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, dtype=np.float32))
    point_number: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, dtype=np.uint32))
    strip: Strip | None = None
    bounces: NDArray[np.float64] = field(default_factory=lambda: np.empty((3, 0)))

    @property
    def points(self) -> PointScatterers:
        """Visible point scatterers."""
        return PointScatterers(self.point_row, self.point_column, self.point_amplitude, self.point_number)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Mask of the pixels that at least one visible facet reaches, shape ``shape``."""
        return np.asarray(np.diff(self.cell_start).reshape(self.shape) > 0)

    def pixels(self, name: str, margin_px: int | NDArray[np.int64] = 0) -> NDArray[np.int64]:
        """Flat indices of the visible pixels that contain the given material alone.

        Parameters
        ----------
        name : str
            Name of the material.
        margin_px : int or ndarray of int, shape ``shape``
            Width of the margin [pixels], counted in rows or columns. A pixel is left out if the image's border, or a
            pixel that is mixed, invisible or of another material, lies within the margin around this pixel.

        Returns
        -------
        ndarray of int64
            Indices in ascending order.
        """
        inside = self.material == self.names.index(name) + 1
        if np.any(np.asarray(margin_px) > 0):
            # the scene is not simulated beyond the image's border, so that resolution cells at the border are
            # incomplete
            padded = np.pad(inside, 1)
            distance = scipy.ndimage.distance_transform_cdt(padded, metric="chessboard")[1:-1, 1:-1]
            inside = distance > margin_px
        return np.flatnonzero(inside)


def joined(strips: Sequence[Geometry]) -> Geometry:
    """Geometry of a whole image from the geometries of all its strips, in their order.

    Raises
    ------
    StoreError
        The strips do not follow each other, or are of different images.
    """
    pairs = [(one, one.strip) for one in strips if one.strip is not None]
    borders = [0, *(strip.last for _, strip in pairs)]
    same_image = len({(strip.columns, strip.frame) for _, strip in pairs}) == 1 and pairs[-1][1].columns == borders[-1]
    if not same_image or [strip.first for _, strip in pairs] != borders[:-1]:
        raise StoreError("the strips of the image do not belong together; delete them to have them made again.")
    rows = strips[0].shape[0]
    counts = [strip.cut(np.diff(one.cell_start).reshape(one.shape)) for one, strip in pairs]
    # the cells and facets of each strip in each row, in the order of the image
    cells = [
        (one, *one.cell_start[row * one.shape[1] + np.array([strip.first, strip.last]) - strip.left])
        for row in range(rows)
        for one, strip in pairs
    ]
    facets = [(one, *one.facet_start[[first, last]]) for one, first, last in cells]
    sizes = np.concatenate([np.diff(one.facet_start[first : last + 1]) for one, first, last in cells])
    fields: dict[str, Any] = {}
    for name in ("material", "incidence_deg", "layover", "shadow", "ground"):
        fields[name] = np.concatenate([strip.cut(getattr(one, name)) for one, strip in pairs], axis=-1)
    for name, parts in (("cell_material", cells), ("facet_incidence", facets), ("facet_weight", facets)):
        fields[name] = np.concatenate([getattr(one, name)[first:last] for one, first, last in parts])
    own = np.concatenate([strip.own(one.point_column) for one, strip in pairs])
    for name in ("point_row", "point_amplitude", "point_number"):
        fields[name] = np.concatenate([getattr(one, name) for one, _ in pairs])[own]
    fields["point_column"] = np.concatenate([one.point_column + strip.left for one, strip in pairs])[own]
    order = np.lexsort((fields["point_number"], fields["point_row"]))
    fields |= {name: values[order] for name, values in fields.items() if name.startswith("point_")}
    fields["bounces"] = np.unique(np.concatenate([one.bounces for one in strips], axis=1), axis=1)
    return replace(
        strips[0],
        shape=(rows, borders[-1]),
        cell_start=starts(np.hstack(counts)),
        facet_start=starts(sizes),
        strip=None,
        **fields,
    )


def starts(sizes: NDArray[Any]) -> NDArray[np.int32]:
    """Index of the first item of each group of items, and the number of all items, from the sizes of the groups."""
    found = np.zeros(sizes.size + 1, dtype=np.int32)
    np.cumsum(sizes, out=found[1:])
    return found


def write_geometry(path: str | Path, geometry: Geometry, radar: Radar, immaterial: Iterable[str] = ()) -> None:
    """Write a geometry to an HDF5 file, atomically.

    Parameters
    ----------
    path : path
        The file.
    geometry : Geometry
        Geometry to write.
    radar : Radar
        Pass, whose description is stored in the file.
    immaterial : iterable of str, optional
        Keys of the pass that affect neither the geometry nor any run. If only the values of immaterial keys have
        changed, the file stays the same.
    """
    with write_hdf5(path, "geometry") as file:
        file.attrs["pass"] = _recorded_pass(Path(path), _described(radar), set(immaterial))
        file.attrs["simulator"] = simulator_version(radar.earth)
        put(file, geometry)


def is_of_pass(path: str | Path, radar: Radar, immaterial: Iterable[str]) -> bool:
    """Whether the geometry in a file is of the given pass, apart from the values of immaterial keys.

    Parameters
    ----------
    path : path
        File that :func:`write_geometry` wrote.
    radar : Radar
        Pass.
    immaterial : iterable of str, optional
        The same as for :func:`write_geometry`.
    """
    ours = _described(radar)
    with h5py.File(path, "r", locking=False) as file:
        return bool(file.attrs.get("pass") == _recorded_pass(Path(path), ours, set(immaterial)))


def _described(radar: Radar) -> str:
    """Description of a pass, as a file of its geometry stores it."""
    return json.dumps(radar.described(), separators=(",", ":"), ensure_ascii=False)


def _recorded_pass(path: Path, ours: str, immaterial: Container[str]) -> str:
    """Description of the pass in an existing file if it equals ``ours`` except for immaterial keys; else ``ours``."""

    def material(text: str) -> dict[str, Any]:
        return {key: value for key, value in json.loads(text).items() if key not in immaterial}

    # a file that cannot be read is replaced
    with contextlib.suppress(OSError, KeyError, ValueError), h5py.File(path, "r", locking=False) as file:
        theirs = str(file.attrs["pass"])
        if material(theirs) == material(ours):
            return theirs
    return ours


def read_geometry(path: str | Path) -> Geometry:
    """Read a geometry that :func:`write_geometry` wrote; :func:`.read_hdf5` describes the errors."""
    with read_hdf5(path, "geometry") as file:
        return take(file, Geometry)
