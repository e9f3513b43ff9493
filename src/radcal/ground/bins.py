"""Incidence-angle bins (classes of local incidence): edges, and statistics of the pixels in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import MeasurementError
from radcal.ground.correlation import independent_pairs, without_trend

FEWEST = 30  # smallest number of pixels in a bin
_AUTO = (4, 8)  # smallest and largest number of bins
_AUTO_SPAN_DEG = 2.0  # width of a bin: a law of 0.3 dB/deg changes in it by less than a third of speckle's sd
_FAR = 6.0  # number of robust standard deviations, which one pixel in 1,500 of single-look speckle in dB exceeds
_LEAST_DB2 = 1e-6  # smallest variance of a bin
_FREEDOM = 10  # degrees of freedom that an estimate of a variance needs
_NODES = 24  # incidence angles that represent a bin


@dataclass(frozen=True)
class Classes:
    """Target pixels of one material, grouped by incidence-angle bin, with statistics of each bin.

    Attributes
    ----------
    edges_deg : ndarray, shape (n + 1,)
        Edges of the bins [deg].
    member : ndarray of int, shape (pixels,)
        Bin of each pixel.
    count : ndarray of int, shape (n,)
        Number of pixels in each bin.
    pairs : ndarray, shape (3, n, n)
        Means of the correlation, of its square and of its cube over all pairs of pixels from two bins, or from one bin
        (:meth:`radcal.ground.correlation.Correlation.pairs`).
    cumulants : ndarray, shape (n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] of the measured pixels.
    nodes_deg : ndarray, shape (n, m)
        Incidence angles that represent each bin [deg]: quantiles in the middles of m equal shares of the bin's pixels.
    speckle_db2 : ndarray, shape (n,)
        Variance in each bin of the measured pixels of one cell at equal incidence [dB^2]: the part of the variance that
        would be random again in another image of the same ground.
    """

    edges_deg: NDArray[np.float64]
    member: NDArray[np.int64]
    count: NDArray[np.int64]
    pairs: NDArray[np.float64]
    cumulants: NDArray[np.float64]
    nodes_deg: NDArray[np.float64]
    speckle_db2: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Number of incidence-angle bins."""
        return self.count.size

    @property
    def effective(self) -> NDArray[np.float64]:
        """Effective sample size of each bin, shape (n,).

        The effective sample size is the number of independent pixels whose mean has the same variance as the mean of
        the correlated pixels.
        """
        return np.asarray(1.0 / np.diagonal(self.pairs[0]))

    def compared(self, draws: int) -> Classes:
        """Bins for a comparison with a run that shows the same pixels in several draws of speckle.

        The difference between measured and simulated statistics has 1 + 1 / draws times the variance of the measured
        statistics.
        """
        return replace(self, pairs=(1.0 + 1.0 / draws) * self.pairs)

    def shares(self, label: NDArray[np.int64], labels: int) -> NDArray[np.float64]:
        """Share of the pixels of each incidence-angle bin that lie in each labelled area, shape (n, labels)."""
        joint = np.bincount(self.member * labels + label, minlength=self.size * labels)
        return np.asarray(joint.reshape(self.size, labels) / self.count[:, None])


