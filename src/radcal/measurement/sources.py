"""Measurement from its configured source, a file or a synthetic image, checked against the scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from radcal import skewnormal
from radcal.bands import LETTER_BANDS_GHZ, letter_band, within_band
from radcal.config import FileMeasurement, Radar, TargetConfig, expand_path, stages
from radcal.errors import FitError, MeasurementError, MissingSign
from radcal.findings import Finding
from radcal.ground.pixels import IN_THE_NOISE, eligible_pixels, noise_limited
from radcal.image.georeference import (
    check_spacing,
    map_pixel_m,
    places_on_ground,
    read_georeferenced,
    values_at_ground,
)
from radcal.image.header import Header, header_of
from radcal.image.model import Measurement, ReadImage
from radcal.image.readers import image_of, read_image
from radcal.image.resolution import check_resolutions
from radcal.image.speckle_check import check_speckle
from radcal.measurement.synthetic import make_synthetic
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.reading.products import named_product
from radcal.reading.safe import is_safe_name
from radcal.registration.relief import check_relief, relief_slope
from radcal.scene.model import Scene
from radcal.sections.measurement import RADIOMETRY_EXPECTED
from radcal.sentinel1.product import open_product
from radcal.sentinel1.reader import sigma0_image
from radcal.simulators.protocol import Simulator

__all__ = ["make_measurement"]

_INCIDENCE_DEG = 2.0  # largest difference from the incidences that a file gives; their definitions differ by far less
_SAME_RELIEF = 0.3  # largest ratio of differences to the relief (rms) at which an image counts as heights
_NOISE_ABOVE_DB = 3.0  # an image contains its noise: only errors of both levels let the noise lie above the image


def make_measurement(
    case: stages.MeasurementStage,
    geometry: Geometry,
    simulator: Simulator,
    scene: Scene | None = None,
    partly: bool = False,
) -> Measurement:
    """Read or simulate the measured image, and check that every calibrated material can be fitted.

    Parameters
    ----------
    case : stages.MeasurementStage
        Source of the image, with the pass, materials and target settings that the image must suit.
    geometry : Geometry
        Geometry with the image grid and the material masks.
    simulator : Simulator
        Simulator of a synthetic measurement; it is not used if the measurement is a file.
    scene : Scene, optional
        Scene of the geometry. If missing, every image file is assumed to be in slant range, and a synthetic measurement
        cannot have relief or wrong labels.
    partly : bool
        Whether one calibrated material that can be fitted is enough, as in the second and later passes.

    Raises
    ------
    MeasurementError
        The file cannot be read, has another size, scale, radiometry, polarisation or band, or leaves a
        material without enough pixels above the noise; or no area of a single material is as wide as a resolution.
    """
    check_resolutions(geometry.material, case.radar)
    if isinstance(case.measurement, FileMeasurement):
        measurement = _from_file(case.measurement, case.radar, geometry, scene)
    else:
        measurement = make_synthetic(case, case.measurement.synthetic, geometry, simulator, scene)
    flags = {}
    if case.target.normalisation == "none":  # else the noise level is known after the reference run
        noise_db = noise_floor_db(case.radar, geometry.flat_incidence_deg)
        flags[IN_THE_NOISE] = noise_limited(measurement.image_db, noise_db, case.target.snr_db)
    refused = [_refusal(name, measurement, geometry, case.target, flags) for name in case.calibrated]
    errors = [error for error in refused if error is not None]
    if errors and not (partly and len(errors) < len(refused)):
        is_file = isinstance(case.measurement, FileMeasurement)
        mistake = _noise_above(measurement, noise_db, case.radar) if flags and is_file else None
        raise mistake or errors[0]
    return measurement


def _refusal(
    name: str,
    measurement: Measurement,
    geometry: Geometry,
    config: TargetConfig,
    flags: Mapping[str, NDArray[np.bool_]],
) -> MeasurementError | None:
    """Error about a material that cannot be fitted; None if it can be fitted."""
    try:
        pixels = eligible_pixels(name, geometry, measurement, config, flags=flags).pixels
        skewnormal.fit(measurement.image_db.ravel()[pixels])
    except MeasurementError as error:
        return error
    except FitError as error:
        return MeasurementError(f"materials.{name} in {measurement.source}: {error}")
    return None


def _noise_above(measurement: Measurement, noise_db: NDArray[np.float64], radar: Radar) -> MeasurementError | None:
    """Error about noise far above the level of the whole image, which no image can have."""
    present = measurement.image_db[np.isfinite(measurement.image_db)].astype(np.float64)
    level, noise = 10.0 * np.log10(np.mean(10.0 ** (present / 10.0))), float(np.median(noise_db))
    if not noise > level + _NOISE_ABOVE_DB:
        return None
    one = radar.nesz_db if isinstance(radar.nesz_db, float) else None
    given = "" if one is None else f" is {one:g}"
    sign = "" if one is None or one <= 0 else f" (is a minus sign missing? -{one:g})"
    return MeasurementError(
        f"radar.nesz_db{given}: this noise of {noise:.3g} dB lies above the mean level of {measurement.source}, "
        f"{level:.3g} dB, which contains the noise, expected a smaller radar.nesz_db{sign}, for an image without noise "
        "far below this level, or another measurement.scale.",
        MissingSign("radar.nesz_db") if sign else None,
    )


def _from_file(config: FileMeasurement, radar: Radar, geometry: Geometry, scene: Scene | None) -> Measurement:
    safe = is_safe_name(config.path)
    path = expand_path(config.path, "measurement.path", folder=safe)
    crs, transform = (scene.crs, scene.transform) if scene is not None else (None, None)
    header = Header() if safe else header_of(path, config)
    sides, resampled, of_file = None, False, list[Finding]()
    if safe:
        opened = open_product(path, config, radar)
        power, _, found = sigma0_image(opened, config, radar, geometry, scene)
        config = config.model_copy(update={"scale": "power"})
        read = replace(image_of(power, path, config, geometry.shape), findings=found, radiometry="sigma0_ref")
        path, resampled = path.with_name(opened.name), True
    elif crs is not None and transform is not None and header.pixel_m is not None:
        check_spacing(path, header.pixel_m, radar)
        sides = map_pixel_m(header.pixel_m, radar)
        places = partial(places_on_ground, crs, transform, geometry.ground)
        image = read_georeferenced(path, config, places)
        resampled = True
        around = {"pixels": image.values.size, "no_data": int(np.count_nonzero(~np.isfinite(image.values)))}
        of_file.append(Finding("file_around_scene", "note", path.name, around))
        values = values_at_ground(image, crs, transform, geometry.ground)
        _check_no_heights(values, path, geometry, scene)
        read = image_of(values, path, config, geometry.shape)
    else:
        read = read_image(path, config, geometry.shape, "" if crs is None else _off_the_map(header, crs))
    read = _tagged(read, header, config, path)
    _check_pass(read, radar, path)
    _check_radiometry(read.radiometry, config.radiometry, radar, path)
    code = "pixels_at_ground" if resampled else "pixels"
    findings = [Finding(code, "note", path.name, vars(read.counts)), *of_file, *read.findings]
    if sides is not None:
        findings.append(_angle(path, header, config, radar, geometry, scene))
    scale = None if safe else config.scale
    findings += check_speckle(read.image_db, geometry.material, radar, path.name, scale, sides)
    slope = relief_slope(read.image_db, geometry, radar)
    if slope is not None:
        slope_error_deg = scene.slope_error_deg if scene is not None else 0.0
        findings += check_relief(slope, radar, path.name, slope_error_deg)
    product = None if safe else named_product(config.path)
    if product is not None:
        keys = {key: str(getattr(config, key)) for key in ("scale", "radiometry", "polarisation")}
        findings.append(Finding("product", "note", path.name, {"product": product.called, **keys}))
        if product.filtered:
            findings.append(Finding("product_filtered", "note", path.name))
    if read.frequency_hz is not None and within_band(radar.band, read.frequency_hz) is None:
        bands: dict[str, float | str] = {"band": radar.band, "bands": ", ".join(LETTER_BANDS_GHZ)}
        carrier = {"frequency_ghz": read.frequency_hz / 1e9, **bands}
        findings.append(Finding("carrier_not_compared", "note", path.name, carrier))
    return Measurement(read.image_db, path.name, findings=tuple(findings))


def _check_no_heights(values: NDArray[Any], path: Path, geometry: Geometry, scene: Scene | None) -> None:
    """Refuse values that are the scene's own heights: a copy of the elevation in place of the measured image."""
    if scene is None or scene.elevation_m is None or values.dtype.kind == "c":
        return
    known = np.isfinite(values) & np.isfinite(geometry.ground).all(axis=0)
    height = map_coordinates(scene.elevation_m, geometry.ground[:, known].astype(np.float64), order=0, mode="nearest")
    if height.size and np.sqrt(np.mean((values[known] - height) ** 2)) < _SAME_RELIEF * height.std():
        raise MeasurementError(
            f"measurement.path: the values of {path}, {values[known].min():.4g} to {values[known].max():.4g}, are the "
            "heights of scene.elevation in metres, expected backscatter: give the file of the measured image."
        )


