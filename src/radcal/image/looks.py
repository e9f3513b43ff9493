"""Equivalent number of looks (ENL) of a measured image, from its homogeneous areas."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.speckle.texture import trigamma_inverse
from radcal.words import sentence

SIDE = 8  # number of independent pixels on a side of a window
_SMALLER = (6, 5, 4)  # sides of windows in materials whose areas are too small for 20 windows of the usual side
_INDEPENDENT = 1.5  # resolution widths between pixels that are assumed to be independent
_WINDOWS = 20  # smallest number of windows for an estimate
_BANDWIDTH = 0.5  # kernel width of the density of log variances, in standard errors of one window
_DRAWS = 100
_DB = 10.0 / np.log(10.0)
_TOO_MANY, _TOO_FEW = 2.0, 0.35  # times the configured looks: neither sensor nor texture explains more extreme ratios
# power read as amplitude has 4 times the variance; this is 4 to the power of 3/4, and a texture of 2.5 dB at least
_TOO_VARIABLE, _TEXTURE_DB = 2.83, 2.5
_CERTAIN = 4.0  # standard errors of the logarithm of the variance
_ALIKE = (0.6, 1.3)  # times the configured looks


@dataclass(frozen=True)
class Looks:
    """Equivalent number of looks of an image, with its confidence interval.

    Attributes
    ----------
    looks : float
        Equivalent number of looks of the homogeneous areas.
    low, high : float
        Ends of the 95 % confidence interval of ``looks``.
    windows : int
        Number of windows used.
    side_px : int
        Number of independent pixels on a side of a window.
    """

    looks: float
    low: float
    high: float
    windows: int
    side_px: int = SIDE

    def differs(self, looks: float) -> bool:
        """Whether the variance of the speckle certainly contradicts a number of looks.

        The variance differs by more than four standard errors from that of the given looks. A larger variance must also
        be at least twice as large in the whole interval, because heterogeneous ground increases the variance of some
        windows; a wrong scale makes it four times as large.
        """
        variances = np.log([_log_variance(count) for count in (self.looks, looks, self.low, self.high)])
        error = (variances[2] - variances[3]) / (2.0 * 1.96)
        whole = self.looks > looks or variances[3] - variances[1] > np.log(2.0)
        return bool(abs(variances[0] - variances[1]) > _CERTAIN * error and whole)


def looks_of_log_variance(variance_db2: float) -> float:
    """Number of looks at which gamma speckle has a given variance in dB.

    Parameters
    ----------
    variance_db2 : float
        Variance of the backscatter in dB [dB^2].

    Returns
    -------
    float
        Number L for which (10 / ln 10)^2 trigamma(L) is the variance (Oliver and Quegan, "Understanding
        Synthetic Aperture Radar Images", section 4.3).
    """
    return trigamma_inverse(variance_db2 / _DB**2)


def estimate_looks(image_db: NDArray[np.float32], material: NDArray[np.uint8], radar: Radar) -> Looks | None:
    """Equivalent number of looks of the image's homogeneous areas.

    In each window of one material, only pixels that are far enough apart to be independent are used, and a plane is
    subtracted from their dB values. In homogeneous windows, the remaining variance is the variance of speckle; in other
    windows it is larger. The most frequent variance is therefore taken as the variance of speckle. Windows have 8 x 8
    independent pixels; if fewer than 20 of them fit into the materials, they have 6 x 6, 5 x 5 or 4 x 4.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several.
    radar : Radar
        Pass with its resolutions and pixel spacings.

    Returns
    -------
    Looks or None
        Estimated looks; None if fewer than 20 windows of 4 x 4 independent pixels fit into the materials.

    References
    ----------
    Anfinsen, Doulgeris and Eltoft, "Estimation of the equivalent number of looks in
    polarimetric synthetic aperture radar imagery", IEEE TGRS 47 (2009): the mode of many
    windows' estimates.
    """
    for side in (SIDE, *_SMALLER):
        variances = _window_variances(image_db, material, *independent_steps(radar), side)
        if variances.size >= _WINDOWS:
            break
    else:
        return None
    rng = np.random.default_rng(0)  # seed of the bootstrap only: the estimate itself is not random
    mode = most_frequent_variance(variances, side)
    again = [most_frequent_variance(rng.choice(variances, variances.size), side) for _ in range(_DRAWS)]
    low, high = np.percentile(again, [2.5, 97.5])
    return Looks(
        looks_of_log_variance(mode),
        looks_of_log_variance(float(high)),
        looks_of_log_variance(float(low)),
        int(variances.size),
        side,
    )


def local_looks(image_db: NDArray[np.float32], pixels: NDArray[np.int64], radar: Radar) -> float:
    """Equivalent number of looks, estimated from differences between neighbouring pixels of a material.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB].
    pixels : ndarray of int
        Flat indices of the material's finite pixels.
    radar : Radar
        Pass with its resolutions and pixel spacings.

    Returns
    -------
    float
        Number of looks from the semivariance of pairs of pixels that are just far enough apart to have independent
        speckle. Changes of the level over longer distances, such as those between fields, have no effect on this
        semivariance. NaN if there are no pairs.

    References
    ----------
    Matheron, "Principles of geostatistics", Economic Geology 58 (1963): semivariance.
    """
    values = np.full(image_db.shape, np.nan)
    values.flat[pixels] = image_db.flat[pixels]
    down, across = independent_steps(radar)
    pairs = np.concatenate(
        [(values[down:] - values[:-down]).ravel(), (values[:, across:] - values[:, :-across]).ravel()]
    )
    pairs = pairs[np.isfinite(pairs)]
    semivariance = float(0.5 * np.mean(pairs**2)) if pairs.size else 0.0
    return looks_of_log_variance(semivariance) if semivariance > 0.0 else float("nan")


def independent_steps(radar: Radar) -> tuple[int, int]:
    """Smallest numbers of rows and of columns between pixels with independent speckle."""
    return (
        max(1, int(np.ceil(_INDEPENDENT * radar.range_resolution_m / radar.range_spacing_m))),
        max(1, int(np.ceil(_INDEPENDENT * radar.azimuth_resolution_m / radar.azimuth_spacing_m))),
    )


def windows_of(values: NDArray[Any], height: int, width: int) -> NDArray[Any]:
    """Windows of an image side by side, shape (windows, height, width); pixels that fill no window are left out."""
    rows, columns = values.shape[0] // height, values.shape[1] // width
    parts = values[: rows * height, : columns * width].reshape(rows, height, columns, width)
    return parts.swapaxes(1, 2).reshape(rows * columns, height, width)


def _window_variances(
    image_db: NDArray[np.float32], material: NDArray[np.uint8], down: int, across: int, side: int
) -> NDArray[np.float64]:
    """Variance about a fitted plane in every window of one material, of ``side`` pixels squared [dB^2]."""
    # the independent pixels of each window, shape (windows, pixels)
    labels, values = (
        windows_of(part, side * down, side * across)[:, ::down, ::across].reshape(-1, side**2)
        for part in (material, image_db)
    )
    values = values.astype(np.float64)
    whole = (labels[:, :1] != 0).ravel() & np.all(labels == labels[:, :1], axis=1) & np.isfinite(values).all(axis=1)
    y, x = np.indices((side, side)).reshape(2, -1) - (side - 1) / 2.0
    plane = np.stack([np.ones_like(x), x, y], axis=1)
    plane /= np.sqrt((plane**2).sum(axis=0))  # orthogonal already
    values = values[whole] - values[whole].mean(axis=1, keepdims=True)
    left = values - (values @ plane) @ plane.T
    return np.asarray((left**2).sum(axis=1) / (side**2 - 3))


def most_frequent_variance(variances: NDArray[np.float64], side: int = SIDE) -> float:
    """Variance at which the estimated density of the logarithms of ``variances`` is largest.

    Parameters
    ----------
    variances : ndarray, shape (windows,)
        Variances in windows [dB^2].
    side : int, optional
        Number of independent pixels on a side of a window, which sets the width of the kernel.
    """
    logs = np.log(np.maximum(variances, 1e-12))
    # standard error for normal values; log variances of log-gamma values scatter a little more
    width = _BANDWIDTH * np.sqrt(2.0 / (side**2 - 3))
    grid = np.arange(logs.min() - 4.0 * width, logs.max() + 4.0 * width, width / 10.0)  # not shorter than the kernel
    counts, _ = np.histogram(logs, np.append(grid, grid[-1] + width / 10.0) - width / 20.0)
    offsets = np.arange(-40, 41) / 10.0
    density = np.convolve(counts, np.exp(-0.5 * offsets**2), mode="same")
    return float(np.exp(grid[int(np.argmax(density))]))


def check_looks(found: Looks, looks: float, scale: str | None, source: str, filtered: bool = False) -> Finding:
    """Refuse an image whose estimated looks contradict ``radar.looks``, and return the estimate as a finding.

    If amplitude is read as power, every dB value is halved, and the variance of speckle is divided by four. If power is
    read as amplitude, the variance of speckle is multiplied by four. A wrong choice between amplitude and power thus
    makes the estimated number of looks about three times too large or too small. If a dB image is read as power, hardly
    any speckle is left.

    Parameters
    ----------
    found : Looks
        Looks of the image.
    looks : float
        Configured number of looks, ``radar.looks``.
    scale : {'db', 'power', 'amplitude', 'complex'} or None
        Configured scale of the file's numbers; None for a product that defines its scale, so that the scale cannot be
        wrong.
    source : str
        Name of the image.
    filtered : bool
        Whether the autocorrelation of the speckle shows a speckle filter.

    Returns
    -------
    Finding
        Estimated looks.

    Raises
    ------
    MeasurementError
        The estimated and the configured looks differ so much that the scale, or ``radar.looks``, must be wrong.
    """
    plain = Finding("looks", "note", source, {**vars(found), "declared": looks})
    clause = sentence(plain).removesuffix(".")
    variance = _log_variance(found.looks)
    too_many, too_few = found.looks > _TOO_MANY * looks, found.looks < _TOO_FEW * looks
    if scale in ("amplitude", "db"):  # scales with which power would have four times its variance
        configured = _log_variance(looks)
        too_few |= variance > max(_TOO_VARIABLE * configured, configured + _TEXTURE_DB**2)
    if (too_many or too_few) and not found.differs(looks):
        return replace(plain, code="looks_uncertain")
    if too_many and filtered:
        raise MeasurementError(
            f"measurement.path: {source} is speckle-filtered: {clause}, and its speckle is correlated over a larger "
            "area than the resolutions say; use the image before filtering, or set radar.looks: "
            f"{min(64, round(found.looks))} (docs/measured_images.md says what is then lost; a multilooked image needs "
            "its own resolutions, too)."
        )
    if scale is None and (too_many or too_few):
        raise MeasurementError(
            f"measurement.path: {clause}, which is no speckle of this product: use it as it was delivered, or set "
            "radar.looks to what it has."
        )
    if too_many:
        as_amplitude = looks_of_log_variance(4.0 * variance)
        if scale == "db":
            guess = "10 log10 of amplitude instead of power would do that: check what the file holds"
        elif as_amplitude > _TOO_MANY * looks:
            guess = "as if its numbers were dB: check measurement.scale"
        else:
            guess = (
                f"it would be that of {as_amplitude:.3g} if its numbers are amplitude: set measurement.scale: amplitude"
            )
        raise MeasurementError(
            f"measurement.scale is {scale}, but {clause}; {guess}, or radar.looks if they are so many."
        )
    if too_few:
        guess = ""
        if scale in ("amplitude", "db"):
            guess = f"it would be that of {looks_of_log_variance(0.25 * variance):.3g} if its numbers are "
            guess += "power: set measurement.scale: power" if scale == "amplitude" else "20 log10 of power"
            guess += ", or "
        raise MeasurementError(f"measurement.scale is {scale}, but {clause}; {guess}set radar.looks to what it has.")
    if found.looks > _ALIKE[1] * looks and not found.low <= looks <= found.high:
        return replace(plain, code="looks_more")
    if found.looks < _ALIKE[0] * looks and not found.low <= looks <= found.high:
        return replace(plain, code="looks_fewer")
    return plain


def _log_variance(looks: float) -> float:
    """Variance of the dB values of gamma speckle [dB^2]."""
    return float(_DB**2 * scipy.special.polygamma(1, looks))
