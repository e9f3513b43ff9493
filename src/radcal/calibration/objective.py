"""What is minimised: residuals of a material's classes against what is expected of them.

Three objectives, one class each. All take the expected cumulants of the classes and give a vector of
residuals in standard deviations, whose sum of squares is minimised.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.measurement.classes import Classes
from radcal.measurement.looks import looks_of_log_variance

__all__ = ["SKEWNESS_SHAPE", "ClassesObjective", "DensityObjective", "LikelihoodObjective", "sampling_covariance"]

# a skewness says which law texture follows as much as it says the backscatter law: the gamma law of 2.5 looks has
# -0.69 in dB, the K distribution of 4 looks with the same variance -0.36
SKEWNESS_SHAPE = 0.3
_LOG_SD_PATCH = 0.1  # texture differs between patches: looks by some 20 %
_BIN_DB = 0.5
_LEVELS = 8  # that stand for a class


def sampling_covariance(variance_db2: float, effective: float) -> NDArray[np.float64]:
    """Covariance of sample mean, log sd and skewness of log-gamma values.

    Parameters
    ----------
    variance_db2 : float
        Variance of the values [dB^2]; the gamma law of so many looks is taken for their shape.
    effective : float
        Number of independent values.

    Returns
    -------
    ndarray, shape (3, 3)
        To first order in 1/n: mean [dB], natural log of the standard deviation, skewness.

    References
    ----------
    Stuart and Ord, "Kendall's Advanced Theory of Statistics", vol. 1, 6th edition (1994), section 12.16:
    covariances of k-statistics in terms of cumulants.
    """
    from scipy.special import polygamma

    looks = looks_of_log_variance(variance_db2)
    sd = float(np.sqrt(polygamma(1, looks)))
    # standardised cumulants of orders 3 to 6
    _, _, _, c3, c4, c5, c6 = (0.0 if r < 3 else float(polygamma(r - 1, looks)) / sd**r for r in range(7))
    k = np.array(
        [
            [1.0, c3, c4],
            [c3, c4 + 2.0, c5 + 6.0 * c3],
            [c4, c5 + 6.0 * c3, c6 + 9.0 * c4 + 9.0 * c3**2 + 6.0],
        ]
    )
    to = np.array([[np.sqrt(variance_db2), 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, -1.5 * c3, 1.0]])
    return np.asarray(to @ k @ to.T / effective)


def _statistics(cumulants: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulants to mean, log sd and skewness, all means first, shape (3 n,)."""
    mean, variance, third = cumulants.T
    return np.concatenate([mean, 0.5 * np.log(variance), third / variance**1.5])


