"""Misfit of measured pixels and expected statistics: residuals in standard deviations, of two kinds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.expected import expected_cumulants, law_cumulants
from radcal.calibration.incidence_error import ErrorKind, attenuation, true_nodes
from radcal.calibration.moments import from_cumulants, sampled_statistics, sampling_covariance
from radcal.measurement.classes import Classes, class_of
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread
from radcal.radar.laws import Law
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["SKEWNESS_SHAPE", "BinMisfit", "LikelihoodMisfit", "Method", "Misfit", "true_angles"]

# a skewness says which law texture follows as much as it says the backscatter law: the gamma law of 2.5 looks has
# -0.69 in dB, the K distribution of 4 looks with the same variance -0.36
SKEWNESS_SHAPE = 0.3
_LOG_SD_PATCH = 0.1  # texture differs between patches: looks by some 20 %
_BIN_DB = 0.5
_LEVELS = 8  # that represent a bin
Doubles = NDArray[np.float64]


class Misfit(ABC):
    """Misfit of one material; ``of_fields`` says whether the variance between fields is part of it."""

    of_fields: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> Misfit:
        """Misfit of a material's pixels in their incidence-angle bins, fitted with a method."""

    @abstractmethod
    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Residuals of unit variance.

        Parameters
        ----------
        parameters : ndarray, shape (d,)
            X.
        looks : float
            Effective number of looks of the material.
        simulated : ndarray, shape (n, 3)
            Mean [dB], variance [dB^2] and third central moment [dB^3] of each bin at the sensor's looks.
        slack : ndarray, shape (n, 3), or 0
            By how much mean [dB], log sd and skewness may be moved to the measured ones.

        Returns
        -------
        ndarray, shape (k,)
        """


@dataclass(frozen=True)
class BinMisfit(Misfit):
    """Mean, log sd and skewness of each incidence-angle bin, weighted by their inverse covariance.

    The covariance is that of sampling, whose pixels are correlated inside of bins and between them, plus that of the
    fields and cells that the bins share: a field that lies in all bins moves all their means alike, and says no less of
    the slope. A few fields have another variance among them than they have in the mean, which moves the log sds. A
    skewness common to all bins has a standard deviation of 0.3 besides (the shape of texture).

    Attributes
    ----------
    classes : Classes
        Measured.
    patch_share : ndarray, shape (n, patches)
        Share of each bin's pixels in each field.
    cell_share : ndarray, shape (n, cells)
        The same for cells.
    patch_of_cell : ndarray of int, shape (cells,)
        Column of each cell's field in ``patch_share``.
    between_db, within_db : float
        Between-field and within-field standard deviation [dB].
    method : Method, optional
        Law and error of the incidence, which moves what is expected.
    true_deg : ndarray, shape (n, k), optional
        True angles behind the mapped ones [deg].
    patches : ndarray of int, shape (patches,), optional
        Label of each field, by which it is known in other passes.
    """

    classes: Classes
    patch_share: Doubles
    cell_share: Doubles
    patch_of_cell: NDArray[np.int64]
    between_db: float
    within_db: float
    method: Method | None = None
    true_deg: Doubles | None = None
    patches: NDArray[np.int64] | None = None

    of_fields: ClassVar[bool] = True

    @classmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> BinMisfit:
        """Misfit of a material's pixels in their incidence-angle bins, fitted with a method."""
        cells = ground.cells
        patches, patch = np.unique(cells.patch, return_inverse=True)
        shares = classes.shares(patch[cells.of_pixel], int(patch.max()) + 1)
        by_cell = classes.shares(cells.of_pixel, cells.count.size)
        true_deg = true_angles(ground, classes, method, classes.nodes_deg)
        return cls(classes, shares, by_cell, patch, spread.between, spread.within, method, true_deg, patches)

    @property
    def patch_variance(self) -> Doubles:
        """Expected variance among the patches and cells inside of each class [dB^2], shape (n,)."""
        inside = [1.0 - (share**2).sum(axis=1) for share in (self.patch_share, self.cell_share)]
        return np.asarray(self.between_db**2 * inside[0] + self.within_db**2 * inside[1])

    @cached_property
    def log_sds(self) -> Doubles:
        """Covariance of the log sds by the variance that few fields and cells happen to have among them.

        The variance of a bin holds u' S u of the effects u of its cells, with S = diag(s) - s s' and the cells' shares
        s. Its covariance with that of another bin is 2 tr(S_i G S_j G) for effects of the covariance G, here between^2
        for two cells of one field, plus within^2 for a cell and itself.

        Returns
        -------
        ndarray, shape (2, 2, n, n)
            To be multiplied with between^2 or within^2 twice.

        References
        ----------
        Searle, Casella and McCulloch, "Variance Components" (1992), appendix S.5: covariance of quadratic forms.
        """
        cells, patches = self.cell_share, self.patch_share
        field = patches[:, self.patch_of_cell]
        both = cells[:, None] * cells  # (n, n, cells)
        one = cells @ cells.T
        alone = both.sum(axis=-1) - (both * cells[:, None]).sum(axis=-1) - (both * cells).sum(axis=-1) + one**2
        mixed = both.sum(axis=-1) - (both * field[:, None]).sum(axis=-1) - (both * field).sum(axis=-1)
        mixed += one * (patches @ patches.T)
        shared = patches[:, None] * patches
        whole = shared.sum(axis=-1) - (shared * patches[:, None]).sum(axis=-1) - (shared * patches).sum(axis=-1)
        whole += (patches @ patches.T) ** 2
        variance = self.classes.cumulants[:, 1]
        # d log sd = d variance / (2 variance)
        return np.array([[whole, mixed], [mixed, alone]]) * 2.0 / (4.0 * np.multiply.outer(variance, variance))

    @cached_property
    def _order(self) -> Doubles:
        """Statistics of each bin as sums over orthogonal polynomials of order 1, 2 and 3, shape (n, 3, 3)."""
        each = zip(self.classes.speckle_db2, self._levels_db2, strict=True)
        return np.linalg.cholesky(np.stack([sampling_covariance(v, 1.0, of_levels) for v, of_levels in each]))

    @property
    def _levels_db2(self) -> Doubles:
        """Variance of the levels inside of each bin [dB^2], shape (n,)."""
        return self.classes.cumulants[:, 1] - self.classes.speckle_db2

    @cached_property
    def sampling(self) -> Doubles:
        """Covariance of all means, log sds and skewnesses by speckle alone, shape (3 n, 3 n).

        The correlations of two pixels' orthogonal polynomials of order 1, 2 and 3 are the pixels' correlation, its
        square and its cube: exactly so for normal values, and within some percent for log-gamma ones.
        """
        whole = np.einsum("iak,jbk,kij->aibj", self._order, self._order, self.classes.pairs)
        return np.asarray(whole.reshape(3 * self.classes.size, -1))

    @cached_property
    def covariance(self) -> Doubles:
        """Covariance of all means, then all log sds, then all skewnesses, shape (3 n, 3 n)."""
        n = self.classes.size
        whole = self.sampling.reshape(3, n, 3, n).copy()
        patches = self.patch_share @ self.patch_share.T
        whole[0, :, 0, :] += self.between_db**2 * patches + self.within_db**2 * self.cell_share @ self.cell_share.T
        whole[1, :, 1, :] += _LOG_SD_PATCH**2 * patches
        tau2 = np.array([self.between_db, self.within_db]) ** 2
        whole[1, :, 1, :] += np.einsum("a,b,abij->ij", tau2, tau2, self.log_sds)
        whole[2, :, 2, :] += SKEWNESS_SHAPE**2
        return whole.reshape(3 * n, 3 * n)

    @cached_property
    def _root(self) -> Doubles:
        return np.asarray(np.linalg.cholesky(self.covariance))

    @cached_property
    def _whitening(self) -> Doubles:
        return np.asarray(np.linalg.inv(self._root))

    def whitened(self, differences: Doubles) -> Doubles:
        """Residuals from expected minus measured mean [dB], log sd and skewness, (..., n, 3) to (..., 3 n)."""
        return np.swapaxes(differences, -1, -2).reshape(*differences.shape[:-2], -1) @ self._whitening.T

    def differences(self, residuals: Doubles) -> Doubles:
        """The inverse of :meth:`whitened`, (..., 3 n) to (..., n, 3)."""
        return np.swapaxes((residuals @ self._root.T).reshape(*residuals.shape[:-1], 3, -1), -1, -2)

    def replicates(self, count: int, rng: np.random.Generator) -> Doubles:
        """Residuals of samples that the expected statistics describe, shape (count, 3 n).

        Each bin is drawn anew, with as many log-gamma values as its effective sample size, and so are the effects of
        fields and cells and the shape of texture: whatever :attr:`covariance` holds, without its normal law. The bins'
        samples are independent, and are then given the covariance that sampling has between bins.
        """
        n = self.classes.size
        # each bin by itself has the covariance that its effective sample size gives it; the root of both is triangular
        alone = np.zeros((3, n, 3, n))
        for k in range(n):
            alone[:, k, :, k] = np.linalg.inv(self._order[k]) * np.sqrt(self.classes.effective[k])
        together = np.linalg.cholesky(self.sampling) @ alone.reshape(3 * n, 3 * n)
        found = np.empty((count, 3, n))
        for k in range(n):
            speckle, levels = self.classes.speckle_db2[k], self._levels_db2[k]
            found[:, :, k] = sampled_statistics(speckle, self.classes.effective[k], count, rng, levels)
        found = (found.reshape(count, 3 * n) @ together.T).reshape(count, 3, n)
        fields, cells = (share.shape[1] for share in (self.patch_share, self.cell_share))
        effects = self.between_db * rng.normal(size=(count, fields))
        found[:, 1] += _LOG_SD_PATCH * rng.normal(size=(count, fields)) @ self.patch_share.T
        effects = effects[:, self.patch_of_cell] + self.within_db * rng.normal(size=(count, cells))
        means = effects @ self.cell_share.T
        found[:, 0] += means
        variance = effects**2 @ self.cell_share.T - means**2
        measured = self.classes.cumulants[:, 1]
        found[:, 1] += (variance - self.patch_variance) / (2.0 * measured)
        found[:, 2] += SKEWNESS_SHAPE * rng.normal(size=(count, 1))
        return self.whitened(np.swapaxes(found, 1, 2))

    def _shift(self, x: Doubles) -> Doubles | float:
        """Change of the cumulants by the error of the incidence."""
        m = self.method
        mapped = self.classes.nodes_deg
        if m is None or not m.law.has_curve or self.true_deg is None or self.true_deg.shape == mapped.shape:  # no error
            return 0.0
        return law_cumulants(m.law, x, self.true_deg) - law_cumulants(m.law, x, mapped)

    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Whitened differences of all means, log sds and skewnesses, shape (3 n,)."""
        sensor = looks if self.method is None else self.method.looks
        expected = expected_cumulants(simulated, sensor, looks, self.patch_variance, self._shift(parameters))
        difference = from_cumulants(expected) - from_cumulants(self.classes.cumulants)
        return self.whitened(difference - np.clip(difference, -np.asarray(slack), slack))


@dataclass(frozen=True)
class LikelihoodMisfit(Misfit):
    """Gamma likelihood of the pixels of each bin, tempered by effective over nominal sample size.

    Pixels are counted in bins of 0.5 dB: the deviance residuals of the counts have the binned likelihood
    as sum of squares. The law of a bin is the mixture, over its angles, of gamma speckle of the material's
    looks. Fields are not part of it.

    Attributes
    ----------
    classes : Classes
        Measured.
    values_db : ndarray, shape (pixels,)
        The pixels behind them [dB].
    method : Method, optional
        Law.
    true_deg : ndarray, shape (n, k), optional
        True angles behind the mapped ones [deg].

    References
    ----------
    McCullagh and Nelder, "Generalized Linear Models", 2nd edition (1989), section 2.4: deviance residuals.
    """

    classes: Classes
    values_db: Doubles
    method: Method | None = None
    true_deg: Doubles | None = None

    @classmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> LikelihoodMisfit:
        """Misfit of a material's pixels in their incidence-angle bins, fitted with a method."""
        return cls(classes, ground.values_db, method, true_angles(ground, classes, method, classes.nodes_deg))

    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Deviance residuals of the law's levels, moved to the simulated mean of each bin; no slack is used."""
        m = self.method
        assert m is not None  # noqa: S101
        assert self.true_deg is not None  # noqa: S101
        levels = m.law(np.radians(self.true_deg), parameters)
        # the simulator's mean, not the law's: it knows the area of facets, the noise, the neighbours
        mean = simulated[:, 0] - log_speckle_cumulants(m.looks)[0]
        moved = mean[:, None] - law_cumulants(m.law, parameters, self.classes.nodes_deg)[:, :1]
        return self.residuals(levels + moved, looks)

    @cached_property
    def _bins(self) -> Doubles:
        low, high = float(self.values_db.min()), float(self.values_db.max())
        return np.arange(np.floor(low / _BIN_DB), np.ceil(high / _BIN_DB) + 1.0) * _BIN_DB

    @cached_property
    def _counts(self) -> Doubles:
        """Tempered counts, shape (n, bins); the first and last bins reach to infinity."""
        place = np.clip(np.searchsorted(self._bins, self.values_db, side="right") - 1, 0, self._bins.size - 2)
        width = self._bins.size - 1
        joint = np.bincount(self.classes.member * width + place, minlength=self.classes.size * width)
        # pixels of other bins, which are correlated with a bin's own, count with them
        with_others = self.classes.count * (self.classes.pairs[0] @ self.classes.count)
        temper = self.classes.count / with_others
        return np.asarray(joint.reshape(self.classes.size, -1) * temper[:, None])

    def residuals(self, level_db: Doubles, looks: float) -> Doubles:
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
class Method:
    """How a material's law is fitted.

    Attributes
    ----------
    law : Law
        With a curve, unless runs are what is fitted.
    bounds : array_like, shape (d, 2)
        Box of X.
    looks : float
        Of the sensor.
    misfit : type of Misfit
        What is minimised.
    classes : int or 'auto'
        Number of incidence-angle bins.
    free_looks : bool
        Whether the effective looks are searched.
    priors : bool
        Weak priors on curve and looks.
    incidence_error_deg : float
        Standard deviation of the error of the local incidence [deg].
    incidence_error : {'classical', 'berkson'}
        Its kind.
    """

    law: Law
    bounds: ArrayLike
    looks: float
    misfit: type[Misfit] = BinMisfit
    classes: int | Literal["auto"] = "auto"
    free_looks: bool = True
    priors: bool = True
    incidence_error_deg: float = 0.0
    incidence_error: ErrorKind = "classical"


def true_angles(ground: Ground, classes: Classes, method: Method, nodes_deg: Doubles) -> Doubles:
    """True angles behind mapped ones of a material.

    Parameters
    ----------
    ground : Ground
        Pixels of the material; where they have errors of their own, each bin has the root mean square of its pixels'.
    classes : Classes
        Bins of the same pixels.
    method : Method
        Kind of the error, and its size where one number holds for all pixels.
    nodes_deg : ndarray, shape (n, m)
        Mapped angles [deg], those of a row in one bin.

    Returns
    -------
    ndarray, shape (n, k)
        Angles [deg], equally likely each.
    """
    mapped, error, rms = ground.incidence_deg, np.asarray(method.incidence_error_deg), None
    if ground.error_deg is not None:
        square = ground.error_deg**2
        each = np.sqrt(np.bincount(classes.member, square, classes.size) / classes.count)
        error, rms = each[class_of(nodes_deg.mean(axis=1), classes.edges_deg)], float(np.sqrt(square.mean()))
    share = attenuation(mapped, error, rms)
    return true_nodes(nodes_deg, error, method.incidence_error, float(mapped.mean()), share)
