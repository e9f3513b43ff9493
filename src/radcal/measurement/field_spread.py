"""Likelihood of the variation between and within the fields of one material, without a law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Residuals, spread_log_likelihood

__all__ = ["spread_table"]

Doubles = NDArray[np.float64]

_KNOWN = 1e-6  # prior information on the level of a bin [1/dB^2]: practically none


def spread_table(grounds: Sequence[Ground]) -> Doubles:
    """Log likelihood of the fields' standard deviations from cells that share a bin, on the grid of both.

    A free level of each bin of each pass takes the place of the law, so that a wrong law does not change the result.
    The differences between cells are independent of the means of the bins, which enter the rest of the likelihood, if
    all bins contain equal shares of the fields (``docs/uncertainty.md`` gives the loss if they do not). Cells of
    several passes in one field share the effect of this field.
    """
    slopes, inside = [], []
    for ground in grounds:
        edges = incidence_edges(ground.incidence_deg, "auto")
        member = class_of(ground.incidence_deg, edges)
        columns = np.column_stack([member[:, None] == np.arange(len(edges) - 1), ground.values_db]).astype(np.float64)
        means = ground.cells.mean(columns)
        slopes.append(means[:, :-1])
        # differences between the bins inside one cell, which no effect of a field or of a cell changes
        left = columns - means[ground.cells.of_pixel]
        inside.append(left.T @ (left / (ground.sampling * ground.cells.count)[ground.cells.of_pixel, None]))
    of_bins = block_diag(*slopes)
    data = Residuals(
        np.concatenate([ground.cells.mean(ground.values_db) for ground in grounds]),
        np.concatenate([ground.sampling for ground in grounds]),
        np.concatenate([ground.cells.patch for ground in grounds]),
        of_bins,
        _KNOWN * np.eye(of_bins.shape[1]) + block_diag(*(one[:-1, :-1] for one in inside)),
        np.concatenate([one[:-1, -1] for one in inside]),
    )
    table = spread_log_likelihood(data)
    return np.asarray(table - table.max())
