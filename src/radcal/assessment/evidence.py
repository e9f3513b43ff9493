"""What the bins of one pass say of a law: log likelihood of many X, looks and errors at once."""

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

_EVERY = 3  # of the angles that stand for a bin: enough for the change by an error of the incidence
_HERMITE = (np.arange(5) - 2.0) / np.sqrt(2.0)  # points of a normal law with its first three moments
_LEAST_SHARE = 0.1  # as radcal.calibration.incidence_error.attenuation has it
_LOOKS_TABLE = 200
_KNOWN = 1e-6  # inverse variance of levels that nothing is known of


@dataclass(frozen=True)
class Unknowns:
    """Unknowns at m points besides X.

    Attributes
    ----------
    looks : ndarray, shape (m,)
        Effective looks in the first pass.
    between_db, within_db : ndarray, shape (m,)
        Standard deviations between and within fields [dB].
    incidence, point_spread : ndarray, shape (m,)
        Standard normal deviates of the error of the incidence and of the resolutions.
    """

    looks: Doubles
    between_db: Doubles
    within_db: Doubles
    incidence: Doubles
    point_spread: Doubles


class Evidence:
    """Likelihood of the bins of one material in one pass.

    Normal in mean, log sd and skewness of all bins. The covariance is that of
    :class:`radcal.calibration.misfit.BinMisfit` with the level's variance, which is common to all means, and with the
    error of the surrogate; its log-determinant counts, because it depends on the unknowns.

    Parameters
    ----------
    part : Objective
        Of the pass.
    budget : Budget
        Standard errors.
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
        else:  # values of normalised images: the moments of a normal sample
            self._base = np.diag((part.scale.T.ravel() ** 2) / np.repeat(compared.classes.effective, 3))
            self._spread = np.zeros((GRID_DB.size, GRID_DB.size))
        nodes = part.expected.nodes_deg if part.expected is not None else compared.classes.nodes_deg
        self._nodes, self._few = np.ascontiguousarray(nodes), np.ascontiguousarray(nodes[:, _EVERY // 2 :: _EVERY])
        mapped = compared.ground.incidence_deg
        self._mean_deg, self._variance = float(mapped.mean()), max(float(np.var(mapped)), 1e-12)
        self._stated = np.broadcast_to(np.asarray(compared.method.incidence_error_deg, dtype=np.float64), (n,))
        self._rms = np.sqrt(np.mean(self._stated**2, keepdims=True))
        if compared.ground.error_deg is not None:  # pixels have errors of their own
            square, classes = compared.ground.error_deg**2, compared.classes
            self._stated = np.sqrt(np.bincount(classes.member, square, n) / classes.count)
            self._rms = np.sqrt(np.mean(square, keepdims=True))
        self._looks = _looks_table(sensor, material.looks)
        self.has_baseline = part.expected is not None

    def baseline(self, levels_db: Doubles) -> Doubles:
        """Statistics that law, speckle and noise have, from curves (m, 361) to (m, n, 3)."""
        expected = self.part.expected
        assert expected is not None  # noqa: S101
        cumulants = cumulants_at(levels_db, self._nodes * PER_DEG, float(expected.noise_db))
        return from_cumulants(cumulants + log_speckle_cumulants(expected.looks))

    def _shift(self, levels_db: Doubles, unknowns: Unknowns) -> Doubles:
        """Change of the cumulants by the errors of incidence and resolution, shape (m, n, 3)."""
        error = self.budget.incidence_error_deg(self._stated, unknowns.incidence)
        # as radcal.calibration.incidence_error.attenuation has it
        rms = self.budget.incidence_error_deg(self._rms, unknowns.incidence)
        of_true = np.maximum(self._variance - rms**2, _LEAST_SHARE * self._variance)
        share = np.maximum(of_true / (of_true + error**2), _LEAST_SHARE)
        slope = share * self.budget.steepening(unknowns.point_spread)[:, None]
        spread = error * np.sqrt(share) * PER_DEG
        return shifted_cumulants(levels_db, self._few * PER_DEG, self._mean_deg * PER_DEG, slope, spread, _HERMITE)

    def difference(self, simulated: Doubles, levels_db: Doubles | None, unknowns: Unknowns) -> Doubles:
        """Expected minus measured statistics, all means, log sds and skewnesses: (m, n, 3) to (m, 3 n)."""
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
        """Differences in standard deviations, and the logarithm of their covariance's determinant, halved.

        Parameters
        ----------
        difference : ndarray, shape (m, 3 n)
            As :meth:`difference` returns it.
        error : ndarray, shape (m, 3)
            Standard errors of the surrogate.
        unknowns : Unknowns
            At m points.

        Returns
        -------
        ndarray, shape (m, 3 n)
        ndarray, shape (m,)
        """
        fields = (tau**2 if self.decibels else 0.0 * tau for tau in (unknowns.between_db, unknowns.within_db))
        between, within = fields
        return whitened(difference, self._base, between, self._patches, within, self._cells, self._log_sds, error)

    def log_likelihood(self, simulated: Doubles, error: Doubles, levels_db: Doubles | None, at: Unknowns) -> Doubles:
        """Log likelihood of the bins and, of the fields' standard deviations, of the cells inside bins, shape (m,)."""
        residuals, determinant = self.whitened(self.difference(simulated, levels_db, at), error, at)
        return np.asarray(-0.5 * (residuals**2).sum(axis=1) - determinant + self._of_fields(at))

    def _of_fields(self, at: Unknowns) -> Doubles:
        """Log likelihood of the fields' standard deviations, interpolated in its table."""
        places = [np.interp(tau, GRID_DB, np.arange(GRID_DB.size)) for tau in (at.between_db, at.within_db)]
        first, second = (np.minimum(place.astype(np.intp), GRID_DB.size - 2) for place in places)
        a, b = places[0] - first, places[1] - second
        t = self._spread
        low = (1.0 - b) * t[first, second] + b * t[first, second + 1]
        high = (1.0 - b) * t[first + 1, second] + b * t[first + 1, second + 1]
        return np.asarray((1.0 - a) * low + a * high)


def _spread_table(ground: Ground) -> Doubles:
    """Log likelihood of the fields' standard deviations from cells that share a bin, on the grid of both.

    A free level of each bin takes the place of the law: these contrasts know of no law that might be wrong. They are
    independent of the means of the bins, which the rest of the likelihood is about, as far as the bins share the fields
    alike (``docs/uncertainty.md`` says what it costs that they do not).
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
    """Logarithms of the looks in the first pass and in this one, for interpolation."""
    log = np.linspace(np.log(0.1), np.log(2.0 * first), _LOOKS_TABLE)
    return log, np.array([np.log(equal_texture(first, float(looks), here)) for looks in np.exp(log)])
