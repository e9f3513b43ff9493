"""Likelihood of the cells of one material with the effects of its cells and fields integrated out.

The cell means y of a material are y = Z b + u[field] + c[cell] + e, with normal effects u of the fields (standard
deviation tau) and c of the cells (standard deviation s), and speckle e of known variance. The normal equations of all
columns are tabulated over s and tau, so that a step of the sampler costs the same whatever the number of cells. What is
interpolated is relative to cells of one common variance, which changes little from one s to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

_CELL = np.log(np.geomspace(0.01, 3.0, 32))
_FIELD = np.log(np.geomspace(0.01, 8.0, 32))
_LEAST = 1e-10  # share added to the sum of squares, which rounding could make negative


class Marginal:
    """Normal equations of columns of cells, over the standard deviations of cells and fields.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
        Columns Z, with the values y among them.
    variance : ndarray, shape (n,)
        Variance of each cell's speckle [dB^2].
    patch : ndarray of int, shape (n,)
        Field of each cell.

    References
    ----------
    Searle, Casella and McCulloch, "Variance Components" (1992), appendix M: inverse and determinant of a diagonal
    matrix plus one of rank one for each field.
    """

    def __init__(self, columns: Doubles, variance: Doubles, patch: NDArray[np.int64]) -> None:
        labels, field = np.unique(patch, return_inverse=True)
        k = columns.shape[1]
        self._cells, self._speckle = variance.size, float(np.exp(np.log(variance).mean()))
        self._gram = np.empty((_CELL.size, _FIELD.size, k, k))
        self._log_det = np.empty((_CELL.size, _FIELD.size))
        for i, cell in enumerate(np.exp(2.0 * _CELL)):
            weight = 1.0 / (variance + cell)
            weighted = columns * weight[:, None]
            own = columns.T @ weighted
            of_field = np.zeros((labels.size, k))
            np.add.at(of_field, field, weighted)
            total = np.bincount(field, weight, labels.size)
            for j, between in enumerate(np.exp(2.0 * _FIELD)):
                pulled = of_field * np.sqrt(between / (1.0 + between * total))[:, None]
                self._gram[i, j] = own - pulled.T @ pulled
                self._log_det[i, j] = np.log1p(between * total).sum() - np.log(weight).sum()
            self._gram[i] *= self._speckle + cell
            self._log_det[i] -= self._cells * np.log(self._speckle + cell)

    def at(self, log_cell: Doubles, log_field: Doubles) -> tuple[Doubles, Doubles]:
        """Gram matrices of the columns, (m, k, k), and log determinants, (m,), at logarithms of s and tau, (m,)."""
        (i, u), (j, v) = (_place(log_cell, _CELL), _place(log_field, _FIELD))
        corners = (i * _FIELD.size + j)[:, None] + np.array([0, 1, _FIELD.size, _FIELD.size + 1])
        shares = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v], axis=1)
        k = self._gram.shape[-1]
        gram = (shares[:, None] @ self._gram.reshape(-1, k * k)[corners]).reshape(-1, k, k)
        log_det = (shares * self._log_det.ravel()[corners]).sum(axis=1)
        common = self._speckle + np.exp(2.0 * np.clip(log_cell, _CELL[0], _CELL[-1]))
        return np.asarray(gram / common[:, None, None]), np.asarray(log_det + self._cells * np.log(common))


def _place(values: Doubles, grid: Doubles) -> tuple[NDArray[np.intp], Doubles]:
    """Grid point below each value, and distance from it in steps of the grid; values outside take the ends."""
    at = np.clip((values - grid[0]) / (grid[1] - grid[0]), 0.0, grid.size - 1.0)
    below = np.minimum(at.astype(np.intp), grid.size - 2)
    return below, at - below


def integrated(gram: Doubles, prior: Doubles, count: int) -> tuple[Doubles, Doubles]:
    """Gram matrices with the first ``count`` columns integrated out, and their half log determinants.

    Parameters
    ----------
    gram : ndarray, shape (m, k, k)
        Gram matrices.
    prior : ndarray, shape (m, count)
        Prior variance of each column's coefficient; its prior mean is 0.
    count : int
        Number of columns.

    Returns
    -------
    ndarray, shape (m, k - count, k - count)
        Schur complements.
    ndarray, shape (m,)
        Half of the log determinant of the precision, times the prior variance.
    """
    diagonal, of_prior = np.arange(count), 0.5 * np.log(prior).sum(axis=1)
    if gram.shape[1] == count + 1:  # one decomposition gives both results
        full = gram.copy()
        full[:, diagonal, diagonal] += 1.0 / prior
        full[:, count, count] += _LEAST * (1.0 + full[:, count, count])
        root = np.diagonal(np.linalg.cholesky(full), axis1=1, axis2=2)
        return root[:, count:, None] ** 2, np.log(root[:, :count]).sum(axis=1) + of_prior
    inner = gram[:, :count, :count].copy()
    inner[:, diagonal, diagonal] += 1.0 / prior
    root = np.linalg.cholesky(inner)
    left = np.linalg.solve(root, gram[:, :count, count:])
    half = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + of_prior
    return gram[:, count:, count:] - np.swapaxes(left, 1, 2) @ left, half


def normal_draws(gram: Doubles, prior: Doubles, count: int, rng: np.random.Generator) -> Doubles:
    """Draws of the first ``count`` coefficients from their normal distribution; the last column belongs to the values.

    Parameters
    ----------
    gram : ndarray, shape (m, count or more, k)
        Gram matrices.
    prior : ndarray, shape (m, count)
        Prior variances.

    Returns
    -------
    ndarray, shape (m, count)
    """
    inner = gram[:, :count, :count].copy()
    inner[:, np.arange(count), np.arange(count)] += 1.0 / prior
    mean = np.linalg.solve(inner, gram[:, :count, -1:])
    root = np.swapaxes(np.linalg.cholesky(inner), 1, 2)
    return np.asarray((mean + np.linalg.solve(root, rng.standard_normal((len(gram), count, 1))))[..., 0])
