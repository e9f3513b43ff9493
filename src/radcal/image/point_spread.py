"""Point spread of a measured image, from the autocorrelation of its speckle, and recognition of filtered speckle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.findings import Finding, Severity
from radcal.image.looks import SIDE, Looks, independent_steps, most_frequent_variance, windows_of
from radcal.image.small_areas import pairs_of_areas
from radcal.speckle.response import speckle_correlation

_WINDOWS = (20, 2000)  # smallest number of windows, and largest number that is not thinned out
_HOMOGENEOUS = (0.5, 2.0)  # times the most frequent variance; other windows have edges, texture or point targets
_FAR = 2.0  # widths beyond which speckle is uncorrelated; what is correlated further is texture
_DRAWS = 100
_WAYS = ("range", "azimuth")
_NARROW = 1.0  # pixel spacings
_SHAPE = 0.05  # relative error that other weightings than Taylor's (Hamming 3 %, Kaiser 10 %) and texture leave
_CERTAIN = 2.0  # standard errors
_REACH = 7  # distance in pixels over which the correlation area is summed: that of the usual filters
_MORE_LOOKS, _WIDER = 1.5, 1.5  # smallest ratios of looks and of areas to the configured ones for filtered speckle
# smallest ratios for smoothed speckle that has about the configured looks. An area of the point spread above 2.25 could
# only come from resolutions that are wrong (both by half, or one by more). A correlation area above 3 could only come
# from texture, which would also lower the looks below 0.9 times the configured ones.
_COARSE, _SMOOTHED, _AS_MANY_LOOKS = 2.25, 3.0, 0.9
# width that resampling adds in quadrature, in sides of a pixel of the image before it (a map), from the variance of its
# kernels: 1/12 of the nearest neighbour (radcal's), 1/6 of a linear interpolation (of the program that made the map),
# and 2.355 standard deviations in a width
_RESAMPLED = 2.355 * math.sqrt(1.0 / 12.0 + 1.0 / 6.0)
# trial widths in pixel spacings: from sampling far below the bandwidth to filters far wider than any window
_WIDTHS = np.geomspace(0.4, 30.0, 600)

Semivariances = Callable[[Any], NDArray[np.float64]]
"""Semivariances of some of the windows or tiles, given as an index."""


@dataclass(frozen=True)
class Width:
    """Width of the impulse response along one axis.

    Attributes
    ----------
    width_m : float
        -3 dB width [m] of the impulse response that, with the simulator's weighting, gives speckle the same correlation
        as in the image.
    error_m : float
        Standard error [m].
    smoothing : float
        Ratio of the sum of the autocorrelation to the sum for the configured resolution.
    at_least : bool
        Whether the width is only a lower limit, because speckle is correlated over half the windows.
    """

    width_m: float
    error_m: float
    smoothing: float
    at_least: bool = False

    @classmethod
    def of(cls, semivariances: Semivariances, draws: NDArray[np.int64], start: float, way: str, radar: Radar) -> Width:
        """Width from semivariances, and its error from those of bootstrap samples; ``start`` is a first guess."""
        seen = semivariances(slice(None))
        spacing, resolution = getattr(radar, f"{way}_spacing_m"), getattr(radar, f"{way}_resolution_m")
        expected = _expected(seen.size)
        width = _width(seen, expected, start)
        scatter = float(np.std([_width(semivariances(draw), expected, start) for draw in draws]))
        error = spacing * float(np.hypot(scatter, _SHAPE * width))
        far = bool(np.ceil(_FAR * width) > seen.size - 1)  # the largest distances are correlated, too
        return cls(width * spacing, error, _correlation_length(seen, resolution / spacing), far)


@dataclass(frozen=True)
class PointSpread:
    """Point spread of an image in slant range and in azimuth.

    Attributes
    ----------
    range, azimuth : Width
        Width along each axis.
    windows : int
        Number of windows used, or of tiles with pairs of pixels if the areas are too small for windows.
    """

    range: Width
    azimuth: Width
    windows: int

    @property
    def smoothing(self) -> float:
        """Ratio of the correlation area of the image's power to the correlation area for the configured resolutions.

        A correlation area is the sum of the autocorrelation over both directions. Averaging over an area multiplies the
        ratio by about the number of independent pixels in this area. Unlike the widths, it also grows if a filter keeps
        a part of each pixel's own value.
        """
        return self.range.smoothing * self.azimuth.smoothing

    @property
    def cell_m2(self) -> float:
        """Area of the point spread [m2]."""
        return self.range.width_m * self.azimuth.width_m

    def cells(self, radar: Radar) -> float:
        """Ratio of the area of the point spread to the area of the configured resolution cell."""
        return self.cell_m2 / (radar.range_resolution_m * radar.azimuth_resolution_m)


def estimate_point_spread(
    image_db: NDArray[np.float32], material: NDArray[np.uint8], radar: Radar
) -> PointSpread | None:
    r"""Point spread from the semivariances of the power in homogeneous windows of one material, or in small areas.

    For any number of looks, the power of speckle has the autocorrelation :math:`\rho(d) = |\mu(d)|^2`, where
    :math:`\mu` is the autocorrelation of the complex amplitude. The same :math:`\mu` is the autocorrelation of the
    impulse response (:func:`radcal.speckle.response.speckle_correlation`). The function estimates :math:`\rho(d)` as
    :math:`1 - \gamma(d) / \gamma(D)`, where :math:`\gamma` is the semivariance of the power divided by the window's
    mean power, and D is a distance just beyond the correlation of speckle. Semivariances need no removal of a mean, and
    texture that is correlated over longer distances has no effect. The width is fitted by least squares to
    :math:`\rho(d)` at the distances below D.

    If fewer than 20 homogeneous windows fit into the materials, the semivariances are those of pairs of pixels of the
    same area (:func:`radcal.image.small_areas.pairs_of_areas`), whatever the configured resolutions.

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
    PointSpread or None
        Estimated point spread; None if the areas are too small for pairs of pixels, too, or if the widths are half of
        the largest distance of pairs or more. The standard errors of the widths combine the sampling error of the
        windows or tiles (bootstrap) with 5 % for other weightings and texture. For
        an impulse response without any weighting, the estimate is only 0.66 to 0.76 of the estimate for a weighted
        impulse response of equal width.

    References
    ----------
    Goodman, "Speckle Phenomena in Optics" (2007), section 4.4: autocorrelation of the intensity from that of the
    amplitude. Madsen, "Spectral properties of homogeneous and nonhomogeneous radar images", IEEE TAES 23 (1987).
    Matheron, "Principles of geostatistics", Economic Geology 58 (1963): semivariance.
    """
    return _of_windows(_windows(image_db, material, radar), radar) or _of_small_areas(image_db, material, radar)


def _of_windows(windows: NDArray[np.float64], radar: Radar) -> PointSpread | None:
    """Point spread from the power in windows, shape (windows, rows, columns); None if fewer than 20 are homogeneous."""
    if len(windows) < _WINDOWS[0]:
        return None
    both = [_semivariances(windows), _semivariances(windows.swapaxes(1, 2))]
    sill = 0.5 * (both[0][:, -1] + both[1][:, -1])
    mode = most_frequent_variance(sill)
    usual = (sill > _HOMOGENEOUS[0] * mode) & (sill < _HOMOGENEOUS[1] * mode)
    if np.count_nonzero(usual) < _WINDOWS[0]:
        return None
    each = [semivariances[usual] for semivariances in both]
    starts = [getattr(radar, f"{way}_resolution_m") / getattr(radar, f"{way}_spacing_m") for way in _WAYS]
    return _spread([partial(_mean, one) for one in each], [len(one) for one in each], starts, radar)


def _mean(semivariances: NDArray[np.float64], draw: Any) -> NDArray[np.float64]:
    return np.asarray(semivariances[draw].mean(axis=0))


def _of_small_areas(image_db: NDArray[np.float32], material: NDArray[np.uint8], radar: Radar) -> PointSpread | None:
    """Point spread from pairs of pixels of the same area; None if too few pairs are far enough apart."""
    both = pairs_of_areas(image_db, material)
    if both is None:
        return None
    # the first guess is one pixel, because a guess beyond the distances would make them all count as correlated
    found = _spread([one.semivariances for one in both], [len(one.sums) for one in both], [_NARROW, _NARROW], radar)
    # a limit would not tell whether the image is finer than the resolutions
    return None if found.range.at_least or found.azimuth.at_least else found


def _spread(both: Sequence[Semivariances], sizes: Sequence[int], starts: Sequence[float], radar: Radar) -> PointSpread:
    """Point spread from semivariances along each axis, with those of bootstrap samples of windows or tiles."""
    rng = np.random.default_rng(0)  # seed of the bootstrap only: the estimate itself is not random
    along, across = (
        Width.of(semivariances, rng.integers(size, size=(_DRAWS, size)), start, way, radar)
        for semivariances, size, start, way in zip(both, sizes, starts, _WAYS, strict=True)
    )
    return PointSpread(along, across, sizes[0])


def _windows(image_db: NDArray[np.float32], material: NDArray[np.uint8], radar: Radar) -> NDArray[np.float64]:
    """Power divided by the window's mean power, in windows of one material, shape (windows, rows, columns)."""
    height, width = (SIDE * step for step in independent_steps(radar))
    labels, values = windows_of(material, height, width), windows_of(image_db, height, width)
    first = labels[:, :1, :1]
    whole = np.flatnonzero(((labels == first) & (first != 0) & np.isfinite(values)).all(axis=(1, 2)))
    power = 10.0 ** (values[whole[:: max(1, -(-whole.size // _WINDOWS[1]))]].astype(np.float64) / 10.0)
    return np.asarray(power / power.mean(axis=(1, 2), keepdims=True))


def _semivariances(windows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Semivariances at distances from 1 pixel to half a window along axis 1, shape (windows, distances)."""
    n = windows.shape[1]
    lags = range(1, n // 2 + 1)
    return np.stack([0.5 * np.mean((windows[:, k:] - windows[:, : n - k]) ** 2, axis=(1, 2)) for k in lags], axis=1)


@cache
def _expected(lags: int) -> NDArray[np.float64]:
    """Autocorrelations of speckle of all trial widths, shape (widths, lags - 1); the same for each image."""
    return speckle_correlation(np.arange(1, lags) / _WIDTHS[:, None])


def _width(semivariances: NDArray[np.float64], expected: NDArray[np.float64], start: float) -> float:
    """Width of the impulse response in pixel spacings; ``start`` is a first guess.

    The observed autocorrelation is compared with ``expected``, the autocorrelations for the widths ``_WIDTHS``, shape
    (widths, distances). The distance beyond which speckle is assumed to be uncorrelated grows with the estimated width.
    """
    width, far = start, 0
    while (wanted := min(semivariances.size - 1, max(2, int(np.ceil(_FAR * width))))) > far:
        far = wanted
        seen = 1.0 - semivariances[: far - 1] / semivariances[far - 1 : far + 1].mean()
        width = float(_WIDTHS[int(np.argmin(((expected[:, : far - 1] - seen) ** 2).sum(axis=1)))])
    return width


def _correlation_length(semivariances: NDArray[np.float64], resolution: float) -> float:
    """Ratio of the sums of two autocorrelations over distances of both signs: observed, and for a given resolution."""
    lags = min(semivariances.size - 2, _REACH)
    seen = 1.0 - semivariances[:lags] / semivariances[lags : lags + 2].mean()
    expected = speckle_correlation(np.arange(1, lags + 1) / resolution)
    return float((1.0 + 2.0 * np.maximum(seen, 0.0).sum()) / (1.0 + 2.0 * expected.sum()))


def is_filtered(found: PointSpread | None, looks: Looks | None, radar: Radar) -> bool:
    """Whether an image is speckle-filtered, that is, has far more looks and a far larger point spread than configured.

    Smoothing of a detected image multiplies the number of looks and the correlation area by about the same factor.
    Other causes do not raise both: more looks of the sensor do not change the correlation, a coarser resolution does
    not change the looks, texture lowers the looks, and a wrong ``measurement.scale`` changes only the looks.

    Parameters
    ----------
    found, looks : PointSpread, Looks or None
        Estimates of point spread and looks of the image; the function returns False if one of them is missing.
    radar : Radar
        Resolutions and looks.

    References
    ----------
    Lee, "Digital image enhancement and noise filtering by use of local statistics", IEEE TPAMI 2 (1980).
    Oliver and Quegan, "Understanding Synthetic Aperture Radar Images", section 6.2: filters and their equivalent looks.
    """
    if found is None or looks is None:
        return False
    return looks.looks > _MORE_LOOKS * radar.looks and found.cells(radar) > _WIDER


def point_spread_findings(
    found: PointSpread, looks: Looks | None, radar: Radar, source: str, pixel_m: tuple[float, float] | None = None
) -> list[Finding]:
    """Finding on a point spread that differs from the configured resolutions.

    The list is empty if no other resolutions that the pixel spacings allow are nearer to the image's. The finding is a
    warning if the image is filtered, smoothed or coarser than the resolutions, because the simulated image then differs
    from the measured one; it is a note if the image is only finer, unless the configured resolution cell has more than
    2.25 times the area of the possible one that is nearest to the image's.

    If ``radar.looks`` has been set to the number of looks after filtering, only the correlation shows the filter. If
    the image does not have more looks than configured, it counts as smoothed in two cases:

    - The area of the point spread exceeds 2.25 times the area of the configured resolution cell.
    - The area of the point spread exceeds 1.5 times the area of the configured resolution cell, the correlation area
      exceeds 3 times the configured correlation area, and the number of looks is not reduced (texture reduces it).

    Parameters
    ----------
    found, looks, radar
        Arguments of :func:`is_filtered`.
    source : str
        Name of the image.
    pixel_m : (float, float), optional
        Sides along slant range and azimuth of the pixels of an image that was resampled by nearest neighbour, such as a
        georeferenced image [m]. The resampling widens the configured cell, so that only a width beyond the widened cell
        leads to an advice.
    """
    configured = (radar.range_resolution_m, radar.azimuth_resolution_m)
    sides = pixel_m or (0.0, 0.0)
    explained = [math.hypot(one, _RESAMPLED * side) for one, side in zip(configured, sides, strict=True)]
    widths = (found.range, found.azimuth)
    finer, unexplained = (
        any(sign * (own.width_m - one) > _CERTAIN * own.error_m for own, one in zip(widths, limits, strict=True))
        for sign, limits in ((-1.0, configured), (1.0, explained))
    )
    numbers: dict[str, float | str] = {}
    for way, own, declared in zip(_WAYS, widths, configured, strict=True):
        numbers[f"{way}_m"], numbers[f"{way}_error_m"] = own.width_m, own.error_m
        numbers[f"{way}_least"], numbers[f"{way}_declared_m"] = "at least " * own.at_least, declared
    numbers["correlation_ratio"] = found.smoothing
    if looks is not None and is_filtered(found, looks, radar):
        return [Finding("filtered", "warning", source, {**numbers, "looks_ratio": looks.looks / radar.looks})]
    as_many = looks is not None and looks.looks > _AS_MANY_LOOKS * radar.looks
    cells = found.cell_m2 / math.prod(explained)
    coarse = cells > _COARSE or (cells > _WIDER and found.smoothing > _SMOOTHED and as_many)
    if coarse and unexplained:
        return [Finding("smoothed", "warning", source, numbers)]
    if not (finer or unexplained):
        return []
    possible = {way: radar.possible_resolution_m(way, own.width_m) for way, own in zip(_WAYS, widths, strict=True)}
    if all(abs(possible[way] / getattr(radar, f"{way}_resolution_m") - 1.0) <= _SHAPE for way in _WAYS):
        return []
    far_finer = _COARSE * math.prod(possible.values()) < math.prod(configured)
    asked = {f"{way}_possible_m": width for way, width in possible.items()}
    severity: Severity = "warning" if unexplained or far_finer else "note"
    return [Finding("resolutions", severity, source, {**numbers, **asked})]
