"""Rounding of an elevation model's heights to whole metres or another step, and the error that it leaves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["height_step_m", "rounding_error_m"]

_FINEST_M = 1e-3  # single precision has steps of 0.0005 m at the height of the Himalaya
_TOLERANCE = 0.01  # steps by which a height may differ from a multiple: decimal fractions have no exact binary number
_SAMPLE = 2_000_000  # number of heights in which the step is sought; all heights are then checked


def height_step_m(heights_m: NDArray[np.float64]) -> float:
    """Step to whose multiples the heights are rounded.

    The step is the smallest difference of two heights, provided that all differences are multiples of it. The heights
    of a plane (an invented elevation model, or a constant) are multiples of a step without having been rounded, so
    that a plane has none.

    Parameters
    ----------
    heights_m : ndarray, shape (rows, columns)
        Heights of the raster's own pixels, before any interpolation [m]; NaN where there is none.

    Returns
    -------
    float
        Step [m]; 0 where the heights are not rounded, or to less than a millimetre.
    """
    known = heights_m[np.isfinite(heights_m)]
    if known.size == 0:
        return 0.0
    distinct = np.unique(known[:: max(1, known.size // _SAMPLE)])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 0.5 * _FINEST_M]  # decimal fractions of other steps may differ by a rounding error
    if gaps.size == 0:
        return 0.0
    span = float(distinct[-1] - distinct[0])
    single = float(gaps[gaps < 1.5 * gaps.min()].mean())  # of heights in single precision, whose errors cancel
    step = span / round(span / single)  # more digits than a single difference has
    if step < _FINEST_M or not _multiples(known - distinct[0], step):
        return 0.0
    curved = (np.diff(heights_m, 2, axis=0), np.diff(heights_m, 2, axis=1))
    return step if any(np.nanmax(np.abs(c), initial=0.0) > 0.5 * step for c in curved) else 0.0


def _multiples(values: NDArray[Any], step: float) -> bool:
    """Whether all values are multiples of a step."""
    ratio = values / step
    return bool(np.max(np.abs(ratio - np.round(ratio))) < _TOLERANCE)


def rounding_error_m(step_m: float) -> float:
    """Standard error of heights that are rounded to multiples of a step.

    Parameters
    ----------
    step_m : float
        Step [m].

    Returns
    -------
    float
        Standard deviation of an even distribution as wide as the step, step / sqrt(12): 0.29 m for whole metres. Two
        neighbours with independent errors of this size differ by an error of step / sqrt(6). Neighbours on gentle
        ground share most of their error and form terraces: on a slope of f steps a pixel the error of their difference
        is step sqrt(f (1 - f)), whose mean square over f from 0 to 1 is the same.

    References
    ----------
    Widrow, Kollar and Liu, "Statistical theory of quantization", IEEE Transactions on Instrumentation and Measurement
    45 (1996). Carter, "The effect of data precision on the calculation of slope and aspect using gridded DEMs",
    Cartographica 29 (1992).
    """
    return step_m / float(np.sqrt(12.0))
