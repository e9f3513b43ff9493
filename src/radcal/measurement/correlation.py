"""Correlation of the pixels of a material: what their number is worth, in all of them and between groups of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Correlation", "estimate_correlation", "independent_pairs", "without_trend"]

REACH_PX = 6  # lag beyond which speckle is assumed to be uncorrelated
_GROUPS, _GROUP = 24, 30  # groups of incidence in which a mean is taken: their largest number, and their least size
_SIGNIFICANT = 2.0  # standard errors: noise of 168 lags, which would count if it is positive, adds up otherwise
_LEAST_SHARE = 0.05  # smallest eigenvalue of the correlations of groups, as share of their smallest variance
_POWERS = 3

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Correlation:
    """Correlation of pixels by their lag in rows and columns.

    Attributes
    ----------
    lags : ndarray, shape (13, 13)
        Correlation at lags of -6 to 6 rows and columns, 1 in the middle; 0 where it is not significant.
    width : int
        Number of columns of the image.
    """

    lags: Doubles
    width: int

    def pairs(self, pixels: NDArray[np.int64], group: NDArray[np.int64], size: int) -> Doubles:
        """Mean correlation, its square and its cube over all pairs of pixels of two groups.

        The mean of a group of n pixels has the variance of a pixel times the first of them, which is 1/n without
        correlation. The sums of Hermite polynomials of order k of normal values have the k-th.

        Parameters
        ----------
        pixels : ndarray of int, shape (n,)
            Flat indices, increasing.
        group : ndarray of int, shape (n,)
            Group of each pixel, from 0; each has pixels.
        size : int
            Number of groups.

        Returns
        -------
        ndarray, shape (3, size, size)
            Positive definite matrices.

        References
        ----------
        Bayley and Hammersley, "The effective number of independent observations in an autocorrelated time series",
        J. R. Statist. Soc. Suppl. 8 (1946). Lancaster, "The structure of bivariate distributions", Ann. Math. Statist.
        29 (1958): correlations of orthogonal polynomials.
        """
        powers = np.arange(1, _POWERS + 1)
        count = np.bincount(group, minlength=size)
        sums = np.zeros((_POWERS, size, size))
        row, column = np.divmod(pixels, self.width)
        for down, across in zip(*np.nonzero(self.lags), strict=True):
            lag = int(down) - REACH_PX, int(across) - REACH_PX
            if lag <= (0, 0):  # the other half is the same
                continue
            inside = (column + lag[1] >= 0) & (column + lag[1] < self.width)
            wanted = (row[inside] + lag[0]) * self.width + column[inside] + lag[1]
            place = np.minimum(np.searchsorted(pixels, wanted), pixels.size - 1)
            found = pixels[place] == wanted
            joint = np.bincount(group[inside][found] * size + group[place[found]], minlength=size * size)
            sums += self.lags[down, across] ** powers[:, None, None] * joint.reshape(size, size)
        sums += np.swapaxes(sums, 1, 2)
        sums[:, np.arange(size), np.arange(size)] += count
        return _positive(sums / np.multiply.outer(count, count))

    def effective(self, pixels: NDArray[np.int64]) -> float:
        """Number of independent pixels whose mean has the variance of the mean of these, from 1 to their number."""
        together = self.pairs(pixels, np.zeros(pixels.size, dtype=np.int64), 1)[0, 0, 0]
        return float(np.clip(1.0 / together, 1.0, pixels.size))


def independent_pairs(group: NDArray[np.int64], size: int) -> Doubles:
    """The same as :meth:`Correlation.pairs` for pixels without correlation, shape (3, size, size)."""
    return np.repeat(np.diag(1.0 / np.bincount(group, minlength=size))[None], _POWERS, axis=0)


def _positive(matrices: Doubles) -> Doubles:
    """Matrices with eigenvalues of at least a small share of their smallest diagonal element."""
    values, vectors = np.linalg.eigh(matrices)
    least = _LEAST_SHARE * np.diagonal(matrices, axis1=1, axis2=2).min(axis=1)
    if (values >= least[:, None]).all():
        return matrices
    return np.asarray((vectors * np.maximum(values, least[:, None])[:, None]) @ np.swapaxes(vectors, 1, 2))


def estimate_correlation(
    image_db: NDArray[np.float32], inside: NDArray[np.int64], incidence_deg: NDArray[np.float32] | None = None
) -> Correlation:
    """Correlation of a material's pixels.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB].
    inside : ndarray of int
        Flat indices of the material's finite pixels.
    incidence_deg : ndarray, shape (rows, columns), optional
        Local incidence [deg]. The mean of the material at each incidence is subtracted, because what any law explains
        is no correlation of the pixels; without it, the mean of the whole material.

    Returns
    -------
    Correlation
        At lags that are connected with the lag of 0 by significant correlations (two standard errors).

    References
    ----------
    Bartlett, "On the theoretical specification and sampling properties of autocorrelated time series", J. R. Statist.
    Soc. Suppl. 8 (1946): standard error of a correlation.
    """
    from scipy import fft  # every process of the workflow imports this module, and few call it
    from scipy.ndimage import label

    shape = image_db.shape
    alone = np.zeros((2 * REACH_PX + 1, 2 * REACH_PX + 1))
    alone[REACH_PX, REACH_PX] = 1.0
    if not inside.size:
        return Correlation(alone, shape[1])
    size = tuple(fft.next_fast_len(n + REACH_PX + 1, real=True) for n in shape)

    def pairs(values: Doubles) -> Doubles:
        """Sum of products of all pairs of pixels at each lag, in both directions."""
        spectrum = fft.rfft2(values, s=size)
        lags = fft.irfft2(np.abs(spectrum) ** 2, s=size)
        window = np.arange(-REACH_PX, REACH_PX + 1)
        return np.asarray(lags[np.ix_(window, window)])

    there, values = np.zeros(image_db.size), np.zeros(image_db.size)
    there[inside] = 1.0
    of_material = image_db.ravel()[inside].astype(np.float64)
    angle = np.zeros(inside.size) if incidence_deg is None else incidence_deg.ravel()[inside].astype(np.float64)
    values[inside] = without_trend(of_material, angle, _groups(angle, 1 if incidence_deg is None else _GROUPS))
    count, products = pairs(there.reshape(shape)).round(), pairs(values.reshape(shape))
    variance = products[REACH_PX, REACH_PX] / inside.size
    if variance <= 0.0:  # one level everywhere
        return Correlation(np.ones_like(alone), shape[1])
    correlation = np.where(count > 0.0, products / np.maximum(count, 1.0), 0.0) / variance
    # covariance at the largest lags comes from changes of level within the material, not from speckle
    edge = np.ones_like(correlation, dtype=bool)
    edge[1:-1, 1:-1] = False
    floor = float(np.mean(correlation[edge & (count > 0.0)])) if np.any(edge & (count > 0.0)) else 0.0
    correlation = np.clip((correlation - floor) / max(1.0 - floor, 1e-6), 0.0, 1.0)
    noise = 1.0 / np.maximum(count, 1.0)
    wide = np.maximum(correlation**2 - noise, 0.0).sum()  # sum of the squares, as Bartlett's variance has it
    significant, _ = label(correlation > _SIGNIFICANT * np.sqrt(wide * noise))
    return Correlation(np.where(significant == significant[REACH_PX, REACH_PX], correlation, 0.0), shape[1])


def without_trend(values: Doubles, incidence_deg: Doubles, group: NDArray[np.int64]) -> Doubles:
    """Values minus a straight line in the incidence in each group of pixels, shape (pixels,)."""
    count = np.maximum(np.bincount(group), 1)
    away = incidence_deg - (np.bincount(group, incidence_deg) / count)[group]
    level = values - (np.bincount(group, values) / count)[group]
    slope = np.bincount(group, away * level) / np.maximum(np.bincount(group, away**2), 1e-12)
    return np.asarray(level - slope[group] * away)


def _groups(incidence_deg: ArrayLike, most: int) -> NDArray[np.int64]:
    """Groups of pixels of about equal size and alike incidence, shape (pixels,)."""
    order = np.argsort(np.asarray(incidence_deg), kind="stable")
    count = max(1, min(most, order.size // _GROUP))
    group = np.empty(order.size, dtype=np.int64)
    group[order] = np.arange(order.size) * count // max(order.size, 1)
    return group
