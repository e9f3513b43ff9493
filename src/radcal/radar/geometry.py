"""Acquisition geometry: all that does not depend on the backscatter laws.

Image coordinates: axis 0 is slant range (row 0 nearest), axis 1 is azimuth.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt, map_coordinates

from radcal.config import Radar
from radcal.errors import SceneError, StoreError
from radcal.files import write_hdf5
from radcal.scene.model import Scene

__all__ = [
    "Geometry",
    "laid_over",
    "local_incidence_cosine",
    "make_geometry",
    "read_geometry",
    "shadowed",
    "write_geometry",
]

# facets per pixel spacing; slopes falling away by more than about 35 degrees still leave some
# visible pixels without a facet, which then count as invisible
_FACETS_PER_PIXEL = 1.2
_SCHEMA = 2


@dataclass(frozen=True)
class Geometry:
    """Facets of the scene in the image of one pass.

    Attributes
    ----------
    shape : (int, int)
        Image size: slant-range rows, azimuth columns.
    names : tuple of str
        Material names; id k is ``names[k - 1]``.
    facet_pixel : ndarray of int32, shape (f,)
        Flat image index of each visible facet.
    facet_material : ndarray of uint8, shape (f,)
        Material id of each visible facet, sorted.
    facet_incidence_rad : ndarray of float32, shape (f,)
        Local incidence angle [rad].
    facets : ndarray of int32, shape ``shape``
        Visible facets per pixel.
    material : ndarray of uint8, shape ``shape``
        Material id where all visible facets of a pixel share one, else 0.
    incidence_deg : ndarray of float32, shape ``shape``
        Mean local incidence of the pixel's visible facets [deg], NaN where there is none.
    layover : ndarray of bool, shape ``shape``
        Whether facets of separate places, more than a pixel apart in slant range on the way
        between them, share the pixel.
    shadow : ndarray of bool, shape ``shape``
        Whether some of the pixel's facets, or all, are hidden or face away.
    ground : ndarray of float32, shape (2, rows, columns)
        Mean row and column of the pixel's visible facets in the scene's grid, cell centres at
        whole numbers; NaN where there is none, and in a slant-range scene.
    """

    shape: tuple[int, int]
    names: tuple[str, ...]
    facet_pixel: NDArray[np.int32]
    facet_material: NDArray[np.uint8]
    facet_incidence_rad: NDArray[np.float32]
    facets: NDArray[np.int32]
    material: NDArray[np.uint8]
    incidence_deg: NDArray[np.float32]
    layover: NDArray[np.bool_]
    shadow: NDArray[np.bool_]
    ground: NDArray[np.float32]

    def pixels(self, name: str, margin_px: int | NDArray[np.int64] = 0) -> NDArray[np.int64]:
        """Flat indices of the visible pixels that hold one material only.

        Parameters
        ----------
        name : str
            Material.
        margin_px : int or ndarray of int, shape ``shape``
            Pixels at most this far (in rows or columns) from a pixel of another
            material, a mixed or an invisible one, or from the image's border are left out.

        Returns
        -------
        ndarray of int64, ascending
        """
        inside = self.material == self.names.index(name) + 1
        if np.any(np.asarray(margin_px) > 0):
            # nothing is known beyond the image's border, and what lies there is missing from the
            # resolution cells along it
            padded = np.pad(inside, 1)
            distance = distance_transform_cdt(padded, metric="chessboard")[1:-1, 1:-1]
            inside = distance > margin_px
        return np.flatnonzero(inside)


def local_incidence_cosine(
    elevation_m: NDArray[np.float64], step_m: float, to_radar: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Cosine of the local incidence angle from the surface normals.

    Parameters
    ----------
    elevation_m : ndarray, shape (ny, nx)
        Elevation; axis 1 is ground range away from the track, axis 0 is azimuth [m].
    step_m : float
        Grid step [m].
    to_radar : (ndarray, ndarray), each broadcastable to (ny, nx)
        Components of the unit vector to the radar along ground range and up
        (zero Doppler: none along azimuth).

    Returns
    -------
    ndarray, shape (ny, nx)
        n . r with the unit normal n of central differences; negative when back-facing.

    References
    ----------
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE
    TGRS 34 (1996), eq. 10.
    """
    along, across = np.gradient(elevation_m, step_m)
    toward, up = to_radar
    return np.asarray((up - across * toward) / np.sqrt(1.0 + along**2 + across**2))