def _off_the_map(header: Header, crs: str) -> str:
    """End of the message about an image of another size that has no place on the map; ``crs`` is the scene's."""
    from pyproj import CRS

    lacks = "CRS" if header.crs is None else "transform from its pixels to the map"
    return (
        f", and the file has no {lacks}, expected a georeferenced image, as the scene in "
        f"{CRS.from_user_input(crs).name} is, or one in slant range on the grid of the scene's image"
    )


def _angle(
    path: Path, header: Header, config: FileMeasurement, radar: Radar, geometry: Geometry, scene: Scene | None
) -> Finding:
    """Finding on the incidence of an image on the map, in which the map and not the angle places the pixels.

    Raises
    ------
    MeasurementError
        The file has a band of incidence angles, and these differ from those of ``radar``.
    """
    key = "depression_deg" if radar.incidence_deg is None else "incidence_deg"
    value = getattr(radar, key)
    low, high = geometry.flat_incidence_deg.min(), geometry.flat_incidence_deg.max()
    numbers = {"key": f"radar.{key}", "declared_deg": value, "from_deg": float(low), "to_deg": float(high)}
    band = header.incidence
    off_deg = None if band is None else _off_band_deg(path, config, geometry, scene, *band)
    if band is None or off_deg is None:
        return Finding("incidence_by_map", "note", path.name, numbers)
    if abs(off_deg) > _INCIDENCE_DEG:
        right = value + off_deg * (1.0 if key == "depression_deg" else -1.0)
        raise MeasurementError(
            f"radar.{key} is {value:g}, whose incidences differ by {off_deg:+.1f} degrees (median) from band {band[0]} "
            f"({band[1]}) of {path}, expected about {right:.1f}."
        )
    numbers |= {"band": band[0], "name": band[1], "off_deg": off_deg}
    return Finding("incidence_of_band", "note", path.name, numbers)


