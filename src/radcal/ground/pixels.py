"""Masks that select a material's pixels for the comparison of the measured image with runs, the same for both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar, TargetConfig
from radcal.errors import MeasurementError
from radcal.image.looks import looks_of_log_variance
from radcal.image.model import Measurement

if TYPE_CHECKING:
    from radcal.radar.geometry import Geometry

MINIMUM_PIXELS = 50
IN_THE_NOISE = "in the noise"  # reason for masking
MANY_IN_NOISE = 0.05  # share of pixels masked as noise that a sentence states
_LEVEL_PX = 9  # window of the local level
_GUARD_PX, _REACH_PX = 3, 10  # half-widths of the area next to a point target, and of the area compared with it
_FALSE_ALARMS = 1e-8
_IQR_OF_NORMAL = 1.349


@dataclass(frozen=True)
class Eligible:
    """Pixels of a material from which the target's pixels are drawn: inside the material, valid, and not masked.

    Attributes
    ----------
    pixels : ndarray of int64
        Flat indices of the pixels in the image, ascending.
    masked : mapping
        Number of the material's visible pixels that are masked, by reason, in the order in which the reasons are
        tested. A pixel that is masked for several reasons is counted for the first one.
    """

    pixels: NDArray[np.int64]
    masked: Mapping[str, int]


def _local_power(power: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Mean power of the finite pixels in a window around each pixel; NaN where the window holds no finite pixel."""
    there = np.isfinite(power)
    share = scipy.ndimage.uniform_filter(there.astype(np.float64), size, mode="constant")
    total = scipy.ndimage.uniform_filter(np.where(there, power, 0.0), size, mode="constant")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(share > 1e-9, total / share, np.nan))


def noise_limited(image_db: NDArray[np.float32], noise_db: NDArray[np.float64], snr_db: float) -> NDArray[np.bool_]:
    """Pixels around which the mean power is hardly higher than the thermal noise.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter with noise [dB], NaN where a pixel has no value.
    noise_db : ndarray, shape (rows,)
        Noise floor of each row [dB], shifted to the level of the image.
    snr_db : float
        Required signal-to-noise ratio [dB].

    Returns
    -------
    ndarray of bool
        True where the mean power of the surrounding 9 x 9 pixels is below the noise power times 1 + 10^(snr_db / 10),
        because the powers of signal and noise add.
    """
    level = _local_power(10.0 ** (image_db.astype(np.float64) / 10.0), (_LEVEL_PX, _LEVEL_PX))
    return np.asarray(level < 10.0 ** (noise_db[:, None] / 10.0) * (1.0 + 10.0 ** (snr_db / 10.0)))


def share_in_noise(masked: Mapping[str, int], eligible: int) -> float:
    """Share of a material's pixels that are masked as noise, among these and the pixels from which a target is drawn.

    Parameters
    ----------
    masked : mapping
        Number of masked pixels by reason.
    eligible : int
        Number of pixels from which the target's pixels are drawn.
    """
    hidden = masked.get(IN_THE_NOISE, 0)
    return hidden / max(hidden + eligible, 1)


def point_targets(image_db: NDArray[np.float32], material: NDArray[np.uint8], radar: Radar) -> NDArray[np.bool_]:
    """Pixels that hold a point target, and the neighbouring pixels that the target's response reaches.

    The power of a pixel is divided by the greatest of the mean powers of four blocks around the pixel, so that the edge
    of a field does not count as a point target. The threshold for this ratio of powers follows from the spread of the
    ratio within the pixel's material. Texture widens the spread, and thus raises the threshold, so that texture does
    not count as a point target, either.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several.
    radar : Radar
        Looks, resolutions and pixel spacings.

    Returns
    -------
    ndarray of bool

    References
    ----------
    Hansen and Sawyers, "Detectability loss due to greatest of selection in a cell-averaging
    CFAR", IEEE TAES 16 (1980). The false alarm rate is 1e-8 per pixel in gamma clutter, because texture has longer
    tails.
    """
    power = 10.0 ** (image_db.astype(np.float64) / 10.0)
    wide, depth = 2 * _REACH_PX + 1, _REACH_PX - _GUARD_PX
    away = _GUARD_PX + 1 + depth // 2
    rows, columns = image_db.shape
    around = np.full(image_db.shape, -np.inf)
    for size, directions in (((depth, wide), ((away, 0), (-away, 0))), ((wide, depth), ((0, away), (0, -away)))):
        level = np.pad(_local_power(power, size), away, constant_values=np.nan)
        for down, right in directions:
            around = np.fmax(around, level[away + down :, away + right :][:rows, :columns])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio_db = image_db - 10.0 * np.log10(around)
    bright = np.zeros(image_db.shape, dtype=np.bool_)
    for k in np.unique(material[material > 0]):
        inside = (material == k) & np.isfinite(ratio_db)
        if np.count_nonzero(inside) < MINIMUM_PIXELS:
            continue
        low, middle, high = np.percentile(ratio_db[inside], [25.0, 50.0, 75.0])
        spread_db = max(float(high - low), 1e-3) / _IQR_OF_NORMAL
        looks = min(float(radar.looks), looks_of_log_variance(spread_db**2))
        # the observed median replaces the median of speckle, because the greatest of four means exceeds the mean
        threshold_db = 10.0 * np.log10(
            scipy.special.gammainccinv(looks, _FALSE_ALARMS) / scipy.special.gammainccinv(looks, 0.5)
        )
        bright |= inside & (ratio_db > middle + threshold_db)
    spill = [
        int(np.ceil(resolution / spacing))
        for resolution, spacing in (
            (radar.range_resolution_m, radar.range_spacing_m),
            (radar.azimuth_resolution_m, radar.azimuth_spacing_m),
        )
    ]
    return np.asarray(scipy.ndimage.binary_dilation(bright, np.ones([2 * n + 1 for n in spill], dtype=bool)))


