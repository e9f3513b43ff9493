"""Positions of a scene's pixels in a Sentinel-1 product, and acquisition of the product at the scene."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.acquisition import Acquisition
from radcal.image.georeference import places_on_ground
from radcal.scene.crs import geoid_m
from radcal.scene.model import Scene
from radcal.sentinel1.product import Product, open_product
from radcal.sentinel1.safe import SafeRefused, safe_images

__all__ = ["Overpass", "overpass_of", "overpass_unchecked"]

Array = NDArray[np.float64]

_LIGHT_M_S = 299_792_458.0
_NOISE_ROWS = 9
_SIDE = 50  # rows and columns of the coarse grid
# equivalent number of looks, mean of all swaths: documentation of S1_NRB, after the Sentinel-1 Product Definition
_EQUIVALENT_LOOKS = {("IW", (5, 1)): 4.4}


@dataclass(frozen=True)
class Overpass:
    """Positions of the pixels of a scene's image in a product, and acquisition of the product at the scene.

    Attributes
    ----------
    line, pixel : ndarray, shape (rows, columns)
        Position, in the product, of each pixel of the scene's image; NaN for pixels that the product does not show.
    acquisition : Acquisition
        Acquisition at the middle of the scene.
    findings : tuple of Finding
        Finding on the heights if the height of the geoid is unknown; else empty.
    """

    line: Array
    pixel: Array
    acquisition: Acquisition
    findings: tuple[Finding, ...]


def overpass_of(product: Product, scene: Scene, ground: NDArray[np.float32]) -> Overpass:
    """Positions of a scene's pixels in a product, and acquisition of the product at the scene.

    Parameters
    ----------
    product : Product
        Opened product.
    scene : Scene
        Scene with a CRS and map coordinates.
    ground : ndarray, shape (2, rows, columns)
        Scene row and column that each pixel of the scene's image shows, NaN where a pixel shows no ground.

    Raises
    ------
    MeasurementError
        The scene has no map coordinates, or the product does not show the scene.
    """
    from pyproj import CRS

    if scene.crs is None or scene.transform is None or scene.elevation_m is None:
        raise MeasurementError(
            f"measurement.path: {product.path} is an image in ground range, whose pixels are found by their place on "
            "the map: expected scene.source: raster."
        )
    shown = np.isfinite(ground).all(axis=0)
    longitude, latitude = places_on_ground(scene.crs, scene.transform, ground, CRS.from_epsg(4326))
    height, findings = _heights(
        scene, ground[:, shown], float(np.median(longitude)), float(np.median(latitude)), product
    )
    at_line, at_pixel = product.annotation.ground.positions(longitude, latitude, height)
    if not np.isfinite(at_line).any():
        raise MeasurementError(
            f"measurement.path: {product.path} covers no place of the scene's image, which lies around "
            f"{np.median(latitude):.4f} degrees north, {np.median(longitude):.4f} degrees east: expected an image of "
            "the same area.",
        )
    line, pixel = np.full(shown.shape, np.nan), np.full(shown.shape, np.nan)
    line[shown], pixel[shown] = at_line, at_pixel
    found = np.isfinite(at_line)
    middle = np.array([np.median(part[found]) for part in (longitude, latitude, height)])[:, None]
    return Overpass(line, pixel, _acquisition(product, middle, at_line[found], at_pixel[found]), findings)


def overpass_unchecked(path: Path, config: FileMeasurement, radar: Radar, scene: Scene) -> Overpass:
    """Positions of a coarse grid of a scene in a product, and acquisition there, without a comparison with ``radar``.

    Parameters
    ----------
    path : path
        SAFE folder or its manifest.
    config : FileMeasurement
        Configuration of the image.
    radar : Radar
        Pass, of which only the polarisation is used; if the product lacks it, the first polarisation of the product is
        used.
    scene : Scene
        Scene with a CRS and map coordinates.

    Raises
    ------
    MeasurementError
        The product is damaged or does not show the scene.
    """
    with contextlib.suppress(SafeRefused):
        whole = [image.polarisation for image in safe_images(path) if all(file.is_file() for file in image.files)]
        if whole and radar.polarisation not in whole:
            radar = radar.model_copy(update={"polarisation": whole[0]})
    rows, columns = (np.linspace(0.0, length - 1.0, min(length, _SIDE)) for length in scene.material.shape)
    ground = np.stack(np.meshgrid(rows, columns, indexing="ij")).astype(np.float32)
    return overpass_of(open_product(path, config, radar), scene, ground)


def _heights(
    scene: Scene, ground: NDArray[np.float32], longitude: float, latitude: float, product: Product
) -> tuple[Array, tuple[Finding, ...]]:
    """Heights of places in the scene above the ellipsoid [m], and a finding if the height of the geoid is unknown."""
    from scipy.ndimage import map_coordinates

    height = map_coordinates(scene.elevation_m, ground.astype(np.float64), order=1, mode="nearest")
    geoid = geoid_m(scene.vertical_datum or "", longitude, latitude)
    if geoid is not None:
        return np.asarray(height + geoid), ()
    look = product.annotation.ground.look(*(np.array([value]) for value in (longitude, latitude, 0.0)))
    metres = 1.0 / np.tan(np.radians(look.incidence_deg[0]))
    numbers: dict[str, float | str] = {"datum": str(scene.vertical_datum), "m_per_m": float(metres)}
    return np.asarray(height), (Finding("geoid_unknown", "note", product.name, numbers),)


def _acquisition(product: Product, middle: Array, line: Array, pixel: Array) -> Acquisition:
    """Acquisition at ``middle``: longitude, latitude and height of the scene's middle, each of shape (1,)."""
    of = product.annotation
    look = of.ground.look(*middle)
    at_line, at_pixel = float(np.median(line)), float(np.median(pixel))
    swath = next((one for one in of.swaths if one.shows(at_line, at_pixel)), of.swaths[0])
    numbers = (swath.range.looks, swath.azimuth.looks)
    return Acquisition(
        product=product.name,
        sensor=f"{of.mission} {of.mode} {of.product_type}",
        start=of.start,
        pass_direction=of.pass_direction,
        platform_heading_deg=of.platform_heading_deg,
        heading_deg=float(look.heading_deg[0]),
        look_side="right" if look.right[0] else "left",
        incidence_deg=float(look.incidence_deg[0]),
        altitude_m=float(look.altitude_m[0]),
        frequency_hz=of.frequency_hz,
        polarisation=of.polarisation,
        looks=_EQUIVALENT_LOOKS.get((of.mode, numbers), float(numbers[0] * numbers[1])),
        numbers_of_looks=numbers,
        range_spacing_m=of.ground.range_spacing_m,
        azimuth_spacing_m=of.azimuth_spacing_m,
        range_resolution_m=0.5 * _LIGHT_M_S / swath.range.bandwidth_hz * _width(swath.range.window),
        azimuth_resolution_m=of.azimuth_spacing_m
        / of.ground.line_s
        / swath.azimuth.bandwidth_hz
        * _width(swath.azimuth.window),
        nesz_db=_noise_over_incidence(product, at_line, float(pixel.min()), float(pixel.max()), at_pixel, middle),
        noise_removed=of.noise_removed,
    )


