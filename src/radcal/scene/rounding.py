"""Rounding of an elevation model's heights to a step, such as whole metres, and the resulting error of heights."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["height_step_m", "rounding_error_m"]

_FINEST_M = 1e-3  # smallest step that is detected; single precision itself has steps of 0.0005 m at 8 km of height
_TOLERANCE = 0.01  # tolerance of multiples [steps]; most decimal fractions have no exact binary number
_SAMPLE = 2_000_000  # number of heights in which the step is sought; all heights are then checked


def height_step_m(heights_m: NDArray[np.float64]) -> float:
    """Step of which the rounded heights of an elevation model are multiples.

    The step is the smallest difference between two heights, if all differences between heights are multiples of it. The
    heights of a plane (an artificial elevation model, or a constant) may be multiples of a step without being rounded;
    the step of a plane is therefore 0.

    Parameters
    ----------
    heights_m : ndarray, shape (rows, columns)
        Heights of the raster's own pixels, before any interpolation [m]; NaN for a pixel without height.

    Returns
    -------
    float
        Step [m]; 0 if the heights are not rounded, or if the step is below 1 mm.
    """
    known = heights_m[np.isfinite(heights_m)]
    if known.size == 0:
        return 0.0
    distinct = np.unique(known[:: max(1, known.size // _SAMPLE)])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 0.5 * _FINEST_M]  # smaller gaps are errors of decimal fractions in binary numbers
    if gaps.size == 0:
        return 0.0
    span = float(distinct[-1] - distinct[0])
    single = float(gaps[gaps < 1.5 * gaps.min()].mean())  # a mean, in which errors of single precision cancel
    step = span / round(span / single)  # the span of all heights gives more digits than one difference
    if step < _FINEST_M or not _multiples(known - distinct[0], step):
        return 0.0
    curved = (np.diff(heights_m, 2, axis=0), np.diff(heights_m, 2, axis=1))
    return step if any(np.nanmax(np.abs(c), initial=0.0) > 0.5 * step for c in curved) else 0.0


def _multiples(values: NDArray[Any], step: float) -> bool:
    """Whether all values are multiples of a step."""
    ratio = values / step
    return bool(np.max(np.abs(ratio - np.round(ratio))) < _TOLERANCE)


def rounding_error_m(step_m: float) -> float:
    """Standard error of heights [m] that are rounded to multiples of a step.

    Parameters
    ----------
    step_m : float
        Step [m].

    Returns
    -------
    float
        Standard deviation of a uniform distribution as wide as the step: step / sqrt(12), 0.29 m for whole metres. The
        difference of two neighbouring heights with independent errors has a standard error of step / sqrt(6). On gentle
        slopes, heights form terraces, and the errors of neighbouring heights are nearly equal. On a slope of f steps
        per pixel, with f from 0 to 1, the standard error of the difference of two neighbouring heights is step sqrt(f
        (1 - f)); the mean square of this error over f is also step^2 / 6.

    References
    ----------
    Widrow, Kollar and Liu, "Statistical theory of quantization", IEEE Transactions on Instrumentation and Measurement
    45 (1996). Carter, "The effect of data precision on the calculation of slope and aspect using gridded DEMs",
    Cartographica 29 (1992).
    """
    return step_m / float(np.sqrt(12.0))
