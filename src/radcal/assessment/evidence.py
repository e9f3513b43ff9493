"""Log likelihood of the statistics of the bins of all passes, for many X, looks and errors at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from radcal.assessment.budget import Budget
from radcal.assessment.compiled_bins import cumulants_at, shifted_cumulants, whitened
from radcal.assessment.curves import PER_DEG
from radcal.calibration.incidence_error import LEAST_SHARE
from radcal.calibration.misfit import BinMisfit
from radcal.calibration.moments import from_cumulants, to_cumulants
from radcal.calibration.objectives.objective import Objective
from radcal.calibration.shared_fields import together
from radcal.measurement.field_spread import spread_table
from radcal.measurement.patches import GRID_DB, Spread
from radcal.radar.texture import equal_texture, log_speckle_cumulants

__all__ = ["Evidence", "Unknowns"]

Doubles = NDArray[np.float64]

_EVERY = 3  # of the angles that stand for a bin: enough for the change by an error of the incidence
_HERMITE = (np.arange(5) - 2.0) / np.sqrt(2.0)  # points of a normal law with its first three moments
_LOOKS_TABLE = 200


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


class _Pass:
    """Expected statistics of the bins of one material in one pass, and variances of their errors.

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
        self.misfit = misfit
        self._inside = [1.0 - (share**2).sum(axis=1) for share in (misfit.patch_share, misfit.cell_share)]
        nodes = part.expected.nodes_deg if part.expected is not None else compared.classes.nodes_deg
        self._nodes, self._few = np.ascontiguousarray(nodes), np.ascontiguousarray(nodes[:, _EVERY // 2 :: _EVERY])
        mapped = compared.ground.incidence_deg
        self._mean_deg, self._variance = float(mapped.mean()), max(float(np.var(mapped)), 1e-12)
        self._stated = np.broadcast_to(np.asarray(compared.method.incidence_error_deg, dtype=np.float64), (self.size,))
        self._rms = np.sqrt(np.mean(self._stated**2, keepdims=True))
        if compared.ground.error_deg is not None:  # each pixel has a standard error of its own
            square, classes = compared.ground.error_deg**2, compared.classes
            self._stated = np.sqrt(np.bincount(classes.member, square, self.size) / classes.count)
            self._rms = np.sqrt(np.mean(square, keepdims=True))
        self._looks = _looks_table(sensor, material.looks)
        self.has_baseline = part.expected is not None

    @property
    def of_level(self) -> Doubles:
        """Covariance of the means of n bins by errors of the image level and the noise floor, shape (n, n) [dB^2]."""
        material = self.part.material
        power_db = self.compared.statistics[:, 0] - log_speckle_cumulants(material.looks)[0]
        of_noise = self.budget.noise_errors_db(power_db, material.target.noise_db)
        return np.asarray(self.budget.level_db**2 + np.multiply.outer(of_noise, of_noise))

    @property
    def of_sample(self) -> Doubles:
        """Variances of mean, log sd and skewness of normal samples, shape (n, 3); used for normalised images."""
        return np.asarray(self.part.scale**2 / self.compared.classes.effective[:, None])

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
        of_true = np.maximum(self._variance - rms**2, LEAST_SHARE * self._variance)
        share = np.maximum(of_true / (of_true + error**2), LEAST_SHARE)
        slope = share * self.budget.steepening(unknowns.point_spread)[:, None]
        spread = error * np.sqrt(share) * PER_DEG
        return shifted_cumulants(levels_db, self._few * PER_DEG, self._mean_deg * PER_DEG, slope, spread, _HERMITE)

    def difference(self, simulated: Doubles, levels_db: Doubles | None, unknowns: Unknowns) -> Doubles:
        """Expected minus measured statistics of n bins at m points, shape (m, n, 3).

        The expected statistics are the simulated statistics, corrected for looks, effects of fields, and the errors of
        incidence and resolutions. The curves ``levels_db`` have the shape (m, 361).
        """
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
        return np.asarray(from_cumulants(found) - self.compared.statistics)


class Evidence:
    """Likelihood of the incidence-angle bins of one material in all passes.

    The likelihood is normal in the means, log standard deviations and skewnesses of all bins. The covariance is the sum
    of three parts: the covariance of :class:`radcal.calibration.misfit.BinMisfit`, in which passes share the effects of
    their fields (:func:`radcal.calibration.shared_fields.together`); the variances of the level and the noise floor of
    each pass; and the variance of the surrogate. The covariance depends on the unknowns, so that the
    determinant of the covariance is part of the likelihood.

    Parameters
    ----------
    parts : sequence of Objective
        Objective of each pass.
    budgets : sequence of Budget
        Uncertainty budget of each pass.
    sensor : float
        Looks of the sensor in the first pass.
    """

    def __init__(self, parts: Sequence[Objective], budgets: Sequence[Budget], sensor: float) -> None:
        self.passes = [_Pass(part, budget, sensor) for part, budget in zip(parts, budgets, strict=True)]
        self.compared, self.decibels = self.passes[0].compared, self.passes[0].decibels
        self._ends = np.cumsum([one.size for one in self.passes])
        n = self.size = int(self._ends[-1])
        misfit = together([one.misfit for one in self.passes])
        self._patches = misfit.patch_share @ misfit.patch_share.T
        self._cells = misfit.cell_share @ misfit.cell_share.T
        self._log_sds = misfit.log_sds
        if self.decibels:
            self._base = misfit.covariance.copy()
            self._base[:n, :n] += block_diag(*(one.of_level for one in self.passes))
            self._spread = spread_table([one.compared.ground for one in self.passes])
        else:
            self._base = np.diag(np.concatenate([one.of_sample for one in self.passes]).T.ravel())
            self._spread = np.zeros((GRID_DB.size, GRID_DB.size))

    @property
    def has_baseline(self) -> bool:
        """Whether the objective of every pass has a baseline."""
        return all(one.has_baseline for one in self.passes)

    def baseline(self, levels_db: Doubles) -> Doubles:
        """Statistics of n bins by law, speckle and noise alone, shape (m, n, 3), from m curves, shape (m, 361)."""
        return np.concatenate([one.baseline(levels_db) for one in self.passes], axis=1)

    def difference(self, simulated: Doubles, levels_db: Doubles | None, unknowns: Unknowns) -> Doubles:
        """Expected minus measured statistics at m points, shape (m, 3 n): means, then log sds, then skewnesses."""
        each = zip(self.passes, np.split(simulated, self._ends[:-1], axis=1), strict=True)
        found = np.concatenate([one.difference(own, levels_db, unknowns) for one, own in each], axis=1)
        return np.ascontiguousarray(np.swapaxes(found, 1, 2)).reshape(len(found), -1)

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


def _looks_table(first: float, here: float) -> tuple[Doubles, Doubles]:
    """Logarithms of the effective looks of one texture in the first pass and in another pass, for interpolation."""
    log = np.linspace(np.log(0.1), np.log(2.0 * first), _LOOKS_TABLE)
    return log, np.array([np.log(equal_texture(first, float(looks), here)) for looks in np.exp(log)])
