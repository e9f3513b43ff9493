"""Correlation of a material's pixels, effective sample size, and covariances of the means of groups of pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

REACH_PX = 6  # lag beyond which speckle is assumed to be uncorrelated
_GROUPS, _GROUP = 24, 30  # groups of pixels of similar incidence: largest number of groups, smallest group
_SIGNIFICANT = 2.0  # standard errors; without this threshold, the positive noise of 168 lags would add up
_LEAST_SHARE = 0.05  # smallest eigenvalue of a matrix of groups, as a share of its smallest diagonal element
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
        """Means of the correlation, of its square and of its cube over all pairs of pixels from two groups.

        The mean of a group of n pixels has the variance of one pixel times the mean correlation, which is 1/n for
        uncorrelated pixels. For Hermite polynomials of order k of normally distributed pixel values, the mean of a
        group has the variance of one pixel times the mean of the k-th power of the correlation.

        Parameters
        ----------
        pixels : ndarray of int, shape (n,)
            Flat indices of the pixels in the image, increasing.
        group : ndarray of int, shape (n,)
            Group number of each pixel, from 0; no group is empty.
        size : int
            Number of groups.

        Returns
        -------
        ndarray, shape (3, size, size)
            One positive definite matrix for each of the three powers of the correlation.

        References
        ----------
        Bayley and Hammersley, "The effective number of independent observations in an autocorrelated time series",
        J. R. Statist. Soc. Suppl. 8 (1946). Lancaster, "The structure of bivariate distributions", Ann. Math. Statist.
        29 (1958): correlations of orthogonal polynomials.
        """
        powers = np.arange(1, _POWERS + 1)
        count = np.bincount(group, minlength=size)
        sums = np.zeros((_POWERS, size, size))
        for value, first, second in self._neighbours(pixels):
            joint = np.bincount(group[first] * size + group[second], minlength=size * size)
            sums += value ** powers[:, None, None] * joint.reshape(size, size)
        sums += np.swapaxes(sums, 1, 2)
        sums[:, np.arange(size), np.arange(size)] += count
        matrices = sums / np.multiply.outer(count, count)
        # eigenvalues are raised to at least 5 % of the smallest diagonal element of the matrix
        values, vectors = np.linalg.eigh(matrices)
        least = _LEAST_SHARE * np.diagonal(matrices, axis1=1, axis2=2).min(axis=1)[:, None]
        if (values >= least).all():
            return np.asarray(matrices)
        return np.asarray((vectors * np.maximum(values, least)[:, None]) @ np.swapaxes(vectors, 1, 2))

    def _neighbours(self, pixels: NDArray[np.int64]) -> Iterator[tuple[float, NDArray[np.int64], NDArray[np.int64]]]:
        """Correlation at each lag of one half of the plane, and the numbers of the pixels that are this lag apart."""
        row, column = np.divmod(pixels, self.width)
        for down, across in zip(*np.nonzero(self.lags), strict=True):
            lag = int(down) - REACH_PX, int(across) - REACH_PX
            if lag <= (0, 0):  # the opposite lag has the same correlation
                continue
            inside = np.flatnonzero((column + lag[1] >= 0) & (column + lag[1] < self.width))
            wanted = (row[inside] + lag[0]) * self.width + column[inside] + lag[1]
            place = np.minimum(np.searchsorted(pixels, wanted), pixels.size - 1)
            found = pixels[place] == wanted
            yield float(self.lags[down, across]), inside[found], place[found]

    def effective(self, pixels: NDArray[np.int64]) -> float:
        """Effective sample size of given pixels, from 1 to their number; see :meth:`effective_of`."""
        return float(self.effective_of(pixels, np.zeros(pixels.size, dtype=np.int64))[0])

    def effective_of(self, pixels: NDArray[np.int64], group: NDArray[np.int64]) -> Doubles:
        """Effective sample size of each group of pixels, from 1 to the number of its pixels, shape (groups,).

        The effective sample size is the number of independent pixels whose mean has the same variance as the mean of
        the group's pixels. Arguments are those of :meth:`pairs`.
        """
        count = np.bincount(group)
        sums = np.zeros(count.size)
        for value, first, second in self._neighbours(pixels):
            same = group[first] == group[second]
            sums += value * np.bincount(group[first[same]], minlength=count.size)
        return np.clip(1.0 / ((2.0 * sums + count) / count**2), 1.0, count)


def independent_pairs(group: NDArray[np.int64], size: int) -> Doubles:
    """Result of :meth:`Correlation.pairs` for uncorrelated pixels, shape (3, size, size)."""
    return np.repeat(np.diag(1.0 / np.bincount(group, minlength=size))[None], _POWERS, axis=0)


def estimate_correlation(
    image_db: NDArray[np.float32], inside: NDArray[np.int64], incidence_deg: NDArray[np.float32] | None = None
) -> Correlation:
    """Correlation of a material's pixels, estimated from an image.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Backscatter [dB].
    inside : ndarray of int
        Flat indices of the material's finite pixels.
    incidence_deg : ndarray, shape (rows, columns), optional
        Local incidence angle [deg]. The material's mean level at each incidence angle is subtracted, because a law can
        explain the variation of this level with the angle. If missing, the mean of the whole material is subtracted.

    Returns
    -------
    Correlation
        Correlation at the lags that are connected with lag 0 by lags of significant correlation (two standard errors),
        and 0 at all other lags.

    References
    ----------
    Bartlett, "On the theoretical specification and sampling properties of autocorrelated time series", J. R. Statist.
    Soc. Suppl. 8 (1946): standard error of a correlation.
    """
    shape = image_db.shape
    alone = np.zeros((2 * REACH_PX + 1, 2 * REACH_PX + 1))
    alone[REACH_PX, REACH_PX] = 1.0
    if not inside.size:
        return Correlation(alone, shape[1])
    size = tuple(scipy.fft.next_fast_len(n + REACH_PX + 1, real=True) for n in shape)

    def pairs(values: Doubles) -> Doubles:
        """Sums of the products of all pairs of pixels at each lag, from -6 to 6 rows and columns."""
        spectrum = scipy.fft.rfft2(values, s=size)
        lags = scipy.fft.irfft2(np.abs(spectrum) ** 2, s=size)
        window = np.arange(-REACH_PX, REACH_PX + 1)
        return np.asarray(lags[np.ix_(window, window)])

    there, values = np.zeros(image_db.size), np.zeros(image_db.size)
    there[inside] = 1.0
    of_material = image_db.ravel()[inside].astype(np.float64)
    angle = np.zeros(inside.size) if incidence_deg is None else incidence_deg.ravel()[inside].astype(np.float64)
    # groups of about equal sizes hold similar incidence angles
    groups = 1 if incidence_deg is None else max(1, min(_GROUPS, inside.size // _GROUP))
    group = np.empty(inside.size, dtype=np.int64)
    group[np.argsort(angle, kind="stable")] = np.arange(inside.size) * groups // inside.size
    values[inside] = without_trend(of_material, angle, group)
    count, products = pairs(there.reshape(shape)).round(), pairs(values.reshape(shape))
    variance = products[REACH_PX, REACH_PX] / inside.size
    if variance <= 0.0:  # all pixels are equal
        return Correlation(np.ones_like(alone), shape[1])
    correlation = np.where(count > 0.0, products / np.maximum(count, 1.0), 0.0) / variance
    # covariance at the largest lags comes from changes of level within the material, not from speckle
    edge = np.ones_like(correlation, dtype=bool)
    edge[1:-1, 1:-1] = False
    floor = float(np.mean(correlation[edge & (count > 0.0)])) if np.any(edge & (count > 0.0)) else 0.0
    correlation = np.clip((correlation - floor) / max(1.0 - floor, 1e-6), 0.0, 1.0)
    noise = 1.0 / np.maximum(count, 1.0)
    wide = np.maximum(correlation**2 - noise, 0.0).sum()  # sum of squared correlations, as in Bartlett's formula
    significant, _ = scipy.ndimage.label(correlation > _SIGNIFICANT * np.sqrt(wide * noise))
    return Correlation(np.where(significant == significant[REACH_PX, REACH_PX], correlation, 0.0), shape[1])


def without_trend(values: Doubles, incidence_deg: Doubles, group: NDArray[np.int64]) -> Doubles:
    """Residuals of values from a straight line in the incidence angle, fitted to each group, shape (pixels,)."""
    count = np.maximum(np.bincount(group), 1)
    away = incidence_deg - (np.bincount(group, incidence_deg) / count)[group]
    level = values - (np.bincount(group, values) / count)[group]
    slope = np.bincount(group, away * level) / np.maximum(np.bincount(group, away**2), 1e-12)
    return np.asarray(level - slope[group] * away)
