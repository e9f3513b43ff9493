"""Comparison of the errors of two predictors, law and constant, with a standard error over fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["POWER", "Gain", "field_gains", "power"]

POWER = 2.0
"""Power from which a comparison is believed: a right law then looks worse than a constant in 2.3 % of the cases."""
_LEAST_DB2 = 1e-6  # squared error of a field, which has speckle at least
Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Gain:
    """Gain of a law over a constant.

    Attributes
    ----------
    mean : float
        Mean over the fields of ln(rms error of the constant / rms error of the law): each field counts in proportion,
        so that one field far off does not decide. NaN for no field.
    error : float
        Standard error of the mean, from the scatter of the fields (the jackknife's); infinite for a single field.
    fields : int
        Number of fields.
    """

    mean: float
    error: float
    fields: int

    @classmethod
    def of(cls, field: NDArray[np.int64], gains: Doubles) -> Gain:
        """Gain from the gains of fields, shape (k,); several values of the same field are averaged first."""
        labels, of = np.unique(field, return_inverse=True)
        if not labels.size:
            return cls(float("nan"), float("inf"), 0)
        each = np.bincount(of, gains) / np.bincount(of)
        error = float(each.std(ddof=1) / np.sqrt(each.size)) if each.size > 1 else float("inf")
        return cls(float(each.mean()), error, int(each.size))

    @property
    def better(self) -> bool:
        """Whether the law is better than the constant beyond the standard error."""
        return bool(self.mean > self.error)

    @property
    def worse(self) -> bool:
        """Whether the constant is better than the law beyond the standard error."""
        return bool(-self.mean > self.error)

    @property
    def ratio(self) -> float:
        """Error of the law over that of the constant, geometric mean over the fields."""
        return float(np.exp(-self.mean))


def field_gains(
    patch: NDArray[np.int64], law_error_db: Doubles, constant_error_db: Doubles
) -> tuple[NDArray[np.int64], Doubles]:
    """Logarithm of the ratio of rms errors, constant over law, of each field.

    Parameters
    ----------
    patch : ndarray of int, shape (cells,)
        Field of each cell.
    law_error_db, constant_error_db : ndarray, shape (cells,)
        Errors of both predictions [dB].

    Returns
    -------
    field : ndarray of int, shape (k,)
        Labels, increasing.
    gain : ndarray, shape (k,)
    """
    labels, of = np.unique(patch, return_inverse=True)
    count = np.maximum(np.bincount(of, minlength=labels.size), 1)
    law, constant = (
        np.maximum(np.bincount(of, error**2, labels.size) / count, _LEAST_DB2)
        for error in (law_error_db, constant_error_db)
    )
    return labels, np.asarray(0.5 * np.log(constant / law))


def power(patch: NDArray[np.int64], difference_db: Doubles, common: Doubles, own: Doubles) -> float:
    r"""Power of a comparison: the gain that a right law is expected to show, in standard errors of it.

    Where two predictions differ by :math:`\delta_c` and the first is right but for errors e, the difference of the
    squared errors is :math:`\delta_c^2 + 2 \delta_c e_c`. Its sum over the cells is :math:`\sum \delta_c^2`, the
    variance of the predicted means about the constant, in the mean; its variance is four times that of
    :math:`\sum \delta_c e_c`. Ground whose folds hold all angles alike has :math:`\delta_c` near 0, and no power.

    Parameters
    ----------
    patch : ndarray of int, shape (cells,)
        Field of each cell.
    difference_db : ndarray, shape (cells,)
        Difference of the two predictions of each cell [dB].
    common, own : ndarray, shape (cells,)
        Variance of the error that the cells of a field share, and of each cell's own [dB^2].

    Returns
    -------
    float
    """
    _, of = np.unique(patch, return_inverse=True)
    shared = np.bincount(of, difference_db * np.sqrt(common)) ** 2
    variance = 4.0 * (shared.sum() + np.sum(difference_db**2 * own))
    return float(np.sum(difference_db**2) / np.sqrt(max(variance, 1e-300)))
