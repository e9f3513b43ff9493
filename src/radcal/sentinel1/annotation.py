"""Annotation, calibration and noise tables of a Sentinel-1 image, read from their XML files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.sentinel1.geolocation import GroundRange, between

Array = NDArray[np.float64]
Bounds = tuple[int, int, int, int]


@dataclass(frozen=True)
class Processing:
    """Processing of a swath along one axis of the image.

    Attributes
    ----------
    looks : int
        Number of looks.
    bandwidth_hz : float
        Bandwidth of a look [Hz].
    window : float
        Coefficient of the generalised Hamming window; 1 without a window.
    """

    looks: int
    bandwidth_hz: float
    window: float


@dataclass(frozen=True)
class Swath:
    """Processing parameters of one swath, and the parts of the image that show this swath.

    Attributes
    ----------
    name : str
        Name, such as "IW1".
    bounds : tuple of (int, int, int, int)
        First line, last line, first pixel and last pixel of each part of the image that shows the swath; empty if the
        swath is the whole image.
    range, azimuth : Processing
        Processing in range and azimuth.
    """

    name: str
    bounds: tuple[Bounds, ...]
    range: Processing
    azimuth: Processing

    def shows(self, line: float, pixel: float) -> bool:
        """Whether a position of the image lies in this swath."""
        return not self.bounds or any(a <= line <= b and c <= pixel <= d for a, b, c, d in self.bounds)


@dataclass(frozen=True)
class Annotation:
    """Quantities that radcal reads from the annotation of an image.

    Attributes
    ----------
    mission, mode, product_type, polarisation : str
        Texts such as "S1B", "IW", "GRD" and "VV".
    start : str
        Time of the first line (UTC).
    pass_direction : str
        ``ascending`` or ``descending``.
    frequency_hz : float
        Carrier frequency [Hz].
    noise_removed : bool
        Whether the processor has subtracted thermal noise.
    azimuth_spacing_m : float
        Pixel spacing in azimuth [m].
    swaths : tuple of Swath
        Swaths of the image.
    ground : GroundRange
        Orbit and conversion from slant range to pixels.
    grid : ndarray, shape (points, 5)
        Geolocation grid: line, pixel, longitude [deg], latitude [deg] and height [m] of each point.
    """

    mission: str
    mode: str
    product_type: str
    polarisation: str
    start: str
    pass_direction: str
    frequency_hz: float
    noise_removed: bool
    azimuth_spacing_m: float
    swaths: tuple[Swath, ...]
    ground: GroundRange
    grid: Array


@dataclass(frozen=True)
class LookUpTable:
    """Table of a quantity at some pixels on some lines of an image; every line has its own list of pixels.

    Attributes
    ----------
    lines : ndarray, shape (n,)
        Line numbers, ascending; a line may lie outside the image.
    pixels, values : tuple of n ndarrays
        Pixel numbers on each line, ascending, and values of the quantity at these pixels.
    """

    lines: Array
    pixels: tuple[Array, ...]
    values: tuple[Array, ...]

    def at(self, line: Array, pixel: Array) -> Array:
        """Values of the quantity at positions of the image, by bilinear interpolation; constant outside the table.

        Parameters
        ----------
        line, pixel : ndarray, shape (k,)
            Line and pixel of each position; all numbers are finite.
        """
        return between(self.lines, line, lambda k, there: np.interp(pixel[there], self.pixels[k], self.values[k]))


@dataclass(frozen=True)
class NoiseTable:
    """Thermal noise in squared digital numbers: a table of values over range, multiplied by factors along azimuth.

    Attributes
    ----------
    over_range : LookUpTable
        Table of the noise over range.
    along : tuple of (bounds, lines, factors)
        For each block of a swath: its bounds (first line, last line, first pixel, last pixel), some of its lines, and
        the noise factors at these lines. Empty for products of processors before version 2.9, which have no factors.
    """

    over_range: LookUpTable
    along: tuple[tuple[Bounds, Array, Array], ...] = ()

    def at(self, line: Array, pixel: Array) -> Array:
        """Thermal noise at positions of the image, in squared digital numbers, shape (k,)."""
        factor = np.ones(line.shape)
        row, column = np.round(line), np.round(pixel)  # the bounds of blocks are whole pixels
        for (first, last, near, far), lines, factors in self.along:
            inside = (row >= first) & (row <= last) & (column >= near) & (column <= far)
            factor[inside] = np.interp(line[inside], lines, factors)
        return self.over_range.at(line, pixel) * factor


def annotation_of(root: Any) -> Annotation:
    """Annotation of an image, from the root element of the annotation's XML tree.

    Raises
    ------
    ValueError
        An element is missing, or its text is not a number where a number is expected.
    """
    about, image = "generalAnnotation/productInformation", "imageAnnotation/imageInformation"
    start = _text(root, f"{image}/productFirstLineUtcTime")
    shape = (int(_number(root, f"{image}/numberOfLines")), int(_number(root, f"{image}/numberOfSamples")))
    return Annotation(
        mission=_text(root, "adsHeader/missionId"),
        mode=_text(root, "adsHeader/mode"),
        product_type=_text(root, "adsHeader/productType"),
        polarisation=_text(root, "adsHeader/polarisation").upper(),
        start=start,
        pass_direction=_text(root, f"{about}/pass").lower(),
        frequency_hz=_number(root, f"{about}/radarFrequency"),
        noise_removed=_text(
            root, "imageAnnotation/processingInformation/thermalNoiseCorrectionPerformed", "false"
        ).lower()
        == "true",
        azimuth_spacing_m=_number(root, f"{image}/azimuthPixelSpacing"),
        swaths=_swaths(root),
        ground=_ground_range(root, start, shape),
        grid=_grid(root),
    )


def calibration_of(root: Any) -> LookUpTable:
    """Table of sigmaNought, the divisor A of digital numbers; raises the errors of :func:`annotation_of`."""
    return _table(root, "calibrationVectorList/calibrationVector", "sigmaNought")


def noise_of(root: Any) -> NoiseTable:
    """Noise tables of an image, from the root element of their XML tree; raises the errors of :func:`annotation_of`."""
    if root.find("noiseVectorList/noiseVector") is not None:  # processors before version 2.9
        return NoiseTable(_table(root, "noiseVectorList/noiseVector", "noiseLut"))
    blocks = []
    for block in root.findall("noiseAzimuthVectorList/noiseAzimuthVector"):
        lines, factors = _numbers(block, "line"), _numbers(block, "noiseAzimuthLut")
        if lines.shape != factors.shape:
            raise ValueError(f"it has {factors.size} noiseAzimuthLut on {lines.size} lines")
        blocks.append((_bounds(block), lines, factors))
    return NoiseTable(_table(root, "noiseRangeVectorList/noiseRangeVector", "noiseRangeLut"), tuple(blocks))


def _table(root: Any, path: str, quantity: str) -> LookUpTable:
    vectors = sorted(_all(root, path), key=lambda vector: _number(vector, "line"))
    pixels = tuple(_numbers(vector, "pixel") for vector in vectors)
    values = tuple(_numbers(vector, quantity) for vector in vectors)
    for one, other in zip(pixels, values, strict=True):
        if one.shape != other.shape or np.any(np.diff(one) <= 0):
            raise ValueError(f"it has {other.size} {quantity} at {one.size} pixels, expected ascending pixels")
    if quantity == "sigmaNought" and min(part.min() for part in values) <= 0:
        raise ValueError("it has sigmaNought of 0 or less")
    return LookUpTable(np.array([_number(vector, "line") for vector in vectors]), pixels, values)


def _bounds(part: Any) -> Bounds:
    """First line, last line, first pixel and last pixel of a part of the image."""
    names = ("firstAzimuthLine", "lastAzimuthLine", "firstRangeSample", "lastRangeSample")
    first, last, near, far = (int(_number(part, name)) for name in names)
    return first, last, near, far


def _swaths(root: Any) -> tuple[Swath, ...]:
    merged = {
        _text(part, "swath"): tuple(map(_bounds, part.findall("swathBoundsList/swathBounds")))
        for part in root.findall("swathMerging/swathMergeList/swathMerge")
    }
    found = []
    for part in _all(root, "imageAnnotation/processingInformation/swathProcParamsList/swathProcParams"):
        name = _text(part, "swath")
        processing = (_processing(part, f"{way}Processing") for way in ("range", "azimuth"))
        found.append(Swath(name, merged.get(name, ()), *processing))
    return tuple(found)


def _processing(part: Any, way: str) -> Processing:
    windowed = _text(part, f"{way}/windowType", "NONE").upper() != "NONE"
    return Processing(
        int(_number(part, f"{way}/numberOfLooks")),
        _number(part, f"{way}/lookBandwidth"),
        _number(part, f"{way}/windowCoefficient") if windowed else 1.0,
    )


def _ground_range(root: Any, start: str, shape: tuple[int, int]) -> GroundRange:
    orbit = _all(root, "generalAnnotation/orbitList/orbit")
    if len(orbit) < 4:
        raise ValueError(f"its orbit has {len(orbit)} state vectors, expected at least 4")
    conversions = _all(root, "coordinateConversion/coordinateConversionList/coordinateConversion")
    image = "imageAnnotation/imageInformation"
    coefficients = [_numbers(part, "srgrCoefficients") for part in conversions]
    if len({part.size for part in coefficients}) != 1:
        raise ValueError("its srgrCoefficients differ in number")
    return GroundRange(
        orbit_s=np.array([_seconds(_text(part, "time"), start) for part in orbit]),
        position_m=np.array([[_number(part, f"position/{axis}") for axis in "xyz"] for part in orbit]),
        velocity_m_s=np.array([[_number(part, f"velocity/{axis}") for axis in "xyz"] for part in orbit]),
        line_s=_number(root, f"{image}/azimuthTimeInterval"),
        conversion_s=np.array([_seconds(_text(part, "azimuthTime"), start) for part in conversions]),
        near_m=np.array([_number(part, "sr0") for part in conversions]),
        coefficients=np.array(coefficients),
        range_spacing_m=_number(root, f"{image}/rangePixelSpacing"),
        shape=shape,
    )


def _grid(root: Any) -> Array:
    points = _all(root, "geolocationGrid/geolocationGridPointList/geolocationGridPoint")
    names = ("line", "pixel", "longitude", "latitude", "height")
    return np.array([[_number(point, name) for name in names] for point in points])


def _seconds(time: str, start: str) -> float:
    """Time between ``start``, the time of the first line, and ``time`` [s]."""
    try:
        return float((np.datetime64(time, "ns") - np.datetime64(start, "ns")) / np.timedelta64(1, "ns") * 1e-9)
    except ValueError:
        raise ValueError(f"its time {time!r} is none") from None


def _all(node: Any, path: str) -> list[Any]:
    """XML elements at a path; a ValueError is raised if there is none."""
    found: list[Any] = node.findall(path)
    if not found:
        raise ValueError(f"it has no {path}")
    return found


def _text(node: Any, path: str, default: str | None = None) -> str:
    found = node.findtext(path)
    if found is None or not found.strip():
        if default is not None:
            return default
        raise ValueError(f"it has no {path}")
    return str(found).strip()


def _number(node: Any, path: str) -> float:
    return float(_numbers(node, path)[0])


def _numbers(node: Any, path: str) -> Array:
    text = _text(node, path)
    try:
        found = np.array(text.split(), dtype=np.float64)
    except ValueError:
        raise ValueError(f"its {path} is {text[:40]!r}, expected numbers") from None
    if not np.isfinite(found).all():
        raise ValueError(f"its {path} is {text[:40]!r}, expected finite numbers")
    return found
