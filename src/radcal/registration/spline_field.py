"""Displacement fields of cubic B-splines with a Gaussian process prior, and their posterior.

A displacement field is a Gaussian process with a standard deviation and a correlation length; the data enter as a
quadratic log-likelihood of the field's coefficients. The standard deviation and the correlation length are chosen so
that the data are most probable (largest evidence; MacKay, "Bayesian interpolation", Neural Computation 4 (1992),
section 4). The standard error of the field is the standard deviation of its posterior distribution.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
import scipy
from numpy.typing import NDArray

CELL_PX = 8
_SPACING_PX = 24.0
_MOST_CONTROLS = 64  # largest number along the longer side, which limits the cost of the factorisations
_ORDER = 3  # power of the Laplacian in the prior's precision, whose band is then as wide as that of the data
_DRAWS = 64
_RATIO = 1.5  # ratio between neighbouring values on the grid of priors
# Steps on the grid of priors, in spread and length. The data determine the amplitude of high frequencies, spread /
# length^2, better than either spread or length, so that the evidence has a ridge along (2, 1).
_WAYS = ((0, 0), (1, 0), (-1, 0), (1, 1), (-1, -1), (2, 1), (-2, -1))
_SPREADS_PX = (0.03, 100.0)  # smallest and largest standard deviation
_SHORTEST = 0.7  # correlation length, in spacings of the control points
_LONGEST = 2.0  # correlation length, in sides of the image

Bands = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Prior of a displacement field: Gaussian process with a standard deviation and a correlation length.

    Attributes
    ----------
    spread_px : float
        Standard deviation of each component of the displacement [pixels].
    length_px : float
        1/e correlation length of Gaussian-filtered noise with the same spectrum at low frequencies as the field
        [pixels]. The correlation length of the field itself is about 0.7 of ``length_px``, because its spectrum falls
        off less steeply at high frequencies.
    """

    spread_px: float
    length_px: float


def _laplacian(n: int) -> scipy.sparse.csr_array:
    """Matrix of the quadratic form that sums the squared differences between neighbours along a line."""
    one = scipy.sparse.eye_array(n, format="csr")
    difference = one[1:] - one[:-1]
    return scipy.sparse.csr_array(difference.T @ difference)