def eligible_pixels(
    name: str,
    geometry: Geometry,
    measurement: Measurement,
    config: TargetConfig,
    uncertainty_px: NDArray[np.float32] | None = None,
    flags: Mapping[str, NDArray[np.bool_]] | None = None,
) -> Eligible:
    """Pixels of a material from which the target's pixels are drawn: inside the material, valid, and not masked.

    Parameters
    ----------
    name : str
        Material.
    geometry : Geometry
        Geometry with the material masks and the masks of layover and shadow.
    measurement : Measurement
        Registered image.
    config : TargetConfig
        Configuration of the target, with the margin to other materials.
    uncertainty_px : ndarray, shape (rows, columns), optional
        Standard error of the length of the registration's displacement [pixels], 0 without registration. The margin is
        widened by two standard errors of one component, and by half a pixel, the largest error of a nearest neighbour.
    flags : mapping of str to ndarray of bool, optional
        Masks of pixels that are excluded for further reasons, such as point targets, by reason.

    Raises
    ------
    MeasurementError
        The material has no finite pixel, or fewer than 50 usable pixels.
    """
    margin: int | NDArray[np.int64] = config.margin_px
    if uncertainty_px is not None:
        # the margin is counted along rows and columns; one component has 1 / sqrt(2) of the length's standard error
        widened = np.ceil(2.0 * uncertainty_px / np.sqrt(2.0) + 0.5)
        margin = margin + np.where(uncertainty_px > 0, widened, 0).astype(np.int64)
    visible = geometry.pixels(name)
    interior = np.zeros(geometry.shape[0] * geometry.shape[1], dtype=np.bool_)
    interior[geometry.pixels(name, margin)] = True
    reasons = {
        "layover": geometry.layover,
        "shadow": geometry.shadow,
        "without data": ~np.isfinite(measurement.image_db),
        "near other ground": ~interior,
        **(flags or {}),
    }
    left, masked = visible, {}
    for reason, flag in reasons.items():
        out = flag.ravel()[left]
        masked[reason] = int(np.count_nonzero(out))
        left = left[~out]
    if visible.size >= MINIMUM_PIXELS and masked["without data"] == visible.size:
        raise MeasurementError(
            f"materials.{name}: all {visible.size} of its pixels in the measured image ({measurement.source}) are NaN."
        )
    if left.size < MINIMUM_PIXELS:
        why = ", ".join(f"{count} {reason}" for reason, count in masked.items() if count)
        above = ""
        if masked.get(IN_THE_NOISE):
            level_db = np.nanmedian(measurement.image_db.ravel()[visible])
            above = (
                f"; the image's own level there is {level_db:.3g} dB, which radar.nesz_db and target.snr_db treat as "
                "noise: set radar.nesz_db to that of the image, or far below this level for an image without noise"
            )
        raise MeasurementError(
            f"materials.{name}: {left.size} usable pixels, expected at least {MINIMUM_PIXELS}; in "
            f"{measurement.source} it has {visible.size} visible pixels{f', masked: {why}' if why else ''} "
            f"(target.margin_px is {config.margin_px}"
            f"{', and the registration has an uncertainty' if uncertainty_px is not None else ''}){above}."
        )
    return Eligible(left, masked)