def incidence_edges(incidence_deg: ArrayLike, classes: int | Literal["auto"]) -> NDArray[np.float64]:
    """Edges of incidence-angle bins that hold about equal numbers of pixels.

    Parameters
    ----------
    incidence_deg : array_like, shape (n,)
        Local incidence of a material's target pixels [deg].
    classes : int or 'auto'
        Number of bins; with ``auto``, one bin for every 2 degrees between the 5 % and 95 % quantiles of the angles, but
        at least 4 and at most 8. The number of bins is smaller if a bin would hold fewer than 30 pixels, or if many
        pixels have the same angle.

    Returns
    -------
    ndarray, shape (m + 1,)
        Increasing edges; the first and last are the smallest and largest angle of all pixels [deg].

    Raises
    ------
    MeasurementError
        There are no pixels, or an angle is not finite.
    """
    angle = np.sort(np.asarray(incidence_deg, dtype=np.float64))
    if angle.size == 0 or not np.isfinite(angle).all():
        raise MeasurementError(
            f"target.incidence_classes: {classes} classes of {angle.size} pixels, expected pixels, all with a finite "
            "local incidence."
        )
    if classes == "auto":
        span = float(np.subtract(*np.quantile(angle, [0.95, 0.05])))
        wanted = int(np.clip(round(span / _AUTO_SPAN_DEG), *_AUTO))
    else:
        wanted = classes
    wanted = max(1, min(wanted, angle.size // FEWEST))
    inner = np.unique(np.quantile(angle, np.arange(1, wanted) / wanted))
    edges = [angle[0]]
    for edge in inner:  # many pixels of one angle may leave a bin with hardly any pixel
        first, last = np.searchsorted(angle, [edges[-1], edge])
        if last - first >= FEWEST and angle.size - last >= FEWEST:
            edges.append(edge)
    return np.array([*edges, angle[-1]])


def class_of(incidence_deg: ArrayLike, edges_deg: ArrayLike) -> NDArray[np.int64]:
    """Index of the incidence-angle bin of each angle [deg]; an angle outside all bins belongs to the nearest one."""
    inner = np.asarray(edges_deg, dtype=np.float64)[1:-1]
    return np.searchsorted(inner, np.asarray(incidence_deg, dtype=np.float64), side="right")


def class_cumulants(values_db: ArrayLike, member: NDArray[np.int64], size: int) -> NDArray[np.float64]:
    """Mean, variance and third central moment of the backscatter in each incidence-angle bin.

    Parameters
    ----------
    values_db : array_like, shape (pixels,)
        Backscatter, measured or simulated [dB].
    member : ndarray of int, shape (pixels,)
        Bin of each pixel.
    size : int
        Number of bins.

    Returns
    -------
    ndarray, shape (size, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3], not corrected for biases of order 1/n. The variance
        is at least 1e-6 dB^2, even if all pixels are equal.
    """
    values = np.asarray(values_db, dtype=np.float64)
    count = np.bincount(member, minlength=size)
    mean = np.bincount(member, values, size) / count
    left = values - mean[member]
    variance = np.maximum(np.bincount(member, left**2, size) / count, _LEAST_DB2)
    return np.stack([mean, variance, np.bincount(member, left**3, size) / count], -1)


def make_classes(
    values_db: ArrayLike,
    incidence_deg: ArrayLike,
    classes: int | Literal["auto"],
    pairs: Callable[[NDArray[np.int64], int], NDArray[np.float64]] = independent_pairs,
    cells: NDArray[np.int64] | None = None,
) -> Classes:
    """Incidence-angle bins of a material's target pixels.

    Parameters
    ----------
    values_db : array_like, shape (pixels,)
        Measured backscatter [dB].
    incidence_deg : array_like, shape (pixels,)
        Local incidence [deg].
    classes : int or 'auto'
        Number of bins, as for :func:`incidence_edges`.
    pairs : callable
        Function that gives the correlations of the pixels by bin, such as
        :meth:`radcal.ground.ground.Ground.pairs`; by default the pixels are independent.
    cells : ndarray of int, shape (pixels,), optional
        Number of each pixel's cell, from 0; by default all pixels lie in one cell.

    Returns
    -------
    Classes

    Raises
    ------
    MeasurementError
        There are no pixels, or an angle is not finite.
    """
    angle = np.asarray(incidence_deg, dtype=np.float64)
    edges = incidence_edges(angle, classes)
    member = class_of(angle, edges)
    size = edges.size - 1
    count = np.bincount(member, minlength=size)
    middle = (np.arange(_NODES) + 0.5) / _NODES
    cumulants = class_cumulants(values_db, member, size)
    # variance about a straight line in the incidence angle, and about the means of the cells
    left = without_trend(np.asarray(values_db, dtype=np.float64), angle, member)
    freedom = count - 2.0
    if cells is not None:
        of_cell = np.bincount(cells)
        left -= (np.bincount(cells, left) / of_cell)[cells]
        freedom = freedom - np.bincount(member, 1.0 / of_cell[cells])
    found = np.bincount(member, left**2) / np.maximum(freedom, 1.0)
    # with few degrees of freedom the estimate is poor; the variance of all pixels of the bin is an upper bound
    return Classes(
        edges_deg=edges,
        member=member,
        count=count,
        pairs=pairs(member, size),
        cumulants=cumulants,
        nodes_deg=np.stack([np.quantile(angle[member == k], middle) for k in range(size)]),
        speckle_db2=np.where(freedom < _FREEDOM, cumulants[:, 1], np.clip(found, _LEAST_DB2, cumulants[:, 1])),
    )


def winsorised(values_db: ArrayLike, member: NDArray[np.int64]) -> NDArray[np.float64]:
    """Values clipped at 6 robust standard deviations from the median of their incidence-angle bin.

    A pixel whose power is zero except for rounding errors has about -100 dB. A single pixel of -100 dB would dominate
    the third moment of a bin.

    Parameters
    ----------
    values_db : array_like, shape (pixels,)
        Measured backscatter [dB].
    member : ndarray of int, shape (pixels,)
        Bin of each pixel.

    Returns
    -------
    ndarray, shape (pixels,)

    References
    ----------
    Huber and Ronchetti, "Robust Statistics", 2nd edition (2009), sections 1.7 and 5.1: winsorising, and the
    median absolute deviation times 1.4826 as standard deviation.
    """
    values = np.array(values_db, dtype=np.float64)
    for k in np.unique(member):
        inside = member == k
        median = np.median(values[inside])
        limit = _FAR * 1.4826 * np.median(np.abs(values[inside] - median))
        if limit > 0.0:
            values[inside] = np.clip(values[inside], median - limit, median + limit)
    return values
