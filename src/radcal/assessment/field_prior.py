"""Prior of the standard deviations between and within the fields of one material, given the fields of the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf, stdtr, stdtrit

from radcal.assessment.budget import FIELD_FREEDOM
from radcal.measurement.patches import half_normal, scale_log_evidence

__all__ = ["MOST_FIELD_DB", "FieldPrior"]

MOST_FIELD_DB = 6.0
"""Largest standard deviation of fields [dB]: the end of the table of its likelihood."""

Doubles = NDArray[np.float64]

_SCALES = np.geomspace(0.1, 60.0, 96)  # scales of the half-normal priors, in units of ``field_db``
_PLACES = 4000  # standard deviations in the table of the distribution function


class FieldPrior:
    """Quantiles of the priors of the standard deviations between and within the fields of one material.

    The standard deviations of all materials of the image have half-normal priors with the same scale. The square of
    this scale has an inverse gamma prior with 2 degrees of freedom about the square of ``field_db``. For a single
    material, the prior of its standard deviations is then half-t with 2 degrees of freedom and scale ``field_db``. The
    fields of the other materials change the distribution of the scale. The scales between and within fields are
    independent before the other materials are seen.

    Parameters
    ----------
    scale_db : float
        Scale ``field_db`` [dB].
    others : sequence of ndarray, shape (grid, grid)
        Log likelihood of the standard deviations of each other material on the grid of both
        (:func:`radcal.measurement.field_spread.spread_table`).

    References
    ----------
    Gelman, "Prior distributions for variance parameters in hierarchical models", Bayesian Analysis 1 (2006), sections
    3.2 and 6: half-t priors, and a common prior whose scale is estimated from several variances.
    """

    def __init__(self, scale_db: float, others: Sequence[Doubles] = ()) -> None:
        self._tables: list[tuple[Doubles, Doubles]] = []
        most = 0.99 * MOST_FIELD_DB / max(scale_db, 1e-9)
        self._below = min(float(stdtr(FIELD_FREEDOM, most)), 1.0 - 1e-12)
        if not others or scale_db <= 0.0:
            return
        # logarithm of the scaled inverse chi density, times the steps of an even grid of log scales
        hyper = -FIELD_FREEDOM * (np.log(_SCALES) + 0.5 / _SCALES**2)
        hyper = hyper - np.log(np.exp(hyper).sum())
        prior = half_normal(scale_db * _SCALES)
        prior /= prior.sum(axis=1, keepdims=True)  # so that fields of unknown variation leave all scales alike
        log = hyper[:, None] + hyper + sum(scale_log_evidence(np.exp(one - one.max()), prior) for one in others)
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        tau = most * np.linspace(0.0, 1.0, _PLACES) ** 2
        for shares in (weight.sum(axis=1), weight.sum(axis=0)):
            below = erf(tau[:, None] / (_SCALES * np.sqrt(2.0))) @ shares
            self._tables.append((below / below[-1], tau))

    def quantiles(self, share: Doubles) -> Doubles:
        """Standard deviations between and within fields, in units of the scale, from shares in (0, 1), shape (m, 2)."""
        if not self._tables:
            return np.asarray(stdtrit(FIELD_FREEDOM, 0.5 + (self._below - 0.5) * share))
        return np.stack(
            [np.interp(column, *table) for column, table in zip(share.T, self._tables, strict=True)], axis=-1
        )