def _off_band_deg(
    path: Path, config: FileMeasurement, geometry: Geometry, scene: Scene | None, number: int, _: str, local: bool
) -> float | None:
    """Median of the geometry's incidence less that of a band [deg]; None if no angle is known."""
    crs, transform = (scene.crs, scene.transform) if scene is not None else (None, None)
    if crs is None or transform is None:
        return None
    places = partial(places_on_ground, crs, transform, geometry.ground)
    image = read_georeferenced(path, config.model_copy(update={"band": number}), places)
    angle = values_at_ground(image, crs, transform, geometry.ground)
    off = (geometry.incidence_deg if local else geometry.flat_incidence_deg[:, None]) - angle
    return float(np.nanmedian(off)) if np.isfinite(off).any() else None


def _tagged(read: ReadImage, tags: Header, config: FileMeasurement, path: Path) -> ReadImage:
    """Image with the polarisation from its raster tags; tags that contradict the configuration raise an error."""
    if tags.decibels and config.scale != "db":
        raise MeasurementError(
            f"measurement.scale is {config.scale}, the name of the band of {path} says dB: set measurement.scale: db."
        )
    if tags.normalisation is not None and tags.normalisation != (config.radiometry or "").partition("_")[0]:
        raise MeasurementError(
            f"measurement.radiometry is {config.radiometry}, the tags of {path} say {tags.normalisation} after terrain "
            "correction: set measurement.radiometry and radar.radiometry to it (gamma0_rtc for gamma0)."
        )
    return read if tags.polarisation is None else replace(read, polarisation=tags.polarisation)


def _check_radiometry(of_file: str | None, configured: str | None, radar: Radar, path: Path) -> None:
    """Refuse an image whose radiometry is unknown or differs from the configured radiometry."""
    if of_file is None and configured is None:
        raise MeasurementError(
            f"measurement.radiometry is missing: {path} does not say it (SICD does with a polynomial of sigma0, beta0 "
            f"or gamma0), {RADIOMETRY_EXPECTED}."
        )
    if of_file is not None and configured not in (None, of_file):
        raise MeasurementError(
            f"measurement.radiometry is {configured}, {path} is read as {of_file}: leave the key out, and set "
            f"radar.radiometry: {of_file}."
        )
    if of_file is not None and of_file != radar.radiometry:
        raise MeasurementError(
            f"measurement.path: the radiometry of {path} is {of_file}, radar.radiometry is {radar.radiometry}: set it "
            "to the image's, since the simulated image is made in it."
        )


def _check_pass(read: ReadImage, radar: Radar, path: Path) -> None:
    """Refuse an image whose file gives another polarisation or band than ``radar``."""
    if read.polarisation not in (None, radar.polarisation):
        raise MeasurementError(
            f"measurement.path: the polarisation of {path} is {read.polarisation}, radar.polarisation is "
            f"{radar.polarisation}: polarisations are never mixed, set it to the image's."
        )
    if read.frequency_hz is not None and within_band(radar.band, read.frequency_hz) is False:
        raise MeasurementError(
            f"measurement.path: the carrier of {path} is {read.frequency_hz / 1e9:.4g} GHz (band "
            f"{letter_band(read.frequency_hz) or 'without a letter'}), radar.band is {radar.band}: "
            "bands are never mixed, set it to the image's."
        )
