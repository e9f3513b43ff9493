"""Measured images from Sentinel-1 ground-range products (GRD), calibrated by the tables of the product.

The pixel value is sigma0 = DN^2 / A^2, where DN is the digital number and A the value of the table ``sigmaNought``.
Thermal noise, which is eta / A^2 with eta from the noise tables, is not subtracted, because the simulated image
contains noise, too. Subtraction would also give negative pixels, which have no value in dB.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.acquisition import Acquisition, contradictions, differences
from radcal.image.readers import image_file
from radcal.radar.geometry import Geometry
from radcal.reading.arrays import raster_band
from radcal.reading.images import reading
from radcal.reading.rasters import open_raster
from radcal.scene.model import Scene
from radcal.sentinel1.overpass import overpass_of
from radcal.sentinel1.product import Product
from radcal.words import sentence

__all__ = ["sigma0_image"]

Array = NDArray[np.float64]

_SLOPES = 250_000  # number of slopes of a scene from which a quantile is taken


def sigma0_image(
    product: Product, config: FileMeasurement, radar: Radar, geometry: Geometry, scene: Scene | None
) -> tuple[Array, Acquisition, tuple[Finding, ...]]:
    """Image of sigma0 on the pixel grid of the scene's image, from the nearest pixels of a product.

    Parameters
    ----------
    product : Product
        Opened product.
    config : FileMeasurement
        Configuration of the image.
    radar : Radar
        Configured pass, which is compared with the acquisition of the product.
    geometry : Geometry
        Geometry of the scene's image.
    scene : Scene or None
        Scene of the geometry.

    Returns
    -------
    power : ndarray, shape (rows, columns)
        sigma0 with thermal noise, in linear units; NaN where the product has no data.
    acquisition : Acquisition
        Acquisition at the scene.
    findings : tuple of Finding
        Acquisition, calibration and noise of the image.

    Raises
    ------
    MeasurementError
        The product contradicts section ``radar``, does not show the scene, or its pixels are blank.
    """
    if scene is None:
        raise MeasurementError(f"measurement.path: {product.path} needs a scene on the map.")
    seen = overpass_of(product, scene, geometry.ground)
    flat = np.broadcast_to(geometry.flat_incidence_deg[:, None], geometry.shape)[np.isfinite(seen.line)]
    if wrong := contradictions(seen.acquisition, radar, flat, _steep_deg(scene)):
        raise MeasurementError(f"measurement.path: {product.name} contradicts section radar: {'; '.join(wrong)}.")
    there = np.isfinite(seen.line)
    # nearest pixels: a mean of neighbours would have less speckle
    line, pixel = (np.round(part[there]).astype(np.int64) for part in (seen.line, seen.pixel))
    digital = _digital_numbers(product, config, line, pixel)
    data = digital[np.isfinite(digital) & (digital > 0)]
    if data.size == 0 or (data.size > 1 and data.min() == data.max()):
        held = "no data (digital number 0)" if data.size == 0 else f"the digital number {data.min():g} alone"
        raise MeasurementError(
            f"measurement.path: {product.pixels} holds {held} over the scene: the image is blank, and only its "
            f"annotation could be read ({sentence(seen.acquisition.finding()).removesuffix('.')})."
        )
    divisor = product.calibration.at(line.astype(np.float64), pixel.astype(np.float64))
    power = np.full(geometry.shape, np.nan)
    power[there] = np.where(digital > 0, (digital / divisor) ** 2, np.nan)  # DN 0 marks pixels without data
    noise = "noise_subtracted" if seen.acquisition.noise_removed else "noise_kept"
    findings = (
        seen.acquisition.finding(),
        Finding("levels_sentinel1", "note", product.name),
        Finding(noise, "note", product.name),
        *seen.findings,
        *differences(seen.acquisition, radar),
    )
    return power, seen.acquisition, findings


def _steep_deg(scene: Scene) -> float:
    """Slope that 95 % of the scene's ground does not exceed [deg]."""
    if scene.elevation_m is None or min(scene.elevation_m.shape) < 2:
        return 0.0
    height = scene.elevation_m
    # of a large scene every k-th cell is enough
    k = max(1, round((height.size / _SLOPES) ** 0.5))
    here = height[:-1:k, :-1:k]
    rise = np.hypot(height[1::k, :-1:k] - here, height[:-1:k, 1::k] - here)
    known = rise[np.isfinite(rise)]
    return float(np.degrees(np.arctan(np.quantile(known, 0.95) / scene.cell_m))) if known.size else 0.0


def _digital_numbers(
    product: Product, config: FileMeasurement, line: NDArray[np.int64], pixel: NDArray[np.int64]
) -> Array:
    """Digital numbers at positions of the image; only the rectangle around them is read."""
    from rasterio.windows import Window

    file = image_file(product.pixels, config)
    window = Window(int(pixel.min()), int(line.min()), int(np.ptp(pixel)) + 1, int(np.ptp(line)) + 1)
    with reading(file, "the image of a Sentinel-1 product"), open_raster(product.pixels) as raster:
        if raster.shape != product.annotation.ground.shape:
            raise ValueError(
                f"it has {raster.shape[0]} x {raster.shape[1]} pixels, its annotation "
                f"{product.annotation.ground.shape[0]} x {product.annotation.ground.shape[1]}"
            )
        values = raster_band(raster, file, window)
    return np.asarray(values[line - window.row_off, pixel - window.col_off], dtype=np.float64)
