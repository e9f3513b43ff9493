"""Measurement from its configured source, a file or a synthetic image, checked against the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.bands import LETTER_BANDS_GHZ, letter_band, within_band
from radcal.config import FileMeasurement, Radar
from radcal.config.part import Part
from radcal.errors import FitError, MeasurementError, MissingSign
from radcal.findings import Finding
from radcal.ground.pixels import IN_THE_NOISE, eligible_pixels, noise_limited
from radcal.image.base import Grid, opened
from radcal.image.model import Measurement
from radcal.image.speckle_check import check_resolutions, check_speckle
from radcal.measurement.synthetic import make_synthetic
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.registration.relief import check_relief, relief_slopes
from radcal.scene.model import Scene
from radcal.sections.measurement import RADIOMETRY_EXPECTED
from radcal.simulators.base import Simulator

_NOISE_ABOVE_DB = 3.0  # an image contains its noise: only errors of both levels let the noise lie above the image


def make_measurement(
    case: Part,
    geometry: Geometry,
    simulator: Simulator,
    scene: Scene | None = None,
    partly: bool = False,
) -> Measurement:
    """Read or simulate the measured image, and check that every calibrated material can be fitted.

    Parameters
    ----------
    case : Part
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
    errors = []
    for name in case.calibrated:
        try:
            pixels = eligible_pixels(name, geometry, measurement, case.target, flags=flags).pixels
            skewnormal.fit(measurement.image_db.ravel()[pixels])
        except MeasurementError as error:
            errors.append(error)
        except FitError as error:
            errors.append(MeasurementError(f"materials.{name} in {measurement.source}: {error}"))
    if errors and not (partly and len(errors) < len(case.calibrated)):
        is_file = isinstance(case.measurement, FileMeasurement)
        mistake = _noise_above(measurement, noise_db, case.radar) if flags and is_file else None
        raise mistake or errors[0]
    return measurement


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
    reader = opened(config, radar)
    read, facts = reader.read(Grid(geometry, scene)), reader.facts()
    path, of_file, configured = reader.path, facts.radiometry, config.radiometry
    if facts.polarisation not in (None, radar.polarisation):
        raise MeasurementError(
            f"measurement.path: the polarisation of {path} is {facts.polarisation}, radar.polarisation is "
            f"{radar.polarisation}: polarisations are never mixed, set it to the image's."
        )
    if facts.frequency_hz is not None and within_band(radar.band, facts.frequency_hz) is False:
        raise MeasurementError(
            f"measurement.path: the carrier of {path} is {facts.frequency_hz / 1e9:.4g} GHz (band "
            f"{letter_band(facts.frequency_hz) or 'without a letter'}), radar.band is {radar.band}: "
            "bands are never mixed, set it to the image's."
        )
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
    code = "pixels_at_ground" if read.resampled else "pixels"
    findings = [Finding(code, "note", reader.name, vars(read.counts)), *read.findings]
    scale = None if reader.gives_acquisition else config.scale  # a product with its acquisition defines its scale
    findings += check_speckle(read.image_db, geometry.material, radar, reader.name, scale, read.pixel_m)
    for slope in relief_slopes([read.image_db], geometry, radar):
        slope_error_deg = scene.slope_error_deg if scene is not None else 0.0
        findings += check_relief(slope, radar, reader.name, slope_error_deg)
    product = None if reader.gives_acquisition else reader.named(config.path)
    if product is not None:
        keys = {key: str(getattr(config, key)) for key in ("scale", "radiometry", "polarisation")}
        findings.append(Finding("product", "note", reader.name, {"product": product.called, **keys}))
        if product.filtered:
            findings.append(Finding("product_filtered", "note", reader.name))
    if facts.frequency_hz is not None and within_band(radar.band, facts.frequency_hz) is None:
        bands: dict[str, float | str] = {"band": radar.band, "bands": ", ".join(LETTER_BANDS_GHZ)}
        carrier = {"frequency_ghz": facts.frequency_hz / 1e9, **bands}
        findings.append(Finding("carrier_not_compared", "note", reader.name, carrier))
    return Measurement(read.image_db, reader.name, findings=tuple(findings))
