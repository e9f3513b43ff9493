"""Warnings, before any run, on calibrated materials whose measured level lies at or below the noise."""

from __future__ import annotations

import numpy as np

from radcal.config import Case
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.ground.pixels import (
    IN_THE_NOISE,
    MANY_IN_NOISE,
    eligible_pixels,
    noise_limited,
    point_targets,
    share_in_noise,
)
from radcal.image.model import Measurement
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db

__all__ = ["hidden_by_noise"]

# share of pixels in the noise from which the warning is about the whole law: with 21, 39, 52 and 75 % of the pixels of
# a dark material in the noise, its law was known at no angle, and with 0 % between 23 and 28 of 20 to 44 degrees
_MUCH = 0.2


def hidden_by_noise(case: Case, geometry: Geometry, measured: Measurement) -> list[Finding]:
    """Warnings on calibrated materials of which a part of the pixels is to be masked as noise.

    The share of pixels is that of the report (:func:`radcal.ground.pixels.share_in_noise`), but for an image that
    is not registered, and for all ground, held out or not. If the level of the image is removed, its noise is not known
    before the reference run, and nothing is said.

    Parameters
    ----------
    case : Case
        One pass of the case.
    geometry : Geometry
        Geometry of the pass.
    measured : Measurement
        Measured image before registration.
    """
    if case.target.normalisation != "none":
        return []
    image_db, snr_db = measured.image_db, case.target.snr_db
    noise_db = noise_floor_db(case.radar, geometry.flat_incidence_deg)
    flags = {IN_THE_NOISE: noise_limited(image_db, noise_db, snr_db)}
    if not flags[IN_THE_NOISE].any():
        return []
    if case.target.leave_out_point_targets:
        flags["point targets"] = point_targets(image_db, geometry.material, case.radar)
    found = []
    for name in case.calibrated:
        try:
            eligible = eligible_pixels(name, geometry, measured, case.target, flags=flags)
        except MeasurementError:  # too few pixels: a further pass, which may lack the material
            continue
        share = share_in_noise(eligible.masked, eligible.pixels.size)
        if share < MANY_IN_NOISE:
            continue
        inside = (geometry.material == geometry.names.index(name) + 1) & np.isfinite(image_db)
        level = _mean_db(image_db[inside])
        noise = _mean_db(np.broadcast_to(noise_db[:, None], image_db.shape)[inside])
        numbers: dict[str, float | str] = {
            "share_percent": 100.0 * share,
            "image": measured.source,
            "snr_db": snr_db,
            "level_db": level,
            "noise_db": noise,
        }
        code = "much_in_noise" if share >= _MUCH else "some_in_noise"
        found.append(Finding(code, "warning", f"materials.{name}", numbers))
    return found


def _mean_db(values_db: np.ndarray) -> float:
    """Mean power of values in dB [dB]."""
    return float(10.0 * np.log10(np.mean(10.0 ** (np.asarray(values_db, dtype=np.float64) / 10.0))))