@dataclass(frozen=True)
class ClassesObjective:
    """Mean, spread and skewness of each class of incidence, weighted by their inverse covariance.

    The covariance is the sampling's at the effective sample size, plus that of the patches and cells which
    the classes share: a patch that lies in all classes moves all their means alike and says no less of
    the slope. A skewness common to all classes has a standard deviation of 0.3 besides (the shape of
    texture).

    Attributes
    ----------
    classes : Classes
        Measured.
    patch_share : ndarray, shape (n, patches)
        Share of each class's pixels in each patch.
    cell_share : ndarray, shape (n, cells)
        The same for cells.
    between_db, within_db : float
        Standard deviations of patches and of their cells [dB].
    """

    classes: Classes
    patch_share: NDArray[np.float64]
    cell_share: NDArray[np.float64]
    between_db: float
    within_db: float

    @property
    def patch_variance(self) -> NDArray[np.float64]:
        """Expected variance among the patches and cells inside of each class [dB^2], shape (n,)."""
        inside = [1.0 - (share**2).sum(axis=1) for share in (self.patch_share, self.cell_share)]
        return np.asarray(self.between_db**2 * inside[0] + self.within_db**2 * inside[1])

    @cached_property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of all means, then all log sds, then all skewnesses, shape (3 n, 3 n)."""
        n = self.classes.size
        whole = np.zeros((3, n, 3, n))
        for k in range(n):
            whole[:, k, :, k] = sampling_covariance(self.classes.cumulants[k, 1], self.classes.effective[k])
        patches = self.patch_share @ self.patch_share.T
        whole[0, :, 0, :] += self.between_db**2 * patches + self.within_db**2 * self.cell_share @ self.cell_share.T
        whole[1, :, 1, :] += _LOG_SD_PATCH**2 * patches
        whole[2, :, 2, :] += SKEWNESS_SHAPE**2
        return whole.reshape(3 * n, 3 * n)

    @cached_property
    def _whitening(self) -> NDArray[np.float64]:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))

    @cached_property
    def _measured(self) -> NDArray[np.float64]:
        return _statistics(self.classes.cumulants)

    def residuals(self, expected: NDArray[np.float64]) -> NDArray[np.float64]:
        """Independent residuals of unit variance, shape (3 n,), of expected cumulants, shape (n, 3)."""
        return np.asarray(self._whitening @ (_statistics(expected) - self._measured))


@dataclass(frozen=True)
class LikelihoodObjective:
    """Gamma likelihood of the pixels of each class, tempered by effective over nominal sample size.

    Pixels are counted in bins of 0.5 dB: the deviance residuals of the counts have the binned likelihood
    as sum of squares. A class's law is the mixture, over its angles, of gamma speckle of the material's
    looks. Patches are not part of it.

    Attributes
    ----------
    classes : Classes
        Measured.
    values_db : ndarray, shape (pixels,)
        The pixels behind them [dB].

    References
    ----------
    McCullagh and Nelder, "Generalized Linear Models", 2nd edition (1989), section 2.4: deviance residuals.
    """

    classes: Classes
    values_db: NDArray[np.float64]

    @cached_property
    def _bins(self) -> NDArray[np.float64]:
        low, high = float(self.values_db.min()), float(self.values_db.max())
        return np.arange(np.floor(low / _BIN_DB), np.ceil(high / _BIN_DB) + 1.0) * _BIN_DB

    @cached_property
    def _counts(self) -> NDArray[np.float64]:
        """Tempered counts, shape (n, bins); the first and last bins reach to infinity."""
        place = np.clip(np.searchsorted(self._bins, self.values_db, side="right") - 1, 0, self._bins.size - 2)
        joint = np.bincount(self.classes.member * (self._bins.size - 1) + place, minlength=self._places)
        temper = self.classes.effective / self.classes.count
        return np.asarray(joint.reshape(self.classes.size, -1) * temper[:, None])

    @property
    def _places(self) -> int:
        return self.classes.size * (self._bins.size - 1)

    def residuals(self, level_db: NDArray[np.float64], looks: float) -> NDArray[np.float64]:
        """Deviance residuals.

        Parameters
        ----------
        level_db : ndarray, shape (n, m)
            Levels that stand for each class, of power [dB].
        looks : float
            Effective looks of the material.

        Returns
        -------
        ndarray, shape (n * bins,)
        """
        from scipy.special import gammainc

        levels = np.sort(level_db, axis=1)
        if levels.shape[1] % _LEVELS == 0:
            levels = levels.reshape(len(levels), _LEVELS, -1).mean(axis=2)
        below = gammainc(looks, looks * 10.0 ** ((self._bins[1:-1] - levels[..., None]) / 10.0)).mean(axis=1)
        ends = np.zeros((self.classes.size, 1))
        share = np.diff(np.concatenate([ends, below, ends + 1.0], axis=1), axis=1)
        observed = self._counts
        wanted = np.maximum(share, 1e-12) * observed.sum(axis=1, keepdims=True)
        log = np.log(np.where(observed > 0.0, observed, 1.0) / wanted)
        deviance = 2.0 * (np.where(observed > 0.0, observed * log, 0.0) - (observed - wanted))
        return np.asarray((np.sign(observed - wanted) * np.sqrt(np.maximum(deviance, 0.0))).ravel())


@dataclass(frozen=True)
class DensityObjective:
    """Differences in (mean, log sd, skewness) of the one density of all pixels, the paper's objective.

    Scaled as in :class:`radcal.calibration.infill.Search`: where they vanish, so does the density rms.

    Attributes
    ----------
    target_cp : array_like, shape (3,)
        Mean [dB], standard deviation [dB] and skewness of the target.
    effective : float
        Independent pixels behind it.
    """

    target_cp: ArrayLike
    effective: float

    def residuals(self, expected: NDArray[np.float64]) -> NDArray[np.float64]:
        """Three residuals of the expected cumulants of one class, shape (1, 3)."""
        mean, sd, skewness = np.asarray(self.target_cp, dtype=np.float64)
        difference = _statistics(expected) - np.array([mean, np.log(sd), skewness])
        return np.asarray(difference / np.array([sd, np.sqrt(0.5), np.sqrt(6.0)]) * np.sqrt(self.effective))