@dataclass(frozen=True)
class Lattice:
    """Control points of a B-spline field over an image, the same at every scale of the image pyramid.

    Coefficients of a field have shape (2, control rows, control columns) and are in pixels of the full image.
    """

    shape: tuple[int, int]

    @cached_property
    def spacing_px(self) -> float:
        """Distance of neighbouring control points [pixels]."""
        return max(_SPACING_PX, max(self.shape) / _MOST_CONTROLS)

    def _axes(self, step: float, scale: int) -> tuple[scipy.sparse.csr_array, scipy.sparse.csr_array]:
        """B-spline bases of both axes at the centres of every ``step`` pixels of an image reduced by ``scale``."""
        bases = []
        for length in self.shape:
            n = int(np.ceil(length // scale / step))
            points = np.minimum((np.arange(n) + 0.5) * step * scale, length)
            x = points / self.spacing_px
            first = np.floor(x).astype(int)
            t = x - first
            cubic = (1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3
            place = np.repeat(np.arange(points.size), 4), (first[:, None] + np.arange(4)).ravel()
            shape = (points.size, int(np.floor(length / self.spacing_px)) + 4)
            bases.append(scipy.sparse.csr_array(((np.stack(cubic, axis=1) / 6).ravel(), place), shape=shape))
        return bases[0], bases[1]

    def field(self, coefficients: NDArray[np.float64], scale: int = 1) -> NDArray[np.float64]:
        """Displacement [pixels of the image reduced by ``scale``], shape (2, rows, columns)."""
        rows, columns = self._axes(1.0, scale)
        return np.stack([rows @ (part @ columns.T.toarray()) for part in coefficients]) / scale

    def length(self, draws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Root-mean-square length of the displacement at each pixel, over fields drawn at random.

        The coefficients ``draws`` of these fields have shape (draws, 2, control rows, control columns).
        """
        rows, columns = (axis.toarray() for axis in self._axes(CELL_PX, 1))
        squares = np.square(rows @ draws @ columns.T).sum(axis=1).mean(axis=0)
        wide = np.sqrt(squares).repeat(CELL_PX, axis=0).repeat(CELL_PX, axis=1)
        return np.asarray(wide[: self.shape[0], : self.shape[1]])

    def cells(self, scale: int) -> scipy.sparse.csr_array:
        """B-spline basis at the centres of cells, shape (cells, control points)."""
        return scipy.sparse.csr_array(scipy.sparse.kron(*self._axes(CELL_PX, scale), format="csr"))

    @cached_property
    def size(self) -> tuple[int, int]:
        """Number of control points along rows and columns."""
        rows, columns = self._axes(1.0, 1)
        return rows.shape[1], columns.shape[1]

    @cached_property
    def order(self) -> NDArray[np.int64]:
        """Indices of the coefficients in the order that gives matrices the narrowest band."""
        axes = (1, 2, 0) if self.size[0] >= self.size[1] else (2, 1, 0)
        return np.arange(2 * self.size[0] * self.size[1]).reshape(2, *self.size).transpose(axes).ravel()

    def bands(self, matrix: scipy.sparse.csr_array) -> Bands:
        """Upper diagonals of a symmetric matrix of all coefficients, as LAPACK stores them."""
        width = 2 * (_ORDER * min(self.size) + _ORDER) + 1
        place = np.empty_like(self.order)
        place[self.order] = np.arange(self.order.size)
        entries = matrix.tocoo()
        row, column = place[entries.row], place[entries.col]
        upper = row <= column
        bands = np.zeros((width + 1, self.order.size))
        np.add.at(bands, (width + row[upper] - column[upper], column[upper]), entries.data[upper])
        return bands

    @cached_property
    def _roughness(self) -> tuple[NDArray[np.float64], list[Bands]]:
        """Eigenvalues of the lattice's Laplacian matrix, and the bands of the powers of this matrix."""
        rows, columns = self.size
        laplacian = scipy.sparse.csr_array(
            scipy.sparse.kron(_laplacian(rows), scipy.sparse.eye_array(columns))
            + scipy.sparse.kron(scipy.sparse.eye_array(rows), _laplacian(columns))
        )
        powers = [scipy.sparse.eye_array(rows * columns, format="csr")]
        for _ in range(_ORDER):
            powers.append(powers[-1] @ laplacian)
        along, across = (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in self.size)
        return np.add.outer(along, across).ravel(), [self.bands(scipy.sparse.block_diag([p, p])) for p in powers]

    def precision(self, prior: Prior) -> tuple[Bands, float]:
        """Bands of the prior's precision matrix, and the log-determinant of this matrix.

        The prior is a Matern field of smoothness 2. Its spectral density is (1 + (k l / 2)^2 / 3)^-3 at the angular
        frequency k [1 / pixel], where l is the correlation length, and approximates the Gaussian exp(-(k l / 2)^2)
        (Lindgren, Rue and Lindstroem, J. R. Statist. Soc. B 73 (2011), eq. 2).
        """
        roughness, powers = self._roughness
        bend = (0.5 * prior.length_px / self.spacing_px) ** 2 / _ORDER
        level = float(np.mean((1.0 + roughness * bend) ** -_ORDER)) / prior.spread_px**2
        binomial = (1.0, 3.0, 3.0, 1.0)
        bands = reduce(np.add, (level * c * bend**n * p for n, (c, p) in enumerate(zip(binomial, powers, strict=True))))
        return bands, 2.0 * float(np.sum(_ORDER * np.log1p(roughness * bend) + np.log(level)))


@dataclass(frozen=True)
class Data:
    """Quadratic log-likelihood -x H x / 2 + g x, where x are the coefficients of a field minus those of a start field.

    Attributes
    ----------
    lattice : Lattice
        The control points.
    curvature : ndarray
        Bands of the matrix H [1 / pixel^2].
    pull : ndarray, shape (2 * control points,)
        Vector g [1 / pixel], in the order of the bands.
    """

    lattice: Lattice
    curvature: Bands
    pull: NDArray[np.float64]

    def given(self, prior: Prior) -> SplinePosterior:
        """Posterior of the coefficients, given data and prior.

        Raises
        ------
        scipy.linalg.LinAlgError
            The prior is so wide or so narrow that the precision matrix is numerically singular.
        """
        precision, log_determinant = self.lattice.precision(prior)
        factor = scipy.linalg.cholesky_banded(self.curvature + precision, overwrite_ab=True, check_finite=False)
        pivots = factor[-1] ** 2
        if pivots.min() < pivots.size * np.finfo(np.float64).eps * pivots.max():  # rounding errors alone
            raise scipy.linalg.LinAlgError("the precision matrix is numerically singular")
        mean = scipy.linalg.cho_solve_banded((factor, False), self.pull, check_finite=False)
        evidence = 0.5 * log_determinant - float(np.log(factor[-1]).sum()) + 0.5 * float(self.pull @ mean)
        return SplinePosterior(self.lattice, prior, mean, factor, evidence)

    def best(self, near: Prior) -> SplinePosterior:
        """Posterior under the prior of largest evidence, found by hill climbing on a grid of priors from ``near``."""
        lows = _SPREADS_PX[0], _SHORTEST * self.lattice.spacing_px
        highs = _SPREADS_PX[1], _LONGEST * max(self.lattice.shape)
        known: dict[tuple[int, int], float] = {}
        best: SplinePosterior | None = None  # only the best is kept, because its factor is large

        def evidence(place: tuple[int, int]) -> float:
            nonlocal best
            if place not in known:
                known[place] = -np.inf
                values = [_RATIO**n for n in place]
                if all(low <= v <= high for low, v, high in zip(lows, values, highs, strict=True)):
                    with suppress(scipy.linalg.LinAlgError):
                        posterior = self.given(Prior(*values))
                        known[place] = posterior.evidence
                        best = posterior if best is None or posterior.evidence > best.evidence else best
            return known[place]

        first = np.clip((near.spread_px, near.length_px), lows, highs)
        floors, ceilings = (np.log(limit) / np.log(_RATIO) for limit in (lows, highs))
        places = np.clip(np.round(np.log(first) / np.log(_RATIO)), np.ceil(floors), np.floor(ceilings))
        here = int(places[0]), int(places[1])
        while True:
            # of equal values max returns the first, which is the present place, so that the climb ends
            there = max(((here[0] + a, here[1] + b) for a, b in _WAYS), key=evidence)
            if there == here:
                return best or self.given(near)
            here = there


@dataclass(frozen=True)
class SplinePosterior:
    """A Gaussian distribution of the coefficients of a field.

    Attributes
    ----------
    lattice : Lattice
        The control points.
    prior : Prior
        Prior from which the posterior was computed.
    mean : ndarray, shape (2 * control points,)
        Most probable coefficients [pixels], in the order of the bands.
    factor : ndarray
        Bands of the Cholesky factor of the precision matrix.
    evidence : float
        Log-probability of the data under the prior, up to a constant.
    """

    lattice: Lattice
    prior: Prior
    mean: NDArray[np.float64]
    factor: Bands
    evidence: float

    def coefficients(self) -> NDArray[np.float64]:
        """Posterior mean [pixels], shape (2, control rows, control columns)."""
        return np.asarray(self._unordered(self.mean[None])[0])

    def standard_error_px(self) -> NDArray[np.float64]:
        """Standard error of the displacement's length [pixels], shape (rows, columns), from 64 posterior draws."""
        normal = np.random.default_rng(0).standard_normal((self.mean.size, _DRAWS))
        draws, _ = scipy.linalg.lapack.dtbtrs(self.factor, normal, uplo="U")
        return self.lattice.length(self._unordered(np.asarray(draws).T))

    def _unordered(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        out: NDArray[np.float64] = np.empty_like(vectors)
        out[:, self.lattice.order] = vectors
        return out.reshape(-1, 2, *self.lattice.size)
