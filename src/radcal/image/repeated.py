"""Pixels that a resampling by nearest neighbour repeats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.findings import Finding

__all__ = ["Repeated", "repeated_pixels"]

_LEAST_SHARE = 0.01  # of equal adjacent pixels
_APART = 8
# largest share of all pairs of pixels with equal values at which adjacent pixels are not equal by chance
_BY_CHANCE = 2e-4


@dataclass(frozen=True)
class Repeated:
    """Shares of adjacent pixels with equal values, along slant range and azimuth."""

    range: float
    azimuth: float

    def sides_m(self, radar: Radar) -> tuple[float, float]:
        """Sides of the pixels before the resampling along slant range and azimuth [m]; 0 where none is repeated.

        If a pixel has n copies in a row, the share 1 - 1/n of the adjacent pixels is equal.
        """
        ways = ((self.range, radar.range_spacing_m), (self.azimuth, radar.azimuth_spacing_m))
        along = [spacing / (1.0 - share) if share >= _LEAST_SHARE else 0.0 for share, spacing in ways]
        return along[0], along[1]

    def finding(self, source: str) -> Finding:
        """Finding on the repeated pixels of the image ``source``."""
        shares = {"range_percent": 100.0 * self.range, "azimuth_percent": 100.0 * self.azimuth}
        return Finding("pixels_repeated", "note", source, shares)


def repeated_pixels(image_db: NDArray[np.float32]) -> Repeated | None:
    """Shares of adjacent pixels that are repetitions.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.

    Returns
    -------
    Repeated or None
        Shares; None if fewer than 1 % of the adjacent pixels are equal, all of them, or if the values are so coarsely
        rounded that equal neighbours can be a chance.
    """
    shares = [_equal_share(image_db), _equal_share(image_db.T)]
    if not _LEAST_SHARE <= max(shares) < 1.0:
        return None
    apart = image_db[::_APART, ::_APART]  # repetitions of a pixel lie nearer to each other
    counts = np.unique(apart[np.isfinite(apart)], return_counts=True)[1].astype(np.float64)
    by_chance = float((counts * (counts - 1.0)).sum() / max(counts.sum() * (counts.sum() - 1.0), 1.0))
    return Repeated(*shares) if by_chance < _BY_CHANCE else None


def _equal_share(image_db: NDArray[np.float32]) -> float:
    """Share of the pairs of adjacent pixels along axis 0 that are equal, of those with values; 0 if there are none."""
    pairs = np.isfinite(image_db[1:]) & np.isfinite(image_db[:-1])
    return float(np.mean((image_db[1:] == image_db[:-1])[pairs])) if pairs.any() else 0.0
