"""Change of a measured image with the local incidence angle on relief, which shows a wrong look side or elevation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.radar.geometry import Geometry
from radcal.words import sentence

_BLOCK_PX = 32
_FEWEST = 20  # smallest number of blocks, and of pixels of a material in a block
_LEAST_SPREAD_DEG = 1.0  # smallest standard deviation of the incidence inside blocks
_BETWEEN_DEG = (15.0, 75.0)  # at other angles, layover and noise change the image more than the law does
_CERTAIN, _LIKELY = 5.0, 3.0  # standard errors
_AWAY, _FLAT = -0.5, 0.5  # shares of the slope of constant gamma


@dataclass(frozen=True)
class ReliefSlope:
    """Slope of an image over the local incidence angle, inside blocks of 32 x 32 pixels and inside materials.

    Attributes
    ----------
    db_per_deg : float
        Slope of the measured image [dB per degree].
    error : float
        Standard error of the slope, from the scatter between blocks [dB per degree].
    least : float
        Slope of ground of constant gamma in the radiometry of the image [dB per degree]. Ground with steeper laws has a
        slope of more than this size.
    spread_deg : float
        Standard deviation of the incidence inside blocks [deg].
    against_gamma, against_first : (float, float)
        Slope relative to that of constant gamma, and to that of the first image on the same pixels, each with its
        standard error. The errors are those of ratios, in which what blocks have in common cancels.
    """

    db_per_deg: float
    error: float
    least: float
    spread_deg: float
    against_gamma: tuple[float, float] = (np.nan, np.nan)
    against_first: tuple[float, float] = (np.nan, np.nan)


def relief_slopes(images_db: Sequence[NDArray[np.float32]], geometry: Geometry, radar: Radar) -> list[ReliefSlope]:
    """Slopes of images over the local incidence angle on relief, on the pixels that all of them have.

    Blocks have their own level for each material, so that neither differences between fields nor the decrease from near
    to far range change the slope, only relief of less than 32 pixels does.

    Parameters
    ----------
    images_db : sequence of ndarray, each of shape (rows, columns)
        Images [dB].
    geometry : Geometry
        Geometry of the pass.
    radar : Radar
        Pass; only its radiometry is used.

    Returns
    -------
    list of ReliefSlope
        Slope of each image; empty if the relief is too small or the images have the radiometry gamma0_rtc, in which
        constant gamma has no slope.

    References
    ----------
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE TGRS 34 (1996): area of the ground
    in a pixel. Cochran, "Sampling Techniques", 3rd edition (1977), section 6.4: standard error of a ratio.
    """
    if radar.radiometry == "gamma0_rtc":
        return []
    angle = geometry.incidence_deg.astype(np.float64)
    with np.errstate(invalid="ignore"):
        used = (geometry.material > 0) & (angle > _BETWEEN_DEG[0]) & (angle < _BETWEEN_DEG[1])
    used &= np.isfinite(images_db).all(axis=0)
    used &= ~(geometry.layover | geometry.shadow)
    row, column = np.nonzero(used)
    block = row // _BLOCK_PX * (used.shape[1] // _BLOCK_PX + 1) + column // _BLOCK_PX
    _, group, count = np.unique(block * 256 + geometry.material[used], return_inverse=True, return_counts=True)
    enough = count[group] >= _FEWEST
    if not enough.any():
        return []
    group, block, angle = group[enough], block[enough], angle[used][enough]
    gamma_db = 10.0 * np.log10(np.cos(np.radians(angle)))
    if radar.radiometry != "sigma0_local":  # the ground in a pixel of the other radiometries has this area
        gamma_db -= 10.0 * np.log10(np.sin(np.radians(angle)))
    away = angle - (np.bincount(group, angle, count.size) / count)[group]
    blocks = np.unique(block, return_inverse=True)[1]
    others = [gamma_db, *(image[used][enough].astype(np.float64) for image in images_db)]
    square, gamma, *seen = (np.asarray(np.bincount(blocks, away * values), np.float64) for values in [away, *others])
    spread = float(np.sqrt(square.sum() / away.size))
    if square.size < _FEWEST or spread < _LEAST_SPREAD_DEG:
        return []
    least = float(gamma.sum() / square.sum())
    return [ReliefSlope(*_ratio(one, square), least, spread, _ratio(one, gamma), _ratio(one, seen[0])) for one in seen]


def _ratio(values: NDArray[np.float64], others: NDArray[np.float64]) -> tuple[float, float]:
    """Ratio of the sums of two values of each block, and its standard error."""
    whole = others.sum()
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = values.sum() / whole
        scatter = np.sqrt(np.sum((values - ratio * others) ** 2) * others.size / (others.size - 1)) / abs(whole)
    return float(ratio), float(scatter)


def check_relief(found: ReliefSlope, radar: Radar, source: str, slope_error_deg: float) -> list[Finding]:
    """Refuse an image that gets brighter where the ground is turned away, and describe an image without any slope.

    Parameters
    ----------
    found : ReliefSlope
        Slope of the image.
    radar : Radar
        Pass.
    source : str
        Name of the image.
    slope_error_deg : float
        Standard error of the slopes of the scene's elevation [deg].

    Returns
    -------
    list of Finding
        Warning on an image that does not follow the relief; else empty.

    Raises
    ------
    MeasurementError
        The image gets brighter with the local incidence angle, at least half as much as ground of constant gamma gets
        darker.
    """
    share, error = found.db_per_deg / found.least, abs(found.error / found.least)
    numbers = {
        "db_per_deg": found.db_per_deg,
        "error_db_per_deg": found.error,
        "constant_gamma_db_per_deg": abs(found.least),
        "look_side": radar.look_side,
        "heading_deg": radar.heading_deg,
    }
    if share < _AWAY and share + _CERTAIN * error < 0.0:
        raise MeasurementError(
            f"measurement.path: {sentence(Finding('relief_turned', 'refusal', source, numbers), prefix=False)}"
        )
    if share + _LIKELY * error < _FLAT and 2.0 * slope_error_deg**2 < found.spread_deg**2:
        return [Finding("relief_not_followed", "warning", source, numbers)]
    return []
