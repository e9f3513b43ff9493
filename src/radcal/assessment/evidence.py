"""Log likelihood of the incidence-angle bins of one pass, for many points of X and the other unknowns at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.budget import Budget
from radcal.assessment.compiled_bins import cumulants_at, shifted_cumulants, whitened
from radcal.assessment.curves import PER_DEG
from radcal.calibration.misfit import BinMisfit
from radcal.calibration.moments import from_cumulants, to_cumulants
from radcal.calibration.objectives.objective import Objective
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.ground import Ground
from radcal.measurement.patches import GRID_DB, Residuals, Spread, spread_log_likelihood
from radcal.radar.texture import equal_texture, log_speckle_cumulants

__all__ = ["Evidence", "Unknowns"]

Doubles = NDArray[np.float64]

_EVERY = 3  # every third angle of a bin is enough for the change of its cumulants by an error of the incidence
_HERMITE = (np.arange(5) - 2.0) / np.sqrt(2.0)  # points with the first three moments of a standard normal law
_LEAST_SHARE = 0.1  # least attenuation, as in radcal.calibration.incidence_error.attenuation
_LOOKS_TABLE = 200
_KNOWN = 1e-6  # prior information on the level of a bin [1/dB^2]: practically none


@dataclass(frozen=True)
class Unknowns:
    """Values of the unknowns besides X, at m points of the posterior.

    Attributes
    ----------
    looks : ndarray, shape (m,)
        Effective looks in the first pass.
    between_db, within_db : ndarray, shape (m,)
        Standard deviations between and within fields [dB].
    incidence, point_spread : ndarray, shape (m,)
        Standard normal deviates: of the logarithm of the standard error of the incidence, and of the relative error of
        the resolutions.
    """

    looks: Doubles
    between_db: Doubles
    within_db: Doubles
    incidence: Doubles
    point_spread: Doubles


class Evidence:
    """Likelihood of the incidence-angle bins of one material in one pass.

    The likelihood is normal in the means, log standard deviations and skewnesses of all bins. The covariance of bins is
    the sum of that of :class:`radcal.calibration.misfit.BinMisfit`, of the variances of the level and of the noise
    floor, and of the variance of the surrogate. The covariance depends on the unknowns, so that its
    determinant is part of the likelihood.

    Parameters
    ----------
    part : Objective
        Objective of the material in the pass.
    budget : Budget
        Uncertainty budget: standard errors of level, noise floor, incidence and resolutions.
    sensor : float
        Looks of the sensor in the first pass.
    """

    def __init__(self, part: Objective, budget: Budget, sensor: float) -> None:
        self.part, self.budget = part, budget
        compared = part.compared()
        self.compared, self.size = compared, len(compared.statistics)
        material = part.material
        self.decibels = material.decibels
        self.curve = material.law.has_curve and material.decibels
        misfit = BinMisfit.of(compared.ground, compared.classes, compared.method, Spread(0.0, 0.0))
        self._measured = compared.statistics.T.ravel()
        n = self.size
        self._patches = misfit.patch_share @ misfit.patch_share.T
        self._cells = misfit.cell_share @ misfit.cell_share.T
        self._log_sds = misfit.log_sds
        self._inside = [1.0 - (share**2).sum(axis=1) for share in (misfit.patch_share, misfit.cell_share)]
        if self.decibels:
            self._base = misfit.covariance.copy()
            self._base[:n, :n] += budget.level_db**2
            power_db = compared.statistics[:, 0] - log_speckle_cumulants(material.looks)[0]
            of_noise = budget.noise_errors_db(power_db, material.target.noise_db)
            self._base[:n, :n] += np.multiply.outer(of_noise, of_noise)
            self._spread = _spread_table(compared.ground)
        else:  # values of normalised images: covariance of the moments of a normal sample
            self._base = np.diag((part.scale.T.ravel() ** 2) / np.repeat(compared.classes.effective, 3))
            self._spread = np.zeros((GRID_DB.size, GRID_DB.size))
        nodes = part.expected.nodes_deg if part.expected is not None else compared.classes.nodes_deg
        self._nodes, self._few = np.ascontiguousarray(nodes), np.ascontiguousarray(nodes[:, _EVERY // 2 :: _EVERY])
        mapped = compared.ground.incidence_deg
        self._mean_deg, self._variance = float(mapped.mean()), max(float(np.var(mapped)), 1e-12)
        self._stated = np.broadcast_to(np.asarray(compared.method.incidence_error_deg, dtype=np.float64), (n,))
        self._rms = np.sqrt(np.mean(self._stated**2, keepdims=True))
        if compared.ground.error_deg is not None:  # each pixel has a standard error of its own
            square, classes = compared.ground.error_deg**2, compared.classes
            self._stated = np.sqrt(np.bincount(classes.member, square, n) / classes.count)
            self._rms = np.sqrt(np.mean(square, keepdims=True))
        self._looks = _looks_table(sensor, material.looks)
        self.has_baseline = part.expected is not None

    def baseline(self, levels_db: Doubles) -> Doubles:
        """Statistics of n bins by law, speckle and noise alone, shape (m, n, 3), from m curves, shape (m, 361)."""
        expected = self.part.expected
        assert expected is not None  # noqa: S101
        cumulants = cumulants_at(levels_db, self._nodes * PER_DEG, float(expected.noise_db))
        return from_cumulants(cumulants + log_speckle_cumulants(expected.looks))

    def _shift(self, levels_db: Doubles, unknowns: Unknowns) -> Doubles:
        """Change of the cumulants of n bins by errors of the incidence and of the resolutions, shape (m, n, 3)."""
        error = self.budget.incidence_error_deg(self._stated, unknowns.incidence)
        # same formula as in radcal.calibration.incidence_error.attenuation
        rms = self.budget.incidence_error_deg(self._rms, unknowns.incidence)
        of_true = np.maximum(self._variance - rms**2, _LEAST_SHARE * self._variance)
        share = np.maximum(of_true / (of_true + error**2), _LEAST_SHARE)
        slope = share * self.budget.steepening(unknowns.point_spread)[:, None]
        spread = error * np.sqrt(share) * PER_DEG
        return shifted_cumulants(levels_db, self._few * PER_DEG, self._mean_deg * PER_DEG, slope, spread, _HERMITE)

    def difference(self, simulated: Doubles, levels_db: Doubles | None, unknowns: Unknowns) -> Doubles:
        """Expected minus measured means, log standard deviations and skewnesses, shape (m, 3 n)."""
        cumulants = to_cumulants(simulated)
        found = cumulants
        if self.decibels:
            here = np.exp(np.interp(np.log(unknowns.looks), *self._looks))
            nominal = log_speckle_cumulants(self.part.material.looks)
            found = cumulants + (log_speckle_cumulants(here) - nominal)[:, None]
            if levels_db is not None and self.curve:
                found = found + self._shift(levels_db, unknowns)
            fields = np.multiply.outer(unknowns.between_db**2, self._inside[0])
            fields = fields + np.multiply.outer(unknowns.within_db**2, self._inside[1])
            found[..., 1] = np.maximum(found[..., 1] + fields, 1e-3 * cumulants[..., 1])
        return np.asarray(np.swapaxes(from_cumulants(found), 1, 2).reshape(len(found), -1) - self._measured)

    def whitened(self, difference: Doubles, error: Doubles, unknowns: Unknowns) -> tuple[Doubles, Doubles]:
        """Differences whitened by their covariance, and half the logarithm of the determinant of this covariance.

        Parameters
        ----------
        difference : ndarray, shape (m, 3 n)
            Expected minus measured statistics, as :meth:`difference` returns them.
        error : ndarray, shape (m, 3)
            Standard errors of the mean, log standard deviation and skewness that the surrogate predicts.
        unknowns : Unknowns
            Unknowns besides X at the m points.

        Returns
        -------
        ndarray, shape (m, 3 n)
        ndarray, shape (m,)
        """
        fields = (tau**2 if self.decibels else 0.0 * tau for tau in (unknowns.between_db, unknowns.within_db))
        between, within = fields
        return whitened(difference, self._base, between, self._patches, within, self._cells, self._log_sds, error)

    def log_likelihood(self, simulated: Doubles, error: Doubles, levels_db: Doubles | None, at: Unknowns) -> Doubles:
        """Log likelihood of the statistics of the bins and of the differences between cells of one bin, shape (m,)."""
        residuals, determinant = self.whitened(self.difference(simulated, levels_db, at), error, at)
        return np.asarray(-0.5 * (residuals**2).sum(axis=1) - determinant + self._of_fields(at))

    def _of_fields(self, at: Unknowns) -> Doubles:
        """Log likelihood of the standard deviations between and within fields, interpolated in a table, shape (m,)."""
        places = [np.interp(tau, GRID_DB, np.arange(GRID_DB.size)) for tau in (at.between_db, at.within_db)]
        first, second = (np.minimum(place.astype(np.intp), GRID_DB.size - 2) for place in places)
        a, b = places[0] - first, places[1] - second
        t = self._spread
        low = (1.0 - b) * t[first, second] + b * t[first, second + 1]
        high = (1.0 - b) * t[first + 1, second] + b * t[first + 1, second + 1]
        return np.asarray((1.0 - a) * low + a * high)


def _spread_table(ground: Ground) -> Doubles:
    """Log likelihood of the standard deviations between and within fields, on the grid ``GRID_DB`` of both.

    Each bin has a free level in place of the law, so that only differences between cells of one bin determine these
    standard deviations. The differences between cells are independent of the means of the bins, which enter the rest of
    the likelihood, and a wrong law does not affect them.
    """
    edges = incidence_edges(ground.incidence_deg, "auto")
    member, cells = class_of(ground.incidence_deg, edges), ground.cells
    slopes = cells.mean((member[:, None] == np.arange(len(edges) - 1)).astype(np.float64))
    data = Residuals(
        cells.mean(ground.values_db), ground.sampling, cells.patch, slopes, _KNOWN * np.eye(slopes.shape[1])
    )
    table = spread_log_likelihood(data)
    return np.asarray(table - table.max())


def _looks_table(first: float, here: float) -> tuple[Doubles, Doubles]:
    """Logarithms of the effective looks of one texture in the first pass and in another pass, for interpolation."""
    log = np.linspace(np.log(0.1), np.log(2.0 * first), _LOOKS_TABLE)
    return log, np.array([np.log(equal_texture(first, float(looks), here)) for looks in np.exp(log)])
