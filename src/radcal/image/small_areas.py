"""Semivariances of speckle in areas too small for windows, pooled over all areas of an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.image.looks import looks_of_log_variance

LEAST_LAGS = 4
"""Smallest number of distances for an estimate: one or two with correlation, and two beyond it."""
LEAST_PAIRS = 150
"""Smallest number of pairs at the largest distance."""
_LAGS = 16  # largest distance [pixels]
_TILE, _LEAST_TILES = 16, 8  # side of a tile [pixels], and smallest number of tiles with pairs at the largest distance
# pixels that are left out at the edges of areas, where an image that is not yet registered shows the neighbouring
# material, and smallest numbers of pairs with which so many are left out
_EDGES = ((4, 2000), (2, 1000), (1, LEAST_PAIRS))
_HOMOGENEOUS = (0.5, 1.7)  # times the median semivariance; other tiles have edges, texture or point targets
_TERMS = 500  # of the series; for one look and equal pixels, the rest is 0.1 % of the variance

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Pairs:
    """Pairs of pixels of one area along one axis of the image, at distances from 1 pixel.

    Attributes
    ----------
    sums : ndarray, shape (tiles, distances)
        Half the sum of the squared differences of the pairs in each tile of the image [dB^2].
    counts : ndarray, shape (tiles, distances)
        Numbers of pairs.
    """

    sums: Doubles
    counts: Doubles

    def semivariances(self, tiles: Any) -> Doubles:
        r"""Semivariances of the power of speckle, relative to those of uncorrelated pixels, shape (distances,).

        They are derived from the semivariances of dB values, in which the level of an area cancels. If the power of
        speckle of L looks has the correlation :math:`\rho`, its logarithm has the correlation
        :math:`\sum_k \rho^k \Gamma(k) \Gamma(L) / (k \Gamma(L + k)) / \psi'(L)`. L is that of the semivariance at the
        two largest distances.

        Parameters
        ----------
        tiles : ndarray of int, or slice
            Numbers of the tiles, each as often as it counts.

        References
        ----------
        Lancaster, "The structure of bivariate distributions", Ann. Math. Statist. 29 (1958): the bivariate gamma
        distribution in Laguerre polynomials, from whose coefficients of the logarithm the series follows.
        """
        of_log = self.sums[tiles].sum(axis=0) / np.maximum(self.counts[tiles].sum(axis=0), 1.0)
        sill = float(of_log[-2:].mean())
        power, log = _correlations(looks_of_log_variance(sill))
        seen = 1.0 - of_log / sill
        # negative correlations are those of noise about 0, where the relation is linear
        return np.asarray(1.0 - np.where(seen > 0.0, np.interp(seen, log, power), seen * power[1] / log[1]))


def _correlations(looks: float) -> tuple[Doubles, Doubles]:
    """Correlations of the power of speckle from 0 to 1, and those of its logarithm."""
    k, power, powers = _powers()
    terms = np.exp(scipy.special.gammaln(k) + scipy.special.gammaln(looks) - scipy.special.gammaln(looks + k)) / k
    return power, np.asarray(powers @ terms / float(scipy.special.polygamma(1, looks)))


@cache
def _powers() -> tuple[NDArray[np.int64], Doubles, Doubles]:
    """Exponents of the series, correlations from 0 to 1, and their powers; the same in each draw of the bootstrap."""
    k, power = np.arange(1, _TERMS + 1), np.linspace(0.0, 1.0, 201)
    return k, power, power[:, None] ** k


def pairs_of_areas(image_db: NDArray[np.float32], material: NDArray[np.uint8]) -> tuple[Pairs, Pairs] | None:
    """Pairs of pixels along range and along azimuth between which all pixels have a value and the same material.

    Up to four pixels at the edges of the areas are left out, and tiles whose semivariance differs much from the median.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB], NaN where a pixel has no value.
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several.

    Returns
    -------
    (Pairs, Pairs) or None
        Pairs at distances of up to 16 pixels; None if fewer than 150 pairs in 8 tiles of 16 x 16 pixels are 4 pixels
        apart.
    """
    for edge, pairs in _EDGES:
        inner = np.where(np.isfinite(image_db), _without_edges(material, edge), 0)
        both = _pairs(image_db, inner, pairs), _pairs(image_db.T, inner.T, pairs)
        if all(one.counts.shape[1] >= LEAST_LAGS for one in both):
            return _homogeneous(both[0]), _homogeneous(both[1])
    return None


def _without_edges(material: NDArray[np.uint8], edge: int) -> NDArray[np.uint8]:
    """Material ids, 0 where another id is at most ``edge`` rows and columns away."""
    side = 2 * edge + 1
    return np.where(
        scipy.ndimage.maximum_filter(material, side) == scipy.ndimage.minimum_filter(material, side),
        material,
        np.uint8(0),
    )


def _pairs(image_db: NDArray[np.float32], material: NDArray[np.uint8], least: int) -> Pairs:
    """Pairs along axis 0, in the tiles that hold any, at all distances with at least ``least`` pairs in 8 tiles."""
    rows, columns = image_db.shape
    values = np.where(material > 0, image_db, 0.0).astype(np.float64)
    across = -(-columns // _TILE)
    tile = (np.arange(rows)[:, None] // _TILE) * across + np.arange(columns) // _TILE
    size = int(tile[-1, -1]) + 1
    joined = (material[1:] == material[:-1]) & (material[1:] > 0)
    together = np.ones_like(joined)  # pairs without another area between them, by their first pixel
    sums, counts = list[Doubles](), list[Doubles]()
    for lag in range(1, min(_LAGS, rows - 1) + 1):
        together = together[: rows - lag] & joined[lag - 1 :]
        at = tile[: rows - lag][together]
        count = np.bincount(at, minlength=size)
        if at.size < least or np.count_nonzero(count) < _LEAST_TILES:
            break
        squares = (values[lag:] - values[:-lag])[together] ** 2
        sums.append(np.bincount(at, 0.5 * squares, size).astype(np.float64))
        counts.append(count.astype(np.float64))
    if not sums:
        return Pairs(np.zeros((0, 0)), np.zeros((0, 0)))
    held = counts[0] > 0
    return Pairs(np.stack(sums, axis=1)[held], np.stack(counts, axis=1)[held])


def _homogeneous(pairs: Pairs) -> Pairs:
    """Pairs in the tiles whose semivariance, beyond the first distance, is near the median of all pairs."""
    counts = pairs.counts[:, 1:].sum(axis=1)
    each = pairs.sums[:, 1:].sum(axis=1) / np.maximum(counts, 1.0)
    order = np.argsort(each)
    middle = each[order][np.searchsorted(np.cumsum(counts[order]), 0.5 * counts.sum())]
    usual = (each > _HOMOGENEOUS[0] * middle) & (each < _HOMOGENEOUS[1] * middle)
    return Pairs(pairs.sums[usual], pairs.counts[usual])