def shadowed(look_rad: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which facets are hidden by nearer ones: horizon scan along ground range.

    Parameters
    ----------
    look_rad : ndarray, shape (ny, nx)
        Angle from nadir at the radar; axis 1 is ground range, nearest first [rad].

    Returns
    -------
    ndarray of bool
        True where an earlier facet of the same row is seen at a larger angle.
    """
    horizon = np.maximum.accumulate(look_rad, axis=1)
    return np.asarray(look_rad < horizon)


def laid_over(slant_m: NDArray[np.float64], visible: NDArray[np.bool_], apart_m: float) -> NDArray[np.bool_]:
    """Which facets share their slant range with others that lie elsewhere.

    Parameters
    ----------
    slant_m : ndarray, shape (ny, nx)
        Slant range; axis 1 is ground range, nearest first [m].
    visible : ndarray of bool, shape (ny, nx)
        Facets that return an echo; the others count for nothing.
    apart_m : float
        By how much slant range must fall back on the way between them [m].

    Returns
    -------
    ndarray of bool, shape (ny, nx)
        True where a visible facet further out is nearer to the radar, or one before it is
        further from it: the active and the passive part of a layover (Schreier, "SAR
        Geocoding: Data and Systems" (1993), chapter 6).
    """
    nearer = np.where(visible, slant_m, -np.inf)
    further = np.where(visible, slant_m, np.inf)
    before = np.maximum.accumulate(nearer, axis=1)
    beyond = np.minimum.accumulate(further[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(visible & ((before > slant_m + apart_m) | (beyond < slant_m - apart_m)))


def make_geometry(scene: Scene, radar: Radar) -> Geometry:
    """Geometry of a scene in one pass.

    Raises
    ------
    SceneError
        The track does not clear the terrain or nothing is visible.
    """
    if scene.elevation_m is None:
        return _slant_range_geometry(scene)
    return _terrain_geometry(scene, radar)


def _slant_range_geometry(scene: Scene) -> Geometry:
    """One facet per labelled pixel, incidence by row."""
    assert scene.incidence_deg is not None  # noqa: S101 - a scene has either elevation or incidence
    shape = (scene.material.shape[0], scene.material.shape[1])
    incidence = np.broadcast_to(scene.incidence_deg[:, None], shape)
    pixel = np.flatnonzero(scene.material)
    return _assemble(shape, scene.names, pixel, scene.material.ravel()[pixel], np.radians(incidence.ravel()[pixel]))


def _terrain_geometry(scene: Scene, radar: Radar) -> Geometry:
    """Facets of the refined elevation model seen from a straight track."""
    elevation = scene.elevation_m
    assert elevation is not None  # noqa: S101 - checked by the caller
    material = scene.material
    if radar.look_side == "left":  # ground range grows westward
        elevation, material = elevation[:, ::-1], material[:, ::-1]
    step = min(radar.range_spacing_m, radar.azimuth_spacing_m) / _FACETS_PER_PIXEL
    k = max(1, int(np.ceil(scene.cell_m / step)))
    size = scene.cell_m / k
    ny, nx = elevation.shape
    # facet centres in units of cells: k x k in each cell
    along = (np.arange(ny * k) + 0.5) / k - 0.5
    across = (np.arange(nx * k) + 0.5) / k - 0.5
    fine = map_coordinates(elevation, np.meshgrid(along, across, indexing="ij"), order=3, mode="nearest")
    fine_material = np.repeat(np.repeat(material, k, axis=0), k, axis=1)

    mean = float(elevation.mean())
    height = mean + radar.altitude_m - fine
    if height.min() <= 0.0:
        raise SceneError(
            f"radar.altitude_m is {radar.altitude_m:g} m above the scene's mean, the terrain rises "
            f"{elevation.max() - mean:.0f} m: fly higher."
        )
    centre = radar.altitude_m / np.tan(np.radians(radar.depression_deg))
    ground = (np.arange(nx * k) + 0.5) * size - nx * scene.cell_m / 2 + centre
    if ground[0] <= 0.0:
        raise SceneError(
            f"radar.depression_deg {radar.depression_deg:g} at radar.altitude_m {radar.altitude_m:g} puts the track "
            "over the scene: lower the depression angle or fly higher."
        )
    slant = np.hypot(height, ground)
    cosine = local_incidence_cosine(fine, size, (-ground / slant, height / slant))
    visible = ~shadowed(np.arctan2(np.broadcast_to(ground, height.shape), height)) & (cosine > 0.0)

    # rows from the first to the last range that every azimuth line reaches: nothing of the
    # image then lies outside the scene
    first = float(slant[:, 0].max())
    last = float(slant[:, -1].min())
    rows = int((last - first) / radar.range_spacing_m)
    columns = int(ny * scene.cell_m / radar.azimuth_spacing_m)
    if rows < 8 or columns < 8:
        raise SceneError(f"the image of the scene would have {rows} x {columns} pixels: use a finer pixel spacing.")
    row = np.floor((slant - first) / radar.range_spacing_m).astype(np.int64)
    column = np.floor((np.arange(ny * k) + 0.5) * size / radar.azimuth_spacing_m).astype(np.int64)[:, None]
    inside = (row >= 0) & (row < rows) & (column < columns)
    laid = laid_over(slant, visible, radar.range_spacing_m) & inside
    pixel = row * columns + column
    hidden = pixel[inside & ~visible]
    visible &= inside
    # the scene's rows and columns, east to the right whichever way the radar looks
    north, east = np.broadcast_arrays(along[:, None], nx - 1 - across if radar.look_side == "left" else across)
    return _assemble(
        (rows, columns),
        scene.names,
        pixel[visible],
        fine_material[visible],
        np.arccos(np.minimum(cosine[visible], 1)),
        layover=pixel[laid],
        shadow=hidden,
        ground=(north[visible], east[visible]),
    )


def _assemble(
    shape: tuple[int, int],
    names: tuple[str, ...],
    pixel: NDArray[np.int64],
    material: NDArray[np.uint8],
    incidence_rad: NDArray[np.float64],
    *,
    layover: NDArray[np.int64] | None = None,
    shadow: NDArray[np.int64] | None = None,
    ground: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> Geometry:
    """Facets to pixels; ``layover``, ``shadow``: pixels of such facets; ``ground``: facets on the scene's grid."""
    if pixel.size == 0:
        raise SceneError("no part of the scene is visible to the radar.")
    n = shape[0] * shape[1]
    facets = np.bincount(pixel, minlength=n)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float32]:
        with np.errstate(invalid="ignore"):
            return np.asarray(np.bincount(pixel, values, minlength=n) / facets, dtype=np.float32).reshape(shape)

    dark, shared = np.zeros((2, *shape), dtype=np.bool_)
    if shadow is not None:
        dark.flat[shadow] = True
        dark |= (facets == 0).reshape(shape)
    if layover is not None:
        shared.flat[layover] = True
    where = np.stack([mean(g) for g in ground]) if ground else np.full((2, *shape), np.nan, dtype=np.float32)
    incidence_deg = mean(np.degrees(incidence_rad))
    # by material, then by pixel: a law is evaluated on one slice and sums are local in memory
    order = np.lexsort((pixel, material))
    pixel, material, incidence_rad = pixel[order], material[order], incidence_rad[order]
    lowest = np.full(n, 255, dtype=np.uint8)
    np.minimum.at(lowest, pixel, material)
    highest = np.zeros(n, dtype=np.uint8)
    np.maximum.at(highest, pixel, material)
    return Geometry(
        shape=shape,
        names=names,
        facet_pixel=pixel.astype(np.int32),
        facet_material=material,
        facet_incidence_rad=incidence_rad.astype(np.float32),
        facets=facets.astype(np.int32).reshape(shape),
        material=np.where(lowest == highest, highest, 0).astype(np.uint8).reshape(shape),
        incidence_deg=incidence_deg,
        layover=shared,
        shadow=dark,
        ground=where,
    )


def write_geometry(path: str | Path, geometry: Geometry) -> None:
    """Write a geometry to HDF5, atomically."""
    with write_hdf5(path) as file:
        file.attrs["schema"] = _SCHEMA
        file.attrs["shape"] = geometry.shape
        file["names"] = list(geometry.names)
        for field in fields(Geometry)[2:]:
            file.create_dataset(field.name, data=getattr(geometry, field.name), compression="gzip", compression_opts=1)


def read_geometry(path: str | Path) -> Geometry:
    """Read a geometry that :func:`write_geometry` wrote.

    Raises
    ------
    StoreError
        Another version wrote it.
    """
    with h5py.File(path, "r") as file:
        if file.attrs["schema"] != _SCHEMA:
            raise StoreError(
                f"{path}: written with schema {file.attrs['schema']}, this radcal reads {_SCHEMA}; type the same "
                "command with --forcerun geometry at its end (finished runs are kept)."
            )
        rows, columns = (int(n) for n in file.attrs["shape"])
        arrays = {field.name: file[field.name][()] for field in fields(Geometry)[2:]}
        return Geometry(shape=(rows, columns), names=tuple(file["names"].asstr()[()]), **arrays)
