"""From a configured source to a measurement that fits the scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from radcal import skewnormal
from radcal.config import Case, FileMeasurement, Synthetic, expand_path
from radcal.errors import FitError, MeasurementError
from radcal.measurement.displacement import invert, warp
from radcal.measurement.model import Measurement
from radcal.measurement.pixels import eligible_pixels
from radcal.measurement.readers import read_image_db
from radcal.radar.geometry import Geometry
from radcal.seeds import derived_rng, derived_seed
from radcal.simulators.protocol import Simulator

__all__ = ["make_measurement", "smooth_warp"]

_WARP_SIGMA_PX = 60.0  # smoothing of a synthetic displacement field


def make_measurement(case: Case, geometry: Geometry, simulator: Simulator) -> Measurement:
    """Read or make the measurement and check that every calibrated material can be fitted.

    Parameters
    ----------
    case : Case
        The configuration.
    geometry : Geometry
        Image grid and material masks.
    simulator : Simulator
        Makes a synthetic measurement; not called for a file.

    Raises
    ------
    MeasurementError
        The file cannot be read, has another size or scale, or leaves a material without
        enough pixels.
    """
    if isinstance(case.measurement, FileMeasurement):
        measurement = _from_file(case.measurement, geometry)
    else:
        measurement = _synthetic(case, case.measurement.synthetic, simulator)
    for name in case.calibrated:
        pixels = eligible_pixels(name, geometry, measurement, case.target).pixels
        try:
            skewnormal.fit(measurement.image_db.ravel()[pixels])
        except FitError as error:
            raise MeasurementError(f"materials.{name} in {measurement.source}: {error}") from None
    return measurement


def smooth_warp(shape: tuple[int, int], rms_px: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Smooth random displacement field.

    Parameters
    ----------
    shape : (int, int)
        Image size.
    rms_px : float
        Root mean square length of the displacement [pixels].
    rng : Generator
        Source of the noise.

    Returns
    -------
    ndarray, shape (2, rows, columns)
        Displacement along rows and columns [pixels].
    """
    field = np.stack([gaussian_filter(rng.standard_normal(shape), _WARP_SIGMA_PX, mode="reflect") for _ in range(2)])
    return np.asarray(field * rms_px / np.sqrt(np.mean((field**2).sum(axis=0))))


def _synthetic(case: Case, synthetic: Synthetic, simulator: Simulator) -> Measurement:
    hidden = {name: material.start_parameters for name, material in case.materials.items()}
    hidden.update({name: x for name, x in synthetic.parameters.items() if name in hidden})
    image_db = simulator.run(hidden, derived_seed(synthetic.seed, "measurement", "noise"))
    field = None
    if synthetic.warp_px > 0:
        field = smooth_warp(
            (image_db.shape[0], image_db.shape[1]),
            synthetic.warp_px,
            derived_rng(synthetic.seed, "measurement", "warp"),
        )
        try:
            # nearest pixels: a sensor's speckle is not smoothed by where the image is thought to lie
            image_db = warp(image_db, invert(field))
        except ValueError as error:
            raise MeasurementError(
                f"measurement.synthetic.warp_px is {synthetic.warp_px:g}: {error} Expected a smaller one."
            ) from None
    return Measurement(
        image_db + np.float32(synthetic.offset_db),
        f"synthetic, seed {synthetic.seed}",
        {name: hidden[name] for name in case.calibrated},
        field.astype(np.float32) if field is not None else None,
    )


def _from_file(config: FileMeasurement, geometry: Geometry) -> Measurement:
    path = expand_path(config.path, "measurement.path")
    return Measurement(read_image_db(path, config, geometry.shape), path.name)
