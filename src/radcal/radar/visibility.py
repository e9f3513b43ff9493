"""Visible parts of facets (shadow), and facets that overlap in slant range (layover).

The ground is assumed to be straight between the middles of neighbouring facets. A ray from the radar is described by
the tangent of its angle from nadir.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from radcal.compiled import njit

NEAR_HALF, FAR_HALF = 1, 2  # the visible half, for a facet of which only one half is visible


@njit()
def seen_from(near: Any, near_down: Any, far: Any, far_down: Any, horizon: Any) -> Any:
    """Beginning of the visible part of a straight piece of ground, as a fraction of the piece's length.

    Parameters
    ----------
    near, far : float
        Ground range of the near and of the far end [m].
    near_down, far_down : float
        Depth of the near and of the far end below the radar [m].
    horizon : float
        Largest tangent of the angle from nadir among all places on the same azimuth line that are nearer to the radar.

    Returns
    -------
    float
        Fraction of the way from the near to the far end; 1 if the piece is hidden or faces away from the radar.
    """
    first, last = near / near_down, far / far_down
    if last <= horizon or last <= first:
        return 1.0
    if first >= horizon:
        return 0.0
    return (horizon * near_down - near) / (far - near - horizon * (far_down - near_down))


@njit()
def part_seen(
    near: Any, near_down: Any, middle: Any, middle_down: Any, far: Any, far_down: Any, horizon: Any
) -> tuple[Any, Any]:
    """Visible interval of a facet that bends in its middle, as two fractions of the facet's length.

    The interval is empty if the first fraction exceeds the second. The angle from nadir is monotonic along each half of
    the facet, so that each half has at most one visible interval.
    """
    first = seen_from(near, near_down, middle, middle_down, horizon)
    second = seen_from(middle, middle_down, far, far_down, max(horizon, middle / middle_down))
    return 0.5 * first if first < 1.0 else 0.5 + 0.5 * second, 1.0 if second < 1.0 else 0.5


@njit()
def slant_extent(
    start: Any, end: Any, near: Any, near_down: Any, middle: Any, middle_down: Any, far: Any, far_down: Any
) -> tuple[Any, Any]:
    """Smallest and largest slant range [m] of the part of a bent facet between the fractions ``start`` and ``end``."""
    low, high = np.inf, -np.inf
    for at in (start, min(max(0.5, start), end), end):
        if at < 0.5:
            away, down = near + 2.0 * at * (middle - near), near_down + 2.0 * at * (middle_down - near_down)
        else:
            part = 2.0 * at - 1.0
            away, down = middle + part * (far - middle), middle_down + part * (far_down - middle_down)
        slant = np.hypot(away, down)
        low, high = min(low, slant), max(high, slant)
    return low, high


@njit()
def laid_over(slant: Any, share: Any, apart: Any, laid: Any) -> None:
    """Mask of the facets of a line in layover, which share their slant range with facets at a separate ground range.

    Parameters
    ----------
    slant : ndarray, shape (facets,)
        Slant range of each facet [m], in the order of ground range, nearest first.
    share : ndarray, shape (facets,)
        Visible share of each facet; facets without a visible part are ignored.
    apart : float
        Decrease of slant range along ground range above which two facets are in layover [m].
    laid : ndarray of bool, shape (facets,)
        Result: True for a visible facet if another visible facet has a larger ground range but a smaller slant range,
        or a smaller ground range but a larger slant range. Facets of the two kinds are the active and the passive part
        of a layover (Schreier, "SAR Geocoding: Data and Systems" (1993), chapter 6).
    """
    before, beyond = -np.inf, np.inf
    for f in range(slant.size):
        laid[f] = share[f] > 0.0 and before > slant[f] + apart
        if share[f] > 0.0:
            before = max(before, slant[f])
    for f in range(slant.size - 1, -1, -1):
        if share[f] > 0.0:
            laid[f] = laid[f] or beyond < slant[f] - apart
            beyond = min(beyond, slant[f])
