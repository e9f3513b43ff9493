"""Measured images from Sentinel-1 ground-range products (GRD), calibrated by the tables of the product.

The pixel value is sigma0 = DN^2 / A^2, where DN is the digital number and A the value of the table ``sigmaNought``.
Thermal noise, which is eta / A^2 with eta from the noise tables, is not subtracted, because the simulated image
contains noise, too. Subtraction would also give negative pixels, which have no value in dB.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.acquisition import contradictions, differences
from radcal.image.base import Facts, Grid, Reader, ReadImage, image_file
from radcal.reading.arrays import raster_band
from radcal.reading.images import reading
from radcal.reading.products import NamedProduct
from radcal.reading.rasters import open_raster
from radcal.sentinel1.overpass import Overpass, Product, open_product, overpass_of, overpass_unchecked
from radcal.sentinel1.safe import MANIFEST, chosen_image, safe_folder, safe_images
from radcal.words import sentence

if TYPE_CHECKING:
    from radcal.scene.model import Scene

Array = NDArray[np.float64]

_SLOPES = 250_000  # number of slopes of a scene from which a quantile is taken


class Sentinel1Reader(Reader):
    """Reader of a SAFE folder: sigma0 with thermal noise, from the nearest pixels of the product."""

    called = "a Sentinel-1 product"
    folder = True
    gives_acquisition = True

    @classmethod
    def matches(cls, path: Path) -> bool:
        """Whether a path names a SAFE folder or its manifest; its ending decides."""
        return path.name.lower().endswith(".safe")

    @classmethod
    def named(cls, path: str) -> NamedProduct:
        """Scale and radiometry: the digital numbers are amplitudes, and their calibration holds for level ground."""
        del path
        return NamedProduct(cls.called, "amplitude", "sigma0_ref", None)

    @classmethod
    def files(cls, path: Path, polarisation: str, folders: Sequence[Path]) -> list[Path]:
        """Manifest, and the files of one polarisation."""
        del folders
        return [safe_folder(path) / MANIFEST, *chosen_image(safe_images(path), polarisation).files]

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self._product.name

    @cached_property
    def _product(self) -> Product:
        return open_product(self.path, self.config, self.radar)

    def facts(self, scene: Scene | None = None) -> Facts:
        """Radiometry, and with a scene the acquisition; ``radar`` may have a polarisation that the product lacks."""
        if scene is None:
            return Facts(radiometry="sigma0_ref", on_map=True)
        seen = overpass_unchecked(self.path, self.config, self.radar, scene)
        found = self._findings(seen)
        return Facts(radiometry="sigma0_ref", on_map=True, acquisition=seen.acquisition, findings=found)

    def _findings(self, seen: Overpass) -> tuple[Finding, ...]:
        return (seen.acquisition.finding(), *seen.findings, *differences(seen.acquisition, self.radar))

    def read(self, grid: Grid) -> ReadImage:
        """Image of sigma0 with thermal noise; NaN where the product has no data.

        Raises
        ------
        MeasurementError
            The product contradicts section ``radar``, does not show the scene, or its pixels are blank.
        """
        product, geometry, scene = self._product, grid.geometry, grid.scene
        if scene is None:
            raise MeasurementError(f"measurement.path: {product.path} needs a scene on the map.")
        seen = overpass_of(product, scene, geometry.ground)
        there = np.isfinite(seen.line)
        flat = np.broadcast_to(geometry.flat_incidence_deg[:, None], grid.shape)[there]
        if wrong := contradictions(seen.acquisition, self.radar, flat, _steep_deg(scene)):
            raise MeasurementError(f"measurement.path: {product.name} contradicts section radar: {'; '.join(wrong)}.")
        # nearest pixels: a mean of neighbours would have less speckle
        line, pixel = (np.round(part[there]).astype(np.int64) for part in (seen.line, seen.pixel))
        digital = self._digital_numbers(line, pixel)
        data = digital[np.isfinite(digital) & (digital > 0)]
        if data.size == 0 or (data.size > 1 and data.min() == data.max()):
            held = "no data (digital number 0)" if data.size == 0 else f"the digital number {data.min():g} alone"
            raise MeasurementError(
                f"measurement.path: {product.pixels} holds {held} over the scene: the image is blank, and only its "
                f"annotation could be read ({sentence(seen.acquisition.finding()).removesuffix('.')})."
            )
        divisor = product.calibration.at(line.astype(np.float64), pixel.astype(np.float64))
        power = np.full(grid.shape, np.nan)
        power[there] = np.where(digital > 0, (digital / divisor) ** 2, np.nan)  # DN 0 marks pixels without data
        findings = self._findings(seen)
        if seen.acquisition.noise_removed:
            findings = (*findings, Finding("noise_subtracted", "note", product.name))
        return ReadImage(*self.in_db(power, "power", grid.shape), findings, resampled=True)

    def _digital_numbers(self, line: NDArray[np.int64], pixel: NDArray[np.int64]) -> Array:
        """Digital numbers at positions of the image; only the rectangle around them is read."""
        from rasterio.windows import Window

        product = self._product
        file = image_file(product.pixels, self.config)
        window = Window(int(pixel.min()), int(line.min()), int(np.ptp(pixel)) + 1, int(np.ptp(line)) + 1)
        with reading(file, "the image of a Sentinel-1 product"), open_raster(product.pixels) as raster:
            if raster.shape != product.annotation.ground.shape:
                raise ValueError(
                    f"it has {raster.shape[0]} x {raster.shape[1]} pixels, its annotation "
                    f"{product.annotation.ground.shape[0]} x {product.annotation.ground.shape[1]}"
                )
            values = raster_band(raster, file, window)
        return np.asarray(values[line - window.row_off, pixel - window.col_off], dtype=np.float64)


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