def _noise_over_incidence(
    product: Product, line: float, near: float, far: float, at: float, middle: Array
) -> tuple[tuple[float, float], ...]:
    """Pairs of incidence angle [deg] and noise-equivalent sigma0 [dB] on one line of a product, across the scene."""
    columns = product.annotation.ground.shape[1]
    # radar.nesz_db needs two angles that differ after rounding to two decimals: the margin of 100 pixels ensures this
    pixel = np.linspace(max(near - 100.0, 0.0), min(far + 100.0, columns - 1.0), _NOISE_ROWS)
    place = np.full(pixel.shape, line)
    level = 10.0 * np.log10(product.noise.at(place, pixel) / product.calibration.at(place, pixel) ** 2)
    grid = product.annotation.grid
    row = grid[grid[:, 0] == grid[np.argmin(np.abs(grid[:, 0] - line)), 0]]
    look = product.annotation.ground.look(row[:, 2], row[:, 3], row[:, 4])
    angle = np.interp(pixel, row[:, 1], look.incidence_deg)
    own = float(product.annotation.ground.look(*middle).incidence_deg[0])
    angle += own - float(np.interp(at, row[:, 1], look.incidence_deg))  # at the scene's height instead of the grid's
    keep = np.concatenate([[True], np.diff(np.round(angle, 2)) > 0])
    return tuple((round(float(a), 2), round(float(b), 2)) for a, b in zip(angle[keep], level[keep], strict=True))


def _width(a: float) -> float:
    """-3 dB width of a look's impulse response, in units of the inverse of the look's bandwidth.

    A look of bandwidth B with the spectral window a + (1 - a) cos(2 pi f / B) has, with x in units of 1 / B, the
    impulse response a sinc(x) + (1 - a) / 2 (sinc(x - 1) + sinc(x + 1)).
    """
    from scipy.optimize import brentq

    def response(x: float) -> float:
        return float(a * np.sinc(x) + 0.5 * (1.0 - a) * (np.sinc(x - 1.0) + np.sinc(x + 1.0)))

    return 2.0 * float(brentq(lambda x: response(x) - response(0.0) / np.sqrt(2.0), 1e-6, 1.0))
