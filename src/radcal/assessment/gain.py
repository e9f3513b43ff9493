"""Comparison of the errors of two predictors, law and constant, with a standard error from the scatter of fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["POWER", "Gain", "field_gains", "power"]

POWER = 2.0
"""Least power of a comparison that counts: at this power, a right law looks worse than a constant in 2.3 % of cases."""
_LEAST_DB2 = 1e-6  # least squared error of a field: speckle always leaves one
Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Gain:
    """Gain in accuracy if the levels of fields are predicted by a law and not by a constant.

    Attributes
    ----------
    mean : float
        Mean over the fields of ln(rms error of the constant / rms error of the law); NaN without fields. Because of the
        logarithm, a single field with large errors does not decide.
    error : float
        Jackknife standard error of the mean gain, from the scatter of the fields; infinite for a single field.
    fields : int
        Number of fields.
    """

    mean: float
    error: float
    fields: int

    @classmethod
    def of(cls, field: NDArray[np.int64], gains: Doubles) -> Gain:
        """Mean gain over fields, from k gains and the labels of their fields; gains of one field are averaged first."""
        labels, of = np.unique(field, return_inverse=True)
        if not labels.size:
            return cls(float("nan"), float("inf"), 0)
        each = np.bincount(of, gains) / np.bincount(of)
        error = float(each.std(ddof=1) / np.sqrt(each.size)) if each.size > 1 else float("inf")
        return cls(float(each.mean()), error, int(each.size))

    @property
    def better(self) -> bool:
        """Whether the law is better than the constant by more than one standard error."""
        return bool(self.mean > self.error)

    @property
    def worse(self) -> bool:
        """Whether the constant is better than the law by more than one standard error."""
        return bool(-self.mean > self.error)

    @property
    def ratio(self) -> float:
        """Ratio of the rms error of the law to that of the constant, as a geometric mean over the fields."""
        return float(np.exp(-self.mean))


def field_gains(
    patch: NDArray[np.int64], law_error_db: Doubles, constant_error_db: Doubles
) -> tuple[NDArray[np.int64], Doubles]:
    """Gain of the law in each field: logarithm of the ratio of the constant's rms error to the law's.

    Parameters
    ----------
    patch : ndarray of int, shape (cells,)
        Field of each cell.
    law_error_db, constant_error_db : ndarray, shape (cells,)
        Errors of the means of cells that law and constant predict [dB].

    Returns
    -------
    field : ndarray of int, shape (k,)
        Labels of the fields, increasing.
    gain : ndarray, shape (k,)
        Gain in each field.
    """
    labels, of = np.unique(patch, return_inverse=True)
    count = np.maximum(np.bincount(of, minlength=labels.size), 1)
    law, constant = (
        np.maximum(np.bincount(of, error**2, labels.size) / count, _LEAST_DB2)
        for error in (law_error_db, constant_error_db)
    )
    return labels, np.asarray(0.5 * np.log(constant / law))


def power(patch: NDArray[np.int64], difference_db: Doubles, common: Doubles, own: Doubles) -> float:
    r"""Power of a comparison: expected gain of a right law over a constant, in standard errors of this gain.

    Let the predictions of the mean of cell c by law and constant differ by :math:`\delta_c`, and let the prediction by
    the law have the error :math:`e_c`. The squared error of the constant then exceeds that of the law by
    :math:`\delta_c^2 + 2 \delta_c e_c`. Summed over the cells, the difference of the squared errors has the expectation
    :math:`\sum \delta_c^2` and four times the variance of :math:`\sum \delta_c e_c`. If all cells hold the same angles,
    law and constant predict the same means, and the comparison has no power.

    Parameters
    ----------
    patch : ndarray of int, shape (cells,)
        Field of each cell.
    difference_db : ndarray, shape (cells,)
        Difference of the two predictions of each cell [dB].
    common, own : ndarray, shape (cells,)
        Variance of the error that the cells of a field share, and variance of the error of each single cell [dB^2].

    Returns
    -------
    float
    """
    _, of = np.unique(patch, return_inverse=True)
    shared = np.bincount(of, difference_db * np.sqrt(common)) ** 2
    variance = 4.0 * (shared.sum() + np.sum(difference_db**2 * own))
    return float(np.sum(difference_db**2) / np.sqrt(max(variance, 1e-300)))
