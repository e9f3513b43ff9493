"""Effects that the cells of all materials share, and errors of fixed laws, as columns of cells.

The cell means of a material, less its simulated level, are the sum of effects that all materials share, of an error
and a slope of its law, of a smooth error of the law's form, and of effects of fields and cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.posterior.cells import CellMeans

Doubles = NDArray[np.float64]

FLATTENING = 0.25
"""Ratio of the relative flattening of a law to the relative error of the resolutions (docs/uncertainty.md)."""
FORM_DEG = 8.0
"""Correlation length of the error of a law's form over the incidence [deg]."""
FIXED_FORMS = 4
"""Number of components of the error of a fixed law's form."""
_KNOT_DEG = 4.0


@dataclass(frozen=True)
class Observed:
    """Cells of one material in all passes, with the law at which the image was simulated.

    Attributes
    ----------
    cells : sequence of CellMeans
        Cells in each pass.
    law_db, slope_db : sequence of ndarray
        Level of the law at each cell [dB], and its slope [dB per degree].
    """

    cells: Sequence[CellMeans]
    law_db: Sequence[Doubles]
    slope_db: Sequence[Doubles]

    @property
    def size(self) -> int:
        """Number of cells in all passes."""
        return sum(one.size for one in self.cells)

    def together(self, name: str) -> NDArray[Any]:
        """Attribute of the cells of all passes, one after the other."""
        return np.concatenate([getattr(one, name) for one in self.cells])

    @property
    def above_db(self) -> Doubles:
        """Measured minus simulated mean of each cell [dB]."""
        each = zip(self.cells, self.law_db, strict=True)
        return np.concatenate([one.above_db(law) for one, law in each])


@dataclass(frozen=True)
class Shared:
    """Posterior of the effects that all materials share in p passes, as a normal distribution, given a radiometry.

    Attributes
    ----------
    chance : float
        Probability of this radiometry of the passes.
    mean : ndarray of float64, shape (4 p + 1,)
        Level, area exponent, noise, incidence by pass; point spread.
    covariance : ndarray of float64, shape (4 p + 1, 4 p + 1)
        Covariance of the shared effects.
    field : tuple of float
        Mean and standard deviation of the logarithm of the common sd of fields [log dB].
    """

    chance: float
    mean: Doubles
    covariance: Doubles
    field: tuple[float, ...]


def form_basis(angles_deg: Doubles, knots_deg: Doubles, count: int) -> Doubles:
    """Columns of a smooth error of a law's form at angles [deg], shape (n, count), of variance 1 at each angle.

    The leading components of a Gaussian process with a squared exponential correlation, interpolated between knots.
    Columns beyond the number of knots are zero.

    References
    ----------
    Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), section 4.3: eigenfunctions of a kernel.
    """
    away = (knots_deg[:, None] - knots_deg) / FORM_DEG
    values, vectors = np.linalg.eigh(np.exp(-0.5 * away**2))
    basis = (vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1][:, :count]
    columns = [np.interp(angles_deg, knots_deg, column) for column in basis.T]
    return np.stack(columns + [np.zeros(len(angles_deg))] * (count - len(columns)), axis=-1)


def law_columns(angle_deg: Doubles) -> Doubles:
    """Columns of the errors of a fixed law at angles [deg]: level, slope [per 10 degrees] and form, shape (n, 6)."""
    knots = np.arange(angle_deg.min() - 0.5, angle_deg.max() + 2.0 * _KNOT_DEG, _KNOT_DEG)
    away = (angle_deg - angle_deg.mean()) / 10.0
    return np.column_stack([np.ones(away.size), away, form_basis(angle_deg, knots, FIXED_FORMS)])


def common_columns(of: Observed, areas: Sequence[float], config: Uncertainty) -> Doubles:
    """Columns of the effects that all materials share, for the cells of one material in p passes, shape (n, 4 p + 1).

    ``areas`` holds the mean area of the ground in each pass [dB], about which the area is centred.
    """
    p = len(of.cells)
    found = [np.zeros((one.size, 4 * p + 1)) for one in of.cells]
    middle = float(np.concatenate(of.law_db).mean())
    for k, (one, law, slope, area) in enumerate(zip(of.cells, of.law_db, of.slope_db, areas, strict=True)):
        signal = 1.0 - one.share
        found[k][:, 4 * k] = 1.0
        found[k][:, 4 * k + 1] = signal * (one.area_db - area)
        found[k][:, 4 * k + 2] = config.noise_db * one.share
        found[k][:, 4 * k + 3] = config.incidence_floor_deg * signal * slope
        found[k][:, -1] = -FLATTENING * config.point_spread * signal * (law - middle)
    return np.concatenate(found)


def expected_effects(areas: Sequence[float], terms: Sequence[int]) -> Doubles:
    """Expected effects that all materials share, shape (4 p + 1,), if the area enters each pass with an exponent.

    The effect of the mean area is a level, because the area is centred.
    """
    found = np.zeros(4 * len(areas) + 1)
    found[0:-1:4], found[1:-1:4] = np.multiply(areas, terms), terms
    return found
